"""Between which samples an input switched.

A switching differs from a ramp by its steps between samples: they exceed the noise, and the steps next to them. A
monitor's filter against aliasing rings about every switching, now above a level and now below: those samples belong to
it, and are no switchings of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from ..signals.sampling import usual_step

# Set by judgement. Check: `pytest tests/test_edges.py`,
# `python -m blind.score --nulls 12 --conventions edges --seed 1000`
FEW_ON_WAY = 3  # [samples] on the way at most for a ramp to stand for the edge; with more its shape is told
STANDS_OUT = 8.0  # [standard deviations] of noise that a step between samples of an edge has at least
LEADS_ON = 5.7  # [standard deviations] of noise that the steps beside those have: 4 of a difference of samples
BESIDE = 8  # [samples] on either side whose median step an edge's steps exceed
CONTRAST = 3.0  # [1] times by which they do
GOES_ON = 0.005  # [1] of an edge's height: a smaller step is no part of it

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions edges --seed 1000`
LEAST_STEP = 1e-3  # [1] of the span of its input: smaller steps are a monitor's, no switchings

# Set by judgement. Check: `pytest tests/test_edges.py`,
# `python -m blind.score --nulls 12 --conventions edges amplifier --seed 1000`
LONGEST_EDGE = 0.02  # [s] from sample to sample that an edge takes at most where its shape is followed, else it ramps
LONGEST_DECAY = 0.1  # [s] that one takes at most which comes to rest as an exponential does

# Set by judgement. Check: `pytest tests/test_edges.py -k exponential`
RESTED_BY_HALF = 0.75  # [1] of its height that an exponential has reached when half of its samples on the way are over

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions edges amplifier --seed 1000`
SLOW_EDGE = 5e-3  # [s] that slow amplifiers take

# Set by judgement. Check: `pytest tests/test_edges.py -k filter`,
# `python -m blind.score --nulls 12 --conventions edges antialias steep --seed 1000`
RINGING = 0.25  # [1] of an edge's height: what a filter overshoots by, at most
RINGS = 24  # [samples] that a filter rings for at most
HALF_WAVE = 3  # [samples] that it stays on one side of a level at most
LEAST_REST = 3  # [samples] behind these that tell the level


@dataclass(frozen=True)
class Transitions:
    """Samples `before` (m,), the last of the old level, and `after` (m,), the first of the new one."""

    before: np.ndarray
    after: np.ndarray

    def __len__(self) -> int:
        return int(self.before.size)

    @property
    def on_the_way(self) -> np.ndarray:
        """How many samples lie between the levels of each, (m,)."""
        return self.after - self.before - 1

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """The samples before and after of each."""
        return list(zip(self.before.tolist(), self.after.tolist(), strict=True))

    def only(self, chosen: np.ndarray) -> Transitions:
        """Some of them."""
        return Transitions(self.before[chosen], self.after[chosen])


def transitions(time: np.ndarray, values: np.ndarray, noise: float) -> Transitions:
    """All switchings of a held signal, without its ramps and its noise.

    They are sought between neighbouring samples, and between samples as far apart as slow amplifiers need.
    """
    found = _steps_in_a_row(time, values, noise)
    apart = int(SLOW_EDGE / usual_step(time)) if time.size > 2 else 1
    if apart > 1:
        coarse = _steps_in_a_row(time[::apart], values[::apart], noise)
        slow = [_exact(values, noise, a * apart, min(b * apart, values.size - 1)) for a, b in coarse.pairs]
        taken = np.zeros(time.size + 1)
        np.add.at(taken, found.before, 1)
        np.add.at(taken, found.after, -1)
        covered = np.append(0, np.cumsum(np.cumsum(taken[:-1]) > 0))
        new = [(a, b) for a, b in slow if covered[b + 1] == covered[a]]
        both = np.array(sorted([*found.pairs, *new]), dtype=int).reshape(-1, 2)
        found = Transitions(both[:, 0], both[:, 1])
    return _with_ringing(values, noise, found)


def _with_ringing(values: np.ndarray, noise: float, found: Transitions) -> Transitions:
    """With what a filter rings by, after its edges and before them, counted as samples on the way, and no switchings
    of their own."""
    if not len(found):
        return found
    height = np.abs(values[found.after] - values[found.before])
    floor, shows = STANDS_OUT / 2 * noise, LEADS_ON * noise
    begins = np.searchsorted(found.after, found.before - 2 * RINGS)
    ends = np.searchsorted(found.before, found.after + 2 * RINGS)
    listed: list[tuple[int, int]] = []
    kept = np.ones(len(found), dtype=bool)
    for i in np.argsort(-height, kind="stable"):
        if not kept[i]:
            continue
        near = slice(begins[i], ends[i])
        large = begins[i] + np.flatnonzero(height[near] >= RINGING * height[i])
        place = int(np.searchsorted(large, i))
        before, after = int(found.before[i]), int(found.after[i])
        first = int(found.after[large[place - 1]]) if place > 0 else max(0, before - 2 * RINGS)
        last = int(found.before[large[place + 1]]) if place + 1 < large.size else after + 2 * RINGS
        least, most = (floor, max(floor, GOES_ON * height[i])), RINGING * height[i]
        after += _rings_for(values[after : last + 1], least, (shows, most))
        before -= _rings_for(values[first : before + 1][::-1], least, (shows, most))
        listed.append((before, after))
        kept[near] &= (found.after[near] <= before) | (found.before[near] >= after)
    both = np.array(sorted(listed), dtype=int).reshape(-1, 2)
    return Transitions(both[:, 0], both[:, 1])


def _rings_for(values: np.ndarray, least: Sequence[float], largest: tuple[float, float]) -> int:
    """For how many samples a signal (n,) is more than one of `least` off the level it comes to, now above it and now
    below.

    0 where it does not ring, or its `largest` swing is not between these two: a smaller one is chance, and what stays
    on one side for long creeps, or is a level.
    """
    rest = values[RINGS : 2 * RINGS]
    off = values[:RINGS] - (np.median(rest) if rest.size >= LEAST_REST else values[-1])
    for size in least if largest[0] < np.abs(off).max() <= largest[1] else ():
        beyond = np.flatnonzero(np.abs(off) > size)
        if not beyond.size:
            break
        last = int(beyond[-1])
        turns = np.flatnonzero(np.diff(np.sign(off[: last + 1])))
        longest = int(np.diff(np.concatenate([[-1], turns, [last]])).max())
        if longest <= HALF_WAVE and last + 1 < values.size:
            return last + 1
    return 0


def _steps_in_a_row(time: np.ndarray, values: np.ndarray, noise: float) -> Transitions:
    """Steps one after the other in the same direction that stand out, with those that lead up to them and go on."""
    step = np.diff(values)
    if step.size < 2:
        return Transitions(*np.zeros((2, 0), dtype=int))
    floor = max(STANDS_OUT * noise, LEAST_STEP * float(np.ptp(values)))
    size = np.abs(step)
    fast = (size > floor) & (size > CONTRAST * _beside(size))
    direction = np.where(fast, np.sign(step), 0).astype(int)
    ends = np.flatnonzero(np.diff(np.concatenate([[0], direction, [0]])) != 0)
    listed: list[tuple[int, int]] = []
    for a, b in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
        if direction[a] == 0 or (listed and a < listed[-1][1]):
            continue
        least = max(LEADS_ON * noise, GOES_ON * abs(values[b] - values[a]))
        first, last = _extended(step * direction[a], a, b, least, listed[-1][1] if listed else 0)
        if last - first <= FEW_ON_WAY + 1 or time[last] - time[first] <= _longest(values[first : last + 1]):
            listed.append((first, last))
    before, after = np.array(listed, dtype=int).reshape(-1, 2).T
    return Transitions(before, after)


def _longest(values: np.ndarray) -> float:
    """How long an edge with the samples `values` (n,) may take [s]: what comes to rest by itself is no ramp."""
    part = (values - values[0]) / (values[-1] - values[0])
    return LONGEST_DECAY if part[part.size // 2] > RESTED_BY_HALF else LONGEST_EDGE


def _extended(up: np.ndarray, a: int, b: int, least: float, first: int) -> tuple[int, int]:
    """From `a` back to `first` at most and from `b` on, as long as steps `up` (n,) are at least `least`."""
    while a > first and up[a - 1] > least:
        a -= 1
    while b < up.size and up[b] > least:
        b += 1
    return a, b


def _exact(values: np.ndarray, noise: float, a: int, b: int) -> tuple[int, int]:
    """The last sample on the level at `a` and the first on that at `b` of a slow edge in between."""
    height = values[b] - values[a]
    near = max(LEADS_ON * noise / abs(height), GOES_ON)
    part = (values[a : b + 1] - values[a]) / height
    last = int(np.flatnonzero(part < 1 - near)[-1])
    return a + int(np.flatnonzero(part[: last + 1] < near)[-1]), a + last + 1


def _beside(size: np.ndarray) -> np.ndarray:
    """The larger one of the median steps before and after each step (n,), the step itself left out."""
    wide = np.concatenate([np.zeros(BESIDE), size, np.zeros(BESIDE)])
    running = median_filter(wide, size=BESIDE, mode="constant")  # of BESIDE steps, centred (to the left)
    at = np.arange(size.size) + BESIDE
    before, after = at - BESIDE + BESIDE // 2, at + 1 + BESIDE // 2
    return np.maximum(running[before], running[np.minimum(after, wide.size - 1)])


def few(found: Transitions) -> np.ndarray:
    """Those with few samples on the way, (m,)."""
    return found.on_the_way <= FEW_ON_WAY
