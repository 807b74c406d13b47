"""Model: a softening spring, in whose place an FMU has its own."""

from __future__ import annotations

from .table import INF, Curve, SlaveVariable, Vector

NAME = "StandIn"
GUID = "{00000000-0000-4000-8000-000000000000}"
VARIABLES: tuple[SlaveVariable, ...] = (
    SlaveVariable("time", "s", "TIME", 0, "Real", "continuous", -INF, INF, 0.0, False),
    SlaveVariable("load", "N", "INPUT", 0, "Real", "continuous", -INF, INF, 0.0, False),
    SlaveVariable("x", "1", "STATE", 0, "Real", "continuous", -10.0, INF, 0.0, False),
    SlaveVariable("margin", "N", "OUTPUT", 0, "Real", "continuous", -INF, INF, 0.0, True),
    SlaveVariable("der(x)", "1/s", "DERIVATIVE", 0, "Real", "continuous", -INF, INF, 0.0, False),
    SlaveVariable("damping", "N.s", "PARAMETER", 0, "Real", "tunable", 1e-3, INF, 0.1, False),
    SlaveVariable("at_rest", "1", "PARAMETER", 1, "Boolean", "fixed", -INF, INF, 0.0, False),
)
NOMINAL = (1.0,)
FLOORS = ((0, -10.0),)
CURVE: Curve | None = Curve(0, 1, (), -1.0, 0.0, 2.0)


def derivatives(time: float, x: Vector, u: Vector, du: Vector, p: Vector, fold: Vector) -> Vector:
    """A softening spring (x - x^3 / 3) and a damper under a load."""
    return ((u[0] - x[0] + x[0] ** 3 / 3) / p[0],)


def outputs(time: float, x: Vector, u: Vector, du: Vector, p: Vector, fold: Vector) -> Vector:
    """The outputs that are not states."""
    return (fold[0] - u[0],)


def start(u: Vector, p: Vector) -> Vector:
    """Initial states away from equilibrium."""
    return (0.0,)


def equilibrium(unknown: float, u: Vector, p: Vector) -> tuple[float, float, Vector]:
    """The load at rest over x, its slope, and the states there."""
    return unknown - unknown**3 / 3, 1 - unknown**2, (unknown,)


PLACES = ((0, 0),)


def linearise(time: float, x: Vector, u: Vector, du: Vector, p: Vector, fold: Vector) -> tuple[Vector, Vector, Vector]:
    """State derivatives, d(dx)/dx at `PLACES` (elsewhere it is zero), and d(dx)/dt at fixed states."""
    return derivatives(time, x, u, du, p, fold), ((x[0] ** 2 - 1) / p[0],), (du[0] / p[0],)


def multiply(J: Vector, v: Vector) -> Vector:
    """J v."""
    return (J[0] * v[0],)


def factorise(shift: float, J: Vector) -> tuple[Vector, Vector]:
    """Factors of shift I - J, and the pivots."""
    pivot = shift - J[0]
    return (1 / pivot,), (pivot,)


def solve(L: Vector, b: Vector) -> Vector:
    """k with (shift I - J) k = b."""
    return (L[0] * b[0],)
