"""An answer does not depend on the unit of time: a plant, and the same one ten and a hundred times as slow."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter

import tubular_dea as td
from tubular_dea.identify.signals.quiet import pace_of
from tubular_dea.identify.study.study import study
from tubular_dea.plants import Balance, Build, Coefficient, Input, Output, Path, Plant

STEP, TAU, GAIN = 0.04, 2.0, 1.5  # of the plant that the others are slower than, in s
RMS = 0.05
SCALES = (1.0, 10.0, 100.0)


def lag(scale: float, **how: bool) -> Plant:
    """A store that is filled by an input and empties by itself, `scale` times as slowly."""
    m = Build("Store")
    feed = m.input("feed", "V", nominal=3.0)
    tau = m.parameter("tau", "s", 1.2 * TAU * scale, minimum=1e-9)
    gain = m.parameter("gain", "1", 1.2 * GAIN, minimum=1e-3)
    level = m.state("level", "V", nominal=3.0)
    drained = m.define("drained", "V/s", level / tau, nominal=3.0 / (TAU * scale))
    m.derivative(level, gain * feed / tau - drained)
    m.output("reading", "V", level, nominal=3.0)
    places = [Coefficient("drained", of="level"), Balance("level"), Path("feed"), Path("reading")]
    return Plant(m.model(), [Input("feed", **how)], [Output("reading")], places=places)


def noisy(random: np.random.Generator, size: int) -> np.ndarray:
    """Noise that forgets a tenth from sample to sample, and as much white noise."""
    slow = lfilter([np.sqrt(1 - 0.9**2)], [1, -0.9], random.standard_normal(size + 200))[200:]
    return RMS * (slow + random.standard_normal(size)) / np.sqrt(2)


@cache
def tables(scale: float) -> dict[str, dict[str, np.ndarray]]:
    """Three files that rest for 300 samples; then the feed changes every 40."""
    made = {}
    for number in range(3):
        random = np.random.default_rng(number)
        feed = np.append(np.zeros(300), np.repeat(random.uniform(0.5, 3.0, 12), 40))
        keeps = np.exp(-STEP / TAU)
        level = lfilter([0.0, GAIN * (1 - keeps)], [1.0, -keeps], feed)
        columns = {"feed [V]": feed, "reading [V]": level + noisy(random, feed.size)}
        made[f"file {number}"] = {"time [s]": scale * STEP * np.arange(feed.size)} | columns
    return made


def test_the_noise_does_not_depend_on_the_unit_of_time() -> None:
    told = []
    for scale in SCALES:
        recordings = td.read_recordings(tables(scale), plant=lag(scale, held=True))
        told.append(study(recordings, held_out=()).noise["reading"])
    for noise, scale in zip(told, SCALES, strict=True):
        assert noise.quiet
        assert noise.rms == pytest.approx(RMS, rel=0.05)
        assert noise.phi == pytest.approx(0.9, abs=0.06)
        assert noise.rms == pytest.approx(told[0].rms, rel=1e-6)
        assert noise.correlation == pytest.approx(told[0].correlation, rel=1e-6)
        assert noise.freedom == told[0].freedom
        assert noise.step == pytest.approx(scale * STEP)


@pytest.mark.long
def test_the_verdict_does_not_depend_on_the_unit_of_time() -> None:
    found = [td.discover(td.read_recordings(tables(s), plant=lag(s, held=True))) for s in SCALES]
    assert [f.verdict for f in found] == ["no_effect"] * len(SCALES)
    for one, scale in zip(found, SCALES, strict=True):
        assert one.parameters["tau"].value / scale == pytest.approx(found[0].parameters["tau"].value, rel=1e-3)


def test_a_plant_that_declares_its_bandwidth_is_as_slow_as_that_says() -> None:
    assert pace_of(25.0, [1e-3]) == 1.0  # the tube
    assert pace_of(0.25, [1e-3]) == pytest.approx(100.0)
    assert pace_of(np.inf, [4.0]) == pytest.approx(200.0)
    assert pace_of(np.inf, [0.001]) == pace_of(np.inf, [0.02]) == 1.0
    assert pace_of(np.inf, [5e-6]) == pytest.approx(0.01)


@pytest.mark.parametrize("scale", SCALES)
def test_rest_is_seen_before_an_input_that_is_band_limited(scale: float) -> None:
    """No line smooths such an input, so the noise of its monitor moves it at every sample."""
    made = {}
    for number in range(3):
        random = np.random.default_rng(10 + number)
        time = STEP * np.arange(1200)
        phases = random.uniform(0, 2 * np.pi, 20)
        turns = 2 * np.pi * np.outer(time[400:] - time[400], 0.05 * np.arange(1, 21))
        feed = np.append(np.zeros(400), (np.sin(turns + phases) - np.sin(phases)).sum(axis=1))
        fine = np.interp(np.arange(0, time[-1], STEP / 20), time, feed)
        keeps = np.exp(-STEP / 20 / TAU)
        level = lfilter([0.0, GAIN * (1 - keeps)], [1.0, -keeps], np.append(fine, feed[-1]))[::20]
        read = level + RMS * random.standard_normal(time.size)
        columns = {"feed [V]": feed + 0.02 * random.standard_normal(time.size), "reading [V]": read}
        made[f"file {number}"] = {"time [s]": scale * time} | columns
    found = study(td.read_recordings(made, plant=lag(scale, band_limited=True)), held_out=()).noise["reading"]
    assert found.quiet
    assert found.rms == pytest.approx(RMS, rel=0.06)
