"""A record linearised at the present model: its residual, and how instants and nuisance parameters change it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..fitting.compiled import Ids
from ..fitting.problem import whitened
from .instants import ON_CLOCK, EdgeResponse, bounds, edge_responses, reach
from .nuisances import EDGE_OF, EDGE_STEP, step_of
from .study import Piece, Study

# Set by judgement. Check: `pytest tests/test_adjust.py -k clock`
ANYWHERE = 0.8  # [1] of the sampling interval in which an edge's instant is unknown: samples on its way tell it else


@dataclass(frozen=True)
class Linearised:
    """A piece linearised at the present model: its white residual and whitened columns, before any marginalisation.

    `windows` are the samples that depend on the instant of each edge, and their response to shifts within its bounds;
    `lasting` (k,) are the shifts [s] of edges that have a column in their place, and 0 for the other columns.
    """

    residual: np.ndarray
    windows: list[EdgeResponse]
    columns: np.ndarray
    lasting: np.ndarray

    def undecided(self) -> np.ndarray:
        """The residual (N,) with every edge at its first estimate, about which its prior is: what all edges have been
        shifted by alike may be the delay of their monitor."""
        found = self.residual - self.columns @ self.lasting
        for edge in self.windows:
            found[edge.where] += edge.change(0.0)
        return found


def linearised_piece(study: Study, ids: Ids, values: Mapping[str, float], piece: Piece) -> Linearised:
    """The piece linearised: white residual, responses to its edges, columns of its nuisance parameters."""
    response = study.asked(ids, [piece.case])
    here = response.outputs_alone(values)[0]
    residual = whitened(piece.case, here - piece.record, study.noise, piece.weight)
    columns = whitened(piece.case, piece.nuisances.columns, study.noise, piece.weight)
    lasting = lasting_shifts(piece)
    edges = [] if lasting_edges(piece) else edge_responses(study, response, values, piece)
    return Linearised(residual, edges, columns, lasting)


def lasting_edges(piece: Piece) -> dict[int, int]:
    """The edges that are estimated together: of every nuisance parameter that is one's instant, the edge's number."""
    return {k: int(n.removeprefix(EDGE_OF)) for k, n in enumerate(piece.nuisances.names) if n.startswith(EDGE_OF)}


def lasting_shifts(piece: Piece) -> np.ndarray:
    """The shift [s] of every nuisance parameter (k,) that is an edge's instant, 0 for the others."""
    lasting, found = lasting_edges(piece), np.zeros(len(piece.nuisances.names))
    found[list(lasting)] = piece.shifts[list(lasting.values())]
    return found


def wide(piece: Piece) -> np.ndarray:
    """Which edges (m,) may have happened anywhere between two samples."""
    low, high = bounds(piece)
    return high - low > ANYWHERE * step_of(piece)


def windows_of(
    piece: Piece, linear: Linearised, shifts: np.ndarray, on_clock: bool = False
) -> list[tuple[slice, np.ndarray, float, float]]:
    """The samples of every edge, their column at a shift, its prior [s], small for those that are `on_clock`, and the
    column's length on average over all shifts."""
    known = np.where(wide(piece) & on_clock, ON_CLOCK * step_of(piece), np.inf)
    return [
        (m.where, m.column(float(s)), min(reach(e), k), m.chord)
        for m, s, e, k in zip(linear.windows, shifts, piece.driven.edges, known, strict=False)
    ]


def common_shift(
    study: Study, ids: Ids, values: Mapping[str, float], piece: Piece, shifts: np.ndarray, on_clock: bool
) -> tuple[np.ndarray, float]:
    """The whitened column (N,) of a shift of all edges alike, and its prior [s].

    Of edges that are on one clock it is anywhere between two samples: many do not tell it better. All outputs feel it,
    and windows are of one: a time constant of the others was 6 standard errors off.
    """
    anywhere, (low, high) = wide(piece), bounds(piece)
    if not anywhere.any():
        return np.zeros(piece.record.size), 0.0
    up = high - shifts > shifts - low  # each towards its farther bound: none passes a sample
    by = EDGE_STEP * 0.5 * float((high - low)[anywhere].min())
    moves = [np.where(anywhere & up, by, 0.0), np.where(anywhere & ~up, -by, 0.0)]
    cases = [replace(piece.case, protocol=piece.driven_by(shifts + move)) for move in moves]
    later, earlier = study.asked(ids, cases).possible(values)
    if later is None or earlier is None:
        return np.zeros(piece.record.size), 0.0
    alike = 1 if on_clock else int(anywhere.sum())
    deviation = step_of(piece) / float(np.sqrt(12.0 * alike))
    return whitened(piece.case, (later - earlier) / by, study.noise, piece.weight), deviation
