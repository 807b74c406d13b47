"""Options, which the search compares: sets of effects, fitted and validated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..identify.compiled import Ids
from ..identify.fit import Fit, FitError
from ..identify.study import Study
from .levels import passed
from .parameters import at_bounds
from .refit import fit_effects
from .residuals import LackOfFit, lack_of_fit
from .validation import folds, held_out_residual, left_out


@dataclass(frozen=True)
class Option:
    """Effects `ids` fitted: the fit, and its residuals on data that took no part in it.

    `cross_validated` is the sum of squares of blocks left out in turn, `across` that of experiments left out in turn,
    `unseen` (N,) the white residual of the held-out experiments. `exact` is True where all the effects have only one
    form, so that any remaining residual has another cause. `pinned` are effects whose strength ended at a bound: the
    records ask for more than they can be. `unreached` are those with a level that no record passes.
    """

    ids: Ids
    fitted: Fit
    cross_validated: float
    across: float
    unseen: np.ndarray
    lack_of_fit: LackOfFit
    refined: Ids = ()
    exact: bool = False
    pinned: Ids = ()
    unreached: Ids = ()

    @property
    def impossible(self) -> Ids:
        """The effects that cannot be as they were fitted."""
        return (*self.pinned, *self.unreached)

    @property
    def held_out(self) -> float:
        """The sum of squares of the held-out experiments, in units of the noise; 0 where there are none."""
        return float(self.unseen @ self.unseen)

    @property
    def misfit(self) -> float:
        """The sum of squares of all experiments, in training and held out."""
        return self.fitted.cost + self.held_out

    @property
    def evidence(self) -> float:
        """Log evidence by BIC: minus half of the misfit and of the penalty, log(samples) for each parameter."""
        return -0.5 * (self.misfit + len(self.fitted.names) * float(np.log(self.fitted.residual.size)))


def fitted_option(study: Study, ids: Ids, start: Mapping[str, float], refined: Sequence[str]) -> Option | None:
    """Effects `ids` fitted from `start` (SI), those in `refined` in their finer form; None where that fails."""
    finer = tuple(i for i in ids if i in refined)
    try:
        return option(study, ids, fit_effects(study, ids, dict(start), refined=finer), finer)
    except FitError:
        return None


def option(study: Study, ids: Ids, fitted: Fit, refined: Ids = ()) -> Option:
    """A fit with its validation."""
    blocks, experiments = (left_out(fitted, fold) for fold in folds(study.training, fitted.residual.size))
    return Option(
        ids,
        fitted,
        blocks,
        experiments,
        held_out_residual(study, ids, fitted),
        lack_of_fit(study, fitted),
        refined,
        all(study.catalogue[i].exact for i in ids),
        tuple(i for i in ids if any(n in study.catalogue[i].off for n in at_bounds(study.catalogue[i], fitted))),
        _unreached(study, ids, fitted),
    )


def _unreached(study: Study, ids: Ids, fitted: Fit) -> Ids:
    """The effects with a level that its state never passes in training."""
    ranges = passed(study, ids, fitted.values, [study.catalogue[i] for i in ids])
    watched = [(i, level, state) for i in ids for level, state in study.catalogue[i].levels.items() if state in ranges]
    return tuple(i for i, level, state in watched if not ranges[state][0] < fitted.values[level] < ranges[state][1])
