"""The 95 % interval of each parameter: from the covariance at the optimum where the likelihood falls as that tells.

Elsewhere, as for a stiffness that hardly matters, it is from the profile of the likelihood: the parameter is held, the
others refitted, until twice the log likelihood has fallen by 3.84. Where what is left of the records is no white noise
(a coarse monitor leaves steps), the scores of stretches of the records vary more than the covariance says, and it is
widened to what they tell (Huber, Proc. 5th Berkeley Symp. 1 (1967) 221; Newey and West, Econometrica 55 (1987) 703).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from .fit import NORMAL_95, Fit, described, inverse, search
from .problem import FARTHEST, Problem

# Set by judgement. Check: `pytest tests/test_intervals.py`, `python -m blind.coverage --trials 60`
NOT_NORMAL = 1.5  # [1] times by which the likelihood may fall more or less than the covariance tells
PROFILE_TRIALS = 6  # [1] places at which the end of a profile is sought
END_MISSED = 0.1  # [standard deviations] by which it may be missed
HELD_REFITS = 4  # [evaluations] of the other parameters' fit there
FARTHER_OUT = (1.2, 3.0)  # [1] times by which a place lies further out than the one before it
LEAST_FALL = 1e-3  # [standard deviations] that a place is taken to lie below the optimum at least
SCORED = 14  # [1] of a record whose scores are independent of each other's


def vanishing(problem: Problem, best: Fit) -> tuple[Problem, Fit]:
    """The problem and its optimum in numbers that have intervals: what stays positive may be nothing in them.

    The logarithm of a stiffness that hardly matters has no standard error, and those of all others depend on it.
    """
    free = [replace(f, logarithmic=False, vanishing=True) if f.logarithmic else f for f in best.free]
    problem = replace(problem, free=free)
    return problem, described(problem, problem.scaled(best.values), best.converged)


def intervals(problem: Problem, best: Fit, profile: bool = False) -> dict[str, tuple[float, float]]:
    """The interval of every parameter (SI), with `profile` always from the profile of the likelihood."""
    return {
        name: profile_interval(problem, best, name)
        if profile or not _quadratic(problem, best, name)
        else interval(best, name)
        for name in best.names
    }


def interval(fitted: Fit, name: str) -> tuple[float, float]:
    """The interval of a parameter (SI) from the covariance, within its bounds; not symmetric where the scale is
    logarithmic."""
    i = fitted.names.index(name)
    free = fitted.free[i]
    half = NORMAL_95 * float(np.sqrt(max(fitted.covariance[i, i], 0.0)))
    ends = sorted([free.to_si(fitted.scaled[i] - half), free.to_si(fitted.scaled[i] + half)])
    low = ends[0] if free.lower is None else max(ends[0], free.lower)
    return low, ends[1] if free.upper is None else min(ends[1], free.upper)


def profile_interval(problem: Problem, best: Fit, name: str) -> tuple[float, float]:
    """The interval of one parameter (SI) from the profile of the likelihood, within its bounds.

    Where it is open, it ends at infinity, or at zero for what stays positive. Where `best.covariance` counts more than
    the sensor's noise, the likelihood may fall by as much more.
    """
    i = best.names.index(name)
    free, deviation = best.free[i], float(np.sqrt(best.covariance[i, i]))
    positive = free.logarithmic or free.vanishing
    farthest = FARTHEST if positive else np.inf
    ends = []
    for side, bound in zip((-1, 1), (b[i] for b in problem.bounds()), strict=True):
        to_bound = abs(bound - best.scaled[i])
        room = min(to_bound, farthest - side * best.scaled[i]) / deviation
        steps = _reaches(partial(_fall, problem, best, i, side), room, to_bound <= farthest)
        open_end = 0.0 if positive and side < 0 else side * np.inf
        ends.append(open_end if steps is None else free.to_si(float(best.scaled[i] + side * steps * deviation)))
    return ends[0], ends[1]


def _quadratic(problem: Problem, best: Fit, name: str) -> bool:
    """Whether the likelihood falls as the covariance tells, at both ends of a parameter's interval."""
    i = best.names.index(name)
    known = inverse(best.jacobian.T @ best.jacobian)
    half = NORMAL_95 * float(np.sqrt(best.covariance[i, i]))
    low, high = problem.bounds()
    for side in (-1, 1):
        moved = np.clip(best.scaled + side * half * known[:, i] / known[i, i], low, high)
        residual = problem.residuals(moved)
        ratio = (residual @ residual - best.cost) / ((moved[i] - best.scaled[i]) ** 2 / known[i, i] or 1.0)
        if not 1 / NOT_NORMAL < ratio < NOT_NORMAL:
            return False
    return True


def _reaches(fall: Callable[[float], float], room: float, bounded: bool) -> float | None:
    """At how many standard errors `fall` reaches NORMAL_95, or at the bound, if that is nearer (`room`, `bounded`).

    None where it does not reach it within any usual size.
    """
    if bounded and room < END_MISSED:
        return room
    near, far, at = (0.0, 0.0), (np.inf, np.inf), NORMAL_95
    for _ in range(PROFILE_TRIALS):
        at = min(at, room)
        found = fall(at)
        if abs(found - NORMAL_95) < END_MISSED:
            break
        if found > NORMAL_95:
            far = (at, found)
        elif at == room:
            return room if bounded else None
        else:
            near = (at, found)
        if not np.isfinite(far[0]):
            at *= float(np.clip(NORMAL_95 / max(found, LEAST_FALL), *FARTHER_OUT))
        elif np.isfinite(far[1]):
            at = near[0] + (far[0] - near[0]) * (NORMAL_95 - near[1]) / (far[1] - near[1])
        else:
            at = (near[0] + far[0]) / 2
    return at


def _fall(problem: Problem, best: Fit, i: int, side: int, steps: float) -> float:
    """By how many standard deviations the likelihood has fallen with parameter `i` so many standard errors off to one
    side, and the others refitted; infinite where the model has no answer."""
    known = inverse(best.jacobian.T @ best.jacobian)
    scaled = best.scaled[i] + side * steps * float(np.sqrt(best.covariance[i, i]))
    name, others = best.names[i], [f for f in best.free if f.name != best.names[i]]
    fixed = dict(problem.fixed) | {name: best.free[i].to_si(scaled)}
    held = replace(problem, free=others, fixed=fixed)
    guess = np.delete(best.scaled + (scaled - best.scaled[i]) * known[:, i] / known[i, i], i)
    solution = search(held, held.inside(guess), HELD_REFITS)
    if solution is None:
        return float("inf")
    own = 0.0 if problem.prior is None else best.free[i].pulled(scaled, problem.prior)[0]
    excess = (2 * solution.cost + own**2 - best.cost) * known[i, i] / best.covariance[i, i]
    return float(np.sqrt(max(excess, 0.0)))


def with_coarse_residuals(best: Fit, sizes: list[int], least: float = 1.0) -> Fit:
    """The fit with standard errors that are not less than what the scores of stretches of its records tell, nor their
    variances less than `least` times as large.

    `sizes` are the numbers of rows of each record.
    """
    ends = np.cumsum([0, *sizes])
    parts = [p for a, b in zip(ends[:-1], ends[1:], strict=True) for p in np.array_split(np.arange(a, b), SCORED)]
    scores = np.array([best.jacobian[p].T @ best.residual[p] for p in parts])
    known = inverse(best.jacobian.T @ best.jacobian)
    told = known @ (scores.T @ scores) @ known
    wider = np.sqrt(np.maximum(np.diag(told) / np.diag(known), least))
    return best.with_covariance(best.covariance * np.outer(wider, wider))
