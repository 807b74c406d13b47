"""Which unused columns the residual follows: a room's temperature, a second sensor, a pump's speed.

What a column acts on may follow it slowly: the wall of a tube was 5 s behind the air around it. So a column is compared
as it is and behind lags of first order.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...identify.records.columns import signals
from ...identify.signals.colour import filtered
from ...recordings import Table, read
from ..engine import Discovery
from .left_over import Left

# Set by judgement. Check: `pytest tests/test_follows.py`
MEANS_OF_ALL = 200  # [1] means of all samples together that are compared,
LEAST_MEAN = 20  # [samples] of as many each at least: noise hardly moves them,
LEAST_MEANS = 30  # [1] and so many of them at least
FOLLOWS_IT = 0.5  # [1] of the variance of these means that a column explains, where it is told
FOLLOWING_LAGS = (0.0, 1.0, 2.0, 4.0, 8.0)  # [means] how slowly a residual may follow it: the best of them is told

Course = tuple[np.ndarray, np.ndarray, np.ndarray]  # residual, column and output, each (n,), of a file


@dataclass(frozen=True)
class Followed:
    """The part of the variance of a residual's means that a column explains behind a lag [s]."""

    part: float
    lag: float


def columns_followed(found: Discovery, rest: Sequence[Left]) -> dict[str, Followed]:
    """The unused columns, by heading, that explain a good part of the `rest` that the named model leaves."""
    experiments = {e.name: e for e in found.recordings.experiments}
    tables: dict[str, Table] = {}
    courses: dict[str, list[Course]] = {}
    steps: list[float] = []
    for piece, answer, left in rest:
        experiment = experiments[piece.source]
        source = experiment.source
        if source is None or not source.unused or not source.path.is_file():  # a table in memory is no file
            continue
        if str(source.path) not in tables:
            tables[str(source.path)] = read(source.path, signals(found.study.plant), pipe=False)
        columns = _columns(tables[str(source.path)], source.unused, experiment.lines)
        reading, part = piece.case.readings[0], piece.case.parts[0]
        steps.append(float(np.median(np.diff(reading.times))))
        for heading, values in columns.items():
            there = np.interp(reading.times, experiment.time, values)
            courses.setdefault(heading, []).append((left[part], there, answer[part]))
    found_at = {heading: best_lag(each, float(np.median(steps))) for heading, each in courses.items()}
    return {heading: one for heading, one in found_at.items() if one.part >= FOLLOWS_IT}


def _columns(table: Table, headings: Sequence[str], lines: np.ndarray) -> Mapping[str, np.ndarray]:
    """Those of the columns that hold a number in every one of the `lines` (n,), and move other than a counter."""
    rows = np.searchsorted(table.lines, lines)
    found = {c.heading: c.values[rows] for c in table.columns if c.heading in headings and not c.problem}
    return {
        heading: values
        for heading, values in found.items()
        if np.isfinite(values).all() and np.any(steps := np.diff(values)) and np.any(steps <= 0) and np.any(steps >= 0)
    }


def best_lag(courses: Sequence[Course], step: float) -> Followed:
    """What a column explains behind the lag at which that is most, of samples every `step` [s]."""
    size = _size(courses)
    tried = [
        Followed(
            share([(left, _behind(column, lag * size), output) for left, column, output in courses]), lag * size * step
        )
        for lag in FOLLOWING_LAGS
    ]
    return max(tried, key=lambda one: one.part)


def _behind(column: np.ndarray, lag: float) -> np.ndarray:
    """The column (n,) behind a lag of first order of so many samples, which had settled at its first value."""
    gain = 1 / (1 + lag)
    return filtered([gain], [1, gain - 1], column, (1 - gain) * column[:1])


def _size(courses: Sequence[Course]) -> int:
    """Of how many samples the means are taken."""
    return max(LEAST_MEAN, sum(left.size for left, *_ in courses) // MEANS_OF_ALL)


def share(courses: Sequence[Course]) -> float:
    """The part of the variance of a residual's means that a column explains, alone and in proportion to the output, in
    all files alike; 0 where there are few means."""
    size, rows = _size(courses), []
    for left, column, output in courses:
        count = left.size // size
        if count:
            own = column - column.mean()
            table = np.column_stack([left, own, own * (output - output.mean())])[: count * size]
            means = table.reshape(count, size, -1).mean(axis=1)
            rows.append(means - means.mean(axis=0))
    if sum(len(r) for r in rows) < LEAST_MEANS:
        return 0.0
    means = np.concatenate(rows)
    means /= np.maximum(np.abs(means).max(axis=0), 1e-300)
    left, known = means[:, 0], means[:, 1:]
    rest = left - known @ np.linalg.lstsq(known, left, rcond=None)[0]
    return float(1 - rest @ rest / max(left @ left, 1e-300))
