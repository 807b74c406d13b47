"""What an expression of a model may be made of: functions that C and Python print and that have a derivative."""

from __future__ import annotations

import sympy
from sympy.core.function import AppliedUndef
from sympy.core.relational import Relational

INSTEAD = (  # what has no derivative that could be printed, and what does
    (sympy.sign, "tanh(x / small) where it holds x still, as friction does, else 2*step(x) - 1 (tubular_dea.plants)"),
    (sympy.Heaviside, "step(x) of tubular_dea.plants"),
    ((sympy.floor, sympy.ceiling, sympy.Mod, sympy.frac), "a state or a smooth function"),
    ((sympy.DiracDelta, sympy.Derivative, sympy.Integral, AppliedUndef), "a state of its own, with its derivative"),
)


def unusable(expression: sympy.Basic) -> str:
    """Why this cannot be an expression of a model, and what to write instead; "" where it can."""
    if isinstance(expression, Relational) or not isinstance(expression, sympy.Expr):
        return (
            f"expected a number or an expression but was given {expression}; a switch is step(x) of tubular_dea.plants"
        )
    if expression.has(sympy.nan, sympy.oo, -sympy.oo, sympy.zoo, sympy.I):
        return f"expected a finite real expression but was given {expression}"
    for functions, instead in INSTEAD:
        found = next(iter(expression.atoms(*(functions if isinstance(functions, tuple) else (functions,)))), None)
        if found is not None:
            return f"{found} cannot be computed with its derivatives; write {instead}"
    return ""
