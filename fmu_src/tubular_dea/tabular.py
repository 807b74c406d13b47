"""CSV files whose header names quantity and unit, as in `time [s],pressure [mmHg]`; errors name file, line, column."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .errors import UserError
from .files import FileError, read_whole


class TableError(UserError, ValueError):
    """A table that cannot be used; the text names the file and, where there is one, line and column."""


@dataclass(frozen=True)
class Cell:
    """A heading taken apart: `radius [mm]` stands in column `place`."""

    name: str
    unit: str
    place: int


def rows(path: Path) -> list[tuple[int, list[str]]]:
    """The lines of a CSV file that are not empty, each with its number in the file (from 1), cells stripped."""
    try:
        content = read_whole(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise TableError(f"{path}: cannot be read as a text file; save it as CSV in UTF-8") from None
    except FileError as problem:
        raise TableError(str(problem)) from None
    reader = csv.reader(content.splitlines())
    try:
        found = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    except csv.Error as problem:
        raise TableError(f"{path}, line {reader.line_num}: cannot be read as CSV: {problem}") from None
    if found and len(found[0][1]) == 1 and found[0][1][0].count(";") > 0:
        raise TableError(f"{path}, line 1: expected commas between columns and decimal points, but found semicolons")
    return [(line, cells) for line, cells in found if any(cells)]


def text(time: np.ndarray, columns: Mapping[str, np.ndarray], units: Mapping[str, str]) -> str:
    """A table over `time` [s] as CSV: `columns` by name, each with its unit ("1" where `units` has none), 12 digits."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["time [s]", *(f"{name} [{units.get(name, '1')}]" for name in columns)])
    for row in np.column_stack([time, *columns.values()]):
        writer.writerow([f"{value:.12g}" for value in row])
    return out.getvalue()


def headings(path: Path, header: list[str], known: Mapping[str, str]) -> dict[str, Cell]:
    """The columns of `known` names (with an example unit each) in a header; the others are left alone.

    Raises `TableError` for a name without a unit or one that appears twice.
    """
    found: dict[str, Cell] = {}
    for place, heading in enumerate(header):
        name, _, rest = heading.partition("[")
        name, unit = name.strip(), rest.rstrip("] ").strip()
        if name not in known:
            continue
        if not unit:
            raise TableError(f"{path}, line 1: column {name!r} names no unit; write it as '{name} [{known[name]}]'")
        if name in found:
            raise TableError(f"{path}, line 1: column {name!r} appears twice; expected it once")
        found[name] = Cell(name, unit, place)
    return found
