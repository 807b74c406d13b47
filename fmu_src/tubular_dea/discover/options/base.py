"""The base model with its own parameters refitted: the reference for every candidate.

A base that has not converged leads to false effects, so the fit starts from several points. One of them has the
declared values of the parameters that the plant names as `restart`: a Maxwell branch that became very fast during a fit
does not come back by itself.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...identify.fitting.fit import AGREE, Fit, FitError, fit, may_be_better
from ...identify.fitting.problem import Problem
from ...identify.study.procedure import staged
from ...identify.study.study import Study
from ...identify.threads import side_by_side
from ..scores.parameters import base_parameters

# Set by judgement. Check: `pytest tests/test_base.py`,
# `pytest tests/test_unusual_recordings.py::test_a_tube_far_from_table_3_gets_the_best_base`,
# `python -m blind.score --nulls 60 --seed 1000`
BASE_STARTS = 3  # [1] places from which the base is searched
MOVE = 0.1  # [1] relative distance of the further ones

# Set by judgement: no unit test tells a factor of four. Check: `python -m blind.score --nulls 60 --seed 1000`
CONFIRM = 15  # [evaluations] that they have

# Set by judgement. Check: `pytest tests/test_base.py`
LAST_STARTS = 4  # [1] places that are tried where the model has no answer at safer values either
LAST_SPREAD = 0.3  # [1] relative distance of these


def recalibrate(
    study: Study, starts: int = BASE_STARTS, seed: int = 0, start: Mapping[str, float] | None = None
) -> Fit:
    """The best fit of the base model to the training pieces: from `start` (the declared values), then from around it.

    The first fit runs until it converges; the others start near its optimum and confirm it, or go on from a better
    point. Where there are long records, this is done with their beginnings, and the fit to all goes on from there.
    """
    if start is None and study.beginning is not study:
        start, starts = _searched(study.beginning, starts, seed, None).values, 1
    return _searched(study, starts, seed, start)


def _searched(study: Study, starts: int, seed: int, start: Mapping[str, float] | None) -> Fit:
    """The best of the fits to all training pieces of a study."""
    problem = study.problem((), base_parameters(study.plant), {})
    best = _somewhere(study, problem, _begin(study, problem) if start is None else start, seed)
    if starts == 1:
        return best
    most = _most_steps(problem, best)

    def confirm(number: int) -> Fit:
        if number == 1:
            return _restarted(problem, study, best, most)
        try:
            return fit(problem, best.values, 1, evaluations=CONFIRM, move=MOVE, seed=seed + number, most_steps=most)
        except FitError:  # no answer there: no better place
            return best

    other = min([best, *side_by_side(confirm, range(1, starts))], key=lambda f: f.cost)
    return fit(problem, other.values, 1) if other.cost < best.cost - AGREE else best


def _begin(study: Study, problem: Problem) -> dict[str, float]:
    """The declared values, or what the plant's own stages lead to from there where that fits better.

    Where the records' starts are unknown, they make up for wrong parameters, and a fit of all at once may end anywhere.
    """
    declared = study.plant.model.parameter_values()
    if not study.plant.stages:
        return declared
    try:
        reached = staged(study, declared)
    except FitError:
        return declared
    here, there = (float(np.sum(problem.residuals(problem.scaled(v)) ** 2)) for v in (declared, reached))
    return reached if there < here else declared


def elsewhere(study: Study, fitted: Fit) -> Fit | None:
    """What the parameters that a fit may lose lead to from their declared values, if that may be a better optimum."""
    if not study.plant.restart:
        return None
    problem = study.problem((), fitted.free, {})
    other = _restarted(problem, study, fitted, _most_steps(problem, fitted))
    return other if may_be_better(other, fitted) else None


def _most_steps(problem: Problem, fitted: Fit) -> float:
    """The steps that a search from elsewhere may begin with. Beside a wrong optimum's other parameters the declared
    ones may stand for a tube that bursts and rings: 13 million steps in 150 s."""
    problem.residuals(problem.scaled(fitted.values))
    return problem.most_steps()


def _restarted(problem: Problem, study: Study, fitted: Fit, most_steps: float) -> Fit:
    """A few steps from the declared values of the parameters that a fit may lose; the fit where there is no answer."""
    try:
        return fit(problem, fitted.values | study.plant.restarts, 1, evaluations=CONFIRM, most_steps=most_steps)
    except FitError:
        return fitted


def _somewhere(study: Study, problem: Problem, start: Mapping[str, float], seed: int) -> Fit:
    """The fit from `start`, or from safer values where the model cannot be solved there (a tube that bursts)."""
    for move in (dict, *study.plant.safer):
        try:
            return fit(problem, move(start), 1, seed=seed)
        except FitError:
            continue
    return fit(problem, start, LAST_STARTS, LAST_SPREAD, seed)
