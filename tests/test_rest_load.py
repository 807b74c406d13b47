"""A closed circuit rests under a small load: what its monitor shows there need not be the monitor's zero."""

from __future__ import annotations

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.identify.study.nuisances import left_of
from tubular_dea.identify.study.study import PRIOR, study
from tubular_dea.plants.tube import PLANT

RATE, LONG, REST = 100.0, 20.0, 100.0  # samples per second, s, Pa


def recorded(number: int, first: float, noise: float = 10e-6) -> dict[str, np.ndarray]:
    """A tube at equilibrium under the pressure `first` [Pa], then under levels of pressure and voltage."""
    random, time = np.random.default_rng(number), np.arange(int(RATE * LONG)) / RATE
    at = np.sort(random.uniform(2, LONG - 1, 7))
    ends = np.column_stack([at, at + 0.2]).ravel()
    pressure = np.interp(time, ends, np.repeat(np.append(first, random.uniform(6e3, 12e3, 7)), 2)[1:-1])
    voltage = np.interp(time, ends, np.repeat(np.append(0.0, random.uniform(1e3, 4.5e3, 7)), 2)[1:-1])
    values = {"start_at_equilibrium": 1.0, "C_1": 330e3}
    run = td.Kernel(PLANT.model).simulate(td.Protocol.of(time, pressure=pressure, voltage=voltage), time, values)
    read = run["measured_displacement"] + noise * random.standard_normal(time.size)
    monitored = pressure + 5 * random.standard_normal(time.size)
    return {"time [s]": time, "pressure [Pa]": monitored, "voltage [V]": voltage, "displacement [m]": read}


def recordings(rest: float = REST) -> td.RecordingSet:
    return td.read_recordings({"rest": recorded(0, rest), "load 1": recorded(1, 9e3), "load 2": recorded(2, 8e3)})


def test_what_a_monitor_shows_at_rest_may_be_a_load_as_well() -> None:
    """The plant begins at equilibrium with it, and as much of it is left open; a file under load shows none."""
    work = study(recordings(), (), PRIOR)
    rest, loaded = work.pieces[:2]
    assert rest.case.own["start_at_equilibrium"] == 1.0
    taken = rest.driven.zeros["pressure"]
    assert taken == pytest.approx(REST, abs=10)
    assert left_of(work, rest, "pressure") * work.zero("pressure") == pytest.approx(taken)
    assert left_of(work, loaded, "pressure") == 1.0


@pytest.mark.parametrize("rest", [REST, 2 * REST])
def test_a_small_load_at_rest_is_no_effect(rest: float) -> None:
    """Taken for a zero, it was ambiguous with a prestretch."""
    found = td.discover(recordings(rest))
    assert found.verdict == "no_effect"
    low, high = found.parameters["C_1"].ci95
    assert low < 330e3 < high
