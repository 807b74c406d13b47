"""Time of a 1 ms step in a heart beat: the native FMU from a C host, the pythonfmu FMU, and a slave on SciPy's LSODA.

    python tests/benchmarks/do_step.py            # two beats, three rounds in turn, the best of each
    python tests/benchmarks/do_step.py --beats 5

The native FMU is stepped by tests/hosts/fmi2_host.c (set inputs, step, get the displacement). The others are driven
by FMPy in this process with the same inputs. `solve_ivp` is how such a slave is usually written; `odeint` is SciPy's
fastest way to LSODA. At the same tolerance ours is more accurate by far, so it is run at one of like error as well;
errors are the largest in lambda_2, against our FMU at 1e-11.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from contextlib import redirect_stdout
from dataclasses import dataclass
from math import pi, sin
from pathlib import Path
from time import perf_counter

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from pythonfmu import FmuBuilder

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from hosts.compile import compile_host, time_host
from tubular_dea.export.package import native_fmu
from tubular_dea.export.python_fmu import python_fmu
from tubular_dea.model.dea import MMHG, tubular_dea

HERE = Path(__file__).resolve().parent
STEP = 1e-3  # s
BEAT = 0.8  # s


@dataclass(frozen=True)
class Contender:
    """An FMU, and what it is run with."""

    name: str
    path: Path
    tolerance: float
    interface: int | None = None  # of the LSODA slave


def beat(time: float) -> list[float]:
    """Pressure [Pa] around 95 mmHg from 0.2 s on, and 5 kV [V] during the systole."""
    phase = time % BEAT / BEAT
    pressure = (95 + 15 * sin(2 * pi * phase) + 5 * sin(4 * pi * phase)) * MMHG * min(1.0, time / 0.2)
    rise, fall = (phase - 0.1) / 0.03, (0.45 - phase) / 0.03
    return [pressure, 5000.0 * max(0.0, min(1.0, rise, fall))]


def build(folder: Path) -> list[Contender]:
    """Our FMU, and the LSODA slave by stock pythonfmu."""
    ours = python_fmu(tubular_dea(), folder / "TubularDEA.fmu")
    with redirect_stdout(None):
        theirs = FmuBuilder.build_FMU(
            HERE / "lsoda_slave.py",
            folder / "LsodaTube.fmu",
            [HERE.parent / "independent.py"],
            needsExecutionTool=False,
        )
    return [
        Contender("reference", ours, 1e-11),
        Contender("ours", ours, 1e-6),
        Contender("LSODA by solve_ivp", theirs, 1e-6, 0),
        Contender("LSODA by odeint", theirs, 1e-6, 1),
        Contender("ours, like error", ours, 1e-4),
    ]


def run(contender: Contender, steps: int) -> tuple[float, np.ndarray]:
    """Mean seconds per doStep, and lambda_2 after each."""
    description = fmpy.read_model_description(str(contender.path), validate=False)
    reference = {v.name: v.valueReference for v in description.modelVariables}
    inputs, output = [reference["pressure"], reference["voltage"]], [reference["lambda_2"]]
    folder = fmpy.extract(str(contender.path))
    fmu = FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        instanceName="tube",
        modelIdentifier=description.coSimulation.modelIdentifier,
    )
    fmu.instantiate()
    if contender.interface is not None:
        fmu.setInteger([reference["interface"]], [contender.interface])
    fmu.setupExperiment(tolerance=contender.tolerance)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    seconds, values = 0.0, []
    for i in range(steps):
        fmu.setReal(inputs, beat(i * STEP))
        begin = perf_counter()
        fmu.doStep(i * STEP, STEP)
        seconds += perf_counter() - begin
        values += fmu.getReal(output)
    fmu.freeInstance()
    shutil.rmtree(folder, ignore_errors=True)
    return seconds / steps, np.array(values)


def compare(beats: int, rounds: int = 3) -> dict[str, tuple[float, float]]:
    """Best mean time per step [s] and largest error in lambda_2 of each, measured in turn."""
    steps = round(beats * BEAT / STEP)
    with tempfile.TemporaryDirectory() as folder:
        reference, *contenders = build(Path(folder))
        _, exact = run(reference, steps)
        results = [[run(c, steps) for c in contenders] for _ in range(rounds)]
    return {
        c.name: (min(seconds for seconds, _ in found), float(np.abs(found[0][1] - exact).max()))
        for c, found in zip(contenders, zip(*results, strict=True), strict=True)
    }


def native(beats: int) -> float:
    """Seconds per step of the native FMU in the C host, best of twenty runs."""
    grid = STEP * np.arange(round(beats * BEAT / STEP) + 1)
    inputs = np.array([[time, *beat(time)] for time in grid])
    with tempfile.TemporaryDirectory() as folder:
        fmu = native_fmu(tubular_dea(), 2, Path(folder) / "TubularDEA.fmu")
        return 1e-9 * time_host(compile_host("host", Path(folder)), fmu, inputs, ["radial_displacement"], 20)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--beats", type=int, default=2, help="beats of 0.8 s to simulate (default: 2)")
    beats = parser.parse_args().beats
    in_c = native(beats)
    best = compare(beats)
    ours = best["ours"][0]
    print(f"{'':20}{'mean time of a 1 ms doStep':>28}{'ratio':>8}{'error':>10}")
    print(f"{'native, C host':20}{in_c * 1e6:>25.2f} us{in_c / ours:>8.4f}")
    for name, (seconds, error) in best.items():
        print(f"{name:20}{seconds * 1e6:>25.0f} us{seconds / ours:>8.2f}{error:>10.0e}")


if __name__ == "__main__":
    main()
