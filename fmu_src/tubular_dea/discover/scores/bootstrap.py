"""The null distribution of the largest score (nothing is missing), by a parametric bootstrap.

Whitened noise is white, so the scores of a null are projections of normal numbers on the candidates' columns; only
their Gram matrix is needed, and thousands of nulls cost a moment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from .bank import Candidate, visible

# Set by judgement: four of them are above the threshold, which a thousandth exceed.
# Check: `pytest tests/test_discover.py::test_records_with_other_noise_score_as_the_nulls_say`
NULL_DRAWS = 4000  # [1] records with nothing missing that are drawn


@dataclass(frozen=True)
class NullScores:
    """The largest score of `draws` records in which nothing is missing, ascending, shape (draws,)."""

    largest: np.ndarray

    def threshold(self, false_alarms: float) -> float:
        """The score that this share of nulls exceeds."""
        return float(np.quantile(self.largest, 1 - false_alarms))


def null_scores(
    listed: Sequence[Candidate], jacobian: np.ndarray, draws: int = NULL_DRAWS, seed: int = 0
) -> NullScores:
    """Largest scores of nulls, given the candidates and the jacobian (N, k) of the present model; 0 where this can
    stand for all of them."""
    basis, _ = np.linalg.qr(jacobian)
    bases = []
    for candidate in listed:
        columns = candidate.columns - basis @ (basis.T @ candidate.columns)
        columns = columns[:, visible(candidate, columns)]
        if columns.size:
            bases.append(np.linalg.qr(columns / np.linalg.norm(columns, axis=0))[0])
    if not bases:
        return NullScores(np.zeros(draws))
    together = np.column_stack(bases)
    gram = together.T @ together
    value, vector = scipy.linalg.eigh(gram)
    root = vector * np.sqrt(np.maximum(value, 0))
    normal = np.random.default_rng(seed).standard_normal((draws, gram.shape[0])) @ root.T
    edges = np.cumsum([0, *(q.shape[1] for q in bases)])
    each = [np.sum(normal[:, a:b] ** 2, axis=1) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    return NullScores(np.sort(np.max(each, axis=0)))
