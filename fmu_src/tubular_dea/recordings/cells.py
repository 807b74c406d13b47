"""From the cells of a column to numbers: decimal marks, thousands, and all that stands for a missing value."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..model.units import is_unit
from .clock import is_clock, seconds

MISSING = frozenset(
    (
        "",
        "nan",
        "-nan",
        "+nan",
        "nan(ind)",
        "-nan(ind)",
        "nan(snan)",
        "not a number",
        "na",
        "n/a",
        "n.a.",
        "n.a",
        "#n/a",
        "#na",
        "<na>",
        "null",
        "none",
        "nil",
        "missing",
        "nodata",
        "no-data",
        "no data",
        "not available",
        "void",
        "-",
        "--",
        "---",
        "----",
        "\u2013",
        "\u2014",
        ".",
        "..",
        "...",
        "?",
        "??",
        "*",
        "**",
        "***",
        "ol",
        "o.l",
        "o.l.",
        "-ol",
        "+ol",
        "over",
        "overload",
        "ovl",
        "ovld",
        "ovf",
        "ovrflw",
        "overflow",
        "ovrng",
        "overrange",
        "underrange",
        "over-range",
        "under-range",
        "out-of-range",
        "out of range",
        "sat",
        "saturated",
        "err",
        "err!",
        "error",
        "#err",
        "#error",
        "#value!",
        "#value",
        "#div/0!",
        "#div/0",
        "#ref!",
        "#num!",
        "#name?",
        "#null!",
        "#wert!",
        "#zahl!",
        "#nv",
        "invalid",
        "bad",
        "fail",
        "failed",
        "timeout",
        "lost",
        "dropout",
        "no signal",
        "1.#qnan",
        "-1.#qnan",
        "1.#ind",
        "-1.#ind",
        "1.#snan",
        "1.#nan",
        "#qnan",
    )
)
TRUTH = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0, "yes": 1.0, "no": 0.0, "high": 1.0, "low": 0.0}
SCPI = (9.9e37, 9.91e37)  # what instruments answer for an overload and for "not a number" (SCPI 1999, 7.2.1)

SOME = 200  # cells of a column that tell what it is
_WITH_UNIT = re.compile(r"[-+]?[\d.,]*\d[.,]?(?:[eE][-+]?\d+)?\s*([^\d\s.,;:+-][^,;:]*)")
_PLAIN = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?")
_SPACES = "\u00a0\u202f\u2009"  # no-break and thin ones, which group digits
_LOOSE = str.maketrans({"−": "-", "’": "'", "D": "e", "d": "e", **dict.fromkeys(_SPACES, " ")})
_GROUPED = {mark: re.compile(rf"[-+]?[1-9]\d{{0,2}}(?:[{mark}]\d{{3}})+") for mark in ",."}
_GROUPS = {
    decimal: re.compile(
        rf"[-+]?\d{{1,3}}(?P<mark>[{others}])\d{{3}}(?:(?P=mark)\d{{3}})*(?:{point}\d*)?(?:[eE][-+]?\d+)?"
    )
    for decimal, others, point in ((".", "', ", r"\."), (",", "'. ", ","))
}


@dataclass(frozen=True)
class Numbers:
    """A column's `values` (n,), NaN where missing, and where its `bad` cells are: those that are no numbers.

    `kind` is number, clock or text (nearly every cell is none); `decimal` the mark it is written with, "" where none
    is, and "?" where "1,234" may be either of two numbers; `unit` what every cell says behind its number, as meters do.
    """

    values: np.ndarray
    bad: np.ndarray
    kind: str
    decimal: str
    unit: str = ""


def numbers(cells: Sequence[str], hint: str = "") -> Numbers:
    """The numbers of a column; `hint` is the decimal mark of other columns, for where this one's cells do not tell."""
    quick = _quickly(cells)
    if quick is not None and (hint != "," or decimal_mark(cells, hint) == "."):
        return Numbers(quick, np.array([], int), "number", "." if any("." in c for c in cells[:100]) else "")
    if any(":" in c for c in cells) and sum(map(is_clock, cells[:SOME])) > 0.5 * sum(map(bool, cells[:SOME])):
        gone = [is_missing(c) for c in cells]
        values = seconds(cells, gone)
        return Numbers(values, np.flatnonzero(np.isnan(values) & ~np.array(gone)), "clock", "")
    unit = _said(cells)
    if unit:
        bare = [c.strip().removesuffix(unit) for c in cells]
        return replace(numbers(bare, hint), unit=unit)
    decimal = decimal_mark(cells, hint)
    if decimal == ",":
        quick = _quickly([c.replace(",", ".") if "." not in c else "x" for c in cells])
        if quick is not None:
            return Numbers(quick, np.array([], int), "number", decimal)
    return _slowly(cells, decimal)


def _said(cells: Sequence[str]) -> str:
    """The unit that stands behind the number in most cells, as in "4.012 kV"; "" for none."""
    some = [c.strip() for c in cells[:SOME] if not is_missing(c)]
    behind = [match[1] for match in map(_WITH_UNIT.fullmatch, some) if match]
    unit = max(set(behind), key=behind.count, default="")
    return unit if behind.count(unit) > len(some) / 2 and is_unit(unit) else ""


def has_unit(cell: str) -> bool:
    """Whether a cell is a number with a unit behind it."""
    match = _WITH_UNIT.fullmatch(cell)
    return match is not None and is_unit(match[1])


def _quickly(cells: Sequence[str]) -> np.ndarray | None:
    """As Python reads numbers, which is fast; None where a cell is none. It reads 1_000 and inf, which are none."""
    try:
        values = np.fromiter(map(float, cells), float, len(cells))
    except ValueError:
        return None
    if any("_" in c for c in cells) or np.any(np.abs(values) >= SCPI[0]):
        return None
    return values


def _slowly(cells: Sequence[str], decimal: str) -> Numbers:
    values, bad = np.full(len(cells), np.nan), []
    for i, cell in enumerate(cells):
        if not cell:
            continue
        value = number(cell, decimal)
        if value is not None:
            values[i] = value
        elif not is_missing(cell):
            bad.append(i)
    if bad and len(bad) > 0.9 * (len(bad) + np.count_nonzero(np.isfinite(values))):
        truth = _truth(cells)
        if truth is not None:
            return Numbers(truth, np.array([], int), "number", "")
        return Numbers(values, np.array(bad), "text", "")
    return Numbers(values, np.array(bad, int), "number", decimal)


def number(cell: str, decimal: str = ".") -> float | None:
    """The number that a cell holds, written with this decimal mark; None for anything else, such as inf."""
    mark = "," if decimal == "," else "."
    if mark == "." and _PLAIN.fullmatch(cell) and "d" not in cell and "D" not in cell:
        return _finite(float(cell))
    plain = cell.translate(_LOOSE).strip()
    grouped = _GROUPS[mark].fullmatch(plain) if decimal != "?" else None
    if grouped:
        plain = plain.replace(grouped["mark"], "")
    elif mark == "," and "." in plain:
        return None
    plain = plain.replace(",", ".") if mark == "," else plain
    if not _PLAIN.fullmatch(plain):
        return None
    return _finite(float(plain))


def _finite(value: float) -> float | None:
    return value if abs(value) < SCPI[0] else None


def is_missing(cell: str) -> bool:
    """Whether a cell stands for a value that is not there."""
    plain = cell.strip().strip("\"'").lower()
    return plain in MISSING or (_PLAIN.fullmatch(plain) is not None and abs(float(plain.replace("d", "e"))) in SCPI)


def _truth(cells: Sequence[str]) -> np.ndarray | None:
    """A column of on and off, true and false, as 1 and 0."""
    words = [c.strip().lower() for c in cells]
    if not all(w in TRUTH or w in MISSING for w in words):
        return None
    return np.array([TRUTH.get(w, np.nan) for w in words])


def decimal_mark(cells: Iterable[str], hint: str = "") -> str:
    """Which mark ends the whole part of a column's numbers: "." or ","; "?" where thousands look the same.

    A cell with both marks has the decimal one last. "12,345" alone may be either: what then tells is a number that no
    thousands are grouped in, such as 0,012 or 3,14, a number from 1000 on without groups, or `hint`, the mark of other
    columns. With points alone the same holds, where others have decimal commas.
    """
    commas, points, small, large = [], [], False, False
    for cell in cells:
        comma, point = cell.rfind(","), cell.rfind(".")
        if comma >= 0 and point >= 0:
            return "," if comma > point else "."
        if comma >= 0:
            commas.append(cell)
        elif point >= 0:
            points.append(cell)
        elif cell.lstrip("-+").isdigit():
            large, small = large or len(cell.lstrip("-+")) > 3, True
    if commas and points:  # some of them stand in marks of missing values, such as 9.9E37 or 1.#QNAN
        commas, points = ([c for c in there if not is_missing(c)] for there in (commas, points))
    if not commas and (hint != "," or not points):
        return "."
    mark, other, there = (",", ".", commas) if commas else (".", ",", points)
    if commas and points:
        groups = all(map(_GROUPED[","].fullmatch, commas)), all(map(_GROUPED["."].fullmatch, points))
        return {(True, False): ".", (False, True): ",", (True, True): "?"}.get(groups, ".")
    if large or hint == mark or not all(map(_GROUPED[mark].fullmatch, there)):
        several = hint == mark and any(c.count(mark) > 1 for c in there)
        return other if several else mark
    thousands = small or (hint == other and mark == ",") or any(c.count(mark) > 1 for c in there)
    return other if thousands else "?"
