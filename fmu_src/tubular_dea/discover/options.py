"""A set of effects, fitted and validated: what the search compares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..identify.fit import Fit, FitError
from .compiled import Ids
from .refit import fit_effects
from .residuals import Adequacy, adequacy
from .study import Study
from .validation import cross_validated, held_out_cost


@dataclass(frozen=True)
class Option:
    """Effects `ids` fitted: the fit, and its sums of squares on blocks and experiments that had no part in it."""

    ids: Ids
    fitted: Fit
    cross_validated: float
    held_out: float
    adequacy: Adequacy
    refined: Ids = ()

    @property
    def misfit(self) -> float:
        """The sum of squares of all experiments: those it was fitted to and those held out."""
        return self.fitted.cost + self.held_out

    @property
    def evidence(self) -> float:
        """Minus half of the misfit and of the price of the parameters (log of the samples each)."""
        return -0.5 * (self.misfit + len(self.fitted.names) * float(np.log(self.fitted.residual.size)))


def fitted_option(study: Study, ids: Ids, start: Mapping[str, float], refined: Sequence[str]) -> Option | None:
    """Effects `ids` fitted from `start` (SI), those of them in `refined` in their finer form; None without answer."""
    finer = tuple(i for i in ids if i in refined)
    try:
        return option(study, ids, fit_effects(study, ids, dict(start), refined=finer), finer)
    except FitError:
        return None


def option(study: Study, ids: Ids, fitted: Fit, refined: Ids = ()) -> Option:
    """A fit with its validation."""
    return Option(ids, fitted, cross_validated(fitted, study.training), held_out_cost(study, ids, fitted),
                  adequacy(study, fitted), refined)  # fmt: skip
