"""Discretes in the making, one rule a line: what a sampled model decides at each of its samples.

Usage::

    r = Rules([trigger, limit])
    high = r.flag("high", "The trigger is high", r.s["trigger"] > sympy.Float(0.5))
    r.count("edges", "Rises of the trigger", And(yes(high), no(r.old("high"))))
    Model(..., discretes=tuple(r.made))
"""

from __future__ import annotations

from collections.abc import Iterable

import sympy

from .declare import Discrete, Quantity, before

NEVER = 1e9  # s: no event is planned
SOON = 1e-7  # s: events this close have come


def choose(condition: sympy.Basic, then: sympy.Expr | float, otherwise: sympy.Expr | float) -> sympy.Expr:
    """`then` where the condition holds, else `otherwise`."""
    return sympy.Piecewise((sympy.sympify(then), condition), (sympy.sympify(otherwise), True), evaluate=False)


def yes(symbol: sympy.Expr) -> sympy.Basic:
    """Truth of a discrete that is 0 or 1."""
    return symbol > sympy.Float(0.5)


def no(symbol: sympy.Expr) -> sympy.Basic:
    """Its opposite."""
    return symbol < sympy.Float(0.5)


class Rules:
    """`s` symbols by name, of quantities and of the discretes made so far, in the order of their sampling."""

    def __init__(self, quantities: Iterable[Quantity]) -> None:
        self.s: dict[str, sympy.Symbol] = {q.name: q.symbol for q in quantities}
        self.made: list[Discrete] = []

    def old(self, name: str) -> sympy.Symbol:
        """What a discrete was before this sample."""
        return before(Quantity(name, "1", ""))

    def add(
        self,
        name: str,
        unit: str,
        description: str,
        update: sympy.Expr | float,
        start: sympy.Expr | float = 0.0,
        nominal: float = 1.0,
        display_unit: str | None = None,
    ) -> sympy.Symbol:
        """A discrete, and its symbol."""
        quantity = Quantity(name, unit, description, nominal=nominal, display_unit=display_unit)
        begin = sympy.Float(start) if isinstance(start, float) else start
        self.made.append(Discrete(quantity, begin, sympy.sympify(update)))
        self.s[name] = quantity.symbol
        return quantity.symbol

    def flag(self, name: str, description: str, condition: sympy.Basic) -> sympy.Symbol:
        """1 where the condition holds, else 0."""
        return self.add(name, "1", description, choose(condition, 1, 0))

    def count(self, name: str, description: str, condition: sympy.Basic) -> sympy.Symbol:
        """One more at each sample at which the condition holds."""
        return self.add(name, "1", description, self.old(name) + choose(condition, 1, 0))
