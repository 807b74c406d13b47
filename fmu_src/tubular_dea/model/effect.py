"""An effect: a function Model -> Model that declares its parameters and the values at which it is off.

So every candidate is nested in the model it is added to. The tube's own effects stand in `plants/effects`, laws that
may act at the places of any plant in `laws`. Usage::

    lag = plant.catalogue["electrode_resistance"]
    model = lag(plant.model)                        # off: the same trajectories as the base
    model = model.with_values(lag.typical)          # of typical size
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from .declare import DeclarationError, Model, Parameter, Quantity, nearest, unchecked

Values = Mapping[str, float]


@dataclass(frozen=True)
class Effect:
    """A physical effect as a change of a model.

    `parameters` are declared as tunable parameters of the model, with the default `off` for those listed there; others
    without a value have that in `typical`.
    An effect is off where its parameters have the values `off`, whatever the others are. `typical` has a value of
    every parameter at which the effect has its usual size.

    For identification: the response to the `off` parameters is taken at each point of the grid `shapes` (parameters
    without influence while the effect is off). `on` are values that are held while the others are fitted: the share
    of a lag, for example, is 1. `fit` names what is identified; `refine` what may be freed after that if the record
    asks for a slightly different form. Where the response turns with an amplitude (the pitch of a ringing with a
    mass), the tangent at `off` does not see it: `strengths` are distances from `off` at which the chord is taken
    beside it. `trades` says how a parameter of the grid changes if a share of an effect is replaced by the whole
    effect: by this power of the share (1: a lag's time constant, -1: a rate limit). What is `hard` may be as large as
    it likes: a rim over which all runs at once, a wall. An `exact` effect has only one form: a remaining residual has
    another cause. The finer form of a `delicate` one follows the noise of recorded inputs (it wears friction down): it
    is tried only where the coarse one leaves more than noise. `channel` says where it acts, by the plant's own names;
    `recording` that it is a fault of a monitor or sensor, not of the plant; `lasting` that what it changes outlasts a
    record.
    `levels` are parameters that a state has to pass, or the effect is another one: a stop that always holds is a
    spring. `limits` are the ids of effects that are limits of this one: where it explains no more, they are told alone.
    `curve` is how reports show the effect alone: "x over y" or "x", the definition x over an input or state y
    that it depends on (default: what `alone` finds in the declaration).
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
    strengths: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    trades: Values = field(default_factory=dict)
    hard: tuple[str, ...] = ()
    exact: bool = False
    recording: bool = False
    lasting: bool = False
    delicate: bool = False
    documentation: str = ""
    curve: str = ""
    levels: Mapping[str, str] = field(default_factory=dict)
    limits: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.parameters, Sequence):
            raise DeclarationError(
                f"{self.id}: parameters: expected a tuple of Quantity, as (Quantity(...),), but was given "
                f"{type(self.parameters).__name__}"
            )
        if not self.off:
            raise DeclarationError(f"{self.id}: off: expected a parameter with the value at which there is no effect")
        names = {q.name for q in self.parameters}
        shaped = (self.shapes, self.strengths, self.trades, self.levels)
        for mentioned in (self.off, self.typical, self.on, self.refine, self.hard, *shaped):
            if not set(mentioned) <= names:
                raise DeclarationError(f"{self.id}: expected its own parameters but was given {set(mentioned) - names}")
        if missing := sorted(names - set(self.typical)):
            raise DeclarationError(f"{self.id}: typical: expected a usual value of every parameter, also {missing[0]}")
        for q in self.parameters:
            low, high = (-math.inf if q.minimum is None else q.minimum), (math.inf if q.maximum is None else q.maximum)
            if not low <= self.typical[q.name] <= high:
                raise DeclarationError(
                    f"{self.id}: typical: {q.name}: expected {f'{low:g} to {high:g} {q.unit}'.removesuffix(' 1')}, the "
                    f"parameter's bounds, but was given {self.typical[q.name]:g}"
                )

    @property
    def fit(self) -> tuple[str, ...]:
        """The parameters that are identified: all that are neither held (`on`) nor kept for refinement."""
        return tuple(q.name for q in self.parameters if q.name not in self.on and q.name not in self.refine)

    @property
    def amplitudes(self) -> tuple[str, ...]:
        """The parameters whose sensitivity at `off` is the effect's first-order response."""
        return tuple(name for name in self.off if name not in self.refine)

    @property
    def equation(self) -> str:
        """The equation in the documentation, with what is said of it; "" without one."""
        parts = self.documentation.split("\n\n")
        first = next((i for i, part in enumerate(parts) if part.startswith("Equation")), len(parts))
        last = next((i for i, part in enumerate(parts) if part.startswith(("Source", "Typical"))), len(parts))
        return "\n\n".join(" ".join(part.split()) for part in parts[first : max(first, last)])

    @property
    def drawing(self) -> str:
        """The drawing in the documentation; "" without one."""
        _, _, after = self.documentation.partition("::\n\n")
        lines = after.split("\n")
        end = next((i for i, line in enumerate(lines) if line and not line.startswith(" ")), len(lines))
        return textwrap.dedent("\n".join(lines[:end])).strip("\n")

    def __call__(self, model: Model) -> Model:
        """`model` with the effect in it, and off; `DeclarationError` if it is in there already."""
        if self.id in model.effects:
            raise DeclarationError(f"{model.name} has the effect {self.id!r} already; it cannot be added twice")
        values = dict(self.typical) | {q.name: q.value for q in self.parameters if q.value is not None} | dict(self.off)
        declared = [Parameter(replace(q, value=values[q.name]), tunable=True) for q in self.parameters]
        with unchecked():
            changed = self.apply(model.extend(parameters=declared))
        if not isinstance(changed, Model):
            raise DeclarationError(
                f"{self.id}: apply: expected a function that returns the changed model, as `return model.extend(...)`, "
                f"but it returned {changed!r}"
            )
        return changed.marked(self.id)


def with_effects(model: Model, ids: Sequence[str], catalogue: Mapping[str, Effect]) -> Model:
    """The model with the effects `ids` of a catalogue added in that order; `DeclarationError` for an unknown id."""
    for name in ids:
        if name not in catalogue:
            raise DeclarationError(f"{model.name}: there is no effect {name!r}{nearest(name, catalogue)}")
    return added(model, [catalogue[name] for name in ids])


def added(model: Model, effects: Iterable[Effect]) -> Model:
    """The model with effects added one after the other, and checked once."""
    with unchecked():
        for effect in effects:
            model = effect(model)
    model.check()
    return model


def equations(model: Model, effect: Effect) -> str:
    """The equation of an effect: as its documentation has it, else what it changes and adds, line by line."""
    if effect.equation:
        return effect.equation
    after = effect(model)
    before = {d.quantity.name: d.expression for d in model.definitions}
    lines = [
        f"{d.quantity.name} = {d.expression}" for d in after.definitions if before.get(d.quantity.name) != d.expression
    ]
    rates = {s.quantity.name: s.derivative for s in model.states}
    lines += [
        f"d({s.quantity.name})/dt = {s.derivative}" for s in after.states if rates.get(s.quantity.name) != s.derivative
    ]
    lines += [f"{d.quantity.name} = {d.of}(t - {d.by})" for d in after.delays if d not in model.delays]
    return "\n".join(lines).replace("**", "^")
