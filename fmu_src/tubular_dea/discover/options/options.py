"""Options, which the search compares: sets of effects, fitted and validated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...identify.fitting.compiled import Ids
from ...identify.fitting.fit import Fit, FitError
from ...identify.fitting.problem import Problem
from ...identify.study.study import Study, log_determinant
from ..scores.levels import passed
from ..scores.parameters import strengths_at_bounds
from .refit import fit_effects
from .residuals import LackOfFit, lack_of_fit
from .validation import folds, held_out_residual, left_out, predictive_deviance

# Set by measurement: a prestretch of two directions left C_1 known to a factor of 50, which was known to 0.3 %.
# Check: `pytest tests/test_rounds.py -k vaguer`
VAGUER = 30.0  # [1] times by which a finer form makes the error larger of what was known that well (to a thirtieth)


@dataclass(frozen=True)
class Option:
    """Effects `ids` fitted: the fit, and its residuals on data that took no part in it.

    `blocks` and `experiments` are what fits without them predict of blocks, and of experiments, left out in turn
    (`validation`), `unseen` (N,) the white residual of the held-out experiments. `widths` are the logarithms of the
    determinants that the records' own numbers give the likelihood, in training and held out: sums of squares compare
    with these alone, where options have records with other numbers of their own. `exact` is True where all the effects
    have only one form, so that any remaining residual has another cause. `pinned` are effects whose strength ended at a
    bound: the records ask for more than they can be. `unreached` are those with a level that no record passes.
    """

    ids: Ids
    fitted: Fit
    blocks: float
    experiments: float
    unseen: np.ndarray
    lack_of_fit: LackOfFit
    refined: Ids = ()
    exact: bool = False
    pinned: Ids = ()
    unreached: Ids = ()
    widths: tuple[float, float] = (0.0, 0.0)

    @property
    def impossible(self) -> Ids:
        """The effects that cannot be as they were fitted."""
        return (*self.pinned, *self.unreached)

    def wrong_with(self, effect: str) -> str:
        """What an effect that cannot be as it was fitted would have."""
        return "an implausible strength" if effect in self.pinned else "a level that no record passes"

    @property
    def cost(self) -> float:
        """Minus twice the logarithm of the likelihood of the training, up to a constant."""
        return self.fitted.cost + self.widths[0]

    @property
    def cross_validated(self) -> float:
        """The same of blocks left out in turn."""
        return self.blocks + self.widths[0]

    @property
    def across(self) -> float:
        """The same of experiments left out in turn."""
        return self.experiments + self.widths[0]

    @property
    def held_out(self) -> float:
        """The same of the held-out experiments; 0 where there are none."""
        return self.unseen_squares + self.widths[1]

    @property
    def misfit(self) -> float:
        """The same of all experiments, in training and held out."""
        return self.cost + self.held_out

    @property
    def unseen_squares(self) -> float:
        """The sum of squares of the held-out experiments, in units of the noise."""
        return float(self.unseen @ self.unseen)

    @property
    def squares(self) -> float:
        """The sum of squares of all experiments, in units of the noise."""
        return self.fitted.cost + self.unseen_squares

    def gain_over(self, before: Option) -> float:
        """By how much the misfit falls from that of `before`; in training alone where one of them has no answer in a
        held-out experiment, which tells no size of a gain."""
        gained = before.misfit - self.misfit
        return gained if np.isfinite(gained) else before.cost - self.cost

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


def finer_form(study: Study, one: Option, names: Sequence[str]) -> Option | None:
    """An option with the finer form of its effects `names`; None where that cannot be fitted, or says what others do:
    where what it adds leaves parameters of the plant unknown that were known well."""
    finer = fitted_option(study, one.ids, one.fitted.values, (*one.refined, *names))
    if finer is None:
        return None
    effects = {q.name for i in one.ids for q in study.catalogue[i].parameters}
    before, after = _relative_errors(one.fitted), _relative_errors(finer.fitted)
    known = {n: e for n, e in before.items() if n not in effects and e < 1 / VAGUER}
    return None if any(after[n] > VAGUER * e for n, e in known.items()) else finer


def _relative_errors(fitted: Fit) -> dict[str, float]:
    """The standard errors of the fitted parameters, as shares of their values."""
    return {n: fitted.stderr[n] / abs(fitted.values[n]) if fitted.values[n] else np.inf for n in fitted.names}


def problem_of(study: Study, one: Option) -> Problem:
    """The problem of which an option is the fit: its free parameters, with the others where they are."""
    fixed = {n: v for n, v in one.fitted.values.items() if n not in one.fitted.names}
    return study.problem(one.ids, one.fitted.free, fixed)


def option(study: Study, ids: Ids, fitted: Fit, refined: Ids = ()) -> Option:
    """A fit with its validation."""
    blocks, experiments = folds(study.training, fitted.residual.size)
    return Option(
        ids,
        fitted,
        left_out(fitted, blocks),
        predictive_deviance(fitted, experiments),
        held_out_residual(study, ids, fitted),
        lack_of_fit(study, fitted),
        refined,
        all(study.catalogue[i].exact for i in ids),
        tuple(i for i in ids if strengths_at_bounds(study.catalogue[i], fitted)),
        _unreached(study, ids, fitted),
        (log_determinant(study.training), log_determinant(study.held_out)),
    )


def _unreached(study: Study, ids: Ids, fitted: Fit) -> Ids:
    """The effects with a level that its state never passes in training."""
    ranges = passed(study, ids, fitted.values, [study.catalogue[i] for i in ids])
    watched = [(i, level, state) for i in ids for level, state in study.catalogue[i].levels.items() if state in ranges]
    return tuple(i for i, level, state in watched if not ranges[state][0] < fitted.values[level] < ranges[state][1])
