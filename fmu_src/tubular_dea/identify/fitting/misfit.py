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
CLEAN_TOTAL = 4.0  # [standard deviations] of all samples up to which an excess is noise
MOST_COLOURED = 16.0  # [1] times the variance of white noise that slow noise may have where no stretch tells


@dataclass(frozen=True)
class ResidualOverNoise:
    """A whitened residual compared with the noise: the `ratio` of their rms, and the excess of its slow part, `slow`.

    `slow` is the excess of the mean square over blocks of BLOCK samples, and `total` that of all samples, in their
    standard deviations under noise alone, whose level is not known exactly either. `blocks` is the ratio of the rms
    over blocks. `coloured` is its square where no stretch is quiet or long enough to tell how much slow noise there
    is; 1 elsewhere.
    """

    ratio: float
    slow: float
    total: float = 0.0
    coloured: float = 1.0
    blocks: float = 1.0

    @property
    def significant(self) -> bool:
        """Whether the residual is more than noise, so that the model lacks something."""
        return self.slow > SLOW_CHANCE and not self.may_be_slow_noise

    @property
    def may_be_slow_noise(self) -> bool:
        """Whether noise with a colour explains the residual's slow part, where nothing tells its colour."""
        return self.slow > SLOW_CHANCE and coloured_noise(self.coloured, self.total)


def coloured_noise(coloured: float, z_total: float) -> bool:
    """Whether noise may be slow enough to be all of a residual: its variance over blocks, relative to that of noise
    whose colour no stretch tells, and the excess of all samples in standard deviations."""
    return 1 < coloured < MOST_COLOURED and z_total < CLEAN_TOTAL


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
    slow = float(np.mean(sums**2)) / BLOCK
    count = sum(r.size for r in each)
    squares = sum(float(r @ r) for r in each) / (count - len(best.names))
    level = max(noise.uncertainty for noise in problem.noise.values())
    known = all(noise.quiet and noise.slow_known for noise in problem.noise.values())
    return ResidualOverNoise(
        float(np.sqrt(squares)),
        (slow - 1) / float(np.hypot(np.sqrt(2 / sums.size), level)),
        (squares - 1) / float(np.hypot(np.sqrt(2 / count), level)),
        1.0 if known else max(1.0, slow),
        float(np.sqrt(slow)),
    )
