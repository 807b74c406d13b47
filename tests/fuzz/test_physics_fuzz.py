"""Random tubes over and beyond the physical envelope: each agrees with a tight run, or ends in an error that says why.

The physical ones among them are held against `independent.py`, too. Short by default, longer by
`pytest tests/fuzz --fuzz-cases 1000000 --fuzz-seed 7`. The driver, and what it stops at, is in physics_fuzz.c.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import independent as tube
from hosts.beside_sources import compile_driver
from tubular_dea.model.declare import Model

SOURCE = Path(__file__).parent / "physics_fuzz.c"
FLAGS = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"]
MAX_STEPS = 20000  # internal steps of one doStep, so that absurd tubes cost milliseconds
SHOWN = 5  # cases for the independent solver
TOLERATED = 30  # tolerances, as in the driver
NOMINAL = np.array([1.0, 10.0, 1e5, 1e5])


@pytest.mark.long
@pytest.mark.skipif(not shutil.which("gcc"), reason="the driver is compiled by gcc")
def test_random_tubes_agree_or_say_why(
    model: Model, tmp_path: Path, request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    cases, seed = request.config.getoption("--fuzz-cases"), request.config.getoption("--fuzz-seed")
    fuzzer = compile_driver(model, 2, [SOURCE], [*FLAGS, f"-DMAX_STEPS={MAX_STEPS}"], tmp_path)
    command = [str(fuzzer), str(cases), str(seed), str(4 * SHOWN)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    told = [line for line in lines if not line.startswith("case ")]
    assert " 0 agree" not in told[0], "the physical envelope was not covered"
    worst = _check_independently([line for line in lines if line.startswith("case ")])
    with capsys.disabled():
        print("\n" + "\n".join(told) + f"\nagainst the independent solver: {SHOWN} cases, worst {worst:.3g} tolerances")


def _check_independently(lines: list[str]) -> float:
    """The worst distance of the tight runs that start at lambda_2_start from `independent.py`, in tolerances."""
    cases = [case for case in map(_read, lines) if not case["parameters"]["start_at_equilibrium"]][:SHOWN]
    assert len(cases) == SHOWN
    return max(map(_distance, cases))


def _read(line: str) -> dict:
    """A case as the driver prints it: parameters, steps (size, pressure, its rate, voltage, its rate), states."""
    case: dict = {"parameters": {}, "step": [], "x": []}
    for name, _, text in (word.partition("=") for word in line.split()[1:]):
        values = [float(v) for v in text.split(",")]
        if name in ("step", "x"):
            case[name].append(values if name == "step" else values[0])
        else:
            case["parameters"][name] = values[0]
    return case


def _distance(case: dict) -> float:
    """How many tolerances the tight run is off Radau's solution of the equations written by hand."""
    protocol: dict[str, list[float]] = {"time": [], "pressure": [], "voltage": []}
    time = 0.0
    for size, pressure, pressure_rate, voltage, voltage_rate in case["step"]:
        for t in (0.0, size):
            protocol["time"].append(time + t)
            protocol["pressure"].append(pressure + pressure_rate * t)
            protocol["voltage"].append(voltage + voltage_rate * t)
        time += size
    par = tube.PARAMETERS | case["parameters"]
    found = tube.trajectory(protocol, [time], par, (par["lambda_2_start"], 0.0, 0.0, 0.0))
    x = np.array([found[name][-1] for name in ("lambda_2", "lambda_2_rate", "sigma_vis1", "sigma_vis2")])
    off = float(np.max(np.abs(x - case["x"]) / (par["tolerance"] * (NOMINAL + np.abs(x)))))
    assert off <= TOLERATED, case
    return off
