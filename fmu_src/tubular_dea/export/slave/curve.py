"""Equilibrium: the fold of the curve, and rest states on the branch before it."""

from __future__ import annotations

from collections.abc import Callable

from .stand_in import equilibrium
from .table import Curve, Vector

SCAN = 100  # scanning steps along the curve: folds closer than (upper - fold_lower) / SCAN are not told apart


def falling_zero(f: Callable[[float], float], a: float, b: float) -> float:
    """The zero between a (value positive) and b (not positive): regula falsi with Illinois weights."""
    fa, fb, middle, side = f(a), f(b), b, 0
    for _ in range(200):
        if not (fb != 0 and b - a > 4e-16 * b):
            break
        middle = (fa * b - fb * a) / (fa - fb)
        if not a < middle < b:
            middle = 0.5 * (a + b)
        value = f(middle)
        if value > 0:
            a, fa = middle, value
            fb *= 0.5 if side == 1 else 1.0
            side = 1
        elif value < 0:
            b, fb = middle, value
            fa *= 0.5 if side == -1 else 1.0
            side = -1
        else:
            return middle
    return middle


def fold_point(curve: Curve, u: Vector, p: Vector) -> tuple[float, float]:
    """Unknown and load at the first local maximum of the load; at the interval's end if there is none."""

    def slope(unknown: float) -> float:
        return equilibrium(unknown, u, p)[1]

    width = (curve.upper - curve.fold_lower) / SCAN
    unknown = curve.upper
    if not slope(curve.fold_lower) > 0:
        unknown = curve.fold_lower
    else:
        for i in range(1, SCAN + 1):
            right = curve.fold_lower + i * width
            if not slope(right) > 0:
                unknown = falling_zero(slope, right - width, right)
                break
    return unknown, equilibrium(unknown, u, p)[0]


def rest_state(curve: Curve, u: Vector, p: Vector, fold: float) -> Vector | None:
    """The states at rest under the inputs, on the branch before the unknown `fold`; None if there is none."""

    def surplus(unknown: float) -> float:
        return u[curve.load] - equilibrium(unknown, u, p)[0]

    if not surplus(curve.lower) > 0 or not surplus(fold) <= 0:
        return None
    return equilibrium(falling_zero(surplus, curve.lower, fold), u, p)[2]
