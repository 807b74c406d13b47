"""Validation on data that took no part in a fit: block cross-validation and the held-out pieces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from ...identify.fitting.compiled import Ids
from ...identify.fitting.fit import Fit
from ...identify.study.study import Piece, Study

# Set by judgement: half a second at 250 Hz. Check: `python -m blind.score --nulls 60 --seed 1000`
FOLD_BLOCK = 125  # [samples] of a block that is left out
FOLDS = 6  # [1] folds that blocks are dealt to

# Set by theory: what rounding leaves of an information of 1 that is taken away again; no unit test tells a factor of
# four. Check: `pytest tests/test_validation.py tests/test_acceptance.py`
UNDECIDED = 1e-10  # [1] scaled information in a direction that the rest does not determine, at most
NO_INFORMATION = 1e-12  # [1] information that a parameter's scale is taken from at least


def left_out(fitted: Fit, fold: np.ndarray) -> float:
    """The sum of squares of folds under parameters fitted without them (linearised at the optimum).

    `fold` (N,) is the fold of each row; rows with -1 are in all fits.
    """
    J, r = fitted.jacobian, fitted.residual
    information, slope = J.T @ J, J.T @ r
    total = 0.0
    for number in range(int(fold.max(initial=-1)) + 1):
        part, left = J[fold == number], r[fold == number]
        remaining = information - part.T @ part
        scale = np.sqrt(np.maximum(np.diag(remaining), NO_INFORMATION))
        target = (slope - part.T @ left) / scale
        step = -np.linalg.lstsq(remaining / np.outer(scale, scale), target, rcond=UNDECIDED)[0] / scale
        moved = left + part @ step
        total += float(moved @ moved)
    return total


def predictive_deviance(fitted: Fit, fold: np.ndarray) -> float:
    """Minus twice the logarithm of the density that fits without a fold predict for it, summed over folds.

    A constant apart; linearised at the optimum. What the rest does not determine is predicted widely, not wrongly. With
    Q the least sum of squares and A the information, a density is the ratio of exp(-Q / 2) / sqrt(det A) with the fold
    and without it (Bishop, "Pattern recognition", eq. 3.86). `fold` (N,) is as in `left_out`.
    """
    J, r = fitted.jacobian, fitted.residual
    information, slope, squares = J.T @ J, J.T @ r, float(r @ r)
    whole, total = _evidence(information, slope, squares), 0.0
    for number in range(int(fold.max(initial=-1)) + 1):
        part, left = J[fold == number], r[fold == number]
        total += whole - _evidence(information - part.T @ part, slope - part.T @ left, squares - float(left @ left))
    return total


def _evidence(information: np.ndarray, slope: np.ndarray, squares: float) -> float:
    """Q + ln det A of normal equations and the sum of squares at their expansion point."""
    scale = np.sqrt(np.maximum(np.diag(information), NO_INFORMATION))
    values, vectors = scipy.linalg.eigh(information / np.outer(scale, scale))
    values = np.maximum(values, UNDECIDED)  # of what is not determined, rounding is left
    along = vectors.T @ (slope / scale)
    return float(squares - np.sum(along**2 / values) + np.log(values).sum() + 2 * np.log(scale).sum())


def folds(pieces: Sequence[Piece], rows: int) -> tuple[np.ndarray, np.ndarray]:
    """The fold of every row (N,), by blocks in turn and by experiments; -1 for the rows of the prior.

    With blocks, no fold contains all information on a parameter; with experiments, a model must extrapolate.
    """
    blocks, experiments = np.full(rows, -1), np.full(rows, -1)
    begin, dealt = 0, 0
    for number, piece in enumerate(pieces):
        rows_of = slice(begin, begin + piece.record.size)
        block = np.arange(piece.record.size) // FOLD_BLOCK
        blocks[rows_of], experiments[rows_of] = (block + dealt) % FOLDS, number
        begin += piece.record.size
        dealt += int(block[-1]) + 1
    return blocks, experiments


def held_out_residual(study: Study, ids: Ids, fitted: Fit) -> np.ndarray:
    """The white residual (N,) of the held-out pieces; empty where there are none."""
    if not study.held_out:
        return np.empty(0)
    return study.problem(ids, [], fitted.values, study.held_out).residuals(np.empty(0))
