"""The base model with its own parameters refitted: the ground that every candidate is measured from.

A base that has not converged produces false names, so the search starts from several places.
"""

from __future__ import annotations

from ..identify.fit import Fit, FitError, fit
from .parameters import base_parameters
from .study import Study

STARTS = 3
AGREE = 2.0  # by how much the costs of converged searches may differ


def recalibrate(study: Study, starts: int = STARTS, seed: int = 0) -> Fit:
    """The best fit of the base model to the training pieces from `starts` starts around the declared values."""
    problem = study.problem((), base_parameters(study.compiled.base), {})
    defaults = study.compiled.base.parameter_values()
    try:
        return fit(problem, defaults, starts, 0.08, seed)
    except FitError:
        return fit(problem, {n: v * 1.2 if n in ("C_1", "C_3") else v for n, v in defaults.items()}, starts, 0.15, seed)
