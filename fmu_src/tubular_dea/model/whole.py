"""The largest whole number that is not above its argument: what turns a running phase into a place in the cycle."""

from __future__ import annotations

from typing import Any

import sympy


class whole(sympy.Function):  # noqa: N801 - reads like a function in equations
    """floor(x), with the derivative 0: right everywhere but at the jumps, where the phase does not stay."""

    @classmethod
    def eval(cls, x: sympy.Expr) -> sympy.Expr | None:
        """Numbers at once."""
        return sympy.Integer(sympy.floor(x)) if x.is_number else None

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        """0, at the jumps too."""
        return sympy.Integer(0)

    def _eval_is_extended_real(self) -> bool:
        return True

    def _ccode(self, printer: Any, **_: Any) -> str:
        return f"floor({printer._print(self.args[0])})"

    def _pythoncode(self, printer: Any, **_: Any) -> str:
        return f"math.floor({printer._print(self.args[0])})"


def cycle_fraction(phase: sympy.Expr) -> sympy.Expr:
    """How far the present cycle has come, 0 to 1; `phase` counts cycles."""
    return phase - whole(phase)


def rename(expression: sympy.Expr, names: dict[sympy.Symbol, sympy.Expr]) -> sympy.Expr:
    """`expression` with symbols replaced, all at once and without rearranging anything else."""
    return sympy.sympify(expression).xreplace(names)
