"""Axes from the entries of a plan's [vary]."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import UserError
from ..model.declare import nearest
from ..model.patients import PATIENTS
from ..model.units import NUMBER, factor
from ..plants.plant import Plant
from ..tabular import headings, rows
from .axes import Axis, Joint, Levels, Normal, Range
from .expression import PlanError, number
from .models import calibrated
from .quantities import Quantities

FORMS = (
    '{ from = "0 kV", to = "6 kV", count = 61 }, a list, { mean = 2.8, deviation = 0.1 }, { file = "patients.csv" }, '
    '{ patients = ["healthy"] } or { model = "model.json" }'
)


def axis(name: str, given: object, quantities: Quantities, folder: Path, plant: Plant | None = None) -> Axis:
    """The axis that an entry of [vary] describes, of a model of `plant`; `PlanError` naming it for anything else."""
    place = f"[vary] {name}"
    if isinstance(given, Sequence) and not isinstance(given, str):
        made: Axis = _levels(name, given, quantities, place)
    elif not isinstance(given, Mapping):
        raise PlanError(f"{place}: expected {FORMS} but was given {given!r}")
    elif {"from", "to"} <= set(given):
        made = _range(name, given, quantities, place)
    elif {"mean", "deviation"} <= set(given):
        made = _normal(name, given, quantities, place)
    elif "file" in given:
        made = _file(name, folder / str(given["file"]), quantities, place)
    elif "patients" in given:
        made = _patients(name, given, quantities, place)
    elif "model" in given:
        made = _calibration(folder / str(given["model"]), quantities, place, plant)
    else:
        raise PlanError(f"{place}: expected {FORMS} but was given {', '.join(given)}")
    _check_bounds(made, quantities, place)
    return made


def _unit(name: str, texts: Sequence[object], quantities: Quantities) -> str:
    """The SI unit of an axis: its parameter's or input's, or that of the numbers given (which has to be SI then)."""
    known = {**quantities.parameters, **quantities.inputs}
    if name in known:
        return known[name].unit
    import re

    match = re.fullmatch(rf"\s*{NUMBER}\s*(\S+)\s*", str(texts[0]))
    return _base(match[1]) if match else "1"


def _base(unit: str) -> str:
    """The SI unit for one like it: Pa for mmHg."""
    for candidate in ("Pa", "V", "m", "s", "Hz", "m3", "m3/s", "N", "F", "C", "A", "kg", "K", "Pa.s", "1"):
        try:
            factor(unit, candidate)
        except UserError:
            continue
        return candidate
    return unit


def _numbers(texts: Sequence[Any], unit: str, place: str) -> list[float]:
    values = [number(float(t) if isinstance(t, bool) else t, unit, place) for t in texts]
    if any(v.constant is None for v in values):
        raise PlanError(f"{place}: expected numbers but was given {list(texts)!r}")
    return [v.constant for v in values if v.constant is not None]


def _levels(name: str, given: Sequence[Any], quantities: Quantities, place: str) -> Levels:
    if not given:
        raise PlanError(f"{place}: the list is empty; expected at least one value")
    unit = _unit(name, given, quantities)
    values = _numbers(given, unit, place)
    if len(set(values)) < len(values):
        raise PlanError(f"{place}: a value is given twice; expected each once")
    return Levels(name, ((name, unit),), tuple((v,) for v in values))


def _only(given: Mapping[str, Any], names: tuple[str, ...], place: str) -> None:
    for entry in given:
        if entry not in names:
            raise PlanError(f"{place} has no entry {entry!r}{nearest(entry, names)}")


def _range(name: str, given: Mapping[str, Any], quantities: Quantities, place: str) -> Range:
    _only(given, ("from", "to", "count", "step", "log"), place)
    unit = _unit(name, [given["from"], given["to"]], quantities)
    low, high = _numbers([given["from"], given["to"]], unit, place)
    count = given.get("count")
    log = bool(given.get("log", False))
    if not low < high:
        what = "is empty" if low == high else "is reversed"
        raise PlanError(f"{place}: the range {what}; expected from below to, but was given {low:g} to {high:g} {unit}")
    if log and low <= 0:
        raise PlanError(f"{place}: expected a positive range for log but was given {low:g} {unit}")
    if "step" in given:
        (step,) = _numbers([given["step"]], unit, place)
        parts = (high - low) / step if step > 0 else 0.0
        if count is not None or log or not parts >= 1 or abs(parts - round(parts)) > 1e-6:
            raise PlanError(
                f"{place}: expected a step that divides {high - low:g} {unit}, without count or log, "
                f"but was given {step:g} {unit}"
            )
        count = round(parts) + 1
    if count is not None and (isinstance(count, bool) or not isinstance(count, int) or count < 2):
        raise PlanError(f"{place}: expected a count of at least 2 but was given {count!r}")
    return Range(name, unit, low, high, count, log)


def _normal(name: str, given: Mapping[str, Any], quantities: Quantities, place: str) -> Normal:
    _only(given, ("mean", "deviation"), place)
    unit = _unit(name, [given["mean"], given["deviation"]], quantities)
    mean, deviation = _numbers([given["mean"], given["deviation"]], unit, place)
    if not deviation > 0:
        raise PlanError(f"{place}: expected a positive deviation but was given {deviation:g} {unit}")
    return Normal(name, unit, mean, deviation)


def _file(name: str, path: Path, quantities: Quantities, place: str) -> Levels:
    """One point a line; a column `name` without a unit has the labels."""
    try:
        table = rows(path)
        header = table[0][1] if table else []
        cells = headings(path, header, {n: q.unit for n, q in quantities.parameters.items()})
        scales = {n: factor(cell.unit, quantities.parameters[n].unit) for n, cell in cells.items()}
    except UserError as problem:
        raise PlanError(f"{place}: {problem}") from None
    for text in header:
        column = text.partition("[")[0].strip()
        if column not in cells and column != name:
            raise PlanError(
                f"{place}: {path}: {quantities.name} has no parameter {column!r}"
                f"{nearest(column, quantities.parameters)}"
            )
    if len(table) < 2 or not cells:
        raise PlanError(f"{place}: {path}: expected a header with parameters and at least one line of numbers")
    points, labels = [], []
    for line, row in table[1:]:
        try:
            points.append(tuple(float(row[c.place]) * scales[n] for n, c in cells.items()))
        except (ValueError, IndexError):
            raise PlanError(f"{place}: {path}, line {line}: expected {len(cells)} numbers but found {row}") from None
        labels.append(row[header.index(name)] if name in header else f"line {line}")
    columns = tuple((n, quantities.parameters[n].unit) for n in cells)
    return Levels(name, columns, tuple(points), tuple(labels))


def _patients(name: str, given: Mapping[str, Any], quantities: Quantities, place: str) -> Levels:
    """Patients of `model.patients` by name, for the part of a composition they belong to."""
    _only(given, ("patients", "part"), place)
    prefix = f"{given['part']}_" if "part" in given else ""
    names = list(given["patients"])
    for patient in names:
        if patient not in PATIENTS:
            raise PlanError(f"{place}: there is no patient {patient!r}{nearest(patient, PATIENTS)}")
    keys = list(dict.fromkeys(key for patient in names for key in PATIENTS[patient]))
    unknown = [f"{prefix}{key}" for key in keys if f"{prefix}{key}" not in quantities.parameters]
    if unknown or not names:
        raise PlanError(
            f"{place}: {quantities.name} has no parameter {unknown[:1]}; name the part that is the heart, "
            f'for example {{ patients = ["healthy"], part = "heart" }}'
        )
    defaults = {key: float(quantities.parameters[f"{prefix}{key}"].value or 0.0) for key in keys}
    table = tuple(tuple(float({**defaults, **PATIENTS[p]}[key]) for key in keys) for p in names)
    columns = tuple((f"{prefix}{key}", quantities.parameters[f"{prefix}{key}"].unit) for key in keys)
    return Levels(name, columns, table, tuple(names))


def _calibration(path: Path, quantities: Quantities, place: str, plant: Plant | None) -> Joint:
    _, joint = calibrated(path, plant)
    if joint is None:
        raise PlanError(f"{place}: {path} has no covariance; expected one of a model that was identified")
    for column, _ in joint.columns:
        if column not in quantities.parameters:
            raise PlanError(
                f"{place}: {quantities.name} has no parameter {column!r}"
                f"{nearest(column, quantities.parameters)}; give the same model.json as model"
            )
    return joint


def _check_bounds(made: Axis, quantities: Quantities, place: str) -> None:
    """The ends of ranges and all points of lists lie within the parameters' bounds."""
    values: dict[str, list[float]] = {}
    if isinstance(made, Range):
        values[made.name] = [made.low, made.high]
    elif isinstance(made, Levels):
        values = {name: [row[i] for row in made.table] for i, (name, _) in enumerate(made.columns)}
    for name, numbers in values.items():
        for value in numbers:
            if not math.isfinite(value):
                raise PlanError(f"{place}: expected finite numbers but was given {value!r}")
            if name in quantities.parameters:
                quantities.check_bounds(name, value, place)
