"""The switching instants of an input, as far as its samples determine them.

If the sample at t_k has the new value and that at t_(k-1) the old one, the input switched in between. The best estimate
is then the middle, and the bounds are the two samples. With a slow amplifier, a sample may fall on the edge; if the
rise is known, the height of this sample determines the instant. The rise is common to all edges of a record (or of a
set). It follows from the heights of such samples and from how often they occur. Where more samples than `FEW_ON_WAY`
lie on an edge, they tell whether it is an exponential one; if not, its shape is recorded and used as it is.

A set point without noise, written by a computer, changes at the sample that first shows the new value: there this
sample is the best estimate, and both bounds.

A switching differs from a ramp by its steps between samples: they exceed the noise, and the steps next to them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.ndimage import median_filter

from .sampling import usual_step

# Set by judgement. Check: `pytest tests/test_edges.py`,
# `python -m blind.score --nulls 12 --conventions edges --seed 1000`
FEW_ON_WAY = 3  # [samples] on the way at most for a ramp to stand for the edge; with more its shape is told
STANDS_OUT = 8.0  # [standard deviations] of noise that a step between samples of an edge has at least
BESIDE = 8  # [samples] on either side whose median step an edge's steps exceed
CONTRAST = 3.0  # [1] times by which they do
MATTERS = 0.02  # [1] of the span: the instant of a smaller step moves the answer by less than any noise
GOES_ON = 0.005  # [1] of an edge's height: a smaller step is no part of it

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions edges --seed 1000`
LEAST_STEP = 1e-3  # [1] of the span of its input: smaller steps are a monitor's, no switchings

# Set by judgement. Check: `pytest tests/test_edges.py`,
# `python -m blind.score --nulls 12 --conventions edges amplifier --seed 1000`
ROUGH_SHAPE = 0.03  # [1] of an edge's height by which amplifiers differ from ramps and exponentials
LONGEST_EDGE = 0.02  # [s] from sample to sample that an edge takes at most where its shape is followed, else it ramps
LONGEST_DECAY = 0.1  # [s] that one takes at most which comes to rest as an exponential does
BLURRED = 2.0  # [standard errors] of an instant by noise and by the shape that its bounds are wider
NOWHERE = 1e-6  # [1] of the likeliest rise's chance: rises with less need not be tried again
UNLIKELY = 0.01  # [1] of the likeliest rise's chance: rises with less do not count in an edge's bounds
TOGETHER = 5  # [1] edges from which on it can be told whether all fall on the same part of the sampling
SYNCHRONOUS = 0.1  # [1] spread of the parts below which they do: 0.29 where instants have nothing to do with samples

# Set by judgement. Check: `pytest tests/test_edges.py -k exponential`
MOST_ON_WAY = 24  # [samples] on the way up to which an exponential is told apart; with more straight lines follow it
FAITHFUL = 0.01  # [1] of its height by which samples miss an exponential: others miss it by 0.04 and more
RESTED = 0.75  # [1] of its height that an exponential has reached when half of its samples on the way are over

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions edges amplifier --seed 1000`
SLOW_EDGE = 5e-3  # [s] that slow amplifiers take
SHORTEST = 0.01  # [samples] that the shortest rise takes that is tried
TRIALS = 96  # [1] rises that are tried
PLAINER = 2.0  # [log likelihood] by which an exponential rise has to be likelier than a ramp
SAMPLED = 300  # [1] edges at most, evenly taken, that tell the rise: more tell it no better

# Set by judgement. Check: `pytest tests/test_edges.py`,
# `python -m blind.score --nulls 12 --conventions edges antialias --seed 1000`
RINGING = 0.25  # [1] of an edge's height: what a filter overshoots by, at most
RINGS = 24  # [samples] that a filter rings for at most
HALF_WAVE = 3  # [samples] that it stays on one side of a level at most
LEAST_REST = 3  # [samples] behind these that tell the level
BETWEEN = 0.4  # [1] of an edge's height about its middle: a filter leaves few samples there

# Set by measurement: 0.04 to 0.06 behind a Butterworth filter of second order at 0.35 to 0.45 of the rate, 0.02 to 0.04
# behind steeper ones. Check: `pytest tests/test_edges.py -k filter`
ALIASED = 0.06  # [samples] by which the centroid of samples is off that a filter against aliasing let pass

# Set by judgement: an edge of 1.5 samples behind such a filter still overshoots. Check: `pytest tests/test_edges.py`
HIDDEN_RISE = 1.5  # [samples] that an edge takes at most that a filter with overshoot hides

# Set by theory: a ramp of so many time constants spreads as an exponential rise does.
# Check: `pytest tests/test_edges.py -k spreads`
EXPONENTIAL = float(np.sqrt(12.0))  # [1] duration of a ramp over the time constant that it stands for

# Set by theory: least squares over the rise; 9e-3 rms of its height. Chords through an exponential come late.
# Check: `pytest tests/test_edges.py -k corners_of_an_exponential`
BENDING = np.array([0.0, 0.5, 1.3, 2.6, 5.5])  # [time constants] from its begin to the corners of an exponential's line
RISEN = np.array([0.0, 0.417, 0.7488, 0.9472, 1.0])  # [1] of its height that the line has there


@dataclass(frozen=True)
class Edge:
    """One switching of `input`. Times in s, levels in SI units.

    `time` is the best estimate of its centroid, which lies between `earliest` and `latest`. Between the levels `low`
    before and `high` after it, its `shape` is that of a straight ramp of `rise` (0: a jump), of an exponential that
    spreads as this ramp does, or as it was recorded.
    """

    input: str
    time: float
    earliest: float
    latest: float
    rise: float
    low: float
    high: float
    shape: Literal["ramp", "exponential", "recorded"] = "ramp"

    @property
    def corners(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners of the line that stands for it: times from its centroid over half its rise, parts of its height."""
        if self.shape == "exponential":
            return 2 * (BENDING - 1) / EXPONENTIAL, RISEN
        return np.array([-1.0, 1.0]), np.array([0.0, 1.0])


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

    def only(self, chosen: np.ndarray) -> Transitions:
        """Some of them."""
        return Transitions(self.before[chosen], self.after[chosen])


@dataclass(frozen=True)
class Rise:
    """How an amplifier rises: as a ramp or as an exponential, which lasts or has a time constant of `trials` (k,) [s].

    `weights` (k,) are the chances of the trials. Nothing is `seen` where no sample ever fell on the way: then a jump
    is the simplest that agrees, and the trials say how slow it may be all the same.
    """

    exponential: bool
    trials: np.ndarray
    weights: np.ndarray
    seen: bool

    @property
    def spread(self) -> np.ndarray:
        """Durations of the ramps that stand for the trials (k,)."""
        return self.trials * (EXPONENTIAL if self.exponential else 1.0)

    @property
    def value(self) -> float:
        """The duration of the ramp that stands for it [s]."""
        return float(self.weights @ self.spread) if self.seen else 0.0

    @property
    def stderr(self) -> float:
        """Its standard deviation [s]."""
        return float(np.sqrt(self.weights @ (self.spread - self.value) ** 2))

    @property
    def longer(self) -> tuple[float, float]:
        """By how much less and more than `value` it may last [s]."""
        likely = self.spread[self.weights > UNLIKELY * self.weights.max()]
        return float(min(likely.min() - self.value, 0.0)), float(likely.max() - self.value)


def transitions(time: np.ndarray, values: np.ndarray, noise: float) -> Transitions:
    """All switchings of a held signal, without its ramps and its noise.

    They are sought between neighbouring samples, and between samples as far apart as slow amplifiers need.
    """
    found = _runs(time, values, noise)
    apart = int(SLOW_EDGE / usual_step(time)) if time.size > 2 else 1
    if apart > 1:
        coarse = _runs(time[::apart], values[::apart], noise)
        slow = [_exact(values, noise, a * apart, min(b * apart, values.size - 1)) for a, b in _pairs(coarse)]
        taken = np.zeros(time.size + 1)
        np.add.at(taken, found.before, 1)
        np.add.at(taken, found.after, -1)
        covered = np.append(0, np.cumsum(np.cumsum(taken[:-1]) > 0))
        new = [(a, b) for a, b in slow if covered[b + 1] == covered[a]]
        both = np.array(sorted([*_pairs(found), *new]), dtype=int).reshape(-1, 2)
        found = Transitions(both[:, 0], both[:, 1])
    return _with_ringing(values, noise, found)


def _with_ringing(values: np.ndarray, noise: float, found: Transitions) -> Transitions:
    """With what a filter rings by, after its edges and before them, counted as samples on the way, and no switchings
    of their own."""
    if not len(found):
        return found
    height = np.abs(values[found.after] - values[found.before])
    floor = STANDS_OUT / 2 * noise
    listed: list[tuple[int, int]] = []
    kept = np.ones(len(found), dtype=bool)
    for i in np.argsort(-height, kind="stable"):
        if not kept[i]:
            continue
        large = np.flatnonzero(height >= RINGING * height[i])
        place = int(np.searchsorted(large, i))
        first = int(found.after[large[place - 1]]) if place > 0 else 0
        last = int(found.before[large[place + 1]]) if place + 1 < large.size else values.size - 1
        before, after = int(found.before[i]), int(found.after[i])
        least, most = (floor, max(floor, GOES_ON * height[i])), RINGING * height[i]
        after += _rings_for(values[after : last + 1], least, most)
        before -= _rings_for(values[first : before + 1][::-1], least, most)
        listed.append((before, after))
        kept &= (found.after <= before) | (found.before >= after)
    both = np.array(sorted(listed), dtype=int).reshape(-1, 2)
    return Transitions(both[:, 0], both[:, 1])


def _rings_for(values: np.ndarray, least: Sequence[float], most: float) -> int:
    """For how many samples a signal (n,) is more than one of `least` off the level it comes to, now above it and now
    below.

    0 where it does not ring, or by more than `most`: what stays on one side for long creeps, or is a level.
    """
    rest = values[RINGS : 2 * RINGS]
    off = values[:RINGS] - (np.median(rest) if rest.size >= LEAST_REST else values[-1])
    for size in least if np.abs(off).max() <= most else ():
        beyond = np.flatnonzero(np.abs(off) > size)
        if not beyond.size:
            break
        last = int(beyond[-1])
        turns = np.flatnonzero(np.diff(np.sign(off[: last + 1])))
        longest = int(np.diff(np.concatenate([[-1], turns, [last]])).max())
        if longest <= HALF_WAVE and last + 1 < values.size:
            return last + 1
    return 0


def _rings(edge: _EdgeSamples) -> bool:
    """Whether samples on the way lie beyond a level, and few between the two: the monitor's filter made the edge."""
    beyond = max(3 * GOES_ON, STANDS_OUT / 2 * float(np.sqrt(max(edge.error**2 - ROUGH_SHAPE**2, 0.0))))
    parts = edge.parts[edge.on_the_way]
    return bool(np.any(np.abs(parts - 0.5) > 0.5 + beyond) and np.sum(np.abs(parts - 0.5) < BETWEEN) <= FEW_ON_WAY)


def _runs(time: np.ndarray, values: np.ndarray, noise: float) -> Transitions:
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
        least = max(STANDS_OUT / 2 * noise, GOES_ON * abs(values[b] - values[a]))
        first, last = _extended(step * direction[a], a, b, least, listed[-1][1] if listed else 0)
        if last - first <= FEW_ON_WAY + 1 or time[last] - time[first] <= _longest(values[first : last + 1]):
            listed.append((first, last))
    before, after = np.array(listed, dtype=int).reshape(-1, 2).T
    return Transitions(before, after)


def _longest(values: np.ndarray) -> float:
    """How long an edge with the samples `values` (n,) may take [s]: what comes to rest by itself is no ramp."""
    part = (values - values[0]) / (values[-1] - values[0])
    return LONGEST_DECAY if part[part.size // 2] > RESTED else LONGEST_EDGE


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
    near = max(STANDS_OUT / 2 * noise / abs(height), GOES_ON)
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


def rise(records: Sequence[tuple[np.ndarray, np.ndarray, float]]) -> Rise | None:
    """How the amplifier behind records of (time, values, noise) of one input rises; None where nothing switches.

    The likelihood of a rise, the instant of every edge being anything: samples on the way agree with it, and the
    longer it is, the more often there is one. Many samples on the way tell by themselves whether it is exponential.
    Where a filter with overshoot passed most edges on, it is the filter that samples on the way tell.
    """
    every = [edge for record in records for edge in _edge_samples(*record)]
    edges = [edge for edge in every if not _rings(edge)]
    if len(edges) < 0.5 * len(every):
        return _hidden(every)
    slow = [e for e in edges if e.on_the_way.size > FEW_ON_WAY]
    if slow:
        how, _ = _likeliest(_some(edges), exponential=True)
        if np.mean([_has_shape(e, how) for e in slow]) > 0.5:
            return how
    fast = _some([e for e in edges if e.on_the_way.size <= FEW_ON_WAY])
    if not fast:
        return None
    (ramp, odds), (decay, others) = (_likeliest(fast, exponential) for exponential in (False, True))
    return decay if others - PLAINER > odds else ramp  # a ramp, where both serve


def _hidden(edges: Sequence[_EdgeSamples]) -> Rise:
    """What is known of a rise that a filter hides: it is short beside the sampling. A jump is the simplest."""
    period = _period(edges)
    trials = np.geomspace(SHORTEST, HIDDEN_RISE, TRIALS) * period
    weights = trials * (trials <= max(SLOW_EDGE, 2 * SHORTEST * period))  # every rise as likely beforehand
    return Rise(False, trials, weights / weights.sum(), False)


def _period(edges: Sequence[_EdgeSamples]) -> float:
    """The usual time between the samples of edges [s]."""
    return float(np.median([e.times[e.first + 1] - e.times[e.first] for e in edges]))


def _some(edges: Sequence[_EdgeSamples]) -> list[_EdgeSamples]:
    """`SAMPLED` of the edges at most, evenly taken."""
    return [edges[i] for i in np.unique(np.linspace(0, len(edges) - 1, min(SAMPLED, len(edges))).astype(int))]


def _likeliest(edges: Sequence[_EdgeSamples], exponential: bool) -> tuple[Rise, float]:
    """The rise of this kind that the edges tell, and the logarithm of the chance of the kind."""
    period = _period(edges)
    most = max(FEW_ON_WAY, *(e.on_the_way.size for e in edges)) + (0.0 if exponential else 1.5)
    seen = any(e.anchor is not None for e in edges)
    longest = most * period if seen else max(min(most * period, SLOW_EDGE), 2 * SHORTEST * period)
    trials = np.geomspace(SHORTEST * period, longest, TRIALS)
    odds = _odds(edges, trials, exponential)
    chance = float(odds.max() + np.log(np.mean(np.exp(odds - odds.max()))))
    likely = np.flatnonzero(odds > odds.max() + np.log(NOWHERE))  # again, in steps as fine as what they tell
    around = np.clip([likely[0] - 1, likely[-1] + 1], 0, TRIALS - 1)
    trials = np.geomspace(trials[around[0]], trials[around[1]], TRIALS)
    odds = _odds(edges, trials, exponential)
    weights = np.exp(odds - odds.max())
    return Rise(exponential, trials, weights / weights.sum(), seen), chance


def _odds(edges: Sequence[_EdgeSamples], trials: np.ndarray, exponential: bool) -> np.ndarray:
    """Logarithm of the chance of every one of the trials (k,)."""
    odds = np.sum([_likelihood(e, trials, exponential) for e in edges], axis=0) / _together(edges)
    return np.asarray(odds + np.log(trials))  # every rise as likely beforehand


def _has_shape(edge: _EdgeSamples, how: Rise) -> bool:
    """Whether the samples of an edge lie on one of the rises."""
    centroids, _ = _instants(edge, how.trials, how.exponential)
    missed = edge.parts[:, None] - _shape(edge.times[:, None] - centroids[:, 0], how.trials, how.exponential)
    least = float(np.min(np.mean(missed**2, axis=0)))
    return least < CONTRAST * (FAITHFUL**2 + max(edge.error**2 - ROUGH_SHAPE**2, 0.0))


@dataclass(frozen=True)
class _EdgeSamples:
    """One edge: `times` and `parts` (0 before, 1 after) of the samples around it, `first` the last of the old level."""

    times: np.ndarray
    parts: np.ndarray
    first: int
    last: int
    error: float

    @property
    def on_the_way(self) -> np.ndarray:
        return np.arange(self.first + 1, self.last)

    @property
    def anchor(self) -> int | None:
        """The sample on the way nearest to the middle."""
        inner = self.on_the_way
        return int(inner[np.argmin(np.abs(self.parts[inner] - 0.5))]) if inner.size else None


def _edge_samples(time: np.ndarray, values: np.ndarray, noise: float) -> list[_EdgeSamples]:
    found = transitions(time, values, noise)
    large = np.abs(values[found.after] - values[found.before]) > MATTERS * np.ptp(values)
    told = large & (found.on_the_way <= MOST_ON_WAY)
    return [_samples_of(time, values, noise, a, b) for a, b in _pairs(found.only(told))]


def _pairs(found: Transitions) -> list[tuple[int, int]]:
    return list(zip(found.before.tolist(), found.after.tolist(), strict=True))


def _samples_of(time: np.ndarray, values: np.ndarray, noise: float, before: int, after: int) -> _EdgeSamples:
    """The samples of one edge, and two on either side."""
    a, b = max(before - 1, 0), min(after + 2, time.size)
    height = values[after] - values[before]
    error = float(np.hypot(ROUGH_SHAPE, noise / abs(height)))
    return _EdgeSamples(time[a:b], (values[a:b] - values[before]) / height, before - a, after - a, error)


def _shape(late: np.ndarray, tau: np.ndarray, exponential: bool) -> np.ndarray:
    """The height of an edge, relative to its step, `late` seconds after its centroid."""
    if exponential:
        return 1 - np.exp(-np.clip((late + tau) / tau, 0, 50))
    return np.clip(late / tau + 0.5, 0, 1)


def _lateness(part: float, tau: np.ndarray, exponential: bool) -> np.ndarray:
    """The time after its centroid at which an edge reaches the relative height `part`."""
    part = float(np.clip(part, 0.005, 0.995))
    return -tau * np.log(1 - part) - tau if exponential else tau * (part - 0.5)


def _likelihood(edge: _EdgeSamples, trials: np.ndarray, exponential: bool) -> np.ndarray:
    """Logarithm of the chance of one edge's samples for every rise (k,), over all instants."""
    centroids, measure = _instants(edge, trials, exponential)
    expected = _shape(edge.times[:, None, None] - centroids, trials[:, None], exponential)
    left = (edge.parts[:, None, None] - expected) / edge.error
    if edge.anchor is not None:
        left[edge.anchor] = 0.0
    squares = -0.5 * np.sum(left**2, axis=0)
    return np.log(np.mean(np.exp(np.maximum(squares, -300)), axis=1) * measure)


def _instants(edge: _EdgeSamples, trials: np.ndarray, exponential: bool) -> tuple[np.ndarray, np.ndarray]:
    """Centroids (k, m) to average over, and the time they stand for (k,).

    A sample on the edge alone determines the instant, for a given rise; else all instants between the samples are
    tried.
    """
    if edge.anchor is not None:
        part = edge.parts[edge.anchor]
        at = edge.times[edge.anchor] - _lateness(part, trials, exponential)
        slope = 1 / np.clip(1 - part, 0.02, 1) if exponential else 1.0
        return at[:, None], trials * slope * edge.error
    a, b = edge.times[edge.first], edge.times[edge.last]
    every = (np.arange(33) + 0.5) / 33
    return np.broadcast_to(a + (b - a) * every, (trials.size, 33)), np.full(trials.size, b - a)


def _together(edges: Sequence[_EdgeSamples]) -> float:
    """How many edges count as one: all, where every one falls on the same part of the sampling (synchronous).

    So it may be where none of them has a sample on the way.
    """
    if len(edges) < TOGETHER:
        return 1.0
    seen = np.array([np.nan if e.anchor is None else e.parts[e.anchor] for e in edges])
    known = np.isfinite(seen)
    if not known.any() or (known.all() and np.std(seen) < SYNCHRONOUS):
        return float(len(edges))
    return 1.0


def located(
    name: str,
    time: np.ndarray,
    values: np.ndarray,
    noise: float,
    found: Transitions,
    how: Rise | None,
    between: float = 0.5,
) -> list[Edge]:
    """An `Edge` for every transition; `between` its samples (0 to 1) is where it is if nothing on the way tells."""
    listed = []
    for (before, after), short in zip(_pairs(found), few(found), strict=True):
        look = _samples_of(time, values, noise, before, after)
        shape: Literal["ramp", "exponential", "recorded"] = "ramp"
        if _rings(look):
            time_, earliest, latest, lasting = _through_filter(time, values, noise, before, after)
        elif how is not None and (short or (how.exponential and _has_shape(look, how))):
            time_, earliest, latest, lasting = _between(look, how, between)
            shape = "exponential" if how.exponential else "ramp"
        else:
            time_, earliest, latest, lasting = _followed(time, values, noise, before, after)
            shape = "recorded"
        listed.append(
            Edge(
                name,
                float(time_),
                float(earliest),
                float(latest),
                float(lasting),
                float(values[before]),
                float(values[after]),
                shape,
            )
        )
    return listed


def _between(edge: _EdgeSamples, how: Rise, between: float) -> tuple[float, float, float, float]:
    """Centroid, its bounds and the rise of an edge with few samples on the way."""
    a, b = edge.times[edge.first], edge.times[edge.last]
    if edge.anchor is None:
        return a + between * (b - a), a, b, min(how.value, b - a)
    part = edge.parts[edge.anchor]
    late = _lateness(part, how.trials, how.exponential)
    possible = how.weights * np.exp(np.maximum(_agreement(edge, how), -300))
    weights = possible / possible.sum()
    at = edge.times[edge.anchor] - late
    lasting = float(weights @ how.spread)
    rate = how.trials * (1 / np.clip(1 - part, 0.02, 1) if how.exponential else 1.0)
    blur = BLURRED * edge.error * float(weights @ rate)  # of the instant by noise and by the shape
    kept = weights > UNLIKELY * weights.max()
    best = float(weights @ at)
    return best, max(at[kept].min() - blur, a), min(at[kept].max() + blur, b), lasting


def _through_filter(
    time: np.ndarray, values: np.ndarray, noise: float, before: int, after: int
) -> tuple[float, float, float, float]:
    """Centroid, its bounds and the rise of an edge that a filter with overshoot passed on.

    The filter moves the centroid, by as much in all files. As it overshoots it hardly widens what it passes on, and
    what passes so fast is a jump.
    """
    t, v = time[before : after + 1], values[before : after + 1]
    weight, middle = np.diff(v) / (v[-1] - v[0]), (t[1:] + t[:-1]) / 2
    centroid, step = float(weight @ middle), usual_step(t)
    uncertainty = float(np.hypot(ALIASED, BLURRED * noise / abs(v[-1] - v[0]) * np.sqrt(t.size))) * step
    return centroid, centroid - uncertainty, centroid + uncertainty, 0.0


def _agreement(edge: _EdgeSamples, how: Rise) -> np.ndarray:
    """How well every rise agrees with the samples of one edge: a logarithm (k,), 0 where perfectly."""
    centroids, _ = _instants(edge, how.trials, how.exponential)
    expected = _shape(edge.times[:, None] - centroids[:, 0], how.trials, how.exponential)
    left = (edge.parts[:, None] - expected) / edge.error
    return -0.5 * np.sum(left**2, axis=0)


def _followed(
    time: np.ndarray, values: np.ndarray, noise: float, before: int, after: int
) -> tuple[float, float, float, float]:
    """Centroid, its bounds and the rise of an edge whose shape was recorded: from the samples themselves.

    Straight lines between them leave out where between samples it begins and ends: an eighth of a sample at most.
    """
    t, v = time[before : after + 1], values[before : after + 1]
    part = (v - v[0]) / (v[-1] - v[0])
    weight, middle = np.diff(part), (t[1:] + t[:-1]) / 2
    centroid = float(weight @ middle)
    spread = float(np.sqrt(max(weight @ ((middle - centroid) ** 2 + np.diff(t) ** 2 / 12), 0.0)))
    step = usual_step(t)
    uncertainty = np.hypot(step / 8, noise / abs(v[-1] - v[0]) * step * np.sqrt(t.size))
    return centroid, max(centroid - uncertainty, t[0]), min(centroid + uncertainty, t[-1]), EXPONENTIAL * spread
