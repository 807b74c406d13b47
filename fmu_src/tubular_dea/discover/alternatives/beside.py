"""What curves that are no effect explain of a residual: integrated out of it, each of about its usual size.

Rasmussen and Williams, "Gaussian processes for machine learning", 2006, eq. 2.39.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from ..options.options import Option

# Rows of a piece, its columns (N, k), and how much of each is in the residual (k,).
Curves = tuple[slice, np.ndarray, np.ndarray]


def taken(option: Option, columns: Iterable[np.ndarray]) -> Iterator[Curves]:
    """How much of its `columns`, whitened and one for each usual size, is in the residual of every training piece."""
    begin = 0
    for own in columns:
        rows = slice(begin, begin + len(own))
        along = own.T @ option.fitted.residual[rows]
        yield rows, own, np.linalg.solve(np.eye(along.size) + own.T @ own, along)
        begin = rows.stop


def marginal_misfit(option: Option, curves: Iterable[Curves]) -> float:
    """The sum of squares of the training pieces, with the curves integrated out."""
    explained = (float(option.fitted.residual[rows] @ columns @ found) for rows, columns, found in curves)
    return option.fitted.cost - sum(explained)
