"""The table of FMI variables of a model: value references, causality, dependencies. Every interface reads it."""

from __future__ import annotations

import hashlib
import uuid
from dataclasses import dataclass, replace
from functools import lru_cache

import sympy

from ..model.declare import TIME, Model, Quantity, rate
from .jacobian import at_rest, needed, real

TIME_QUANTITY = Quantity("time", "s", "Simulation time")


@dataclass(frozen=True)
class Variable:
    """One FMI variable. `index` is its place in the array of its `kind`; its value reference is its place in the
    table, counted from 1: some importers (OMSimulator) take 0 for none. `dependencies` names the inputs, states and
    time it depends on directly (outputs, derivatives); `initial_dependencies` the inputs and parameters it depends on
    at the start of a simulation, `rates` the inputs whose rates it uses."""

    name: str
    kind: str
    index: int
    quantity: Quantity
    causality: str
    variability: str
    needs_fold: bool = False
    dependencies: tuple[str, ...] = ()
    initial_dependencies: tuple[str, ...] = ()
    rates: tuple[str, ...] = ()


@lru_cache(maxsize=8)
def variables(model: Model) -> tuple[Variable, ...]:
    """time, inputs, outputs, other states, derivatives, parameters; in this order, which gives the value references."""
    return (
        Variable("time", "TIME", 0, TIME_QUANTITY, "independent", "continuous"),
        *(Variable(q.name, "INPUT", i, q, "input", "continuous") for i, q in enumerate(model.inputs)),
        *_outputs(model),
        *_hidden_states(model),
        *_derivatives(model),
        *(_discrete(model, name) for name in _discretes(model) if name not in model.outputs),
        *(
            Variable(p.quantity.name, "PARAMETER", i, p.quantity, "parameter", "tunable" if p.tunable else "fixed")
            for i, p in enumerate(model.parameters)
        ),
    )


def guid(model: Model, kind: str = "native") -> str:
    """An identifier that is a hash of everything declared: the same model gives the same FMU anywhere.

    Hosts may take FMUs with one identifier for the same, so each `kind` ("native", "python") has its own.
    """
    text = repr((kind, model.name, model.inputs, model.parameters, model.outputs, model.curve, model.effects))
    text += repr([(d.quantity, sympy.srepr(d.expression)) for d in model.definitions])
    text += repr([(s.quantity, *map(sympy.srepr, (s.derivative, s.start, s.equilibrium))) for s in model.states])
    text += repr([(d.quantity, sympy.srepr(d.start), sympy.srepr(d.update)) for d in model.discretes])
    text += repr(model.delays) if model.delays else ""
    return f"{{{uuid.UUID(bytes=hashlib.sha256(text.encode()).digest()[:16], version=4)}}}"


def direct_dependencies(model: Model, expression: sympy.Expr) -> tuple[str, ...]:
    """The time, inputs and states that an expression reaches through definitions, in table order.

    The fold stands for the inputs that move it; an input's rate stands for that input.
    """
    reached = _reached(model, expression)
    for q in model.inputs:
        if rate(q) in reached:
            reached.add(q.symbol)
    ordered = [TIME, *(q.symbol for q in model.inputs), *(s.quantity.symbol for s in model.states)]
    return tuple(str(s) for s in ordered if s in reached)


def _reached(
    model: Model, expression: sympy.Expr, constant: dict[sympy.Symbol, sympy.Expr] | None = None
) -> set[sympy.Symbol]:
    """Every symbol that `expression` depends on through definitions, where some are `constant`: what is multiplied
    by zero is not reached."""
    known = dict(constant or {})
    through: dict[sympy.Symbol, set[sympy.Symbol]] = {}
    for d in needed(model, [sympy.sympify(expression)]):
        value = sympy.sympify(d.expression).xreplace(known)
        if value.is_number:
            known[d.quantity.symbol] = value
        else:
            through[d.quantity.symbol] = value.free_symbols.union(*(through.get(s, ()) for s in value.free_symbols))
    free = sympy.sympify(expression).xreplace(known).free_symbols
    reached: set[sympy.Symbol] = free.union(*(through.get(s, ()) for s in free))
    if model.curve and model.curve.fold.symbol in reached:
        reached |= moved_by(model)
    for delay in model.delays:  # a delay may be zero: what is late may be what is now
        if delay.quantity.symbol in reached:
            reached |= {real(delay.by)} | _reached(model, real(delay.of))
    return reached


def moved_by(model: Model) -> set[sympy.Symbol]:
    """The inputs and parameters that move the equilibrium curve; none where there is no curve."""
    if model.curve is None:
        return set()
    used = [expression for _, expression in at_rest(model, [real(model.curve.balance)])]
    reached: set[sympy.Symbol] = set().union(*(e.free_symbols for e in used))
    return reached - {s.quantity.symbol for s in model.states}


def _initial(model: Model, expression: sympy.Expr) -> tuple[str, ...]:
    """Inputs and parameters that `expression` depends on at the start, through the initial states too."""
    reached = _reached(model, expression, _same_at_every_start(model))
    reached = _with_starts(model, reached)
    for q in model.inputs:
        if rate(q) in reached:
            reached.add(q.symbol)
    ordered = [*(q.symbol for q in model.inputs), *(p.quantity.symbol for p in model.parameters)]
    return tuple(str(s) for s in ordered if s in reached)


def _same_at_every_start(model: Model) -> dict[sympy.Symbol, sympy.Expr]:
    """The states that start at one number, whatever the parameters and the way to start: rates at zero."""
    starts = {s.quantity.symbol: (sympy.sympify(s.start), s.equilibrium) for s in model.states}
    return {
        symbol: start
        for symbol, (start, rest) in starts.items()
        if start.is_number and (start == rest or model.curve is None)
    }


def _with_starts(model: Model, reached: set[sympy.Symbol]) -> set[sympy.Symbol]:
    """`reached`, and what the starts of the states in it reach; a start may use those of other states."""
    states = {s.quantity.symbol: s for s in model.states}
    todo, found = reached & states.keys(), set(reached)
    while todo:
        state = states.pop(todo.pop())
        found |= _initial_of_state(model, state.start, state.equilibrium)
        todo = found & states.keys()
    return found


def _initial_of_state(model: Model, start: sympy.Expr, equilibrium: sympy.Expr | None) -> set[sympy.Symbol]:
    reached = _reached(model, start)
    if model.curve:
        settled = sympy.sympify(equilibrium).free_symbols
        reached |= settled
        if real(model.curve.unknown) in settled:
            reached |= moved_by(model) | {real(model.curve.load)}
        if settled or sympy.sympify(start) != sympy.sympify(equilibrium):
            reached.add(real(model.curve.start_switch))
    return reached


def _outputs(model: Model) -> list[Variable]:
    states = {s.quantity.name: (i, s) for i, s in enumerate(model.states)}
    found = []
    position = 0
    for name in model.outputs:
        quantity = model.quantity(name)
        symbol = quantity.symbol
        common = (quantity, "output", "continuous")
        if name in states:
            index, state = states[name]
            initial = _state_initial(model, state.start, state.equilibrium)
            found.append(Variable(name, "STATE", index, *common, False, (name,), initial))
        elif name in _discretes(model):
            found.append(_discrete(model, name))
        elif model.curve and name == model.curve.fold.name:
            found.append(
                Variable(name, "FOLD", 0, *common, True, direct_dependencies(model, symbol), _initial(model, symbol))
            )
        else:
            reached = _reached(model, symbol)
            fold = model.curve is not None and model.curve.fold.symbol in reached
            rates = tuple(q.name for q in model.inputs if rate(q) in reached)
            found.append(
                Variable(
                    name,
                    "OUTPUT",
                    position,
                    *common,
                    fold,
                    direct_dependencies(model, symbol),
                    _initial(model, symbol),
                    rates,
                )
            )
            position += 1
    return found


def _discretes(model: Model) -> list[str]:
    return [d.quantity.name for d in model.discretes]


def _discrete(model: Model, name: str) -> Variable:
    """A discrete; it is kept behind the parameters."""
    place = _discretes(model).index(name)
    causality = "output" if name in model.outputs else "local"
    start = sympy.sympify(model.discretes[place].start)
    return Variable(
        name,
        "SAMPLED",
        len(model.parameters) + place,
        model.quantity(name),
        causality,
        "discrete",
        initial_dependencies=_initial(model, start),
    )


def _state_initial(model: Model, start: sympy.Expr, equilibrium: sympy.Expr | None) -> tuple[str, ...]:
    reached = _with_starts(model, _initial_of_state(model, start, equilibrium))
    ordered = [*(q.symbol for q in model.inputs), *(p.quantity.symbol for p in model.parameters)]
    return tuple(str(s) for s in ordered if s in reached)


def _hidden_states(model: Model) -> list[Variable]:
    return [
        Variable(
            s.quantity.name,
            "STATE",
            i,
            s.quantity,
            "local",
            "continuous",
            initial_dependencies=_state_initial(model, s.start, s.equilibrium),
        )
        for i, s in enumerate(model.states)
        if s.quantity.name not in model.outputs
    ]


def _derivatives(model: Model) -> list[Variable]:
    return [
        Variable(
            f"der({s.quantity.name})",
            "DERIVATIVE",
            i,
            _derivative_quantity(s.quantity),
            "local",
            "continuous",
            dependencies=direct_dependencies(model, s.derivative),
            initial_dependencies=_initial(model, s.derivative),
        )
        for i, s in enumerate(model.states)
    ]


def _derivative_quantity(quantity: Quantity) -> Quantity:
    unit = {"1": "1/s", "1/s": "1/s2"}.get(quantity.unit, f"{quantity.unit}/s")
    return replace(
        quantity,
        name=f"der({quantity.name})",
        unit=unit,
        value=None,
        description=f"Time derivative of {quantity.name}",
        display_unit=None,
        minimum=None,
        maximum=None,
    )
