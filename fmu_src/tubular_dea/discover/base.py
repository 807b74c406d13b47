"""The base model with its own parameters refitted: the ground that every candidate is measured from.

A base that has not converged produces false names, so the search starts from several places, one of them with the
declared viscous parameters: a Maxwell branch that became very fast by the way does not come back by itself.
"""

from __future__ import annotations

from collections.abc import Mapping

from ..identify.fit import Fit, FitError, fit
from ..identify.problem import Problem
from ..identify.procedure import VISCOUS
from ..identify.threads import side_by_side
from .parameters import base_parameters
from .study import Study

STARTS = 3
MOVE = 0.1  # relative distance of the further starts
CONFIRM = 15  # evaluations they have
AGREE = 2.0  # by how much the costs of converged searches may differ


def recalibrate(study: Study, starts: int = STARTS, seed: int = 0, start: Mapping[str, float] | None = None) -> Fit:
    """The best fit of the base model to the training pieces: from `start` (the declared values), then from around it.

    The first search runs until it converges; the others start around where it ended and confirm it, or go on from a
    better place.
    """
    problem = study.problem((), base_parameters(study.compiled.base), {})
    best = _somewhere(problem, study.compiled.base.parameter_values() if start is None else start, seed)

    declared = {n: v for n, v in study.compiled.base.parameter_values().items() if n in VISCOUS}

    def confirm(number: int) -> Fit:
        begin, move = (best.values | declared, 0.0) if number == 1 else (best.values, MOVE)
        try:
            return fit(problem, begin, 1, evaluations=CONFIRM, move=move, seed=seed + number)
        except FitError:  # a tube that bursts is no better place
            return best

    other = min([best, *side_by_side(confirm, range(1, starts))], key=lambda f: f.cost)
    return fit(problem, other.values, 1) if other.cost < best.cost - AGREE else best


def _somewhere(problem: Problem, start: Mapping[str, float], seed: int) -> Fit:
    """From `start`, or from stiffer tubes where the model has no answer there (it bursts)."""
    for stiffer in (1.0, 1.2, 1.5):
        try:
            return fit(
                problem, {n: v * (stiffer if n.startswith("C_") else 1.0) for n, v in start.items()}, 1, seed=seed
            )
        except FitError:
            continue
    return fit(problem, start, 4, 0.3, seed)
