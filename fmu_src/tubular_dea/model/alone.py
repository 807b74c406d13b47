"""An effect isolated from the plant: a model of the effect alone, with all quantities that it acts on as inputs.

::

    what it acts on ---[ the effect's own states, delays and equations ]---> the quantity that it changes
    (inputs and states of the plant, as inputs here)

It is a model like any other, made only from the effect's declaration: running it gives the step response of a lag, the
loop of friction or the curve of a power law. The quantity is the first definition (in the model's order) that contains
the effect's parameters (a signal goes before its rate), or the one that the effect declares (`Effect.curve`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import sympy

from .declare import DeclarationError, Definition, Model, Quantity, State, nearest, rate
from .effect import Effect
from .units import combined

GIVEN = "_given"  # behind the names of the plant's states, which are inputs of the cut


@dataclass(frozen=True)
class Alone:
    """The `model` of an isolated effect, whose only output is `output`.

    `acts_on` has the names of the model's inputs by their names in the plant; `moving`, by coordinate, the state that
    is its rate, where the effect acts on that; `over` is what the effect declares to be shown over, "" if nothing.
    """

    model: Model
    output: str
    acts_on: dict[str, str]
    moving: dict[str, str]
    over: str = ""

    @property
    def remembers(self) -> bool:
        """Whether its output depends on the past, or on the rate of an input."""
        rates = {rate(q) for q in self.model.inputs}
        moving = any(rates & d.expression.free_symbols for d in self.model.definitions)
        return bool(self.model.states or self.model.delays or moving)

    @property
    def clock(self) -> bool:
        """Whether its only memory is the time since the start."""
        inputs = {q.symbol for q in self.model.inputs} | {rate(q) for q in self.model.inputs}
        felt = [_needed(self.model, [s.derivative])[1] & inputs for s in self.model.states]
        return bool(self.model.states) and not any(felt) and not self.model.delays

    @property
    def drivers(self) -> list[str]:
        """The quantities that may be moved: all that it acts on; with memory, a coordinate instead of its rate."""
        if not self.remembers:
            return list(self.acts_on)
        coordinates = {v: x for x, v in self.moving.items()}
        return list(dict.fromkeys(coordinates.get(name, name) for name in self.acts_on))


def alone(base: Model, effect: Effect) -> Alone:
    """The effect isolated from `base`; `DeclarationError` if it changes nothing."""
    model = effect(base)
    known = base.quantities()
    own = [s for s in model.states if s.quantity.name not in known]
    delays = [d for d in model.delays if d.quantity.name not in known]
    marks = {q.symbol for q in effect.parameters} | {s.quantity.symbol for s in own}
    marks |= {d.quantity.symbol for d in delays} | {rate(d.quantity) for d in delays}
    shown, _, over = effect.curve.partition(" over ")
    model, output = _output(model, effect.id, marks, shown)
    ends = [model[output], *(sympy.Symbol(d.of, real=True) for d in delays)]
    expressions = [*ends, *(e for s in own for e in (s.derivative, s.start))]
    definitions, leaves = _needed(model, expressions)
    given = [s.quantity for s in model.states if s.quantity.symbol in leaves and s not in own]
    inputs = [q for q in model.inputs if {q.symbol, rate(q)} & leaves or any(d.of == q.name for d in delays)]
    inputs = inputs or ([] if given else list(model.inputs[:1]))  # a model has at least one
    names = {q.symbol: sympy.Symbol(q.name + GIVEN, real=True) for q in given}
    cut = Model(
        name=base.name,
        description=effect.summary,
        documentation="",
        inputs=(*inputs, *(replace(q, name=q.name + GIVEN, value=None) for q in given)),
        parameters=model.parameters,
        definitions=tuple(replace(d, expression=d.expression.xreplace(names)) for d in definitions),
        states=tuple(_given(s, names) for s in own),
        outputs=(output,),
        delays=tuple(delays),
    )
    acts_on = {q.name: q.name for q in inputs} | {q.name: q.name + GIVEN for q in given}
    made = Alone(cut, output, acts_on, _moving(base, acts_on), over)
    if over and over not in made.drivers:
        there = nearest(over, made.drivers)
        raise DeclarationError(f"{effect.id}: it is shown over {over!r}, which it does not act on{there}")
    return made


def _output(model: Model, effect: str, marks: set[sympy.Symbol], shown: str) -> tuple[Model, str]:
    """The quantity that an effect is shown by; where it enters no definition, the rate of the first state it drives."""
    if shown:
        model.expression(shown)  # which says what is there, where it is not
        return model, shown
    entered = [d.quantity for d in model.definitions if sympy.sympify(d.expression).free_symbols & marks]
    rates = {rate(q) for q in entered}
    for q in entered:
        if q.symbol not in rates:
            return model, q.name
    for s in model.states:
        if s.derivative.free_symbols & marks and s.quantity.symbol not in marks:
            q = s.quantity
            speed = Quantity(f"der_{q.name}", combined((q.unit, 1), ("s", -1)), f"Rate of {q.description}")
            return model.extend(definitions=[Definition(speed, s.derivative)]), speed.name
    raise DeclarationError(f"{effect}: expected a change of the model {model.name} but its parameters enter nothing")


def _needed(model: Model, expressions: list[sympy.Expr]) -> tuple[list[Definition], set[sympy.Symbol]]:
    """The definitions behind some expressions, in the model's order, and all that they depend on in the end."""
    reached = {s for e in expressions for s in sympy.sympify(e).free_symbols}
    kept = []
    for d in reversed(model.definitions):
        if d.quantity.symbol in reached:
            kept.append(replace(d, expression=sympy.sympify(d.expression)))
            reached |= kept[-1].expression.free_symbols
    return kept[::-1], reached


def _given(state: State, names: dict[sympy.Symbol, sympy.Symbol]) -> State:
    """An own state, in what is given; without the curve of the whole model it needs no equilibrium."""
    start = sympy.sympify(state.start).xreplace(names)
    return State(state.quantity, sympy.sympify(state.derivative).xreplace(names), start)


def _moving(base: Model, acts_on: dict[str, str]) -> dict[str, str]:
    """By coordinate the state that is its rate, where the effect acts on both."""
    symbols = {s.quantity.symbol: s.quantity.name for s in base.states}
    pairs = {s.quantity.name: symbols.get(s.derivative, "") for s in base.states}
    return {x: v for x, v in pairs.items() if v in acts_on}
