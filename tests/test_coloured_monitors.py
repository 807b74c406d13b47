"""Noise of a monitor that is slower than a sample drives the model, and a lag or a friction would smooth it away."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

import tubular_dea as td
from tubular_dea.identify.study.nuisances import SMOOTH_OF
from tubular_dea.identify.study.study import PRIOR, study
from tubular_dea.plants.tube import PLANT

RATE, LONG = 250.0, 12.0  # samples per second, s


def slow_noise(random: np.random.Generator, size: int, tau: float) -> np.ndarray:
    """Noise of variance 1 with this time constant [s]."""
    phi = float(np.exp(-1 / (RATE * tau)))
    return np.asarray(lfilter([np.sqrt(1 - phi**2)], [1, -phi], random.standard_normal(size)))


def recorded(number: int, white: float, slow: float) -> dict[str, np.ndarray]:
    """A perfect tube under a ramp of pressure and steps of voltage; the pressure's monitor has noise [Pa] of 0.2 s."""
    random, time = np.random.default_rng(number), np.arange(int(RATE * LONG)) / RATE
    at = np.sort(random.uniform(2, LONG - 1, 5))
    ends = np.column_stack([at, at + 0.02]).ravel()
    voltage = np.interp(time, ends, np.repeat(np.append(0.0, random.uniform(2e3, 5e3, 5)), 2)[1:-1])
    pressure = np.interp(time, [2.0, 10.0], [9e3 + 1e3 * number, 12e3 - 1e3 * number])
    run = td.Kernel(PLANT.model).simulate(
        td.Protocol.of(time, pressure=pressure, voltage=voltage), time, {"start_at_equilibrium": 1.0}
    )
    monitored = pressure + white * random.standard_normal(time.size) + slow * slow_noise(random, time.size, 0.2)
    read = run["measured_displacement"] + 10e-6 * random.standard_normal(time.size)
    return {"time [s]": time, "pressure [Pa]": monitored, "voltage [V]": voltage, "displacement [m]": read}


def recordings(white: float, slow: float) -> td.RecordingSet:
    return td.read_recordings({f"file {n}": recorded(n, white, slow) for n in range(3)})


@pytest.mark.parametrize(("slow", "count"), [(0.0, 2), (40.0, 5)])
def test_a_monitor_with_slow_noise_may_be_smoothed_over_longer_means(slow: float, count: int) -> None:
    work = study(recordings(20.0, slow), (), PRIOR)
    assert work.coloured == (frozenset({"pressure"}) if slow else frozenset())
    adjusted_to = td.discover(recordings(20.0, slow)).discovery.study.pieces[0].nuisances.names
    assert sum(n.startswith(SMOOTH_OF) for n in adjusted_to) == count


def test_slow_noise_of_a_monitor_is_no_lag() -> None:
    """It was a lag in the line to the tube, a delay and a stop."""
    assert td.discover(recordings(20.0, 40.0)).verdict == "no_effect"
