"""The lack of fit of an identification: if it is significant, the model lacks something and intervals are too
narrow."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from ..signals.noise import Noise
from .fit import Fit
from .problem import Problem

# Set by judgement: below the frequencies of the sensor's noise, above those of most effects (0.1 s at 250 Hz).
# Check: `pytest tests/test_discover.py`, `python -m blind.score --nulls 60 --singles 2 --seed 1000`
BLOCK = 25  # [samples] over which residuals are averaged for their slow parts

# Set by judgement. Check: `pytest tests/test_acceptance.py`, `python -m blind.score --nulls 60 --seed 1000`
SLOW_CHANCE = 5.0  # [standard deviations] of the slow parts up to which they are noise
CLEAN_TOTAL = 4.0  # [standard deviations] of all samples up to which an excess is noise
MOST_COLOURED = 16.0  # [1] times the variance of white noise that slow noise may have where no stretch tells

# Set by measurement: of 400 sets of files each with white, autoregressive or 1/f noise, less a parabola, none is so
# unlike, and of random walks 3 %; a free surface that swings at 2.3 Hz left 13 times the noise beside heartbeats, and
# none beside steps. Check: `pytest tests/test_steady.py`
UNLIKE_CHANCE = 1e-5  # [1] below which slow parts of a residual are too unlike from part to part to be noise
PARTS_A_RECORD = 4  # [1] parts of a record that are compared, at most
BLOCKS_A_PART = 8  # [1] blocks that each has, at least


@dataclass(frozen=True)
class ResidualOverNoise:
    """A whitened residual compared with the noise: the `ratio` of their rms, and the excess of its slow part, `slow`.

    `slow` is the excess of the mean square over blocks of BLOCK samples, and `total` that of all samples, in their
    standard deviations under noise alone, whose level is not known exactly either. `blocks` is the ratio of the rms
    over blocks. `coloured` is its square where no stretch is quiet or long enough to tell how much slow noise there
    is, and it is as slow in all parts of the records; 1 elsewhere.
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


def alike_throughout(means: Sequence[np.ndarray]) -> bool:
    """Whether block means (n,) of records, each over its standard deviation, are alike in all parts of these, as those
    of noise are, however slow: Bartlett's test (Proc. R. Soc. A 160 (1937) 268), with as many degrees of freedom as
    blocks that depend on each other have."""
    cut = [p for m in means for p in np.array_split(m, min(PARTS_A_RECORD, max(1, m.size // BLOCKS_A_PART)))]
    kept = [p for p in cut if p.size >= BLOCKS_A_PART and np.any(p)]
    if len(kept) < 2:
        return True
    sizes, variances = np.array([float(p.size) for p in kept]), np.array([np.mean(p**2) for p in kept])
    lags = np.arange(1, int(sizes.min()) // 2 + 1)
    shared = np.array([sum(p[k:] @ p[:-k] / v for p, v in zip(kept, variances, strict=True)) for k in lags])
    alike = shared / np.array([np.sum(sizes - k) for k in lags])
    freedom = sizes / (1 + 2 * np.sum((1 - lags / sizes.min()) * alike**2))
    whole = freedom.sum()
    statistic = whole * np.log(freedom @ variances / whole) - freedom @ np.log(variances)
    return bool(chi2.sf(statistic, len(kept) - 1) > UNLIKE_CHANCE)


def slow_noise_told(noises: Collection[Noise], means: Sequence[np.ndarray]) -> bool:
    """Whether stretches tell how slow all noises are, or block means (n,) of each record that these are no noise.

    What rounding adds is slow where the plant moves slowly: it is alike nowhere.
    """
    if all(noise.quiet and noise.slow_known for noise in noises):
        return True
    return not (any(noise.grain > 0 for noise in noises) or alike_throughout(means))


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
    ends = np.cumsum([r.size // BLOCK for r in each])[:-1]
    slow = float(np.mean(sums**2)) / BLOCK
    count = sum(r.size for r in each)
    squares = sum(float(r @ r) for r in each) / (count - len(best.names))
    level = max(noise.uncertainty for noise in problem.noise.values())
    told = slow_noise_told(problem.noise.values(), np.split(sums / np.sqrt(BLOCK), ends))
    return ResidualOverNoise(
        float(np.sqrt(squares)),
        (slow - 1) / float(np.hypot(np.sqrt(2 / sums.size), level)),
        (squares - 1) / float(np.hypot(np.sqrt(2 / count), level)),
        1.0 if told else max(1.0, slow),
        float(np.sqrt(slow)),
    )
