"""Model exchange in a host that holds inputs over its steps, as FMPy does: where they change, its solver starts anew.

Without that CVode meets a jump of the derivatives, takes it for its own error, and ends with the smallest step.
"""

from __future__ import annotations

import ctypes
from pathlib import Path

import fmpy
import numpy as np
import pytest

from drivers import ME, Host


def recorded(pulsed: bool) -> np.ndarray:
    """Pressure that moves as in an artery, with pulses of voltage or without."""
    time = np.arange(0, 1.5, 0.01)
    pressure = 12e3 + 2e3 * np.sin(2 * np.pi * 1.2 * time)
    rows = zip(time, pressure, 5500.0 * (pulsed & (time % 0.83 < 0.3)), strict=True)
    return np.array(list(rows), [("time", float), ("pressure", float), ("voltage", float)])


@pytest.mark.parametrize("pulsed", [False, True], ids=["pressure", "pulses"])
def test_fmpy_integrates_the_model_itself(fmu: Path, pulsed: bool) -> None:
    def run(kind: str, every: float) -> np.ndarray:
        start = {"start_at_equilibrium": True}
        return fmpy.simulate_fmu(
            str(fmu), fmi_type=kind, input=recorded(pulsed), output_interval=every, start_values=start, stop_time=1.4
        )

    exact = run("CoSimulation", 1e-3)
    found = run("ModelExchange", 1e-3)
    expected = np.interp(found["time"], exact["time"], exact["lambda_2"])
    assert np.abs(found["lambda_2"] - expected).max() < 1e-6
    assert np.isfinite(run("ModelExchange", 1e-2)["lambda_2"]).all()  # coarse: what it holds, it still integrates


def _asked(host: Host) -> bool:
    flag = ctypes.c_int if host.version == 2 else ctypes.c_bool
    event, ends = flag(), flag()
    host.call("CompletedIntegratorStep", 1, ctypes.byref(event), ctypes.byref(ends))
    return bool(event.value)


def _evaluate(host: Host) -> None:
    name = "GetDerivatives" if host.version == 2 else "GetContinuousStateDerivatives"
    host.call(name, (ctypes.c_double * 4)(), 4)


def test_an_event_is_asked_for_where_held_inputs_change(fmu: Path) -> None:
    with Host(fmu, ME) as host:
        host.initialize()
        for pressure, changes in ((0.0, False), (100.0, True), (100.0, False), (200.0, True)):
            _evaluate(host)
            host.set(pressure=pressure)
            assert _asked(host) == changes


def test_no_event_is_asked_for_where_inputs_move_within_steps(fmu: Path) -> None:
    with Host(fmu, ME) as host:
        host.initialize()
        for step in range(4):
            for stage in (0.0, 0.5, 1.0):
                host.set(pressure=100.0 * (step + stage))
                _evaluate(host)
            host.set(pressure=100.0 * (step + 1.5))  # an explicit method ends elsewhere than where it asked last
            assert not _asked(host)
