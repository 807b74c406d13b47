"""Does an addition hold on data that had no part in it: block cross-validation and the held-out pieces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..identify.fit import Fit
from .compiled import Ids
from .study import Piece, Study

BLOCK, FOLDS = 125, 6  # samples of a block (half a second), and folds they are dealt to


def cross_validated(fitted: Fit, pieces: Sequence[Piece]) -> float:
    """The sum of squares of blocks of samples under parameters found without them (linearised at the optimum).

    Blocks of BLOCK samples are dealt to FOLDS folds in turn, so that no fold takes away all that the record says about
    a parameter: whether a model extrapolates is asked of the held-out experiments.
    """
    J, r = fitted.jacobian, fitted.residual
    fold = _folds(pieces, r.size)
    information, slope = J.T @ J, J.T @ r
    total = 0.0
    for number in range(FOLDS):
        part, left = J[fold == number], r[fold == number]
        remaining = information - part.T @ part
        scale = np.sqrt(np.maximum(np.diag(remaining), 1e-12))
        target = (slope - part.T @ left) / scale
        step = -np.linalg.lstsq(remaining / np.outer(scale, scale), target, rcond=1e-10)[0] / scale
        moved = left + part @ step
        total += float(moved @ moved)
    return total


def _folds(pieces: Sequence[Piece], rows: int) -> np.ndarray:
    """The fold of every row; -1 for those of the prior, which are in all fits."""
    fold = np.full(rows, -1)
    begin, dealt = 0, 0
    for piece in pieces:
        blocks = np.arange(piece.record.size) // BLOCK
        fold[begin : begin + piece.record.size] = (blocks + dealt) % FOLDS
        begin += piece.record.size
        dealt += int(blocks[-1]) + 1
    return fold


def held_out_cost(study: Study, ids: Ids, fitted: Fit) -> float:
    """The sum of squares of the held-out pieces, in units of the noise; 0 where there are none."""
    if not study.held_out:
        return 0.0
    problem = study.problem(ids, [], fitted.values, study.held_out)
    residual = problem.residuals(np.empty(0))
    return float(residual @ residual)
