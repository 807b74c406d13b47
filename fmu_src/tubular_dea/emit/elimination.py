"""The linear systems (shift I - J) k = b of a Rosenbrock method, solved along the diagonal.

The order is chosen from the places where J is not zero; zeros cost nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import sympy

from .functions import Function
from .jacobian import ZERO, Assignment, real

Place = tuple[int, int]


def linear_algebra(n: int, places: Sequence[Place]) -> tuple[list[Function], int]:
    """multiply, factorise and solve for J with entries at `places`; and the size of the array `L`."""
    entries = {place: real(f"J_{place[0]}_{place[1]}") for place in places}
    order = elimination_order(n, places)
    factors = _factors(n, entries, order)
    return [_multiply(n, entries), factors.function, _solve(n, factors, order)], len(factors.stored)


def elimination_order(n: int, places: Iterable[Place]) -> list[int]:
    """Pivots along the diagonal: the one that can make the fewest new entries first (Markowitz).

    Among equals, those go last that are nothing but the shift: where steps are long the shift is small.
    """
    filled = set(places)
    left, order = list(range(n)), []
    while left:
        k = min((_elimination_cost(k, left, filled), k) for k in left)[1]
        left.remove(k)
        order.append(k)
        filled |= {(i, j) for i in left for j in left if (i, k) in filled and (k, j) in filled}
    return order


def _elimination_cost(k: int, left: Sequence[int], filled: set[Place]) -> tuple[int, bool]:
    """How many entries the pivot k can change, and whether it is nothing but the shift."""
    right = sum((k, j) in filled for j in left if j != k)
    below = sum((i, k) in filled for i in left if i != k)
    return right * below, (k, k) not in filled


@dataclass(frozen=True)
class _Factors:
    function: Function
    stored: dict[Place, sympy.Symbol]  # multipliers, inverse pivots and what is right of them


def _factors(n: int, entries: dict[Place, sympy.Symbol], order: Sequence[int]) -> _Factors:
    """Gaussian elimination of shift I - J without exchanges. `pivot` lets the caller judge it."""
    shift = real("shift")
    now: dict[Place, sympy.Expr] = {place: -symbol for place, symbol in entries.items()}
    for i in range(n):
        now[i, i] = shift + now.get((i, i), ZERO)
    body: list[Assignment] = []
    stored: dict[Place, sympy.Symbol] = {}
    pivots: dict[int, sympy.Symbol] = {}

    def name(text: str, value: sympy.Expr) -> sympy.Symbol:
        body.append((text, value))
        return real(text)

    for position, k in enumerate(order):
        later = order[position + 1 :]
        pivots[k] = name(f"pivot_{k}", now[k, k])
        stored[k, k] = name(f"inverse_{k}", 1 / pivots[k])
        for j in later:
            if (k, j) in now:
                stored[k, j] = name(f"U_{k}_{j}", now[k, j])
        for i in later:
            if (i, k) not in now:
                continue
            stored[i, k] = name(f"L_{i}_{k}", now[i, k] * stored[k, k])
            for j in later:
                if (k, j) in now:
                    now[i, j] = now.get((i, j), ZERO) - stored[i, k] * stored[k, j]
    function = Function(
        "factorise",
        "Factors of shift I - J along the diagonal, and the pivots.",
        {"shift": [shift], "J": list(entries.values())},
        body,
        {"L": list(stored.values()), "pivot": [pivots[k] for k in range(n)]},
    )
    return _Factors(function, stored)


def _solve(n: int, factors: _Factors, order: Sequence[int]) -> Function:
    """(shift I - J) k = b by the factors: forward, then back."""
    b = [real(f"b_{i}") for i in range(n)]
    stored = factors.stored
    reached: dict[int, sympy.Expr] = dict(enumerate(b))
    body: list[Assignment] = []
    for position, i in enumerate(order):
        terms = [stored[i, k] * reached[k] for k in order[:position] if (i, k) in stored]
        if terms:
            body.append((f"c_{i}", b[i] - sympy.Add(*terms)))
            reached[i] = real(f"c_{i}")
    for position in reversed(range(n)):
        k = order[position]
        known = sympy.Add(*(stored[k, j] * real(f"k_{j}") for j in order[position + 1 :] if (k, j) in stored))
        body.append((f"k_{k}", stored[k, k] * (reached[k] - known)))
    return Function(
        "solve",
        "k with (shift I - J) k = b.",
        {"L": list(stored.values()), "b": b},
        body,
        {"k": [real(f"k_{i}") for i in range(n)]},
    )


def _multiply(n: int, entries: dict[Place, sympy.Symbol]) -> Function:
    v = [real(f"v_{i}") for i in range(n)]
    rows = [sympy.Add(*(symbol * v[j] for (row, j), symbol in entries.items() if row == i)) for i in range(n)]
    return Function("multiply", "J v.", {"J": list(entries.values()), "v": v}, [], {"Jv": rows})
