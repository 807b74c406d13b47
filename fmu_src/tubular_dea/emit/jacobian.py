"""Exact derivatives along named intermediates.

Nothing is expanded: every derivative of a definition becomes a named assignment that uses the definitions
themselves, so the emitted Jacobian reads like the chain rule done by hand.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache

import sympy

from ..model.declare import Definition, Model

Assignment = tuple[str, sympy.Expr]
ZERO = sympy.Integer(0)


def real(name: str) -> sympy.Symbol:
    """The real symbol of that name."""
    return sympy.Symbol(name, real=True)


def needed(model: Model, expressions: Iterable[sympy.Expr]) -> list[Definition]:
    """The definitions that `expressions` use, directly or through others, in the model's order."""
    wanted: set[sympy.Symbol] = set().union(*(sympy.sympify(e).free_symbols for e in expressions))
    chosen: list[Definition] = []
    for definition in reversed(model.definitions):
        if definition.quantity.symbol in wanted:
            chosen.append(definition)
            wanted |= definition.expression.free_symbols
    return chosen[::-1]


def assignments(definitions: Iterable[Definition]) -> list[Assignment]:
    """The definitions as (name, expression) pairs."""
    return [(d.quantity.name, d.expression) for d in definitions]


def forward(
    body: Sequence[Assignment], results: Sequence[sympy.Expr], seeds: Mapping[sympy.Symbol, sympy.Expr], name: str
) -> tuple[list[Assignment], list[sympy.Expr]]:
    """Tangents of `results` for the tangents `seeds` of the free symbols, through the assignments `body`.

    `name` makes the names of the tangents of intermediates, for example "d_{}_d_x".
    Returns the assignments to place after `body`, and the tangent of each result.
    """
    tangent = dict(seeds)
    added: list[Assignment] = []
    for target, expression in body:
        value = _total(expression, tangent)
        if value == ZERO:
            continue
        if value.is_Atom or (-value).is_Atom:
            tangent[real(target)] = value
        else:
            added.append((name.format(target), value))
            tangent[real(target)] = real(name.format(target))
    return added, [_total(result, tangent) for result in results]


def at_rest(model: Model, results: Sequence[sympy.Expr]) -> list[Assignment]:
    """The assignments that lead to `results` with every state at its equilibrium.

    States that settle to a number are put in as that number, and what becomes a number by it (a damper's stress,
    say) goes in as well, so that nothing seems to depend on what plays no part at rest.
    """
    values = {s.quantity.symbol: sympy.sympify(s.equilibrium) for s in model.states}
    body: list[Assignment] = [(str(s), e) for s, e in values.items() if not e.is_Number and e != s]
    numbers = {s: e for s, e in values.items() if e.is_Number}
    for definition in needed(model, results):
        expression = sympy.sympify(definition.expression)
        settled = expression.subs({s: n for s, n in numbers.items() if s in expression.free_symbols})
        if settled.is_Number and not expression.is_Number:
            numbers[definition.quantity.symbol] = settled
        else:
            body.append((definition.quantity.name, settled))
    return body


def _total(expression: sympy.Expr, tangent: Mapping[sympy.Symbol, sympy.Expr]) -> sympy.Expr:
    """Sum of partial derivatives times tangents."""
    expression = sympy.sympify(expression)
    used = [symbol for symbol in _symbols(expression) if symbol in tangent]
    return sympy.Add(*(sympy.diff(expression, symbol) * tangent[symbol] for symbol in used))


@lru_cache(maxsize=50_000, typed=True)
def _symbols(expression: sympy.Expr) -> tuple[sympy.Symbol, ...]:
    """The free symbols of an expression in the order of their names; models that share a part ask for it once."""
    return tuple(sorted(expression.free_symbols, key=str))
