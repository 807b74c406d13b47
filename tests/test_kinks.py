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
