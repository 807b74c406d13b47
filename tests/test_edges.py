"""Switchings between samples, slow amplifiers, ramps, polarity, and how edges move: against what is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, cheby1, firwin, lfilter

from tubular_dea.identify.inputs.clocked import sent_at
from tubular_dea.identify.inputs.drive import drive, drives
from tubular_dea.identify.inputs.edges import BENDING, EXPONENTIAL, RISEN, _EdgeSamples, _together
from tubular_dea.identify.inputs.transitions import Transitions, few, transitions
from tubular_dea.identify.records.experiment import Experiment
from tubular_dea.plants.plant import Input

NOISE = 4.0  # V


VOLTAGE = [Input("voltage", held=True)]


def switched(
    rate: float,
    rise: float,
    exponential: bool = False,
    beats: int = 60,
    height: float = 5e3,
    seed: int = 0,
    noise: float = NOISE,
) -> tuple[Experiment, np.ndarray]:
    """Pulses that begin anywhere between samples of `rate` [Hz]; and the centroids of their edges."""
    random = np.random.default_rng(seed)
    time = np.arange(0, beats / 1.2 + 1, 1 / rate)
    on = 0.5 + np.arange(beats) / 1.2 + random.uniform(0, 1 / rate, beats)
    off = on + 0.33 + random.uniform(0, 1 / rate, beats)

    def risen(late: np.ndarray) -> np.ndarray:
        late = np.maximum(late, 0)
        return 1 - np.exp(-late / rise) if exponential else np.minimum(late / rise, 1)

    clean = sum(risen(time - a) for a in on) - sum(risen(time - a) for a in off)
    values = height * clean + noise * random.standard_normal(time.size)
    centroids = np.sort(np.concatenate([on, off])) + (rise if exponential else rise / 2)
    return Experiment("pulses", time, {"voltage": values}, {}, np.arange(time.size)), centroids


@pytest.mark.parametrize("rate", [50.0, 250.0, 1000.0])
@pytest.mark.parametrize("rise", [1e-6, 0.3e-3, 1.5e-3, 5e-3])
def test_every_switching_is_found_within_its_bounds(rate: float, rise: float) -> None:
    experiment, centroids = switched(rate, rise)
    edges = drive(experiment, VOLTAGE).edges
    assert len(edges) == centroids.size
    error = np.array([e.time for e in edges]) - centroids
    assert np.all(np.array([e.earliest for e in edges]) <= centroids + 1e-9)
    assert np.all(np.array([e.latest for e in edges]) >= centroids - 1e-9)
    expected = max(1 - 0.8 * rise * rate, 0.05) / np.sqrt(12) / rate  # a longer rise shows where it is
    assert error.std() < 1.1 * expected
    assert abs(error.mean()) < 3 * expected / np.sqrt(error.size)


@pytest.mark.parametrize("noise", [0.0, NOISE])
@pytest.mark.parametrize(("wandering", "edges"), [(0.0, 2), (5e3, 0)])
def test_a_continuous_input_that_only_steps_has_edges(noise: float, wandering: float, edges: int) -> None:
    """Straight lines across its steps are half a sample early, which looks like a delay: a carriage pushed by steps of
    its drive had one. What also moves between its steps is what its samples say."""
    experiment, _ = switched(250.0, 1e-9, noise=noise, beats=1, height=500.0)
    moving = experiment.inputs["voltage"] + wandering * np.sin(3.0 * experiment.time)
    driven = drive(replace(experiment, inputs={"voltage": moving}), [Input("voltage", least=1.0)])
    assert len(driven.edges) == edges
    assert np.all(np.diff(driven.corners["voltage"]) > 0)


@pytest.mark.parametrize(("slow", "edges"), [(3.0, 2), (300.0, 0)])
def test_a_continuous_input_that_leaps_beside_a_sine_has_edges(slow: float, edges: int) -> None:
    """A voltage of an ionic polymer jumped and then was a sine: a line across the jump left 60 um, and a null "lacked"
    something. The sine stays where its samples are."""
    experiment, centroids = switched(250.0, 1e-9, noise=0.5, beats=1, height=5000.0)
    sine = 600.0 * np.sin(slow * experiment.time)
    driven = drive(replace(experiment, inputs={"voltage": experiment.inputs["voltage"] + sine}), [Input("voltage")])
    assert np.allclose([e.time for e in driven.edges], centroids[:edges], atol=2.1e-3)
    off = np.abs(experiment.time[:, None] - centroids).min(axis=1) > 4.1e-3
    drawn = driven.protocol.at(experiment.time)["voltage"] - experiment.inputs["voltage"] - sine
    assert np.abs(drawn[off][5:-5]).max() < 5.0  # a fast sine has no neighbours at its ends


@pytest.mark.parametrize(
    ("rise", "exponential", "steps"),
    [(50e-6, False, True), (1.5e-3, False, True), (10e-3, False, True), (50e-3, False, False), (4e-3, True, True)],
)
def test_a_sample_on_its_way_makes_no_ramp_of_a_step(rise: float, exponential: bool, steps: bool) -> None:
    """Of 16 edges of an amplifier two had a sample on their way: all were lines then, and a null "lacked" something. Of
    an exponential with a time constant of one sample, seven are on the way: no line follows it, and it was refused."""
    experiment, centroids = switched(250.0, rise, exponential)
    driven = drive(experiment, [Input("voltage", least=1.0)])
    assert len(driven.edges) == (centroids.size if steps else 0)
    error = np.array([e.time for e in driven.edges]) - centroids[: len(driven.edges)]
    assert np.all(np.abs(error) < 3e-3)


@pytest.mark.long
def test_a_sample_on_a_level_is_not_taken_for_one_on_the_way() -> None:
    """Two samples of a level differ by the noise of both, and of many samples beside an edge one is far off."""
    experiment, centroids = switched(1000.0, 1e-9, beats=1000, height=14.0, noise=0.02)
    found = transitions(experiment.time, experiment.inputs["voltage"], 0.02)
    assert len(found) == centroids.size
    assert np.count_nonzero(found.on_the_way) <= 1  # by chance 0.1 of 2000, and 15 at 4 standard deviations


@pytest.mark.parametrize(("rise", "exponential"), [(1.5e-3, False), (5e-3, False), (1.5e-3, True)])
def test_a_rise_is_told_from_samples_on_the_way(rise: float, exponential: bool) -> None:
    experiment, _ = switched(250.0, rise, exponential)
    found = np.median([e.rise for e in drive(experiment, VOLTAGE).edges])
    assert found == pytest.approx(rise * (np.sqrt(12) if exponential else 1), rel=0.25)


def slewing(random: np.random.Generator, slope: float, edges: int) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a voltage that switches between levels of unlike height with one slope [V/s]: times [s] and volts."""
    starts = 0.5 + np.cumsum(random.uniform(0.3, 0.5, edges))
    levels = np.concatenate([[0.0], random.choice([0.0, 1500.0, 3000.0, 5000.0], edges)])
    corners = np.column_stack([starts, starts + np.abs(np.diff(levels)) / slope]).ravel()
    return corners, np.column_stack([levels[:-1], levels[1:]]).ravel()


@pytest.mark.parametrize(("rate", "slope"), [(500.0, 1.5e6), (200.0, 5e5), (250.0, 6e5), (1000.0, 1.5e6)])
def test_an_amplifier_with_a_largest_current_rises_with_one_slope(rate: float, slope: float) -> None:
    """Between levels of unlike height: ramps that all last as long miss it by 190 to 350 V (rms)."""
    random = np.random.default_rng(3)
    corners, heights = slewing(random, slope, 40)
    levels = np.append(0.0, heights[1::2])
    fine = np.arange(0, corners[-2] + 0.4, 1e-5)

    def true(t: np.ndarray) -> np.ndarray:
        return np.asarray(np.interp(t, corners, heights))

    time = np.arange(0, fine[-1], 1 / rate)
    values = true(time) + NOISE * random.standard_normal(time.size)
    found = drive(Experiment("slew", time, {"voltage": values}, {}, np.arange(time.size)), VOLTAGE)
    how = found.rises["voltage"]
    assert how.kind == "slew"
    assert how.height / how.value == pytest.approx(slope, rel=0.03)
    missed = found.protocol.at(fine)["voltage"] - true(fine)
    moving = np.any(np.abs(fine[:, None] - (corners[::2] + corners[1::2]) / 2) < 2 / rate, axis=1)
    assert np.sqrt(np.mean(missed[moving] ** 2)) < 80.0
    longest, shortest = (f(np.abs(np.diff(levels))[np.diff(levels) != 0]) for f in (np.max, np.min))
    by = 0.5e-3
    more = found.moved(np.zeros(len(found.edges)), {"voltage": by})
    assert np.ptp(more.time) == pytest.approx(np.ptp(found.protocol.time))
    for edge in found.edges:  # each lasts longer by its share of what the highest does
        if edge.shape == "ramp":
            end = edge.time + (edge.rise + edge.share * by) / 2
            assert np.min(np.abs(more.time - end)) < 1e-9
    assert {round(e.share, 2) for e in found.edges} >= {1.0, round(float(shortest / longest), 2)}


@pytest.mark.parametrize("shift", [0.0, 0.25, 0.5, 0.75])
def test_what_a_filter_overshoots_by_is_no_level_and_moves_no_edge(shift: float) -> None:
    """A filter against aliasing: second order, Butterworth, at 0.4 of the rate; its delay is common to all edges."""
    fine = 32
    at = np.arange(4 * 250 * fine) / (250.0 * fine)
    jumped = np.where((at % 1.0) * 250 >= 125 + shift, 4000.0, 0.0)
    filtered = lfilter(*butter(2, 0.4 * 2 / fine), jumped)[::fine]
    values = filtered + NOISE * np.random.default_rng(1).standard_normal(filtered.size)
    time = at[::fine]
    found = drive(Experiment("filtered", time, {"voltage": values}, {}, np.arange(time.size)), VOLTAGE)
    assert found.shown
    rising = [e for e in found.edges if e.high > e.low]
    assert len(rising) == 4
    for edge in rising:
        late = (edge.time % 1.0) * 250 - 125 - shift
        assert late == pytest.approx(np.sqrt(2) / (2 * np.pi * 0.4), abs=0.25)  # samples
        assert edge.rise == 0.0
        assert edge.high == pytest.approx(4000, abs=6)


def filtered_edges(kind: str, rise: float) -> tuple[Experiment, np.ndarray]:
    """Sixty edges of a `rise` [samples] at any part of the sampling, through a filter; and their centroids [s]."""
    fine, step = 64, 1 / 250
    random = np.random.default_rng(5)
    begun = (np.arange(60) * 40 + 20 + random.uniform(-5, 5, 60)) * step
    at = np.arange(60 * 40 * fine) * step / fine
    signs = np.where(np.arange(60) % 2, -4000.0, 4000.0)
    volts = sum(
        h * np.clip((at - b) / (rise * step) if rise else at > b, 0, 1) for h, b in zip(signs, begun, strict=True)
    )
    if kind == "linear phase":
        seen = np.convolve(np.pad(volts, 8 * fine, mode="edge"), firwin(16 * fine + 1, 0.9 / fine), "valid")
    else:
        order = int(kind[-1])
        b, a = butter(order, 0.8 / fine) if kind.startswith("b") else cheby1(order, 0.1, 0.8 / fine)
        seen = lfilter(b, a, volts)
    values = seen[::fine] + NOISE * random.standard_normal(seen[::fine].size)
    time = at[::fine]
    return Experiment(kind, time, {"voltage": values}, {}, np.arange(time.size)), begun + rise * step / 2


@pytest.mark.parametrize("rise", [0.0, 0.5])
@pytest.mark.parametrize("kind", ["butterworth 2", "butterworth 4", "butterworth 6", "chebyshev 4", "linear phase"])
def test_behind_any_filter_edges_are_late_alike_and_ring_as_no_others(kind: str, rise: float) -> None:
    """How long such an edge takes is hidden by the filter, and left to the fit."""
    experiment, centroids = filtered_edges(kind, rise)
    found = drive(experiment, VOLTAGE)
    assert len(found.edges) == 60
    late = (np.array([e.time for e in found.edges]) - centroids) * 250
    reach = np.array([e.latest - e.earliest for e in found.edges]) * 250 / 2
    assert late.std() < 0.045
    assert np.mean(np.abs(late - late.mean()) < reach) > 0.9
    assert np.all(reach < 0.1)
    assert {e.rise for e in found.edges} == {0.0}
    assert not found.rises["voltage"].seen
    assert found.rises["voltage"].longer[1] > 4e-3


def test_a_small_step_soon_after_a_large_one_is_no_ringing() -> None:
    time = np.arange(400) / 250
    values = np.where(time >= 0.5, 4000.0, 0.0) + np.where(time >= 0.54, 400.0, 0.0)
    found = transitions(time, values + NOISE * np.random.default_rng(3).standard_normal(time.size), NOISE)
    assert found.before.tolist() == [124, 134]


def test_edges_from_sample_to_sample_are_not_shown() -> None:
    assert not drive(switched(250.0, 1e-6)[0], VOLTAGE).shown
    assert drive(switched(250.0, 5e-3)[0], VOLTAGE).shown


def test_a_file_with_two_edges_borrows_the_rise_from_its_set() -> None:
    many, _ = switched(250.0, 1.5e-3)
    two = [switched(250.0, 1.5e-3, beats=1, seed=s) for s in range(40)]
    alone = np.concatenate([[e.time for e in drive(e, VOLTAGE).edges] - c for e, c in two])
    together = drives([many, *(e for e, _ in two)], VOLTAGE)[1:]
    borrowed = np.concatenate([[e.time for e in d.edges] - c for d, (_, c) in zip(together, two, strict=True)])
    assert borrowed.std() <= alone.std()
    assert all(abs(e.rise - 1.5e-3) < 1e-3 for d in together for e in d.edges)


@pytest.mark.parametrize("seed", range(3))
def test_hum_that_keeps_time_with_the_edges_is_no_slow_amplifier(seed: int) -> None:
    time = np.arange(0, 28.8, 0.002)  # 72 turns of the mains to a pulse: at every edge it is at the same height
    clean = np.where(np.sin(2 * np.pi * (time - 1.19815) / 2.4) > 0, 3000.0, 0.0)
    hum = 3 * NOISE * np.sin(2 * np.pi * 60 * time - 2)
    values = clean + hum + NOISE * np.random.default_rng(seed).standard_normal(time.size)
    experiment = Experiment("pulses", time, {"voltage": values}, {}, np.arange(time.size))
    for found in (drive(experiment, VOLTAGE), *drives([experiment], VOLTAGE)):
        assert not found.rises["voltage"].seen
        assert all(edge.rise == 0.0 for edge in found.edges)


def test_a_fast_record_of_a_slow_edge_follows_its_shape() -> None:
    experiment, centroids = switched(5000.0, 1.5e-3, exponential=True, beats=6)
    found = drive(experiment, VOLTAGE)
    clean, _ = switched(5000.0, 1.5e-3, exponential=True, beats=6, noise=0.0)
    line = found.protocol.at(experiment.time)["voltage"]
    assert np.sqrt(np.mean((line - clean.inputs["voltage"]) ** 2)) < 0.2 * NOISE + 5e3 * 1e-4
    assert [e.time for e in found.edges] == pytest.approx(centroids, abs=1e-4)


@pytest.mark.parametrize("polarity", [1, -1])
def test_ramps_are_no_switchings_and_steps_on_ramps_are(polarity: int) -> None:
    time = np.arange(0, 10, 0.004)
    ramp = np.interp(time, [0, 2, 4, 4.1, 6, 8, 10], [0, 0, 4000, 5000, 5000, 0, 0])
    stepped = ramp + np.where((time > 2.999) & (time < 9), 1000.0, 0.0)
    noise = NOISE * np.random.default_rng(1).standard_normal(time.size)
    assert len(transitions(time, polarity * ramp + noise, NOISE)) == 0
    found = transitions(time, polarity * stepped + noise, NOISE)
    np.testing.assert_array_equal(found.after, [750, 2250])


def test_a_set_point_switches_where_it_is_first_written() -> None:
    time = np.arange(0, 4, 0.02)
    written = Experiment("set point", time, {"voltage": np.where(time > 0.999, 4e3, 0.0)}, {}, np.arange(time.size))
    (edge,) = drive(written, VOLTAGE).edges
    assert (edge.time, edge.earliest, edge.latest) == pytest.approx((1.0, 0.98, 1.0))


def test_edges_move_exactly_and_stop_at_each_other() -> None:
    experiment, _ = switched(250.0, 1e-6, beats=3)
    found = drive(experiment, VOLTAGE)
    assert found.moved(np.zeros(6)).inputs["voltage"] == pytest.approx(found.protocol.inputs["voltage"])
    shifts = np.array([1e-3, -1e-3, 0, 0, 0, 2e-3])
    moved = found.moved(shifts, {"voltage": 0.5e-3})
    for edge, by in zip(found.edges, shifts, strict=True):
        at = edge.time + by + np.array([-0.26e-3, 0, 0.26e-3])
        middle = (edge.low + edge.high) / 2
        assert moved.at(at)["voltage"] == pytest.approx([edge.low, middle, edge.high], abs=1e-6)
    far = found.moved(np.array([10.0, 0, 0, 0, 0, -10.0]))
    assert np.all(np.diff(far.time) >= 0)
    with pytest.raises(ValueError, match="expected 6 of them"):
        found.moved(np.zeros(5))


def test_a_step_too_small_to_matter_is_no_reason_to_refuse_a_record() -> None:
    """Once in thousands of ramps neighbouring samples' noise looks like a switching; its line is left as it is."""
    time = np.arange(0, 8, 0.004)
    ramp = np.interp(time, [1, 7], [0, 7000]) + 4.0 * np.random.default_rng(1).standard_normal(time.size)
    ramp[[1000, 1001]] = np.interp(time[[1000, 1001]], [1, 7], [0, 7000]) + np.array([-20.0, 21.0])
    assert len(transitions(time, ramp, 4.0)) == 1
    found = drive(Experiment("ramp", time, {"voltage": ramp}, 0 * time, time), VOLTAGE)
    assert found.edges == ()
    assert found.error["voltage"] < 1.1 * 4.0


def test_a_filter_that_rings_does_not_switch_twice() -> None:
    time = np.arange(0, 10, 0.02)
    pulses = np.where((time % 2 > 1) & (time < 9), 5e3, 0.0)
    rung = pulses.copy()
    for begin in np.flatnonzero(np.diff(pulses)) + 1:
        rung[begin : begin + 2] += np.sign(pulses[begin] - pulses[begin - 1]) * np.array([230.0, -20.0])
    noisy = rung + NOISE * np.random.default_rng(6).standard_normal(time.size)
    assert len(transitions(time, noisy, NOISE)) == np.count_nonzero(np.diff(pulses))


def test_a_ramp_spreads_as_the_exponential_that_it_stands_for() -> None:
    """Both have the same standard deviation about their centroids."""
    tau, time = 0.7, np.linspace(0.0, 40.0, 400_001)
    rate = np.exp(-time / tau) / tau
    spread = np.sqrt(np.trapezoid(rate * (time - tau) ** 2, time))
    ramp = EXPONENTIAL * tau
    inside = np.linspace(-ramp / 2, ramp / 2, 10_001)
    assert np.sqrt(np.mean(inside**2)) == pytest.approx(spread, rel=1e-3)


@pytest.mark.parametrize(("steps", "found"), [(1, 1), (4, 1), (5, 1), (6, 0)])
def test_what_takes_longer_than_an_edge_is_a_ramp(steps: int, found: int) -> None:
    """At 250 Hz, six steps from sample to sample take 24 ms."""
    time = np.arange(200) / 250
    values = 5e3 * np.clip((np.arange(200) - 100) / steps, 0, 1)
    assert len(transitions(time, values, NOISE)) == found


def test_a_ramp_stands_for_edges_with_few_samples_on_the_way() -> None:
    assert few(Transitions(np.array([0, 10, 20]), np.array([1, 14, 25]))).tolist() == [True, True, False]


@pytest.mark.parametrize(("parts", "counted"), [((0.5,) * 4, 1), ((0.5,) * 6, 6), ((0.1, 0.3, 0.5, 0.7, 0.9), 1)])
def test_edges_that_keep_time_with_the_samples_count_as_one(parts: tuple[float, ...], counted: int) -> None:
    looks = [_EdgeSamples(np.arange(5.0), np.array([0, 0, part, 1, 1]), 1, 3, 0.03, 4e3) for part in parts]
    assert _together(looks) == counted


def test_the_corners_of_an_exponential_are_the_best_straight_lines() -> None:
    """Least squares over the rise, between the corners; the centroid stays where it is."""
    late = np.linspace(0, BENDING[-1], 5501)
    rests = np.array([np.interp(late, BENDING, unit) for unit in np.eye(BENDING.size)]).T
    best = np.linalg.lstsq(rests[:, 1:-1], 1 - np.exp(-late) - rests[:, -1], rcond=None)[0]
    np.testing.assert_allclose(RISEN[1:-1], best, atol=1e-4)
    assert np.trapezoid(1 - rests @ RISEN, late) == pytest.approx(1.0, abs=5e-3)


@pytest.mark.parametrize(("rate", "tau"), [(200.0, 4e-3), (250.0, 1.5e-3), (100.0, 12e-3), (1000.0, 3e-3)])
def test_an_exponential_is_drawn_as_one_however_many_samples_caught_it(rate: float, tau: float) -> None:
    """Straight lines between samples miss what an amplifier of 4 ms does between samples of 5 ms."""
    experiment, centroids = switched(rate, tau, exponential=True, beats=12)
    driven = drive(experiment, VOLTAGE)
    assert {e.shape for e in driven.edges} == {"exponential"}
    assert [e.time for e in driven.edges] == pytest.approx(centroids, abs=0.1 * max(tau, 0.2 / rate))
    assert np.median([e.rise for e in driven.edges]) == pytest.approx(EXPONENTIAL * tau, rel=0.05)
    for edge, centroid in zip(driven.edges[::2], centroids[::2], strict=True):
        late = np.linspace(0, 6, 200)
        drawn = driven.protocol.at(centroid - tau + late * tau)["voltage"]
        missed = drawn - edge.low - (edge.high - edge.low) * (1 - np.exp(-late))
        assert np.sqrt(np.mean(missed**2)) < 0.04 * 5e3


def test_an_edge_cuts_off_the_end_of_the_one_before() -> None:
    """Pulses of 8 ms through an amplifier of 4 ms."""
    experiment, _ = switched(1000.0, 4e-3, exponential=True, beats=12)
    driven = drive(experiment, VOLTAGE)
    near = driven.edges[0].time - driven.edges[1].time + 8e-3
    moved = driven.moved(np.where(np.arange(24) % 2 == 1, near, 0.0))
    assert np.all(np.diff(moved.time) >= 0)
    second = driven.edges[1].time + near - driven.edges[1].rise / EXPONENTIAL  # its begin
    assert moved.at(np.array([second - 1e-4]))["voltage"] > 0.5 * 5e3
    assert moved.at(np.array([second + 5e-3]))["voltage"] < 0.5 * 5e3


def test_an_exact_command_that_chatters_at_its_limits_stands_as_it_is() -> None:
    """Between calm levels a controller switches at every sample: none of that is an edge on its way."""
    time = np.arange(600) * 0.02
    values = np.where(time < 4, 1.0, np.where(time < 8, -0.5, 2.0))
    values[250:262] = 4.76 * (-1.0) ** np.arange(12)
    signal = Input("u", held=True)
    found = drives([Experiment("a", time, {"u": values}, {}, np.arange(600) + 2)], [signal], {"u": 0.0})[0]
    np.testing.assert_array_equal(found.protocol.at(time)["u"], values)
    assert found.protocol.time.size < 40  # nothing stands where nothing changes


def clocked(period: float, step: float, jitter: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, a wave that a computer sends every `period` [s] to 5 mV, after a second of rest, and when it did."""
    random, time = np.random.default_rng(4), step * np.arange(3000)
    clock = np.arange(0.37 * period, time[-1], period)
    clock = clock + jitter * random.standard_normal(clock.size)
    wave = np.where(clock > 1.0, 3.0 * np.sin(9.3 * (clock - 1.0)), 0.0)
    sent = np.append(0.0, np.round(wave / 0.005) * 0.005)
    values = sent[np.searchsorted(clock, time, side="right")]
    return time, values, clock[np.flatnonzero(np.diff(sent))]


@pytest.mark.parametrize(("period", "step"), [(0.0071, 0.002), (0.01, 0.004), (0.003, 0.002), (1 / 60, 1e-3)])
def test_a_command_with_a_clock_of_its_own_was_sent_between_samples(period: float, step: float) -> None:
    time, values, truth = clocked(period, step)
    found = sent_at(time, values)
    assert found is not None
    assert np.abs(found[0] - truth).max() <= found[1] + 1e-9
    assert found[1] <= 0.26 * step
    held = Experiment("one", time, {"u": values}, {}, np.arange(time.size) + 2)
    driven = drive(held, [Input("u", held=True)], {"u": 0.0})
    assert driven.room == {"u": found[1]} and not driven.edges
    assert np.array_equal(driven.protocol.time[1:-1:2], found[0])


@pytest.mark.parametrize(("period", "step", "jitter"), [(0.0071, 0.002, 5e-4), (0.01, 0.002, 0.0), (0.8, 0.002, 0.0)])
def test_steps_on_no_clock_or_on_that_of_the_samples_have_none_of_their_own(
    period: float, step: float, jitter: float
) -> None:
    time, values, _ = clocked(period, step, jitter)
    assert sent_at(time, values) is None


def test_a_noisy_monitor_that_reads_the_same_twice_has_no_clock() -> None:
    time, values = 0.002 * np.arange(3000), np.random.default_rng(2).standard_normal(3000)
    values[1500] = values[1499]
    assert sent_at(time, values) is None


def swept(rate: float, fastest: float, seed: int = 0) -> tuple[Experiment, np.ndarray, np.ndarray]:
    """A sine of 1.5 kV about 3 kV that becomes ever faster, switched on and off; and its true values at fine times."""
    fine = np.arange(0, 40, 1e-3)
    phase = 2 * np.pi * (0.8 * (fine - 3) + (fastest - 0.8) / 72 * (fine - 3) ** 2)
    clean = np.where((fine > 3) & (fine < 39), 3e3 + 1.5e3 * np.sin(phase), 0.0)
    time = np.arange(0, 40, 1 / rate)
    values = np.interp(time, fine, clean) + NOISE * np.random.default_rng(seed).standard_normal(time.size)
    return Experiment("sweep", time, {"voltage": values}, {}, np.arange(time.size)), fine, clean


@pytest.mark.parametrize("fastest", [6.0, 19.0])
def test_a_fast_sweep_between_two_edges_is_followed_by_curves_and_is_no_noise(fastest: float) -> None:
    """Its own differences say 37 V of noise; straight lines lose 7 % of the mean square that it has between samples."""
    pulses, _ = switched(100.0, 1e-3, exponential=True)
    sweep, fine, clean = swept(100.0, fastest)
    _, found = drives([pulses, sweep], VOLTAGE)
    assert NOISE < found.noise["voltage"] < 1.5 * NOISE
    within = (fine > 3.1) & (fine < 38.9)
    drawn = found.protocol.at(fine)["voltage"]
    assert np.std((drawn - clean)[within]) < 0.02 * 1.5e3
    late = (fine > 34) & within
    assert np.mean(drawn[late] ** 2) == pytest.approx(np.mean(clean[late] ** 2), rel=8e-3)


def test_a_monitor_that_is_noisier_in_every_part_of_a_file_is_noisier_there() -> None:
    """Where voltage was written down as it was sent in one file, and measured in another."""
    sent, _ = switched(250.0, 1e-6, noise=0.01)
    measured, centroids = switched(250.0, 1.5e-3, seed=1)
    _, found = drives([sent, measured], VOLTAGE)
    assert found.noise["voltage"] == pytest.approx(NOISE, rel=0.2)
    assert len(found.edges) == centroids.size
