"""One round of the search: the catalogue scored, the best few and every rival near them refitted, the best judged."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ..identify.fit import Fit
from ..identify.threads import side_by_side
from ..model.effects import catalogue
from . import bank
from .acceptance import FALSE_ALARMS, accept, clean, no_further_effect
from .bank import Score
from .bootstrap import NullScores, null_scores
from .compiled import Ids
from .equivalence import CHANCE
from .options import Option, fitted_option, option
from .refit import FULL, first_refit, further
from .study import Study

REFITS, NEAR = 5, 0.6  # the best so many, and all whose score is at least this share of the best's
MARGIN = 1.2  # over the bootstrap's threshold, as the noise is not known exactly
WEAK = 100.0  # below the best score: where evidence is weak, rivals are near even at a small share of it
MOST_REFITS = 10
AT_BEST = 2.5  # times its score that a further effect may be hoped to gain when refitted
LEAST_REACH, REACH = 500.0, 0.3  # above the best refit, and as a share of its gain: the others are refitted to the end
RESTARTED = 3  # of the best refits, from the declared values where they leave more than noise

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Round:
    """One step of the search: scores of the catalogue, the null's largest, refitted options (best first), choice."""

    present: Ids
    scores: list[Score]
    null: NullScores
    threshold: float
    options: list[Option]
    accepted: bool
    reason: str


def take_round(study: Study, base: Option, chosen: Option, numeric: float, seed: int, tell: Progress) -> Round:
    """The next effect beside those of `chosen`; `numeric` is the gain that the numerics could feign."""
    tell("scores of the catalogue")
    listed = bank.candidates(study, chosen.fitted, chosen.ids)
    scored = bank.scores(listed, chosen.fitted.residual, chosen.fitted.jacobian)
    ranked = bank.best_of_each(scored)
    null = null_scores(listed, chosen.fitted.jacobian, seed=seed)
    threshold = max(MARGIN * null.threshold(FALSE_ALARMS), numeric)
    if ranked[0].gain < threshold:
        return Round(chosen.ids, ranked, null, threshold, [], False, "no score stands out of the nulls'")
    hopeless = no_further_effect(base, chosen, AT_BEST * ranked[0].gain, ranked[0].id) if chosen.ids else ""
    if hopeless:
        return Round(chosen.ids, ranked, null, threshold, [], False, hopeless)
    options = _refits(study, chosen, scored, _worth(ranked, threshold), tell)
    if not options:
        return Round(chosen.ids, ranked, null, threshold, [], False, "no candidate could be refitted")
    said = [accept(base, chosen, o, threshold) for o in options]
    good = [i for i, (accepted, _) in enumerate(said) if accepted]
    best = _plainest(options, good) if good else 0
    options = [options[best], *options[:best], *options[best + 1 :]]
    return Round(chosen.ids, ranked, null, threshold, options, *said[best])


def _plainest(options: Sequence[Option], good: Sequence[int]) -> int:
    """Of the options at the places `good`, the best; of equals a monitor's fault, before one of the tube."""
    equal = [i for i in good if 2 * (options[good[0]].evidence - options[i].evidence) < CHANCE]
    return next((i for i in equal if catalogue()[options[i].ids[-1]].channel in ("pressure", "sensor")), good[0])


def _worth(ranked: Sequence[Score], threshold: float) -> list[str]:
    """The ids that are refitted: the best few, and all that score near the best."""
    standing = [s for s in ranked if s.gain > 0.5 * threshold]
    near = [s for s in standing if s.gain >= min(NEAR * standing[0].gain, standing[0].gain - WEAK)]
    return [s.id for s in standing[: max(REFITS, min(len(near), MOST_REFITS))]]


def _refits(study: Study, chosen: Option, scored: Sequence[Score], ids: Sequence[str], tell: Progress) -> list[Option]:
    """The candidates refitted: all of them some steps, those within reach of the best until they converge."""

    def begin(name: str) -> Fit | None:
        tell(f"refit with {name}")
        shapes = [s for s in scored if s.id == name and s.gain > 0]
        return first_refit(study, chosen.ids, chosen.fitted, _distinct(shapes), chosen.refined)

    begun = {name: fitted for name, fitted in zip(ids, side_by_side(begin, ids), strict=True) if fitted is not None}
    best = min((f.cost for f in begun.values()), default=0.0)
    reach = best + max(LEAST_REACH, REACH * (chosen.fitted.cost - best))

    def finish(name: str) -> Option:
        together, fitted = (*chosen.ids, name), begun[name]
        if fitted.cost < reach:
            tell(f"refit with {name}")
            fitted = further(study, together, fitted, FULL, chosen.refined)
        return option(study, together, fitted, chosen.refined)

    options = sorted(side_by_side(finish, begun), key=lambda o: -o.evidence)
    again = side_by_side(lambda o: _from_declared(study, o), options[:RESTARTED])
    return sorted([*again, *options[RESTARTED:]], key=lambda o: -o.evidence)


def _from_declared(study: Study, found: Option) -> Option:
    """The option, if it leaves more than noise searched again from the base's declared values: what is missing may have
    led the base far off."""
    if clean(found.adequacy):
        return found
    start = found.fitted.values | study.compiled.base.parameter_values()
    again = fitted_option(study, found.ids, start, found.refined)
    return again if again and again.fitted.cost < found.fitted.cost else found


def _distinct(shapes: Sequence[Score]) -> list[Score]:
    """The best shape, and the next one where it scores nearly as much."""
    return [s for s in shapes[:2] if s.gain > 0.5 * shapes[0].gain]
