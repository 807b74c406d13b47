"""A sensor's noise from its records alone: level, colour, lines of the mains, mixed rates, nothing quiet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import firwin, lfilter, welch

from tubular_dea.identify.signals import noise, noise_bound
from tubular_dea.identify.signals.bridges import bridged
from tubular_dea.identify.signals.colour import Colour, filtered
from tubular_dea.identify.signals.colour_estimate import as_told
from tubular_dea.identify.signals.colour_estimate import coloured as colour_of
from tubular_dea.identify.signals.hum import is_hum
from tubular_dea.identify.signals.noise import BRIEF, Noise, estimate, of_residual, rounded
from tubular_dea.identify.signals.quiet import Clock, calm, stretches
from tubular_dea.identify.signals.repeats import Repeated, unrepeated

RMS = 15e-6
EVENTS = np.array([0.0, 1.0, 2.0, 12.0, 16.0])
Make = Callable[[int, np.random.Generator], np.ndarray]


def record(rate: float, noise: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A tube that is driven at EVENTS and creeps afterwards, fast and slowly."""
    time = np.arange(noise.size) / rate
    output = np.zeros(time.size)
    for size, event in zip((2e-3, -0.5e-3, 1e-3, -1e-3), EVENTS[:-1], strict=True):
        late = np.maximum(time - event, 0)
        output += size * (1 - 0.6 * np.exp(-late / 0.006) - 0.25 * np.exp(-late / 0.3) - 0.15 * np.exp(-late / 3.3))
    return time, output + noise, EVENTS


def records(make: Make, rates: tuple[float, ...] = (250.0,) * 8, seed: int = 0) -> list:
    random = np.random.default_rng(seed)
    return [record(rate, make(int(16 * rate), random)) for rate in rates]


def coloured(phi: float, white: float = 0.0, rms: float = RMS) -> Make:
    return lambda n, random: rms * Colour(phi, white).sample(n, random)


def with_hum(make: Make, line: float, size: float, rate: float = 250.0) -> Make:
    def noise(n: int, random: np.random.Generator) -> np.ndarray:
        return make(n, random) + size * np.sin(2 * np.pi * line * np.arange(n) / rate + random.uniform(0, 7))

    return noise


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9, 0.95, 0.97])
def test_level_and_colour(phi: float) -> None:
    found = estimate(records(coloured(phi)))
    assert found.rms == pytest.approx(RMS, rel=0.05)
    assert found.correlation == pytest.approx(phi, abs=max(0.01, 0.1 * (1 - phi)))
    truth = RMS * np.sqrt((1 + phi) / (1 - phi))
    assert abs(found.slow / truth - 1) < 3 * max(found.uncertainty, 0.02)
    assert found.hum == found.lines == ()
    assert found.uncertainty == 0.012 if phi == 0 else 0.012 < found.uncertainty < 0.1


@pytest.mark.parametrize("phi", [0.0, 0.9])
def test_lines_lost_at_random_leave_stretches_that_tell_the_noise(phi: float) -> None:
    """A rig's four per cent left 25 samples between gaps, and "no part of the recordings is quiet"."""
    random = np.random.default_rng(3)
    lossy = []
    for time, values, events in records(with_hum(coloured(phi), 50.0, 1.5 * RMS)):
        there = random.random(time.size) > 0.04
        lossy.append((time[there], values[there], events))
    found = estimate(lossy)
    assert found.quiet and found.hum == pytest.approx((50.0,), abs=0.01)
    assert found.rms == pytest.approx(RMS, rel=0.05)
    assert found.correlation == pytest.approx(phi, abs=0.06)


def test_a_logger_that_samples_more_slowly_for_a_while_has_lost_no_line() -> None:
    time = np.concatenate([np.arange(500) / 250, 2 + np.arange(60) / 125, 2.48 + np.arange(500) / 250])
    assert bridged(time, np.sin(time))[0].size == time.size


def test_white_and_slow_noise_together() -> None:
    found = estimate(records(coloured(0.95, 0.5)))
    assert found.rms == pytest.approx(RMS, rel=0.05)
    assert found.white == pytest.approx(0.5, abs=0.07)
    assert found.tau == pytest.approx(-0.004 / np.log(0.95), rel=0.3)


def falling(n: int, random: np.random.Generator) -> np.ndarray:
    """Noise of a laser: 1/f between 0.3 and 125 Hz, and white."""
    frequency = np.fft.rfftfreq(n, 0.004)
    shape = 1 / np.sqrt(np.maximum(frequency, 0.3))
    slow = np.fft.irfft(shape * (random.standard_normal(shape.size) + 1j * random.standard_normal(shape.size)), n)
    return RMS * (np.sqrt(0.6) * slow / slow.std() + np.sqrt(0.4) * random.standard_normal(n))


def slow_share(found: Noise, noise: np.ndarray) -> float:
    """The variance of whitened noise in blocks of a tenth of a second; 1 where its colour is right."""
    white = found.whiten(Clock.of(0.004 * np.arange(noise.size)), noise)
    return float(np.var(white[: noise.size // 25 * 25].reshape(-1, 25).sum(axis=1) / 5))


def test_noise_that_falls_over_decades() -> None:
    found = estimate(records(falling))
    assert found.slower[0] > found.slower[1] > 0 and not found.slow_known  # it goes on beyond any stretch
    noise = falling(80_000, np.random.default_rng(9))
    plain = replace(found, slower=(0.0, 0.0))
    assert slow_share(found, noise) < 1.2 and slow_share(plain, noise) > 2


def test_noise_is_not_slow_because_one_stretch_in_many_moves() -> None:
    quiet = records(coloured(0.85))
    time, output, events = quiet[3]
    moving = (time > 12.5) & (time < 14.5)
    bulge = np.where(moving, 4 * RMS * np.sin(2 * np.pi * 1.2 * (time - 12.5)), 0.0)
    found = estimate([*quiet[:3], (time, output + bulge, events), *quiet[4:]])
    assert not any(found.slower)
    assert found.rms == pytest.approx(RMS, rel=0.05)


def test_short_quiet_stretches_do_not_tell_that_no_noise_is_slow() -> None:
    often = np.union1d(EVENTS, np.arange(0.0, 16.0, 0.7))
    assert not estimate([(time, output, often) for time, output, _ in records(falling)]).slow_known
    assert estimate([(time, output, often) for time, output, _ in records(coloured(0.0))]).slow_known


def test_few_samples_at_rest_do_not_tell_that_no_noise_is_slow() -> None:
    """A third of a second at 500 Hz before each first step: 9 um with a memory of 12 ms and 7 um of white noise were
    read as 10 um with hardly any, and a perfect tube was "unexplained"."""
    time, random, few = np.arange(2250) * 0.002, np.random.default_rng(2), []
    for _ in range(2):
        noise = coloured(np.exp(-2 / 12), 0.4)(time.size, random)
        few.append((time, noise, np.append(0.0, np.arange(0.32, 4.5, 0.015))))
    assert not estimate(few).slow_known
    rested = [(time, y, np.append(0.0, np.arange(2.0, 4.5, 0.015))) for time, y, _ in few]
    assert estimate(rested).rms == pytest.approx(RMS, rel=0.15)


def test_a_filtered_colour_whitens_its_own_noise() -> None:
    noise = Noise(RMS, 0.3, white=0.5, step=0.004, slower=(0.97, 0.9))
    colour = noise.colour(0.004)
    values = colour.sample(400_000, np.random.default_rng(1))
    assert np.var(values) == pytest.approx(1.0, rel=0.03)
    white = colour.whiten(values)
    assert np.var(white) == pytest.approx(1.0, rel=0.01)
    assert np.var(white.reshape(-1, 100).sum(axis=1) / 10) == pytest.approx(1.0, abs=0.06)
    density = [colour.density(f) for f in np.linspace(0, 0.5, 20_001)]
    assert np.mean(density) == pytest.approx(1.0, rel=1e-3)


def test_what_is_driven_is_not_raised_with_1_over_f_noise() -> None:
    random, time = np.random.default_rng(2), 0.004 * np.arange(200_000)
    noise = Noise(RMS, 0.3, white=0.5, step=0.004, slower=(0.97, 0.9), driven=2 * RMS)
    own = replace(noise, driven=0.0).sample(time, random) + noise.driven * random.standard_normal(time.size)
    assert np.var(noise.whiten(Clock.of(time), own)) == pytest.approx(1.0, rel=0.02)
    assert slow_share(noise, own) == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize(("line", "size", "phi"), [(50.02, 3e-6, 0.0), (59.95, 10e-6, 0.9), (180.1, 5e-6, 0.0)])
def test_hum_is_told_apart(line: float, size: float, phi: float) -> None:
    found = estimate(records(with_hum(coloured(phi), line, size)))
    assert found.hum == (pytest.approx(min(line, 250 - line), abs=0.03),)
    assert found.lines == ()
    assert found.rms == pytest.approx(RMS, rel=0.05)


def test_harmonics_of_the_mains_leave_short_stretches_no_calmer_than_long_ones() -> None:
    make, rate, random = coloured(0.96), 2000.0, np.random.default_rng(0)
    for line, size in ((50.0, 1.2e-6), (100.0, 0.8e-6), (150.0, 0.8e-6)):
        make = with_hum(make, line, size, rate)
    listed = []
    for _ in range(7):
        time, output, events = record(rate, make(int(16 * rate), random))
        often = 12 + np.cumsum(random.uniform(0.11, 0.25, 20))  # stretches of 0.01 to 0.15 s between them
        listed.append((time, output, np.union1d(events, often[often < 16])))
    found = estimate(listed)
    assert found.quiet
    assert len(found.hum) == 3
    assert found.innovation == pytest.approx(RMS * np.sqrt(1 - 0.96**2), rel=0.01)


def test_an_oscillation_that_is_not_the_mains_is_neither_noise_nor_hum() -> None:
    found = estimate(records(with_hum(coloured(0.0), 7.3, 10e-6)))
    assert found.hum == ()
    assert found.lines == (pytest.approx(7.3, abs=0.03),)
    assert found.rms == pytest.approx(RMS, rel=0.02)
    assert is_hum(50.0, 0.004)
    assert is_hum(10.0, 0.004)  # 240 Hz
    assert not is_hum(7.3, 0.004)
    assert not is_hum(1.06, 0.005)  # 600 Hz, or a heart
    assert not is_hum(19.2, 0.002)  # 480 Hz


def test_slow_drift_of_a_sensor_is_no_noise() -> None:
    def drifting(n: int, random: np.random.Generator) -> np.ndarray:
        return coloured(0.0)(n, random) + 5e-6 * np.arange(n) / 250 + 1e-5 * np.sin(np.arange(n) / 250 / 3)

    assert estimate(records(drifting)).rms == pytest.approx(RMS, rel=0.02)


def test_rates_may_differ_from_file_to_file() -> None:
    rates = (100.0, 250.0, 500.0, 1000.0)
    random = np.random.default_rng(1)
    mixed = [record(r, RMS * Colour(float(np.exp(-1 / r / 0.02))).sample(int(16 * r), random)) for r in rates]
    found = estimate(mixed)
    assert found.rms == pytest.approx(RMS, rel=0.05)
    assert found.tau == pytest.approx(0.02, rel=0.1)
    for time, *_ in mixed:
        white = found.whiten(Clock.of(time), found.sample(time, random))
        assert np.std(white) == pytest.approx(1, rel=0.06)
        assert abs(np.mean(white[1:] * white[:-1])) < 4 / np.sqrt(white.size)


@pytest.mark.parametrize("rates", [(40.0, 125.0, 80.0, 50.0), (100.0, 250.0, 250.0, 500.0)])
def test_a_memory_that_counts_samples_is_told_from_one_that_counts_seconds(rates: tuple[float, ...]) -> None:
    """That of a converter's filter: as one in seconds it was a random walk of ten times the noise."""
    found = estimate(records(coloured(0.5), rates * 2))
    assert found.clocked and found.rms == pytest.approx(RMS, rel=0.05)
    assert [found.colour(1 / rate).correlation for rate in rates] == pytest.approx([0.5] * 4, abs=0.05)
    random = np.random.default_rng(2)
    seconds = [record(r, RMS * Colour(float(np.exp(-1 / r / 0.02))).sample(int(16 * r), random)) for r in rates * 2]
    assert not estimate(seconds).clocked
    assert not estimate(records(coloured(0.5))).clocked  # one rate does not tell


def test_noise_that_is_slow_makes_no_file_of_a_lower_rate_look_loud() -> None:
    """From sample to sample, noise of 100 ms changes five times as much at 100 Hz as at 500 Hz, and is as quiet."""
    random = np.random.default_rng(4)
    quiet = [
        record(rate, RMS * Colour(0.962 ** (250 / rate)).sample(int(16 * rate), random)) for rate in (100.0, 500.0)
    ]
    groups = stretches(quiet)
    assert sum(g.freedom for g in calm(groups, 0.0)) > 0.9 * sum(g.freedom for g in groups)
    found = estimate(quiet)
    assert found.quiet and found.rms == pytest.approx(RMS, rel=0.25)


def test_without_any_quiet_stretch_the_uncertainty_is_larger() -> None:
    random = np.random.default_rng(2)
    time = np.arange(0, 60, 0.004)
    beats = np.arange(0, 60, 0.13)
    output = 1e-3 * np.exp(-np.mod(time, 0.13) / 0.02) + RMS * random.standard_normal(time.size)
    found = estimate([(time, output, beats)])
    assert found.rms == pytest.approx(RMS, rel=0.05)
    assert found.uncertainty >= 0.2
    moving = estimate([(time, output, time)])  # an event at every sample
    assert moving.uncertainty >= 0.2


def test_some_quiet_samples_do_not_outweigh_all_the_others() -> None:
    random = np.random.default_rng(4)
    time = np.arange(0, 120, 0.004)
    beats = np.append(np.arange(0, 100, 0.16), [100.0, *np.arange(100.48, 120, 0.16)]) - 1e-3
    noise = 15e-6 * Colour(0.94).sample(time.size, random)
    creep = 1e-3 * np.exp(-np.mod(time + 1e-6, 0.16) / 0.02) * ((time < 100.159) | (time > 100.479))
    found = estimate([(time, noise + creep, beats)])
    assert 0.75 * 15e-6 < found.rms < 1.6 * 15e-6  # stretches of 0.16 s tell noise that lasts 0.07 s no better
    assert found.uncertainty >= 0.2


@pytest.mark.parametrize(("phi", "white"), [(0.0, 0.0), (0.9, 0.0), (0.97, 0.4), (-0.3, 0.0)])
def test_whitened_noise_is_white(phi: float, white: float) -> None:
    random = np.random.default_rng(3)
    noise = Noise(2.0, (1 - white) * phi, step=0.01, white=white)
    time = np.arange(20000) * 0.01
    time[12000:] += 5.0  # a gap
    values = noise.sample(time, random)
    assert values.std() == pytest.approx(2.0, rel=0.1)
    found = noise.whiten(Clock.of(time), values)
    lags = [float(np.mean(found[k:] * found[:-k])) for k in (1, 2, 5, 30)]
    assert found.std() == pytest.approx(1, rel=0.02)
    assert np.abs(lags).max() < 4 / np.sqrt(time.size)
    columns = noise.whiten(Clock.of(time), np.stack([values, 2 * values], axis=1))
    np.testing.assert_allclose(columns, np.stack([found, 2 * found], axis=1))


@pytest.mark.parametrize(("bits", "white"), [(1.0, False), (5.0, True)])
def test_rounding_to_steps_larger_than_the_noise_is_white_where_the_signal_moves(bits: float, white: bool) -> None:
    """At rest a coarse record stands on one level, or toggles between two; `bits` is a step over the noise."""
    step, phi = bits * RMS, 0.9
    listed = [(t, step * np.round(y / step), e) for t, y, e in records(coloured(phi), (100.0,) * 8)]
    found = rounded(estimate(listed), step)
    moving = np.random.default_rng(1).uniform(-40 * step, 40 * step, 20_000) + RMS * Colour(phi).sample(
        20_000, np.random.default_rng(2)
    )
    error = step * np.round(moving / step) - moving
    if white:
        assert found.white > 0.5
        assert error.std() < found.innovation < 1.3 * np.hypot(error.std(), RMS)
    else:
        assert found.innovation == pytest.approx(np.hypot(error.std(), RMS * np.sqrt(1 - phi**2)), rel=0.15)


@pytest.mark.parametrize("share", [1 / 3, 0.4, 0.5])
def test_how_much_noise_a_coarse_sensor_shows_at_rest_depends_on_where_it_rests(share: float) -> None:
    random = np.random.default_rng(0)
    places = np.linspace(0, 1, 9)
    shown = [np.var(np.round(share * random.standard_normal(200_000) + place)) for place in places]
    told = rounded(Noise(float(np.sqrt(np.mean(shown))), 0.0), 1.0).form
    assert told == pytest.approx(np.ptp(shown) / 2 / np.mean(shown), rel=0.15)
    assert rounded(Noise(1.0, 0.0), 1.0).form == Noise(1.0, 0.0).form


@pytest.mark.parametrize("spread", [0.1, 0.2, 0.35, 0.6, 1.0, 3.0])
def test_readings_that_change_are_as_many_as_noise_makes_them(spread: float) -> None:
    random = np.random.default_rng(1)
    before = random.uniform(0, 1, 400_000)
    change = np.round(before + spread * random.standard_normal(before.size)) - np.round(before)
    assert noise._changing(float(np.mean(change**2))) == pytest.approx(np.mean(change != 0), rel=0.03)


def test_neighbours_of_noise_behind_a_filter_resemble_each_other_more() -> None:
    """1/f noise of ten bits was read as if it had 0.25 between neighbours for 0.88: a rest that changes little said
    that it is less."""
    colour = Colour(0.373, 0.33, 0.9677, 0.6186)
    made = colour.sample(400_000, np.random.default_rng(2))
    assert colour.neighbours == pytest.approx(np.mean(made[1:] * made[:-1]) / np.var(made), abs=0.01)
    assert Colour(0.9, 0.2).neighbours == pytest.approx(0.72)


def ringing(lasts: float, after: float, decay: float, colour: Colour, seed: int) -> list[tuple[np.ndarray, ...]]:
    """Records of a carriage on a spring that rests, is pushed `after` [s] and rings out, with noise of a colour."""
    time, random = np.arange(0, lasts, 0.01), np.random.default_rng(seed)
    since = np.maximum(time - after, 0.0)
    course = 1 - np.exp(-decay * since) * np.cos(9.4 * since)
    noises = [1e-4 * colour.sample(time.size, random) for _ in range(3)]
    return [(time, size * course + n, np.array([after])) for size, n in zip((0.09, -0.06, 0.05), noises, strict=True)]


def test_what_rings_after_every_event_is_at_rest_before_the_first() -> None:
    """A carriage on a spring after a push: what rests then is the force, not the carriage."""
    records = ringing(10, 1.0, 0.75, Colour(0.0), 4)
    found = estimate(records)
    assert found.quiet
    assert found.rms == pytest.approx(1e-4, rel=0.1)


def test_noise_that_remembers_long_is_told_by_rest_before_what_rings() -> None:
    """A cylinder that rests for five seconds, then rings: its sensor remembers longer than a ringing plant's may."""
    records = ringing(20, 5.0, 0.1, Colour(0.9), 5)
    found = estimate(records)
    assert found.quiet
    assert found.rms == pytest.approx(1e-4, rel=0.1)
    assert found.correlation == pytest.approx(0.9, abs=0.04)


def test_ringing_that_never_settles_is_no_noise() -> None:
    """The same carriage where a record begins with the push."""
    time, random = np.arange(0, 10, 0.01), np.random.default_rng(4)
    ringing = 0.09 * (1 - np.exp(-0.05 * time) * np.cos(9.4 * time))
    assert not estimate([(time, ringing + 1e-4 * random.standard_normal(time.size), np.array([0.0]))]).quiet


def test_a_coarse_sensor_that_rests_in_the_middle_of_a_step_is_no_measure_of_noise() -> None:
    """What toggles between two readings is as quiet as what does not."""
    time, random = np.arange(0, 8, 0.004), np.random.default_rng(6)
    levels = np.linspace(0.0, 5.0, 24)  # in steps of the sensor, from their middles to between them
    records = [(time, np.round(v + 0.25 * random.standard_normal(time.size)), np.array([0.0])) for v in levels]
    alike = np.mean([np.var(y) for _, y, _ in records])
    assert estimate(records).rms ** 2 == pytest.approx(alike, rel=0.1)


def test_slow_noise_that_coarse_readings_show_at_rest_keeps_its_memory() -> None:
    """Ten bits: rounding is white where the plant moves, and hides less at rest than noise of two thirds of a step."""
    random, time, listed = np.random.default_rng(8), np.arange(0, 16, 0.004), []
    for size in (40.0, -60.0, 90.0, -75.0, 30.0, 55.0):
        creep = size * (1 - np.exp(-np.maximum(time - 6.0, 0.0) / 4.0))
        noise = 0.67 * Colour(0.9625).sample(time.size, random)
        listed.append((time, np.round(random.uniform(0, 1) + creep + noise), np.array([6.0])))
    found = rounded(estimate(listed), 1.0)
    assert found.quiet
    assert 0.95 < found.rms / np.hypot(0.67, 12**-0.5) < 1.25
    assert 3.0 < found.slow < 9.0  # per sample of averages: it has 4.8; without its memory it would have 0.7


def test_half_a_second_of_rest_tells_the_noise_of_a_plant_that_never_rests_again() -> None:
    """What moves smoothly at all times afterwards would be noise with a long memory, 30 times as large."""
    random, time = np.random.default_rng(6), np.arange(1000) * 0.02
    events = np.append([0.0, 0.8], 0.8 + np.cumsum(random.uniform(0.3, 1.4, 25)))
    events = events[events < time[-1]]
    speed = np.zeros(time.size)
    for i in range(1, time.size):
        drive = 0.0 if time[i] < 0.8 else (-1.0) ** np.searchsorted(events, time[i])
        speed[i] = speed[i - 1] + 0.02 / 0.3 * (2 * drive - speed[i - 1])
    listed = [(time, speed + 0.01 * random.standard_normal(time.size), events) for _ in range(3)]
    found = estimate(listed)
    assert found.quiet
    assert 0.008 < found.rms < 0.03


def test_records_that_rest_at_their_end_alone_tell_the_noise_there() -> None:
    """A servo's steps of a second: what settled within half of one was noise of 7 mrad beside a sensor of 0.7."""
    random, time = np.random.default_rng(6), np.arange(56) * 0.02
    listed = []
    for step in (0.2, 0.3, -0.3, 1.5, -1.5, 1.8, -1.8, 0.25):
        late = np.maximum(time - 0.08, 0.0)
        angle = np.sign(step) * np.minimum(abs(step), 5.0 * late) + 0.1 * step * np.exp(-late / 0.1) * np.sin(40 * late)
        listed.append((time, angle + 7e-4 * random.standard_normal(time.size), np.array([0.0, 0.08, time[-1]])))
    found = estimate(listed)
    assert found.quiet
    assert found.rms == pytest.approx(7e-4, rel=0.3)


def test_what_rings_out_does_not_hide_the_rest_before_the_first_event() -> None:
    """README's carriage: a second of rest, then oscillations that leave the quietest later stretches coloured."""
    records = []
    for number in range(3):
        random, time = np.random.default_rng(number), 0.01 * np.arange(1001)
        late = np.clip(time - 1.0, 0.0, None)
        ringing = 0.1 * np.exp(-late) * np.sin(10 * late)
        records.append((time, ringing + 1e-4 * random.standard_normal(time.size), np.array([0.0, 1.0, 10.0])))
    found = estimate(records)
    assert found.quiet and found.rms == pytest.approx(1e-4, rel=0.15)


@pytest.mark.parametrize("at_rest", [False, True])
def test_noise_with_a_memory_that_is_not_there_at_rest_is_the_plants(at_rest: bool) -> None:
    random, time, events = np.random.default_rng(6), np.arange(3000) / 500, np.array([0.0, 1.0, 2.6, 4.1, 6.0])
    made = []
    for _ in range(6):
        stirred = 0.7 * RMS * Colour(0.9).sample(time.size, random) * (at_rest | (time > 1.0))
        moving = 50 * RMS * (1 - np.exp(-3 * np.maximum(time - 1.0, 0)))
        made.append((time, moving + stirred + RMS * random.standard_normal(time.size), events))
    found = estimate(made)
    assert found.correlation == pytest.approx(0.3 if at_rest else 0.0, abs=0.08)
    assert found.rms == pytest.approx(np.hypot(1, 0.7) * RMS if at_rest else RMS, rel=0.06)


@pytest.mark.parametrize("at_rest", [False, True])
def test_half_a_second_of_rest_tells_that_noise_has_no_memory(at_rest: bool) -> None:
    """A shaft that is eccentric: what moved it passed for noise of 0.59 rad/s with a memory of 54 ms, beside 0.15."""
    random, time, events = np.random.default_rng(7), np.arange(2250) / 500, np.array([0.0, 0.5, 1.5, 2.5, 4.5])
    made = []
    for _ in range(4):
        stirred = 1.2 * RMS * Colour(0.963).sample(time.size, random) * (at_rest | (time > 0.5))
        made.append((time, stirred + RMS * random.standard_normal(time.size), events))
    found = estimate(made)
    assert found.rms == pytest.approx(np.hypot(1, 1.2) * RMS if at_rest else RMS, rel=0.12)


def test_what_moves_five_times_as_much_as_at_rest_is_no_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    """The load of a drive with play coasts: of stretches as short as its rest, none tells that the long ones move."""
    time, listed = 1e-3 * np.arange(4000), []
    for number in range(4):
        random = np.random.default_rng(number)
        wandering = lfilter([0.1], [1, -0.97], random.standard_normal(time.size))
        coasting = np.where(time < 1.0, 0.0, wandering + 3 * (time - 1.0))
        listed.append((time, coasting + 0.05 * random.standard_normal(time.size), np.array([0.0, 1.0])))
    later = [(t[1000:], y[1000:], np.array([1.0])) for t, y, _ in listed]
    monkeypatch.setattr(noise, "_chosen", lambda records, apart, pace: (stretches(later), True, False))
    found = estimate(listed)
    assert found.quiet and found.rms == pytest.approx(0.05, rel=0.1)


def test_short_stretches_without_hum_do_not_make_long_ones_look_loud() -> None:
    time = np.arange(0, 8, 1 / 5000)
    events = np.append(0.0, 0.132 * np.arange(1, 12))  # then nothing happens for seconds
    for seed in range(10):
        values = 15e-6 * Colour(0.955).sample(time.size, np.random.default_rng(seed))
        groups = stretches([(time, values, events)])
        kept = calm(groups, 0.0, lines=(60.0, 120.0, 180.0))
        assert {len(g.values) for g in kept} == {len(g.values) for g in groups}


@pytest.mark.parametrize("correlation", [0.0, 0.5, np.exp(-1 / BRIEF)])
def test_noise_is_no_louder_than_a_residual_is_where_it_is_calm(correlation: float) -> None:
    """What a model lacks moves it where it is driven; noise with a brief memory is at all frequencies."""
    random = np.random.default_rng(5)
    noise = Colour(correlation).sample(20_000, random)
    lacks = np.convolve(random.standard_normal(20_200), firwin(201, 0.5), "valid")
    lacks *= 15 / lacks.std()
    known = Noise(15.0, 0.0, 20_000.0, quiet=False)
    assert noise_bound.BRIEFLY_COLOURED * noise_bound.calmest([noise]) > 1.0  # noise alone is left as it is
    assert noise_bound.limited(known, [noise + lacks]).rms < 5.0


def test_a_stated_noise_stays_as_it_was_stated() -> None:
    """Whatever residuals say, and though no stretch of the output is quiet."""
    left = 20e-6 * np.random.default_rng(0).standard_normal(15_000)
    times, begins = 0.004 * np.arange(15_000), np.arange(0.1, 60, 0.8)
    beats = unrepeated([Repeated(times, left, begins, np.sort(np.append(begins, begins + 0.3)))])
    for rms in (30e-6, 100e-6):
        known = Noise(rms, 0.0, quiet=False)
        assert noise_bound.limited(known, [left]) == of_residual(known, beats) == known
    estimated = Noise(100e-6, 0.0, 1000.0, quiet=False)
    assert noise_bound.limited(estimated, [left]).rms < 80e-6
    assert of_residual(estimated, beats).rms == pytest.approx(20e-6, rel=0.02)


@pytest.mark.parametrize(("count", "size"), [(1000, 256), (1001, 255), (300, 300)])
def test_a_spectrum_is_scipys(count: int, size: int) -> None:
    walk = np.random.default_rng(0).standard_normal(count).cumsum()
    expected = welch(walk, nperseg=size)[1][1 : (size + 1) // 2]
    np.testing.assert_allclose(noise_bound._spectrum(walk, size), expected, rtol=1e-12)


@pytest.mark.parametrize("shape", [(0,), (1,), (400,), (400, 3)])
@pytest.mark.parametrize(("above", "below"), [([1.0], [1.0, -0.97]), ([1.0, -0.5], [1.0, -0.9])])
def test_a_recursive_filter_is_scipys(shape: tuple[int, ...], above: list[float], below: list[float]) -> None:
    values = np.random.default_rng(1).standard_normal(shape)
    begin = np.full((1, *shape[1:]), 0.3)
    expected = lfilter(above, below, values, axis=0, zi=begin)[0] if len(values) else values
    np.testing.assert_allclose(filtered(above, below, values, begin), expected, rtol=1e-12, atol=1e-14)


def test_slow_noise_as_large_as_the_record_is_what_the_plant_does() -> None:
    """A muscle's contraction, smooth beside a laser of 30 um, was read as noise of 22 mm with a long memory."""
    random, time = np.random.default_rng(1), np.arange(2000) / 50.0
    late = np.exp(-0.02 / 10.0)
    records = [(time, 0.15 * np.sin(time), time[::3])]  # what moves all the time tells nothing, but is large
    for number in range(2):
        stairs = 0.01 * np.floor(time / 4) * (-1) ** np.floor(time / 8)
        read = lfilter([1 - late], [1, -late], stairs) + random.normal(0, 3e-5, time.size)
        records.append((time, read, np.arange(0, 40, 4.0 + number / 2)))
    assert noise.estimate(records).rms == pytest.approx(3e-5, rel=0.1)


def test_a_rest_before_anything_moves_is_a_stretch_of_its_own() -> None:
    """A second of 50 samples is no half of eight seconds, and was left out."""
    random, time = np.random.default_rng(6), np.arange(300) / 50.0
    events = np.concatenate([[0.0], time[49:]])
    records = [(time, np.where(time < 0.98, 0, 0.1 * time) + random.normal(0, 1e-3, 300), events) for _ in range(6)]
    (rest,) = stretches(records)
    assert rest.values.shape == (44, 6)  # a tenth of a second later
    assert noise.estimate(records).rms == pytest.approx(1e-3, rel=0.15)


@pytest.mark.parametrize("wander", [False, True])
def test_an_encoder_that_stands_at_rest_has_no_slow_noise(wander: bool) -> None:
    """A motor's shaft bends a little as it turns: that passed for 15 mrad of noise beside counts of 6 mrad, at rest
    nothing moved. Where the reading wanders by steps at rest, too, noise stays."""
    step, time, events = 6.28e-3, np.arange(400) / 200, np.array([0.0, 0.5, 2.0])
    made = []
    for number in range(4):
        random = np.random.default_rng(number)
        bends = 1.5 * step * Colour(0.98).sample(time.size, random)
        turned = 30.0 * np.maximum(time - 0.5, 0) ** 2
        moved = turned + np.where((time > 0.5) | wander, bends, 0.0)
        made.append((time, step * np.round(moved / step), events))
    found = rounded(estimate(made), step)
    if wander:
        assert found.total > step and found.correlation > 0.5
    else:
        assert found.total == pytest.approx(step / np.sqrt(12), rel=0.1) and found.correlation == 0


def test_a_memory_longer_than_stretches_can_show_is_none_of_theirs() -> None:
    """Curves between pulses of a cell, 30 s long, were read as noise of 6 mV with a memory of 1000 s, beside 0.3."""
    random, time = np.random.default_rng(3), 0.5 * np.arange(1200)
    walk = lfilter([1], [1, -0.9995], random.normal(0, 1e-4, time.size))
    pulses = np.arange(0, 600, 30.0)
    read = walk + random.normal(0, 3e-4, time.size) + 0.05 * np.exp(-(time % 30) / 9)
    quiet = stretches([(time, read, pulses)])
    longest = max(s.step * len(s.values) for s in quiet)
    found = colour_of(quiet, 0.5)
    told = as_told(quiet, found)
    assert told.at_step.phi <= max(np.exp(-0.5 / (0.25 * longest)), min(found.at_step.phi, 0.9)) < 0.97
    assert told.variance < 4 * 3e-4**2


def test_a_memory_that_has_vanished_whitens() -> None:
    values = np.random.default_rng(1).standard_normal(50)
    np.testing.assert_allclose(Colour(1e-300, 0.5).whiten(values), values)


def test_a_logger_with_several_rates_has_parts_of_each() -> None:
    """A cycler samples every minute at rest, and ten times a second in a pulse: that was noise at the usual rate."""
    random = np.random.default_rng(2)
    steps = np.concatenate([np.full(50, 60.0), np.full(3000, 0.1), np.full(6500, 0.5), [7.0], np.full(3000, 0.1)])
    time = np.append(0.0, np.cumsum(steps))
    clock = Clock.of(time)
    assert clock.step == 0.5
    assert [len(range(*p.indices(time.size))) for p in clock.parts] == [1, 50, 3000, 6500, 1, 3000]
    assert clock.steps == pytest.approx((0.5, 60.0, 0.1, 0.5, 0.5, 0.1))
    late = np.exp(-steps / 0.8)
    values = np.zeros(time.size)
    for k, phi in enumerate(late):
        values[k + 1] = phi * values[k] + np.sqrt(1 - phi**2) * random.standard_normal()
    white = Noise(1.0, float(np.exp(-0.1 / 0.8)), step=0.1).whiten(clock, values)
    for part in (white[60:3050], white[3060:9550], white[9560:]):
        assert np.std(part) == pytest.approx(1.0, rel=0.05)
        assert abs(np.corrcoef(part[1:], part[:-1])[0, 1]) < 0.05


@pytest.mark.parametrize("tau", [0.13, 0.24, 0.5])
@pytest.mark.parametrize("rate", [100.0, 200.0, 500.0])
def test_a_plant_that_settles_at_any_speed_leaves_no_slow_noise(tau: float, rate: float) -> None:
    """A motor of 0.24 s and 250 times its sensor's noise made white noise 1.4 to 2.7 times as large, with a memory."""
    random, settling = np.random.default_rng(4), []
    for size in (0.5, 1.0, 0.75, -1.0):
        time = np.arange(round(6 * rate)) / rate
        late = np.maximum(time - 1, 0)
        value = size * ((1 - np.exp(-late / tau)) - (time > 4) * (1 - np.exp(-np.maximum(time - 4, 0) / tau)))
        settling.append((time, value + 4e-3 * random.standard_normal(time.size), np.array([0.0, 1.0, 4.0])))
    found = estimate(settling)
    assert found.quiet and found.rms == pytest.approx(4e-3, rel=0.06)
    assert found.slow == pytest.approx(4e-3, rel=0.1)
