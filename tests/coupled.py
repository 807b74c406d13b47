"""What the tests of the coupled heart share: models, compiled kernels and FMUs, built once a session."""

from __future__ import annotations

import functools
import os
import tempfile
from pathlib import Path

import numpy as np
import pytest

from tubular_dea.cosim.heart_assist import COUPLING, fmus, rest_stretch
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
