"""What a monitor would have shown without its noise: straight lines between as few corners as it supports.

The recorded inputs drive the model, and so does their noise: 25 Pa of it leave 3 to 5 um in the radius. A bench's
inputs are ramps, steps and slow waves, so most of that noise can be told from the signal. `polyline` fits a
continuous line with corners at samples; a corner is set wherever one more explains the record better than chance,
so that a signal that really moves at every sample is kept as it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

INSERT = 11.0  # squared standard deviations by which one more corner must explain the record better
REMOVE = 8.0  # and below which a corner is taken out again
ROUNDS = 40
QUIET = 1e-4  # of its span: noise below which a record comes from a computer or a set point


@dataclass(frozen=True)
class Line:
    """Corners at sample numbers `corners` (k,) with `values` (k,), in the unit of the record."""

    corners: np.ndarray
    values: np.ndarray


def noise_level(values: np.ndarray) -> float:
    """Standard deviation of white noise on a slow signal: third differences, robust against jumps."""
    if values.size < 8:
        return 0.0
    thirds = np.diff(values, 3) / np.sqrt(20.0)
    return float(1.4826 * np.median(np.abs(thirds)))


def resolution(values: np.ndarray) -> float:
    """The smallest step between neighbouring samples, 0 where there is none."""
    step = np.abs(np.diff(values))
    return float(np.min(step[step > 0], initial=np.inf)) if np.any(step) else 0.0


def jumps(values: np.ndarray, noise: float) -> np.ndarray:
    """Numbers of the samples at which a held signal has just switched.

    A switch stands out from the differences around it, unlike a ramp, and from eight times the noise.
    """
    if values.size < 2:
        return np.array([], dtype=int)
    step = np.abs(np.diff(values))
    around = np.minimum(np.append(0.0, step[:-1]), np.append(step[1:], 0.0))
    floor = max(8.0 * noise, 1e-3 * float(np.ptp(values)))
    return np.flatnonzero((step > floor) & (step > 3 * around)) + 1


def polyline(time: np.ndarray, values: np.ndarray, noise: float) -> Line:
    """A continuous line through `values` (n,) at ascending `time` (n,) [s], as simple as their noise allows."""
    n = values.size
    if n <= 3 or noise <= 0:
        return Line(np.arange(n), values.copy())
    corners = _insert(time, values, np.array([0, n - 1]), noise)
    corners = _move(time, values, _prune(time, values, corners, noise))
    corners = _insert(time, values, corners, noise)
    return Line(corners, _fit(time, values, corners))


def _insert(time: np.ndarray, values: np.ndarray, corners: np.ndarray, noise: float) -> np.ndarray:
    """With corners wherever one more explains the record better than chance."""
    for _ in range(ROUNDS):
        fitted = _fit(time, values, corners)
        added = _worst_places(time, (values - np.interp(time, time[corners], fitted)) / noise, corners)
        if not added:
            break
        corners = np.unique([*corners, *added])
    return corners


def _fit(time: np.ndarray, values: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Least squares values at the corners of the continuous line (tridiagonal normal equations)."""
    place = np.clip(np.searchsorted(corners, np.arange(values.size), side="right") - 1, 0, corners.size - 2)
    left, right = time[corners[place]], time[corners[place + 1]]
    part = (time - left) / (right - left)
    k = corners.size
    diagonal = np.bincount(place, (1 - part) ** 2, k) + np.bincount(place + 1, part**2, k)
    beside = np.bincount(place, part * (1 - part), k)[: k - 1]
    target = np.bincount(place, (1 - part) * values, k) + np.bincount(place + 1, part * values, k)
    bands = np.zeros((2, k))
    bands[1] = diagonal + 1e-12 * diagonal.max()
    bands[0, 1:] = beside
    return solveh_banded(bands, target)


def _worst_places(time: np.ndarray, scaled: np.ndarray, corners: np.ndarray) -> list[int]:
    """In every piece, the sample where one more corner gains most, if it gains enough."""
    added = []
    for a, b in zip(corners[:-1], corners[1:], strict=True):
        if b - a < 2:
            continue
        inner = np.arange(a + 1, b)
        gain = _corner_gain(time[a : b + 1], scaled[a : b + 1])
        best = int(np.argmax(gain))
        if gain[best] > INSERT:
            added.append(int(inner[best]))
    return added


def _corner_gain(time: np.ndarray, scaled: np.ndarray) -> np.ndarray:
    """What a triangle over the piece with its tip at each inner sample would take from the sum of squares."""
    rising, falling = time - time[0], time[-1] - time
    inner = slice(1, time.size - 1)
    up, up_squared = np.cumsum(rising * scaled)[inner], np.cumsum(rising**2)[inner]
    down = np.cumsum((falling * scaled)[::-1])[::-1][2:]
    down_squared = np.cumsum((falling**2)[::-1])[::-1][2:]
    product = up / rising[inner] + down / falling[inner]
    square = up_squared / rising[inner] ** 2 + down_squared / falling[inner] ** 2
    return product**2 / square


def _prune(time: np.ndarray, values: np.ndarray, corners: np.ndarray, noise: float) -> np.ndarray:
    """Without the corners that explain nothing, the least useful first, never two neighbours at once."""
    while corners.size > 2:
        fitted, at = _fit(time, values, corners), time[corners]
        chord = fitted[:-2] + (fitted[2:] - fitted[:-2]) * (at[1:-1] - at[:-2]) / (at[2:] - at[:-2])
        loss = ((fitted[1:-1] - chord) / noise) ** 2 * (corners[2:] - corners[:-2]) / 8.0
        chosen: list[int] = []
        for i in np.argsort(loss):
            if loss[i] < REMOVE and all(abs(i - j) > 1 for j in chosen):
                chosen.append(int(i))
        if not chosen:
            break
        corners = np.delete(corners, np.array(chosen) + 1)
    return corners


def _move(time: np.ndarray, values: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """The corners, each moved to where the line between its neighbours bends best; odd and even ones in turn."""
    for turn in range(4):
        fitted = _fit(time, values, corners)
        for i in range(1 + turn % 2, corners.size - 1, 2):
            a, b = corners[i - 1], corners[i + 1]
            chord = np.interp(time[a : b + 1], time[[a, b]], fitted[[i - 1, i + 1]])
            if b - a > 2:
                corners[i] = a + 1 + int(np.argmax(_corner_gain(time[a : b + 1], values[a : b + 1] - chord)))
    return corners
