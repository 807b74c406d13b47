"""The models a plan may name: the package's own, a calibrated `model.json`, or an FMU made elsewhere."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import UserError
from ..model.compose import compose
from ..model.dea import tubular_dea
from ..model.declare import Model, nearest
from ..model.effects import with_effects
from ..model.units import factor
from ..model.windkessel import aortic_windkessel
from .axes import Joint
from .expression import PlanError


@dataclass(frozen=True)
class ForeignFmu:
    """An FMU as it is: its name and its bytes, so that any worker can run it."""

    name: str
    content: bytes

    def __repr__(self) -> str:
        from hashlib import sha256

        return f"ForeignFmu({self.name!r}, {sha256(self.content).hexdigest()})"


def assisted_heart() -> Model:
    """The tube on the aorta behind the ventricle, as one system of equations; its input is `tube_voltage`."""
    parts = {"tube": tubular_dea(), "heart": aortic_windkessel()}
    wires = [("heart.aortic_pressure", "tube.pressure"), ("tube.tube_flow", "heart.tube_flow")]
    return compose("AssistedHeart", parts, wires)


MODELS: dict[str, Callable[[], Model]] = {
    "TubularDEA": tubular_dea,
    "AorticWindkessel": aortic_windkessel,
    "AssistedHeart": assisted_heart,
}


def resolve(given: object, effects: tuple[str, ...], folder: Path) -> Model | ForeignFmu:
    """The model that a plan names; `PlanError` with what there is otherwise."""
    if isinstance(given, Model | ForeignFmu):
        return given
    if not isinstance(given, str):
        raise PlanError(f"model: expected a name or a file but was given {given!r}")
    if given in MODELS:
        return with_effects(MODELS[given](), effects)
    path = folder / given
    if path.suffix == ".json":
        return with_effects(calibrated(path)[0], effects)
    if path.suffix == ".fmu":
        if effects:
            raise PlanError(f"effects: {given} is an FMU made elsewhere; effects go into the package's own models")
        try:
            return ForeignFmu(path.name, path.read_bytes())
        except OSError as problem:
            raise PlanError(f"model: {path}: cannot be read: {problem.strerror}") from None
    raise PlanError(f"model: there is no {given!r}{nearest(given, MODELS)}, or a model.json or .fmu file")


def calibrated(path: Path) -> tuple[Model, Joint | None]:
    """The model of a `model.json` at its identified values, and their joint distribution if it has a covariance."""
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        model = with_effects(MODELS[content.get("model", "TubularDEA")](), list(content.get("effects", [])))
        values = {name: _value(name, v, model.quantity(name).unit) for name, v in content["parameters"].items()}
        model = model.with_values(values)
        return model, _joint(model, content, values)
    except UserError:
        raise
    except OSError as problem:
        raise PlanError(f"{path}: cannot be read: {problem.strerror}") from None
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as problem:
        raise PlanError(f"{path}: cannot be read as a model.json: {problem!r}") from None


def _value(name: str, entry: Any, unit: str) -> float:
    """A parameter in SI units; entries may name a unit of their own."""
    value, given = (entry["value"], entry.get("unit", unit)) if isinstance(entry, dict) else (entry, unit)
    value = float(value) * (1.0 if given == unit else factor(str(given), unit))
    if not math.isfinite(value):
        raise PlanError(f"{name}: expected a finite number but found {value!r}")
    return value


def _joint(model: Model, content: dict[str, Any], values: dict[str, float]) -> Joint | None:
    given = content.get("covariance")
    if not given:
        return None
    names, matrix = (given["names"], given["matrix"]) if isinstance(given, dict) else (list(values), given)
    covariance = np.array(matrix, float)
    if covariance.shape != (len(names), len(names)):
        raise PlanError(f"covariance: expected {len(names)} rows and columns but found shape {covariance.shape}")
    scale = np.sqrt(np.diag(covariance))
    if not np.all(scale > 0):
        raise PlanError("covariance: expected positive variances")
    try:
        factor = np.linalg.cholesky(covariance / np.outer(scale, scale) + 1e-12 * np.eye(len(names))) * scale[:, None]
    except np.linalg.LinAlgError:
        raise PlanError("covariance: expected a positive definite matrix") from None
    columns = tuple((name, model.quantity(name).unit) for name in names)
    return Joint("calibration", columns, tuple(values[n] for n in names), tuple(map(tuple, factor.tolist())))
