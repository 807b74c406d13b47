"""The tube's own effects, which are more than a law at a place, each in a file of its own and found by its presence.

Usage::

    from tubular_dea.plants.effects import catalogue
    catalogue()["electrode_resistance"].documentation
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from types import MappingProxyType

from ...model.declare import DeclarationError, Model
from ...model.effect import Effect
from ...model.effect import with_effects as added

RECORDING = ("pressure", "sensor")  # channels of monitors and sensors: before or behind the tube


def catalogue() -> Mapping[str, Effect]:
    """All candidate effects of the tube: its own, and laws at its places."""
    from ..tube import PLANT  # which imports the effects of this folder

    return PLANT.catalogue


@cache
def own() -> Mapping[str, Effect]:
    """The tube's own effects by id, in alphabetical order of the files."""
    found = {}
    for module in sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")):
        loaded = importlib.import_module(f"{__name__}.{module}")
        effect = loaded.EFFECT
        text = (loaded.__doc__ or "").strip()
        found[module] = replace(effect, documentation=text, recording=effect.channel in RECORDING)
        if found[module].id != module:
            raise DeclarationError(f"effects/{module}.py: expected the effect {module!r}, not {found[module].id!r}")
    return MappingProxyType(found)


def with_effects(model: Model, ids: Sequence[str]) -> Model:
    """The tube with the effects `ids` added in that order; `DeclarationError` for an id that is not known."""
    return added(model, ids, catalogue())
