"""An output that takes no part in fits shows what the model does not have, where next to nothing flows as it has it."""

from __future__ import annotations

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.discover.options.options import fitted_option
from tubular_dea.discover.search.second_output import missed
from tubular_dea.identify.study.study import PRIOR, study
from tubular_dea.plants.tube import PLANT

CURRENT = 1.5e-6  # A, noise of the monitor


def recorded(leak: float, rise: float) -> dict[str, np.ndarray]:
    """Steps of voltage of `rise` [s], with a resistance of 5 kV / `leak` [A] beside the tube."""
    time = np.arange(4000) / 500.0
    voltage = np.interp(time % 2, [0, 0.5, 0.5 + rise, 1.5, 1.5 + rise, 2], [0, 0, 5e3, 5e3, 0, 0])
    pressure = np.full(time.size, 10e3)
    drive = td.Protocol.of(time, pressure=pressure, voltage=voltage)
    run = td.Kernel(PLANT.model).simulate(drive, time, {"start_at_equilibrium": 1.0})
    random = np.random.default_rng(3)
    return {
        "time [s]": time,
        "pressure [Pa]": pressure + random.normal(0, 15.0, time.size),
        "voltage [V]": voltage,
        "displacement [m]": run["measured_displacement"] + random.normal(0, 10e-6, time.size),
        "current [A]": run["current"] + leak * voltage / 5e3 + random.normal(0, CURRENT, time.size),
    }


@pytest.mark.parametrize("rise", [0.05, 0.004], ids=["slow", "of two samples"])
@pytest.mark.parametrize("leak", [0.0, 20e-6], ids=["tight", "leaking"])
def test_a_leakage_is_missed(leak: float, rise: float) -> None:
    """A judge's tube leaked 40 uA at 5 kV: nothing in its radius, and "nothing is missing" was the answer."""
    work = study(td.read_recordings({"steps": recorded(leak, rise)}), [], PRIOR)
    chosen = fitted_option(work, (), PLANT.model.parameter_values(), ())
    assert chosen is not None
    found = missed(work, chosen)
    if leak == 0:
        assert found is None
    else:
        assert found is not None and (found.output, found.piece) == ("current", "steps")
        assert found.value == pytest.approx(leak / 2, rel=0.1)  # half of the time it is on
