"""A model with its effects and parameter values as a readable JSON file, and back.

::

    {"format": 1, "model": "TubularDEA", "plant": "", "effects": ["electrode_resistance"],
     "parameters": {"C_1": {"value": 331000.0, "unit": "Pa", "description": "..."}, ...},
     "covariance": {"names": ["C_1", "eps_r"], "matrix": [[...], [...]]}}

The covariance (SI units) of identified parameters is there where the model was fitted; sweeps propagate it. `plant`
names the file that declares a plant which is not shipped: such a model is loaded with its plant (`--plant FILE.py`).
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import UserError
from ..files import read_whole
from ..model.declare import DeclarationError, Model, nearest
from ..model.effect import with_effects
from ..model.starts import started
from ..model.units import UnitError, factor
from .load import PLANT, SHIPPED, shipped, shipped_of
from .plant import Plant

FORMAT = 1


class ModelFileError(UserError, ValueError):
    """A model file that cannot be read; the text says what was expected where."""


def as_json(
    model: Model, note: str = "", covariance: dict[str, list[Any]] | None = None, plant: Plant | None = None
) -> str:
    """The model as text: base, the file of a plant that is not shipped, effects in their order, every parameter's
    value, and the covariance of some."""
    parameters = {
        p.quantity.name: {"value": p.quantity.value, "unit": p.quantity.unit, "description": p.quantity.description}
        for p in model.parameters
    }
    content = {
        "format": FORMAT,
        "model": model.name,
        "plant": plant.file if plant else "",
        "note": note,
        "effects": list(model.effects),
        "parameters": parameters,
    } | ({"covariance": covariance} if covariance else {})
    return json.dumps(content, indent=2, allow_nan=False) + "\n"


def load(path: Path, plant: Plant | None = None) -> Model:
    """The model of a file, of `plant` or of one that is shipped; `ModelFileError` that names what is wrong."""
    if not path.exists():
        raise ModelFileError(f"there is no file {path}")
    try:
        content = json.loads(read_whole(path).decode())
    except (OSError, ValueError, RecursionError) as problem:
        raise ModelFileError(f"{path}: cannot be read as JSON: {problem}") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ModelFileError(
            f'{path}: expected an object with "format": {FORMAT}, as in a model.json of an identified model'
        )
    name, effects = content.get("model"), content.get("effects", [])
    base = _base(path, name, str(content.get("plant") or ""), plant)
    if not isinstance(effects, list) or not all(isinstance(e, str) for e in effects):
        raise ModelFileError(f'{path}: expected "effects" to be a list of effect ids')
    try:
        model = with_effects(base.model, effects, base.catalogue)
    except DeclarationError as problem:
        raise ModelFileError(f"{path}: {problem}") from None
    given = content.get("parameters", {})
    model = started(model, given if isinstance(given, dict) else ())
    values = _values(path, model, given)
    _check_covariance(path, content.get("covariance"), values)
    return model.with_values(values)


def _base(path: Path, name: Any, file: str, plant: Plant | None) -> Plant:
    """The plant that a file starts from."""
    if plant is not None and plant.name == name:
        return plant
    found = shipped_of(name) if isinstance(name, str) and not file else None
    if found is not None:
        return found
    if plant is not None and file:
        raise ModelFileError(
            f"{path}: expected a model of {plant.name} but found one of {name!r}, which is declared in {file}: "
            f"give that file as the plant, as in --plant {file.partition(':')[0]}"
        )
    if file:
        where = _beside(path, file)
        raise ModelFileError(
            f"{path}: its plant {name!r} is declared in {file}; give that file as the plant (--plant {where})"
        )
    if plant is not None:
        raise ModelFileError(f"{path}: expected a model of {plant.name} but found one of {name!r}")
    raise ModelFileError(f"{path}: there is no model {name!r}{nearest(str(name), [shipped(n).name for n in SHIPPED])}")


def _beside(path: Path, file: str) -> str:
    """The plant's file as an option names it: where it lies, beside the model's file, its folder, or here; else as
    the model's file has it."""
    file = file.removesuffix(f":{PLANT}")
    source, _, name = file.partition(".py:")
    for folder in (Path(), path.parent, path.parent.parent):
        found = folder / (f"{source}.py" if name else file)
        if found.is_file():
            return f"{found}:{name}" if name else str(found)
    return file


def _check_covariance(path: Path, covariance: Any, values: Mapping[str, float]) -> None:
    """Refuse a covariance of parameters whose values the file lacks: they were found together."""
    names = covariance.get("names") if isinstance(covariance, dict) else None
    missing = [n for n in names if n not in values] if isinstance(names, list) else []
    if missing:
        raise ModelFileError(
            f'{path}: expected "parameters" to have {missing[0]}, as "covariance" has it: these values were found '
            "together"
        )


def _values(path: Path, model: Model, given: Any) -> dict[str, float]:
    if not isinstance(given, dict):
        raise ModelFileError(f'{path}: expected "parameters" to be an object of name: {{"value": ..., "unit": ...}}')
    declared = {p.quantity.name: p.quantity for p in model.parameters}
    values = {}
    for name, entry in given.items():
        if name not in declared:
            raise ModelFileError(f"{path}: {model.name} has no parameter {name!r}{nearest(name, declared)}")
        value = entry.get("value") if isinstance(entry, dict) else entry
        unit = entry.get("unit", declared[name].unit) if isinstance(entry, dict) else declared[name].unit
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= sys.float_info.max:
            raise ModelFileError(f"{path}: {name}: expected a finite number but found {value!r}")
        if not isinstance(unit, str):
            raise ModelFileError(f"{path}: {name}: expected a unit like {declared[name].unit!r} but found {unit!r}")
        try:
            values[name] = value if unit == declared[name].unit else value * factor(unit, declared[name].unit)
        except UnitError as problem:
            raise ModelFileError(f"{path}: {name}: {problem}") from None
        q = declared[name]
        if not q.allows(values[name]):
            raise ModelFileError(f"{path}: {name}: expected {q.allowed} but found {values[name]:g}")
    return values
