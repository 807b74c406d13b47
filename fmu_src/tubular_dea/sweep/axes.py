"""What varies in a sweep, one axis each: a range, a list, a normal distribution, patients, a calibrated model.

An axis has `columns` (name and SI unit each), may have a `count` of points (then it can be part of a grid), and turns
`dimensions` uniform numbers into values (then it can be sampled).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Range:
    """From `low` to `high`, evenly or evenly in the logarithm; `count` points in a grid."""

    name: str
    unit: str
    low: float
    high: float
    count: int | None = None
    log: bool = False
    dimensions = 1
    tails = (0.0, 1.0)  # what a tornado calls low and high, as fractions

    @property
    def columns(self) -> tuple[tuple[str, str], ...]:
        """Name and unit."""
        return ((self.name, self.unit),)

    def at(self, index: np.ndarray) -> Columns:
        """Grid points by their number from 0."""
        return self.quantile(np.asarray(index)[:, None] / max(1, (self.count or 1) - 1))

    def quantile(self, unit: np.ndarray) -> Columns:
        """Values for uniform numbers of shape (rows, 1)."""
        part = unit[:, 0]
        if self.log:
            return {self.name: np.exp(np.log(self.low) * (1 - part) + np.log(self.high) * part)}
        return {self.name: self.low * (1 - part) + self.high * part}


@dataclass(frozen=True)
class Levels:
    """A list of points, each a value for every column; `labels` are names for people (patients), if there are any."""

    name: str
    columns: tuple[tuple[str, str], ...]
    table: tuple[tuple[float, ...], ...]
    labels: tuple[str, ...] = ()
    dimensions = 1
    tails = (0.0, 1.0)

    @property
    def count(self) -> int:
        """The number of points."""
        return len(self.table)

    def at(self, index: np.ndarray) -> Columns:
        """Points by their number from 0."""
        rows = np.array(self.table, float)[index]
        named: Columns = {self.name: np.array(self.labels, dtype=object)[index]} if self.labels else {}
        return named | {name: rows[:, i] for i, (name, _) in enumerate(self.columns)}

    def quantile(self, unit: np.ndarray) -> Columns:
        """Every point is as likely as any other."""
        return self.at(np.minimum((unit[:, 0] * self.count).astype(int), self.count - 1))


@dataclass(frozen=True)
class Normal:
    """Normally distributed."""

    name: str
    unit: str
    mean: float
    deviation: float
    count = None
    dimensions = 1
    tails = (0.05, 0.95)

    @property
    def columns(self) -> tuple[tuple[str, str], ...]:
        """Name and unit."""
        return ((self.name, self.unit),)

    def quantile(self, unit: np.ndarray) -> Columns:
        """Values for uniform numbers of shape (rows, 1)."""
        return {self.name: self.mean + self.deviation * _normal(unit[:, 0])}


@dataclass(frozen=True)
class Joint:
    """Jointly normal: `mean` and a Cholesky `factor` of the covariance, by rows; from a calibrated model."""

    name: str
    columns: tuple[tuple[str, str], ...]
    mean: tuple[float, ...]
    factor: tuple[tuple[float, ...], ...]
    count = None
    tails = (0.05, 0.95)

    @property
    def dimensions(self) -> int:
        """One uniform number for each column."""
        return len(self.mean)

    def quantile(self, unit: np.ndarray) -> Columns:
        """Values for uniform numbers of shape (rows, dimensions)."""
        values = np.array(self.mean)[:, None] + np.zeros((1, unit.shape[0]))
        for i, row in enumerate(self.factor):  # not a matrix product: its rounding depends on the number of rows
            for j in range(i + 1):
                values[i] += row[j] * _normal(unit[:, j])
        return {name: values[i] for i, (name, _) in enumerate(self.columns)}


Axis = Range | Levels | Normal | Joint


def grid_points(axis: Axis, index: np.ndarray | None = None) -> Columns:
    """Points of an axis of a grid by their number from 0; all of them where no numbers are given."""
    assert isinstance(axis, Range | Levels)
    return axis.at(np.arange(axis.count or 1) if index is None else index)


def _normal(unit: np.ndarray) -> np.ndarray:
    """Standard normal numbers from uniform ones; never infinite."""
    return ndtri(np.clip(unit, 2.0**-54, 1 - 2.0**-53))


def units(axes: Sequence[Axis]) -> dict[str, str]:
    """SI unit by column; "" for labels."""
    named = {axis.name: "" for axis in axes if isinstance(axis, Levels) and axis.labels}
    return named | {name: unit for axis in axes for name, unit in axis.columns}
