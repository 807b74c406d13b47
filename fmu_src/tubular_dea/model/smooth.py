"""Functions with a corner that friction, stops and memory of the largest load need: `positive_part` and its step.

sympy's own `Max`, `Abs` and `Heaviside` differentiate to Dirac pulses, which no language can print. Here the step
has the derivative zero: right everywhere but at the corner itself, where no trajectory stays.
"""

from __future__ import annotations

import sympy


class step(sympy.Function):  # noqa: N801 - reads like a function in equations
    """1 where its argument is positive, else 0; its derivative is taken as 0."""

    @classmethod
    def eval(cls, x: sympy.Expr) -> sympy.Expr | None:
        """Numbers at once."""
        return sympy.Integer(int(bool(x > 0))) if x.is_number else None

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        """0, at the corner too."""
        return sympy.Integer(0)

    def _eval_is_extended_real(self) -> bool:
        return True


class positive_part(sympy.Function):  # noqa: N801 - reads like a function in equations
    """max(x, 0), with the derivative `step(x)`."""

    @classmethod
    def eval(cls, x: sympy.Expr) -> sympy.Expr | None:
        """Numbers at once."""
        return (x if x > 0 else sympy.Integer(0)) if x.is_number else None

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        """`step` of the argument."""
        return step(self.args[0])

    def _eval_is_extended_real(self) -> bool:
        return True


def magnitude(x: sympy.Expr) -> sympy.Expr:
    """|x|, with the derivative 2 step(x) - 1."""
    return 2 * positive_part(x) - x


def _as_written(width: float | sympy.Expr) -> sympy.Expr:
    """A width, a number or a parameter, as an expression."""
    return width if isinstance(width, sympy.Expr) else sympy.Float(width)


def ramp(x: sympy.Expr, width: float | sympy.Expr) -> sympy.Expr:
    """0 below 0, x - width far above it, with a continuous slope: no drift while x is negative, no kink at 0."""
    above = positive_part(x)
    return above**2 / (above + _as_written(width))


def root(x: sympy.Expr, width: float | sympy.Expr) -> sympy.Expr:
    """The square root to both sides: sqrt(x) far above `width`, -sqrt(-x) far below -`width`, a finite slope at 0."""
    return x / (x**2 + _as_written(width) ** 2) ** sympy.Rational(1, 4)
