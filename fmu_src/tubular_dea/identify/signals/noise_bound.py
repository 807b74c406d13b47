"""An upper bound of a sensor's noise: the prediction error of an autoregression.

Whatever moves a plant, and whatever a model lacks, an autoregression predicts what is slow of it, but not white noise.
The bound is needed where a record has no quiet part (a circuit driven by a broadband signal, a pendulum that swings):
its noise estimate then contains signal and is far too large, or has the signal's colour. In that case white noise of
the size of the bound is assumed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import solve_toeplitz

from .noise import BRIEF, Noise

# Set by judgement. Check: `pytest tests/test_acceptance.py::test_noise_is_no_more_than_a_residual_hides_from_its_past`,
# `python -m measured.table`
TOO_MUCH = 1.25  # [1] times the bound: noise below that is left as it was estimated

# Set by judgement: no unit test tells a factor of four. Check: `python -m measured.table`
ORDER = 20  # [samples] that the autoregression looks back
LOOKS_BACK = 4  # [1] times as long as that a record is at least; of shorter ones it looks back less

# Set by theory: nothing beside 1. Check: `pytest tests/test_acceptance.py`, `python -m measured.table`
REGULAR = 1e-9  # [1] of the variance, added to it: what is predicted without error has an answer too

# Set by theory: noise with a memory of BRIEF samples has 8 times the variance of white noise that is as strong at the
# frequency above which lies CALM_PART of all; twice that is allowed, by judgement.
# Check: `pytest tests/test_noise.py -k louder`, `python -m measured.table`
BRIEFLY_COLOURED = 4.0  # [1] times the rms of white noise as strong as a record where it is calm: that of its noise
CALM_PART = 0.33  # [1] of all frequencies: what filters leave out above a third of the sampling tells no noise
PERIODOGRAM = 256  # [samples] of the periodograms that are averaged


def limited(known: Noise, left: list[np.ndarray], hummed: bool = False) -> Noise:
    """Noise, limited to what the residuals `left` (each (n,)) allow, unless it was stated; `hummed`: its level was
    estimated with hum."""
    if known.stated:
        return known
    known = known if known.quiet else _no_louder(known, left)
    bound = prediction_error(left)
    if bound <= 0:
        return known
    innovation = known.own_innovation  # a line need not follow its monitor's noise at every sample
    # without a quiet stretch the signal cannot be separated from noise of its colour
    if innovation > TOO_MUCH * bound or (not known.quiet and known.tau > known.brief * known.step):
        freedom, memory = float(sum(r.size for r in left)), _brief_memory(left, known.brief)
        return Noise(
            bound / float(np.sqrt(1 - memory**2)),
            memory,
            freedom,
            hum=known.hum,
            step=known.step if memory else 0.0,
            form=known.form,
            quiet=known.quiet,
            slow_known=known.slow_known,
            grain=known.grain,
        ).of(known.plant)
    if hummed and innovation > bound:
        known = replace(known, rms=known.rms * bound / innovation)
    return _no_larger(known, left)


def _no_louder(known: Noise, left: list[np.ndarray]) -> Noise:
    """Noise no louder than it can be where the residuals (each (n,)) are calm: noise is at every frequency, and more
    than a brief memory cannot be told from what a model lacks."""
    most = BRIEFLY_COLOURED * float(np.sqrt(known.brief / BRIEF)) * calmest(left)
    if known.rms <= most:
        return known
    quieter = Noise(most, 0.0, known.freedom, known.hum, form=known.form, quiet=False, grain=known.grain)
    return quieter.of(known.plant)


def calmest(records: list[np.ndarray]) -> float:
    """The rms of white noise as strong as records (each (n,)) are at the calmest part of all frequencies."""
    size = min(PERIODOGRAM, *(r.size for r in records))
    powers = [(r.size, _spectrum(r, size)) for r in records]
    power = sum(n * p for n, p in powers) / sum(n for n, _ in powers)
    return float(np.sqrt(0.5 * np.quantile(power, CALM_PART)))  # up to half a cycle a sample


def _spectrum(values: np.ndarray, size: int) -> np.ndarray:
    """Power ((size - 1) // 2,) over frequency without both ends, of Hann windows that overlap by half (Welch 1967).

    As `scipy.signal.welch`, whose import takes a sixth of what `close-loop` takes for a short record.
    """
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(size) / size)
    pieces = sliding_window_view(values, size)[:: size - size // 2]
    powers = np.abs(np.fft.rfft(window * (pieces - pieces.mean(axis=1, keepdims=True)))) ** 2
    return 2 * powers.mean(axis=0)[1 : (size + 1) // 2] / float(window @ window)


def _no_larger(known: Noise, left: list[np.ndarray]) -> Noise:
    """Noise no larger than the residuals (each (n,)) that it is a part of: then its memory is shorter than thought.

    Quiet stretches last too short to tell a memory of seconds; what is new in each sample they tell well.
    """
    rms = float(np.sqrt(sum(float(r @ r) for r in left) / sum(r.size for r in left)))
    if known.white > 0 or not known.own_innovation < rms < known.rms:
        return known
    return replace(known, rms=rms, correlation=float(np.sqrt(1 - (known.own_innovation / rms) ** 2)))


def _brief_memory(records: list[np.ndarray], brief: float) -> float:
    """The correlation of neighbours in records (each (n,)); 0 where it lasts longer than noise may, `brief` samples."""
    squares, beside = _covariances(records, 1)
    found = beside / squares if squares > 0 else 0.0
    return found if 0 < found < np.exp(-1 / brief) else 0.0


def prediction_error(records: list[np.ndarray]) -> float:
    """Root mean square prediction error of an autoregression over all records (each (n,))."""
    order = min(ORDER, min(r.size for r in records) // LOOKS_BACK)
    lags = _covariances(records, order) / sum(r.size for r in records)
    if lags[0] <= 0:
        return 0.0
    lags[0] *= 1 + REGULAR
    weights = solve_toeplitz(lags[:-1], lags[1:])
    return float(np.sqrt(max(lags[0] - weights @ lags[1:], 0.0)))


def _covariances(records: list[np.ndarray], most: int) -> np.ndarray:
    """The sums of products of samples 0 to `most` apart, over all records (each (n,)) without their means."""
    centred = [r - r.mean() for r in records]
    return np.array([sum(float(r[k:] @ r[: r.size - k]) for r in centred) for k in range(most + 1)])
