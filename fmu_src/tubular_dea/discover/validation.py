"""Does an addition hold on data that had no part in it: block cross-validation and the held-out pieces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..identify.fit import Fit
from .compiled import Ids
from .study import Piece, Study


def cross_validated(fitted: Fit, pieces: Sequence[Piece]) -> float:
    """The sum of squares of every training piece under parameters found without it (linearised at the optimum)."""
    J, r = fitted.jacobian, fitted.residual
    information, slope = J.T @ J, J.T @ r
    total, begin = 0.0, 0
    for piece in pieces:
        rows = slice(begin, begin + piece.record.size)
        begin = rows.stop
        part, left = J[rows], r[rows]
        remaining = information - part.T @ part
        scale = np.sqrt(np.maximum(np.diag(remaining), 1e-12))
        step = (
            -np.linalg.lstsq(remaining / np.outer(scale, scale), (slope - part.T @ left) / scale, rcond=1e-10)[0]
            / scale
        )
        moved = left + part @ step
        total += float(moved @ moved)
    return total


def held_out_cost(study: Study, ids: Ids, fitted: Fit) -> float:
    """The sum of squares of the held-out pieces, in units of the noise; 0 where there are none."""
    if not study.held_out:
        return 0.0
    problem = study.problem(ids, [], fitted.values, study.held_out)
    residual = problem.residuals(np.empty(0))
    return float(residual @ residual)
