"""Corners of a continuous input between its samples, and what samples do not tell."""

from __future__ import annotations

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.identify.inputs.drive import drive
from tubular_dea.identify.records.experiment import Experiment

STEP, NOISE = 0.02, 10.0  # s, Pa
PRESSURE = [s for s in td.load_plant("tube").inputs if s.name == "pressure"]


def recorded(knots: list[tuple[float, float]], noise: float = NOISE) -> Experiment:
    """Straight lines between `knots` (time [s], pressure [Pa]), sampled at 50 Hz."""
    time = np.arange(0, knots[-1][0] + 1e-9, STEP)
    pressure = np.interp(time, *np.transpose(knots)) + noise * np.random.default_rng(1).standard_normal(time.size)
    return Experiment("made up", time, {"pressure": pressure}, {}, np.arange(time.size))


@pytest.mark.parametrize("part", [0.05, 0.3, 0.5, 0.7, 0.95])
def test_a_ramp_begins_between_two_samples(part: float) -> None:
    knots = [(0.0, 6000.0), (1 + part * STEP, 6000.0), (1.5 + part * STEP, 14000.0), (3.0, 14000.0)]
    found = drive(recorded(knots), PRESSURE)
    fine = np.linspace(0.9, 1.7, 2000)
    error = np.interp(fine, found.lines["pressure"].time, found.lines["pressure"].values)
    error -= np.interp(fine, *np.transpose(knots))
    assert np.abs(error).max() < 2.5 * NOISE  # from sample to sample it would be up to 80 Pa
    assert not found.untold


def test_a_step_of_one_sample_is_untold_and_a_slow_ramp_is_not() -> None:
    knots = [(0.0, 6000.0), (1.007, 6000.0), (1.027, 12000.0), (2.0, 12000.0), (2.3, 6000.0), (3.0, 6000.0)]
    found = drive(recorded(knots), PRESSURE)
    assert found.untold["pressure"].shape == (1, 2)
    told = found.tells(np.arange(0, 3.0, STEP))
    first = np.flatnonzero(~told)
    assert first.min() == 51
    assert 3 <= first.size <= 5


@pytest.mark.parametrize("long", [1.6, 2.4, 3.3, 4.4, 5.5])  # steps
def test_a_short_ramp_is_known_where_its_lines_meet(long: float) -> None:
    """From sample to sample it would be 1000 Pa off."""
    begins = 1 + 2 * np.arange(12) + STEP * np.linspace(0.05, 0.95, 12)
    knots = [(0.0, 6000.0)]
    for k, begin in enumerate(begins):
        levels = (6000.0, 12000.0) if k % 2 == 0 else (12000.0, 6000.0)
        knots += [(begin, levels[0]), (begin + long * STEP, levels[1])]
    found = drive(recorded([*knots, (26.0, 6000.0)]), PRESSURE)
    fine = np.linspace(0.5, 25.5, 50_001)
    error = np.interp(fine, found.lines["pressure"].time, found.lines["pressure"].values)
    error -= np.interp(fine, *np.transpose(knots))
    spans = found.untold.get("pressure", np.empty((0, 2)))
    told = np.all([(fine < a - STEP) | (fine > b + STEP) for a, b in spans], axis=0)
    assert np.abs(error[told]).max(initial=0.0) < 10 * NOISE


@pytest.mark.parametrize("rate", [1.0, 2.0, 3.0, 5.0, 6.0])
def test_waves_are_told_by_their_samples(rate: float) -> None:
    time = np.arange(0, 6, STEP)
    wave = 9000 + 3000 * np.sin(2 * np.pi * rate * time)
    noisy = wave + NOISE * np.random.default_rng(2).standard_normal(time.size)
    experiment = Experiment("wave", time, {"pressure": noisy}, {}, np.arange(time.size))
    found = drive(experiment, PRESSURE)
    assert not found.untold
    fine = np.linspace(0.5, 5.5, 3000)
    error = np.interp(fine, found.lines["pressure"].time, found.lines["pressure"].values)
    error -= 9000 + 3000 * np.sin(2 * np.pi * rate * fine)
    assert np.sqrt(np.mean(error**2)) < 2 * NOISE


@pytest.mark.parametrize("constant", [0.02, 0.1, 0.4])  # s, of a valve
@pytest.mark.parametrize("backwards", [False, True])
def test_a_curve_leaves_a_level_between_two_samples(constant: float, backwards: bool) -> None:
    """From sample to sample the line would begin before the valve opens: 400 to 20 Pa too high, always to one side."""
    time, fine = np.arange(0, 40, STEP), np.linspace(0.1, 39.9, 40_000)
    begins = np.arange(1.003, 38, 2.017)

    def pressure(at: np.ndarray) -> np.ndarray:
        since = np.subtract.outer(40 - at if backwards else at, begins)
        climbed = np.where(since > 0, -np.expm1(-np.maximum(since, 0) / constant), 0.0)
        return 6000 + 4000 * (climbed * (-1.0) ** np.arange(begins.size)).sum(axis=1)

    noisy = pressure(time) + NOISE / 5 * np.random.default_rng(3).standard_normal(time.size)
    found = drive(Experiment("valve", time, {"pressure": noisy}, {}, np.arange(time.size)), PRESSURE)
    error = np.interp(fine, found.lines["pressure"].time, found.lines["pressure"].values) - pressure(fine)
    switched = 40 - begins if backwards else begins
    areas = [sign * error[np.abs(fine - t) < 2 * STEP].mean() for t, sign in zip(switched, [1, -1] * 10, strict=False)]
    assert abs(np.mean(areas)) < 3 * NOISE / 5
    assert np.count_nonzero(~found.tells(time)) < 20  # four at each of 19 before
