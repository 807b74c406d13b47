"""Monitors as laboratories have them: coloured, filtered, coarse, fast, long, band-limited, with a trigger."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from scipy.signal import butter, lfilter, lsim, lti, resample, sosfilt
from scipy.signal.windows import tukey

from shared_data import shared_files
from tubular_dea.identify.inputs.band import band_limited, noise_floor
from tubular_dea.identify.inputs.drive import Drive, drive, drives
from tubular_dea.identify.inputs.edges import Edge
from tubular_dea.identify.inputs.trigger import triggered
from tubular_dea.identify.records.experiment import DataError, Experiment
from tubular_dea.identify.signals import monitors
from tubular_dea.identify.signals.monitors import (
    LARGEST,
    NO_MEMORY,
    at_rest,
    changes_by_itself,
    level,
    memory,
    noise_level,
    polyline,
)
from tubular_dea.identify.signals.slow import level_at_rest, slow_level
from tubular_dea.plants.plant import Input

TIME = np.arange(0, 16, 0.004)
HOLDS = np.interp(TIME, [0, 1, 6, 6.02, 16], [0, 12e3, 12e3, 9e3, 9e3])
PRESSURE = [Input("pressure")]


def beating(count: int, rate: float = 250.0) -> tuple[np.ndarray, np.ndarray]:
    """Times and pressure of heartbeats, straight between six corners each."""
    beat = [(0, 75), (0.08, 100.8), (0.2, 118), (0.33, 101.6), (0.36, 104.3), (0.6, 87.2)]
    knots = np.array([(0, 0), (0.6, 75), *((0.8 + i / 1.2 + t, p) for i in range(count) for t, p in beat)]).T
    time = np.arange(0, knots[0, -1], 1 / rate)
    return time, 133.322 * np.interp(time, *knots)


def recorded(time: np.ndarray, name: str, values: np.ndarray) -> Experiment:
    return Experiment("record", time, {name: values}, {}, np.arange(time.size) + 2)


@pytest.mark.parametrize("count", [12, 60, 240])
def test_many_beats_are_followed_to_the_last(count: int) -> None:
    time, truth = beating(count)
    noisy = truth + 25 * np.random.default_rng(0).standard_normal(time.size)
    line = polyline(time, noisy, level(noisy))
    error = np.interp(time, time[line.corners], line.values) - truth
    assert np.sqrt(np.mean(error**2)) < 0.5 * 25
    assert np.sqrt(np.mean(error[time > time[-1] - 2] ** 2)) < 0.7 * 25
    assert line.corners.size < 11 * count


@pytest.mark.parametrize("colour", ["0.5", "0.9", "filtered"])
def test_coloured_noise_makes_no_corners_and_is_no_less_than_it_is(colour: str) -> None:
    white = np.random.default_rng(1).standard_normal(TIME.size)
    if colour == "filtered":
        noise = 50 * sosfilt(butter(4, 0.25, output="sos"), white)
        truth = 50.0  # of its averages: a filter leaves low frequencies as they are
    else:
        noise = 25 * lfilter([np.sqrt(1 - float(colour) ** 2)], [1, -float(colour)], white)
        truth = 25 * float(np.sqrt((1 + float(colour)) / (1 - float(colour))))
    found = drives([recorded(TIME, "pressure", HOLDS + noise)], PRESSURE)[0]
    assert found.corners["pressure"].size < 2 * 12  # half of them in the middle of pieces
    assert found.noise["pressure"] == pytest.approx(truth, rel=0.35)


def test_a_moving_signal_is_not_taken_for_noise_with_a_memory() -> None:
    for rate in (50.0, 250.0, 1000.0):
        time, truth = beating(40, rate)
        assert memory(truth + 25 * np.random.default_rng(2).standard_normal(time.size)) in (None, NO_MEMORY)


@pytest.mark.parametrize("seed", range(3))
def test_a_spike_of_noise_in_a_long_record_is_no_corner(seed: int) -> None:
    """Of 200 000 samples of white noise ten are more than four standard deviations off."""
    time = np.arange(200_000) / 5000
    noisy = 400.0 * time + 25.0 * np.random.default_rng(seed).standard_normal(time.size)
    assert np.diff(polyline(time, noisy, 25.0).corners).min() > 5
    noisy[[50_000, 50_001]] += 200.0  # eight on two samples are no chance
    assert np.diff(polyline(time, noisy, 25.0).corners).min() < 3


@pytest.mark.parametrize("rate", [250.0, 1000.0, 5000.0])
def test_no_steps_in_noise_on_a_wave(rate: float) -> None:
    """Lines that may step follow a curve better than lines that may not; a signal of the plant does not step."""
    random = np.random.default_rng(5)
    time = np.arange(0, 8, 1 / rate)
    wave = 1000 + 800 * np.sin(2 * np.pi * time / 3.0)
    found = [polyline(time, wave + 25 * random.standard_normal(time.size), 25.0) for _ in range(20)]
    stepped = sum(bool(np.any(np.diff(line.corners) <= 3)) for line in found)
    assert stepped <= 3
    noisy = wave + 25 * random.standard_normal(time.size) + 300.0 * (time >= 4.0)
    step = polyline(time, noisy, 25.0)
    assert np.interp(4.0 - 1 / rate, time[step.corners], step.values) == pytest.approx(wave[time < 4.0][-1], abs=60)
    assert np.interp(4.0 + 1 / rate, time[step.corners], step.values) == pytest.approx(
        wave[time >= 4.0][0] + 300, abs=60
    )


@pytest.mark.parametrize(("rate", "fast"), [(50.0, 8.0), (100.0, 12.0)])
def test_a_wave_is_known_between_samples(rate: float, fast: float) -> None:
    """Straight lines between six samples a period lose 8 % of a sine: the plant would seem to lag."""
    time, fine = np.arange(0, 16, 1 / rate), np.arange(10, 15.5, 1 / 4000)

    def wave(t: np.ndarray) -> np.ndarray:
        return 9000 + 1500 * np.where(t < 9, 0, np.sin(2 * np.pi * fast * t))

    noisy = wave(time) + 25 * np.random.default_rng(3).standard_normal(time.size)
    line = drives([recorded(time, "pressure", noisy)], PRESSURE)[0].protocol
    drawn = line.at(fine)["pressure"] - 9000
    kept = 2 * np.mean(drawn * np.sin(2 * np.pi * fast * fine)) / 1500
    joined = 2 * np.mean((np.interp(fine, time, noisy) - 9000) * np.sin(2 * np.pi * fast * fine)) / 1500
    assert joined < 0.97
    assert abs(1 - kept) < 0.35 * (1 - joined)


def test_the_upstroke_of_many_beats_is_not_cut() -> None:
    """What each beat loses within its noise adds up: in the mean of 240, lines cut the upstroke by up to 18 Pa."""
    random = np.random.default_rng(5)
    starts = 0.5 + np.cumsum(0.45 * (1 + 0.03 * random.standard_normal(241)))

    def heart(t: np.ndarray) -> np.ndarray:
        since = t - starts[np.maximum(np.searchsorted(starts, t, "right") - 1, 0)]
        rise = 0.5 - 0.5 * np.cos(np.pi * np.clip(since / 0.045, 0, 1))
        return np.asarray(11000 + 5000 * np.where(since < 0, 0, rise * np.exp(-since / 0.12)))

    time, fine = np.arange(0, starts[-1], 1 / 200), np.arange(starts[0], starts[-1], 1 / 2000)
    line = drives([recorded(time, "pressure", heart(time) + 25 * random.standard_normal(time.size))], PRESSURE)[0]
    since = fine - starts[np.searchsorted(starts, fine, "right") - 1]

    def cut(drawn: np.ndarray) -> float:
        phases = [(since >= 0.005 * k) & (since < 0.005 * (k + 1)) for k in range(1, 12)]
        return float(np.std([np.mean((drawn - heart(fine))[phase]) for phase in phases]))

    assert cut(line.protocol.at(fine)["pressure"]) < 0.6 * cut(np.interp(fine, time, heart(time)))


def test_a_measured_flow_is_followed_between_samples() -> None:
    """The mock loop's, of which every fourth running mean is kept: against the means in between, lines miss 2 mL/s."""
    for file in shared_files("measured/mock_loop", "NV_step*.csv"):
        time, flow = np.loadtxt(file, delimiter=",", skiprows=1, usecols=(0, 1)).T
        mean, at = np.convolve(flow, np.ones(4) / 4, "valid"), time[:-3] + 0.0075
        found = drive(recorded(at[::4], "flow", mean[::4]), [Input("flow")])
        inner = slice(40, 4 * (at.size // 4) - 40)
        missed = found.protocol.at(at[inner])["flow"] - mean[inner]
        straight = np.interp(at[inner], at[::4], mean[::4]) - mean[inner]
        assert np.sqrt(np.mean(missed**2)) < 0.5 * np.sqrt(np.mean(straight**2))


def test_a_kink_stays_a_kink() -> None:
    time = np.arange(0, 12, 1 / 50)
    saw = 9000 + 3000 * np.abs(((time / 0.6) % 2) - 1)
    line = drives(
        [recorded(time, "pressure", saw + 25 * np.random.default_rng(4).standard_normal(time.size))], PRESSURE
    )
    fine = np.arange(0.2, 11.8, 1 / 4000)
    off = line[0].protocol.at(fine)["pressure"] - (9000 + 3000 * np.abs(((fine / 0.6) % 2) - 1))
    assert np.sqrt(np.mean(off**2)) < 1.2 * 25


@pytest.mark.parametrize("step", [12.5, 50.0, 133.322])
def test_a_coarse_monitor(step: float) -> None:
    noisy = step * np.round((HOLDS + 25 * np.random.default_rng(3).standard_normal(TIME.size)) / step)
    found = drive(recorded(TIME, "pressure", noisy), PRESSURE)
    assert found.corners["pressure"].size < 2 * 20  # half of them in the middle of pieces
    assert np.sqrt(np.mean((found.protocol.at(TIME)["pressure"] - HOLDS) ** 2)) < max(3, 0.06 * step)
    assert found.noise["pressure"] == pytest.approx(np.hypot(25, step / np.sqrt(12)), rel=0.3)


def test_an_input_that_is_sampled_too_slowly_is_refused() -> None:
    time, truth = beating(40, 6.0)
    with pytest.raises(DataError, match=r"record, column 'pressure': sampled at 6 Hz .* record at \d+ Hz"):
        drive(recorded(time, "pressure", truth), PRESSURE)


def test_a_plant_without_states_may_be_sampled_at_any_rate() -> None:
    """Nothing between samples matters to it: measured power of the sun, every quarter of an hour, was refused."""
    time, truth = beating(40, 6.0)
    found = drive(recorded(time, "pressure", truth), PRESSURE, remembers=False).lines["pressure"]
    assert np.abs(np.interp(time, found.time, found.values) - truth).max() < 0.01 * np.ptp(truth)


def test_a_band_limited_input_is_known_between_its_samples() -> None:
    random = np.random.default_rng(4)
    lines, phases = random.uniform(1, 200, 60), random.uniform(0, 7, 60)

    def signal(time: np.ndarray) -> np.ndarray:
        return np.sin(2 * np.pi * np.outer(time, lines) + phases).sum(axis=1)

    time = np.arange(4000) / 610.35
    times, fine, stated = band_limited(time, signal(time))
    between = np.linspace(0.2, time[-1] - 0.2, 7919)
    missed = np.std(np.interp(between, times, fine) - signal(between))
    assert missed < 1.5 * stated < 0.01 * np.std(signal(time))
    assert np.std(np.interp(between, time, signal(time)) - signal(between)) > 20 * missed
    assert noise_floor(signal(time) + 0.05 * random.standard_normal(4000)) == pytest.approx(0.05, rel=0.15)
    driven = drive(recorded(time, "force", signal(time)), [Input("force", band_limited=True)])
    assert driven.error["force"] == stated
    uneven = np.delete(time, 2000)
    with pytest.raises(DataError, match="record, line 2002: .* band_limited .* held=True"):
        drive(recorded(uneven, "force", signal(uneven)), [Input("force", band_limited=True)])


def rough(count: int = 2000) -> tuple[np.ndarray, np.ndarray]:
    """Times about every 10 ms, as a computer that does other things too reads a signal that moves at each of them."""
    random = np.random.default_rng(6)
    time = (np.arange(count) + random.uniform(-0.2, 0.2, count)) / 100
    lines, phases = random.uniform(1, 40, 40), random.uniform(0, 7, 40)
    return time, np.sin(2 * np.pi * np.outer(time, lines) + phases).sum(axis=1)


def test_jitter_of_a_clock_is_taken_out_of_a_band_limited_input() -> None:
    time, values = rough()
    driven = drive(recorded(time, "force", values), [Input("force", band_limited=True)], {"force": 0.0})
    assert driven.protocol.time[[0, -1]] == pytest.approx(time[[0, -1]], abs=0)
    inner = slice(100, -100)
    missed = np.interp(time, driven.protocol.time, driven.protocol.inputs["force"])[inner] - values[inner]
    ignored = np.interp(np.arange(2000) / 100, time, values)[inner] - values[inner]
    assert np.std(missed) < 0.02 * np.std(values) < 0.2 * np.std(ignored)


def test_every_reading_that_is_offered_for_a_fast_input_works() -> None:
    time, values = rough()
    experiment = recorded(time, "force", values)
    with pytest.raises(DataError, match=r"held=True .* band_limited=True .* `force = .*` under \[noise\]") as refused:
        drive(experiment, [Input("force")])
    offered = tomllib.loads(str(refused.value).split("`")[1])["force"]
    for signal in (Input("force", held=True), Input("force", band_limited=True)):
        assert np.ptp(drive(experiment, [signal]).protocol.inputs["force"]) > np.ptp(values) / 2
    assert drive(experiment, [Input("force")], {"force": 1.1 * offered}).noise["force"] > 0
    with pytest.raises(DataError, match="held=True"):
        drive(experiment, [Input("force")], {"force": 0.1 * offered})
    with pytest.raises(DataError) as refused:
        drive(recorded(time + 0.02 * (time > 7), "force", values), [Input("force")])
    assert "band_limited" not in str(refused.value)


def test_states_feel_lines_with_the_spectrum_of_a_signal_as_the_signal_itself() -> None:
    """An oscillator at 70 Hz, driven by a sum of sines, whose answer is known: two points a sample do."""
    random = np.random.default_rng(5)
    lines, phases = random.uniform(1, 200, 60), random.uniform(0, 7, 60)
    own = 2 * np.pi * 70
    system = lti([own**2], [1, 0.1 * own, own**2])
    answers = own**2 / (own**2 - (2 * np.pi * lines) ** 2 + 0.1j * own * 2 * np.pi * lines)
    time = np.arange(4000) / 610.35
    waves = np.exp(1j * (2 * np.pi * np.outer(time, lines) + phases))
    missed = {}
    for direct in (False, True):
        times, fine, _ = band_limited(time, waves.imag.sum(axis=1), direct)
        finer = (times.size - 1) // (time.size - 1)
        answer = lsim(system, fine, times)[1][::finer]
        missed[finer] = np.std((answer - (waves @ answers).imag)[1000:3500]) / np.std(answer)
    (few, least), (many, usual) = sorted(missed.items())
    assert few <= 2 < many, missed
    assert least < usual / 2, missed


def test_a_signal_with_parts_at_all_frequencies_is_not_taken_for_noise() -> None:
    """What white noise leaves of it may be a bound of 7 % of the signal: lines as rough as that were named a delay."""
    random = np.random.default_rng(1)
    time = np.arange(1000) / 610.35
    force = np.convolve(random.standard_normal(1008), np.ones(9) / 3, "valid") * tukey(1000, 0.1)
    assert noise_floor(force) > 0.03 * np.std(force)
    own = 2 * np.pi * 70
    system = lti([own**2], [1, 0.1 * own, own**2])
    driven = drive(recorded(time, "force", force), [Input("force", band_limited=True, direct=False)]).protocol
    even = np.linspace(time[0], time[-1], 16 * 999 + 1)
    answer = lsim(system, np.interp(even, driven.time, driven.inputs["force"]), even)[1][::16]
    truth = lsim(system, resample(force, 16000)[: even.size], even)[1][::16]
    assert np.std(answer - truth) < 1e-3 * np.std(truth)


@pytest.mark.parametrize("noise", [0.003, 0.05])
def test_noise_is_told_under_a_signal_that_moves_at_every_sample(noise: float) -> None:
    """A load of up to 0.8 Hz read ten times a second: its third differences are 0.3 N, whatever the noise."""
    random, time = np.random.default_rng(2), np.arange(1500) / 10
    lines, phases = random.uniform(0.1, 0.8, 12), random.uniform(0, 7, 12)
    load = 20 * np.sin(2 * np.pi * np.outer(time, lines) + phases).sum(axis=1)
    read = load + noise * random.standard_normal(time.size)
    assert noise_level(read) > 0.1
    assert level(read) == pytest.approx(max(noise, monitors.QUIET * np.ptp(read)), rel=0.2)
    driven = drive(recorded(time, "load", read), [Input("load")])
    assert np.std(driven.protocol.at(time)["load"] - load) < 1.5 * level(read)


@pytest.mark.parametrize("polarity", [1, -1])
def test_a_trigger_tells_as_much_as_it_does(polarity: int) -> None:
    random = np.random.default_rng(5)
    time, step, delay = np.arange(0, 130, 0.004), 0.004, 2e-3
    instants = np.sort(0.5 + np.arange(120) + random.uniform(0, 0.3, 120))
    trigger = polarity * (np.searchsorted(instants, time, "right") % 2).astype(float)

    def bounded(later: float) -> tuple[list[Edge], list[Edge]]:
        last = np.searchsorted(time, instants + later) - 1
        seen = [
            Edge("voltage", t + later, time[i], time[i] + step, 0.0, 5e3 * (n % 2), 5e3 * (1 - n % 2))
            for n, (t, i) in enumerate(zip(instants, last, strict=True))
        ]
        return seen, triggered(seen, time, trigger)

    before, after = bounded(0.0)
    assert [(e.earliest, e.latest) for e in after] == [(e.earliest, e.latest) for e in before]  # it says nothing new
    before, after = bounded(delay)
    width = [np.mean([e.latest - e.earliest for e in edges]) for edges in (before, after)]
    assert width[1] < 0.8 * width[0]
    assert all(e.earliest - 1e-9 <= t + delay <= e.latest + 1e-9 for e, t in zip(after, instants, strict=True))


@pytest.mark.parametrize("name", ["pressure", "voltage"])
def test_hum_of_the_mains_is_no_part_of_a_line(name: str) -> None:
    level, noise = (HOLDS, 25.0) if name == "pressure" else (np.where((TIME > 4) & (TIME < 9), 4000.0, 0.0), 4.0)
    monitor = PRESSURE if name == "pressure" else [Input("voltage", held=True)]
    hum = noise * np.sin(2 * np.pi * 50.02 * TIME + 1)
    values = level + hum + noise * np.random.default_rng(2).standard_normal(TIME.size)
    found = drives([recorded(TIME, name, values)], monitor)[0]
    line = found.protocol.at(TIME + (0.0 if name == "pressure" else 0.5 * (TIME[1] - TIME[0])))[name]
    still = np.abs(np.gradient(level)) < 1e-6
    assert np.std((line - level)[still]) < 0.15 * noise
    assert found.noise[name] < 1.5 * noise


def test_a_file_whose_own_signal_hides_the_hum_learns_of_it_from_the_others() -> None:
    """A pressure that moves at all frequencies up to 100 Hz beside one at rest; both monitors have 45 Pa of hum."""
    time = np.arange(8000) / 1e3
    lively = np.random.default_rng(5).standard_normal(time.size)
    busy = 300.0 * np.sqrt(5) * lfilter(*butter(2, 0.2), lively)
    wave = np.exp(2j * np.pi * 50.01 * time)
    files = []
    for number, pressure in enumerate((0 * time, busy)):
        noise = 30.0 * np.random.default_rng(number).standard_normal(time.size)
        files.append(recorded(time, "pressure", pressure + noise + 45.0 * wave.imag))
    monitor = [Input("pressure", least=400.0)]
    calm, among = (d.protocol.at(time)["pressure"] for d in drives(files, monitor))
    (alone,) = (d.protocol.at(time)["pressure"] for d in drives(files[1:], monitor))
    assert np.std(calm) < 5.0
    humming = [2 * abs(np.mean((line - busy) * wave)) for line in (alone, among)]
    assert humming[0] > 35.0
    assert humming[1] < 20.0


def test_a_command_that_is_new_at_every_sample_has_no_noise() -> None:
    """Rain of every day: what looks like noise is the command. A noisy monitor of few levels keeps its noise."""
    random, time = np.random.default_rng(8), 86400.0 * np.arange(365)
    rain = np.where(random.random(365) < 0.5, random.gamma(0.6, 8.0, 365), 0.0)
    held = [Input("rain", held=True)]
    found = drive(recorded(time, "rain", rain), held)
    assert found.noise["rain"] == 0.0
    assert np.array_equal(found.protocol.at(time[1:-1] + 3600.0)["rain"], rain[1:-1])
    levels = 30.0 * (np.arange(365) % 50 > 25) + 0.2 * random.standard_normal(365)
    assert drive(recorded(time, "rain", levels), held).noise["rain"] == pytest.approx(0.2, rel=0.4)


def test_an_exact_record_keeps_its_corners_alone() -> None:
    time = np.arange(500) * 0.004
    values = np.interp(time, [0.0, 0.4, 1.2, 1.996], [0.0, 3.0, 3.0, -1.0])
    line = polyline(time, values, 0.0)
    assert time[line.corners] == pytest.approx([0.0, 0.4, 1.2, 1.996])
    assert np.interp(time, time[line.corners], line.values) == pytest.approx(values, abs=1e-12)
    wavy = np.sin(time)
    assert polyline(time, wavy, 0.0).corners.size == time.size


def held(values: np.ndarray, noise: float | None = None) -> Drive:
    """The drive of a voltage at 250 Hz; `noise` as bench.toml states it."""
    stated = None if noise is None else {"voltage": noise}
    return drive(recorded(np.arange(values.size) / 250, "voltage", values), [Input("voltage", held=True)], stated)


def test_a_held_input_that_moves_smoothly_is_no_staircase() -> None:
    """Whether a sine was held from sample to sample the record does not tell: it is read between the two ways."""
    random, time = np.random.default_rng(2), np.arange(2000) / 250

    def sine(t: np.ndarray) -> np.ndarray:
        return 3000 + 1000 * np.sin(2 * np.pi * 5 * t)

    found = held(sine(time) + 4 * random.standard_normal(time.size))
    assert found.unheld == {"voltage"}
    between = time[10:-10] + 0.5 / 250
    left = found.protocol.at(between)["voltage"] - sine(between - 0.25 / 250)
    assert np.std(left) < 8  # one that is held, read as a line, misses it by 60
    assert not held(random.uniform(0, 5000, 2000)).unheld  # stairs with new levels
    assert held(sine(time), 0.0).protocol.time.size > 3 * time.size / 2  # a command holds what stands in the file


@pytest.mark.parametrize("bits", [8, 12])
def test_passes_over_a_coarse_record_are_few(bits: int, monkeypatch: pytest.MonkeyPatch) -> None:
    time = np.arange(0, 8, 1e-3)
    moving = np.interp(time, [0, 2, 5, 5.5, 8], [0, 0, 12e3, 12e3, 4e3])
    step = 40e3 / 2**bits
    coarse = step * np.round(moving / step)
    passes = 0

    def counted(pieces: monitors._Segments, noise: float) -> np.ndarray:
        nonlocal passes
        passes += 1
        return loss(pieces, noise)

    loss = monitors._loss
    monkeypatch.setattr(monitors, "_loss", counted)
    line = polyline(time, coarse, level(coarse))
    assert passes < 10 * np.log2(time.size)  # each takes out a share of what is left, also where it stands still
    assert np.abs(np.interp(time, time[line.corners], line.values) - moving).max() < 2 * step


@pytest.mark.parametrize("sigma", [2.0, 4.0, 8.0])
def test_the_noise_of_a_coarse_monitor_is_with_what_rounding_adds(sigma: float) -> None:
    random, step = np.random.default_rng(4), 12.0
    moving = np.interp(TIME, [0, 3, 3.01, 8, 12, 16], [0, 0, 5e3, 5e3, 1e3, 1e3])
    for signal in (moving, 100 + 0 * moving):
        read = step * np.round((signal + sigma * random.standard_normal(TIME.size)) / step)
        assert level(read, NO_MEMORY, step) == pytest.approx(np.hypot(sigma, step / np.sqrt(12)), rel=0.25)


@pytest.mark.parametrize("zero", [0.0, 30.0])
@pytest.mark.parametrize("step", [0.7, 12.0])
def test_a_monitor_that_is_off_in_one_file_has_noise_there_and_no_edges(zero: float, step: float) -> None:
    random, held = np.random.default_rng(3), [Input("voltage", held=True, least=25.0)]
    on = np.where((TIME > 4) & (TIME < 9), 5e3, 0.0)
    files = [step * np.round((v + zero + 4 * random.standard_normal(TIME.size)) / step) for v in (on, 0 * on)]
    found = drives([recorded(TIME, "voltage", v) for v in files], held)
    assert len(found[0].edges) == 2 and not found[1].edges
    assert found[1].noise["voltage"] == pytest.approx(np.hypot(4, step / np.sqrt(12)), rel=0.3)
    assert found[1].protocol.time.size < TIME.size / 50


def test_corners_and_steps_are_no_slow_noise() -> None:
    """The levels over long lags count where few differences have an event in them."""
    time, random = np.arange(0, 6, 0.002), np.random.default_rng(3)
    ramps = np.interp(time, [0, 1, 3, 5, 6], [0, 0, 5, -3, -3])
    steps = 2.0 * np.searchsorted([1, 1.6, 2.3, 3.1, 4.2], time)
    white = 0.02 * random.standard_normal((2, time.size))
    assert 0.018 < (found := slow_level([ramps + white[0]]) or (0, 0.0))[1] < 0.023
    assert found[0] >= 32
    assert 0.018 < (slow_level([steps + white[1]]) or (0, 0.0))[1] < 0.023
    assert slow_level([3 * np.sin(2 * np.pi * 8 * time) + white[0]]) is None


@pytest.mark.parametrize("tau", [0.02, 0.1, 0.3])
def test_slow_noise_beside_white_noise_and_corners_is_found(tau: float) -> None:
    found = []
    for seed in range(6):
        time, random = np.arange(0, 32, 0.004), np.random.default_rng(seed)
        phi = float(np.exp(-0.004 / tau))
        slow = 0.02 * lfilter([np.sqrt(1 - phi**2)], [1, -phi], random.standard_normal(time.size))
        ramps = np.interp(time, [0, 5, 15, 25, 32], [0, 0, 5, -3, -3])
        told = slow_level([ramps + slow + 0.02 * random.standard_normal(time.size)])
        assert told is not None
        found.append(told[1])
    assert np.median(found) == pytest.approx(0.02 * np.hypot(1, np.sqrt((1 + phi) / (1 - phi))), rel=0.3)


def test_the_longest_averages_tell_most_of_noise_whose_spectrum_is_one_over_f() -> None:
    """Where a monitor rests between two ramps; sample by sample its noise is that of white noise."""
    time, told = np.arange(0, 12, 1 / 300), []
    stays = np.interp(time, [0, 0.3, 1.5, 12], [0, 0, 1e4, 1e4])
    for seed in range(12):
        random, frequency = np.random.default_rng(seed), np.fft.rfftfreq(2 * time.size)[1:]
        lines = random.standard_normal((2, frequency.size)) / np.sqrt(frequency)
        flicker = np.fft.irfft(np.r_[0, lines[0] + 1j * lines[1]])[: time.size]
        slow = 45 * flicker / flicker.std()
        told.append([(slow_level([stays + one]) or (0, 0.0))[1] for one in (slow, random.permutation(slow))])
    flicker_level, white_level = np.median(told, axis=0)
    assert flicker_level > 3 * 45 and white_level == pytest.approx(45, rel=0.05)
    beats = 5e3 * np.sin(2 * np.pi * 0.3 * time) + 45 * np.random.default_rng(1).standard_normal(time.size)
    assert (slow_level([beats, stays + slow]) or (0, 0.0))[1] < 10 * 45  # what moves is no noise


@pytest.mark.parametrize(("slow", "times"), [(0.0, 1.0), (1.5, 2.7), (2.5, 3.0)])
def test_noise_with_a_memory_shows_at_rest_before_a_signal_moves(slow: float, times: float) -> None:
    """Heartbeats from the second second on: differences tell nothing of the memory, a second of rest in a few files
    does. `slow` is its size beside white noise of 1."""
    found, time, phi = [], np.arange(0, 8, 0.01), float(np.exp(-0.01 / 0.05))
    for seed in range(12):
        random, records = np.random.default_rng(seed), []
        for _ in range(3):
            beat = 400 * np.maximum(np.sin(2 * np.pi * 1.2 * (time - 1.3)), 0) * (time > 1.3)
            drawn = lfilter([np.sqrt(1 - phi**2)], [1, -phi], random.standard_normal(time.size + 100))[100:]
            records.append(beat + slow * drawn + random.standard_normal(time.size))
        found.append(level_at_rest(records, 1.0, 50) / np.hypot(1, slow))
    assert 0.65 < np.median(found) / times < 1.1  # of a memory of a third of the lags, a part shows
    assert level_at_rest([400 * np.sin(2 * np.pi * time)], 1.0, 50) == 0.0
    ramps = [0.05 * np.arange(800) + np.random.default_rng(seed).standard_normal(800) for seed in range(3)]
    assert level_at_rest(ramps, 1.0, 50) == pytest.approx(1.0, abs=0.3)  # it moves slowly from the first sample on


def test_what_begins_softly_is_no_slow_noise_at_rest() -> None:
    """A regulator takes 0.1 s to get going: what it does before it is far from its rest was the noise of a monitor."""
    number, random = np.arange(800), np.random.default_rng(4)
    soft = 60 * np.clip((number - 150) / 60, 0, None) ** 3
    records = [soft + random.standard_normal(800) for _ in range(3)]
    assert level_at_rest(records, 1.0, 50) == pytest.approx(1.0, abs=0.3)


def test_daily_rain_is_no_noise_of_a_gauge() -> None:
    """Between dry days every day is another amount; a monitor that reads exactly 0 while it is off still has noise."""
    random = np.random.default_rng(8)
    rain = np.where(np.arange(365) % 30 < 15, 0.0, random.exponential(1.0, 365))
    rain[10::60] = 20.0
    assert noise_level(rain) < LARGEST * rain.max()  # the median hardly sees it
    assert changes_by_itself(rain)
    day = (np.arange(160) % 24 > 7) & (np.arange(160) % 24 < 19)
    heating = np.where(day, 2.628 * random.integers(8, 40, 160), 0.0)  # hourly, as a meter counts it; off by night
    assert changes_by_itself(heating) and changes_by_itself(np.where(np.arange(160) < 100, 0.0, heating))
    on = np.arange(4000) % 200 < 150
    assert not changes_by_itself(np.where(on, 3e3 + 5 * random.standard_normal(4000), 0.0))
    assert not changes_by_itself(np.where(on, 3e3, 0.0))


@pytest.mark.parametrize("clamped", [False, True])
def test_an_input_that_is_exactly_nothing_all_night_has_no_noise(clamped: bool) -> None:
    """Light behind clouds moves at every sample: by day 2 kW of it passed for noise. Of noise that is cut off at
    nothing, every other reading by night is above."""
    random, time = np.random.default_rng(5), 900.0 * np.arange(96)
    listed = []
    for _ in range(5):
        light = 9e4 * np.maximum(-np.cos(2 * np.pi * time / 86400), 0) * random.uniform(0.3, 1.0, time.size)
        noise = 500.0 * random.standard_normal(time.size)
        listed.append(recorded(time, "power", np.maximum(light + noise, 0) if clamped else light))
    levels = [d.noise["power"] for d in drives(listed, [Input("power", band_limited=True)])]
    assert np.all(np.array(levels) > 300) if clamped else np.all(np.array(levels) < 20)


def test_a_reading_that_is_repeated_where_samples_were_lost_is_no_rest() -> None:
    random, time = np.random.default_rng(6), np.arange(6000) / 250
    force = np.cumsum(random.standard_normal(6000)) + random.standard_normal(6000)
    for lost in range(500, 6000, 500):
        force[lost : lost + 12] = force[lost]
    assert at_rest(force) < 20
    still = np.where(time % 4 < 1, 0.0, force)
    assert at_rest(still) == 1250  # but for the first run: it may be filled up


@pytest.mark.parametrize("period", [4.6, 8.5, 17.0, 40.0])
def test_a_ripple_is_no_noise_with_a_memory(period: float) -> None:
    """A pump's, of 80 Pa beside noise of 20 Pa: its noise was 720 Pa, and the line through it was straight."""
    random, n = np.random.default_rng(6), 10500
    ripple = 80 * np.sin(2 * np.pi * np.arange(n) / period)
    values = 1e4 + 120 * np.abs((np.arange(n) / 265) % 2 - 1) + ripple + 20 * random.standard_normal(n)
    assert monitors.memory(values) in (None, NO_MEMORY)
    assert monitors.level(values) == pytest.approx(20, rel=0.1 if period > 8 else 0.6)
