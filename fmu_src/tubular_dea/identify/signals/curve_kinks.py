"""Where a continuous signal leaves a straight line along a curve, between two samples.

A valve opens, and the pressure behind it rises from its level as an exponential does:

             __--
          o-'            o samples: the last on the level, and the first ones on the curve
        o'
    o__/                 the curve, followed back, meets the level between them

Lines from sample to sample bend at samples, so they begin before the curve does: by a quarter of what it rises in one
step, always to the same side. Of a hose behind the valve that would be an echo, or a creep. A ramp of a few samples,
too brief for a line of its own, is such a curve as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from .kinks import TRIANGLE, UNKNOWN, Line, through
from .monitors import QUARTERS, WELL_BENT

# Set by theory: a level, or a ramp, is told by four samples, and the four after it tell a curve's slope and how it
# changes. Check: `pytest tests/test_kinks.py -k curve`
SAMPLES = 4  # [samples] on each side of where a curve begins, at least
ON_RAMP = 3  # [samples] of a ramp that is over before the fourth
UNSURE_END = 1.5  # [samples] before the end of a line from which on they may be of the curve already
SEARCHED = 3  # [samples] after that, among which the first one off the line is
SLOWING = (0.3, 1.25)  # [1] from one step of a curve to the next: less may be a ramp's end, more bends upwards
EVEN = 0.01  # [1] of a step by which samples of a curve are off even times, at most
OFF_IT = 0.01  # [1] of a curve's change by which its samples are off it at most, if not by noise: a ramp ends
EARLIEST_MEETING = 0.5  # [samples] before the last one on the line at which noise may make lines meet
STRAIGHTEST = 1e-3  # [1] by which that differs from 1 at least: a curve as straight is a line

Lines = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class _Exponential:
    """From `first` on, `part` of what changes by `ratio` from step to step."""

    first: float
    part: float
    ratio: float

    def at(self, steps: float) -> float:
        """The value `steps` after the first sample."""
        return self.first + self.part * float(np.expm1(steps * np.log(self.ratio)))

    def followed(self, begin: float, end: float, noise: float) -> list[float]:
        """The begin of a piece [steps], and where in it the curve is to be followed: nowhere if it is straight."""
        sag = self.at(0.5 * (begin + end)) - 0.5 * (self.at(begin) + self.at(end))
        return [begin, *(begin + q * (end - begin) for q in QUARTERS if abs(sag) > WELL_BENT * noise)]


def leaving(time: np.ndarray, values: np.ndarray, lines: Lines, step: float, noise: float) -> tuple[Lines, np.ndarray]:
    """The `lines` (times and values (m,)) through samples `time` and `values` (n,), with curves that begin or end at a
    straight one followed to where they meet it; and the times (k,) [s] where they do."""
    lines, begins = _left_by_curves(time, values, lines, step, noise)
    back = (-lines[0][::-1], lines[1][::-1])
    (t, v), ends = _left_by_curves(-time[::-1], values[::-1], back, step, noise)
    return (-t[::-1], v[::-1]), np.append(begins, -ends)


def _left_by_curves(
    time: np.ndarray, values: np.ndarray, lines: Lines, step: float, noise: float
) -> tuple[Lines, np.ndarray]:
    t, v = lines
    gaps, slopes = np.diff(t), np.diff(v) / np.diff(t)
    straight = gaps > (SAMPLES - 0.5) * step
    bent = np.abs(np.diff(slopes)) * step * TRIANGLE > UNKNOWN * noise
    kept, added = np.ones(t.size, dtype=bool), []
    for k in np.flatnonzero(straight[:-1] & ~straight[1:] & bent) + 1:
        points = _followed_back(time, values, (float(t[k - 1]), float(t[k])), step, noise)
        if points is None:
            continue
        begin, end = points[0, 0] - step, points[-1, 0]
        kept &= ~((t > max(begin, t[k - 1])) & (t <= end + EVEN * step))
        added.append(points)
    joined = np.concatenate([np.column_stack([t, v])[kept], *added])
    joined = joined[np.argsort(joined[:, 0], kind="stable")]
    return (joined[:, 0], joined[:, 1]), np.array([points[0, 0] for points in added])


def _followed_back(
    time: np.ndarray, values: np.ndarray, piece: tuple[float, float], step: float, noise: float
) -> np.ndarray | None:
    """Points (k, 2) of the curve after a straight `piece` (begin and end [s]), from where it leaves that up to the
    second sample on it; None where the samples do not show such a curve."""
    line = through(time, values, piece[0], piece[1] - UNSURE_END * step)
    first = int(np.searchsorted(time, piece[1] - UNSURE_END * step))
    if line is None or first < 1 or first + SEARCHED + SAMPLES > time.size:
        return None
    near = slice(first, first + SEARCHED + 1)
    off = np.abs(values[near] - line[1] - line[2] * (time[near] - line[0])) > UNKNOWN * noise
    if not np.any(off[:-1] & off[1:]):
        return None
    first += int(np.argmax(off[:-1] & off[1:]))
    seen = values[first : first + SAMPLES]
    even = np.abs(np.diff(time[first - 1 : first + SAMPLES]) - step).max() < EVEN * step
    curve = (_curve(seen, noise) or _ramp(seen[:ON_RAMP], noise)) if even else None
    back = None if curve is None else _meeting(curve, line, float(time[first]), step, noise)
    if curve is None or back is None:
        return None
    steps = [*curve.followed(-back, 0.0, noise), *curve.followed(0.0, 1.0, noise), 1.0]
    points = np.column_stack([time[first] + np.array(steps) * step, [curve.at(s) for s in steps]])
    points[0, 1] = line[1] + line[2] * (points[0, 0] - line[0])
    return points


def _curve(values: np.ndarray, noise: float) -> _Exponential | None:
    """The curve through `SAMPLES` values; None where they turn, or are on none."""
    early, late = values[2] - values[0], values[3] - values[1]
    if early == 0 or not SLOWING[0] < late / early < SLOWING[1]:
        return None
    ratio = float(late / early)
    if abs(ratio - 1) < STRAIGHTEST:
        ratio = 1 + STRAIGHTEST
    powers = ratio ** np.arange(SAMPLES) - 1
    part = float((early + late) / ((ratio**2 - 1) * (1 + ratio)))
    off = values - part * powers
    if np.abs(off - off.mean()).max() > max(UNKNOWN * noise, OFF_IT * abs(early)):
        return None
    return _Exponential(float(off.mean()), part, ratio)


def _ramp(values: np.ndarray, noise: float) -> _Exponential | None:
    """The straight line through `ON_RAMP` values, of a ramp that ends behind them; None where they are on none."""
    slope, off = 0.5 * (values[2] - values[0]), values - values.mean()
    if slope == 0 or np.abs(off - slope * (np.arange(ON_RAMP) - 1)).max() > UNKNOWN * noise:
        return None
    return _Exponential(float(values.mean() - slope), float(slope / np.log1p(STRAIGHTEST)), 1 + STRAIGHTEST)


def _meeting(curve: _Exponential, line: Line, first: float, step: float, noise: float) -> float | None:
    """How many steps, of at most one, before its `first` sample [s] a curve meets a line; None where it does not.

    Where that is at the sample before, noise makes it a little more than one."""

    def above(steps: float) -> float:
        return curve.at(-steps) - line[1] - line[2] * (first - steps * step - line[0])

    most = 1 + min(EARLIEST_MEETING, UNKNOWN * noise / max(abs(curve.at(1.0) - curve.at(0.0)), noise))
    return float(brentq(above, 0.0, most)) if above(0.0) * above(most) < 0 else None
