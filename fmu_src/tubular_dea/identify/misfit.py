"""Whether a fit leaves more than noise: if it does, the model lacks something, and its intervals are too narrow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .fit import Fit
from .problem import Problem

BLOCK = 25  # samples (0.1 s): below the frequencies of the sensor's noise, above those of most effects
CHANCE = 5.0  # standard deviations of the slow parts up to which they are noise


@dataclass(frozen=True)
class Misfit:
    """A whitened residual against the noise: `ratio` of their rms, and how far slow parts stand out of it, `slow`.

    `slow` is the excess of the mean square over blocks of BLOCK samples, in its standard deviations under noise alone.
    """

    ratio: float
    slow: float

    @property
    def significant(self) -> bool:
        """More than noise: the model lacks something."""
        return self.slow > CHANCE


def misfit(problem: Problem, best: Fit) -> Misfit:
    """How the residual of a fit (without a prior) compares with the noise of its problem."""
    ends = np.cumsum([r.size for r in problem.records])
    pieces = np.split(best.residual, ends[:-1])
    sums = np.concatenate([p[: p.size // BLOCK * BLOCK].reshape(-1, BLOCK).sum(axis=1) for p in pieces])
    excess = float(np.mean(sums**2)) / BLOCK - 1
    freedom = best.residual.size - len(best.names)
    return Misfit(float(np.sqrt(best.cost / freedom)), excess / float(np.sqrt(2 / sums.size)))
