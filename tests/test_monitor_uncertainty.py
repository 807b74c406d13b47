"""A constant added to an input, as its monitor's zero is: from nothing it comes within some samples."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from tubular_dea.identify.fitting.cases import Case, Reading
from tubular_dea.identify.records.start import FIRST_SAMPLES
from tubular_dea.identify.signals.noise import Noise
from tubular_dea.identify.study.monitor_uncertainty import INPUT_STEP, _added, shifted
from tubular_dea.protocol import Protocol

TIME = 0.01 * np.arange(100)


def added(*load: float) -> tuple[np.ndarray, float]:
    """What is added to a load at the samples, and the constant."""
    case = Case(Protocol.of([0.0, 0.5, 0.99], load=load), (Reading("reading", TIME),))
    moved, step = shifted(case, "load")
    return moved.protocol.at(TIME)["load"] - case.protocol.at(TIME)["load"], step


def test_a_constant_is_added_from_the_first_sample() -> None:
    found, step = added(1.0, 3.0, 2.0)
    assert step == 3.0 * INPUT_STEP
    np.testing.assert_allclose(found, step)


def test_where_an_input_begins_with_nothing_no_step_of_a_constant_makes_a_plant_ring() -> None:
    found, step = added(0.0, 3.0, 2.0)
    np.testing.assert_allclose(found, step * np.minimum(np.arange(100) / FIRST_SAMPLES, 1.0))


@pytest.mark.parametrize("more", [(), (Reading("second", TIME),), (Reading("second", TIME[::5]),)])
def test_an_output_that_does_not_respond_changes_nothing_of_what_a_monitor_adds(more: tuple[Reading, ...]) -> None:
    case = Case(Protocol.of(TIME[[0, -1]], load=[0.0, 0.0]), (Reading("first", TIME), *more))
    noise = dict.fromkeys(["first", "second"], Noise(1.0, 0.0))
    problem = SimpleNamespace(response=SimpleNamespace(cases=[case]), noise=noise)
    solved, gain = np.zeros((1, case.times.size)), np.zeros(case.times.size)
    solved[0, :100], gain[:100] = np.sin(TIME) / 100, 1.0
    corners = np.linspace(0, TIME[-1], 6)
    found = _added(problem, 0, solved, gain, corners)
    hats = np.column_stack([np.interp(TIME, corners, column) for column in np.eye(corners.size)])
    line = hats @ np.linalg.solve(hats.T @ hats, hats.T)  # what a line makes of the monitor's noise
    assert found[0, 0] == pytest.approx(float((solved[0, :100] @ line) @ solved[0, :100]), rel=1e-6)
