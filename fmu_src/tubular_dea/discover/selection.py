"""The search for what is missing: forward round by round, then backward.

A round scores the whole catalogue, refits the best few and every rival near them, and takes the best of those if it
is convincing (`acceptance`). Then earlier effects are exchanged for their rivals, dropped where nothing is lost, and
given their finer form where the record asks for it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from ..identify.fit import Fit, FitError
from ..identify.threads import side_by_side
from ..model.effects import catalogue
from . import bank
from .acceptance import FALSE_ALARMS, accept, all_exact, clean, denied, no_further_effect, settled
from .bank import Score
from .base import AGREE
from .bootstrap import NullScores, null_scores
from .compiled import Ids
from .equivalence import CHANCE, stands_in
from .options import Option, option
from .refit import FULL, first_refit, fit_effects
from .study import Study

ROUNDS = 3
REFITS, NEAR = 5, 0.6  # the best so many, and all whose score is at least this share of the best's
WEAK = 100.0  # below the best score: where evidence is weak, rivals are near even at a small share of it
MOST_REFITS = 10
AT_BEST = 2.5  # times its score that a further effect may be hoped to gain when refitted
DEEPER = 0.02  # of what an effect gains: so much less a base must cost for the search to begin anew
RESTARTED = 3  # of the best refits, from the declared values where they leave more than noise
LITTLE = 12.0  # gain below which an effect is dropped again
MOST_FINER = 4  # rivals that are refined with the choice
LONG = 120  # evaluations until a search that converges slowly is given up

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


@dataclass
class Search:
    """The rounds, the base, the final option, its rivals (best first), and what it gains by each of its effects."""

    base: Option
    chosen: Option
    rounds: list[Round] = field(default_factory=list)
    rivals: list[Option] = field(default_factory=list)
    gains: dict[str, float] = field(default_factory=dict)


def search(study: Study, base_fit: Fit, numeric: float, seed: int, tell: Progress) -> Search:
    """The whole search from the recalibrated base; `numeric` is the gain that the numerics could feign."""
    base = option(study, (), base_fit)
    found = Search(base, base)
    stages: list[Search] = []
    for _ in range(ROUNDS):
        step = _round(study, found, numeric, seed, tell)
        deeper = _deeper(study, found, step.options)
        if deeper is not None:
            return search(study, deeper, numeric, seed, tell)
        found.rounds.append(step)
        if not step.accepted:
            break
        found.chosen = _converged(study, step.options[0], tell)
        found.rivals = [o for o in step.options[1:]]
        found.gains = {found.chosen.ids[-1]: base.misfit - found.chosen.misfit}
        if len(found.chosen.ids) > 1:
            _exchange(study, found, tell)
            _drop(study, found)
        _refine(study, found, tell)
        stages.append(replace(found))
        if clean(found.chosen.adequacy) and not all_exact(found.chosen.ids):
            break
    return _settled(found, stages)


def _deeper(study: Study, found: Search, options: Sequence[Option]) -> Fit | None:
    """A better fit of the base, from where the best refit has its parameters: what let it escape is no effect."""
    if found.chosen.ids or not options:
        return None
    try:
        fitted = fit_effects(study, (), dict(options[0].fitted.values))
    except FitError:
        return None
    least = max(AGREE, DEEPER * (found.base.fitted.cost - options[0].fitted.cost))
    return fitted if fitted.cost < found.base.fitted.cost - least else None


def _settled(found: Search, stages: Sequence[Search]) -> Search:
    """Back to the last choice that the held-out experiments confirm; the later one becomes its rival."""
    best = settled(found.base, [s.chosen for s in stages])
    if best is found.chosen:
        return found
    stage = next((s for s in stages if s.chosen is best), Search(found.base, found.base))
    return replace(stage, rounds=found.rounds, rivals=sorted([*stage.rivals, found.chosen], key=lambda o: -o.evidence))


def _converged(study: Study, chosen: Option, tell: Progress) -> Option:
    """The option, searched on until it has converged: what is left of it must not be a search cut short."""
    if chosen.fitted.converged:
        return chosen
    tell(f"converge {', '.join(chosen.ids)}")
    return option(study, chosen.ids, _further(study, chosen.ids, chosen.fitted, LONG, chosen.refined), chosen.refined)


def _round(study: Study, found: Search, numeric: float, seed: int, tell: Progress) -> Round:
    chosen = found.chosen
    tell("scores of the catalogue")
    listed = bank.candidates(study, chosen.fitted, chosen.ids)
    scored = bank.scores(listed, chosen.fitted.residual, chosen.fitted.jacobian)
    ranked = bank.best_of_each(scored)
    null = null_scores(listed, chosen.fitted.jacobian, seed=seed)
    threshold = max(1.2 * null.threshold(FALSE_ALARMS), numeric)
    if not ranked or ranked[0].gain < threshold:
        return Round(chosen.ids, ranked, null, threshold, [], False, "no score stands out of the nulls'")
    hopeless = no_further_effect(found.base, chosen, AT_BEST * ranked[0].gain, ranked[0].id) if chosen.ids else ""
    if hopeless:
        return Round(chosen.ids, ranked, null, threshold, [], False, hopeless)
    options = _refits(study, chosen, scored, _worth(ranked, threshold), tell)
    if not options:
        return Round(chosen.ids, ranked, null, threshold, [], False, "no candidate could be refitted")
    said = [accept(found.base, chosen, o, threshold) for o in options]
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
    reach = best + max(500.0, 0.3 * (chosen.fitted.cost - best))

    def finish(name: str) -> Option:
        together, fitted = (*chosen.ids, name), begun[name]
        if fitted.cost < reach:
            tell(f"refit with {name}")
            fitted = _further(study, together, fitted, FULL, chosen.refined)
        return option(study, together, fitted, chosen.refined)

    options = sorted(side_by_side(finish, begun), key=lambda o: -o.evidence)
    again = side_by_side(lambda o: _from_declared(study, o), options[:RESTARTED])
    return sorted([*again, *options[RESTARTED:]], key=lambda o: -o.evidence)


def _further(study: Study, ids: Ids, begun: Fit, evaluations: int, refined: Ids) -> Fit:
    """The fit, searched on; as it is where the model has no answer on the way."""
    try:
        return fit_effects(study, ids, dict(begun.values), evaluations, refined)
    except FitError:
        return begun


def _from_declared(study: Study, found: Option) -> Option:
    """The option, if it leaves more than noise searched again from the base's declared values: what is missing may have
    led the base far off."""
    if clean(found.adequacy):
        return found
    try:
        start = found.fitted.values | study.compiled.base.parameter_values()
        fitted = fit_effects(study, found.ids, start, refined=found.refined)
    except FitError:
        return found
    return option(study, found.ids, fitted, found.refined) if fitted.cost < found.fitted.cost else found


def _distinct(shapes: Sequence[Score]) -> list[Score]:
    """The best shape, and the next one where it scores nearly as much."""
    return [s for s in shapes[:2] if s.gain > 0.5 * shapes[0].gain]


def _exchange(study: Study, found: Search, tell: Progress) -> None:
    """Every earlier effect against the rivals it had: in company another may do better, if it was not far behind."""
    for place, name in enumerate(found.chosen.ids[:-1]):
        rest = tuple(i for i in found.chosen.ids if i != name)
        for rival in _earlier_rivals(found, place)[:2]:
            if rival in found.chosen.ids:
                continue
            tell(f"{rival} in place of {name}")
            start = dict(found.chosen.fitted.values) | dict(catalogue()[rival].typical) | _fitted_alone(found, rival)
            refined = tuple(i for i in found.chosen.refined if i in rest)
            try:
                fitted = fit_effects(study, (rival, *rest), start, refined=refined)
            except FitError:
                continue
            other = option(study, (rival, *rest), fitted, refined)
            better, worse = (other, found.chosen) if other.evidence > found.chosen.evidence else (found.chosen, other)
            found.chosen = better
            found.rivals = sorted([worse, *found.rivals], key=lambda o: -o.evidence)


def _earlier_rivals(found: Search, place: int) -> list[str]:
    """The rivals of the effect at `place` that lacked no more than a few times what the effects after it brought."""
    if place >= len(found.rounds):
        return []
    best, *others = found.rounds[place].options
    brought = best.fitted.cost - found.chosen.fitted.cost
    return [o.ids[-1] for o in others if o.fitted.cost - best.fitted.cost < AT_BEST * brought]


def _fitted_alone(found: Search, name: str) -> dict[str, float]:
    """The parameters that an effect had in an earlier round."""
    for step in found.rounds:
        for o in step.options:
            if o.ids[-1] == name:
                return {
                    q.name: o.fitted.values[q.name] for q in catalogue()[name].parameters if q.name in o.fitted.values
                }
    return {}


def _drop(study: Study, found: Search) -> None:
    """Without each effect in turn: it goes where next to nothing is lost; what is lost otherwise is its gain."""
    for name in found.chosen.ids:
        rest = tuple(i for i in found.chosen.ids if i != name)
        try:
            refined = tuple(i for i in found.chosen.refined if i in rest)
            fitted = fit_effects(study, rest, dict(found.chosen.fitted.values), refined=refined)
            without = option(study, rest, fitted, refined)
        except FitError:
            found.gains[name] = found.base.misfit - found.chosen.misfit
            continue
        found.gains[name] = without.misfit - found.chosen.misfit
        if without.fitted.cost - found.chosen.fitted.cost < LITTLE:
            found.chosen = without


def _refine(study: Study, found: Search, tell: Progress) -> None:
    """Finer forms of the effects that are in, where the record asks for them; then of the near rivals' too."""
    if clean(found.chosen.adequacy):
        return
    coarse = found.chosen
    for name in coarse.ids:
        if not catalogue()[name].refine or name in found.chosen.refined:
            continue
        finer = _finer(study, found.chosen, (name,), tell)
        if finer and finer.evidence > found.chosen.evidence + 10 and not denied(found.chosen, finer):
            found.chosen = finer
    if found.chosen is not coarse:
        _refine_rivals(study, found, coarse, tell)


def _refine_rivals(study: Study, found: Search, coarse: Option, tell: Progress) -> None:
    """The rivals that came near the coarse form of the choice, with as fine forms as it has now; the best is chosen."""
    near = [r for r in found.rivals if stands_in(r, coarse, found.gains)]

    def refined(rival: Option) -> Option:
        wanted = [i for i in rival.ids if catalogue()[i].refine and (i in found.chosen.refined or i not in coarse.ids)]
        finer = _finer(study, rival, wanted, tell) if rival in near[:MOST_FINER] and wanted else None
        return finer if finer and finer.evidence > rival.evidence else rival

    everyone = sorted([found.chosen, *side_by_side(refined, found.rivals)], key=lambda o: -o.evidence)
    pair = stands_in(everyone[0], found.chosen, found.gains)
    if pair:
        found.gains[pair[1]] = found.gains.pop(pair[0])
    found.chosen, *found.rivals = everyone


def _finer(study: Study, present: Option, names: Sequence[str], tell: Progress) -> Option | None:
    """The option with the finer form of some of its effects; None without answer."""
    tell(f"finer form of {', '.join(names)}")
    refined = (*present.refined, *(n for n in names if n not in present.refined))
    try:
        fitted = fit_effects(study, present.ids, dict(present.fitted.values), refined=refined)
    except FitError:
        return None
    return option(study, present.ids, fitted, refined)
