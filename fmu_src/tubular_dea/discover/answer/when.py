"""When the model misses the records most: a supply that tripped, a hand on the bench, a tube that stuck."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...identify.signals.noise import Noise
from ...stretches import true_stretches
from .left_over import Left

# Set by judgement. Check: `pytest tests/test_when.py`
PARTS_OF_ALL = 200  # [1] parts of all samples together, in each of which a residual is looked at,
LEAST_PART = 20  # [samples] of as many at least
BY_CHANCE = 5.0  # [standard deviations] of the squares of white noise in such a part that are no residual beyond it
MOST_OF_IT = 0.6  # [1] of the squares beyond noise that are in a few stretches, where it is told
SHORTLY = 0.1  # [1] of all samples that are in these, at most
FEW_STRETCHES = 4  # [1] of these, at most


@dataclass(frozen=True)
class Stretch:
    """A stretch of the file `name`, from `begin` to `end` [s] on its clock."""

    name: str
    begin: float
    end: float


def brief_misses(rest: Sequence[Left], noise: Mapping[str, Noise]) -> list[Stretch]:
    """The few short stretches in which is most of the `rest` beyond noise, that of each output; none where it is left
    everywhere."""
    times, squares = [], []
    for piece, _, left in rest:
        for reading, part in zip(piece.case.readings, piece.case.parts, strict=True):
            times.append((piece.name, reading.times))
            squares.append((reading.evened(left[part]) / noise[reading.output].rms) ** 2)
    marked = _marked(squares)
    told: list[Stretch] = []
    for (name, at), there in zip(times, marked, strict=True):
        for a, b in true_stretches(there):
            begin, end = float(at[a]), float(at[b - 1])
            if not any(t.name == name and t.begin <= end and begin <= t.end for t in told):  # as another output tells
                told.append(Stretch(name, begin, end))
    return told if len(told) <= FEW_STRETCHES else []


def _marked(squares: list[np.ndarray]) -> list[np.ndarray]:
    """Which samples, each (n,) of bool, are in the few parts that have most of the squares beyond those of noise;
    none where these are not short."""
    size = max(LEAST_PART, sum(s.size for s in squares) // PARTS_OF_ALL)
    blocks = [(i, a, min(a + size, s.size)) for i, s in enumerate(squares) for a in range(0, s.size, size)]
    lengths = np.array([b - a for _, a, b in blocks])
    sums = np.array([float(np.sum(squares[i][a:b])) for i, a, b in blocks])
    beyond = np.maximum(sums - lengths - BY_CHANCE * np.sqrt(2.0 * lengths), 0.0)
    order = np.argsort(-beyond)
    enough = int(np.searchsorted(np.cumsum(beyond[order]), MOST_OF_IT * float(beyond.sum()))) + 1
    marked = [np.zeros(s.size, dtype=bool) for s in squares]
    for k in order[: enough if beyond.any() else 0]:
        i, a, b = blocks[k]
        marked[i][a:b] = True
    brief = sum(int(m.sum()) for m in marked) <= SHORTLY * sum(m.size for m in marked)
    return marked if brief else [np.zeros_like(m) for m in marked]
