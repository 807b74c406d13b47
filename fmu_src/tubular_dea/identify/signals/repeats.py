"""The noise in what a plant does again and again: what one repetition does not share with the others.

A heart's beats follow each other without a quiet part, and what a model lacks comes back with each of them, slowly
changing. So of a model's residual, cut into windows of one beat each, all that is common to the windows is taken out,
sample by sample, with what of it grows over the record or goes with how long the beat before was. What is left has
little of what the model lacks, and the noise's whole colour (coherent averaging; Rompelman and Ros, J. Biomed. Eng. 8
(1986) 24). Near switchings nothing is told: their instants are known to a part of a sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...stretches import true_stretches
from .quiet import LEAST_STRETCH, Stretches, basis, paced
from .sampling import usual_step

# Set by judgement. Check: `pytest tests/test_repeats.py`,
# `python -m blind.score --nulls 12 --conventions beats --seed 1000`
LEAST_REPETITIONS = 30  # [1] windows of a record that tell what they have in common
SHORTER = 0.1  # [1] of all repetitions are shorter than a window
IN_TIME = 2  # [1] degree of the polynomial in time by which what is common changes
NEAR = 5  # [samples] about a switching in which it may be seen
SELDOM = 0.05  # [1] of the windows: a switching that fewer have is left out with them

# Set by theory: no digits are lost. Check: `pytest tests/test_repeats.py`
LIKE_OTHERS = 1e-9  # [1] of the largest singular value: what changes by less is no change of its own


@dataclass(frozen=True)
class Repeated:
    """A residual `values` (n,) at `time` (n,), the `begins` (k,) of repetitions and all `switchings` (m,), in s."""

    time: np.ndarray
    values: np.ndarray
    begins: np.ndarray
    switchings: np.ndarray


def unrepeated(records: Sequence[Repeated], pace: float = 1.0) -> list[Stretches]:
    """What repetitions do not share, of all records that have enough of them, of a plant that takes `pace` times as
    long as usual."""
    return [s for number, record in enumerate(records) for s in _unshared(record, number, pace)]


def _unshared(record: Repeated, number: int, pace: float) -> list[Stretches]:
    """What the repetitions of one record do not share: stretches between switchings."""
    if record.begins.size <= LEAST_REPETITIONS:
        return []
    step, lasts = usual_step(record.time), np.diff(record.begins)
    size = int(np.quantile(lasts, SHORTER) / step)
    first = np.searchsorted(record.time, record.begins[1:-1])
    whole = (lasts[1:] >= size * step) & (first + size <= record.time.size)
    near = _near(record, first, size)
    often = near[whole].mean(axis=0) > SELDOM if whole.any() else np.ones(size, dtype=bool)
    kept = whole & ~np.any(near & ~often, axis=1)
    if kept.sum() < LEAST_REPETITIONS:
        return []
    apart = _complement(record.time[first[kept]], lasts[:-1][kept])
    cut = record.values[first[kept, None] + np.arange(size)].T @ apart
    first_kept = first[kept][: cut.shape[1]]
    return [
        Stretches(step, cut[a:b], basis(b - a, paced(step, pace)), np.full(cut.shape[1], number), first_kept + a)
        for a, b in true_stretches(~often)
        if b - a >= LEAST_STRETCH
    ]


def _near(record: Repeated, first: np.ndarray, size: int) -> np.ndarray:
    """Whether a switching is near each sample of the windows (m, size) that begin at samples `first` (m,)."""
    at = np.searchsorted(record.time, record.switchings)
    marked = np.zeros(record.time.size + size + 2 * NEAR + 1)
    np.add.at(marked, at, 1.0)  # from NEAR before it
    np.add.at(marked, at + 2 * NEAR, -1.0)  # to as many behind it
    beside = np.cumsum(marked)[NEAR:] > 0
    return np.asarray(beside[first[:, None] + np.arange(size)])


def _complement(begins: np.ndarray, before: np.ndarray) -> np.ndarray:
    """What of windows (m,) is no polynomial in time and does not go with how long the repetition before was: an
    orthonormal basis (m, m - p)."""
    along = np.column_stack([np.polynomial.legendre.legvander(_scaled(begins), IN_TIME), _scaled(before)])
    left, sizes, _ = np.linalg.svd(along)
    return np.asarray(left[:, int(np.sum(sizes > LIKE_OTHERS * sizes[0])) :])


def _scaled(values: np.ndarray) -> np.ndarray:
    """Values (m,) about their mean, of size 1 at most."""
    centred = values - values.mean()
    return centred / max(float(np.abs(centred).max()), np.finfo(float).tiny)
