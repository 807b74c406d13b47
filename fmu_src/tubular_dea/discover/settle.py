"""Options with the nuisance parameters that they make likely themselves: starts, zeros, switching instants, delays."""

from __future__ import annotations

from ..identify.adjust import MOST_SETTLES, adjusted
from ..identify.fit import AGREE
from ..identify.study import Study
from .acceptance import clean
from .options import Option, fitted_option


def own_nuisances(study: Study, one: Option) -> tuple[Study, Option]:
    """An option with nuisance parameters as it makes them likely itself, and the study that has these.

    A start under load and the parameters that it is estimated with change together, in several steps. Where more than
    noise is left, parameters that a fit may lose (`Plant.restart`) begin once more at their declared values.
    """
    study, one = iterated(study, one)
    if clean(one.lack_of_fit):
        return study, one
    again = fitted_option(study, one.ids, one.fitted.values | study.plant.restarts, one.refined)
    if again is None or not study.plant.restart:
        return study, one
    return min((study, one), iterated(study, again), key=lambda settled: settled[1].misfit)


def iterated(study: Study, one: Option) -> tuple[Study, Option]:
    """An option and its nuisance parameters, each taken anew until the option gains no more."""
    for _ in range(MOST_SETTLES):
        moved = adjusted(study, one.ids, one.fitted.values, one.fitted.free)
        again = fitted_option(moved, one.ids, one.fitted.values, one.refined)
        if again is None:
            break
        gained = one.misfit - again.misfit
        study, one = moved, again
        if abs(gained) < AGREE:
            break
    return study, one
