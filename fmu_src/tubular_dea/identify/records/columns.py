"""Which column of a file is which signal: by its heading, or by `--columns radius=laser_2[um] voltage=AI3`."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import ArgumentError, ColumnError
from ...model.declare import nearest
from ...model.units import NUMBER, UnitError, converted, difference, is_unit, parse
from ...plants.plant import Output, Plant
from ...recordings import Column, ReadError, Table
from ...recordings.heading import name as plain
from ...recordings.table import either

TRIGGER = "trigger"
ANY = "ITS_NAME_OR_NUMBER"  # what a message has for a column that it cannot tell
# Set by convention of spreadsheets, which count days from 1900 on. Check: `pytest tests/browser/test_words.py`
SERIAL_DAYS = (36526, 73051)  # [d] of the years 2000 to 2100
# Set by judgement. Check: `pytest tests/test_reading.py -k size`
AT_REST = 0.9  # [1] times its value at rest that the middle number is at least, and
GROWN = 1.8  # [1] at most, where that value is in it: a diameter is twice a radius
CHANGED = 0.6  # [1] times that value that it is at most, where it is not
ALSO_TIME = ("timestamp", "time_stamp", "t", "elapsed", "elapsed_time", "x_value", "datetime", "date_time", "zeit")


@dataclass(frozen=True)
class Choice:
    """The column that a user names for a signal, by heading or number, with its unit ("": as the file says).

    A reading of 1 is `factor` units: 0.5 mm for a diameter in mm, 2500 Pa for a sensor's volts. It counts from the
    reading `zero`, with a negative factor downwards from there: a laser's distance of 42000 um that falls.
    """

    column: str
    unit: str = ""
    factor: float = 1.0
    zero: float = 0.0


@dataclass(frozen=True)
class Assigned:
    """The `values` (n,) of a signal in SI units, from a `column` in this `unit`, of which they are so many times."""

    column: Column
    unit: str
    values: np.ndarray
    times: float = 1.0


def signals(plant: Plant) -> dict[str, str]:
    """The SI unit of everything that a file may hold, by heading; the trigger has any."""
    units = {"time": "s"} | {s.name: plant.quantity(s.name).unit for s in plant.inputs}
    units |= {name: plant.quantity(o.name).unit for o in plant.outputs for name in o.headings}
    return units | {TRIGGER: ""}


def choices(settings: Sequence[str], plant: Plant, source: str = "columns") -> dict[str, Choice]:
    """What `radius=laser_2`, `voltage=3` or `radius=laser_2[um]` say; `ArgumentError` for what they cannot mean.

    `source` is what the error names: the argument, or a file and its table.
    """
    known, found = signals(plant), dict[str, Choice]()
    spelt = {plain(n): n for n in known} | {n: n for n in known}
    for setting in settings:
        name, _, rest = (part.strip() for part in setting.partition("="))
        match = re.fullmatch(r"(?P<column>.*?)\s*(?:\[(?P<unit>[^\]]*)\])?", rest)
        if not name or match is None or not match["column"]:
            raise ArgumentError(
                source,
                f" {setting}: expected SIGNAL=COLUMN, the column by its heading or number, as in radius=laser_2 or "
                "radius=3[um]",
            )
        signal = spelt.get(name) or spelt.get(plain(name))
        if signal is None:
            raise ArgumentError(source, f" {setting}: there is no signal {name!r}{nearest(name, known)}")
        if signal in found:
            raise ArgumentError(source, f" {setting}: {name} is given twice; give it once")
        number, unit, zero = _scaled(match["unit"] or "")
        if unit and not is_unit(unit):
            expected = known[signal] or "V"
            raise ArgumentError(source, f" {setting}: expected a unit like {expected!r} but found {unit!r}")
        found[signal] = Choice(match["column"], unit, number, zero)
    return found


def _scaled(unit: str) -> tuple[float, str, float]:
    """A unit, the number before it (else 1) and the reading from which it counts (else 0), as in "-1 um from 42000"."""
    unit, zero = match.groups() if (match := re.fullmatch(rf"(.*\S)\s+from\s+({NUMBER})\s*", unit)) else (unit, 0.0)
    match = re.fullmatch(rf"\s*({NUMBER})\s*([^\d\s].*)", unit)
    number, unit = (float(match[1]), match[2]) if match and float(match[1]) != 0 else (1.0, unit)
    return number, unit.strip(), float(zero)


def assigned(
    table: Table, plant: Plant, chosen: Mapping[str, Choice], rate: float | None = None
) -> dict[str, Assigned]:
    """Time, inputs, the outputs and the trigger of a file, in SI units; `ReadError` for what is missing or unclear.

    `rate` [Hz] makes the time of a file that has none.
    """
    units = signals(plant)
    chosen = {**chosen, **_multiples(table, plant, chosen, units)}
    columns = {name: _named(table, name, choice) for name, choice in chosen.items()}
    for name in units:
        if name in columns or _otherwise(name, plant, columns):
            continue
        column = _headed(table, name, units[name], [c.number for c in columns.values()])
        if column is not None:
            columns[name] = column
    for signal in plant.inputs:
        if signal.name not in columns and (column := _only(table, units[signal.name], columns)):
            columns[signal.name] = column
    for output in plant.outputs:
        if columns.keys().isdisjoint(output.headings):
            columns |= _by_content(table, output, units, columns, plant)
    if "time" not in columns and rate is not None:
        columns["time"] = Column("time", "s", f"{rate:g} Hz (bench.toml)", np.arange(table.lines.size) / rate, 0)
    _complete(table, plant, columns, units)
    return {name: _in_si(table, name, column, chosen.get(name), units[name]) for name, column in columns.items()}


def unused(table: Table, used: Mapping[str, Assigned]) -> list[str]:
    """The headings of the columns that were not used."""
    numbers = {a.column.number for a in used.values()}
    return [
        c.heading or f"number {c.number}"
        for c in table.columns
        if c.number not in numbers and (c.heading or c.missing < c.values.size)
    ]


def _otherwise(name: str, plant: Plant, columns: Mapping[str, Column]) -> bool:
    """Whether the user has said where an output is, under another of its headings."""
    return any(name in o.headings and not columns.keys().isdisjoint(o.headings) for o in plant.outputs)


def _multiples(table: Table, plant: Plant, chosen: Mapping[str, Choice], units: Mapping[str, str]) -> dict[str, Choice]:
    """The columns of what is a multiple of an output that is in no column itself, as a diameter is of a radius."""
    found = {}
    for output in plant.outputs:
        headed = any(h in chosen or _headed(table, h, units[h], []) for h in output.headings)
        if headed or _worded(table, output, units, {}):
            continue
        measured = [c for c in table.columns if _measured(c)]
        there = [(c, m) for c in measured for m in output.multiples if is_worded(m, c)]
        if len(there) == 1:
            column, name = there[0]
            heading, times = output.multiples[name]
            found[heading] = Choice(str(column.number), factor=1.0 / times)
    return found


def _named(table: Table, name: str, choice: Choice) -> Column:
    """The column that the user means: a heading as it stands there, its name, or a number from 1."""
    exact = [c for c in table.columns if choice.column in (c.heading, c.name)]
    found = exact or [c for c in table.columns if c.name and c.name == plain(choice.column)]
    if not found and choice.column.isdecimal():
        found = [c for c in table.columns if c.number == int(choice.column)]
    if len(found) != 1:
        there = "is there more than once: give its number" if found else "is not there"
        headings = [c.heading for c in table.columns if c.heading]
        close = difflib.get_close_matches(choice.column, headings, n=1, cutoff=0.5)
        hint = f"did you mean {close[0]!r}?" if close and not found else f"found {table.headings}"
        raise ReadError(f"{table.heading_place}: column {choice.column!r} for {name} {there}; {hint}")
    return found[0]


def _headed(table: Table, name: str, unit: str, taken: Sequence[int]) -> Column | None:
    """The column headed with a signal's name, if there is one, in small letters or not; time has other names too."""
    free = [c for c in table.columns if c.number not in taken]
    found = [c for c in free if c.name == plain(name)]
    if len(found) > 1:  # as f and F
        found = [c for c in found if c.heading.strip("\"' ").startswith(name)] or found
    if not found and name == "time":
        found = _times(free)
    if len(found) > 1:  # as time t and temperature T
        found = [c for c in found if _may_be_in(c, unit)] or found
    if len(found) > 1:
        problem = f"{table.heading_place}: column {name!r} appears twice; expected it once:"
        raise ColumnError(f"{problem} say which with", {name: found[1].number}, f"{problem} rename what is no {name}")
    return found[0] if found else None


def _alike(table: Table, unit: str, columns: Mapping[str, Column]) -> list[Column]:
    """The columns left that are in a unit of a signal's kind, whatever their headings."""
    taken = {c.number for c in columns.values()}
    return [c for c in table.columns if c.number not in taken and _measured(c) and is_in(c.unit, unit)]


def _only(table: Table, unit: str, columns: Mapping[str, Column]) -> Column | None:
    """The only one of these."""
    alike = _alike(table, unit, columns)
    return alike[0] if len(alike) == 1 else None


def _by_content(
    table: Table, output: Output, units: Mapping[str, str], columns: Mapping[str, Column], plant: Plant
) -> dict[str, Column]:
    """The only column that an output without its own heading can be: by a word, or by its unit where that is needed,
    if its numbers say which of several headings is meant."""
    if found := _worded(table, output, units, columns):
        return dict([found])
    heading, *others = output.headings
    only = _only(table, units[heading], columns) if output.required else None
    if only and others:
        heading = _by_size(converted(only.values, only.unit, units[heading]), output, plant)
    return {heading: only} if only and heading else {}


def _by_size(values: np.ndarray, output: Output, plant: Plant) -> str:
    """The heading under which numbers (n,) (SI) are what a plant that begins at rest may show: with the value at rest,
    such as a radius, or without, such as its change; "" where they may be either, or something else."""
    rests = {h: plant.model.parameter_values()[p] for h, p in output.columns.items() if p}
    without = [h for h, p in output.columns.items() if not p]
    if len(rests) != 1 or not without:
        return ""
    heading, rest = next(iter(rests.items()))
    middle = float(np.nanmedian(values)) / rest
    if AT_REST < middle < GROWN:
        return heading
    return without[0] if abs(middle) < CHANGED else ""


def _worded(
    table: Table, output: Output, units: Mapping[str, str], columns: Mapping[str, Column]
) -> tuple[str, Column] | None:
    """The heading of an output that is part of one column's alone, as radius in "Laser radius (mm)", and the column."""
    taken = {c.number for c in columns.values()}
    free = [c for c in table.columns if c.number not in taken and _measured(c)]
    inside = [(h, c) for c in free for h in output.headings if is_worded(h, c)]
    fitting = sorted((one for one in inside if is_in(one[1].unit, units[one[0]])), key=lambda one: -len(one[0]))
    return fitting[0] if len({c.number for _, c in fitting}) == 1 else None


def is_worded(name: str, column: Column) -> bool:
    """Whether all words of a name are in a column's heading."""
    return {*plain(name).split("_")} <= {*column.name.split("_")}


def _measured(column: Column) -> bool:
    """Whether a column is one of numbers in a unit; some bad cells do not make it text, and are told on reading."""
    return bool(column.unit) and (not column.problem or 2 * column.missing < column.values.size)


def is_in(unit: str, expected: str) -> bool:
    """Whether a unit can be converted to the expected one."""
    try:
        converted(np.ones(1), unit, expected)
    except UnitError:
        return False
    return True


def _may_be_in(column: Column, unit: str) -> bool:
    """Whether a column has a unit of that kind, or none that is told."""
    return not column.unit or is_in(column.unit, unit)


def _times(columns: Sequence[Column]) -> list[Column]:
    """The column that must be the time: by another usual name, as the only one with it in its name, a clock's, or the
    only one in a unit of time."""
    columns = [c for c in columns if c.clock or _may_be_in(c, "s")]
    for also in ALSO_TIME:
        if any(c.name == also for c in columns):
            return [c for c in columns if c.name == also]
    worded = [c for c in columns if {"time", "zeit"} & set(c.name.split("_"))]
    clocks, in_unit = [c for c in columns if c.clock], [c for c in columns if _measured(c) and is_in(c.unit, "s")]
    return next((wanted for wanted in (worded, clocks, in_unit) if len(wanted) == 1), [])


def _complete(table: Table, plant: Plant, columns: Mapping[str, Column], units: Mapping[str, str]) -> None:
    """Refuse a file without time, an input or a required output, or with an output under two headings."""
    missing = [name for name in ["time", *(s.name for s in plant.inputs)] if name not in columns]
    if missing:
        raise _missing(table, plant, columns, units, missing)
    for output in plant.outputs:
        there = [name for name in output.headings if name in columns]
        if len(there) > 1 or (output.required and not there):
            raise _unclear(table, plant, columns, units, output)


def _missing(
    table: Table, plant: Plant, columns: Mapping[str, Column], units: Mapping[str, str], missing: Sequence[str]
) -> ColumnError:
    """What is said of a file without the time or an input, all that lacks at once, and how it can be given."""
    name, *others = missing
    alike = _alike(table, units[name], columns)
    outputs = [o.headings[0] for o in plant.outputs if o.required and columns.keys().isdisjoint(o.headings)]
    also = [f"'{other} [{units[other]}]'" for other in others] + [_wanted(plant, o, units) for o in outputs]
    said = [f"column '{name} [{units[name]}]' is missing", f"found {table.headings}"]
    if taken := [other for other, column in columns.items() if column.name == plain(name)]:
        said.append(f"column {name!r} was given as the {taken[0]}")
    if len(alike) > 1:
        each = "; where every signal has its own, take that of an output" if name == "time" else ""
        said.append(f"it may be {either([f'{c.heading} (column {c.number})' for c in alike])}{each}")
    if name == "time":
        said.append("if there are no times, give [sampling] rate in bench.toml")
    elif not (alike or taken):
        said.append(f"if there was none, add a column '{name} [{units[name]}]' of zeros")
    problem = f"{table.heading_place}: {'; '.join(said)};"
    too = f" missing too: {' and '.join(also)};" if also else ""
    renamed = f"{problem}{too} if it has another heading, write '{name} [{units[name]}]' there"
    which = {n: _which(table, n, units, ANY if n == name else "COLUMN") for n in [*missing, *outputs]}
    return ColumnError(f"{problem} if it has another name, say", which, renamed)


def _which(table: Table, name: str, units: Mapping[str, str], any_one: str) -> str | int:
    """The column that is most likely a signal, or `any_one`; with the unit where the file has none."""
    likely = [c for c in table.columns if plain(name) in c.name.split("_") and not c.problem]
    if any(c.unit for c in table.columns):
        return likely[0].number if len(likely) == 1 else any_one
    return f"{likely[0].number if len(likely) == 1 else 'COLUMN'}[{units[name]}]"


def _wanted(plant: Plant, heading: str, units: Mapping[str, str]) -> str:
    """The headings under which an output may stand."""
    output = next(o for o in plant.outputs if heading in o.headings)
    return " or ".join(f"'{name} [{units[name]}]'" for name in output.headings)


def _unclear(
    table: Table, plant: Plant, columns: Mapping[str, Column], units: Mapping[str, str], output: Output
) -> ColumnError:
    """What is said of a file in which an output is missing, or there more than once."""
    there = [name for name in output.headings if name in columns]
    wanted = _wanted(plant, output.headings[0], units)
    several = sum(o.required for o in plant.outputs) > 1 and not there
    alone = f" what some files lack is declared as Output({output.name!r}, required=False);" if several else ""
    only = None if there else _only(table, units[output.headings[0]], columns)
    size = f" {said};" if only and (said := _no_size(only, output, plant)) else ""
    problem = f"{table.heading_place}: expected one column {wanted} but found {table.headings};{alone}{size}"
    renamed = f"{problem} write that heading where it belongs, and nowhere else"
    which: str | int = only.number if only else ANY
    return ColumnError(f"{problem} say which with", {output.headings[0]: which}, renamed)


def _no_size(column: Column, output: Output, plant: Plant) -> str:
    """Why the only column that an output may be was not taken for it; "" where its size says nothing."""
    rest = output.size_at_rest
    if not rest:
        return ""
    size, middle = plant.quantity(rest), float(np.nanmedian(column.values))
    whole = converted(float(size.value or 0.0), size.unit, column.unit)
    many = next((n for n, (_, times) in output.multiples.items() if AT_REST < middle / whole / times < GROWN), "")
    half = f", but may be a {many}: [{1 / output.multiples[many][1]:g} {column.unit}] halves it" if many else ""
    return (
        f"the middle reading of {column.shown}, {middle:.4g} {column.unit}, is neither that of {rest} ({whole:g} "
        f"{column.unit}) nor of its change{half}"
    )


def _serial_days(values: np.ndarray) -> bool:
    """Whether times are a spreadsheet's dates: days since 1900 that move by far less than one."""
    return bool(np.all((values > SERIAL_DAYS[0]) & (values < SERIAL_DAYS[1])) and np.ptp(values) < 1)


def _in_si(table: Table, name: str, column: Column, choice: Choice | None, expected: str) -> Assigned:
    unit = (choice.unit if choice else "") or column.unit
    if column.problem:
        raise ReadError(f"{table.path}, {column.problem}")
    if name == TRIGGER:
        return Assigned(column, unit, column.values)
    if not unit:
        expected = "d" if name == "time" and _serial_days(column.values) else expected
        problem = f"{table.heading_place}: column {column.shown} names no unit; write it as '{name} [{expected}]'"
        raise ColumnError(f"{problem} or say", {name: f"{column.number}[{expected}]"}, problem)
    times, zero = (choice.factor, choice.zero) if choice else (1.0, 0.0)
    try:
        if zero and parse(unit).offset != parse(expected).offset:  # 30 degC from 20 are 10 K
            return Assigned(column, expected, difference((column.values - zero) * times, unit, expected), times)
        return Assigned(column, unit, converted((column.values - zero) * times, unit, expected), times)
    except UnitError as problem:
        raise ReadError(f"{table.heading_place}, column {column.shown}: {problem}") from None
