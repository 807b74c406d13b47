"""Tables in text files, of any encoding, delimiter and decimal mark."""

from __future__ import annotations

import csv
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..errors import ReadError
from ..model.units import NUMBER, is_unit
from .cells import SCPI, SOME, Numbers, decimal_mark, is_missing, numbers
from .encoding import decoded, lines_of
from .head import Head, head
from .layout import COMMENT, NAMES, Layout, sniffed, split
from .table import Column, NoTableError, Table, shortened, some

LEAST, PROSE = 2, 0.2  # rows that make a table, and the share of words in every column of a text with some numbers
QUOTED = 20  # lines that a quoted cell may run over
UNITS_OF_TIME = ("horizontal_units", "x_units", "x_unit")  # what oscilloscopes call them above their headings
OFTEN = 0.1  # of the rows: what so many lack at their end is left empty on purpose


@dataclass(frozen=True)
class Body:
    """Rows of `cells` (n times width), their line numbers, and by how many cells a row falls short or goes beyond."""

    cells: list[Sequence[str]]
    lines: np.ndarray
    excess: np.ndarray = field(default_factory=lambda: np.array([], int))


def read_text(path: Path, raw: bytes, names: Collection[str] = ()) -> Table:
    """The table in a text file; `names` are expected headings. `ReadError` names file, line and column."""
    text, encoding = decoded(path, raw)
    text = text.rstrip("\x1a")  # which ends files of DOS
    if not text.strip():
        raise ReadError(f"{path}: expected headings and numbers but the file is empty")
    lines = lines_of(text)
    layout = sniffed(lines)
    if layout is None:
        first = next(i for i, line in enumerate(lines) if line.strip())
        raise NoTableError(
            f"{path}, line {first + 1}: expected rows of numbers below headings like 'time [s]' but no line holds "
            f"numbers; found {shortened(lines[first].strip())}"
        )
    if '"' in text:
        lines = _joined(path, lines, layout.delimiter)
    above = head(lines, layout, names)
    quick = _quickly(lines, above, layout) if '"' not in text else None
    if quick is not None:
        columns, kept, remarks = quick, np.ones(quick[0].values.size, dtype=bool), list[str]()
        body = Body([], np.arange(above.first, above.first + kept.size))
    else:
        body = _body(lines, above, layout)
        columns, kept, remarks = _columns(path, body, above, layout)
    decimals = {n.decimal for n in columns if n.kind == "number"} - {"", "?"}
    made = tuple(_column(i, n, above, body, kept) for i, n in enumerate(columns))
    return Table(
        path,
        made,
        body.lines[kept],
        _format(encoding, layout, decimals, above),
        above.notes,
        tuple(remarks),
        above.heading_line,
    )


def _quickly(lines: Sequence[str], above: Head, layout: Layout) -> list[Numbers] | None:
    """The columns of a plain table, by numpy's reader: numbers or nothing in every cell; None for any other."""
    end = len(lines)
    while end > above.first and not lines[end - 1].strip():
        end -= 1
    body = lines[above.first - 1 : end]
    width, comma = len(above.headings) or layout.width, _with_commas(body, layout)
    if comma is None or len(body) < LEAST or width != layout.width:
        return None
    plain = [line.replace(",", ".") for line in body] if comma else body
    values = _loaded(plain, layout.delimiter)
    if values is None and layout.delimiter:
        values = _loaded(_filled(plain, layout.delimiter), layout.delimiter)
    if values is None or values.shape != (len(body), width) or not np.all(np.isfinite(values).any(axis=1)):
        return None
    if np.nanmax(np.abs(values)) >= SCPI[0]:
        return None
    return [Numbers(np.ascontiguousarray(v), np.array([], int), "number", "," if comma else ".") for v in values.T]


def _loaded(lines: Sequence[str], delimiter: str) -> np.ndarray | None:
    try:
        return np.loadtxt(lines, delimiter=delimiter or None, comments=None, ndmin=2)
    except ValueError:
        return None


def _filled(body: Sequence[str], delimiter: str) -> list[str]:
    """Lines with "nan" in their empty cells."""
    text = "\n".join(["", *body, ""])
    for _ in range(2):  # neighbours share a delimiter
        text = text.replace(2 * delimiter, f"{delimiter}nan{delimiter}")
    text = text.replace(f"\n{delimiter}", f"\nnan{delimiter}").replace(f"{delimiter}\n", f"{delimiter}nan\n")
    return text.split("\n")[1:-1]


def _with_commas(body: Sequence[str], layout: Layout) -> bool | None:
    """Whether all numbers have decimal commas, or none has; None where that is to be told cell by cell."""
    if layout.delimiter == "," or not any("," in line for line in body):
        return False
    if any("." in line for line in body):
        return None
    columns = zip(*(layout.row(line) for line in body[:SOME]), strict=False)
    return True if all(decimal_mark(c, "?") == "," for c in columns if any("," in x for x in c)) else None


def _joined(path: Path, lines: list[str], delimiter: str) -> list[str]:
    """Lines whose quoted cell runs on, joined in the first of them; the others become empty, so that counts stay."""
    if not delimiter:
        return lines
    out = list(lines)
    for i in range(len(out)):
        if out[i].count('"') % 2 == 0:
            continue
        for more in range(min(QUOTED, len(out) - i)):
            whole = " ".join(out[i : i + more + 1])
            try:
                list(csv.reader([whole], delimiter=delimiter, skipinitialspace=True, strict=whole.count('"') % 2 > 0))
            except csv.Error:
                continue
            out[i : i + more + 1] = [whole] + [""] * more
            break
        else:
            raise ReadError(
                f"{path}, line {i + 1}: expected a closing quote within {QUOTED} lines but found "
                f"{shortened(out[i].strip())}; close the quote or remove it"
            )
    return out


def _body(lines: Sequence[str], above: Head, layout: Layout) -> Body:
    """All rows from the first numbers on, without comments and empty lines, each with as many cells as columns."""
    start = above.first
    kept = [
        (n, line)
        for n, line in enumerate(lines[start - 1 :], start)
        if line and not line.isspace() and not COMMENT.match(line)
    ]
    rows: list[Sequence[str]] = [
        split(line, layout.delimiter)
        if '"' in line
        else line.split(layout.delimiter)
        if layout.delimiter
        else line.split()
        for _, line in kept
    ]
    width = len(above.headings) or layout.width
    excess = np.fromiter(map(len, rows), int, len(rows)) - width
    for i in np.flatnonzero(excess):
        row = list(rows[i])
        while len(row) > width and not row[-1].strip():
            row.pop()
        excess[i] = len(row) - width
        rows[i] = (row + [""] * width)[:width]
    return Body(rows, np.array([n for n, _ in kept], int), excess)


def _columns(path: Path, body: Body, above: Head, layout: Layout) -> tuple[list[Numbers], np.ndarray, list[str]]:
    """The numbers of all columns, which rows hold any, and remarks on those that do not."""
    cells = list(zip(*body.cells, strict=True))
    found = [numbers(c) for c in cells]
    if any(n.decimal == "," for n in found):
        found = [n if n.decimal == "," else numbers(c, ",") for c, n in zip(cells, found, strict=True)]
    elif any(n.decimal == "." for n in found):
        found = [n if n.decimal == "." else numbers(c, ".") for c, n in zip(cells, found, strict=True)]
    elif any(map(_ungrouped, found)):  # so 12,345 of others has a decimal comma
        found = [numbers(c, ",") if n.kind == "text" else n for c, n in zip(cells, found, strict=True)]
    filled = np.any([np.isfinite(n.values) for n in found], axis=0)
    if 0 < np.count_nonzero(filled) < LEAST:
        raise NoTableError(f"{path}, line {above.first}: expected at least {LEAST} rows of numbers but found one")
    if not filled.any() or all(filled[n.bad].sum() > PROSE * filled.sum() for n in found):
        raise NoTableError(f"{path}, line {above.first}: expected rows of numbers but found text")
    remarks = _left_out(body, ~filled, above)
    ends = int(np.flatnonzero(filled)[-1])
    if body.excess[ends] < 0 and not _may_be_short(body, filled, ends, layout):
        filled[ends] = False
        remarks.append(f"line {body.lines[ends]}, the last one, is incomplete: left out")
    for i in np.flatnonzero(body.excess * filled):
        if body.excess[i] > 0 or not _may_be_short(body, filled, int(i), layout):
            n, width = body.lines[i], len(found)
            raise ReadError(
                f"{path}, line {n}: {width + body.excess[i]} cells below {width} headings; expected one each between "
                f"{NAMES[layout.delimiter]}{': decimal commas?' if layout.delimiter == ',' else ''}; correct or remove "
                "the line"
            )
    return found, filled, remarks


def _ungrouped(column: Numbers) -> bool:
    """Whether a column has whole numbers of a thousand and more, in which nobody grouped the thousands."""
    whole = column.kind == "number" and column.decimal == ""
    return whole and bool(np.nanmax(np.abs(column.values), initial=0) >= 1000)


def _may_be_short(body: Body, filled: np.ndarray, i: int, layout: Layout) -> bool:
    """Whether what a row lacks at its end are remarks, or columns that many rows leave empty."""
    lacking = body.excess[i]
    kinds = (layout.kinds + ("empty",) * len(body.cells[i]))[: len(body.cells[i])]
    if all(kind in ("text", "empty") for kind in kinds[lacking:]):
        return True
    alike = np.count_nonzero(body.excess[filled] == lacking)
    return bool(layout.delimiter) and alike >= max(2, OFTEN * filled.sum())


def _left_out(body: Body, empty: np.ndarray, above: Head) -> list[str]:
    """In words, the rows without numbers that are more than delimiters and marks of missing values."""
    repeated, texts = [], []
    for i in np.flatnonzero(empty):
        row = [cell.strip() for cell in body.cells[i]]
        if above.headings and row[: len(above.headings)] == list(above.headings):
            repeated.append(f"line {body.lines[i]}")
        elif not all(map(is_missing, row)):
            texts.append(f"line {body.lines[i]} {shortened(' '.join(filter(None, row)))}")
    said = [f"headings repeated: {some(repeated, 5)}"] if repeated else []
    return said + ([f"without numbers, left out: {some(texts, 5)}"] if texts else [])


def _column(i: int, found: Numbers, above: Head, body: Body, kept: np.ndarray) -> Column:
    """A column as others see it, with what is wrong with it in words."""
    name, unit, heading = above.column(i)
    if name == "time" and not unit:
        unit = next((above.notes[n] for n in UNITS_OF_TIME if is_unit(above.notes.get(n, ""))), "")
    if found.kind == "clock" or (name == "x_value" and not unit):  # LabVIEW's, in seconds
        unit = "s"
    unit = unit or found.unit
    column = Column(name, unit, heading, found.values[kept], i + 1, found.kind == "clock")
    bad = found.bad[kept[found.bad]]
    if not bad.size:
        return column
    line, cell = body.lines[bad[0]], body.cells[bad[0]][i].strip()
    wanted = "a number"
    if cell.lstrip("+-").lower().startswith(("inf", "1.#inf", "∞")):
        wanted = "a finite number"
    elif re.fullmatch(NUMBER, cell):
        wanted = f"a finite number of a usual size (instruments mean an overload by {min(SCPI):g})"
    elif found.decimal == "?":
        wanted = "a number that tells decimal from thousands marks"
    elif found.kind == "clock":
        wanted = "a time like 13:07:30.234"
    return replace(column, problem=f"line {line}, column {column.shown}: expected {wanted} but found {shortened(cell)}")


def _format(encoding: str, layout: Layout, decimals: set[str], above: Head) -> str:
    """How the file was understood, in words."""
    words = [f"text ({encoding})", NAMES[layout.delimiter]]
    words += ["decimal commas"] if "," in decimals else []
    words += ["no headings"] if not above.heading_line else []
    words += [f"units in line {above.unit_line}"] if above.unit_line else []
    return ", ".join(words)
