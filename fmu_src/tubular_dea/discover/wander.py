"""A check of slow effects: could a sensor's zero that wanders slowly within a file explain them?

Slow effects (heating, softening, drift) resemble a wandering zero: a smooth curve over the time of each file, of the
usual size of zeros. They are accepted only if they explain more than such curves. The curves are integrated out
(Rasmussen and Williams, "Gaussian processes for machine learning", 2006, eq. 2.39) for this comparison only. The
plant's own parameters are fitted without them, because they would absorb the slow parts that determine these
parameters.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial.legendre import legvander

from ..identify.problem import whitened
from ..identify.study import Piece, Study
from .options import Option

# Set by judgement: 6 um for the tube's laser. Check: `python -m blind.score --nulls 12 --conventions drift --seed 1000`
WANDERS = 0.2  # [1] of the usual size of an output's zero, by which each curve wanders (standard deviation)
CURVES = 4  # [1] curves over a file's time: Legendre polynomials from a straight line up


def explained_by_wandering(study: Study, before: Option, after: Option, threshold: float) -> bool:
    """Whether, with a wandering zero, the last effect of `after` gains less than `threshold` over `before`.

    An effect of the sensor's own channel may be such a fault, and is not checked.
    """
    if study.catalogue[after.ids[-1]].channel in {o.channel for o in study.plant.outputs}:
        return False
    return _misfit(study, before) - _misfit(study, after) < threshold


def _misfit(study: Study, option: Option) -> float:
    """The sum of squares of the training pieces, with the wandering of each integrated out."""
    total, begin = 0.0, 0
    for piece in study.training:
        residual = option.fitted.residual[begin : begin + piece.record.size]
        columns = _curves(study, piece)
        along = columns.T @ residual
        taken = along @ np.linalg.solve(np.eye(along.size) + columns.T @ columns, along)
        total, begin = total + float(residual @ residual - taken), begin + residual.size
    return total + float(np.sum(option.fitted.residual[begin:] ** 2))


def _curves(study: Study, piece: Piece) -> np.ndarray:
    """The curves of every output over a piece, whitened as its record is, shape (N, curves)."""
    found = []
    for reading, part in zip(piece.case.readings, piece.case.parts(), strict=True):
        span = float(np.ptp(reading.times)) or 1.0
        columns = np.zeros((piece.record.size, CURVES))
        columns[part] = legvander(2 * (reading.times - reading.times[0]) / span - 1, CURVES)[:, 1:]
        found.append(WANDERS * study.zero(reading.output) * columns)
    return piece.marginal.apply(whitened(piece.case, np.hstack(found), study.noise, piece.weight))
