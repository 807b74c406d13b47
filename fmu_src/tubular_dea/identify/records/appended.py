"""Runs that a recorder appended to one file: where its time starts anew, a recording of its own begins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ...plants.plant import Plant
from ...recordings import Table
from .columns import Choice, assigned


def runs(name: str, table: Table, plant: Plant, chosen: Mapping[str, Choice], rate: float | None) -> dict[str, Table]:
    """The table by its `name`, or its runs by names of their own: each begins with the time of the first, to a sample.

    Times that go back to another one are in disorder, and what is too short to be used is no run: then the table stays
    whole. The arguments are those of `read_experiment`.
    """
    time = assigned(table, plant, chosen, rate)["time"]
    steps = np.diff(time.values)
    begins = np.flatnonzero(steps < 0) + 1
    if time.column.clock or not begins.size or not np.all(np.isfinite(time.values)):
        return {name: table}
    parts = [slice(a, b) for a, b in pairwise([0, *begins, time.values.size])]
    anew = np.abs(time.values[begins] - time.values[0]) <= np.median(np.abs(steps))
    if not np.all(anew) or min(p.stop - p.start for p in parts) < plant.least_samples:
        return {name: table}
    names = [name, *(f"{name}_run{number + 1}" for number in range(1, len(parts)))]
    said = [
        f"its time starts anew in {table.row} {table.lines[p.start]}: what follows is a recording of its own, {own}"
        for p, own in zip(parts[1:], names[1:], strict=True)
    ]
    first, *others = (_rows(table, part) for part in parts)
    tables = [replace(first, remarks=(*table.remarks, *said)), *(replace(t, remarks=()) for t in others)]
    return dict(zip(names, tables, strict=True))


def _rows(table: Table, part: slice) -> Table:
    """Some rows of a table."""
    columns = tuple(replace(c, values=c.values[part]) for c in table.columns)
    return replace(table, columns=columns, lines=table.lines[part])
