"""Files that cannot be used: one cell, line or heading spoilt, and the words that a refusal must have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from laboratory import DELIMITERS, File, Habits, Luck, written


@dataclass(frozen=True)
class Injury:
    """A file that cannot be used, and the words that a refusal must have beside the file's name."""

    raw: bytes
    kind: str
    words: tuple[str, ...]


def injured(seed: int) -> Injury:
    """A plain file of a laboratory, spoilt in one place."""
    luck = Luck(seed)
    plain = Habits(
        luck.pick(["comma", "semicolon", "tab", "spaces"]),
        luck.pick(["utf-8", "utf-16", "latin-1"]),
        luck.pick(["brackets", "tight", "slash", "row"]),
        luck.pick(["", "comments", "pairs", "long"]),
        False,
        "s",
        ("time", "pressure", "voltage", "radius"),
        luck.pick(["lower", "upper", "title"]),
        False,
        False,
        False,
        False,
        False,
        ("", ""),
        luck.pick(["", "\n"]),
    )
    file = written(plain, luck)
    kind = [*INJURIES][seed % len(INJURIES)]
    words = INJURIES[kind](file, luck)
    return Injury(file.raw, kind, tuple(words))


def _cells(file: File, line: int) -> list[str]:
    d = DELIMITERS[file.habits.delimiter]
    return file.lines[line].split(d)


def _put(file: File, line: int, cells: Sequence[str]) -> None:
    file.lines[line] = DELIMITERS[file.habits.delimiter].join(cells)


def _somewhere(file: File, luck: Luck) -> int:
    """A line of numbers, neither among the first nor the last."""
    return int(luck.random.integers(file.first + 3, len(file.lines) - 3))


def _bad_cell(text: str, wanted: str = "expected a number") -> Any:
    def injure(file: File, luck: Luck) -> list[str]:
        line, column = _somewhere(file, luck), int(luck.random.integers(0, 4))
        cells = _cells(file, line)
        cells[column] = text
        _put(file, line, cells)
        return [f"line {line + 1}, column '{file.habits.names[column]}'", wanted, f"found '{text}'"]

    return injure


def _cell_lost(file: File, luck: Luck) -> list[str]:
    line = _somewhere(file, luck)
    _put(file, line, _cells(file, line)[:-1])
    return [f"line {line + 1}: 3 cells below 4 headings", "expected one each"]


def _cell_more(file: File, luck: Luck) -> list[str]:
    line = _somewhere(file, luck)
    _put(file, line, [*_cells(file, line), "7.25"])
    return [f"line {line + 1}: 5 cells below 4 headings", "expected one each"]


def _time_back(file: File, luck: Luck) -> list[str]:
    line = _somewhere(file, luck)
    file.lines[line : line + 2] = reversed(file.lines[line : line + 2])
    return [f"line {line + 2}, column 'time'", "expected ascending times", "sort the lines"]


def _time_gone(file: File, luck: Luck) -> list[str]:
    line = _somewhere(file, luck)
    cells = _cells(file, line)
    cells[0] = "NaN"
    _put(file, line, cells)
    return [f"line {line + 1}, column 'time'", "expected a number but found none"]


def _heading_gone(file: File, luck: Luck) -> list[str]:
    del file.lines[file.heading]
    if "row" in file.habits.style:
        del file.lines[file.heading]
    return ["column 'time [s]' is missing", 'columns={"time": ']


def _heading_other(file: File, luck: Luck) -> list[str]:
    """Two columns either of which may be the radius."""
    said = _heading_twice(file, luck)
    file.lines[file.heading] = file.lines[file.heading].lower().replace("radius", "weg")
    return [
        said[0].replace("column 'radius' appears twice", "expected one column 'radius [m]' or"),
        "weg",
        '"radius": ',
    ]


def _heading_twice(file: File, luck: Luck) -> list[str]:
    for i, line in enumerate(file.lines[file.heading :], file.heading):
        cells = _cells(file, i) if line else []
        if len(cells) == 4:
            _put(file, i, [*cells, cells[3]])
    return [f"line {file.heading + 1}: column 'radius' appears twice", 'columns={"radius": 5}']


def _other_unit(unit: str, words: str) -> Any:
    def injure(file: File, luck: Luck) -> list[str]:
        _put(file, file.heading, ["time [s]", "pressure [Pa]", f"voltage [{unit}]", "radius [m]"])
        if "row" in file.habits.style:
            del file.lines[file.heading + 1]
        return [f"line {file.heading + 1}, column 'voltage'", words]

    return injure


def _no_unit(file: File, luck: Luck) -> list[str]:
    _put(file, file.heading, ["time [s]", "pressure [Pa]", "voltage", "radius [m]"])
    if "row" in file.habits.style:
        del file.lines[file.heading + 1]
    return [f"line {file.heading + 1}: column 'voltage' names no unit", "write it as 'voltage [V]'"]


def _too_few(file: File, luck: Luck) -> list[str]:
    del file.lines[file.first + 20 :]
    return ["too few samples: 20 lines of numbers", "expected at least 50"]


def _binary(file: File, luck: Luck) -> list[str]:
    line = _somewhere(file, luck)
    file.lines[line] = "\x00\x01\x02" + file.lines[line]
    return ["cannot be read as a text file", "expected characters but found"]


def _open_quote(file: File, luck: Luck) -> list[str]:
    line = max(file.first + 3, _somewhere(file, luck) - 40)
    cells = _cells(file, line)
    cells[2] = f'"{cells[2]}'
    _put(file, line, cells)
    if file.habits.delimiter == "spaces":
        return [f"line {line + 1}, column 'voltage'", "expected a number"]
    return [f"line {line + 1}: expected a closing quote", "close the quote"]


INJURIES = {
    "a letter": _bad_cell("12.x5"),
    "infinite": _bad_cell("inf", "expected a finite number"),
    "a word": _bad_cell("high"),
    "underscores": _bad_cell("1_000"),
    "two points": _bad_cell("1.2.3"),
    "hexadecimal": _bad_cell("0x1F"),
    "a truncated exponent": _bad_cell("1.5e"),
    "too large": _bad_cell("1e999", "expected a finite number"),
    "minus infinite": _bad_cell("-1.#INF", "expected a finite number"),
    "a cell lost": _cell_lost,
    "a cell more": _cell_more,
    "time goes back": _time_back,
    "a time missing": _time_gone,
    "no headings": _heading_gone,
    "another name": _heading_other,
    "a heading twice": _heading_twice,
    "another dimension": _other_unit("mm", "expected a unit like 'V' but was given 'mm'"),
    "an unknown unit": _other_unit("furlong", "cannot read the unit 'furlong'"),
    "no unit": _no_unit,
    "too few": _too_few,
    "binary": _binary,
    "an open quote": _open_quote,
}
