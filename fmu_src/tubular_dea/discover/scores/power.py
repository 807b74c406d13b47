"""Detection limits: for every effect the smallest size that these recordings would have shown.

An effect of size A adds A c to the whitened residual. The part c_p of c that the present parameters cannot absorb
gives an expected score statistic of A^2 |c_p|^2. The detection limit is the size that exceeds the largest score of 95 %
of nulls (5 % false alarms) with a probability of POWER. For an effect with a share (a lag) the size is its time
constant: the one at which the whole effect would be detected, from its shape grid.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtri

from ...model.effect import Effect
from .bank import HIDDEN, Candidate
from .bootstrap import NullScores

# Set by convention (Cohen, "Statistical power analysis for the behavioral sciences", 1988).
# Check: `pytest tests/test_acceptance.py::test_what_would_have_been_seen_is_as_large_as_it_takes`
VISIBLE_ALARMS = 0.05  # [1] share of records with nothing missing whose largest score is above what counts as seen
POWER = 0.8  # [1] share of records with an effect of that size in which it is seen

# Set by theory: a short lag acts by its first moment, so its gain grows with the square of its length; by judgement no
# faster than with the fourth power. Check: `pytest tests/test_rounds.py`
SLOWEST_GAIN = 2.0  # [1] power of the gain over a lag's length, beyond its grid, at least
FASTEST_GAIN = 4.0  # [1] the same at most

Sizes = dict[str, float | None]


def detection_limits(listed: Sequence[Candidate], jacobian: np.ndarray, null: NullScores) -> dict[str, Sizes]:
    """The detection limit (SI) by effect and parameter; None where no size would have been detected.

    `listed` are the candidates at the present model with `jacobian` (N, k).
    """
    needed = (np.sqrt(null.threshold(VISIBLE_ALARMS)) + ndtri(POWER)) ** 2
    basis, _ = np.linalg.qr(jacobian)
    found: dict[str, Sizes] = {}
    for effect in {c.effect.id: c.effect for c in listed}.values():
        tangents = [c for c in listed if c.effect.id == effect.id]
        statistics = [_unit_statistic(c, basis) for c in tangents]
        name = tangents[0].names[0]
        if name in effect.on:
            found[effect.id] = _length(effect, tangents, statistics, needed)
        else:
            best = max(statistics)
            found[effect.id] = {name: float(np.sqrt(needed / best)) if best > 0 else None}
    return found


def _unit_statistic(candidate: Candidate, basis: np.ndarray) -> float:
    """The expected score of the first amplitude at 1 (SI)."""
    column = candidate.columns[:, 0]
    left = column - basis @ (basis.T @ column)
    size = float(np.linalg.norm(left))
    return size**2 if size > HIDDEN * float(np.linalg.norm(column)) else 0.0


def _length(effect: Effect, listed: Sequence[Candidate], statistics: Sequence[float], needed: float) -> Sizes:
    """The time constant (or rate, or frequency) at which the whole effect would just be detected."""
    name = next(iter(effect.shapes))
    best: dict[float, float] = {}
    for candidate, statistic in zip(listed, statistics, strict=True):
        at = candidate.shape[name]
        best[at] = max(best.get(at, 0.0), statistic)
    lengths = np.array(sorted(best))
    levels = np.array([best[x] for x in lengths])
    if levels.max() <= 0:
        return {name: None}
    x, y = np.log(lengths), np.log(np.maximum(levels, 1e-300))
    if y[0] > y[-1]:  # the effect grows as this falls (a rate limit): start from the other end
        x, y = -x[::-1], y[::-1]
        return {name: float(np.exp(-_crossing(x, y, float(np.log(needed)))))}
    return {name: float(np.exp(_crossing(x, y, float(np.log(needed)))))}


def _crossing(x: np.ndarray, y: np.ndarray, level: float) -> float:
    """Where y, which rises over x, reaches `level`; extrapolated linearly beyond the first and last points."""
    above = np.flatnonzero(y >= level)
    if not above.size:
        return float(x[-1] + (level - y[-1]) / SLOWEST_GAIN)
    i = int(above[0])
    if i == 0:
        slope = np.clip((y[1] - y[0]) / (x[1] - x[0]) if x.size > 1 else SLOWEST_GAIN, SLOWEST_GAIN, FASTEST_GAIN)
        return float(x[0] - (y[0] - level) / slope)
    return float(x[i - 1] + (level - y[i - 1]) * (x[i] - x[i - 1]) / (y[i] - y[i - 1]))
