"""A band-limited input: a signal that an analogue filter kept below half the sampling rate.

Such a signal is determined between its samples too (Shannon). It is represented by straight lines on a finer grid,
by zero-padding its spectrum. Beyond its ends the record is continued by its point reflection, so that no jump in value
or slope makes the spectrum ring.

Straight lines through the signal attenuate a frequency f by sinc^2(f step); the rest is aliased above the sampling
rate. Where no output depends on the input directly, the points are therefore chosen such that the lines have the
signal's spectrum below half the sampling rate (Unser, "Sampling - 50 years after Shannon", Proc. IEEE 88 (2000) 569).
States do not respond to the aliased part, so two points per sample do as well as eight otherwise.
"""

from __future__ import annotations

import numpy as np

from ..signals.sampling import usual_step

# Set by measurement: a tenth of it costs four times the points. Check: `python -m measured.table`
CLOSE = 5e-3  # [1] of the signal's rms: what straight lines may miss it by

# Set by judgement. Check: `pytest tests/test_monitors.py`, `python -m measured.table`
ABOVE = 2e-2  # [1] the same where all that they miss lies above the sampling rate

# Set by judgement: no unit test tells a factor of four. Check: `python -m measured.table`
FINEST = 32  # [1] points a sample at most
PADDED = 64  # [samples] of mirror image at either end
SPECTRUM_SHARES = 40  # [1] parts of a spectrum, over one of which its power is averaged for that,
LEAST_FREQUENCIES = 8  # [1] frequencies at least
QUIETEST = 0.05  # [1] share of the frequencies whose power is taken for noise: the least

# Set by theory: a band-limited signal follows from samples that lie off even ones by less than a quarter of a step
# (Kadec). Check: `pytest tests/test_monitors.py -k jitter`
JITTER = 0.24  # [1] of the time between samples: how far off an even clock they lie at most
EVENED = 1e-3  # [1] of the signal's rms: what even samples may miss the recorded ones by (rms)
EVENING = 20  # [1] passes at most

# Set by theory: of a parabola. Check: `pytest tests/test_monitors.py`
LINE = float(np.sqrt(8 / 15))  # [1] rms over its chord, in units of what the chord misses in the middle
BEND = float(np.sqrt(1 / 720))  # [1] rms beside the line that has its mean, in units of curvature times step^2


def band_limited(time: np.ndarray, values: np.ndarray, direct: bool = True) -> tuple[np.ndarray, np.ndarray, float]:
    """Times and values on a finer grid, and by how much (rms) straight lines between them miss the signal.

    `direct` says that some output follows the input at once: then the lines go through the signal. They miss it by
    CLOSE (or ABOVE) of it at most, if FINEST points a sample suffice. The monitor's noise allows no more: in a signal
    with parts at all frequencies it is not known, only a bound of it. `time` is evenly spaced.
    """
    allowed = (CLOSE if direct else ABOVE) * float(np.std(values))
    missed = _cut if direct else _above
    finer = 1
    while finer < FINEST and missed(values, finer) >= allowed:
        finer *= 2
    fine = _finer(values, finer, corrected=not direct)
    step = (time[-1] - time[0]) / (time.size - 1) / finer
    return time[0] + step * np.arange(fine.size), fine, missed(values, finer)


def even(time: np.ndarray) -> np.ndarray:
    """The even times next to those of samples (n,)."""
    index = np.arange(time.size)
    line = np.polyval(np.polyfit(index, time - time[0], 1), index)
    off = time - time[0] - line
    return np.asarray(time[0] + line + (off.max() + off.min()) / 2)


def off_even(time: np.ndarray) -> float:
    """How far the samples lie off an even clock, in steps of it."""
    return float(np.abs(time - even(time)).max() / usual_step(time))


def evened(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Even times, and the values there of the band-limited signal that has `values` (n,) at an uneven `time` (n,).

    Again and again by what it still misses them by.
    """
    there, found = even(time), values.copy()
    fine = np.linspace(there[0], there[-1], FINEST * (time.size - 1) + 1)
    for _ in range(EVENING):
        missed = values - np.interp(time, fine, _finer(found, FINEST))
        if np.std(missed) <= EVENED * np.std(values):
            break
        found = found + missed
    return there, found


def _cut(values: np.ndarray, finer: int) -> float:
    """By how much (rms) lines through the signal miss it over `finer` pieces a sample."""
    twice = _finer(values, 2 * finer)
    return float(np.sqrt(np.mean((twice[1::2] - (twice[:-1:2] + twice[2::2]) / 2) ** 2))) * LINE


def _above(values: np.ndarray, finer: int) -> float:
    """By how much (rms) lines with the signal's own spectrum miss it: what they have above the sampling rate."""
    spectrum, _, size = _spectrum(values)
    bends = (2 * np.pi * np.fft.rfftfreq(size) / finer) ** 2
    return BEND * float(np.sqrt(2 * np.sum(np.abs(spectrum * bends) ** 2))) / size


def _spectrum(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """The spectrum of the signal with its mirror images beside the line between their ends; that line; their size."""
    pad = min(PADDED, values.size - 1)
    begin = 2 * values[0] - values[pad:0:-1]
    end = 2 * values[-1] - values[-2 : -2 - pad : -1]
    whole = np.concatenate([begin, values, end])
    slope = (whole[-1] - whole[0]) / (whole.size - 1)  # the spectrum wants both ends alike
    line = np.array([slope, whole[0]])
    return np.fft.rfft(whole - np.polyval(line, np.arange(whole.size))), line, whole.size


def _finer(values: np.ndarray, times: int, corrected: bool = False) -> np.ndarray:
    """The signal at every sample and `times` - 1 points in between, shape (times (n - 1) + 1,).

    `corrected`: not the signal there, but the points whose lines have its spectrum.
    """
    pad = min(PADDED, values.size - 1)
    spectrum, line, size = _spectrum(values)
    if corrected:
        spectrum = spectrum / np.sinc(np.fft.rfftfreq(size) / times) ** 2
    if size % 2 == 0 and times > 1:
        spectrum[-1] /= 2  # half the sampling rate itself, seen once and not from both sides
    fine = times * np.fft.irfft(spectrum, times * size)
    fine += np.polyval(line, np.arange(fine.size) / times)
    return fine[times * pad : times * (pad + values.size - 1) + 1]


def noise_floor(values: np.ndarray) -> float:
    """Standard deviation of white noise under a band-limited signal: where its spectrum is lowest."""
    power = np.abs(np.fft.rfft((values - values.mean()) * np.hanning(values.size))) ** 2
    width = max(power.size // SPECTRUM_SHARES, LEAST_FREQUENCIES)
    smooth = np.convolve(power, np.ones(width) / width, mode="valid")
    least = float(np.quantile(smooth, QUIETEST))
    return float(np.sqrt(least / np.sum(np.hanning(values.size) ** 2)))
