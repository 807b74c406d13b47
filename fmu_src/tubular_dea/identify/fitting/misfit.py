"""The lack of fit of an identification: if it is significant, the model lacks something and intervals are too
narrow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .fit import Fit
from .problem import Problem

# Set by judgement: below the frequencies of the sensor's noise, above those of most effects (0.1 s at 250 Hz).
# Check: `pytest tests/test_discover.py`, `python -m blind.score --nulls 60 --singles 2 --seed 1000`
BLOCK = 25  # [samples] over which residuals are averaged for their slow parts

# Set by judgement. Check: `pytest tests/test_acceptance.py`, `python -m blind.score --nulls 60 --seed 1000`
SLOW_CHANCE = 5.0  # [standard deviations] of the slow parts up to which they are noise


@dataclass(frozen=True)
class ResidualOverNoise:
    """A whitened residual compared with the noise: the `ratio` of their rms, and the excess of its slow part, `slow`.

    `slow` is the excess of the mean square over blocks of BLOCK samples, in its standard deviations under noise alone,
    whose level is not known exactly either.
    """

    ratio: float
    slow: float

    @property
    def significant(self) -> bool:
        """Whether the residual is more than noise, so that the model lacks something."""
        return self.slow > SLOW_CHANCE


def parts(residual: np.ndarray, records: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The residual (N,) of each record; the rows of a prior, which follow them, are left out."""
    ends = np.cumsum([r.size for r in records])
    return np.split(residual[: ends[-1]], ends[:-1])


def block_sums(residuals: Sequence[np.ndarray]) -> np.ndarray:
    """Sums over whole blocks of BLOCK samples of each residual, one after the other."""
    return np.concatenate([r[: r.size // BLOCK * BLOCK].reshape(-1, BLOCK).sum(axis=1) for r in residuals])


def residual_over_noise(problem: Problem, best: Fit) -> ResidualOverNoise:
    """How the residual of a fit compares with the noise of its problem."""
    each = parts(best.residual, problem.records)
    sums = block_sums(each)
    excess = float(np.mean(sums**2)) / BLOCK - 1
    freedom = sum(r.size for r in each) - len(best.names)
    level = max(noise.uncertainty for noise in problem.noise.values())
    uncertainty = float(np.hypot(np.sqrt(2 / sums.size), level))
    return ResidualOverNoise(float(np.sqrt(sum(float(r @ r) for r in each) / freedom)), excess / uncertainty)
