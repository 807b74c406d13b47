"""The catalogue of physical effects that the paper's model lacks: one file each, found by their presence.

An effect is a function Model -> Model that declares its parameters and the values at which it is off, so that every
candidate is nested in the model it is added to. Usage::

    from tubular_dea.model.dea import tubular_dea
    from tubular_dea.model.effects import catalogue

    lag = catalogue()["electrode_resistance"]
    model = lag(tubular_dea())                      # off: the same trajectories as the base
    model = model.with_values(lag.typical)          # of typical size
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from types import MappingProxyType

from ..declare import DeclarationError, Model, Parameter, Quantity

CHANNELS = ("electrical", "mechanical", "pressure", "sensor")
Values = Mapping[str, float]


@dataclass(frozen=True)
class Effect:
    """A physical effect as a change of a model.

    `parameters` are declared as tunable parameters of the model, with the default `off` for those listed there.
    An effect is off where its parameters have the values `off`, whatever the others are. `typical` has a value of
    every parameter at which the effect has its usual size.

    For identification: the response to the `off` parameters is taken at each point of the grid `shapes` (parameters
    that mean nothing while the effect is off). `on` are values that are held while the others are fitted: the share
    of a lag, say, is 1. `fit` names what is identified; `refine` what may be freed after that if the record asks for
    a slightly different form. An `exact` effect has but one form: what it leaves over is something else.
    """

    id: str
    channel: str
    summary: str
    apply: Callable[[Model], Model]
    parameters: tuple[Quantity, ...]
    off: Values
    typical: Values
    shapes: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    on: Values = field(default_factory=dict)
    refine: tuple[str, ...] = ()
    exact: bool = False
    documentation: str = ""

    def __post_init__(self) -> None:
        names = {q.name for q in self.parameters}
        for mentioned in (self.off, self.typical, self.shapes, self.on, self.refine):
            if not set(mentioned) <= names:
                raise DeclarationError(f"{self.id}: expected its own parameters but was given {set(mentioned) - names}")
        if self.channel not in CHANNELS:
            raise DeclarationError(f"{self.id}: expected a channel of {', '.join(CHANNELS)}, not {self.channel}")

    @property
    def fit(self) -> tuple[str, ...]:
        """The parameters that are identified: all that are neither held (`on`) nor kept for refinement."""
        return tuple(q.name for q in self.parameters if q.name not in self.on and q.name not in self.refine)

    @property
    def amplitudes(self) -> tuple[str, ...]:
        """The parameters whose sensitivity at `off` is the effect's first-order response."""
        return tuple(name for name in self.off if name not in self.refine)

    def __call__(self, model: Model) -> Model:
        """`model` with the effect in it, and off; `DeclarationError` if it is in there already."""
        if self.id in model.effects:
            raise DeclarationError(f"{model.name} has the effect {self.id!r} already; it cannot be added twice")
        declared = [Parameter(replace(q, value=self.off.get(q.name, q.value)), tunable=True) for q in self.parameters]
        return self.apply(model.extend(parameters=declared)).marked(self.id)


@cache
def catalogue() -> Mapping[str, Effect]:
    """Every effect by its id, in alphabetical order of the files."""
    found = {}
    for module in sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")):
        loaded = importlib.import_module(f"{__name__}.{module}")
        found[module] = replace(loaded.EFFECT, documentation=(loaded.__doc__ or "").strip())
        if found[module].id != module:
            raise DeclarationError(f"effects/{module}.py: expected the effect {module!r}, not {found[module].id!r}")
    return MappingProxyType(found)


def with_effects(model: Model, ids: tuple[str, ...] | list[str]) -> Model:
    """The model with the effects `ids` added in that order; `DeclarationError` for an id that is not known."""
    from ..declare import nearest

    for name in ids:
        if name not in catalogue():
            raise DeclarationError(f"there is no effect {name!r}{nearest(name, catalogue())}")
        model = catalogue()[name](model)
    return model
