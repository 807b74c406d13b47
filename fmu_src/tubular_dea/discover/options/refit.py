"""Refits of candidates: all parameters of base and effects together, started from the amplitudes of the scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...identify.fitting.compiled import Ids
from ...identify.fitting.fit import PRECISION, Fit, FitError, fit
from ...identify.fitting.problem import Free, Problem
from ...identify.study.arrivals import delays_of_arrivals
from ...identify.study.study import Study
from ...model.effect import Effect
from ..scores.bank import Score
from ..scores.parameters import base_parameters, clipped, effect_parameters, switched_on

# Set by judgement: what a refit may cost and where it starts. Check: `python -m blind.score --singles 2 --seed 1000`,
# `pytest tests/test_discover.py::test_scores_point_to_the_refit`
FIRST_STEPS = 9  # [evaluations] from each start
FULL_STEPS = 30  # [evaluations] from the best of them
ROUGH_PRECISION = 1e-4  # [1] relative change of the cost at which the first steps end
PROMISED = 0.8  # [1] share of its score that a refit is content with
BELIEVED = 1.0  # [1] step up to which the linear model is believed, in the solver's numbers
NEARBY = 0.1  # [1] share of the score's amplitude with which a refit starts that gained too little from all of it
MOST_SIZES = 10.0  # [1] times its typical size that an amplitude starts at most
NOT_APART = 1e-8  # [1] of the largest singular value: the linear model does not move in directions below
TINY = 1e-3  # [1] of its typical size: so far inside its bound an amplitude starts
LEAST_LAG = 0.1  # [1] share of a lag that counts at least where a shorter whole one stands for it
MOST_LAG = 2.0  # [1] the same at most


def first_refit(study: Study, present: Ids, fitted: Fit, scored: Sequence[Score], refined: Ids = ()) -> Fit | None:
    """The present model with the effect of `scored` (its best shapes) added, after a few steps; None where that fails.

    Effects in `refined` keep their finer form.

    If the gain is much less than the score predicted, the fit starts again: from the linear model's values of the
    present parameters, as these may have compensated for the effect, and with little of the effect.
    """
    ids = (*present, scored[0].candidate.effect.id)
    starts = [start_values(fitted, score) for score in scored]
    best = best_of_starts(study, ids, starts, refined)
    if best is not None and fitted.cost - best.cost > PROMISED * scored[0].statistic:
        return best
    near = start_values(fitted, scored[0], NEARBY)  # the model without the effect costs as much as the present one
    again = best_of_starts(study, ids, [starts[0] | moved(fitted, scored[0]), near], refined)
    return min((f for f in (best, again) if f is not None), key=lambda f: f.cost, default=None)


def best_of_starts(study: Study, ids: Ids, starts: Sequence[dict[str, float]], refined: Ids) -> Fit | None:
    """The model with effects `ids` after a few steps from each of `starts` (SI), the best one; None where all fail."""
    found = []
    for start in starts:
        try:
            found.append(fit_effects(study, ids, start, FIRST_STEPS, refined, ROUGH_PRECISION))
        except FitError:
            continue
    return min(found, key=lambda f: f.cost, default=None)


def moved(fitted: Fit, score: Score) -> dict[str, float]:
    """The present parameters (SI) that the linear model gives together with the score's amplitudes."""
    amplitudes = np.array([score.amplitudes[n] for n in score.candidate.names])
    left = fitted.residual + score.candidate.columns @ amplitudes
    step = np.clip(-np.linalg.lstsq(fitted.jacobian, left, rcond=NOT_APART)[0], -BELIEVED, BELIEVED)
    return {f.name: f.to_si(float(s)) for f, s in zip(fitted.free, fitted.scaled + step, strict=True)}


def fit_effects(
    study: Study,
    ids: Ids,
    start: dict[str, float],
    evaluations: int = FULL_STEPS,
    refined: Sequence[str] = (),
    precision: float = PRECISION,
) -> Fit:
    """The model with effects `ids` fitted from `start` (SI); effects in `refined` with their finer form too."""
    problem = problem_with(study, ids, refined)
    begun = _inside_bounds(problem, start)
    begun |= delays_of_arrivals(study, ids, {**problem.fixed, **begun}, problem.names)
    return fit(problem, begun, 1, evaluations=evaluations, precision=precision)


def problem_with(study: Study, ids: Ids, refined: Sequence[str] = ()) -> Problem:
    """The problem of fitting the base and effects `ids`; those in `refined` with their finer form too."""
    free = [*base_parameters(study.plant)]
    fixed: dict[str, float] = {}
    for name in ids:
        effect = study.catalogue[name]
        free += effect_parameters(effect, name in refined)
        fixed |= switched_on(effect)
    names = [f.name for f in free]
    return study.problem(ids, free, {n: v for n, v in fixed.items() if n not in names})


def _inside_bounds(problem: Problem, start: Mapping[str, float]) -> dict[str, float]:
    """The free parameters (SI) at a start, inside their bounds; at nothing where it does not tell them."""
    return {f.name: clipped(f, start.get(f.name, 0.0)) for f in problem.free}


def cheapest_starts(study: Study, ids: Ids, starts: Sequence[dict[str, float]], most: int) -> list[dict[str, float]]:
    """At most so many of `starts` (SI): those at which the model with effects `ids` costs least."""
    if len(starts) <= most:
        return list(starts)
    problem = problem_with(study, ids)
    white = [problem.residuals(problem.scaled(_inside_bounds(problem, start))) for start in starts]
    costs = [float(r @ r) for r in white]
    return [starts[i] for i in sorted(range(len(starts)), key=costs.__getitem__)[:most]]


def further(study: Study, ids: Ids, begun: Fit, evaluations: int, refined: Ids) -> Fit:
    """The fit continued; unchanged if that fails."""
    try:
        return fit_effects(study, ids, dict(begun.values), evaluations, refined)
    except FitError:
        return begun


def start_values(fitted: Fit, score: Score, share: float = 1.0) -> dict[str, float]:
    """The start of a refit: the present optimum, the score's shape and a share of its amplitude, inside bounds."""
    effect = score.candidate.effect
    values = dict(fitted.values) | dict(effect.typical) | score.candidate.shape
    frees = {f.name: f for f in effect_parameters(effect)}
    for name, amplitude in score.amplitudes.items():
        if name in effect.on:
            values |= _lag(effect, score.candidate.shape, share * amplitude)
        elif name in frees:
            values[name] = _inside(effect, frees[name], share * amplitude)
    return values


def _inside(effect: Effect, free: Free, amplitude: float) -> float:
    """`off` plus the amplitude, at most MOST_SIZES times its usual size and never at a bound."""
    size = free.size
    moved = effect.off[free.name] + float(np.clip(amplitude, -MOST_SIZES * size, MOST_SIZES * size))
    low = -np.inf if free.lower is None else free.lower + TINY * size
    high = np.inf if free.upper is None else free.upper - TINY * size
    return float(np.clip(moved, low, high))


def _lag(effect: Effect, shape: dict[str, float], share: float) -> dict[str, float]:
    """The shape at which a share acts as a whole: a share of a lag is like a shorter lag, of a rate limit a higher
    one."""
    share = float(np.clip(share, LEAST_LAG, MOST_LAG))
    return {name: value * share ** effect.trades.get(name, 0.0) for name, value in shape.items()}
