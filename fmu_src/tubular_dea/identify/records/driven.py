"""The inputs in a file, of any kind in which recordings are read, as they drive a model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...model.declare import Model
from ...plants.plant import Input, Output, Plant
from ...protocol import Protocol
from ...recordings import ReadError, Table
from ...recordings.files import read
from .columns import assigned, choices, signals


def read_inputs(path: Path, model: Model, columns: Sequence[str] = ()) -> Protocol:
    """The protocol in a file of all inputs of a model over time, straight in between; a time listed twice is a jump.

    `columns` says which column an input is, as `voltage=AI3[kV]`. `ReadError` for what is missing or unclear, with the
    file and the line.
    """
    driven = Plant(model, [Input(q.name) for q in model.inputs], [Output(model.outputs[0], required=False)])
    table = read(path, signals(driven))
    found = assigned(table, driven, choices(columns, driven))
    if table.lines.size < 2:
        raise ReadError(f"{path}: expected at least two {table.row}s of numbers but found {table.lines.size}")
    values = {name: found[name].values for name in ("time", *(q.name for q in model.inputs))}
    for name, column in values.items():
        _check_there(table, name, column)
    time = values.pop("time")
    _check_ascends(table, time)
    return Protocol.of(time - (time[0] if found["time"].column.clock else 0.0), **values)


def _check_there(table: Table, name: str, values: np.ndarray) -> None:
    """`ReadError` for the first cell (n,) that holds no number."""
    gone = np.flatnonzero(~np.isfinite(values))
    if gone.size:
        line = table.lines[gone[0]]
        raise ReadError(f"{table.path}, {table.row} {line}, column {name!r}: expected a finite number but found none")


def _check_ascends(table: Table, time: np.ndarray) -> None:
    """`ReadError` for the first time (n,) [s] that is earlier than the one before."""
    back = np.flatnonzero(np.diff(time) < 0)
    if back.size:
        at, line = int(back[0]), table.lines[back[0] + 1]
        raise ReadError(
            f"{table.path}, {table.row} {line}: time goes back from {time[at]:g} to {time[at + 1]:g} s; sort the lines"
        )
