"""A constant added to an input, as its monitor's zero is: from nothing it comes within some samples."""

from __future__ import annotations

import numpy as np

from tubular_dea.identify.fitting.cases import Case, Reading
from tubular_dea.identify.records.start import FIRST_SAMPLES
from tubular_dea.identify.study.monitor_uncertainty import INPUT_STEP, shifted
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
