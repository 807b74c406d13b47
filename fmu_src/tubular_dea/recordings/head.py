"""The lines above the numbers: headings, a row of units, and notes such as `Operator: nobody`."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field

from ..model.units import is_unit
from .heading import is_unit_cell, name, parts, unit_of
from .layout import COMMENT, DELIMITERS, Layout, is_value, split

_PREFIX = re.compile(r"\s*(?:#+|%+|//+|!+|\*+|;+(?=\s)|rem\s)\s*", re.IGNORECASE)
_COLUMN = re.compile(r'"[^"]*"|[^\s\[({]+(?:\s*(?:\[[^\]]*\]|\([^)]*\)|\{[^}]*\}))?')
_PAIR = re.compile(r"\s*(?P<key>[^:=\t]{1,60}?)\s*[:=]\s*(?P<value>.*\S)\s*")
_LABEL = re.compile(
    r"(?:[xy]_?)?(?:units?|einheit(?:en)?|unité|dimension)(?:[ _]?(?:label|name))?s?[:=]?", re.IGNORECASE
)
_WORD = re.compile(r"[^\W\d]{3}")  # what begins a label rather than a number with a mistake in it


@dataclass(frozen=True)
class Head:
    """`headings` and `units` by column ("" for none), where they stand (0: nowhere), and what else is said.

    The numbers begin in line `first`; all line numbers count from 1.
    """

    first: int
    headings: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    heading_line: int = 0
    unit_line: int = 0
    notes: dict[str, str] = field(default_factory=dict)

    def column(self, i: int) -> tuple[str, str, str]:
        """Name, unit and heading of a column; a row of units goes before what the heading seems to say."""
        heading = self.headings[i] if i < len(self.headings) else ""
        name_, unit = parts(heading)
        row = self.units[i] if i < len(self.units) else ""
        if row and unit and "[" not in heading and "(" not in heading:
            name_ = name(heading)  # `phase_A` in a file whose units have a row of their own
        return name_, row or unit, heading


def head(lines: Sequence[str], layout: Layout, names: Collection[str]) -> Head:
    """Everything above the numbers; `names` are expected headings, which decide if several lines could be headings."""
    begin = _begin(lines, layout)
    rows = [(i, cells) for i in range(begin) for cells in [_cells(lines[i], layout)] if cells]
    units = [(i, _units(cells)) for i, cells in rows if _is_units(cells)]
    candidates = [(i, c) for i, c in rows if not any(is_value(x, layout.delimiter) for x in c) and not _is_units(c)]
    candidates = [(i, c) for i, c in candidates if len(c) >= layout.width or _is_heading(c, names)]
    if not candidates and units:
        candidates, units = [(i, c) for i, c in rows if i == units[0][0]], units[1:]
    if not candidates:
        candidates = [(i, c) for i, c in rows if len(c) == layout.width and not is_value(c[0], layout.delimiter)]
    if not candidates:
        candidates = _shifted(lines, layout, begin, names)
    chosen = max(candidates, key=lambda r: _aptness(r, layout.width, names), default=(-1, []))
    unit_row = min(units, key=lambda r: abs(r[0] - chosen[0]), default=(-1, []))
    between = ((i, layout.row(lines[i])) for i in range(chosen[0] + 1, begin))
    first = next((i for i, row in between if layout.is_mostly_data(row) and not _WORD.match(row[0])), begin)
    others = [lines[i] for i in range(first) if i not in (chosen[0], unit_row[0])]
    return Head(first + 1, tuple(chosen[1]), tuple(unit_row[1]), chosen[0] + 1, unit_row[0] + 1, _notes(others, layout))


def _shifted(lines: Sequence[str], layout: Layout, begin: int, names: Collection[str]) -> list[tuple[int, list[str]]]:
    """Headings of all columns but the first, which only counts the rows, as R writes them."""
    rows = (layout.row(line) for line in lines[begin:] if line.strip())
    counted = [row[0] for _, row in zip(range(3), rows, strict=False)]
    if len(counted) < 3 or not all(c.isdecimal() for c in counted) or int(counted[2]) != int(counted[0]) + 2:
        return []
    found = [(i, split(lines[i], layout.delimiter)) for i in range(begin)]
    return [(i, ["", *c]) for i, c in found if len(c) == layout.width - 1 and _is_heading(c, names)]


def _begin(lines: Sequence[str], layout: Layout) -> int:
    """The first line of numbers that another follows, or the first at all."""
    data = _data_lines(lines, layout)
    first = next(data, (0, 0))
    while first[1] > 1:  # numbers all alone belong to the head
        first = next(data, (first[0], 1))
    return first[0]


def _data_lines(lines: Sequence[str], layout: Layout) -> Iterator[tuple[int, int]]:
    """Lines of numbers, each with how many filled lines further the next one is, at most 2."""
    before = -1
    since = 0
    for i, line in enumerate(lines):
        if not line or line.isspace():
            continue
        since += 1
        if not COMMENT.match(line) and layout.is_data(layout.row(line)):
            if before >= 0:
                yield before, min(since, 2)
            before, since = i, 0
    if before >= 0:
        yield before, 1


def _cells(line: str, layout: Layout) -> list[str]:
    """The cells of a line that may be headings or units, split as far as possible into as many as there are columns."""
    plain = _PREFIX.sub("", line, count=1) if _PREFIX.match(line) else line
    ways = [split(line, layout.delimiter), split(plain, layout.delimiter)]
    if not layout.delimiter:
        ways += [re.split(r"\s{2,}|\t", plain.strip()), [c.strip('"') for c in _COLUMN.findall(plain)]]
    ways += [split(plain, delimiter) for delimiter in DELIMITERS if delimiter]
    for cells in ways:
        while len(cells) > layout.width and not cells[-1]:
            cells.pop()
    fitting = [cells for cells in ways if len(cells) == layout.width]
    if fitting:
        return fitting[0]
    own = ways[1]
    return own if len(own) > 1 and layout.delimiter else []


def _is_heading(cells: Sequence[str], names: Collection[str]) -> bool:
    """Whether a row of another length than the numbers' has headings: expected names, or units."""
    return any(name_ in names or is_unit(unit) for name_, unit in map(parts, cells))


def _is_units(cells: Sequence[str]) -> bool:
    """Units in every filled cell but for a label in the first, at least two of them where no bracket shows it."""
    rest = cells[1:] if cells and _LABEL.fullmatch(cells[0]) else cells
    filled = [c for c in rest if unit_of(c)]
    return len(filled) >= min(2, len(cells)) and all(map(is_unit_cell, rest))


def _units(cells: Sequence[str]) -> list[str]:
    return ["" if i == 0 and _LABEL.fullmatch(c) else unit_of(c) for i, c in enumerate(cells)]


def _aptness(row: tuple[int, Sequence[str]], width: int, names: Collection[str]) -> tuple[int, bool, int, int]:
    """The rank of a row as headings: expected names, at least as many as columns, filled, close to the numbers.

    A name counts once: LabVIEW writes `X_Dimension Time Time Time` above the headings.
    """
    i, cells = row
    known = len({parts(c)[0] for c in cells} & {*names})
    return known, len(cells) >= width, sum(map(bool, cells)), i


def _notes(lines: Sequence[str], layout: Layout) -> dict[str, str]:
    """What lines like `key: value`, `key = value; key = value` or two cells say."""
    notes: dict[str, str] = {}
    for line in lines:
        plain = _PREFIX.sub("", line, count=1)
        pieces = [m for m in map(_PAIR.fullmatch, plain.split(";")) if m]
        cells = [c for c in layout.row(plain) if c]
        if pieces:
            notes.update({name(m["key"]): m["value"] for m in pieces})
        elif len(cells) > 1 and layout.delimiter:
            notes[name(cells[0])] = ", ".join(cells[1:])
        elif plain.strip():
            notes.setdefault("", plain.strip())
    return notes
