"""Delayed signals of a model: inputs and definitions.

A delayed input is one more input to the equations. A delayed definition that is put out is that definition read
earlier: without the delay the model is the same ordinary differential equation.
"""

from __future__ import annotations

import dataclasses

import sympy

from .declare import DeclarationError, Delay, Model


def input_delays(model: Model) -> list[Delay]:
    """The delays of inputs."""
    inputs = {q.name for q in model.inputs}
    return [d for d in model.delays if d.of in inputs]


def output_delays(model: Model) -> list[Delay]:
    """The delays of definitions."""
    inputs = {q.name for q in model.inputs}
    return [d for d in model.delays if d.of not in inputs]


def direct(model: Model, delay: Delay) -> list[str]:
    """The outputs that follow at once what a delay lets through, if that jumps where an input does."""
    inputs, ends = {q.symbol for q in model.inputs}, {_name(d.quantity.name) for d in model.delays}
    if _name(delay.of) not in inputs and not _leaves(model, _name(delay.of), ends) & (inputs | ends):
        return []
    late = _name(delay.quantity.name)
    return [name for name in model.outputs if late in _leaves(model, _name(name), ends)]


def undelayed(model: Model) -> tuple[Model, dict[str, str]]:
    """The model without the delays of definitions, and for each delayed output the parameter of its delay.

    `DeclarationError` where an output mixes what is delayed with what is not: it is no earlier value of anything.
    """
    delays = {_name(d.quantity.name): d for d in output_delays(model)}
    if not delays:
        return model, {}
    by = {}
    for name in model.outputs:
        reached = _leaves(model, _name(name), set(delays))
        delayed = [delays[s] for s in reached & delays.keys()]
        if not delayed:
            continue
        variable = {s.quantity.symbol for s in model.states} | {q.symbol for q in model.inputs}
        if len(delayed) > 1 or reached & variable:
            raise DeclarationError(f"{model.name}: {name} mixes {delayed[0].quantity.name} with what is not delayed")
        by[name] = delayed[0].by
    now = {d.quantity.symbol: _name(d.of) for d in delays.values()}
    definitions = tuple(dataclasses.replace(d, expression=d.expression.subs(now)) for d in model.definitions)
    return dataclasses.replace(model, definitions=definitions, delays=tuple(input_delays(model))), by


def _name(name: str) -> sympy.Symbol:
    return sympy.Symbol(name, real=True)


def _leaves(model: Model, symbol: sympy.Symbol, ends: set[sympy.Symbol]) -> set[sympy.Symbol]:
    """What `symbol` depends on through definitions, not beyond `ends`."""
    expressions = {d.quantity.symbol: sympy.sympify(d.expression) for d in model.definitions}
    found: set[sympy.Symbol] = set()
    todo = {symbol}
    while todo:
        s = todo.pop()
        if s in expressions and s not in ends:
            todo |= expressions[s].free_symbols - found
        found.add(s)
    return found
