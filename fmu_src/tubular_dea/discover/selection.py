"""The search for effects: forward selection in rounds (`rounds`), each followed by a `revision`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..identify.adjust import adjusted
from ..identify.fit import Fit, FitError
from ..identify.study import Study
from .acceptance import far, finished, settled
from .base import AGREE
from .options import Option, fitted_option, option
from .refit import fit_effects, further
from .revision import Search, revise
from .rounds import Progress, take_round

# Set by judgement. Check: `python -m measured.table`, `python -m blind.score --pairs 20 --seed 1000`
ROUNDS = 3  # [1] effects that are sought one after the other
MOST_ROUNDS = 5  # [1] the same where models are far from the plant

# Set by judgement. Check: `pytest tests/test_unusual_recordings.py::test_a_tube_far_from_table_3_gets_the_best_base`,
# `python -m blind.score --singles 2 --seed 1000`
DEEPER = 0.02  # [1] share of what an effect gains: a base that costs so much less begins the search anew
LONG_SEARCH = 120  # [evaluations] until a search that converges slowly is given up


def search(study: Study, base_fit: Fit, numeric: float, seed: int, tell: Progress) -> Search:
    """The whole search from the recalibrated base; `numeric` is the gain that numerical errors may cause."""
    base = option(study, (), base_fit)
    found = Search(base, base, study, study)
    stages: list[Search] = []
    for number in range(MOST_ROUNDS):
        if number >= ROUNDS and not far(found.chosen):
            break
        step = take_round(found.study, base, found.chosen, numeric, seed, tell)
        deeper = _better_base(study, found, step.options)
        if deeper is not None:
            return search(study, deeper, numeric, seed, tell)
        found.rounds.append(step)
        if not step.accepted:
            break
        found.chosen = _converged(found.study, step.options[0], tell)
        found.rivals = step.options[1:]
        found.gains = {found.chosen.ids[-1]: base.misfit - found.chosen.misfit}
        revise(found.study, found, tell)
        _settle(found, tell)
        stages.append(replace(found))
        if finished(base, found.chosen):
            break
    return _settled(found, stages)


def _settle(found: Search, tell: Progress) -> None:
    """Estimate the nuisance parameters again with the chosen effects, and refit the choice."""
    chosen = found.chosen
    tell("switching instants and zeros")
    study = adjusted(found.study, chosen.ids, chosen.fitted.values, chosen.fitted.free)
    again = fitted_option(study, chosen.ids, chosen.fitted.values, chosen.refined)
    if again is not None:
        found.study, found.chosen = study, again


def _better_base(study: Study, found: Search, options: Sequence[Option]) -> Fit | None:
    """A better fit of the base, started from the parameters of the best refit: then a local minimum was the cause."""
    if found.chosen.ids or not options:
        return None
    try:
        fitted = fit_effects(study, (), dict(options[0].fitted.values))
    except FitError:
        return None
    least = max(AGREE, DEEPER * (found.base.fitted.cost - options[0].fitted.cost))
    return fitted if fitted.cost < found.base.fitted.cost - least else None


def _settled(found: Search, stages: Sequence[Search]) -> Search:
    """Return to the last choice that the held-out experiments do not contradict; the later one becomes its rival."""
    best = settled(found.base, [s.chosen for s in stages])
    if best is found.chosen:
        return found
    nothing = Search(found.base, found.base, found.base_study, found.base_study)
    stage = next((s for s in stages if s.chosen is best), nothing)
    return replace(stage, rounds=found.rounds, rivals=sorted([*stage.rivals, found.chosen], key=lambda o: -o.evidence))


def _converged(study: Study, chosen: Option, tell: Progress) -> Option:
    """The option, fitted until it has converged: its residual must not come from an unfinished fit."""
    if chosen.fitted.converged:
        return chosen
    tell(f"converge {', '.join(chosen.ids)}")
    fitted = further(study, chosen.ids, chosen.fitted, LONG_SEARCH, chosen.refined)
    return option(study, chosen.ids, fitted, chosen.refined)
