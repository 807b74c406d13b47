"""When each edge of a held input happened, as the samples behind it tell, at the present model.

An edge that jumps between two samples may have happened anywhere between them. The model is asked at some instants in
between; the samples that depend on it tell the likeliest one. Where one computer's clock both samples and switches, all
edges happen at the same part of the sampling interval: where the samples say so, that part is used for all, as the
likeliest instant of each alone can only be off towards the middle.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from scipy.special import logsumexp

from ...kernel import KernelError
from ..fitting.problem import whitened
from ..fitting.response import Response
from ..inputs.edges import Edge
from .study import Piece, Study

# Set by judgement. Check: `pytest tests/test_adjust.py -k instant`,
# `python -m blind.score --nulls 12 --conventions edges --seed 1000`
TOLD = 0.99  # [1] of what an edge's instant changes, as sum of squares: the samples behind that hold hear no more of it
GRID = (0.0, 0.25, 0.5, 0.75, 1.0)  # [1] of the way between an edge's bounds at which the model is asked
INSIDE = 1e-3  # [1] of that way by which these places keep off both bounds: an output that follows at once jumps there
FINE_PLACES = 81  # [1] places between an edge's bounds that are compared, and between those beside the best of them
LEAST_WAY = 1e-12  # [s] between bounds at least: the places between those that are the same are distinct
SHARES = CubicSpline(GRID, np.eye(len(GRID)))  # of every answer on the grid, at a part of the way

# Set by theory. Check: `pytest tests/test_delayed_edges.py`
MEAN_SQUARE = 1 / 3  # [1] of what is anywhere from 0 to 1

# Set by judgement. Check: `pytest tests/test_adjust.py -k clock`
SURELY = 5.0  # [log likelihood] by which edges at one part of the sampling are likelier than edges anywhere
ON_CLOCK = 0.02  # [1] of the sampling interval: uncertainty of that part


@dataclass(frozen=True)
class EdgeResponse:
    """The samples `where` that depend on an edge's instant, their whitened responses (g, m) at the shifts `grid` (g,)
    [s], and the present shift `now`."""

    where: slice
    grid: np.ndarray
    answers: np.ndarray
    now: float

    @property
    def places(self) -> np.ndarray:
        """The shifts [s] over the grid that are compared, (FINE_PLACES,)."""
        return np.linspace(self.grid[0], self.grid[-1], FINE_PLACES)

    def squares(self, left: np.ndarray, places: np.ndarray | None = None) -> np.ndarray:
        """The sum of squares of the residual at `places` (all of them), less what it is at the present shift, where the
        residual is `left` (m,)."""
        if not self.answers.size:
            return np.zeros(FINE_PLACES)
        steps = SHARES(self._part(self.places if places is None else places)) - SHARES(self._part(self.now))
        changes = self.answers - self.answers[0]
        return 2 * steps @ (changes @ left) + np.einsum("ij,ij->i", steps @ (changes @ changes.T), steps)

    def best(self, left: np.ndarray) -> float:
        """The shift with the least squares."""
        if not self.answers.size:
            return self.now
        nearest, step = self.places[int(np.argmin(self.squares(left)))], self.places[1] - self.places[0]
        finer = np.clip(nearest + np.linspace(-step, step, FINE_PLACES), self.grid[0], self.grid[-1])
        return float(finer[int(np.argmin(self.squares(left, finer)))])

    def likeliest(self, left: np.ndarray) -> tuple[float, float]:
        """The shift with the least squares, beyond the bounds too, along the tangent there, and the squares per shift
        squared."""
        best = self.best(left)
        column = self.column(best)
        weight = float(column @ column)
        return best - float(column @ (left + self.change(best))) / max(weight, 1e-300), weight

    def change(self, shift: float) -> np.ndarray:
        """What the samples (m,) would be at a shift, less what they are."""
        if not self.answers.size:
            return np.zeros(self.where.stop - self.where.start)
        return np.asarray((SHARES(self._part(shift)) - SHARES(self._part(self.now))) @ self.answers)

    def column(self, shift: float) -> np.ndarray:
        """The derivative of the samples with respect to the shift, per second."""
        if not self.answers.size:
            return np.empty(0)
        return np.asarray(SHARES(self._part(shift), 1) @ self.answers / np.ptp(self.grid))

    @property
    def chord(self) -> float:
        """By how much the samples differ between the first and the last shift, per second."""
        if not self.answers.size:
            return 0.0
        return float(np.linalg.norm(self.answers[-1] - self.answers[0]) / np.ptp(self.grid))

    def _part(self, shift: float | np.ndarray) -> np.ndarray:
        """Of the way between the edge's bounds at which a shift [s] is."""
        return np.asarray((shift - self.grid[0]) / np.ptp(self.grid))


def edge_responses(study: Study, response: Response, values: Mapping[str, float], piece: Piece) -> list[EdgeResponse]:
    """The response of every edge's window to shifts within the edge's bounds, in the output that tells most.

    Every second edge is moved in the same simulation: its response has ended when the next but one comes, or is cut
    there.
    """
    edges = piece.driven.edges
    if not edges:
        return []
    order = np.argsort([e.time for e in edges], kind="stable")  # of several inputs
    turn = np.argsort(order)
    low, high = _inside(*bounds(piece))
    cases = []
    for parity in (0, 1):
        chosen = turn % 2 == parity
        for part in GRID:
            shift = np.where(chosen, low + part * (high - low), piece.shifts)
            cases.append(replace(piece.case, protocol=piece.driven_by(shift)))
    try:
        answers = response.of(cases).outputs_alone(values)
    except KernelError:
        return [EdgeResponse(slice(0, 0), np.array(GRID), np.empty((0, 0)), s) for s in piece.shifts]
    white = [whitened(piece.case, a, study.noise, piece.weight) for a in answers]

    def of_reading(reading: int) -> list[EdgeResponse]:
        found = []
        for i in range(len(edges)):
            place = samples_behind(piece, i, order[turn[i] + 1 : turn[i] + 2], reading)
            known = high[i] <= low[i] or place.stop <= place.start
            rows = white[turn[i] % 2 * len(GRID) : (turn[i] % 2 + 1) * len(GRID)]
            moved = np.empty((0, 0)) if known else np.array([w[place] for w in rows])
            where = slice(0, 0) if known else slice(place.start, place.start + _informative_samples(moved))
            grid = low[i] + np.array(GRID) * max(high[i] - low[i], LEAST_WAY)
            found.append(EdgeResponse(where, grid, moved[:, : where.stop - where.start], float(piece.shifts[i])))
        return found

    readings = map(of_reading, range(len(piece.case.readings)))
    return max(readings, key=lambda found: sum((m.chord * np.ptp(m.grid)) ** 2 for m in found))


def samples_behind(piece: Piece, number: int, following: Iterable[int], reading: int) -> slice:
    """The samples that may depend on an edge's instant: from its earliest one to that of the `following` edge."""
    edges, times = piece.driven.edges, piece.case.readings[reading].times
    offset = piece.case.parts[reading].start
    starts = [edges[i].earliest - 0.5 * edges[i].rise - piece.delays.get(edges[i].input, 0.0) for i in following]
    mine = edges[number]
    begin = np.searchsorted(times, mine.earliest - 0.5 * mine.rise - piece.delays.get(mine.input, 0.0))
    ends = [np.inf, *starts]
    return slice(offset + int(begin), offset + max(int(begin), int(np.searchsorted(times, min(ends)))))


def _informative_samples(answers: np.ndarray) -> int:
    """How many of the samples behind an edge hold TOLD of what its instant changes; `answers` are (g, m)."""
    told = np.cumsum((answers[-1] - answers[0]) ** 2)
    return min(int(np.searchsorted(told, TOLD * told[-1])) + 1, told.size)


def _inside(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The bounds of shifts (m,), a little apart from the samples that an edge is between."""
    way = INSIDE * (high - low)
    return low + way, high - way


def bounds(piece: Piece) -> tuple[np.ndarray, np.ndarray]:
    """The least and the largest shift [s] of every edge, each (m,), as its input and outputs tell."""
    if piece.arrived is None:
        return recorded_bounds(piece)
    low, high = piece.arrived
    return low.copy(), high.copy()


def recorded_bounds(piece: Piece) -> tuple[np.ndarray, np.ndarray]:
    """The same as its input alone tells."""
    edges = piece.driven.edges
    return np.array([e.earliest - e.time for e in edges]), np.array([e.latest - e.time for e in edges])


def into_bounds(shifts: np.ndarray, weights: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    """The least by which all shifts (m,) are moved to be within their bounds, as well as these weights allow."""

    def outside(by: float) -> float:
        return float(np.sum(weights * np.maximum(0.0, np.maximum(low - shifts - by, shifts + by - high)) ** 2))

    first, last = float(np.max(low - shifts)), float(np.min(high - shifts))
    if first <= last:
        return float(np.clip(0.0, first, last))
    return float(minimize_scalar(outside, bounds=(last, first), method="bounded").x)


def untold_delay(pieces: Sequence[Piece], name: str) -> float:
    """How far off [s, rms] a delay of an input may be that moves all its edges alike: they may have happened earlier or
    later together, anywhere until one is at a bound."""
    ends = [
        (s - low, high - s)
        for p in pieces
        for e, s, low, high in zip(p.driven.edges, p.shifts, *recorded_bounds(p), strict=True)
        if e.input == name
    ]
    if not ends:
        return 0.0
    earlier, later = np.maximum(np.min(ends, axis=0), 0.0)  # one may be beyond its bounds where outputs tell so
    return float(np.sqrt(MEAN_SQUARE * (earlier**3 + later**3) / max(earlier + later, LEAST_WAY)))


def reach(edge: Edge) -> float:
    """Half of the interval in which an edge may have happened."""
    return 0.5 * (edge.latest - edge.earliest)


def part_on_clock(squares: Sequence[np.ndarray]) -> float | None:
    """The part of the way between their bounds at which all edges happened, if they surely did; None if not.

    `squares`, each (FINE_PLACES,), are those of every edge at all parts.
    """
    if not squares:
        return None
    table = -0.5 * np.array(squares)
    anywhere = float(np.sum(logsumexp(table, axis=1) - np.log(FINE_PLACES)))
    together = float(logsumexp(table.sum(axis=0)) - np.log(FINE_PLACES))
    if together < anywhere + SURELY:
        return None
    return float(np.argmax(table.sum(axis=0))) / (FINE_PLACES - 1)
