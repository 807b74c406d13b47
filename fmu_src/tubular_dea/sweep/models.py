"""The models a plan may name: the package's own, a plant's file, a calibrated `model.json`, an FMU made elsewhere."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..files import FileError, read_whole
from ..model.compose import compose
from ..model.dea import tubular_dea
from ..model.declare import Model, nearest
from ..model.effect import with_effects as added
from ..model.windkessel import aortic_windkessel
from ..plants.effects import with_effects
from ..plants.load import SHIPPED, PlantError, load_plant
from ..plants.plant import Plant
from ..plants.saved import ModelFileError, load
from .axes import Joint
from .expression import PlanError


@dataclass(frozen=True)
class ExternalFmu:
    """An FMU as it is: its name and its bytes, so that any worker can run it."""

    name: str
    content: bytes

    def __repr__(self) -> str:
        from hashlib import sha256

        return f"ExternalFmu({self.name!r}, {sha256(self.content).hexdigest()})"


def assisted_heart(tube: Model | None = None) -> Model:
    """The tube on the aorta behind the ventricle, as one system of equations; its input is `tube_voltage`.

    `tube` takes the place of the paper's.
    """
    parts = {"tube": tube or tubular_dea(), "heart": aortic_windkessel()}
    wires = [("heart.aortic_pressure", "tube.pressure"), ("tube.tube_flow", "heart.tube_flow")]
    return compose("AssistedHeart", parts, wires)


MODELS: dict[str, Callable[[], Model]] = {
    "TubularDEA": tubular_dea,
    "AorticWindkessel": aortic_windkessel,
    "AssistedHeart": assisted_heart,
}


def resolve(
    given: object, effects: tuple[str, ...], folder: Path, tube: object = None, plant: Plant | None = None
) -> Model | ExternalFmu:
    """The model that a plan names; `PlanError` with what there is otherwise.

    `tube` is a file with the tube of the assisted heart, `plant` what a model.json is of that is no shipped plant's.
    """
    if tube is not None:
        if given != "AssistedHeart" or not isinstance(tube, str):
            raise PlanError(f'tube: expected a model.json beside model = "AssistedHeart" but was given {tube!r}')
        return assisted_heart(with_effects(calibrated(folder / tube)[0], effects))
    if isinstance(given, Model | ExternalFmu):
        return added(plant.model, effects, plant.catalogue) if plant and given is plant.model else given
    if not isinstance(given, str):
        raise PlanError(f"model: expected a name or a file but was given {given!r}")
    if given in MODELS:
        return with_effects(MODELS[given](), effects)
    path = folder / given
    if given in SHIPPED or ".py" in path.name:
        return _of_plant(given if given in SHIPPED else str(path), effects)
    if path.suffix == ".json":
        model, _ = calibrated(path, plant)
        return added(model, effects, plant.catalogue) if plant else with_effects(model, effects)
    if path.suffix == ".fmu":
        if effects:
            raise PlanError(f"effects: {given} is an FMU made elsewhere; effects go into the package's own models")
        return _external(path)
    also = "or a model.json, FILE.py[:NAME] or .fmu file"
    raise PlanError(f"model: there is no {given!r}{nearest(given, [*SHIPPED, *MODELS])}, {also}")


def _external(path: Path) -> ExternalFmu:
    try:
        return ExternalFmu(path.name, read_whole(path))
    except FileError as problem:
        raise PlanError(f"model: {problem}") from None


def _of_plant(file: str, effects: tuple[str, ...]) -> Model:
    """The model of a plant's file, with effects of its catalogue."""
    try:
        plant = load_plant(file)
    except PlantError as problem:
        raise PlanError(f"model: {problem}") from None
    return added(plant.model, effects, plant.catalogue)


def of_file(given: object, folder: Path) -> Plant | None:
    """The plant that a plan's entry names, FILE.py[:NAME]; None without an entry."""
    if given is None:
        return None
    if not isinstance(given, str) or ".py" not in given:
        raise PlanError(f"plant: expected FILE.py[:NAME] but was given {given!r}")
    try:
        return load_plant(str(folder / given))
    except PlantError as problem:
        raise PlanError(str(problem)) from None


def calibrated(path: Path, plant: Plant | None = None) -> tuple[Model, Joint | None]:
    """The model of a `model.json` (of `plant`) at its identified values, and their joint distribution if it has a
    covariance."""
    try:
        model = load(path, plant)
        given = json.loads(read_whole(path)).get("covariance")
    except (ModelFileError, FileError) as problem:
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
