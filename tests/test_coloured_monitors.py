"""Noise of a monitor that is slower than a sample drives the model, and a lag or a friction would smooth it away."""

from __future__ import annotations

from dataclasses import replace

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


def test_a_stated_level_says_nothing_of_a_memory() -> None:
    """40 Pa with a memory of 30 ms, stated as 40 Pa: "friction_hysteresis", where nothing was missing."""
    random, time, tables = np.random.default_rng(3), np.arange(int(RATE * LONG)) / RATE, {}
    for name in "abc":
        pressure = np.interp(time, [4.0, 10.0], [0.0, 9e3])
        read = 1e-7 * pressure + 10e-6 * random.standard_normal(time.size)
        monitor = pressure + 40 * slow_noise(random, time.size, 0.03)
        columns = {
            "time [s]": time,
            "pressure [Pa]": monitor,
            "voltage [V]": np.where(time > 11, 1e3, 0.0),
            "displacement [m]": read,
        }
        tables[name] = columns
    found = td.read_recordings(tables)
    phi = float(np.exp(-1 / (RATE * 0.03)))
    level = study(replace(found, noise={"pressure": 40.0}), (), PRIOR).monitor_noise["pressure"]
    assert level == pytest.approx(40 * np.sqrt((1 + phi) / (1 - phi)), rel=0.3)
    assert study(replace(found, noise={"pressure": 0.0}), (), PRIOR).monitor_noise["pressure"] == 0
