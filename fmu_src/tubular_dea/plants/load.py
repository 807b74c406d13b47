"""A plant by its name, or from a user's file: what `--plant` takes.

::

    load_plant("tube")                       a plant that is shipped
    load_plant("cascaded_tanks.py")          PLANT of that file
    load_plant("tanks.py:LINEAR")            another value of it
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import sympy

from ..errors import ArgumentError, UserError
from ..laws import moved_by, undefined
from ..model.declare import TIME, Model, nearest, rate
from ..model.dimensions import fault, per_second
from ..model.effect import Effect
from .faults import close_to, message
from .plant import Plant

SHIPPED = {"tube": "tube", "aorta": "aorta"}  # name: module beside this one
PLANT = "PLANT"


class PlantError(ArgumentError):
    """A plant that cannot be loaded; the text names the file, the line if there is one, and what was expected."""


def load_plant(text: str) -> Plant:
    """The plant that `text` names: a shipped one, or FILE.py[:NAME]; `PlantError` in one line where there is none."""
    if text in SHIPPED:
        return shipped(text)
    file, _, name = text.rpartition(":") if not text.endswith(".py") else (text, "", "")
    path = Path(file)
    if path.suffix != ".py":
        raise PlantError(
            "plant", f" {text}: expected FILE.py[:NAME] or a plant that is shipped{nearest(text, SHIPPED)}"
        )
    if not path.is_file():
        raise PlantError("plant", f" {text}: there is no file {path}")
    return _chosen(path, _imported(path), name or PLANT)


def shipped(name: str) -> Plant:
    """A plant of this package."""
    plant = importlib.import_module(f"{__package__}.{SHIPPED[name]}").PLANT
    assert isinstance(plant, Plant)
    return plant


def shipped_of(model: str) -> Plant | None:
    """The shipped plant whose model has that name."""
    return next((plant for plant in map(shipped, SHIPPED) if plant.name == model), None)


def _imported(path: Path) -> ModuleType:
    """The file's module, under a name of its own; its folder is searched for what it imports."""
    name = f"plant_{path.stem}_{hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:12]}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    folder = str(path.resolve().parent)
    sys.modules[name] = module
    sys.path.insert(0, folder)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as problem:
        sys.modules.pop(name, None)
        raise PlantError("", message(path, problem)) from None
    finally:
        sys.path.remove(folder)
    return module


def _chosen(path: Path, module: ModuleType, name: str) -> Plant:
    """The plant of that name in a module, with its catalogue made: what is wrong with a place shows now."""
    there = [n for n, value in vars(module).items() if isinstance(value, Plant)]
    if name not in vars(module):
        also = f"; the file has {', '.join(there)}: write {path.name}:{there[0]}" if there else ""
        raise PlantError("", f"{path}: expected a value {name} = Plant(...) but there is none{also}")
    value = vars(module)[name]
    if not isinstance(value, Plant):
        raise PlantError("", f"{path}: expected {name} to be a Plant but it is of type {type(value).__name__}")
    plant = replace(value, file=f"{path.name}:{name}")
    if equation := undefined(plant.model):
        raise PlantError(
            "",
            f"{path}: {equation} has no value at the start of {plant.model.name}, whatever the inputs (is something "
            "divided by 0 there?): write what it is there with sympy.Piecewise, or let the states start elsewhere",
        )
    _check_own(path, plant)
    try:
        _ = plant.catalogue
    except UserError as problem:
        raise PlantError("", f"{path}: {problem}") from None
    return plant


def _check_own(path: Path, plant: Plant) -> None:
    """`PlantError` unless the plant's own effects stand by their ids, can be added, and fit in their units."""
    if not isinstance(plant.own, Mapping):
        raise PlantError("", f"{path}: own: expected {{id: Effect}} but was given {plant.own!r}")
    ours = {id(effect) for name in SHIPPED for effect in shipped(name).own.values()} if plant.own else set()
    for name, effect in plant.own.items():
        if id(effect) in ours:  # as in a plant that is made from the tube
            continue
        if not isinstance(effect, Effect):
            raise PlantError("", f"{path}: own[{name!r}]: expected an Effect but was given {effect!r}")
        if effect.id != name:
            raise PlantError("", f"{path}: own[{name!r}]: expected the effect's id but this one has {effect.id!r}")
        if wrong := _mistyped(plant, effect):
            raise PlantError("", f"{path}: the effect {name}: channel: {effect.channel!r} is no other's{wrong}")
        try:
            changed = effect(plant.model)
            plant.with_model(changed)  # as a plant it is checked: an effect's parameters act, too
        except (Exception, SystemExit) as problem:
            raise PlantError("", f"{message(path, problem)} (in the effect {name})") from None
        if wrong := _unlike(plant.model, changed):
            raise PlantError("", f"{path}: the effect {name}: {wrong}")
        if moved := moved_by(plant.model, changed):
            given = ", ".join(f"{parameter} = {value:g}" for parameter, value in effect.off.items())
            wrong = f"with {given} it changes {moved}; expected values of `off` at which it does nothing"
            raise PlantError("", f"{path}: the effect {name}: {wrong}")


def _mistyped(plant: Plant, effect: Effect) -> str:
    """The channel or quantity that an effect's own channel is like, as a hint; "" where it is one, or like none."""
    signals = (*(o.channel for o in plant.outputs), *(i.channel for i in plant.inputs), *plant.latent)
    others = (e.channel for e in plant.own.values() if isinstance(e, Effect) and e is not effect)
    known = {*plant.model.quantities(), *(p.channel or p.name for p in plant.places), *signals, *others}
    return "" if effect.channel in known else close_to(effect.channel, sorted(known))


def _unlike(before: Model, after: Model) -> str:
    """What an effect made that is not in its declared unit; "" for nothing."""
    units = {q.symbol: q.unit for q in after.quantities().values()}
    known = {TIME: "s", **units} | {rate(q): per_second(q.unit) for q in after.inputs}
    there = _declared(before)
    found = (fault(*one, known) for one in _declared(after) if one not in there)
    return next(filter(None, found), "")


def _declared(model: Model) -> list[tuple[str, sympy.Expr, str]]:
    """Every expression of a model: what it is of, in words, itself, and the unit in which it should be."""
    said = [(d.quantity.name, d.expression, d.quantity.unit) for d in model.definitions]
    for s in model.states:
        said.append((f"d({s.quantity.name})/dt", s.derivative, per_second(s.quantity.unit)))
        said.append((f"the start of {s.quantity.name}", s.start, s.quantity.unit))
    return said
