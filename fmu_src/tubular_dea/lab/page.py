"""One HTML file: the page's own files, the facts of its models, and the compiled models, joined."""

from __future__ import annotations

import base64
import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from .. import __version__
from ..cosim.beats import EARLY, EJECTING, INDICES, shown
from ..cosim.course import COUNTS, FATES, SETTLED, SETTLING
from ..cosim.heart_assist import models as heart_models
from ..emit.variables import guid
from ..errors import UserError
from ..export.compile import native_source
from ..export.package import KERNEL_SOURCES, core_sources, one_unit
from ..export.remembered import fingerprint
from ..export.wasm import remembered_module, wasm_module
from ..files import write_atomically
from ..model.dea import tubular_dea
from ..model.declare import Model
from ..model.delays import undelayed
from ..model.effect import Effect, with_effects
from ..model.patients import PATIENTS
from ..model.starts import started
from ..model.windkessel import patient
from ..plants.plant import Input, Output, Plant
from ..plants.tube import PLANT
from .coupling import EXPORTS, OPTIONS, VARIABLE, coupling, signals_of
from .facts import model_facts, part_facts
from .recorded import Carried
from .vocabulary import vocabulary

LARGEST = 1_500_000  # bytes of a page
SHARED = ("engine.js", "beats.js")  # both of the page and of its worker
SCRIPTS = (
    "state.js",
    "format.js",
    "plots.js",
    "takeaway.js",
    "controls.js",
    "work.js",
    "drawing.js",
    "tube.js",
    "ecg.js",
    "heart.js",
    "map.js",
    "units.js",
    "cells.js",
    "layout.js",
    "reading.js",
    "bench.js",
    "data.js",
    "main.js",
)
TUBE_SIGNALS = {"tube_flow", "radial_displacement", "snap_through_margin", "electric_field", "charge"}


class PageError(UserError, ValueError):
    """A page that cannot be made as asked."""


@dataclass(frozen=True)
class Setting:
    """Named parameter values (SI units) that the page can switch to, as "before" and "after"."""

    name: str
    values: Mapping[str, float]


@dataclass(frozen=True)
class Content:
    """What a page opens with: plant and model, values to switch between, recordings, a first state.

    `patients` (SI units) come beside the known ones, under the name or file that the command takes; `r_times` [s] are
    recorded beats; `own` are start values of each recording by its name (SI units). `model_file`, `plant_file` and
    `data` are how the copied commands call what the page was made from.
    """

    plant: Plant = PLANT
    model: Model = field(default_factory=tubular_dea)
    settings: Sequence[Setting] = ()
    recordings: Carried = field(default_factory=lambda: Carried({}, {}))
    geometry: Mapping[str, float] = field(default_factory=dict)
    patients: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    r_times: Sequence[float] = ()
    model_file: str = ""
    plant_file: str = ""
    data: str = ""
    state: Mapping[str, Any] = field(default_factory=dict)
    own: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def write(path: Path, content: Content) -> Path:
    """The page, as a file that is there whole or not at all."""
    return write_atomically(path, page(content).encode("utf-8"))


def page(content: Content) -> str:
    """The text of the page. `PageError` where it would be larger than 1.5 MB: fewer recordings, then."""
    models = _Models.of(content)
    facts = _facts(content, models)
    made = _file("page.html")
    for mark, text in {
        "STYLE": _file("vendor/uPlot.min.css") + _file("style.css"),
        "LICENCE": _file("vendor/uPlot.LICENSE"),
        "PLOTS": _file("vendor/uPlot.iife.min.js"),
        "SHARED": "".join(map(_file, SHARED)),
        "WORKER": _file("worker.js"),
        "SCRIPT": '(() => {\n"use strict";\n' + "".join(map(_file, SCRIPTS)) + "})();\n",
        "FACTS": json.dumps(facts, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"),
        "WASM": base64.b64encode(_module(models)).decode(),
        "TITLE": f"{content.model.name} lab",
    }.items():
        made = made.replace(f"<!--{mark}-->", text)
    if len(made.encode()) > LARGEST:
        raise PageError(
            f"lab: the page would have {len(made.encode()) / 1e6:.2f} MB; expected at most {LARGEST / 1e6:g} MB: give "
            "fewer recordings (the page reads others that are dropped on it)"
        )
    return made


def is_tube(model: Model) -> bool:
    """Whether the model can be drawn as a tube and coupled to a heart."""
    return set(model.outputs) >= TUBE_SIGNALS and [q.name for q in model.inputs] == ["pressure", "voltage"]


@dataclass(frozen=True)
class _Models:
    """What is compiled: the model, and it with all effects, at their declared values (the page hands over its own).

    So the compiled module is the same whatever was identified. `parts` of the assisted heart are there for a tube.
    """

    shown: Model
    model: Model
    everything: Model
    parts: Mapping[str, Model]

    @classmethod
    def of(cls, content: Content) -> _Models:
        plant = content.plant
        missing = [name for name in plant.catalogue if name not in content.model.effects]
        plain = with_effects(plant.model, content.model.effects, plant.catalogue)
        declared = started(plain, content.model.parameter_values())  # of the same parameters in the same order
        parts = heart_models(paced=True, tube=declared) if is_tube(declared) else {}
        everything = with_effects(declared, missing, plant.catalogue)
        return cls(everything.with_values(content.model.parameter_values()), declared, everything, parts)


def _module(models: _Models) -> bytes:
    """Kernels of the model and of the one with all effects; the assisted heart."""
    made_by = [fingerprint(), *(_folder_hash(name) for name in ("lab", "cosim"))]
    compiled = (models.model, models.everything, *models.parts.values())
    key = repr((made_by, [guid(model, "wasm") for model in compiled]))
    return remembered_module(key, lambda: _compiled(models))


def _compiled(models: _Models) -> bytes:
    heart = coupling(models.parts) if models.parts else None
    kernel = {name: native_source(name) for name in KERNEL_SOURCES}
    parts = dict(heart.sources) if heart else {"tube_": core_sources(models.model)}
    parts["tube_"] = {**parts["tube_"], **kernel}
    parts["all_"] = core_sources(undelayed(models.everything)[0]) | kernel
    functions = [f"{part}kernel_{f}" for part in ("tube_", "all_") for f in ("trajectory", "curve")]
    exports = ("malloc", "free", *functions, *(EXPORTS if heart else ()))
    units = {prefix: one_unit(sources) for prefix, sources in parts.items()}
    return wasm_module(units, heart.shared if heart else {}, exports)


def _folder_hash(name: str) -> str:
    """Of the files of a folder of this package that have to do with what is compiled."""
    found = hashlib.sha256()
    for path in sorted((resources.files("tubular_dea") / name).iterdir(), key=lambda p: p.name):
        if path.name.endswith((".py", ".c")):
            found.update(path.name.encode() + b"\0" + path.read_bytes())
    return found.hexdigest()


def _facts(content: Content, models: _Models) -> dict[str, Any]:
    facts: dict[str, Any] = {
        "version": __version__,
        "tube": model_facts(content.model),
        "settings": [{"name": s.name, "values": dict(s.values)} for s in content.settings],
        "recordings": content.recordings.texts,
        "thinned": content.recordings.thinned,
        "geometry": dict(content.geometry),
        "own": {name: dict(values) for name, values in content.own.items()},
        "modelFile": content.model_file,
        "plantFile": content.plant_file,
        "data": content.data,
        "state": dict(content.state),
        "isTube": bool(models.parts),
        "all": model_facts(models.shown),
        "effects": [_effect(effect) for effect in content.plant.catalogue.values()],
        "bench": _bench(content.plant),
        "vocabulary": vocabulary(),
    }
    if not models.parts:
        return facts
    order, signals = signals_of(models.parts)
    patients = {name: patient(name) for name in PATIENTS} | {n: dict(v) for n, v in content.patients.items()}
    return facts | {
        "heart": {
            "order": order,
            "signals": signals,
            "parts": {part: part_facts(content.model if part == "tube" else m) for part, m in models.parts.items()},
            "patients": patients,
            "rTimes": list(content.r_times),
            "step": 2 * OPTIONS.step,
            "longest": VARIABLE.step,
            "tolerance": VARIABLE.tolerance,
            "figures": [
                {"name": f.name, "label": f.label, "unit": f.unit, "si": f.si, "worse": f.worse, "factor": 1 / shown(f)}
                for f in INDICES
            ],
            "early": EARLY,
            "ejecting": EJECTING,
            "settling": SETTLING,
            "settled": SETTLED,
            "fates": FATES,
            "counts": COUNTS,
        }
    }


def _effect(effect: Effect) -> dict[str, Any]:
    return {
        "id": effect.id,
        "channel": effect.channel,
        "summary": effect.summary,
        "off": dict(effect.off),
        "typical": dict(effect.typical),
        "on": dict(effect.on),
        "fit": list(effect.fit),
        "parameters": [q.name for q in effect.parameters],
    }


def _bench(plant: Plant) -> dict[str, Any]:
    """What a recording of the plant looks like: signals, what is plausible, how long and how fine."""

    def signal(s: Input | Output) -> dict[str, Any]:
        limits = {"zero": s.known_zero, "least": s.least, "most": s.most if math.isfinite(s.most) else None}
        quantity = plant.quantity(s.name)
        return limits | {"name": s.name, "unit": quantity.unit, "usual": quantity.nominal}

    return {
        "inputs": [signal(s) | {"held": s.held} for s in plant.inputs],
        "outputs": [
            signal(o)
            | {"columns": {h: o.columns.get(h, "") for h in o.headings}, "multiples": {**o.multiples}}
            | {"rest": o.rest, "required": o.required}
            for o in plant.outputs
        ],
        "header": plant.headers(),
        "leastSamples": plant.least_samples,
        "shortest": plant.shortest,
        "coarsest": plant.coarsest if math.isfinite(plant.coarsest) else None,
    }


def _file(name: str) -> str:
    return (resources.files("tubular_dea") / "lab" / "web" / name).read_text(encoding="utf-8")
