"""The signal of a monitor without its noise: straight lines between as few corners as the noise allows.

The recorded inputs drive the model, and so does their noise: 25 Pa of it leave 3 to 5 um in the radius. A bench's
inputs are ramps, steps and slow waves, so most of that noise can be separated from the signal. `polyline` fits
continuous lines with corners at samples. It begins with a corner at every sample and takes out what the noise
explains, the least useful first, so that a signal that really moves at every sample is kept as it is; then every
corner is moved to where it serves best, and more are set wherever one explains the record better than chance. Where
lines miss the record all the same by more than its noise, they go through every sample. Each pass goes over all
corners at once: the cost is linear in the samples, and no constant limits the number of corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb

import numpy as np
from scipy.linalg import solveh_banded
from scipy.special import ndtri

# Set by measurement: of 8, 12, 16 and 20 it leaves the least error over heartbeats, holds and sines at 250 Hz to 5 kHz
# with 25 Pa of noise; with 8, one sample in 80 of pure noise is a corner. Check: `pytest tests/test_monitors.py`,
# `python -m blind.score --nulls 12 --conventions own_protocols rounded --seed 1000`
REMOVE = 16.0  # [squared standard deviations] below which a corner is taken out again

# Set by convention: one in twenty. Check: `pytest tests/test_monitors.py -k spike`
SPIKE_CHANCE = 0.05  # [1] chance that a record of pure noise has a corner as brief and as far off somewhere

# Set by measurement: of 60 records of noise on a sine (32 000 samples each), 27 had steps or spikes between long lines
# that explained up to 46: lines that may step follow a curve better. A step of the signal explains hundreds.
# Check: `pytest tests/test_monitors.py -k no_steps_in_noise`
ABRUPT = 4  # [samples] between two corners that stand for a step or a spike,
ALONE = 16.0  # [1] if the line on their other side is so many times longer
STEP = 100.0  # [squared standard deviations] that such a corner has to explain

# Set by measurement: a third polish changes no corner on the bench sets. Check: `pytest tests/test_monitors.py`,
# `python -m blind.score --nulls 12 --conventions plain --seed 1000`
POLISH = 2  # [1] times that all corners are moved and tried again
MOVED_IN_TURN = 4  # [1] times that every second corner is moved: each one twice

# Set by judgement. Check: `pytest tests/test_monitors.py`,
# `python -m blind.score --nulls 12 --conventions own_protocols rounded --seed 1000`
STAGES = (1.0, 2.0, 4.0, 8.0, REMOVE)  # [squared standard deviations] up to which corners go, the least useful first

# Set by judgement. Check: `pytest tests/test_monitors.py -k passes`
INDIFFERENT = 1e-3  # [squared standard deviations] below which corners are all the same: of a coarse monitor at rest

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions own_protocols rounded --seed 1000`
INSERT = 18.0  # [squared standard deviations] by which one more corner must explain the record better
SHORT = 4  # [samples] of a piece at least that is halved

# Set by measurement: over 240 heartbeats at 200 Hz with 25 Pa of noise, lines with corners at every second sample cut
# the upstroke by 18 Pa in the mean of all beats, curves between corners up to six samples apart by 7 Pa, with no more
# noise; with twelve, noise grows. Check: `pytest tests/test_monitors.py -k upstroke`
DENSE = 6  # [samples] between corners up to which a record is followed from sample to sample
STILL_CURVED = 0.2  # [1] share of a bend that those beside it have in a curve; a kink has none beside it

# Set by theory: noise alone bends by an eighth of itself, and a chord over half as much time misses a quarter.
# Check: `pytest tests/test_monitors.py -k between_samples`
QUARTERS = (0.25, 0.5, 0.75)  # [1] of the way between two samples: where a curve is followed
WELL_BENT = 0.5  # [1] times the noise by which it bends there; if it bends by less, only its middle is

# Set by theory: by chance lines miss so many samples so far once in a million.
# Check: `pytest tests/test_monitors.py::test_many_beats_are_followed_to_the_last`
MISSED_BLOCK = 50  # [samples] over which it is judged whether lines miss a record
WRONG = 1.5  # [1] times its noise by which they do at most

# Set by judgement. Check: `pytest tests/test_monitors.py`,
# `python -m blind.score --nulls 12 --conventions colour antialias --seed 1000`
LEAST_LAGS = 8  # [1] times a lag that a record lasts at least for its noise to be told at all
LAGS = 20  # [1] times a lag that a record lasts at least for differences over it
PLATEAU = 1.12  # [1] growth of a variance from lag to lag that is chance
FALLS = 0.5  # [1] times a variance from one lag to the next, below which no noise with a memory falls
SPREAD = 3.0  # [standard errors] by which it may be more in short records
FILTERED = 4  # [samples] up to which an anti-aliasing filter colours noise
MOSTLY_NEW = 0.5  # [1] share of samples that differ from the one before, where the others say nothing of noise
LARGEST = 0.02  # [1] of its largest value: noise of a monitor, at most
COLOURED = 1.3  # [1] times its differences' variance from which on noise counts as coloured
MOST_CORRELATED = 0.98  # [1] correlation of neighbouring samples, at most
FIRST_ORDER = 4  # [1] order of the differences that tell noise from a signal, at least
MOST_ORDER = 10  # [1] and at most

# Set by judgement: of a clamped monitor at its end every other reading differs.
# Check: `pytest tests/test_monitors.py -k night`
SAME_READINGS = 8  # [samples] of a run of equal readings that is no chance,
ENOUGH_REST = 30  # [samples] and in such runs together, from which on they tell that a monitor has no noise

# Set by judgement. Check: `pytest tests/test_monitors.py::test_a_coarse_monitor tests/test_data.py`,
# `python -m blind.score --nulls 12 --conventions bits --seed 1000`
COARSEST = 0.03  # [1] of its span: a larger smallest step is a switching, no monitor's resolution
SMALL_STEPS = 5.5  # [1] times the smallest step up to which others are looked at: are these
ROUNDLY = 0.1  # [1] whole numbers of it, to within so much,
MOST_STEPS = 0.9  # [1] in more than such a share of them? A fast wave has a smallest step by chance
FEW_TO_TELL = 3  # [1] of them at least
FEW_STEPS = 2.0  # [1] steps of a monitor, below which its noise shows as toggling between readings
SWITCHED = 5.0  # [standard deviations] beyond which such a change is a switching
QUIET = 1e-4  # [1] of its span: noise below which a record comes from a computer or a set point

# Set by theory: some of the 16 digits of a number. Check: `pytest tests/test_monitors.py -k exact`
ROUNDING = 1e-12  # [1] of its largest value: by so much a record without noise is off a straight line, all the same

# Set by theory: of white noise of variance 1, normally distributed. Check: `pytest tests/test_monitors.py`
THIRDS = 20.0  # [1] variance of its third differences: 1 + 9 + 9 + 1
GAUSSIAN_MAD = 1.4826  # [1] standard deviation over the median of its absolute values

# Set by theory: less than noise changes anything. Check: `pytest tests/test_monitors.py`
CORRELATIONS = 500  # [1] correlations between 0 and the largest one, between which straight lines are drawn
RIDGE = 1e-12  # [1] of the largest diagonal: added, so that pieces without a sample inside have an answer

# Set by theory. Check: `pytest tests/test_monitors.py -k memory`
NO_MEMORY = (1.0, 0.0)  # [1] what `memory` tells of white noise: differences show all of it


@dataclass(frozen=True)
class Polyline:
    """Corners at sample numbers `corners` (k,) with `values` (k,), in the unit of the record."""

    corners: np.ndarray
    values: np.ndarray


def noise_level(values: np.ndarray, lag: int = 1) -> float:
    """Standard deviation of noise on a slow signal: third differences of samples `lag` apart, robust against jumps.

    All of it where it is white, and what is faster than about three lags where it is not.
    """
    if values.size < LEAST_LAGS * lag:
        return 0.0
    return float(GAUSSIAN_MAD * np.median(np.abs(thirds(values, lag)))) / float(np.sqrt(THIRDS))


def thirds(values: np.ndarray, lag: int) -> np.ndarray:
    """The third differences of samples `lag` apart."""
    return values[3 * lag :] - 3 * values[2 * lag : -lag] + 3 * values[lag : -2 * lag] - values[: -3 * lag]


def noise_of_differences(differences: np.ndarray, order: int) -> np.ndarray:
    """The noise of which differences (..., n) of that order speak (...), robust against jumps."""
    size = np.median(np.abs(differences), axis=-1)
    return np.asarray(GAUSSIAN_MAD * size / np.sqrt(comb(2 * order, order)))


def changes_by_itself(values: np.ndarray) -> bool:
    """Whether a held signal changes by more than the noise of a monitor: a command that is new at every sample, such
    as rain or a heating; or at most samples, between exact repeats, such as dry days, and longer rests, such as nights.
    """
    begins, lasts = equal_stretches(values)
    brief = lasts < SAME_READINGS
    mostly_new = np.count_nonzero(brief) > MOSTLY_NEW * float(lasts[brief].sum())
    changing = values[begins[brief]] if mostly_new else values
    return noise_level(changing) > LARGEST * float(np.abs(values).max(initial=0.0))


def at_rest(values: np.ndarray) -> int:
    """How many samples repeat one reading exactly, in stretches of some length: there a monitor shows no noise.

    A stretch from the first sample on may be filled up, before a recorder was triggered; stretches at other readings
    may be those of lost samples.
    """
    begins, lasts = (each[1:] for each in equal_stretches(values))
    long = lasts >= SAME_READINGS
    _, which = np.unique(values[begins[long]], return_inverse=True)
    return int(np.bincount(which, lasts[long]).max(initial=0.0))


def equal_stretches(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where stretches of equal readings begin (k,), and how many samples they last (k,)."""
    begins = np.flatnonzero(np.append(True, np.diff(values) != 0))
    return begins, np.diff(np.append(begins, values.size))


def memory(values: np.ndarray) -> tuple[float, float] | None:
    """How much larger a monitor's noise is than its differences show, and the correlation of neighbouring samples.

    White noise has the same differences over any lag. Noise with a memory has larger ones until the lag outlasts it: at
    most twice the variance for each doubling of the lag, once the lag is longer than a filter rings. What a moving
    signal adds grows faster, and larger than a share of its largest value; what a ripple adds falls again about its
    period. So the first lag counts from which doubling it changes nothing; where none does, nothing is known (None).
    """
    first = noise_level(values)
    most = LARGEST * float(np.abs(values).max())
    lag, here = 1, first
    while first > 0 and values.size > LAGS * 2 * lag:
        twice = noise_level(values, 2 * lag)
        more = chance(lag, values.size)
        if lag > 1 and twice**2 < FALLS * here**2:
            return None
        if twice > most or (lag >= FILTERED and twice**2 > here**2 * (2 + more)):
            break
        if twice**2 < here**2 * (PLATEAU + more):
            ratio = (first / here) ** 2
            return (here / first, _correlation(ratio)) if ratio < 1 / COLOURED else NO_MEMORY
        lag, here = 2 * lag, twice
    return None


def chance(lag: int, size: int) -> float:
    """By how much the variance of differences over a lag may be larger by chance, relatively."""
    return SPREAD * float(np.sqrt(lag / size))


def _correlation(ratio: float) -> float:
    """The autoregression whose third differences have this share of the variance that white noise's have."""
    phi = np.linspace(0, MOST_CORRELATED, CORRELATIONS)
    return float(np.interp(-ratio, -seen(phi), phi))


def seen(phi: np.ndarray) -> np.ndarray:
    """The share of the variance of an autoregression that its third differences show, over a lag with correlation
    `phi`."""
    return (THIRDS - 30 * phi + 12 * phi**2 - 2 * phi**3) / THIRDS


def resolution(values: np.ndarray) -> float:
    """The smallest step between neighbouring samples, 0 where there is none."""
    step = np.abs(np.diff(values))
    return float(np.min(step[step > 0], initial=np.inf)) if np.any(step) else 0.0


def level(values: np.ndarray, remembered: tuple[float, float] | None = None, step: float = 0.0) -> float:
    """The noise of a monitor as it weighs on lines over many samples: as white noise of this level would.

    `remembered` is its `memory`, and `step` its resolution, where other records of the same monitor show them better.
    Not less than its resolution makes; without any, every sample would be an event.
    """
    told = remembered or memory(values)
    larger, phi = told or NO_MEMORY
    slow = larger * float(np.sqrt((1 + phi) / (1 - phi)))
    coarse = max(coarseness(values), step)
    thirds_say = noise_level(values)
    noise = _toggling(values, _under_signal(values, thirds_say) if told is None else thirds_say, coarse)
    return max(noise * slow, coarse / float(np.sqrt(12.0)), QUIET * float(np.ptp(values)))


def _under_signal(values: np.ndarray, noise: float) -> float:
    """White noise under a signal that moves so fast that its third differences show in those of the record: `noise`.

    The higher the order of differences, the less they show of a signal, and as much of white noise. So the first order
    counts from which on another one changes nothing; where there is none, nothing more is known than `noise`.
    """
    orders = [n for n in range(FIRST_ORDER, MOST_ORDER + 1) if n < values.size]
    told = [noise] + [
        GAUSSIAN_MAD * float(np.median(np.abs(np.diff(values, n)))) / comb(2 * n, n) ** 0.5 for n in orders
    ]
    ends = zip(told, told[1:], told[2:], strict=False)  # of a wave at few phases, medians go up and down
    return next((here for here, *others in ends if PLATEAU * min(others) ** 2 > here**2), noise)


def _toggling(values: np.ndarray, noise: float, step: float) -> float:
    """The `noise` of a slow signal; of one that is read in steps not much finer than that, with what rounding adds.

    The median of its differences is a whole number of steps, or none: there their mean square counts, but for
    switchings.
    """
    if noise >= FEW_STEPS * step:
        return noise
    thirds = np.abs(np.diff(values, 3))
    near = thirds[thirds <= SWITCHED * float(np.sqrt(THIRDS)) * max(noise, step)]
    return float(np.sqrt(np.mean(near**2) / THIRDS)) if near.size else noise


def long_run(left: np.ndarray) -> float:
    """The level of white noise whose averages vary as those of `left` (n,) do: its correlations added up.

    As far as sums of two neighbouring ones stay positive (Geyer, Statistical Science 7 (1992) 473).
    """
    size = 2 ** int(np.ceil(np.log2(2 * left.size)))
    power = np.abs(np.fft.rfft(left - left.mean(), size)) ** 2
    covariance = np.fft.irfft(power)[: left.size // 2] / left.size
    pairs = covariance[: covariance.size // 2 * 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0)
    kept = pairs[: ends[0]] if ends.size else pairs
    return float(np.sqrt(max(2 * kept.sum() - covariance[0], covariance[0] / left.size)))


def coarseness(values: np.ndarray) -> float:
    """A monitor's resolution; 0 where the smallest step is a switching, or others are not that many times as large.
    Readings that repeat tell nothing of it, nor does the smallest step of itself."""
    step = resolution(values)
    if not 0 < step < COARSEST * float(np.ptp(values)):
        return 0.0
    times = np.abs(np.diff(values)) / step
    times = np.sort(times[(times > 0) & (times <= SMALL_STEPS)])[1:]
    whole = np.abs(times - np.round(times)) < ROUNDLY
    return step if whole.size >= FEW_TO_TELL and np.mean(whole) > MOST_STEPS else 0.0


def polyline(time: np.ndarray, values: np.ndarray, noise: float, starts: np.ndarray | None = None) -> Polyline:
    """Continuous lines through `values` (n,) at ascending `time` (n,) [s], as simple as their noise allows.

    `starts` are samples at which a new line begins (the first one is understood): lines are not joined there.
    """
    n = values.size
    if n <= 3:
        return Polyline(np.arange(n), values.copy())
    begins = np.array([], dtype=int) if starts is None else starts
    fixed, broken = np.zeros((2, n), dtype=bool)
    fixed[np.concatenate([[0, n - 1], begins, begins - 1])] = True
    if noise <= 0:
        corners = np.flatnonzero(fixed | _bends(time, values))
        return Polyline(corners, values[corners])
    broken[begins - 1] = True  # no line from this sample to the next
    mean = float(values.mean())
    centred = values - mean  # so that sums lose no digits
    step = STEP if coarseness(values) < noise else REMOVE  # a coarse monitor shows what bends as steps
    corners = _prune(time, centred, np.arange(n), fixed, noise, step, STAGES)
    for _ in range(POLISH):
        corners = _move(time, centred, corners, fixed)
        corners = _insert(time, centred, corners, broken, noise)
        corners = _prune(time, centred, corners, fixed, noise, step, STAGES[-1:])
    missed = centred - np.interp(time, time[corners], _fit(time, centred, corners))
    allowed = WRONG * np.hypot(noise, coarseness(values) / 2)  # a coarse monitor may toggle between two readings
    far = np.convolve(missed**2, np.ones(MISSED_BLOCK) / MISSED_BLOCK, mode="same") > allowed**2
    if far.any():
        corners = np.union1d(corners, np.flatnonzero(np.convolve(far, np.ones(MISSED_BLOCK), mode="same") > 0.5))
    return Polyline(corners, mean + _fit(time, centred, corners))


def _bends(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """At which samples (n,) a record without noise is not on the line between its neighbours, by more than rounding."""
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    chord = values[:-2] + share * (values[2:] - values[:-2])
    off = np.abs(values[1:-1] - chord) > ROUNDING * float(np.abs(values).max(initial=0.0))
    return np.concatenate([[False], off, [False]])


def halved(time: np.ndarray, values: np.ndarray, line: Polyline) -> Polyline:
    """The line with one more corner in the middle of every piece.

    Corners are set where noise asks for them, so chords cut what bends by as much as noise allows, always to the same
    side: a monitor that follows fast waves less and less, as a line of gas does. With half as long pieces they cut a
    quarter of it, and what noise moves more is chance.
    """
    gaps = np.diff(line.corners)
    middle = (line.corners[:-1] + gaps // 2)[gaps >= SHORT]
    corners = np.union1d(line.corners, middle)
    return Polyline(corners, smoothed(time, values, corners))


def curved(time: np.ndarray, values: np.ndarray, line: Polyline, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and values (m,) of the line, with curves through all samples where it has a corner every few of them.

    A sine of six samples a period loses 8 % between them along straight lines: it would be a lag of the plant, were
    they taken for the signal. Hundreds of heartbeats add up to a mass what each loses within its noise. There the cubic
    through the four nearest samples is followed, at QUARTERS of the way, or in the middle where it bends little.
    """
    gaps = np.diff(line.corners)
    often = gaps <= DENSE
    often = often & np.append(False, often[:-1]) & np.append(often[1:], False)
    if not often.any():
        return time[line.corners], line.values
    inside = np.zeros(time.size, dtype=bool)
    for first, last in zip(line.corners[:-1][often], line.corners[1:][often], strict=True):
        inside[first : last + 1] = True
    kept = ~inside[line.corners]
    samples = np.sort(np.concatenate([line.corners[kept], np.flatnonzero(inside)]))
    t, v = time[samples], values[samples]
    v[~inside[samples]] = line.values[kept]
    return _cubic(t, v, np.flatnonzero(inside[samples][:-1] & inside[samples][1:]), noise)


def _cubic(t: np.ndarray, v: np.ndarray, pieces: np.ndarray, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Lines from `t` and `v` (n,), with a cubic in some `pieces` (by number) unless they end at a kink."""
    pieces = pieces[(pieces > 0) & (pieces < t.size - 2)]
    bend = np.diff(np.diff(v) / np.diff(t)) / (0.5 * (t[2:] - t[:-2]))  # of samples 1 to n - 2
    size = np.pad(np.abs(bend), 1)
    alone = np.append(False, np.maximum(size[:-2], size[2:]) <= STILL_CURVED * size[1:-1])  # of samples 0 to n - 2
    pieces = pieces[~(alone[pieces] | alone[pieces + 1])]
    first, second = bend[pieces - 1], bend[pieces]
    step = np.diff(t)[pieces]
    sags = {s: step**2 * s * (1 - s) / 6 * ((2 - s) * first + (1 + s) * second) for s in QUARTERS}
    well = np.abs(sags[0.5]) > WELL_BENT * noise
    times, found = [t], [v]
    for s, sag in sags.items():
        here = well | (s == 0.5)
        at = pieces[here]
        times.append(t[at] + s * step[here])
        found.append(v[at] + s * (v[at + 1] - v[at]) - sag[here])
    order = np.argsort(np.concatenate(times), kind="stable")
    return np.concatenate(times)[order], np.concatenate(found)[order]


def smoothed(time: np.ndarray, values: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Values (k,) of continuous lines at sample numbers `corners` (k,), by least squares."""
    mean = float(values.mean())  # so that sums lose no digits
    return mean + _fit(time, values - mean, corners)


@dataclass(frozen=True)
class _Segments:
    """Sums over the samples of the pieces between `corners` (k,), which make their normal equations.

    For every piece (k - 1,) its samples from one corner to before the next (the last one: to the end): their number,
    and the sums of s, s^2, v and s v, where s is the time since the piece began and v the value.
    """

    corners: np.ndarray
    length: np.ndarray
    sums: np.ndarray

    @staticmethod
    def of(time: np.ndarray, values: np.ndarray, corners: np.ndarray) -> _Segments:
        """From the samples."""
        count = np.diff(corners)
        count[-1] += 1
        since = time - np.repeat(time[corners[:-1]], count)
        terms = np.stack([np.ones(time.size), since, since**2, values, since * values])
        sums = np.add.reduceat(terms, corners[:-1], axis=1)
        return _Segments(corners, np.diff(time[corners]), sums)

    def without(self, removed: np.ndarray) -> _Segments:
        """With the pieces on both sides of every removed corner (k,) made one; no two neighbours are removed."""
        second = np.flatnonzero(removed)
        first = second - 1
        later = self.length[first]
        n, s, ss, v, sv = self.sums[:, second]
        sums, length = self.sums.copy(), self.length.copy()
        sums[:, first] += np.stack([n, s + n * later, ss + 2 * later * s + n * later**2, v, sv + later * v])
        length[first] += length[second]
        return _Segments(self.corners[~removed], np.delete(length, second), np.delete(sums, second, axis=1))

    def fit(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Least squares values at the corners, and the normal equations: diagonal (k,) and what is beside it."""
        n, s, ss, v, sv = self.sums
        part, square, moved = s / self.length, ss / self.length**2, sv / self.length
        diagonal = np.append(n - 2 * part + square, 0.0) + np.append(0.0, square)
        diagonal += RIDGE * diagonal.max()
        beside = part - square
        target = np.append(v - moved, 0.0) + np.append(0.0, moved)
        bands = np.stack([np.append(0.0, beside), diagonal])
        return solveh_banded(bands, target, check_finite=False), diagonal, beside


def _fit(time: np.ndarray, values: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Least squares values at the corners (k,)."""
    return _Segments.of(time, values, corners).fit()[0]


def _prune(
    time: np.ndarray,
    values: np.ndarray,
    corners: np.ndarray,
    fixed: np.ndarray,
    noise: float,
    step: float,
    stages: Sequence[float],
) -> np.ndarray:
    """Without the corners whose loss is below each of `stages` in turn.

    Those go that lose less than both neighbours, again and again; a `step` has to explain as much as it says.
    """
    pieces = _Segments.of(time, values, corners)
    for most in stages:
        while pieces.corners.size > 2:
            loss = _loss(pieces, noise)
            loss = np.maximum(loss, INDIFFERENT * (1 + np.arange(loss.size) % 2))  # of equals every second one goes
            loss[fixed[pieces.corners]] = np.inf
            below = loss < (most if most < REMOVE else _least(pieces.corners, values.size, step))
            loss[~below] = np.inf  # one that stays is in no one's way
            below[1:] &= loss[1:] < loss[:-1]
            below[:-1] &= loss[:-1] <= loss[1:]
            if not below.any():
                break
            pieces = pieces.without(below)
    return pieces.corners


def _least(corners: np.ndarray, samples: int, step: float) -> np.ndarray:
    """What each corner (k,) has to explain [squared standard deviations]: in long records more, if it is brief.

    A single sample in 16 000 is four standard deviations off by chance, and would make an undamped plant ring. So would
    a step.
    """
    gaps = np.diff(corners, prepend=-samples, append=corners[-1] + samples)
    brief, long = np.minimum(gaps[:-1], gaps[1:]), np.maximum(gaps[:-1], gaps[1:])
    least = np.maximum(REMOVE, ndtri(np.minimum(SPIKE_CHANCE * brief / (2 * samples), 0.5)) ** 2)
    return np.where((brief <= ABRUPT) & (long >= ALONE * brief), np.maximum(step, least), least)


def _loss(pieces: _Segments, noise: float) -> np.ndarray:
    """What the sum of squares over `noise` squared loses without each corner (k,); the outermost have none.

    The bend at a corner over its own variance, for which corners farther than its neighbours are taken as known: 4 %
    too little for equal pieces.
    """
    fitted, diagonal, beside = pieces.fit()
    share = pieces.length[:-1] / (pieces.length[:-1] + pieces.length[1:])
    bend = fitted[1:-1] - (1 - share) * fitted[:-2] - share * fitted[2:]
    first, mid, last = diagonal[:-2], diagonal[1:-1], diagonal[2:]
    up, down = beside[:-1], beside[1:]
    pull = 1 + up * (1 - share) / first + down * share / last
    variance = pull**2 / (mid - up**2 / first - down**2 / last) + (1 - share) ** 2 / first + share**2 / last
    loss = np.full(pieces.corners.size, np.inf)
    loss[1:-1] = bend**2 / np.maximum(variance, 1e-300) / noise**2
    return loss


def _insert(time: np.ndarray, values: np.ndarray, corners: np.ndarray, broken: np.ndarray, noise: float) -> np.ndarray:
    """With corners wherever one more explains the record better than chance."""
    while True:
        fitted = _fit(time, values, corners)
        scaled = (values - np.interp(time, time[corners], fitted)) / noise
        joined = ~broken[corners[:-1]]
        tips, gains = _tips(time, scaled, corners[:-1][joined], corners[1:][joined])
        added = tips[gains > INSERT]
        if not added.size:
            return corners
        corners = np.union1d(corners, added)


def _move(time: np.ndarray, values: np.ndarray, corners: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """The corners, each moved to where the line between its neighbours bends best; odd and even ones in turn."""
    corners = corners.copy()
    for turn in range(MOVED_IN_TURN):
        fitted = _fit(time, values, corners)
        chosen = np.arange(1 + turn % 2, corners.size - 1, 2)
        chosen = chosen[~fixed[corners[chosen]]]
        left, right = corners[chosen - 1], corners[chosen + 1]
        without = np.delete(np.arange(corners.size), chosen)
        chord = np.interp(time, time[corners[without]], fitted[without])
        tips, gains = _tips(time, values - chord, left, right)
        corners[chosen] = np.where(gains > 0, tips, corners[chosen])
    return corners


def _tips(time: np.ndarray, scaled: np.ndarray, left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """In every piece from sample `left` to `right` (m,), where a triangle with its tip there takes most, and how much.

    What it takes is from the sum of squares of `scaled` (n,); 0 for a piece without a sample inside.
    """
    size = right - left - 1
    piece = np.repeat(np.arange(size.size), size)
    first = np.cumsum(size) - size
    inner = np.arange(piece.size) - first[piece] + left[piece] + 1
    rising, falling = time[inner] - time[left[piece]], time[right[piece]] - time[inner]

    def up_to(terms: np.ndarray) -> np.ndarray:
        total = np.append(0.0, np.cumsum(terms))
        return total[1:] - total[first[piece]]

    def after(terms: np.ndarray) -> np.ndarray:
        total = np.append(0.0, np.cumsum(terms))
        return total[(first + size)[piece]] - total[1:]

    value = scaled[inner]
    product = up_to(rising * value) / rising + after(falling * value) / falling
    square = up_to(rising**2) / rising**2 + after(falling**2) / falling**2
    taken = product**2 / square
    best, tips = np.zeros(size.size), left.copy()
    there = np.flatnonzero(size > 0)
    if there.size:
        best[there] = np.maximum.reduceat(taken, first[there])
        top = np.flatnonzero(taken == best[piece])[::-1]
        tips[piece[top]] = inner[top]  # the first of equals is written last
    return tips, best
