"""Changes that effects make to a model: a signal gets a name of its own, a term is added, a factor, a lag.

Each function returns a new model. Effects on one signal form a chain: each takes the expression as it finds it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import sympy

from .declare import Definition, Delay, Model, Quantity, State, rate
from .units import combined


def tapped(model: Model, signal: Quantity, source: sympy.Expr, users: tuple[str, ...]) -> Model:
    """`source` under the name of `signal`, in the definitions `users` only (in the model's order)."""
    if signal.name in model.quantities():
        return model
    model = model.extend(definitions=[Definition(signal, source)], before=users[0])
    for user in users:
        model = model.replace(user, model.expression(user).subs(source, signal.symbol))
    return model


def arriving(model: Model, name: str, signal: str) -> Model:
    """The model with the input `name` under the name `signal` wherever it acts (and its rate as `signal_rate`, where
    that acts): the end of the input's way, which effects change.

    What the equilibrium curve's load is compared with stays the recorded one; the curve's balance is split, so that
    `signal_held` is what arrives at rest.
    """
    if signal in model.quantities():
        return model
    q = model.quantity(name)
    source = next((d.quantity for d in model.delays if d.of == name), q)
    end = _like(q, signal, f"{q.description}, as it arrives")
    moving = Quantity(f"{signal}_rate", combined((q.unit, 1), ("s", -1)), f"Rate of {signal}", nominal=q.nominal)
    model = _renamed(model, rate(source), moving)
    model = _renamed(model, source.symbol, end)
    if model.curve is None or model.curve.load != name:
        return model
    held = _like(q, f"{signal}_held", f"{q.description} that is held at rest")
    balance = model.curve.balance
    model = model.extend(definitions=[Definition(held, model.expression(balance))], before=balance)
    return model.replace(balance, held.symbol)


def reading(model: Model, name: str, signal: str) -> Model:
    """The model with what a sensor makes of the output `name` as `signal`, before any delay.

    Where other equations use that output, they keep what is true (`name_true`).
    """
    if signal in model.quantities():
        return model
    q = model.quantity(name)
    users = [d.expression for d in model.definitions if d.quantity.name != name] + [s.derivative for s in model.states]
    if any(q.symbol in sympy.sympify(e).free_symbols for e in users):
        true = _like(q, f"{name}_true", q.description)
        expression = model.expression(name)
        model = model.extend(definitions=[Definition(true, expression)], before=name)
        definitions, states = _substituted(model, q.symbol, true.symbol)
        model = replace(model, definitions=definitions, states=states).replace(name, true.symbol)
    model = model.extend(
        definitions=[Definition(_like(q, signal, f"{q.description}, as it is read"), model.expression(name))],
        before=name,
    )
    return model.replace(name, sympy.Symbol(signal, real=True))


def with_input_delay(model: Model, delayed: Quantity, name: str, by: str) -> Model:
    """The model with the input `name` acting `by` seconds later, as `delayed`."""
    q = model.quantity(name)
    model = model.extend(delays=[Delay(delayed, of=name, by=by)])
    for source, target in ((q.symbol, delayed.symbol), (rate(q), rate(delayed))):
        definitions, states = _substituted(model, source, target)
        model = replace(model, definitions=definitions, states=states)
    return model


def delayed_input(model: Model, name: str, late: str, by: str) -> tuple[Model, sympy.Symbol]:
    """The model with the input `name` as it was `by` seconds ago, as `late`; nothing uses it yet."""
    q = _like(model.quantity(name), late, f"{model.quantity(name).description}, delayed")
    return model.extend(delays=[Delay(q, of=name, by=by)]), q.symbol


def with_output_delay(model: Model, delayed: Quantity, name: str, signal: str, by: str) -> Model:
    """The model with the output `name`, which is `signal`, put out `by` seconds later, as `delayed`."""
    model = model.extend(delays=[Delay(delayed, of=signal, by=by)])
    return model.replace(name, delayed.symbol)


def effective(model: Model, name: str, signal: str) -> Model:
    """The model with the parameter `name` under the name `signal` wherever it acts."""
    if signal in model.quantities():
        return model
    q = model.quantity(name)
    changed = _renamed(model, q.symbol, _like(q, signal, f"{q.description}, in the present state"))
    return _placed_late(model, changed, signal)


def _placed_late(before: Model, model: Model, name: str) -> Model:
    """The definition `name`, which comes first, in front of its first user: so it may depend on what stands there."""
    if before is model:
        return model
    own, *rest = model.definitions
    used = [i for i, d in enumerate(rest) if own.quantity.symbol in sympy.sympify(d.expression).free_symbols]
    at = used[0] if used else len(rest)
    return replace(model, definitions=(*rest[:at], own, *rest[at:]))


def _like(q: Quantity, name: str, description: str) -> Quantity:
    return Quantity(name, q.unit, description, source=q.source, nominal=q.nominal, display_unit=q.display_unit)


def _renamed(model: Model, source: sympy.Symbol, signal: Quantity) -> Model:
    """`source` used under the name `signal`, which is defined before its first user; as it is where nothing uses it."""
    definitions, states = _substituted(model, source, signal.symbol)
    if definitions == model.definitions and states == model.states:
        return model
    users = [i for i, d in enumerate(definitions) if signal.symbol in sympy.sympify(d.expression).free_symbols]
    at = min(users, default=len(definitions))
    return replace(model, definitions=(*definitions[:at], Definition(signal, source), *definitions[at:]), states=states)


def _substituted(
    model: Model, source: sympy.Symbol, target: sympy.Symbol
) -> tuple[tuple[Definition, ...], tuple[State, ...]]:
    """Definitions and states with `target` in the place of `source`, but for what the fold is compared with."""
    fold = {model.curve.fold.symbol} if model.curve else set()
    definitions = tuple(
        d
        if fold & sympy.sympify(d.expression).free_symbols
        else replace(d, expression=sympy.sympify(d.expression).xreplace({source: target}))
        for d in model.definitions
    )
    return definitions, tuple(
        replace(s, derivative=sympy.sympify(s.derivative).xreplace({source: target})) for s in model.states
    )


def at_rest(model: Model, expression: sympy.Expr) -> sympy.Expr | None:
    """`expression` in inputs, parameters and the curve's unknown, every other state at its equilibrium.

    None where the model has no curve: nothing asks for it then.
    """
    if model.curve is None:
        return None
    settled = {s.quantity.symbol: s.equilibrium for s in model.states if s.quantity.name != model.curve.unknown}
    return held_still(model, _put_in(_expanded(model, expression), settled))


def at_start(model: Model, expression: sympy.Expr) -> sympy.Expr:
    """`expression` as the start of a state: states stand for their own starts, inputs do not move yet."""
    return held_still(model, sympy.sympify(expression))


def held_still(model: Model, expression: sympy.Expr) -> sympy.Expr:
    """`expression` for inputs that do not move."""
    moving = (*model.inputs, *(d.quantity for d in model.delays))
    return _put_in(expression, {rate(q): sympy.Integer(0) for q in moving})


def _expanded(model: Model, expression: sympy.Expr) -> sympy.Expr:
    """`expression` in inputs, parameters and states: definitions put in, delays left out (nothing moves)."""
    late = {d.quantity.symbol: sympy.Symbol(d.of, real=True) for d in model.delays}
    expression = _put_in(sympy.sympify(expression), late)
    for definition in reversed(model.definitions):
        if definition.quantity.symbol in expression.free_symbols:
            expression = _put_in(expression, {definition.quantity.symbol: definition.expression})
            expression = _put_in(expression, late)
    return expression


def _put_in(expression: sympy.Expr, known: Mapping[sympy.Symbol, sympy.Expr]) -> sympy.Expr:
    """`expression` with what is `known` of some symbols put in; only those that are there are looked for, which is
    most of the time of building a model with many effects."""
    there = {symbol: known[symbol] for symbol in known if symbol in expression.free_symbols}
    return expression.subs(there) if there else expression


def filtered(model: Model, signal: str, share: sympy.Expr, output: sympy.Expr, name: str) -> Model:
    """`signal` with a share of it replaced by `output`; what it was before is the definition `name`."""
    before = model.quantity(signal)
    renamed = Quantity(
        name,
        before.unit,
        f"{before.description}, before the lag",
        nominal=before.nominal,
        display_unit=before.display_unit,
    )
    model = model.extend(definitions=[Definition(renamed, model.expression(signal))], before=signal)
    return model.replace(signal, renamed.symbol + share * (output - renamed.symbol))


def added(model: Model, name: str, term: sympy.Expr) -> Model:
    """The definition `name` with `term` added."""
    return model.replace(name, model.expression(name) + term)


def scaled(model: Model, name: str, factor: sympy.Expr) -> Model:
    """The definition `name` times `factor`."""
    return model.replace(name, model.expression(name) * factor)
