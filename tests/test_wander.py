"""Zeros of sensors that wander, and a sensor that drifts alike in every file: no cause is named for the first alone."""

from __future__ import annotations

import numpy as np
import pytest

import tubular_dea as td

RATE, LONG, FILES = 50.0, 20.0, 7  # samples per second, s


def recorded(number: int, moved: np.ndarray) -> dict[str, np.ndarray]:
    """A tube from rest, on levels of pressure and voltage with ramps of 0.2 s, read `moved` (n,) [m] too large."""
    random, time = np.random.default_rng(number), np.arange(int(RATE * LONG)) / RATE
    at = np.sort(random.uniform(1, LONG - 1, 6))
    ramps = np.column_stack([at, at + 0.2]).ravel()
    pressure = np.interp(time, ramps, np.repeat([0, *random.uniform(4e3, 13e3, 6)], 2)[1:-1])
    voltage = np.interp(time, ramps, np.repeat([0, *random.uniform(1e3, 5e3, 6)], 2)[1:-1])
    run = td.Kernel(td.tube()).simulate(td.Protocol.of(time, pressure=pressure, voltage=voltage), time, {"C_1": 330e3})
    read = run["measured_displacement"] + moved + 10e-6 * random.standard_normal(time.size)
    return {"time [s]": time, "pressure [Pa]": pressure, "voltage [V]": voltage, "displacement [m]": read}


def found(moved: list[np.ndarray]) -> td.DiscoveryResult:
    return td.discover(td.read_recordings({f"file {n}": recorded(n, m) for n, m in enumerate(moved)}))


TIME = np.arange(int(RATE * LONG)) / RATE


@pytest.mark.long
def test_a_drift_that_levels_off_is_told_from_wandering_zeros() -> None:
    """A straight line explains less of it than a smooth curve of each file; the drift's finer form explains more."""
    answer = found([4e-5 * (1 - np.exp(-TIME / 1.5))] * FILES)
    assert [e.id for e in answer.effects] == ["sensor_drift"]


@pytest.mark.long
def test_zeros_that_wander_are_no_drift() -> None:
    random = np.random.default_rng(1)
    curves = 4e-6 * random.standard_normal((FILES, 4))
    waves = [np.polynomial.legendre.legval(2 * TIME / LONG - 1, [0.0, *curve]) for curve in curves]
    answer = found(waves)
    assert answer.verdict == "no_effect"
    assert not answer.effects
