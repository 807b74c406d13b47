"""How a text lays out its table: what stands between cells, which lines are headings, units and numbers.

A few lines from all over the file are tried with every delimiter; the one wins that makes rows of equal length of
which most cells are numbers or times.
"""

from __future__ import annotations

import csv
import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from . import cells as cell_values
from .clock import DATE, is_clock

SAMPLE = 160  # lines that are looked at
DELIMITERS = ("\t", ";", ",", "|", "")  # "" is any run of spaces and tabs
NAMES = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars", "": "spaces"}
COMMENT = re.compile(  # unless a spreadsheet's mark of a missing value begins the line
    r"\s*(?:#(?!(?:n/?a|nv|num!|value!|div/0!|ref!|null!|name\?)[\s,;|])|[%!]|//|rem\s)", re.IGNORECASE
)
CLEARLY = 0.95  # of the best score, for a delimiter that can be seen to be preferred to spaces


@dataclass(frozen=True)
class Layout:
    """Cells stand between `delimiter`s, `width` of them in a row; `kinds` are number, clock, text or empty."""

    delimiter: str
    width: int
    kinds: tuple[str, ...]

    def row(self, line: str) -> list[str]:
        """The cells of one line, stripped."""
        return split(line, self.delimiter)

    def is_data(self, row: Sequence[str]) -> bool:
        """A number wherever the table has one, as far as cells are filled, and at least one."""
        if not row or any(row[self.width :]):
            return False
        found = 0
        for cell, kind in zip(row, self.kinds, strict=False):
            if kind in ("number", "clock"):
                if not is_value(cell, self.delimiter) and not cell_values.is_missing(cell):
                    return False
                found += is_value(cell, self.delimiter)
        return found > 0 and len(row) > self.width // 2

    def is_mostly_data(self, row: Sequence[str]) -> bool:
        """Numbers in more than half of the columns that have them: a row of the table, with a bad cell."""
        wanted = [i for i, kind in enumerate(self.kinds) if kind in ("number", "clock")]
        found = sum(is_value(row[i], self.delimiter) for i in wanted if i < len(row))
        return found > len(wanted) / 2 or (found == len(wanted) - 1 > 0 and len(row) == self.width)


def split(line: str, delimiter: str) -> list[str]:
    """The cells of one line, stripped; quotes keep a cell together, unless it is longer than any table's."""
    if '"' in line and len(line) < csv.field_size_limit():
        if delimiter:
            return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]
        return [cell.strip('"') for cell in re.findall(r'"[^"]*"|\S+', line)]
    return [cell.strip() for cell in line.split(delimiter)] if delimiter else line.split()


def is_value(cell: str, delimiter: str) -> bool:
    """Whether a cell is a number with either decimal mark, a time or a date."""
    if not cell or not (cell[0].isdigit() or cell[0] in "-+−.,"):
        return False
    if " " in cell and delimiter not in ("\t", ";", "|") and not is_clock(cell) and not cell_values.has_unit(cell):
        return False  # no digits grouped by spaces beside other spaces
    return (
        cell_values.number(cell, ".") is not None
        or cell_values.number(cell, ",") is not None
        or is_clock(cell)
        or DATE.fullmatch(cell) is not None
        or cell_values.has_unit(cell)
    )


def sniffed(lines: Sequence[str]) -> Layout | None:
    """The layout of a table somewhere in these lines; None where no line holds numbers."""
    filled = [line for line in lines if line and not line.isspace()]
    tried = [line for line in _spread(filled) if not COMMENT.match(line)] or filled[:SAMPLE]
    found = []
    tabs = sum("\t" in line for line in tried) > 0.5 * len(tried)
    for delimiter in DELIMITERS[: -1 if tabs else None]:
        rows = [row for row in (split(line, delimiter) for line in tried) if row]
        score, width = _score(rows, delimiter)
        found.append((score, width, delimiter, rows))
    best = max(score for score, *_ in found)
    if best <= 0:
        return None
    found = [f for f in found if f[1] > 1 and f[0] > best / 2] or found
    best = max(score for score, *_ in found)
    clear = [f for f in found if f[0] >= CLEARLY * best and f[1] > 1 and f[2]]
    _, width, delimiter, rows = clear[0] if clear else max(found, key=lambda f: (round(f[0], 6), f[1]))
    tabular = [row for row in rows if len(row) == width and _share(row, delimiter) > 0.5]
    kinds = tuple(_kind([row[i] for row in tabular], delimiter) for i in range(width))
    return Layout(delimiter, width, kinds)


def _spread(lines: Sequence[str]) -> Iterator[str]:
    """Lines from all over, most of them beyond the head."""
    step = max(1, len(lines) // SAMPLE)
    yield from lines[step // 2 :: step]


def _score(rows: Sequence[Sequence[str]], delimiter: str) -> tuple[float, int]:
    """How much of the lines is rows of numbers of one length, and this length."""
    by_length: dict[int, float] = defaultdict(float)
    for row in rows:
        by_length[len(row)] += _share(row, delimiter)
    width, score = max(by_length.items(), key=lambda item: (item[1], item[0]), default=(0, 0.0))
    return score / max(len(rows), 1), width


def _share(row: Sequence[str], delimiter: str) -> float:
    """Which share of the filled cells are numbers, or marks of missing ones beside numbers."""
    filled = [cell for cell in row if cell]
    values = sum(is_value(cell, delimiter) for cell in filled)
    return (values + sum(map(cell_values.is_missing, filled))) / len(filled) if values else 0.0


def _kind(column: Sequence[str], delimiter: str) -> str:
    filled = [cell for cell in column if not cell_values.is_missing(cell)]
    if not filled:
        return "empty" if not any(column) else "number"
    if sum(map(is_clock, filled)) > 0.5 * len(filled):
        return "clock"
    values = sum(is_value(cell, delimiter) and not DATE.fullmatch(cell) for cell in filled)
    return "number" if values > 0.3 * len(filled) else "text"
