"""What an expression is measured in, and whether that is what was declared: metres per second are no newtons.

Every sum, power and function is looked at. A bare number is a pure number where it multiplies, and has the unit of its
neighbours where it is added (a small number under a root, a zero of a scale). What cannot be known is not refused: a
quantity to a power that is a parameter has any unit, and a number as a factor may convert units, so that only the
dimension is compared behind one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TypeAlias

import sympy
from sympy.core.relational import Relational

from .smooth import positive_part, step
from .units import BASE, Power, combined, named_powers, parse, written

LONGEST = 60  # characters of an expression in a message


@dataclass(frozen=True)
class Measure:
    """Powers of units; `bare` is a number as it is written, and without `exact` a number is a factor in it.

    `zeros` counts the zeros of their own that its units have: one for a temperature in degC, none for a difference.
    """

    powers: Mapping[str, Power]
    exact: bool = True
    bare: bool = False
    zeros: int = 0


Known = Mapping[sympy.Symbol, str]  # the units of quantities
NUMBER = Measure({})


class _UnlikeUnits(ValueError):
    """Things that cannot be added, or a function of what has a unit."""


def fault(what: str, expression: sympy.Expr, unit: str, known: Known) -> str:
    """What is wrong with `expression` as something declared in `unit`, in words; "" where nothing is."""
    try:
        found = _measure(expression, known)
    except _UnlikeUnits as problem:
        return f"{what}: {problem}{_hint(expression)}"
    declared = _of_unit(unit)
    said = f"{what}: expected {unit} but {_short(expression)} is in {written(found.powers)}" if found else ""
    if found is None or found.bare or (_same(found, declared) and not (found.exact and found.zeros != declared.zeros)):
        return ""
    if _same(found, declared):
        own = next((name for name in (unit, *found.powers) if parse(name).offset), unit)
        zero = f"{parse(own).offset:g}"
        said = said if unit != own or unit not in found.powers else f"{said}, as a difference"
        return f"{said}: the zero of {own} is at {zero} K; declare it in K (files may be in degC), or say + or - {zero}"
    if _base(found) == _base(declared):
        return f"{said}; multiply it by {_scale(found) / _scale(declared):.6g}, or correct the unit"
    return f"{said}; correct the expression or the unit{_hint(expression)}"


def per_second(unit: str) -> str:
    """The unit of a rate."""
    return combined((unit, 1), ("s", -1))


def _of_unit(unit: str) -> Measure:
    return Measure(named_powers(unit), zeros=int(parse(unit).offset != 0))


def _measure(e: sympy.Basic, known: Known) -> Measure | None:
    """What `e` is measured in; None where that cannot be known."""
    if e.is_Symbol:
        return _of_unit(known[e]) if e in known else None
    if e.is_number:
        return Measure({}, exact=abs(e) == 1, bare=True)
    rule = next((rule for kinds, rule in RULES if isinstance(e, kinds)), None)
    return rule(e.args, known) if rule else None


def _alike(terms: Sequence[sympy.Basic], known: Known) -> Measure | None:
    """What all terms are measured in; bare numbers follow the others."""
    found = [(term, m) for term in terms if (m := _measure(term, known)) is not None]
    measured = [(term, m) for term, m in found if not m.bare]
    if not measured:
        return Measure({}, exact=False, bare=True) if found else None
    first, like = measured[0]
    for term, m in measured[1:]:
        if not _same(like, m):
            one, other = written(like.powers), written(m.powers)
            told = "correct the expression or a unit"
            if _base(like) == _base(m):
                told = f"1 {other} is {_scale(m) / _scale(like):.6g} {one}: declare both in one unit, as in SI"
            raise _UnlikeUnits(
                f"{_short(first)} is in {one} and {_short(term)} in {other}: they cannot be added or compared; {told}"
            )
    exact = len(measured) == len(terms) and all(m.exact for _, m in measured)
    return Measure(like.powers, exact, zeros=like.zeros)


def _sum(terms: Sequence[sympy.Basic], known: Known) -> Measure | None:
    """What all terms are measured in; the difference of two temperatures has no zero any more."""
    like = _alike(terms, known)
    return like and replace(like, zeros=sum(m.zeros for term in terms if (m := _measure(term, known)) is not None))


def _chosen(branches: Sequence[sympy.Basic], known: Known) -> Measure | None:
    """Branches are alike, and so is what their conditions compare."""
    for _, condition in branches:
        for relation in condition.atoms(Relational):
            _alike(relation.args, known)
    return _alike([value for value, _ in branches], known)


def _product(factors: Sequence[sympy.Basic], known: Known) -> Measure | None:
    powers: dict[str, Power] = {}
    given = [m for m in (_measure(f, known) for f in factors) if m is not None]
    if len(given) < len(factors):
        return None
    for name, power in [pair for m in given for pair in m.powers.items()]:
        powers[name] = powers.get(name, 0) + power
    zeros = [m.zeros for m in given if not m.bare]
    sign = -1 if -1 in factors else 1
    return Measure(
        powers, all(m.exact for m in given), all(m.bare for m in given), sign * zeros[0] if len(zeros) == 1 else 0
    )


def _power(of_and_to: Sequence[sympy.Basic], known: Known) -> Measure | None:
    """Powers of units to a number; a power that changes leaves a number a number, and else any unit."""
    base, exponent = of_and_to
    _check_pure(exponent, known, f"the exponent of {_short(base)}")
    of = _measure(base, known)
    if of is None or of.bare:
        return of and Measure({}, exact=False, bare=exponent.is_number)
    if exponent.is_number:
        times = Fraction(float(exponent)).limit_denominator(1000)
        return Measure({name: power * times for name, power in of.powers.items()}, of.exact)
    return None if any(_base(of)) else Measure({}, exact=False)


def _angle(sides: Sequence[sympy.Basic], known: Known) -> Measure | None:
    return _alike(sides, known) and NUMBER


def _switch(of: Sequence[sympy.Basic], known: Known) -> Measure | None:
    """A number, whatever it is of."""
    return _measure(of[0], known) and NUMBER


def _of_numbers(arguments: Sequence[sympy.Basic], known: Known) -> Measure:
    for a in arguments:
        _check_pure(a, known, "what a function like exp is of")
    return NUMBER


def _check_pure(e: sympy.Basic, known: Known, what: str) -> None:
    """That a function or an exponent is of a number, or an angle in rad."""
    found = _measure(e, known)
    if found is not None and not found.bare and not _same(found, NUMBER):
        raise _UnlikeUnits(
            f"{what} has to be a number (angles in rad), but {_short(e)} is in {written(found.powers)}; "
            "divide it by a quantity in that unit"
        )


def _same(a: Measure, b: Measure) -> bool:
    return _base(a) == _base(b) and (not (a.exact and b.exact) or math.isclose(_scale(a), _scale(b), rel_tol=1e-6))


def _base(m: Measure) -> tuple[float, ...]:
    """The exponents of the base units, to two digits: who writes a third writes 0.33."""
    parts = [(parse(name).exponents, power) for name, power in m.powers.items()]
    return tuple(round(float(sum(e[i] * power for e, power in parts)), 2) + 0.0 for i in range(len(BASE)))


def _scale(m: Measure) -> float:
    """How many SI units one of it is."""
    return math.prod(parse(name).factor ** float(power) for name, power in m.powers.items())


def _hint(expression: sympy.Expr) -> str:
    """What to do about a number that may lack its unit."""
    products = (e for e in sympy.preorder_traversal(expression) if e.is_Mul)
    number = next((n for e in products for n in e.args if n.is_number and abs(n) != 1), None)
    if number is None:
        return ""
    said = f"the number {abs(float(number)):g} has no unit"
    return f" ({said}: if it needs one, m.parameter(name, unit, value, tunable=False))"


def _short(e: sympy.Basic) -> str:
    text = str(e).removeprefix("-") if e.is_Mul else str(e)  # a sign says nothing of units
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 4]} ..."


Rule: TypeAlias = Callable[[Sequence[sympy.Basic], Known], Measure | None]
RULES: tuple[tuple[tuple[type, ...], Rule], ...] = (  # the first that fits
    ((sympy.Add,), _sum),
    ((sympy.Abs, sympy.Min, sympy.Max, sympy.floor, sympy.ceiling, positive_part), _alike),
    ((sympy.Mul,), _product),
    ((sympy.Pow,), _power),
    ((sympy.Piecewise,), _chosen),
    ((sympy.atan2,), _angle),
    ((sympy.sign, sympy.Heaviside, step), _switch),
    ((sympy.Function,), _of_numbers),
)
