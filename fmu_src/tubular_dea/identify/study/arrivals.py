"""When edges of an input arrive behind a delay, as the outputs tell that follow it at once.

Such an output jumps between two samples, wherever that is: no model is needed to see between which. Edges of a command
that switched between samples too are known to a sample, and so is a delay by each of them; by all together far better.
A fit does not find it: what it costs falls in steps, one wherever an edge passes a sample.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...kernel import KernelError
from ...model.declare import Delay, Model
from ...model.delays import direct
from ..fitting.compiled import Ids
from ..threads import side_by_side
from .instants import bounds, into_bounds, recorded_bounds
from .study import Piece, Study

# Set by judgement. Check: `pytest tests/test_delayed_edges.py -k at_once`
SOUGHT = 8.0  # [samples] to both sides of where an edge is now, in which its arrival is looked for
JUMPS = 12.0  # [standard deviations] by which an output differs before and behind an edge, at least, where it tells
KEPT_OFF = 0.02  # [samples] by which an edge keeps off the samples between which it arrived


@dataclass(frozen=True)
class Arrivals:
    """Behind the delay parameter `by`, the edges `numbers` (m,) of a piece arrived between `first` and `last` (m,) [s]
    on its clock."""

    by: str
    numbers: np.ndarray
    first: np.ndarray
    last: np.ndarray

    def sent(self, piece: Piece) -> np.ndarray:
        """When these edges (m,) happened [s], as was first estimated."""
        return np.array([piece.driven.edges[i].time for i in self.numbers])

    def delays(self, piece: Piece, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Between which delays [s] each edge (m,) arrives then, if it is shifted by `low` to `high`, of all edges."""
        sent = self.sent(piece)
        return self.first - sent - high[self.numbers], self.last - sent - low[self.numbers]


def arrivals(study: Study, ids: Ids, values: Mapping[str, float], names: Sequence[str]) -> list[list[Arrivals]]:
    """What every piece tells of the delays `names` at the model with effects `ids` and parameters `values` (SI)."""
    model = study.compiled.kernel(ids).model
    asked = [(d, outputs) for d in model.delays if d.by in names and (outputs := direct(model, d))]
    if not asked:
        return [[] for _ in study.pieces]
    return side_by_side(lambda p: [*_of_piece(study, ids, values, p, model, asked)], study.pieces)


def likeliest_delay(told: Sequence[tuple[np.ndarray, np.ndarray]], now: float) -> float:
    """The delay [s] at which most edges arrive between the samples that tell, each `told` as the delays (m,) between
    which it does; the nearest to `now` of those, off their ends where that is possible."""
    if not any(low.size for low, _ in told):
        return now
    low, high = (np.concatenate(ends) for ends in zip(*told, strict=True))
    ends = np.unique(np.concatenate([low, high]))
    places = np.append((ends[:-1] + ends[1:]) / 2, now)
    within = [int(np.sum((low <= by) & (by <= high))) for by in places]
    best = places[np.array(within) == max(within)]
    return float(now if within[-1] == max(within) else best[int(np.argmin(np.abs(best - now)))])


def _of_piece(
    study: Study,
    ids: Ids,
    values: Mapping[str, float],
    piece: Piece,
    model: Model,
    asked: Sequence[tuple[Delay, list[str]]],
) -> Iterator[Arrivals]:
    """What one piece tells of each delay."""
    reach = SOUGHT * piece.driven.step
    for delay, outputs in asked:
        ways = [max(values[delay.by] + by, 0.0) for by in (-reach, reach)]
        response = study.asked(ids, [piece.case])
        try:
            behind, before = (response.outputs_alone({**values, delay.by: by})[0] for by in ways)
        except KernelError:
            continue
        inputs = {q.name for q in model.inputs}
        edges = piece.driven.edges
        mine = [i for i, e in enumerate(edges) if e.rise == 0 and (delay.of not in inputs or e.input == delay.of)]
        found = [(i, *between) for i in mine if (between := _between(study, piece, i, outputs, ways, behind, before))]
        if found:
            numbers, first, last = (np.array(column) for column in zip(*found, strict=True))
            yield Arrivals(delay.by, numbers, first, last)


def _between(
    study: Study,
    piece: Piece,
    number: int,
    outputs: Sequence[str],
    ways: Sequence[float],
    behind: np.ndarray,
    before: np.ndarray,
) -> tuple[float, float] | None:
    """The samples between which an edge arrived, as the first of the `outputs` tells that jumps there clearly; None
    where none does. `behind` and `before` (N,) are what is read if it arrives early or late, by `ways` [s]."""
    edge, times_of_edges = piece.driven.edges[number], np.array([e.time for e in piece.driven.edges])
    sent = edge.time + piece.shifts[number]
    others = np.abs(times_of_edges - edge.time)
    room = float(np.min(others[others > 0], initial=np.inf)) - 2 * piece.driven.step
    for reading, rows in zip(piece.case.readings, piece.case.parts, strict=True):
        if reading.output not in outputs:
            continue
        near = (reading.times > sent + ways[0]) & (reading.times < sent + min(ways[1], ways[0] + room))
        jump = np.abs(behind - before)[rows][near] / study.noise[reading.output].rms
        clear = int(np.argmin(np.append(jump, 0.0) >= JUMPS))  # what jumps may fade, as the current of a motor does
        near = np.flatnonzero(near)[:clear]
        read = piece.record[rows][near]
        arrived = np.abs(read - behind[rows][near]) < np.abs(read - before[rows][near])
        times, count = reading.times[near], int(arrived.sum())
        if 0 < count < arrived.size and arrived[-count:].all():  # else the model is too far off to tell
            keep = KEPT_OFF * piece.driven.step
            return float(times[-count - 1]) + keep, float(times[-count]) - keep
    return None


def with_arrivals(
    study: Study, ids: Ids, values: Mapping[str, float], names: Sequence[str]
) -> tuple[Study, dict[str, float]]:
    """The study with edges that may have happened only so that they arrive as outputs tell, behind delays among `names`
    at which most of them can; and the parameters (SI) with these delays."""
    study = replace(study, pieces=[p if p.arrived is None else replace(p, arrived=None) for p in study.pieces])
    told = arrivals(study, ids, values, names)
    values = dict(values) | _likeliest(study, told, values, bounds)
    pieces = [_within(p, each, values) if each else p for p, each in zip(study.pieces, told, strict=True)]
    return replace(study, pieces=pieces), values


def delays_of_arrivals(study: Study, ids: Ids, values: Mapping[str, float], names: Sequence[str]) -> dict[str, float]:
    """The delays [s] of those `names` at which most edges arrive as outputs tell, where edges are now."""
    study = replace(study, pieces=study.training)
    return _likeliest(study, arrivals(study, ids, values, names), values, lambda p: (p.shifts, p.shifts))


def _likeliest(
    study: Study,
    told: Sequence[list[Arrivals]],
    values: Mapping[str, float],
    reach: Callable[[Piece], tuple[np.ndarray, np.ndarray]],
) -> dict[str, float]:
    """The likeliest of each delay that the pieces in training tell of, with edges shifted as far as they `reach`."""
    possible: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for piece, each in zip(study.pieces, told, strict=True):
        for one in each if not piece.held_out else ():
            possible.setdefault(one.by, []).append(one.delays(piece, *reach(piece)))
    return {by: likeliest_delay(ends, values[by]) for by, ends in possible.items()}


def _within(piece: Piece, told: Sequence[Arrivals], values: Mapping[str, float]) -> Piece:
    """The piece with edges that happened so that they arrive as outputs tell, where their delays are those of `values`
    (SI). That they then happened between two samples of their input, `sent_as_recorded` sees to."""
    low, high = bounds(piece)
    for one in told:
        sent, mine = one.sent(piece) + values[one.by], one.numbers
        low[mine], high[mine] = one.first - sent, one.last - sent
    return _shifted(replace(piece, arrived=(low, high)), np.clip(piece.shifts, low, high))


def sent_as_recorded(pieces: Sequence[Piece]) -> list[Piece]:
    """The pieces with all edges of an input whose arrival is told moved alike, so that each happened between the two
    samples of its input, as well as may be; a fit's delay makes up for it."""
    moved, told = list(pieces), [p for p in pieces if p.arrived is not None and not p.held_out]
    for name in dict.fromkeys(e.input for p in told for e in p.driven.edges):
        each = [
            (s, 1.0, low, high)
            for p in told
            for e, s, low, high in zip(p.driven.edges, p.shifts, *recorded_bounds(p), strict=True)
            if e.input == name
        ]
        by = into_bounds(*np.array(each).T)
        moved = [_alike(p, name, by) if p.arrived is not None else p for p in moved]
    return moved


def _alike(piece: Piece, name: str, by: float) -> Piece:
    """The piece with all edges of an input, and between what they arrive, moved by a time [s]."""
    more = np.array([by if e.input == name else 0.0 for e in piece.driven.edges])
    low, high = bounds(piece)
    return _shifted(replace(piece, arrived=(low + more, high + more)), piece.shifts + more)


def _shifted(piece: Piece, shifts: np.ndarray) -> Piece:
    return replace(piece, shifts=shifts, case=replace(piece.case, protocol=piece.driven_by(shifts)))
