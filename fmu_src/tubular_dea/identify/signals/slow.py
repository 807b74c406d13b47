"""How slow a monitor's noise is, from records in which its signal moves at corners and switchings only, or at rest.

White noise has the same differences over any lag. Noise with a memory has larger ones until the lag outlasts it. What
an event adds to them is left out: for a lag of a second, that is all within three seconds of it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.optimize import nnls

from .monitors import GAUSSIAN_MAD, LAGS, LARGEST, THIRDS, chance, seen, thirds

# Set by measurement: white and slow noise on ramps with four corners, six seeds each: 4 leaves corners in it (0.37 for
# 0.25), 3 takes noise away. Check: `pytest tests/test_monitors.py -k corners`
EVENT = 3.5  # [standard deviations] of differences beyond which they are of a corner or a switching
WITHOUT_EVENTS = 0.5  # [1] of all differences over a lag, at least, that are without one

# Set by measurement: of white noise, white noise and an autoregression, and 1/f noise, 3000 and 8000 samples, twelve
# seeds each, white noise is never more, and slow noise found within a third where its memory is a hundredth of all.
# Check: `pytest tests/test_monitors.py -k slow_noise`
MOST_GROWTH = 2.2  # [1] growth of it from one lag to twice that: 2 of noise whose memory is longer, and some chance
LEAST_ERROR = 0.02  # [1] relative error of such a variance at least: noise is not quite normally distributed
SLOW_EARNS = 9.0  # [squared standard errors] by which slow noise beside white noise has to explain them better
MEDIAN_ERROR = 2.3  # [1] of a normal variance told by the median of n / lag differences, in units of sqrt(lag / n)
MEMORY_STEP = 0.5  # [1] between logarithms to base 2 of the memories [samples] that are tried

# Set by judgement. Check: `pytest tests/test_monitors.py -k rest`
RESTS_AT = 20  # [samples] whose median is what a monitor rests at
LEFT_REST = 8.0  # [1] times its noise from sample to sample by which it has left that
BEGUN_BEFORE = 4  # [samples] before which it may have begun to, and whose averages last crossed what it rests at then
FEWEST_AT_REST = 40  # [samples] of rest that tell something
LAGS_AT_REST = 8  # [1] times the longest lag of its covariance that a rest lasts at least


def slow_level(records: Sequence[np.ndarray]) -> tuple[int, float] | None:
    """White noise that weighs as much on averages over many samples as a monitor's noise at rest does, behind the
    longest lag [samples] that tells it, from records (each (n,)) of one sampling step.

    White noise, and beside it an autoregression with that memory which explains best how differences grow with the lag,
    if it earns its place. 1/f noise has any memory: averages over the longest lag show most of it. One record is too
    short to tell a memory of seconds. None where a signal moves in all.
    """
    told = [(v, found) for v in records if (found := _grown(v)).size]
    if not told:
        return None
    lags = 2.0 ** np.arange(max(found.size for _, found in told))
    sizes = np.array([sum(v.size for v, found in told if found.size > k) for k in range(lags.size)])
    sums = [sum(v.size * found[k] for v, found in told if found.size > k) for k in range(lags.size)]
    longest = int(lags[-1])
    return longest, max(_level(lags, np.array(sums) / sizes, sizes), _of_averages([v for v, _ in told], longest))


def _of_averages(records: Sequence[np.ndarray], longest: int) -> float:
    """White noise whose averages over a lag have the same third differences as those of a monitor's noise (Hadamard's
    variance): for the lag up to `longest` at which that is most, if it is more than by chance; else 0."""
    white = before = _averages_vary(records, 1)[0]
    most = 0.0
    for doubled in range(1, longest.bit_length()):
        variance, relative = _averages_vary(records, 1 << doubled)
        if not 0 < variance < before * (MOST_GROWTH + relative):  # a signal that moves adds more
            break
        most, before = (max(most, variance) if variance > white * (1 + relative) else most), variance
    return float(np.sqrt(most))


def _averages_vary(records: Sequence[np.ndarray], lag: int) -> tuple[float, float]:
    """The variance of white noise that averages over a `lag` tell, and how much may be chance, relatively; 0 where
    none tells it."""
    told, count = 0.0, 0
    for values in records:
        sums = np.concatenate([[0.0], np.cumsum(values - values.mean())])
        averages = (sums[lag:] - sums[:-lag]) / lag
        if averages.size > LAGS * lag and (here := _calm_level(averages, lag)) is not None:
            told, count = told + values.size * lag * here**2, count + values.size
    return (told / count, MEDIAN_ERROR * chance(lag, count)) if count else (0.0, 0.0)


def level_at_rest(records: Sequence[np.ndarray], fast: float, least: int) -> float:
    """The same from what records (each (n,)) show before they move; 0 where none rests for `least` samples. `fast` is
    the noise from sample to sample.

    The spectral density at frequency 0, by the covariances over the lags that a short rest tells (Newey and West 1987).
    """
    rests = [part for values in records if (part := _rest(values, fast, least)).size]
    if not rests:
        return 0.0
    count, lags = sum(r.size for r in rests), np.arange(min(r.size for r in rests) // LAGS_AT_REST)
    covariances = [sum(float(r[: r.size - k] @ r[k:]) for r in rests) / count for k in lags]
    weights = np.where(lags == 0, 1.0, 2 * (1 - lags / lags.size))
    return float(np.sqrt(weights @ covariances / (1 - 2 / LAGS_AT_REST)))  # the rest went with the straight lines


def _rest(values: np.ndarray, fast: float, least: int) -> np.ndarray:
    """What a record shows before it moves, less its straight line; empty where that is less than `least` samples."""
    off = values - np.median(values[:RESTS_AT])
    moved = np.abs(off) > LEFT_REST * fast
    gone = int(np.argmax(moved))
    last = gone - BEGUN_BEFORE if moved.any() else values.size
    fewest = max(least, FEWEST_AT_REST)
    begun = last if last < fewest else _begun(_straightened(values[:last]), float(np.sign(off[gone])))
    return _straightened(values[:begun]) if begun >= fewest else np.empty(0)


def _straightened(values: np.ndarray) -> np.ndarray:
    """Values (n,) less their straight line."""
    number = np.arange(values.size)
    return np.asarray(values - np.polyval(np.polyfit(number, values, 1), number))


def _begun(rest: np.ndarray, side: float) -> int:
    """From which sample on a record whose `rest` (n,) this seems to be may already move to a `side` (1 or -1).

    Softly, it begins long before it is far off: where it last crosses its rest, if it goes farther from there than ever
    before.
    """
    near = side * np.convolve(rest, np.full(BEGUN_BEFORE, 1 / BEGUN_BEFORE), "valid")
    below = np.flatnonzero(near <= 0)
    begun = int(below[-1]) if below.size else 0
    farther = near[begun:].max() > np.abs(near[:begun]).max(initial=0.0)
    return begun if farther else rest.size


def _level(lags: np.ndarray, variances: np.ndarray, sizes: np.ndarray) -> float:
    """The level over many samples of noise with these variances (k,) over some lags, told by so many samples each."""
    errors = variances * np.hypot(np.sqrt(lags / sizes), LEAST_ERROR)
    one = np.ones(lags.size)
    (white,), left = nnls((one / errors)[:, None], variances / errors)
    best, level = left**2 - SLOW_EARNS, white
    for tau in 2.0 ** np.arange(0, lags.size, MEMORY_STEP):
        phi = np.exp(-1 / tau)
        (beside, slow), left = nnls(np.column_stack([one, seen(phi**lags)]) / errors[:, None], variances / errors)
        if left**2 < best:
            best, level = left**2, beside + slow * (1 + phi) / (1 - phi)
    return float(np.sqrt(level))


def _grown(values: np.ndarray) -> np.ndarray:
    """The variances of a monitor's noise over 1, 2, 4, ... samples (k,), as far as differences without an event tell
    them; none where a signal moves.

    Noise with a memory has differences that grow with the lag, at most to twice the variance for each doubling; what a
    moving signal adds grows faster.
    """
    lag, found, most = 1, [_calm_level(values, 1) or 0.0], LARGEST * float(np.abs(values).max())
    if not found[0]:
        return np.empty(0)
    while values.size > LAGS * 2 * lag and (here := _calm_level(values, 2 * lag)) is not None:
        if here > most or here**2 > found[-1] ** 2 * (MOST_GROWTH + chance(lag, values.size)):
            return np.empty(0)
        found.append(here)
        lag = 2 * lag
    return np.square(found)


def _calm_level(values: np.ndarray, lag: int) -> float | None:
    """The `noise_level` without differences that noise does not make, nor those beside them: corners and switchings of
    a signal. None where most are gone then.
    """
    moved = np.abs(thirds(values, lag))
    around = 2 * (values.size - moved.size) + 1  # differences that have samples in common with one in their middle
    calm = np.ones(moved.size, dtype=bool)
    while calm.mean() >= WITHOUT_EVENTS:
        noise = GAUSSIAN_MAD * float(np.median(moved[calm]))
        events = calm & (moved > EVENT * noise)
        if not events.any():
            return noise / float(np.sqrt(THIRDS))
        calm &= ~maximum_filter1d(events, around)
    return None
