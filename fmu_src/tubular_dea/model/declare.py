"""The vocabulary a model is declared in: quantities, states, definitions, and how to change them.

A `Model` is a value. Nothing in it is ever changed in place: `extend`, `replace`, `drive` and `observe` return
a new model, and refuse names that do not exist (or exist already). Everything that is printed from a model
(C, Python, XML, tables) reads only what is declared here.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from threading import local

import sympy

from ..errors import UserError
from .units import in_words

TIME = sympy.Symbol("time", real=True)

_here = local()  # `unchecked`: models that this thread makes are on the way to one that will be checked


class DeclarationError(UserError, ValueError):
    """A model was declared or changed in a way that cannot mean anything; the text says what to do."""


@contextmanager
def unchecked() -> Iterator[None]:
    """Models are not checked here, for changes of several steps: whoever makes them checks the last one."""
    before = getattr(_here, "unchecked", False)
    _here.unchecked = True
    try:
        yield
    finally:
        _here.unchecked = before


@dataclass(frozen=True)
class Quantity:
    """A physical quantity: its name in the paper (ASCII), its SI unit, what it is and where it comes from.

    `value` is the start or default value in `unit`; `nominal` its typical size (used to scale tolerances);
    `minimum` and `maximum` are inclusive and enforced wherever a value is set. A state stays above its minimum: there
    the equations end, and what would come to it is an error. `type` is the FMI type: "Real", "Integer" or "Boolean".
    """

    name: str
    unit: str
    description: str
    value: float | None = None
    source: str = ""
    minimum: float | None = None
    maximum: float | None = None
    nominal: float = 1.0
    display_unit: str | None = None
    type: str = "Real"

    @cached_property
    def symbol(self) -> sympy.Symbol:
        """The real sympy symbol of this quantity; equal names give equal symbols."""
        return sympy.Symbol(self.name, real=True)

    def allows(self, value: float) -> bool:
        """Whether a value (in `unit`) is a number inside the bounds."""
        low = -math.inf if self.minimum is None else self.minimum
        return low <= value <= (math.inf if self.maximum is None else self.maximum)

    def inside(self, value: float) -> float:
        """The value, or the bound that it is beyond."""
        low = -math.inf if self.minimum is None else self.minimum
        return min(max(value, low), math.inf if self.maximum is None else self.maximum)

    @property
    def units(self) -> dict[str, str]:
        """Its SI unit and the one that people read, as results name them."""
        return {"unit": self.unit, "display_unit": self.display_unit or self.unit}

    @property
    def allowed(self) -> str:
        """The bounds in words, with the unit: "at least 0 N"."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        if self.minimum is not None and self.maximum is not None:
            return f"{self.minimum:g} to {self.maximum:g}{unit}"
        if self.minimum is not None:
            return f"at least {self.minimum:g}{unit}"
        return "a finite number" if self.maximum is None else f"at most {self.maximum:g}{unit}"

    def told(self, value: float) -> str:
        """A value (in `unit`) with its unit."""
        return f"{value:g}" if self.unit == "1" else f"{value:g} {self.unit}"

    def in_words(self, value: float) -> str:
        """A difference or size (in `unit`) in three digits, in the unit in which it is shown or with a prefix."""
        return in_words(value, self.unit, self.display_unit)


def sized(
    name: str,
    unit: str,
    description: str,
    value: float,
    source: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    display_unit: str | None = None,
) -> Quantity:
    """A quantity whose typical size is that of its value."""
    return Quantity(name, unit, description, value, source, minimum, maximum, abs(value) or 1.0, display_unit)


@dataclass(frozen=True)
class Parameter:
    """A quantity the user may choose; `tunable` ones may change while the simulation runs.

    `start` marks an unknown start value of a state: "each" where every recording has its own, "shared" where all
    recordings start alike. It is found by fits, and is no property of the plant.
    """

    quantity: Quantity
    tunable: bool = False
    start: str = ""


@dataclass(frozen=True)
class State:
    """A continuous state: `derivative` is its rate, `start` its value at the start, both as expressions.

    `start` may use inputs, parameters, and states and definitions as they are at the start.
    `equilibrium` is the value it settles to, as an expression in the inputs, the parameters and the unknown of
    the model's equilibrium curve; it is used to start at equilibrium and to walk along that curve. A model without
    a curve needs none.
    """

    quantity: Quantity
    derivative: sympy.Expr
    start: sympy.Expr
    equilibrium: sympy.Expr | None = None

    def __post_init__(self) -> None:
        for name in ("derivative", "start"):  # whoever declares one by hand may write 0
            object.__setattr__(self, name, sympy.sympify(getattr(self, name)))


@dataclass(frozen=True)
class Definition:
    """A named intermediate or observable: `quantity = expression`."""

    quantity: Quantity
    expression: sympy.Expr

    def __post_init__(self) -> None:
        object.__setattr__(self, "expression", sympy.sympify(self.expression))


@dataclass(frozen=True)
class Delay:
    """`quantity` is what `of` was `by` seconds ago: a pure transport delay, which no state can stand for.

    `of` names an input (its past may drive the states) or a definition (its past may be put out, but drives no
    state). `by` names the parameter that holds the delay in s; its `maximum` bounds the memory. Before the start
    everything is taken to have been as it is at the start. A recorded input may be late itself, so that it acts before
    it is recorded: its delay is negative then. That is for recordings alone; an FMU takes a negative delay for none.
    """

    quantity: Quantity
    of: str
    by: str


@dataclass(frozen=True)
class Discrete:
    """A value that changes only when the model is sampled: at the start of every communication step.

    Discretes are sampled in their order. `update` may use the time, inputs, parameters, states, discretes sampled
    before this one, and `before(...)` of any discrete: what it was before this sample. `start` may use inputs and
    parameters. Definitions and state derivatives may use the discretes; between samples they are constants.
    """

    quantity: Quantity
    start: sympy.Expr
    update: sympy.Expr


@dataclass(frozen=True)
class EquilibriumCurve:
    """The balance `load = f(unknown)` at rest, and the end of its first rising branch (the fold).

    `balance` names the definition that gives the load in equilibrium, `load` the input it balances, `unknown`
    the state that parametrises the curve between `lower` and `upper`, `fold` the quantity that is the largest
    load on the first rising branch from `fold_lower` on: the first local maximum, or the value at the end of
    the interval where there is none. `start_switch` names the parameter that starts the model on the curve.
    """

    balance: str
    load: str
    unknown: str
    fold: Quantity
    lower: float
    fold_lower: float
    upper: float
    start_switch: str


@dataclass(frozen=True)
class Terminal:
    """Signals that meet at one physical port: `members` are pairs (name at the port, name of an input or output).

    Where one of them is not put out, there is no such port."""

    name: str
    description: str
    members: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Model:
    """A set of ordinary differential equations with named intermediates, declared once.

    `definitions` are evaluated in their order; each may use the time, inputs and their rates, parameters,
    states and earlier definitions. `outputs` are names of states or definitions; `sensors` those of them that sensors
    report: sensitivities are of these where nothing else is asked for.
    """

    name: str
    description: str
    documentation: str
    inputs: tuple[Quantity, ...]
    parameters: tuple[Parameter, ...]
    definitions: tuple[Definition, ...]
    states: tuple[State, ...]
    outputs: tuple[str, ...]
    curve: EquilibriumCurve | None = None
    effects: tuple[str, ...] = field(default=())
    delays: tuple[Delay, ...] = ()
    discretes: tuple[Discrete, ...] = ()
    terminals: tuple[Terminal, ...] = ()
    sensors: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not getattr(_here, "unchecked", False):
            self.check()

    def check(self) -> None:
        """`DeclarationError` for the first fault."""
        from .checks import check  # the checks read this vocabulary

        check(self)

    @property
    def title(self) -> str:
        """The name with the effects that were added, for titles."""
        return f"{self.name} with {', '.join(self.effects)}" if self.effects else self.name

    # What is declared --------------------------------------------------------------------------------

    @property
    def remembers(self) -> bool:
        """Whether outputs depend on what inputs were before: not those of a static law."""
        return bool(self.states or self.delays or self.discretes)

    def quantities(self) -> dict[str, Quantity]:
        """Every declared quantity by name, in the order inputs, parameters, states, fold, definitions."""
        fold = [self.curve.fold] if self.curve else []
        listed = [
            *self.inputs,
            *(parameter.quantity for parameter in self.parameters),
            *(state.quantity for state in self.states),
            *fold,
            *(delay.quantity for delay in self.delays),
            *(discrete.quantity for discrete in self.discretes),
            *(definition.quantity for definition in self.definitions),
        ]
        return {quantity.name: quantity for quantity in listed}

    def __str__(self) -> str:
        """What goes in, what comes out, and what it is made of, by name and unit."""
        known = self.quantities()
        listed = {
            "inputs": [q.name for q in self.inputs],
            "outputs": self.outputs,
            "states": [s.quantity.name for s in self.states],
            "parameters": [p.quantity.name for p in self.parameters],
        }
        lines = [
            f"{what + ':':12s}{', '.join(f'{n} [{known[n].unit}]' for n in names)}"
            for what, names in listed.items()
            if names
        ]
        return "\n".join([f"{self.name}: {self.description}", *lines])

    def __getitem__(self, name: str) -> sympy.Symbol:
        """The symbol of a declared quantity."""
        return self.quantity(name).symbol

    def quantity(self, name: str) -> Quantity:
        """The declared quantity of that name; `DeclarationError` with the nearest names if there is none."""
        quantities = self.quantities()
        if name not in quantities:
            raise DeclarationError(f"{self.name} has no quantity {name!r}{nearest(name, quantities)}")
        return quantities[name]

    def expression(self, name: str) -> sympy.Expr:
        """The defining expression of a definition."""
        for definition in self.definitions:
            if definition.quantity.name == name:
                return definition.expression
        names = [definition.quantity.name for definition in self.definitions]
        raise DeclarationError(f"{self.name} has no definition {name!r}{nearest(name, names)}")

    def floors(self) -> dict[int, float]:
        """The minima of states that have one, by the place of the state."""
        return {i: s.quantity.minimum for i, s in enumerate(self.states) if s.quantity.minimum is not None}

    def parameter_values(self) -> dict[str, float]:
        """Default parameter values by name, in SI units."""
        return {p.quantity.name: float(p.quantity.value or 0.0) for p in self.parameters}

    # How a declaration changes -----------------------------------------------------------------------

    def extend(
        self,
        *,
        parameters: Iterable[Parameter] = (),
        definitions: Iterable[Definition] = (),
        states: Iterable[State] = (),
        delays: Iterable[Delay] = (),
        before: str | None = None,
    ) -> Model:
        """The model with more parameters, states, delays and definitions; the latter placed in front of `before`."""
        at = len(self.definitions)
        if before is not None:
            self.expression(before)
            at = [d.quantity.name for d in self.definitions].index(before)
        placed = (*self.definitions[:at], *definitions, *self.definitions[at:])
        return dataclasses.replace(
            self,
            parameters=(*self.parameters, *parameters),
            states=(*self.states, *states),
            delays=(*self.delays, *delays),
            definitions=placed,
        )

    def replace(self, name: str, expression: sympy.Expr) -> Model:
        """The model with another expression for the definition `name`."""
        self.expression(name)
        changed = tuple(
            dataclasses.replace(d, expression=expression) if d.quantity.name == name else d for d in self.definitions
        )
        return dataclasses.replace(self, definitions=changed)

    def drive(self, state: str, derivative: sympy.Expr) -> Model:
        """The model with another derivative for one of its states."""
        if state not in [s.quantity.name for s in self.states]:
            names = [s.quantity.name for s in self.states]
            raise DeclarationError(f"{self.name} has no state {state!r}{nearest(state, names)}")
        changed = tuple(
            dataclasses.replace(s, derivative=derivative) if s.quantity.name == state else s for s in self.states
        )
        return dataclasses.replace(self, states=changed)

    def observe(self, quantity: Quantity, expression: sympy.Expr) -> Model:
        """The model with one more output, computed last."""
        extended = self.extend(definitions=[Definition(quantity, expression)])
        return dataclasses.replace(extended, outputs=(*self.outputs, quantity.name))

    def marked(self, effect: str) -> Model:
        """The model with one more id in the list of its effects."""
        return dataclasses.replace(self, effects=(*self.effects, effect))

    def with_values(self, values: Mapping[str, float]) -> Model:
        """The model with other default parameter values (SI units)."""
        names = [p.quantity.name for p in self.parameters]
        for name in values:
            if name not in names:
                raise DeclarationError(f"{self.name} has no parameter {name!r}{nearest(name, names)}")
        changed = tuple(
            dataclasses.replace(
                p, quantity=dataclasses.replace(p.quantity, value=values.get(p.quantity.name, p.quantity.value))
            )
            for p in self.parameters
        )
        return dataclasses.replace(self, parameters=changed)


def rate(quantity: Quantity) -> sympy.Symbol:
    """The time derivative of an input: known where the input is interpolated, zero where it is held."""
    return sympy.Symbol(f"{quantity.name}_rate", real=True)


def before(quantity: Quantity) -> sympy.Symbol:
    """What a discrete was before the present sample."""
    return sympy.Symbol(f"{quantity.name}_before", real=True)


def check_name(what: str, name: str) -> None:
    """`DeclarationError` for a name that is not fit for every language, or that a file could not have."""
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise DeclarationError(
            f"{what}: expected a name of letters, digits and _ that begins with a letter but was given {name!r}"
        )


def nearest(name: str, names: Iterable[str]) -> str:
    """A hint for an error message: "; did you mean a, b?" or the names there are."""
    known = list(names)
    close = difflib.get_close_matches(name, known, n=3)
    if close:
        return f"; did you mean {', '.join(close)}?"
    return f"; there are {', '.join(known) or 'none'}"
