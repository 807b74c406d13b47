"""What a file holds, whatever its format: columns of numbers with the names and units that its headings say."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import ReadError

FEW = 4  # alternatives that a message lists; pages and result.json hold all of them


class NoTableError(ReadError):
    """A readable text in which no line holds numbers, such as somebody's notes."""


@dataclass(frozen=True)
class Column:
    """One column: `values` (n,) in the unit of the file, NaN where a cell is missing.

    `name` and `unit` are the parts of the `heading` as it stands in the file ("" for what is not said). A column of
    times of day has the unit s, since midnight, and `clock` says so. `problem` tells of the first cell that is neither
    a number nor marked as missing: a column is fit for use where it is "".
    """

    name: str
    unit: str
    heading: str
    values: np.ndarray
    number: int
    clock: bool = False
    problem: str = ""

    @property
    def shown(self) -> str:
        """What to call the column in a message: its heading as it stands there, without the unit."""
        if not self.name:
            return f"number {self.number}"
        return repr(re.split(r"\s*[\[(/,]", self.heading.strip("\"' "))[0] or self.name)

    @property
    def missing(self) -> int:
        """How many cells hold no number."""
        return int(np.count_nonzero(np.isnan(self.values)))


@dataclass(frozen=True)
class Table:
    """A file as it was read: `columns`, each with n values, the number of each row's line, and what else is said.

    `format` says in words how the file was understood, `notes` are what it says of itself (key: value), `remarks`
    what was left out, in words. `lines` (n,) count from 1; in a file without lines they are the numbers of samples,
    and `row` is "sample". `heading_line` is 0 where there are no headings.
    """

    path: Path
    columns: tuple[Column, ...]
    lines: np.ndarray
    format: str
    notes: dict[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    heading_line: int = 0
    row: str = "line"

    @property
    def headings(self) -> str:
        """All headings, for a message."""
        return some([c.heading or f"(number {c.number})" for c in self.columns])

    @property
    def heading_place(self) -> str:
        """The file and the line of the headings, for a message."""
        return f"{self.path}, line {self.heading_line}" if self.heading_line else f"{self.path}"


def shortened(text: str, longest: int = 40) -> str:
    """A piece of a file as it may stand in a message."""
    return repr(text if len(text) <= longest else f"{text[: longest - 3]}...")


def some(texts: Sequence[str], most: int = 12) -> str:
    """A list for a message, cut where it is long."""
    return ", ".join(texts[:most]) + (f" and {len(texts) - most} more" if len(texts) > most else "")


def moving(names: Sequence[str]) -> str:
    """That signals move."""
    return f"{' and '.join(names)} move{'s' if len(names) == 1 else ''}"


def either(texts: Sequence[str], most: int = FEW) -> str:
    """Alternatives for a message, cut where they are many."""
    more = [f"one of {len(texts) - most} more"] if len(texts) > most else []
    return " or ".join([*texts[:most], *more])
