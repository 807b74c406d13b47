"""Noise that grows with what is read: that of a laser whose spot blurs as the wall comes nearer.

::

    noise |          _.-'      sd = 1 + g u, u from 0 at the least reading to 1 at the largest
          |     _.-'
          |_.-'__________
             reading

The noise of short windows is told by sixth differences, of which smooth movement leaves nothing, robust against edges.
g is where its logarithms lie closest to the line. Readings are divided by it, so that noise is alike everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from .monitors import noise_of_differences, resolution

# Set by theory. Check: `pytest tests/test_growing_noise.py`
HIGH_DIFFERENCES = 6  # [1] order: of a sine of 20 samples a thousandth is left, of white noise all
LOW_DIFFERENCES = 3  # [1] order of those of which a sine of 20 samples leaves 3 %: as large where noise alone is

# Set by judgement. Check: `pytest tests/test_growing_noise.py`
TOLD_TOGETHER = 40  # [samples] whose noise is told together, a window
LEVEL_OVER = 25  # [samples] of the running median that tells the reading without its noise
THIRD = 1 / 3  # [1] of the way from the least reading to the largest: its ends are compared
FEWEST_AT_ENDS = 12  # [1] windows in the lowest and the highest third, at least
MOVES_BY = 0.5  # [1] by which the logarithm of both differences' ratio may be off the usual one: else something moves
QUIETEST_WINDOWS = 0.1  # [1] share of the windows that tells the least noise
STEPS_OF_NOISE = 2.0  # [1] steps of its resolution that the noise has there, at least

# Set by measurement: the recordings of ../shared/data/lab and of the bench come to 1.2 at most, and a laser that is 1.7
# times as loud under load left a null "unexplained". Check: `pytest tests/test_growing_noise.py`
MOVEMENT = 0.15  # [1] logarithm of the differences' ratio: noise of any memory 0.05, a mock loop at 50 Hz 0.33
SCATTER = 0.3  # [1] by which logarithms are off the line on average, at most: noise alone 0.23, what rings 0.55
LOUDER_AT_END = 1.4  # [1] times that noise differs between the ends of the readings, at least
GROWTH_EARNS = 20.0  # [1] by which twice the logarithm of the likelihood has to grow
RATIOS = np.geomspace(0.1, 10.0, 93)  # [1] of noise at the ends that are tried


@dataclass(frozen=True)
class Growth:
    """Noise at the largest reading is `ratio` times that at the least; `usual` is the rms of all readings' (1: that at
    the least)."""

    least: float
    span: float
    ratio: float
    usual: float = 1.0

    def at(self, values: np.ndarray) -> np.ndarray:
        """The noise of readings (n,) over the usual one (n,)."""
        level = median_filter(values, size=min(LEVEL_OVER, values.size), mode="nearest")
        return _louder(self.ratio, (level - self.least) / self.span) / self.usual


def growth(records: Sequence[np.ndarray]) -> Growth | None:
    """How the noise of records (each (n,), numbers only) grows with the reading; None where it is much the same, or not
    told."""
    steps = [step for values in records if (step := resolution(values))]
    windows = np.concatenate([_windows(np.empty(0)), *(_windows(values) for values in records)])
    windows = windows[np.all(windows[:, 1:] > 0, axis=1)]
    if not windows.size or np.quantile(windows[:, 1], QUIETEST_WINDOWS) < STEPS_OF_NOISE * min(steps, default=0.0):
        return None
    unlike = np.log(windows[:, 2] / windows[:, 1])
    if abs(np.median(unlike)) > MOVEMENT:  # what the plant does is not told from noise
        return None
    level, noise, _ = windows[np.abs(unlike - np.median(unlike)) < MOVES_BY].T
    least, largest = (float(f(values)) for f, values in ((np.min, level), (np.max, level)))
    share = (level - least) / max(largest - least, 1e-300)
    if min(np.count_nonzero(share < THIRD), np.count_nonzero(share > 1 - THIRD)) < FEWEST_AT_ENDS:
        return None
    costs = [_cost(noise, share, ratio) for ratio in RATIOS]
    ratio = float(RATIOS[int(np.argmin(costs))])
    alike, best = _cost(noise, share, 1.0), min(costs)
    if best > SCATTER or max(ratio, 1 / ratio) < LOUDER_AT_END or 2 * share.size * np.log(alike / best) < GROWTH_EARNS:
        return None
    found = Growth(least, largest - least, ratio)
    squares = [found.at(values) ** 2 for values in records if values.size]
    return Growth(least, largest - least, ratio, float(np.sqrt(np.mean(np.concatenate(squares)))))


def _louder(ratio: float, share: np.ndarray) -> np.ndarray:
    """The noise at a share of the way from the least reading to the largest, over that at the least."""
    return np.asarray(1 + (ratio - 1) * np.clip(share, 0.0, 1.0))


def _cost(noise: np.ndarray, share: np.ndarray, ratio: float) -> float:
    """How far the logarithms of noise lie from a line, on average: of windows with an edge in them as of others."""
    left = np.log(noise / _louder(ratio, share))
    return float(np.mean(np.abs(left - np.median(left))))


def _windows(values: np.ndarray) -> np.ndarray:
    """Level and noise of every window of a record, (k, 3): by differences of both orders."""
    whole = values[: values.size // TOLD_TOGETHER * TOLD_TOGETHER].reshape(-1, TOLD_TOGETHER)
    level = np.median(whole, axis=1)
    told = [noise_of_differences(np.diff(whole, n, axis=1), n) for n in (HIGH_DIFFERENCES, LOW_DIFFERENCES)]
    return np.column_stack([level, *told])
