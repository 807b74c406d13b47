"""Jumps of what the model leaves are told where nothing drives them, and nowhere else."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from scipy.signal import lfilter

from tubular_dea.discover.answer import remarks
from tubular_dea.discover.answer.jumps import Jumps, driven, jumped
from tubular_dea.discover.engine import Discovery
from tubular_dea.plants.tube import PLANT
from tubular_dea.protocol import Protocol

OUTPUT = "measured_displacement"
TIME = np.arange(7500) / 300
ANSWER = 1e-3 * np.sin(2 * TIME)
NOISE = 9e-6 * lfilter([np.sqrt(1 - 0.3**2)], [1, -0.3], np.random.default_rng(4).standard_normal(TIME.size))


def test_what_lets_go_is_told_when_it_does() -> None:
    """A clamp into which rubber creeps, and that lets go: "unexplained", and what differs between the files?"""
    slipped, left = [1398, 2484, 5679], NOISE.copy()
    for at in slipped:
        left[at:] -= 2e-4 * np.minimum(np.arange(TIME.size - at) / 3, 1)  # within 10 ms
        left[at:] += 2e-4 * (1 - np.exp(-np.arange(TIME.size - at) / 900))  # and creeps in again
    places, by = jumped(ANSWER, left)
    assert np.abs(places - np.array(slipped)).max() <= 3
    assert by == pytest.approx(-2e-4, rel=0.25)


@pytest.mark.parametrize("what", ["noise", "spikes", "edges", "ringing"])
def test_nothing_is_told_of(what: str) -> None:
    answer, left = ANSWER.copy(), NOISE.copy()
    if what == "spikes":
        left[[700, 2100]] += 3e-4
    if what == "edges":  # of which the model misses a part
        answer[3000:] += 1e-3
        left[3000:] += 2e-4
    if what == "ringing":
        left += 2e-4 * np.sin(60 * TIME)
    assert not jumped(answer, left)[0].size


def test_where_an_input_steps_it_drives_what_jumps() -> None:
    """A load that stepped while the wire stood still: did something slip?"""
    times = np.arange(0, 10, 0.05)
    load = Protocol(np.array([0.0, 4.017, 4.017, 10.0]), {"load": np.array([4.0, 4.0, 9.0, 9.2])})
    moving = driven(load, times)
    assert moving[[80, 81]].all()
    assert np.flatnonzero(moving).min() >= 77 and np.flatnonzero(moving).max() <= 84


def test_when_it_jumps_is_said_of_every_file() -> None:
    told = [Jumps("M1", OUTPUT, (4.66, 8.277, 11.26, 15.92, 18.9, 21.9), 2.16e-4), Jumps("M2", OUTPUT, (6.35,), 1e-4)]
    (said,) = remarks._jumping(cast(Discovery, SimpleNamespace(study=SimpleNamespace(plant=PLANT))), told)
    assert "by up to 216 um: in M1 at 4.66, 8.277, 11.26, 15.92 s and 2 times more, M2 at 6.35 s. Did" in said
    assert remarks._jumping(cast(Discovery, None), []) == []
