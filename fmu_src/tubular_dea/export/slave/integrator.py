"""Integrator: Rodas5P with steps of its own choice.

G. Steinebach, "Construction of Rosenbrock-Wanner method Rodas5P and numerical benchmarks within the Julia Differential
Equations package", BIT Numerical Mathematics 63:27, 2023. It uses the exact Jacobian. Inputs are held during a
communication step. The compiled integrator takes the same steps.
"""

from __future__ import annotations

from typing import NamedTuple

from ...emit.rodas5p import BELOW, GAMMA, LATELY, LEAST_PIVOT, STAGES
from ...emit.step_control import is_accepted, is_last, is_too_short, resolving, wanted_next
from .stand_in import FLOORS, NOMINAL, VARIABLES, derivatives, factorise, linearise, multiply, solve
from .table import INF, Vector

MAX_STEPS = 100_000  # internal steps in one communication step: bounded, so that no call hangs
NX = len(NOMINAL)
HELD = (0.0,) * sum(v.kind == "INPUT" for v in VARIABLES)  # rates of the inputs
NO_FOLD = (0.0,)  # no state derivative may use the fold: it is an output only


class Unsolvable(ArithmeticError):
    """The integrator stopped at `time` and states `x`; the text says why."""

    def __init__(self, why: str, time: float, x: Vector) -> None:
        super().__init__(why)
        self.time, self.x = time, x


class BelowMinimum(ArithmeticError):
    """A step or a stage of it left the range in which the equations hold."""


def check_above(x: Vector) -> None:
    """Raises `BelowMinimum` where a state is not above its minimum (`FLOORS`: places and minima)."""
    for place, floor in FLOORS:
        if x[place] <= floor:
            raise BelowMinimum


class Begin(NamedTuple):
    """The equations at the beginning of a step."""

    time: float
    x: Vector
    dx: Vector
    J: Vector  # the entries of d(dx)/dx at `PLACES`
    dx_dt: Vector
    scale: Vector  # one over the tolerance of each state


def linearised(time: float, x: Vector, u: Vector, p: Vector, tolerance: float) -> Begin:
    """The equations at (time, x); tolerances are relative to |x| + nominal."""
    try:
        dx, J, dx_dt = linearise(time, x, u, HELD, p, NO_FOLD)
    except (ArithmeticError, ValueError):  # division by zero, root of a negative number, overflow
        raise Unsolvable("size", time, x) from None
    scale = [1 / (tolerance * (nominal + abs(a))) for nominal, a in zip(NOMINAL, x)]
    return Begin(time, x, dx, J, dx_dt, scale)


def mean_square(scale: Vector, value: Vector) -> float:
    """Mean square of the values over their tolerances."""
    total = 0.0
    for s, v in zip(scale, value):
        scaled = s * v
        total += scaled * scaled
    return total / NX


def stages(
    time: float, x: Vector, dx: Vector, dx_dt: Vector, h: float, L: Vector, u: Vector, p: Vector
) -> tuple[Vector, Vector]:
    """One step of size h: the states at its end and their error. `L` are the factors of I / (h GAMMA) - J.

    Most of the time goes into this function, so an FMU has it written out for the states of its model.
    """
    y, rates = list(x), dx
    k: list[Vector] = []
    for stage in STAGES:
        if stage.a:
            y = [x[i] + sum(a * before[i] for a, before in zip(stage.a, k)) for i in range(NX)]
        elif k:
            y = [y[i] + k[-1][i] for i in range(NX)]
        if k:
            check_above(y)
            rates = derivatives(time + stage.alpha * h, y, u, HELD, p, NO_FOLD)
        sums = [sum(c * before[i] for c, before in zip(stage.c, k)) for i in range(NX)]
        k.append(solve(L, [rates[i] + sums[i] / h + stage.delta * h * dx_dt[i] for i in range(NX)]))
    return tuple(y[i] + k[-1][i] for i in range(NX)), k[-1]


def attempt(begin: Begin, h: float, u: Vector, p: Vector) -> tuple[Vector, float]:
    """One step: the states at its end, and the square of the error over its tolerance, infinite where the
    step broke down, `BELOW` where a state left the range of the equations.

    A pivot that is small beside the shift has lost its digits.
    """
    shift = 1 / (h * GAMMA)
    try:
        L, pivots = factorise(shift, begin.J)
        if not min(map(abs, pivots)) > LEAST_PIVOT * shift:
            return begin.x, INF
        x_new, difference = stages(begin.time, begin.x, begin.dx, begin.dx_dt, h, L, u, p)
        check_above(x_new)
    except BelowMinimum:
        return begin.x, BELOW
    except (ArithmeticError, ValueError):
        return begin.x, INF
    error = mean_square(begin.scale, difference)
    return x_new, error if error < INF else INF


def resolving_step(begin: Begin, limit: float) -> float:
    """As `resolving`, for the equations at the beginning of a step."""
    second = [a + b for a, b in zip(multiply(begin.J, begin.dx), begin.dx_dt)]
    third = multiply(begin.J, second)
    return resolving(mean_square(begin.scale, second), mean_square(begin.scale, third), limit)


def advance(
    time: float, end: float, x: Vector, h: float, u: Vector, p: Vector, tolerance: float
) -> tuple[Vector, float]:
    """From `time` to `end` under the inputs `u`: the states there, and the step size to go on with. `h` is
    the step size of before, or 0. Raises `Unsolvable`."""
    if not x:
        return x, h  # a static law
    begin = linearised(time, x, u, p, tolerance)
    h = resolving_step(begin, h if h > 0 else end - time)
    tries, since_below = 0, LATELY
    while True:
        left = end - begin.time
        wanted, rejected = h, False
        while True:
            tries += 1
            if tries > MAX_STEPS:
                raise Unsolvable("steps", begin.time, begin.x)
            last = is_last(wanted, left, begin.time)
            step = left if last else wanted
            if is_too_short(step, begin.time):
                raise Unsolvable("minimum" if since_below < LATELY else "size", begin.time, begin.x)
            x_new, error = attempt(begin, step, u, p)
            since_below = 0 if error == BELOW else since_below + 1
            wanted = wanted_next(error, step, wanted, last, rejected)
            if is_accepted(error):
                break
            rejected = True
        h = wanted
        if last:
            return x_new, h
        begin = linearised(begin.time + step, x_new, u, p, tolerance)
