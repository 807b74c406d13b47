"""The initial content of the page that a command writes beside its report: an identified tube, an assisted heart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..identify.records.experiment import Recordings
from ..model.declare import Model
from .facts import quantity_facts
from .page import Content, Setting
from .recorded import carried

BEFORE, PUBLISHED = "before: refitted without effects", "as declared"


def closed_loop(
    recordings: Recordings,
    model: Model,
    before: Mapping[str, float],
    paths: Mapping[str, str],
    own: Mapping[str, Mapping[str, float]],
) -> Content:
    """The found model over its recordings; the refitted base model and the declared one to switch to.

    `paths` tell how the copied commands call `model` and `data`, `own` where each recording begins.
    """
    plant, found = recordings.plant, set(model.parameter_values())
    off = {name: value for effect in model.effects for name, value in plant.catalogue[effect].off.items()}
    declared = {n: v for n, v in plant.model.parameter_values().items() if n in found}
    known = {name: value for name, value in before.items() if name in found}
    settings = (Setting(BEFORE, declared | known | off), Setting(PUBLISHED, declared | off))
    return Content(
        plant=plant,
        model=model,
        settings=settings,
        recordings=carried(recordings),
        geometry=recordings.geometry,
        model_file=paths["model"],
        data=paths["data"],
        state={"view": "data"},
        own={name: {n: v for n, v in values.items() if n in found} for name, values in own.items()},
    )


def assisted_heart(
    parts: Mapping[str, Model],
    patient: tuple[str, Mapping[str, float]],
    settings: Mapping[str, float],
    beats: int,
    r_times: Sequence[float] = (),
    model_file: str = "",
) -> Content:
    """The assisted heart as it was run: `patient` by name or file with its values, `settings` by "part.name" (SI)."""
    changed: dict[str, Any] = {}
    for name, value in settings.items():
        part, _, parameter = name.partition(".")
        declared = next((p.quantity for p in parts[part].parameters if p.quantity.name == parameter), None)
        if declared is not None:
            changed[name] = float(f"{value / quantity_facts(declared)['factor']:.12g}")
    heart = {"patient": patient[0], "beats": beats, "set": changed} | ({"rhythm": "recorded"} if len(r_times) else {})
    return Content(
        model=parts["tube"],
        patients={patient[0]: patient[1]},
        r_times=tuple(map(float, r_times)),
        model_file=model_file,
        state={"view": "heart", "heart": heart},
    )
