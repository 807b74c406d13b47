"""Which points of the axes are computed: grids and samples, each row by its number, in any order and any piece."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .axes import Axis, Columns, grid_points
from .expression import PlanError
from .saltelli import saltelli

KINDS = ("grid", "random", "latin_hypercube", "sobol", "sobol_indices", "one_at_a_time")
WHOLE = ("latin_hypercube", "sobol_indices")  # drawn as a whole, and so held in memory
BLOCK = 4096  # rows of a random design that share a seed


@dataclass(frozen=True)
class Design:
    """`points` samples of `axes` by the method `kind`; a grid has as many rows as its axes make.

    `sobol_indices` is Saltelli's design of points * (dimensions + 2) rows, from which first and total indices are
    estimated; `one_at_a_time` is the middle and, for each axis, its low and its high end.
    """

    kind: str
    axes: tuple[Axis, ...]
    points: int = 0
    seed: int = 1

    @property
    def dimensions(self) -> int:
        """Uniform numbers a row takes."""
        return sum(axis.dimensions for axis in self.axes)

    @property
    def shape(self) -> tuple[int, ...]:
        """Points of each axis of a grid."""
        return tuple(axis.count or 1 for axis in self.axes)

    @property
    def rows(self) -> int:
        """How many rows the design has."""
        if self.kind == "grid":
            return math.prod(self.shape)
        if self.kind == "one_at_a_time":
            return 1 + 2 * self.dimensions
        return self.points * (self.dimensions + 2) if self.kind == "sobol_indices" else self.points

    @property
    def memory(self) -> float:
        """Bytes that have to be held at once to draw the design."""
        return 3.0 * 8 * self.rows * self.dimensions if self.kind in WHOLE else 0.0

    def columns(self, start: int, stop: int) -> Columns:
        """The values of rows `start` to `stop` by column."""
        if self.kind == "grid":
            indices = np.unravel_index(np.arange(start, stop), self.shape) if self.axes else ()
            pairs = zip(self.axes, indices, strict=True)
            return {name: values for axis, i in pairs for name, values in grid_points(axis, i).items()}
        columns: Columns = {}
        unit, place = self._unit(start, stop), 0
        for axis in self.axes:
            columns |= axis.quantile(unit[:, place : place + axis.dimensions])
            place += axis.dimensions
        return columns

    def _unit(self, start: int, stop: int) -> np.ndarray:
        """Uniform numbers of rows `start` to `stop`, shape (rows, dimensions)."""
        if self.kind in (*WHOLE, "one_at_a_time"):
            return self._drawn[start:stop]
        if self.kind == "sobol":
            return self._sobol(start, stop)
        first = start // BLOCK
        blocks = [
            np.random.default_rng([self.seed, b]).random((BLOCK, self.dimensions))
            for b in range(first, -(-stop // BLOCK))
        ]
        return np.concatenate(blocks)[start - first * BLOCK : stop - first * BLOCK]

    def _sobol(self, start: int, stop: int) -> np.ndarray:
        from scipy.stats.qmc import Sobol  # half a second, which a grid need not wait for

        engine = Sobol(self.dimensions, scramble=True, seed=self.seed)
        first = engine.random(1)  # the engine counts from here, and warns of nothing that depends on pieces
        if start > 0:
            engine.fast_forward(start - 1)
            return engine.random(stop - start)
        return np.concatenate([first, engine.random(stop - 1)]) if stop > 1 else first

    @cached_property
    def _drawn(self) -> np.ndarray:
        if self.kind == "latin_hypercube":
            from scipy.stats.qmc import LatinHypercube

            return LatinHypercube(self.dimensions, seed=self.seed).random(self.points)
        if self.kind == "sobol_indices":
            return saltelli(self.dimensions, self.points, self.seed)
        middle = np.full((self.rows, self.dimensions), 0.5)
        tails = [axis.tails for axis in self.axes for _ in range(axis.dimensions)]
        for i, (low, high) in enumerate(tails):
            middle[1 + 2 * i, i], middle[2 + 2 * i, i] = low, high
        return middle


def design(kind: str, axes: Sequence[Axis], points: int, seed: int) -> Design:
    """A checked design; `PlanError` for one that the axes or the number of points do not allow."""
    made = Design(kind, tuple(axes), points, seed)
    if kind == "grid":
        open_ended = [axis.name for axis in axes if axis.count is None]
        if open_ended:
            raise PlanError(
                f"[vary] {open_ended[0]}: a grid needs its points; give count, step or a list, or sample it"
            )
    elif not axes:
        raise PlanError(f"[design] {kind}: there is nothing in [vary] to sample")
    elif kind != "one_at_a_time" and points < 1:
        raise PlanError(f"[design] {kind}: expected points = a positive whole number but was given {points}")
    if kind in ("sobol", "sobol_indices") and points & (points - 1):
        lower = 1 << (points.bit_length() - 1)
        raise PlanError(
            f"[design] {kind}: expected a power of two as points, {lower} or {2 * lower}, but was given {points}"
        )
    return made
