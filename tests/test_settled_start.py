"""Files that begin under load: a slow effect that states of their own would follow is found from equilibrium."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import tubular_dea as td
from test_adjust import FREE, TRUTH, set_of
from tubular_dea.discover import engine
from tubular_dea.identify.records.experiment import UNKNOWN
from tubular_dea.identify.study.adjust import adjusted
from tubular_dea.plants.tube import PLANT

RATE, LONG = 50.0, 40.0  # samples per second, s
BY_CHANCE = 20.0  # squares by which answers may differ


def levels(random: np.random.Generator, time: np.ndarray, low: float, high: float) -> np.ndarray:
    """Eight levels with ramps of 0.2 s between them."""
    at = np.sort(random.uniform(1, LONG - 1, 7))
    return np.interp(time, np.column_stack([at, at + 0.2]).ravel(), np.repeat(random.uniform(low, high, 8), 2)[1:-1])


def loaded(number: int, drift: float, before: float = 0.0) -> dict[str, np.ndarray]:
    """A tube whose C_1 drifts by `drift` [1/s], from equilibrium; `before` [s] at the beginning are not recorded."""
    random, time = np.random.default_rng(number), np.arange(int(RATE * LONG)) / RATE
    pressure, voltage = levels(random, time, 8e3, 12e3), levels(random, time, 1e3, 4.5e3)
    kernel = td.Kernel(PLANT.catalogue["stiffness_drift"](td.tube()))
    values = {"start_at_equilibrium": 1.0, "C_1": 330e3, "stiffness_drift": drift}
    run = kernel.simulate(td.Protocol.of(time, pressure=pressure, voltage=voltage), time, values)
    read = run["measured_displacement"] + 10e-6 * random.standard_normal(time.size)
    table = {"time [s]": time, "pressure [Pa]": pressure, "voltage [V]": voltage, "displacement [m]": read}
    return {name: column[time >= before] for name, column in table.items()}


def searched(drift: float, before: float = 0.0) -> td.DiscoveryResult:
    recordings = td.read_recordings({f"file {n}": loaded(n, drift, before) for n in range(3)})
    assert all(e.start == UNKNOWN for e in recordings.experiments)
    return td.discover(recordings)


@pytest.mark.long
@pytest.mark.parametrize("drift", [5e-5, 0.002])
def test_a_drift_is_no_start_under_load(drift: float) -> None:
    """A faint one would hide in the starts, and a strong one in a branch that relaxes from one of its own."""
    found = searched(drift)
    assert [e.id for e in found.effects] == ["stiffness_drift"]
    rate = found.effects[0].parameters["stiffness_drift"]
    assert rate.value == pytest.approx(drift, abs=4 * rate.stderr)


def test_files_cut_from_a_longer_run_keep_states_of_their_own() -> None:
    found = searched(0.0, before=14.0)
    assert found.verdict == "no_effect"
    assert all(p.loose for p in found.discovery.study.pieces)


def test_what_leaves_more_of_the_records_is_not_as_close_however_little_they_weigh() -> None:
    """A start in the middle of a beat was an equilibrium beside a stop and a viscosity, that left twice the error: more
    was taken for the noise of the pressure's monitor."""
    study = adjusted(set_of(np.zeros(4)), (), TRUTH, FREE)
    light = study.weighted([0.3 * p.weight for p in study.pieces])

    def answer(study: object, **values: float) -> SimpleNamespace:
        fitted = SimpleNamespace(values=TRUTH | values)
        return SimpleNamespace(study=study, chosen=SimpleNamespace(ids=(), fitted=fitted))

    found = answer(study)
    assert engine._as_close(found, answer(light), BY_CHANCE)
    assert engine._as_close(found, answer(light, tau=1.001 * TRUTH["tau"]), BY_CHANCE)
    assert not engine._as_close(found, answer(light, tau=1.01 * TRUTH["tau"]), BY_CHANCE)
    assert engine._as_close(answer(study, tau=1.01 * TRUTH["tau"]), found, BY_CHANCE)
