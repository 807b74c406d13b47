"""Files as laboratories write them, drawn by seed, with the numbers that they are meant to say. Knows no reader.

`drawn(seed)` makes choices (`Habits`) and writes a file by them; `injuries.injured(seed)` spoils one.
"""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

N = 400
UNITS = {  # as somebody writes them, and how many SI units one is
    "time": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "S": 1.0, "seconds": 1.0, "min": 60.0},
    "pressure": {
        "Pa": 1.0,
        "kPa": 1e3,
        "hPa": 1e2,
        "mbar": 1e2,
        "bar": 1e5,
        "mmHg": 133.322,
        "mm Hg": 133.322,
        "cmH2O": 98.0665,
        "cm H2O": 98.0665,
        "psi": 6894.757293168361,
        "PSI": 6894.757293168361,
        "torr": 101325 / 760,
        "Torr": 101325 / 760,
        "MBAR": 1e2,
        "inHg": 25.4 * 133.322,
    },
    "voltage": {"V": 1.0, "kV": 1e3, "KV": 1e3, "mV": 1e-3, "volts": 1.0},
    "radius": {
        "m": 1.0,
        "mm": 1e-3,
        "um": 1e-6,
        "\u00b5m": 1e-6,
        "\u03bcm": 1e-6,
        "cm": 1e-2,
        "microns": 1e-6,
        "MM": 1e-3,
        "inch": 0.0254,
    },
    "current": {"A": 1.0, "uA": 1e-6, "\u00b5A": 1e-6, "mA": 1e-3, "nA": 1e-9},
}
GONE = ["", "NaN", "nan", "-", "OL", "1.#QNAN", "ERR", "#N/A", "n/a", "--", "9.9E+37", "-1.#IND", "null", "overload"]
HEADING = {
    "brackets": "{name} [{unit}]",
    "round": "{name} ({unit})",
    "tight": "{name}[{unit}]",
    "underscore": "{name}_{unit}",
    "slash": "{name}/{unit}",
    "spaced slash": "{name} / {unit}",
    "in": "{name} in {unit}",
    "row": "{name}",
    "bracketed row": "{name}",
    "braces": "{name} {{{unit}}}",
    "cells": "{name}",
}
DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "bar": "|", "spaces": "   ", "aligned": ""}
SPACED = ("spaces", "aligned")
ENCODINGS = ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1", "cp1252"]
HEADS = {
    "": [],
    "comments": ["# rig 2, tube 14", "# operator: none", "%% 23 \u00b0C"],
    "blank": ["", ""],
    "pairs": ["Operator: J. Doe", "Date: 2024-03-01 12:00:01", "Sample rate = 250 Hz"],
    "cells": ["Channels{d}4", "Operator{d}nobody{d}{d}", "Samples{d}400{d}400{d}400", "***End_of_Header***"],
    "long": [f"Setting {i}: {i * 17}" for i in range(40)],
    "title": ["Bench 3 -- radial stiffness of tubes (export of 1.3.2024)", ""],
}
CLOCKS = ("clock", "ISO", "ISO Z", "ISO space", "German", "half days", "colons")
START = datetime.datetime(2024, 2, 28, 23, 59, 59, 500_000)  # shortly before the midnight before a leap day


class Luck:
    """Random choices."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)

    def pick(self, options: Sequence[Any]) -> Any:
        return options[int(self.random.integers(len(options)))]

    def happens(self, share: float) -> bool:
        return bool(self.random.random() < share)


@dataclass(frozen=True)
class Habits:
    """How a laboratory writes its files."""

    delimiter: str
    encoding: str
    style: str
    head: str
    comma: bool
    time: str
    names: tuple[str, ...]
    case: str
    thousands: bool
    gaps: bool
    comment: bool
    quoted: bool
    trailing: bool
    between: tuple[str, ...]
    footer: str

    @staticmethod
    def drawn(luck: Luck) -> Habits:
        """Any combination but those that can mean two things."""
        delimiter, style, comma = luck.pick([*DELIMITERS]), luck.pick([*HEADING]), luck.happens(0.4)
        spaced = delimiter in SPACED
        while spaced and style in ("in", "spaced slash", "braces", "cells"):
            style = luck.pick([*HEADING])
        time = luck.pick(["s"] * 7 + [c for c in CLOCKS if not (spaced and c in ("ISO space", "German", "half days"))])
        names = ["time", "pressure", "voltage", "radius", *(["current"] if luck.happens(0.3) else [])]
        if luck.happens(0.3):
            names = [*names[: time != "s"], *luck.random.permutation(names[time != "s" :])]
        return Habits(
            delimiter,
            luck.pick(ENCODINGS),
            style,
            luck.pick([*HEADS]),
            comma,
            time,
            tuple(names),
            luck.pick(["lower", "upper", "title"]),
            style != "cells" and not spaced and luck.happens(0.15),
            luck.happens(0.5),
            not spaced and luck.happens(0.3),
            (delimiter == "comma" and comma) or (not spaced and luck.happens(0.15)),
            delimiter in ("comma", "semicolon", "tab") and luck.happens(0.2),
            (luck.pick(["", "heading", "comment", "blank"]), luck.pick(["", "", "blank"])),
            luck.pick(["", "\n", "\n\n\n", "\n# end of file\n", "\n*** stopped ***\n"]),
        )


@dataclass
class File:
    """A file and what it means: `values` by column name in the unit of the file, `si` factors, NaN where missing.

    `lines` are its lines, of which `first` (from 0) is the first with numbers and `heading` the one with headings.
    """

    habits: Habits
    lines: list[str] = field(default_factory=list)
    values: dict[str, np.ndarray] = field(default_factory=dict)
    si: dict[str, float] = field(default_factory=dict)
    heading: int = 0
    first: int = 0
    end: str = "\n"

    @property
    def raw(self) -> bytes:
        return (self.end.join(self.lines) + self.habits.footer.replace("\n", self.end)).encode(self.habits.encoding)


def numbers(random: np.random.Generator, n: int = N) -> dict[str, np.ndarray]:
    """A plausible recording in SI units."""
    t = np.arange(n) * 0.004
    pressure = 8000 * np.minimum(t / 0.8, 1) + 25 * random.standard_normal(n)
    voltage = 4000.0 * (t >= 1.0) + 4 * random.standard_normal(n)
    radius = 0.015 + 2e-7 * pressure + 4e-4 * (t >= 1.0) + 15e-6 * random.standard_normal(n)
    current = 1e-5 * np.exp(-np.maximum(t - 1, 0) / 0.1) * (t >= 1) + 1e-8 * random.standard_normal(n)
    return {"time": t, "pressure": pressure, "voltage": voltage, "radius": radius, "current": current}


def drawn(seed: int) -> File:
    """A file of a laboratory."""
    luck = Luck(seed)
    return written(Habits.drawn(luck), luck)


def written(habits: Habits, luck: Luck) -> File:
    """A recording, written by these habits."""
    file, d = File(habits), DELIMITERS[habits.delimiter]
    cells, headings, units = _columns(file, luck)
    quoted = habits.quoted or " " in d
    file.lines = [line.format(d=d or "  ") if "{d}" in line else line for line in HEADS[habits.head]]
    file.heading = len(file.lines)
    file.lines.append(_row(headings, habits.delimiter, quoted))
    if "row" in habits.style:
        file.lines.append(_row(units, habits.delimiter, False))
    file.first = len(file.lines)
    rows = [_row(row, habits.delimiter, habits.quoted) + d * habits.trailing for row in zip(*cells, strict=True)]
    for extra in habits.between:
        between = {"heading": file.lines[file.heading], "comment": "# paused here", "blank": "", "": None}[extra]
        if between is not None:
            rows.insert(int(luck.random.integers(20, N - 20)), between)
    file.lines += rows
    file.end = "\r\n" if "16" in habits.encoding else luck.pick(["\n", "\r\n", "\r"])
    return file


def _columns(file: File, luck: Luck) -> tuple[list[list[str]], list[str], list[str]]:
    """The cells of every column, with headings and units; `file` learns what they mean."""
    habits, data = file.habits, numbers(luck.random)
    cells, headings, units = [], [], []
    for name in habits.names:
        unit = luck.pick([u for u in UNITS[name] if _writable(u, habits)])
        file.si[name] = UNITS[name][unit]
        if name == "time" and habits.time != "s":
            file.si[name], texts = 1.0, [clock(t, habits.time) for t in data["time"]]
            file.values[name] = np.round(data["time"], 3) + 86399.5
        else:
            texts, file.values[name] = _texts(data[name] / file.si[name], habits, luck)
            if habits.style == "cells":
                texts = [f"{text} {unit}" for text in texts]
        if habits.gaps and name != "time":
            _lose(texts, file.values[name], habits, luck)
        plain, clocked = getattr(name, habits.case)(), name == "time" and habits.time != "s"
        headings.append(plain if clocked else HEADING[habits.style].format(name=plain, unit=unit))
        units.append("" if clocked else f"[{unit}]" if habits.style == "bracketed row" else unit)
        cells.append(texts)
    if clocked_alone(habits):
        units[habits.names.index("time")] = "-"
    if habits.comment:
        headings.append("comment"), units.append("")
        cells.append(["started" if i == 7 else "" for i in range(N)])
    return cells, headings, units


def clocked_alone(habits: Habits) -> bool:
    """Whether a row of units needs a mark for a time that has none, as spaces hold no empty cell."""
    return habits.time != "s" and habits.delimiter in SPACED


def _writable(unit: str, habits: Habits) -> bool:
    if habits.encoding in ("latin-1", "cp1252") and "\u03bc" in unit:
        return False
    return " " not in unit or (habits.delimiter not in SPACED and habits.style not in ("slash", "underscore"))


def _texts(values: np.ndarray, habits: Habits, luck: Luck) -> tuple[list[str], np.ndarray]:
    """Numbers as written, with six digits at the size of the largest, and what these digits mean."""
    digits = max(0, 5 - int(np.floor(np.log10(np.max(np.abs(values))))))
    if habits.thousands:
        digits = max(1, digits)
    style = f"{{:,.{digits}f}}" if habits.thousands else f"{{:.{digits}f}}"
    if luck.happens(0.1) and not habits.thousands and values[0] != 0:
        style = "{:.5E}"
    texts = [style.format(v) for v in values]
    meant = np.array([float(t.replace(",", "")) for t in texts])
    if habits.comma:
        texts = [t.translate(str.maketrans(",.", ".,")) for t in texts]
    return texts, meant


def _lose(texts: list[str], values: np.ndarray, habits: Habits, luck: Luck) -> None:
    """Some cells without a number."""
    marks = [g for g in GONE if g] if habits.delimiter in SPACED else GONE
    for i in luck.random.choice(np.arange(3, N - 3), 5, replace=False):
        texts[i], values[i] = luck.pick(marks), np.nan


def clock(seconds: float, style: str) -> str:
    """A time of the day after a start shortly before midnight."""
    now = START + datetime.timedelta(milliseconds=round(seconds * 1e3))
    day, milli = now.strftime("%Y-%m-%d"), f"{now.microsecond // 1000:03d}"
    hour = now.strftime("%H:%M:%S.") + milli
    styles = {
        "clock": hour,
        "ISO": f"{day}T{hour}",
        "ISO Z": f"{day}T{hour}Z",
        "ISO space": f"{day} {hour}",
        "German": now.strftime("%d.%m.%Y ") + hour,
        "colons": hour.replace(".", ":"),
        "half days": now.strftime("%I:%M:%S.") + milli + now.strftime(" %p"),
    }
    return styles[style]


def _row(cells: Sequence[str], kind: str, quoted: bool) -> str:
    if kind == "aligned":
        return "  ".join(f"{cell:>18s}" for cell in cells)
    d = DELIMITERS[kind]
    return d.join(f'"{c}"' if quoted or d in c else c for c in cells)
