"""What the tests of the coupled heart share: models, compiled kernels and FMUs, built once a session."""

from __future__ import annotations

import functools
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from tubular_dea.cosim.beats import BeatError, r_wave_rows
from tubular_dea.cosim.heart_assist import COUPLING, fmus, rest_stretch
from tubular_dea.cosim.master import Run
from tubular_dea.cosim.system import Connection, System
from tubular_dea.kernel import Kernel, Trajectory
from tubular_dea.model.compose import compose
from tubular_dea.model.dea import tubular_dea
from tubular_dea.model.windkessel import aortic_windkessel, patient
from tubular_dea.protocol import Protocol

PERIOD = 0.8  # s, 75 beats a minute
WIRES = [(c.source, c.target) for c in COUPLING]
CASES = {
    "healthy": ("healthy", {}),
    "failing": ("failing", {}),
    "stiff": ("stiff", {}),
    "stiff, 2 elements": ("stiff", {"elements": 2.0}),
}


def needs(package: str) -> None:
    """Skip without a package that is only for comparison; fail in CI, whose task is to have it."""
    try:
        __import__(package)
    except ImportError as problem:
        if "CI" in os.environ:
            pytest.fail(f"{package} is missing: {problem}")
        pytest.skip(f"the package {package} is not installed")


@functools.cache
def slaves() -> dict[str, Path]:
    """Native FMI 2 FMUs of the three parts."""
    return fmus(Path(tempfile.mkdtemp(prefix="slaves-")))


@functools.cache
def monolith() -> Kernel:
    """Tube and heart as one system of equations."""
    return Kernel(compose("AssistedHeart", {"tube": tubular_dea(), "heart": aortic_windkessel()}, WIRES))


def case(name: str) -> dict[str, float]:
    """The patient set of a case."""
    base, changes = CASES[name]
    return patient(base, changes)


@functools.cache
def stretch(pressure: float) -> float:
    """The tube's stretch at rest."""
    return rest_stretch(pressure)


def pulses(beats: int, voltage: float, ramp: float = 0.02) -> Protocol:
    """Voltage on in each systole, with ramps; switching times fall between communication points."""
    time, values = [0.0], [0.0]
    for beat in range(beats):
        on, off = beat * PERIOD + 0.0503, beat * PERIOD + 0.3307
        time += [on, on + ramp, off, off + ramp]
        values += [0.0, voltage, voltage, 0.0]
    return Protocol.of([*time, beats * PERIOD], voltage=[*values, 0.0])


def reference(values: dict[str, float], drive: Protocol, times: np.ndarray) -> Trajectory:
    """The monolithic solution, to 1e-10."""
    parameters = {f"heart_{n}": v for n, v in values.items()}
    parameters["tube_lambda_2_start"] = stretch(values["aortic_pressure_start"])
    protocol = Protocol(drive.time, {"tube_voltage": drive.inputs["voltage"]})
    return monolith().simulate(protocol, times, parameters, tolerance=1e-10)


def driven_tube(
    slaves: Mapping[str, Path],
    patient: Mapping[str, float],
    voltage: Protocol,
    settings: Mapping[str, float] | None = None,
) -> System:
    """Tube and heart without a scheduler, under a known `voltage`."""
    parameters = {f"heart.{name}": value for name, value in patient.items()}
    parameters |= {"tube.start_at_equilibrium": 1.0, **(settings or {})}
    wires = [*COUPLING, Connection("drive.voltage", "tube.voltage")]
    pair = {part: slaves[part] for part in ("tube", "heart")}
    return System(pair, wires, {"drive": voltage}, parameters, ("heart.next_r_wave",))


def last_beats(run: Run, n: int = 1) -> slice:
    """The rows of the last `n` whole beats, both R waves included."""
    rows = r_wave_rows(run)
    if rows.size < n + 1:
        raise BeatError(f"expected a run of at least {n} whole beats but it has {max(0, rows.size - 1)}; run it longer")
    return slice(int(rows[-1 - n]), int(rows[-1]) + 1)


def tube_work(run: Run, rows: slice | None = None) -> tuple[float, float]:
    """Work [J] the windkessel has given to the tube, and work the tube has received by its own pressure and volume.

    The first is integrated inside the windkessel. The second is p dV, step by step, from the pressure the tube was
    given and the volume and flow it reports at both ends (a trapezoid with end correction, of fourth order).
    """
    rows = rows or slice(0, run.time.size)
    h = np.diff(run.time[rows])
    p, volume, flow = (run[name][rows] for name in ("heart.aortic_pressure", "tube.tube_volume", "tube.tube_flow"))
    slope = np.diff(p) / h
    integral = h / 2 * (volume[1:] + volume[:-1]) + h**2 / 12 * (flow[:-1] - flow[1:])
    received = float(np.sum(p[1:] * volume[1:] - p[:-1] * volume[:-1] - slope * integral))
    given = float(run["heart.tube_work"][rows][-1] - run["heart.tube_work"][rows][0])
    return given, received
