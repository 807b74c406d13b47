"""Numbers behind symbols: an expression evaluated, and the usual size of a definition."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from typing import Any

import sympy

CANCELLED = 0.1  # of the largest term of a sum: less is left of terms that cancel

FUNCTIONS: list[Any] = [
    {"positive_part": lambda x: max(x, 0.0), "step": lambda x: float(x > 0), "whole": math.floor},
    "math",
]


def evaluator(expression: sympy.Expr) -> tuple[list[sympy.Symbol], Callable[..., float]]:
    """The symbols of an expression, and it as a function of their values: nan where it has no real value."""
    arguments = sorted(sympy.sympify(expression).free_symbols, key=str)
    function = sympy.lambdify(arguments, expression, FUNCTIONS)

    def value(*numbers: float) -> float:
        try:
            found = function(*numbers)
        except (ArithmeticError, ValueError):
            return math.nan
        return math.nan if isinstance(found, complex) else float(found)

    return arguments, value


def usual_size(
    expression: sympy.Expr, given: Mapping[sympy.Symbol, sympy.Expr | float], moving: Collection[sympy.Symbol] = ()
) -> float:
    """|expression| where the symbols have their usual values (or are what they stand for); 1 where that is no size.

    A difference whose terms cancel there, such as (p_set - p) / tau, is as large as with half of one of its values;
    and one in which hardly more than an offset is left of those that are `moving`, with half of one of these.
    """
    symbols, value = evaluator(expression)

    def size(values: Mapping[sympy.Symbol, sympy.Expr | float]) -> float:
        found = abs(value(*(_value(s, values) for s in symbols)))
        return found if found < math.inf else 0.0

    def halved(those: Collection[sympy.Symbol]) -> float:
        return max((size({**given, s: 0.5 * _value(s, given)}) for s in those), default=0.0)

    usual = size(given)
    if usual and usual > CANCELLED * _largest_term(expression, given):
        return usual
    return halved(moving) or halved([s for s, v in given.items() if not isinstance(v, sympy.Expr)]) or usual or 1.0


def _largest_term(expression: sympy.Expr, given: Mapping[sympy.Symbol, sympy.Expr | float]) -> float:
    """The largest term of a sum where the symbols have their usual values; 0 where that is no number."""
    sizes = []
    for term in sympy.Add.make_args(sympy.expand(expression)):
        symbols, value = evaluator(term)
        sizes.append(abs(value(*(_value(s, given) for s in symbols))))
    return max((size for size in sizes if size < math.inf), default=0.0)


def _value(symbol: sympy.Symbol, given: Mapping[sympy.Symbol, sympy.Expr | float]) -> float:
    known = given[symbol]
    if not isinstance(known, sympy.Expr):
        return float(known)
    symbols, value = evaluator(known)
    return value(*(_value(s, given) for s in symbols))
