"""What a continuous signal does between its samples: where straight lines meet, and where nothing tells.

A monitor's lines bend at samples, but what moves the plant bends when it does. Where a ramp begins between two samples,
the line from one to the other misses a triangle, as high as the ramp climbs in a quarter of the time between them:

           /                     /
        o /                   o /        o samples, the last on the flat line and the first on the ramp
    o__-'/                o___/
    from sample to sample    where both lines meet

Of a ramp that two samples see at most, they do not tell when it began and how long it took: at 50 Hz, an aorta's
pressure that steps by 30 mmHg may be 1 kPa off the line between them. Of a model, what is read there tells nothing.
"""

from __future__ import annotations

import numpy as np

from ...stretches import true_stretches

# Set by theory: three samples and more, of which at most one is on another line, tell where a line runs.
# Check: `pytest tests/test_kinks.py`
STRAIGHT = 2  # [samples] that a line lasts at least on either side of a kink

# Set by judgement: a curve bends little by little, so that its lines miss it by no more than noise between samples.
# Check: `pytest tests/test_kinks.py`, `python -m blind.score --nulls 12 --conventions rates own_protocols --seed 20000`
BENT = 1.0  # [1] times its noise by which a line must miss a kink between samples for the kink to be sought
UNKNOWN = 3.0  # [1] times its noise by which the course between samples is unknown, at least, where it is not told
BRIEFLY = 3  # [samples] that such an event takes at most
RESPONDS = 2  # [samples] after it until which a plant feels when in between it happened

# Set by theory: a ramp climbs in a quarter of a step what the line from sample to sample misses at most, and a cubic
# has no fourth difference. Check: `pytest tests/test_kinks.py`
TRIANGLE = 0.25  # [1] of the bend of slopes times a step
ROUGHNESS = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # [1] weights of a fourth difference
ONE_STEP = 0.01  # [1] of a step by which two pieces together are one


Line = tuple[float, float, float]  # a time on it [s], its value there, and its slope


def kinked(
    time: np.ndarray, values: np.ndarray, lines: tuple[np.ndarray, np.ndarray], step: float, noise: float
) -> tuple[np.ndarray, np.ndarray]:
    """The `lines` (times and values (m,)) through samples `time` and `values` (n,), bent where those on both sides of a
    corner, or of a piece of one `step` [s], meet."""
    t, v = lines
    kept, meetings = np.ones(t.size, dtype=bool), []
    for first, last in _sought(t, v, step, noise):
        near = 0.5 * step if first == last else -0.5 * step  # a sample at the corner may be of either line
        left = through(time, values, t[first - 1] + 0.5 * step, t[first] - near)
        right = through(time, values, t[last] + near, t[last + 1] - 0.5 * step)
        room = step if first == last else 0.0
        meet = _meeting(left, right, t[first] - room, t[last] + room)
        if meet is not None:
            kept[first] = first != last
            meetings.append(meet)
    found = np.concatenate([np.column_stack([t, v])[kept], np.reshape(meetings, (-1, 2))])
    found = found[np.argsort(found[:, 0], kind="stable")]
    return found[:, 0], found[:, 1]


def _sought(t: np.ndarray, v: np.ndarray, step: float, noise: float) -> list[tuple[int, int]]:
    """Corners between which lines bend, the first and the last: one and the same, or both ends of a piece of one step.

    Those with a straight line on either side that bend by more than noise hides.
    """
    gaps = np.diff(t)
    straight, brief = gaps > (STRAIGHT - 0.5) * step, np.abs(gaps - step) < 0.5 * step
    bends = _bends(t, v, step) > BENT * noise
    single = np.flatnonzero(straight[:-1] & straight[1:] & bends) + 1
    double = np.flatnonzero(straight[:-2] & brief[1:-1] & straight[2:] & (bends[:-1] | bends[1:])) + 1
    return [*((int(k), int(k)) for k in single), *((int(k), int(k) + 1) for k in double)]


def _bends(t: np.ndarray, v: np.ndarray, step: float) -> np.ndarray:
    """By how much lines may miss a kink within a step of their corners 1 to m - 2."""
    return np.asarray(np.abs(np.diff(np.diff(v) / np.diff(t))) * step * TRIANGLE)


def through(time: np.ndarray, values: np.ndarray, begin: float, end: float) -> Line | None:
    """The straight line through the samples between two times [s]; None where they are too few."""
    part = slice(*np.searchsorted(time, [begin, end]))
    t, v = time[part], values[part]
    if t.size < STRAIGHT:
        return None
    middle, mean = float(t.mean()), float(v.mean())
    return middle, mean, float((t - middle) @ (v - mean) / np.sum((t - middle) ** 2))


def _meeting(left: Line | None, right: Line | None, begin: float, end: float) -> tuple[float, float] | None:
    """Where two lines meet, time and value, if they do so between two times [s]."""
    if left is None or right is None or left[2] == right[2]:
        return None
    along = (right[1] - left[1] - right[2] * (right[0] - left[0])) / (left[2] - right[2])
    time = left[0] + along
    return (time, left[1] + left[2] * along) if begin < time < end else None


def untold(
    time: np.ndarray, values: np.ndarray, lines: tuple[np.ndarray, np.ndarray], step: float, noise: float
) -> np.ndarray:
    """Spans (k, 2) [s] in which samples do not tell the course of a signal, nor what a plant does that feels it.

    There the `lines` (times and values (m,)), bent where they meet, have pieces too brief for that, alone between
    straight ones, and no curve runs through the samples.
    """
    t, gaps = lines[0], np.diff(lines[0])
    brief = (gaps < (STRAIGHT + 0.5) * step) & ~_kinked(gaps, step)
    rough = _rough(values) > UNKNOWN * noise
    found = []
    for first, last in true_stretches(brief):  # pieces from `first` on, before `last`
        alone = t[last] - t[first] < (BRIEFLY + 0.5) * step and first > 0 and last < gaps.size
        if alone and rough[slice(*np.searchsorted(time, [t[first] - 0.5 * step, t[last] + 0.5 * step]))].any():
            found.append((t[first], t[last] + RESPONDS * step))
    return np.array(found).reshape(-1, 2)


def _rough(values: np.ndarray) -> np.ndarray:
    """By how much every sample (n,) is off the cubic through the two before and the two after it, in units of what is
    chance; 0 for those without."""
    if values.size < ROUGHNESS.size:
        return np.zeros(values.size)
    off = np.abs(np.convolve(values, ROUGHNESS / np.linalg.norm(ROUGHNESS), "valid"))
    return np.pad(off, ROUGHNESS.size // 2)


def _kinked(gaps: np.ndarray, step: float) -> np.ndarray:
    """Which pieces (k,), so long [s], are parts of one step with a kink in between."""
    whole = np.abs(gaps[:-1] + gaps[1:] - step) < ONE_STEP * step
    return np.append(whole, False) | np.append(False, whole)
