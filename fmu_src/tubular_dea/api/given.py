"""Conversion of arguments: "5.5 kV" or 5500.0 to numbers, a plant by its name or file, settings by name."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeAlias, TypeVar

from ..emit.tables import shown
from ..errors import ArgumentError, UserError
from ..model.declare import Model, Quantity, nearest
from ..model.units import UnitError, quantity
from ..plants.load import SHIPPED
from ..plants.load import load_plant as named_plant
from ..plants.plant import Plant
from ..plants.saved import load as saved

Amount: TypeAlias = float | str  # a number in SI, or a text with a unit
Value = TypeVar("Value")
AnyPlant: TypeAlias = Plant | str | Path
AnyModel: TypeAlias = Model | Plant | str | Path


def amount(given: Amount, unit: str, argument: str) -> float:
    """A number in `unit` (SI) from a number or a text such as "5.5 kV"; `ArgumentError` names the argument."""
    try:
        value = quantity(given, unit) if isinstance(given, str) else float(given)
    except UnitError as problem:
        raise ArgumentError(argument, f": {problem}") from None
    except (TypeError, ValueError):
        raise ArgumentError(argument, f": expected a number but was given {brief(given)}") from None
    if not math.isfinite(value):
        raise ArgumentError(argument, f": expected a finite number but was given {value:g}")
    return value


def path_of(given: str | Path, argument: str) -> Path:
    """A path from a text or a path; `ArgumentError` names the argument for anything else."""
    if not isinstance(given, str | Path):
        raise ArgumentError(argument, f": expected a path but was given {brief(given)}")
    return Path(given)


def brief(given: object) -> str:
    """What was given, in a few words: a value that is short, or the name of its type."""
    return repr(given) if isinstance(given, str | int | float | Path | None) else f"a {type(given).__name__}"


def plant_of(plant: AnyPlant) -> Plant:
    """The plant itself, a shipped one by name, or that of a FILE.py[:NAME]."""
    if isinstance(plant, Plant):
        return plant
    if not isinstance(plant, str | Path):
        listed = ", ".join(repr(name) for name in SHIPPED)
        raise ArgumentError("plant", f": expected a Plant, {listed} or a FILE.py[:NAME] but was given {brief(plant)}")
    return named_plant(str(plant))


def model_of(model: AnyModel, plant: AnyPlant | None = None, argument: str = "model") -> Model:
    """The model itself, a plant's, one by a plant's name or file, or that of a model.json (of `plant`).

    `ArgumentError` names the argument.
    """
    if isinstance(model, Model):
        return model
    if isinstance(model, Plant):
        return model.model
    if not isinstance(model, str | Path):
        raise ArgumentError(argument, f": expected a Model, a Plant or a file but was given {brief(model)}")
    if str(model).endswith(".json"):
        chosen = None if plant is None else plant_of(plant)
        found = saved(Path(model), chosen)
        if chosen is not None and chosen.name not in (found.name, named_plant("tube").name):
            raise ArgumentError(
                argument,
                f" {model}: expected a model of the given plant, {chosen.name}, but it holds {found.name}; leave the "
                "plant out, or give a model of it",
            )
        return found
    if str(model) not in SHIPPED and not re.search(r"\.py(:\w+)?$", str(model)):
        raise ArgumentError(argument, f" {model}: expected a model.json, FILE.py[:NAME] or {' or '.join(SHIPPED)}")
    return plant_of(model).model


def tube_of(tube: AnyModel) -> Model:
    """The model of a tube; `ArgumentError` for another one."""
    plant = named_plant("tube")
    model, expected = model_of(tube, plant, "tube"), plant.name
    if model.name != expected:
        where = f" {tube}" if isinstance(tube, str | Path) else ""
        raise ArgumentError("tube", f"{where}: expected a tube ({expected}) but it holds {model.name}")
    return model


def parameters_of(model: Model, given: Mapping[str, Amount] | None, argument: str = "parameters") -> dict[str, float]:
    """Parameters of one model by name, each in SI or as a text with a unit, checked against the declaration."""
    return {n: _value(argument, n, _declared(argument, model, n, n, v), v) for n, v in items(argument, given)}


def settings_of(
    parts: Mapping[str, Model], given: Mapping[str, Amount] | None, argument: str = "settings", also: Sequence[str] = ()
) -> dict[str, float]:
    """The same of a system, by "part.name"; `also` are other names there are, which the caller has taken out."""
    values = {}
    for full, value in items(argument, given):
        part, _, name = full.partition(".")
        if part not in parts:
            known = [*also, *(f"{p}.{q.quantity.name}" for p, model in parts.items() for q in model.parameters)]
            close = difflib.get_close_matches(full, known, n=1)
            raise ArgumentError(
                argument,
                f" {full}={value}: expected PART.PARAMETER=VALUE with one of the parts {', '.join(parts)}, as in "
                f"heart.C=1.2mL/mmHg{f'; did you mean {close[0]}?' if close else ''}",
            )
        values[full] = _value(argument, full, _declared(argument, parts[part], name, full, value), value)
    return values


def items(argument: str, given: Mapping[str, Value] | None, of: str = "") -> list[tuple[str, Value]]:
    """The values by name `of` an argument; `ArgumentError` for what is none, as {"C_1": 3e5} is one."""
    where = f" {of}" if of else ""
    if not isinstance(given, Mapping | None):
        raise ArgumentError(argument, f"{where}: expected values by name, as in a dict, but was given {brief(given)}")
    for name in given or {}:
        if not isinstance(name, str):
            raise ArgumentError(argument, f"{where}: expected a name, as 'name', but was given {brief(name)}")
    return list((given or {}).items())


def whole(value: int, least: int, argument: str) -> int:
    """A whole number from `least` on; `ArgumentError` for anything less."""
    if not isinstance(value, int):
        raise ArgumentError(argument, f": expected a whole number but was given {brief(value)}")
    if value < least:
        raise ArgumentError(argument, f": expected at least {least} but was given {value}")
    return value


def _declared(argument: str, model: Model, name: str, full: str, value: Amount) -> Quantity:
    declared = {p.quantity.name: p.quantity for p in model.parameters}
    if name not in declared:
        raise ArgumentError(
            argument, f" {full}={value}: {model.name} has no parameter {name!r}{nearest(name, declared)}"
        )
    return declared[name]


def _value(argument: str, full: str, q: Quantity, given: Amount) -> float:
    where = f" {full}={given}"
    try:
        value = _number(given, q)
    except (UserError, TypeError, ValueError) as problem:
        example = f"{full}={shown(q).replace(' 1/', '/').replace(' ', '')}"  # 75/min: for shells, without a space
        raise ArgumentError(argument, f"{where}: {problem}; for example {example}") from None
    if not math.isfinite(value) or not q.allows(value):
        raise ArgumentError(argument, f"{where}: expected {q.allowed} but was given {q.told(value)}")
    if q.type == "Integer" and value != int(value):
        raise ArgumentError(argument, f"{where}: expected a whole number but was given {value:g}")
    return value


def _number(given: Amount, q: Quantity) -> float:
    if not isinstance(given, str):
        return float(given)
    return _truth(given) if q.type == "Boolean" else quantity(given, q.unit)


def _truth(text: str) -> float:
    """1.0 for "true" or "1", 0.0 for "false" or "0"."""
    known = {"true": 1.0, "1": 1.0, "false": 0.0, "0": 0.0}
    if text.strip().lower() not in known:
        raise UnitError(f"expected true or false but was given {text!r}")
    return known[text.strip().lower()]
