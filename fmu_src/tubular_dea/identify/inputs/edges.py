"""The switching instants of an input, as far as its samples determine them.

If the sample at t_k has the new value and that at t_(k-1) the old one, the input switched in between. The best estimate
is then the middle, and the bounds are the two samples. With a slow amplifier, a sample may fall on the edge; if the
rise is known, the height of this sample determines the instant. The rise is common to all edges of a record (or of a
set): the time that it takes, or its slope, as an amplifier that charges a capacitor with its largest current has. It
follows from the heights of such samples and from how often they occur. Where more samples than `FEW_ON_WAY` lie on an
edge, they tell whether it is an exponential one; if not, its shape is recorded and used as it is.

A set point without noise, written by a computer, changes at the sample that first shows the new value: there this
sample is the best estimate, and both bounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from ..signals.sampling import usual_step
from .transitions import CONTRAST, FEW_ON_WAY, GOES_ON, SLOW_EDGE, STANDS_OUT, Transitions, few, transitions

# Set by judgement. Check: `pytest tests/test_edges.py`,
# `python -m blind.score --nulls 12 --conventions edges --seed 1000`
MATTERS = 0.02  # [1] of the span: the instant of a smaller step moves the answer by less than any noise

# Set by judgement. Check: `pytest tests/test_edges.py`,
# `python -m blind.score --nulls 12 --conventions edges amplifier --seed 1000`
ROUGH_SHAPE = 0.03  # [1] of an edge's height by which amplifiers differ from ramps and exponentials
BLURRED = 2.0  # [standard errors] of an instant by noise and by the shape that its bounds are wider
NOWHERE = 1e-6  # [1] of the likeliest rise's chance: rises with less need not be tried again
UNLIKELY = 0.01  # [1] of the likeliest rise's chance: rises with less do not count in an edge's bounds
TOGETHER = 5  # [1] edges from which on it can be told whether all fall on the same part of the sampling
SYNCHRONOUS = 0.1  # [1] spread of the parts below which they do: 0.29 where instants have nothing to do with samples

# Set by judgement. Check: `pytest tests/test_edges.py -k exponential`
MOST_ON_WAY = 24  # [samples] on the way up to which an exponential is told apart; with more straight lines follow it
FAITHFUL = 0.01  # [1] of its height by which samples miss an exponential: others miss it by 0.04 and more

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions edges amplifier --seed 1000`
SHORTEST = 0.01  # [samples] that the shortest rise takes that is tried
LEAST_RANGE = 2.0  # [1] times that one, up to which longer ones are tried at least
TRIALS = 96  # [1] rises that are tried
PLAINER = 2.0  # [log likelihood] by which another rise has to be likelier than ramps that all last as long
INSTANTS = 33  # [1] instants between two samples that are tried where none is on the way
ON_WAY_MORE = 1.5  # [samples] by which a ramp may be longer than the samples on its way
OFF_LEVEL = 0.005  # [1] of an edge's height from its levels: a sample on the way tells the instant as if so far off
STILL_RISING = 0.02  # [1] of its height that is left of an exponential, at least, where its slope is taken
SAMPLED = 300  # [1] edges at most, evenly taken, that tell the rise: more tell it no better

# Set by judgement. Check: `pytest tests/test_edges.py -k filter`
BETWEEN = 0.4  # [1] of an edge's height about its middle: a filter leaves few samples there
OVERSHOOT = 3.0  # [1] times GOES_ON beyond a level from which on a sample tells that a filter overshoots
HIDDEN_RISE = 1.5  # [samples] that an edge takes at most that a filter with overshoot hides: it overshoots still

# Set by measurement: 0.04 to 0.06 behind a Butterworth filter of second order at 0.35 to 0.45 of the rate, 0.02 to 0.04
# behind steeper ones. Check: `pytest tests/test_edges.py -k filter`
ALIASED = 0.06  # [samples] by which the centroid of samples is off that a filter against aliasing let pass

# Set by theory: less is nothing beside 1. Check: `pytest tests/test_edges.py`
NO_CHANCE = -300.0  # [log likelihood] that no rise is less likely by: else its chance is rounded to 0, and all may be
RISEN_ALL = 50.0  # [time constants] after which an exponential has risen to the last digit

# Set by theory: straight lines between samples. Check: `pytest tests/test_edges.py`
ENDS_UNSEEN = 0.125  # [samples] by which a recorded edge is off at most, whose ends fall between samples

# Set by theory: a ramp of so many time constants spreads as an exponential rise does.
# Check: `pytest tests/test_edges.py -k spreads`
EXPONENTIAL = float(np.sqrt(12.0))  # [1] duration of a ramp over the time constant that it stands for

# Set by theory: least squares over the rise; 9e-3 rms of its height. Chords through an exponential come late.
# Check: `pytest tests/test_edges.py -k corners_of_an_exponential`
BENDING = np.array([0.0, 0.5, 1.3, 2.6, 5.5])  # [time constants] from its begin to the corners of an exponential's line
RISEN = np.array([0.0, 0.417, 0.7488, 0.9472, 1.0])  # [1] of its height that the line has there


Kind = Literal["ramp", "exponential", "slew"]


@dataclass(frozen=True)
class Edge:
    """One switching of `input`. Times in s, levels in SI units.

    `time` is the best estimate of its centroid, which lies between `earliest` and `latest`. Between the levels `low`
    before and `high` after it, its `shape` is that of a straight ramp of `rise` (0: a jump), of an exponential that
    spreads as this ramp does, or as it was recorded. Where the amplifier rises more slowly by some time, this one lasts
    longer by a `share` of that.
    """

    input: str
    time: float
    earliest: float
    latest: float
    rise: float
    low: float
    high: float
    shape: Literal["ramp", "exponential", "recorded"] = "ramp"
    share: float = 1.0

    @property
    def corners(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners of the line that stands for it: times from its centroid over half its rise, parts of its height."""
        if self.shape == "exponential":
            return 2 * (BENDING - 1) / EXPONENTIAL, RISEN
        return np.array([-1.0, 1.0]), np.array([0.0, 1.0])


@dataclass(frozen=True)
class Rise:
    """How an amplifier rises: as a ramp or as an exponential, which lasts or has a time constant of `trials` (k,) [s],
    or with a slope, so that edges of a `height` (SI) last so long and others in proportion.

    `weights` (k,) are the chances of the trials. Nothing is `seen` where no sample ever fell on the way: then a jump
    is the simplest that agrees, and the trials say how slow it may be all the same.
    """

    kind: Kind
    trials: np.ndarray
    weights: np.ndarray
    seen: bool
    height: float = 0.0

    @property
    def exponential(self) -> bool:
        """Whether it is an exponential."""
        return self.kind == "exponential"

    def share(self, height: float) -> float:
        """How long an edge of a height (SI) lasts, over the trials."""
        return height / self.height if self.kind == "slew" else 1.0

    def lasting(self, height: float) -> np.ndarray:
        """How long an edge of a height (SI) lasts in each of the trials (k,) [s], or its time constants."""
        return self.share(height) * self.trials

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


def _rings(edge: _EdgeSamples) -> bool:
    """Whether samples on the way lie beyond a level, and few between the two: the monitor's filter made the edge."""
    beyond = max(OVERSHOOT * GOES_ON, STANDS_OUT / 2 * float(np.sqrt(max(edge.error**2 - ROUGH_SHAPE**2, 0.0))))
    parts = edge.parts[edge.on_the_way]
    return bool(np.any(np.abs(parts - 0.5) > 0.5 + beyond) and np.sum(np.abs(parts - 0.5) < BETWEEN) <= FEW_ON_WAY)


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
        how, _ = _likeliest(_some(edges), "exponential")
        if np.mean([_has_shape(e, how) for e in slow]) > 0.5:
            return how
    fast = _some([e for e in edges if e.on_the_way.size <= FEW_ON_WAY])
    if not fast:
        return None
    plain, *others = (_likeliest(fast, kind) for kind in get_args(Kind))
    other = max(others, key=lambda found: found[1])
    return other[0] if other[1] - PLAINER > plain[1] else plain[0]


def _hidden(edges: Sequence[_EdgeSamples]) -> Rise:
    """What is known of a rise that a filter hides: it is short beside the sampling. A jump is the simplest."""
    period = _period(edges)
    trials = np.geomspace(SHORTEST, HIDDEN_RISE, TRIALS) * period
    weights = trials * (trials <= max(SLOW_EDGE, LEAST_RANGE * SHORTEST * period))  # every rise as likely beforehand
    return Rise("ramp", trials, weights / weights.sum(), False)


def _period(edges: Sequence[_EdgeSamples]) -> float:
    """The usual time between the samples of edges [s]."""
    return float(np.median([e.times[e.first + 1] - e.times[e.first] for e in edges]))


def _some(edges: Sequence[_EdgeSamples]) -> list[_EdgeSamples]:
    """`SAMPLED` of the edges at most, evenly taken."""
    return [edges[i] for i in np.unique(np.linspace(0, len(edges) - 1, min(SAMPLED, len(edges))).astype(int))]


def _likeliest(edges: Sequence[_EdgeSamples], kind: Kind) -> tuple[Rise, float]:
    """The rise of this kind that the edges tell, and the logarithm of the chance of the kind."""
    period, height = _period(edges), max(e.height for e in edges)
    most = max(FEW_ON_WAY, *(e.on_the_way.size for e in edges)) + (0.0 if kind == "exponential" else ON_WAY_MORE)
    seen = any(e.anchor is not None for e in edges)
    longest = most * period if seen else max(min(most * period, SLOW_EDGE), LEAST_RANGE * SHORTEST * period)
    trials = np.geomspace(SHORTEST * period, longest, TRIALS)
    odds = _odds(edges, Rise(kind, trials, trials, seen, height))  # every rise as likely beforehand
    chance = float(odds.max() + np.log(np.mean(np.exp(odds - odds.max()))))
    likely = np.flatnonzero(odds > odds.max() + np.log(NOWHERE))  # again, in steps as fine as what they tell
    around = np.clip([likely[0] - 1, likely[-1] + 1], 0, TRIALS - 1)
    trials = np.geomspace(trials[around[0]], trials[around[1]], TRIALS)
    how = Rise(kind, trials, trials, seen, height)
    odds = _odds(edges, how)
    weights = np.exp(odds - odds.max())
    return replace(how, weights=weights / weights.sum()), chance


def _odds(edges: Sequence[_EdgeSamples], how: Rise) -> np.ndarray:
    """Logarithm of the chance of every one of the trials (k,) of a rise, which had its `weights` beforehand."""
    odds = np.sum([_likelihood(e, how) for e in edges], axis=0) / _together(edges)
    return np.asarray(odds + np.log(how.weights))


def _has_shape(edge: _EdgeSamples, how: Rise) -> bool:
    """Whether the samples of an edge lie on one of the rises."""
    least = float(np.min(np.mean(_missed(edge, how) ** 2, axis=0)))
    return least < CONTRAST * (FAITHFUL**2 + max(edge.error**2 - ROUGH_SHAPE**2, 0.0))


@dataclass(frozen=True)
class _EdgeSamples:
    """One edge, of a `height` (SI): `times` and `parts` (0 before, 1 after) of the samples around it, `first` the last
    of the old level."""

    times: np.ndarray
    parts: np.ndarray
    first: int
    last: int
    error: float
    height: float

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
    return [_samples_of(time, values, noise, a, b) for a, b in found.only(told).pairs]


def _samples_of(time: np.ndarray, values: np.ndarray, noise: float, before: int, after: int) -> _EdgeSamples:
    """The samples of one edge, and two on either side."""
    a, b = max(before - 1, 0), min(after + 2, time.size)
    step = float(values[after] - values[before])
    error = float(np.hypot(ROUGH_SHAPE, noise / abs(step)))
    return _EdgeSamples(time[a:b], (values[a:b] - values[before]) / step, before - a, after - a, error, abs(step))


def _shape(late: np.ndarray, tau: np.ndarray, exponential: bool) -> np.ndarray:
    """The height of an edge, relative to its step, `late` seconds after its centroid."""
    if exponential:
        return 1 - np.exp(-np.clip((late + tau) / tau, 0, RISEN_ALL))
    return np.clip(late / tau + 0.5, 0, 1)


def _lateness(part: float, tau: np.ndarray, exponential: bool) -> np.ndarray:
    """The time after its centroid at which an edge reaches the relative height `part`."""
    part = float(np.clip(part, OFF_LEVEL, 1 - OFF_LEVEL))
    return -tau * np.log(1 - part) - tau if exponential else tau * (part - 0.5)


def _likelihood(edge: _EdgeSamples, how: Rise) -> np.ndarray:
    """Logarithm of the chance of one edge's samples for every trial (k,) of a rise, over all instants."""
    trials = how.lasting(edge.height)
    centroids, measure = _instants(edge, trials, how.exponential)
    expected = _shape(edge.times[:, None, None] - centroids, trials[:, None], how.exponential)
    left = (edge.parts[:, None, None] - expected) / edge.error
    if edge.anchor is not None:
        left[edge.anchor] = 0.0
    squares = -0.5 * np.sum(left**2, axis=0)
    return np.log(np.mean(np.exp(np.maximum(squares, NO_CHANCE)), axis=1) * measure)


def _instants(edge: _EdgeSamples, trials: np.ndarray, exponential: bool) -> tuple[np.ndarray, np.ndarray]:
    """Centroids (k, m) to average over, and the time they stand for (k,).

    A sample on the edge alone determines the instant, for a given rise; else all instants between the samples are
    tried.
    """
    if edge.anchor is not None:
        part = edge.parts[edge.anchor]
        at = edge.times[edge.anchor] - _lateness(part, trials, exponential)
        slope = 1 / np.clip(1 - part, STILL_RISING, 1) if exponential else 1.0
        return at[:, None], trials * slope * edge.error
    a, b = edge.times[edge.first], edge.times[edge.last]
    every = (np.arange(INSTANTS) + 0.5) / INSTANTS
    return np.broadcast_to(a + (b - a) * every, (trials.size, INSTANTS)), np.full(trials.size, b - a)


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
    for (before, after), short in zip(found.pairs, few(found), strict=True):
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
                1.0 if how is None else how.share(look.height),
            )
        )
    return listed


def _between(edge: _EdgeSamples, how: Rise, between: float) -> tuple[float, float, float, float]:
    """Centroid, its bounds and the rise of an edge with few samples on the way."""
    a, b, share = edge.times[edge.first], edge.times[edge.last], how.share(edge.height)
    if edge.anchor is None:
        return a + between * (b - a), a, b, min(share * how.value, b - a)
    part = edge.parts[edge.anchor]
    late = _lateness(part, how.lasting(edge.height), how.exponential)
    possible = how.weights * np.exp(np.maximum(_agreement(edge, how), NO_CHANCE))
    weights = possible / possible.sum()
    at = edge.times[edge.anchor] - late
    lasting = share * float(weights @ how.spread)
    rate = how.lasting(edge.height) * (1 / np.clip(1 - part, STILL_RISING, 1) if how.exponential else 1.0)
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
    return np.asarray(-0.5 * np.sum((_missed(edge, how) / edge.error) ** 2, axis=0))


def _missed(edge: _EdgeSamples, how: Rise) -> np.ndarray:
    """By how much the samples (n,) of an edge miss each trial (k,) of a rise, through its sample on the way if it has
    one: (n, k)."""
    trials = how.lasting(edge.height)
    centroids, _ = _instants(edge, trials, how.exponential)
    return np.asarray(edge.parts[:, None] - _shape(edge.times[:, None] - centroids[:, 0], trials, how.exponential))


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
    uncertainty = np.hypot(ENDS_UNSEEN * step, noise / abs(v[-1] - v[0]) * step * np.sqrt(t.size))
    return centroid, max(centroid - uncertainty, t[0]), min(centroid + uncertainty, t[-1]), EXPONENTIAL * spread
