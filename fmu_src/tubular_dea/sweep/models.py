"""The models a plan may name: the package's own, a calibrated `model.json`, or an FMU made elsewhere."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..model.compose import compose
from ..model.dea import tubular_dea
from ..model.declare import Model, nearest
from ..model.effects import with_effects
from ..model.saved import ModelFileError, load
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
        model = load(path)
        given = json.loads(path.read_text(encoding="utf-8")).get("covariance")
    except ModelFileError as problem:
        raise PlanError(str(problem)) from None
    try:
        return model, _joint(model, given["names"], given["matrix"]) if given else None
    except (ValueError, KeyError, TypeError) as problem:
        raise PlanError(f"{path}: covariance: {problem}; expected names, and a matrix with a row for each") from None


def _joint(model: Model, names: list[str], matrix: list[list[float]]) -> Joint:
    covariance, values = np.array(matrix, float), model.parameter_values()
    if covariance.shape != (len(names), len(names)):
        raise ValueError(f"there are {len(names)} names and a matrix of shape {covariance.shape}")
    scale = np.sqrt(np.diag(covariance))
    if not np.all(scale > 0):
        raise ValueError("a variance is not positive")
    try:
        factor = np.linalg.cholesky(covariance / np.outer(scale, scale) + 1e-12 * np.eye(len(names))) * scale[:, None]
    except np.linalg.LinAlgError:
        raise ValueError("the matrix is not positive definite") from None
    columns = tuple((name, model.quantity(name).unit) for name in names)
    return Joint("calibration", columns, tuple(values[n] for n in names), tuple(map(tuple, factor.tolist())))
