"""Dimensions of sympy expressions: what the declared units of a model say of every sum, power and function in it."""

from __future__ import annotations

from fractions import Fraction

import sympy

from tubular_dea.model.declare import TIME, Model, rate
from tubular_dea.model.smooth import positive_part, step
from tubular_dea.model.units import BASE, combined, parse

Dimension = tuple[Fraction, ...] | None  # None: a bare number
NONE = tuple([Fraction(0)] * len(BASE))


def mismatches(model: Model) -> list[str]:
    """Every definition, derivative and start whose dimension is not the declared one, or that adds unlike things."""
    known = {q.symbol: _of(q.unit) for q in model.quantities().values()} | {TIME: _of("s")}
    moving = (*model.inputs, *(d.quantity for d in model.delays))
    known |= {rate(q): _of(combined((q.unit, 1), ("s", -1))) for q in moving}
    found = []
    for what, expression, unit in [
        *((d.quantity.name, d.expression, d.quantity.unit) for d in model.definitions),
        *((f"der({s.quantity.name})", s.derivative, combined((s.quantity.unit, 1), ("s", -1))) for s in model.states),
        *((f"start of {s.quantity.name}", s.start, s.quantity.unit) for s in model.states),
    ]:
        try:
            dimension = _dimension(sympy.sympify(expression), known)
        except ValueError as problem:
            found.append(f"{what}: {problem}")
            continue
        if dimension not in (None, _of(unit)):
            found.append(f"{what}: declared in {unit} but is {expression}")
    return found


def _of(unit: str) -> Dimension:
    return tuple(Fraction(e) for e in parse(unit).exponents)


def _dimension(e: sympy.Expr, known: dict[sympy.Symbol, Dimension]) -> Dimension:
    if e.is_Symbol:
        return known[e]
    if e.is_number:
        return None
    if e.is_Add:
        return _same([_dimension(a, known) for a in e.args], e)
    if e.is_Mul:
        parts = [_dimension(a, known) or NONE for a in e.args]
        return tuple(sum(column) for column in zip(*parts, strict=True))
    if e.is_Pow:
        base, exponent = e.as_base_exp()
        if _dimension(exponent, known) not in (None, NONE):
            raise ValueError(f"the exponent of {e} has a dimension")
        inner = _dimension(base, known) or NONE
        if exponent.is_number:
            return tuple(d * Fraction(str(sympy.Rational(exponent))) for d in inner)
        if inner != NONE:
            raise ValueError(f"{base} has a dimension and goes with a power that changes")
        return NONE
    if isinstance(e, positive_part):
        return _dimension(e.args[0], known)
    if isinstance(e, step):
        return NONE
    if any(_dimension(a, known) not in (None, NONE) for a in e.args):
        raise ValueError(f"{e} is a function of what has a dimension")
    return NONE


def _same(dimensions: list[Dimension], e: sympy.Expr) -> Dimension:
    """Numbers beside what has a dimension are no sum that means anything."""
    given = {d if d is not None else NONE for d in dimensions}
    if len(given) > 1:
        raise ValueError(f"{e} adds unlike things")
    return given.pop()
