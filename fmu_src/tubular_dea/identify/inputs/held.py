"""The line of an input that is held and switches: pieces without noise between its edges, which can be moved.

Between two edges that a line of known shape stands for, the samples on the way left out, the monitor's noise is taken
away by straight lines, or by curves where it moves fast; a piece whose slope is chance is a level. Edges whose shape
was recorded are followed like everything else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..signals.monitors import Polyline, curved, polyline
from .edges import Edge
from .transitions import Transitions

# Set by judgement. Check: `pytest tests/test_edges.py`,
# `python -m blind.score --nulls 12 --conventions edges --seed 1000`
LEVEL = 4.0  # [standard deviations] up to which a piece's slope is chance: then it is a level


@dataclass(frozen=True)
class HeldLine:
    """Breakpoints `time` and `values` (k,); `edge` (k,) names the edge that each belongs to, -1 for none.

    `side` (k,) is how far from the edge's centroid a point of its shape lies, over half the edge's rise (-1 where a
    ramp begins, 1 where it ends), and 0 elsewhere; `slope` (k,) is that of the line beside such a point, along which it
    moves.
    """

    time: np.ndarray
    values: np.ndarray
    edge: np.ndarray
    side: np.ndarray
    slope: np.ndarray

    def moved(self, shifts: np.ndarray, widened: np.ndarray) -> HeldLine:
        """With every edge later by its shift (m,) [s] and longer by `widened` (m,) [s]; what they reach gives way."""
        mine = self.edge >= 0
        own = self.edge[mine]
        return self.with_edges_at(self.time[mine] + shifts[own] + self.side[mine] * widened[own] / 2)

    def with_edges_at(self, times: np.ndarray) -> HeldLine:
        """With the breakpoints of edges at other `times`, as far as the order allows; other corners give way."""
        mine = self.edge >= 0
        if not mine.any():
            return self
        time = self.time.copy()
        begins = self.begins[mine]
        following = np.minimum.accumulate(np.where(begins, times, np.inf)[::-1])[::-1]
        times = np.where(begins, times, np.minimum(times, following))  # the next edge cuts off what is left of one
        time[mine] = np.maximum.accumulate(np.clip(times, time[0], time[-1]))
        before = np.maximum.accumulate(np.where(mine, time, time[0]))
        after = np.minimum.accumulate(np.where(mine, time, time[-1])[::-1])[::-1]
        time = np.clip(time, before, after)
        return replace(self, time=time, values=self.values + self.slope * (time - self.time))

    @property
    def begins(self) -> np.ndarray:
        """Which points (k,) are the first of their edge."""
        return (self.edge >= 0) & np.append(True, np.diff(self.edge) != 0)

    def ramps(self, share: float) -> bool:
        """Whether it moves by more than a share of its span where no edge is."""
        within = (self.edge[1:] >= 0) & (np.diff(self.edge) == 0)
        moves = np.abs(np.diff(self.values))[~within & (np.diff(self.time) > 0)]
        return bool(moves.size) and float(moves.sum()) > share * float(np.ptp(self.values))

    def with_time(self, time: float) -> HeldLine:
        """With a point at a time [s] inside it, where no edge is."""
        after = int(np.searchsorted(self.time, time))
        if after in (0, self.time.size) or self.time[after] == time:
            return self
        value = float(np.interp(time, self.time, self.values))
        added = zip(
            (self.time, self.values, self.edge, self.side, self.slope), (time, value, -1, 0.0, 0.0), strict=True
        )
        return HeldLine(*(np.insert(known, after, new) for known, new in added))

    @property
    def rested(self) -> int:
        """How many points lie before that at which it begins to move: one where it rests first."""
        return int(self.values[0] == self.values[1])

    @property
    def begin(self) -> float:
        """When it begins to move [s]."""
        return float(self.time[self.rested])

    def begun_at(self, time: float) -> HeldLine:
        """With its begin at another `time` [s]: at its first point, or after a rest from there."""
        rest = int(time > self.time[0])
        kept = np.r_[np.full(rest, self.rested), self.rested : self.time.size]
        line = HeldLine(*(known[kept] for known in (self.time, self.values, self.edge, self.side, self.slope)))
        line.time[: 1 + rest] = [*self.time[:rest], min(time, float(line.time[1 + rest]))]
        return line

    def in_order(self) -> HeldLine:
        """With times that never fall."""
        return self.with_edges_at(self.time[self.edge >= 0])

    def numbered(self, numbers: np.ndarray) -> HeldLine:
        """With new `numbers` (m,) for the edges, -1 for what is to stay where it is."""
        edge = np.where(self.edge >= 0, np.append(numbers, -1)[self.edge], -1)
        return replace(self, edge=edge)


def held_line(
    time: np.ndarray, values: np.ndarray, noise: float, found: Transitions, edges: Sequence[Edge], delay: float
) -> tuple[HeldLine, list[Edge]]:
    """The line behind a held signal, and its `edges` (one for each of `found`) with the levels that the line has.

    What moves between edges does so `delay` [s] after it was recorded.
    """
    ramp = np.flatnonzero([e.shape != "recorded" for e in edges])
    kept = np.flatnonzero(~_within(time.size, found.before[ramp] + 1, found.after[ramp]))  # none on a ramp's way
    starts = np.searchsorted(kept, found.after[ramp])
    line = _levelled(polyline(time[kept], values[kept], noise, starts), starts, kept.size, noise)
    recorded = np.setdiff1d(np.arange(len(edges)), ramp)
    shaped = np.searchsorted(starts, np.searchsorted(kept, found.before[recorded]), side="right")
    corners = _curved_corners(time[kept], values[kept], line, starts, shaped, noise)
    whole = _breakpoints(time, corners, starts.size, ramp, delay)
    moved = _placed(whole, edges)
    levelled = _with_levels(moved, edges)
    return _following(_shaped(moved, levelled), time, found, edges), levelled


def _placed(line: HeldLine, edges: Sequence[Edge]) -> HeldLine:
    """With the first and the last corner of every edge where its shape begins and ends."""
    mine = line.edge >= 0
    if not mine.any():
        return line
    ends = np.array([e.corners[0][[0, -1]] for e in edges])
    side = line.side.copy()
    side[mine] = np.where(side[mine] < 0, ends[line.edge[mine], 0], ends[line.edge[mine], 1])
    at, lasting = np.array([[e.time, e.rise] for e in edges]).T
    own = line.edge[mine]
    return replace(line, side=side).with_edges_at(at[own] + side[mine] * lasting[own] / 2)


def _shaped(line: HeldLine, edges: Sequence[Edge]) -> HeldLine:
    """With the corners between the first and the last one of edges that are no straight ramps."""
    begins = np.flatnonzero((line.edge >= 0) & (line.side < 0))
    bent = [(k, edges[line.edge[k]]) for k in begins if edges[line.edge[k]].corners[0].size > 2]
    if not bent:
        return line
    after = np.concatenate([np.full(e.corners[0].size - 2, k + 1) for k, e in bent])
    inner = np.concatenate([e.corners[0][1:-1] for _, e in bent])
    part = np.concatenate([e.corners[1][1:-1] for _, e in bent])
    number = line.edge[after - 1]
    at, lasting, low, high = np.array([[e.time, e.rise, e.low, e.high] for e in edges])[number].T
    return HeldLine(
        np.insert(line.time, after, at + inner * lasting / 2),
        np.insert(line.values, after, low + part * (high - low)),
        np.insert(line.edge, after, number),
        np.insert(line.side, after, inner),
        np.insert(line.slope, after, 0.0),
    ).in_order()


def _within(n: int, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Which of n samples lie in any stretch from `begin` to before `end`."""
    turns = np.zeros(n + 1)
    np.add.at(turns, begin, 1)
    np.add.at(turns, end, -1)
    return np.cumsum(turns[:-1]) > 0.5


def _levelled(line: Polyline, starts: np.ndarray, n: int, noise: float) -> Polyline:
    """With a level for every piece of which two corners are left and whose slope is chance."""
    first = np.searchsorted(line.corners, np.append(0, starts))
    last = np.append(first[1:], line.corners.size) - 1
    samples = np.diff(np.concatenate([[0], starts, [n]]))
    error = noise * np.sqrt(12.0 * (samples - 1) / (samples * (samples + 1.0)))
    flat = (last - first == 1) & (np.abs(line.values[last] - line.values[first]) < LEVEL * error)
    values = line.values.copy()
    mean = (values[first[flat]] + values[last[flat]]) / 2
    values[first[flat]] = values[last[flat]] = mean
    return Polyline(line.corners, values)


@dataclass(frozen=True)
class _Corners:
    """Times, values and pieces (k,) of the corners of a line; the number of a piece is that of edges before it."""

    time: np.ndarray
    values: np.ndarray
    piece: np.ndarray


def _curved_corners(
    time: np.ndarray, values: np.ndarray, line: Polyline, starts: np.ndarray, shaped: np.ndarray, noise: float
) -> _Corners:
    """The corners of a line, with curves through what moves fast, but for the pieces that are `shaped` (by number): an
    edge whose shape was recorded is inside them."""
    ends = np.append(starts, time.size)
    first = np.searchsorted(line.corners, np.append(0, ends))
    found = []
    for number, (begin, end) in enumerate(zip(np.append(0, starts), ends, strict=True)):
        own = slice(first[number], first[number + 1])
        t, v = time[line.corners[own]], line.values[own]
        if number not in shaped:
            t, v = curved(time[begin:end], values[begin:end], Polyline(line.corners[own] - begin, v), noise)
        found.append((t, v, np.full(t.size, number)))
    return _Corners(*(np.concatenate(each) for each in zip(*found, strict=True)))


def _breakpoints(time: np.ndarray, corners: _Corners, edges: int, ramp: np.ndarray, delay: float) -> HeldLine:
    """All corners `delay` after they were recorded, the two at every edge assigned to it; one alone becomes two."""
    piece = corners.piece
    begins = np.append(True, np.diff(piece) > 0)
    ends = np.append(np.diff(piece) > 0, True)
    twice = np.repeat(np.arange(piece.size), 1 + (begins & ends))
    second = np.append(False, np.diff(twice) == 0)
    alone = (begins & ends)[twice]
    begins, ends = begins[twice] & ~(alone & second), ends[twice] & ~(alone & ~second)
    piece, values = piece[twice], corners.values[twice]
    edge = np.full(piece.size, -1)
    side = np.zeros(piece.size)
    opened, closed = begins & (piece > 0), ends & (piece < edges)
    edge[opened], side[opened] = ramp[piece[opened] - 1], 1.0
    edge[closed], side[closed] = ramp[piece[closed]], -1.0
    at = np.clip(corners.time[twice] + delay, time[0], time[-1])
    at[0] = time[0]
    rise, run = np.diff(values), np.diff(at)
    rate = np.divide(rise, run, out=np.zeros_like(rise), where=(run > 0) & (np.diff(piece) == 0))
    slope = np.where(opened, np.append(rate, 0.0), np.where(closed, np.append(0.0, rate), 0.0))
    return HeldLine(at, values, edge, side, slope)


def _following(line: HeldLine, time: np.ndarray, found: Transitions, edges: Sequence[Edge]) -> HeldLine:
    """With the corners of every edge whose shape was recorded assigned to it."""
    edge = line.edge.copy()
    for number in np.flatnonzero([e.shape == "recorded" for e in edges]):
        a, b = np.searchsorted(line.time, [time[found.before[number]], time[found.after[number]]])
        inside = slice(a, b + 1)
        edge[inside] = np.where(edge[inside] < 0, number, edge[inside])
    return replace(line, edge=edge)


def _with_levels(line: HeldLine, edges: Sequence[Edge]) -> list[Edge]:
    low = {int(e): float(v) for e, v in zip(line.edge[line.side < 0], line.values[line.side < 0], strict=True)}
    high = {int(e): float(v) for e, v in zip(line.edge[line.side > 0], line.values[line.side > 0], strict=True)}
    return [replace(e, low=low.get(i, e.low), high=high.get(i, e.high)) for i, e in enumerate(edges)]
