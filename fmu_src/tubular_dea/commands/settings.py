"""The option --set NAME=VALUE[UNIT] of every command that has it, checked against the declaration."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from ..emit.tables import shown
from ..errors import UserError
from ..model.declare import Model, Quantity, nearest
from ..model.units import UnitError, quantity


def parameter_values(model: Model, settings: Sequence[str]) -> dict[str, float]:
    """Parameters of one model from "NAME=VALUE" or "NAME=VALUE UNIT", in SI units; `UserError` says what is wrong."""
    return {name: value for (_, name), value in _values({"": model}, settings).items()}


def part_values(parts: Mapping[str, Model], settings: Sequence[str]) -> dict[str, float]:
    """The same of a system from "PART.NAME=VALUE", with the names "PART.NAME"."""
    return {f"{part}.{name}": value for (part, name), value in _values(parts, settings).items()}


def _values(parts: Mapping[str, Model], settings: Sequence[str]) -> dict[tuple[str, str], float]:
    values: dict[tuple[str, str], float] = {}
    for setting in settings:
        full, _, text = setting.partition("=")
        part, _, name = full.strip().partition(".") if "" not in parts else ("", "", full.strip())
        if part not in parts:
            raise UserError(
                f"--set {setting}: expected {', '.join(parts)}, a dot, a parameter and a value, as in "
                "heart.C=1.2mL/mmHg"
            )
        if (part, name) in values:
            raise UserError(f"--set {full.strip()} is there twice; give it once")
        declared = {p.quantity.name: p.quantity for p in parts[part].parameters}
        if name not in declared:
            raise UserError(f"--set {setting}: {parts[part].name} has no parameter {name!r}{nearest(name, declared)}")
        values[part, name] = _value(setting, full.strip(), declared[name], text)
    return values


def _value(setting: str, name: str, q: Quantity, text: str) -> float:
    try:
        value = _truth(text) if q.type == "Boolean" else quantity(text, q.unit)
    except UnitError as problem:
        raise UserError(f"--set {setting}: {problem}; for example {name}={shown(q).replace(' ', '')}") from None
    low, high = q.minimum, q.maximum
    if not math.isfinite(value) or not q.allows(value):
        allowed = f"{'-inf' if low is None else low} to {'inf' if high is None else high}"
        unit = "" if q.unit == "1" else f" {q.unit}"
        raise UserError(f"--set {setting}: expected {allowed}{unit} but was given {value:g}")
    if q.type == "Integer" and value != int(value):
        raise UserError(f"--set {setting}: expected a whole number but was given {value:g}")
    return value


def _truth(text: str) -> float:
    """1.0 for "true" or "1", 0.0 for "false" or "0"."""
    known = {"true": 1.0, "1": 1.0, "false": 0.0, "0": 0.0}
    if text.strip().lower() not in known:
        raise UnitError(f"expected true or false but was given {text!r}")
    return known[text.strip().lower()]
