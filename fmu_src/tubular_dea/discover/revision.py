"""Revision of the effects found so far: some are replaced, dropped, or given their finer form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ..identify.study import Study
from ..identify.threads import side_by_side
from .acceptance import clean, denied
from .equivalence import CHANCE, error_reach, stands_in
from .options import Option, fitted_option
from .rounds import AT_BEST, Progress, Round

# Set by judgement: very strong evidence, and a bound on the cost. Check: `pytest tests/test_acceptance.py`,
# `python -m blind.score --pairs 20 --seed 1000`
FINER_GAIN = 10.0  # [log evidence] that a finer form must bring
MOST_FINER = 4  # [1] rivals that are refined with the choice
PROMISING = 0.7  # [1] share of the choice's gain that a rival may lose whose finer form is tried
EXCHANGED = 2  # [1] earlier rivals that are tried in place of an effect


@dataclass
class Search:
    """The rounds, the base, the final option, its rivals (best first), and the gain of each of its effects.

    `study` has the nuisance parameters as estimated with the choice, `base_study` as estimated with the base.
    """

    base: Option
    chosen: Option
    study: Study
    base_study: Study
    rounds: list[Round] = field(default_factory=list)
    rivals: list[Option] = field(default_factory=list)
    gains: dict[str, float] = field(default_factory=dict)


def revise(study: Study, found: Search, tell: Progress) -> None:
    """After a round: replace earlier effects by rivals, drop effects, refine forms, where that is better."""
    if len(found.chosen.ids) > 1:
        _exchange(study, found, tell)
        _drop(study, found)
    _refine(study, found, tell)


def _exchange(study: Study, found: Search, tell: Progress) -> None:
    """Replace an earlier effect by a close rival of its round where that fits better with the later effects, or where
    it cannot be as it was fitted with them."""
    for place, name in enumerate(found.chosen.ids[:-1]):
        rest = tuple(i for i in found.chosen.ids if i != name)
        for rival in _earlier_rivals(found, place)[:EXCHANGED]:
            if rival in found.chosen.ids:
                continue
            tell(f"{rival} in place of {name}")
            usual = dict(study.catalogue[rival].typical) | _fitted_alone(study, found, rival)
            start = dict(found.chosen.fitted.values) | usual
            other = fitted_option(study, (rival, *rest), start, found.chosen.refined)
            if other is None:
                continue
            gained = 2 * (other.evidence - found.chosen.evidence)
            needed = name in found.chosen.impossible or gained > error_reach(found.chosen)
            ahead = needed and rival not in other.impossible
            better, worse = (other, found.chosen) if ahead else (found.chosen, other)
            found.chosen = better
            found.rivals = sorted([worse, *found.rivals], key=lambda o: -o.evidence)


def _earlier_rivals(found: Search, place: int) -> list[str]:
    """The rivals of the effect at `place` that were behind by no more than a few times the gain of later effects."""
    if place >= len(found.rounds):
        return []
    best, *others = found.rounds[place].options
    brought = best.fitted.cost - found.chosen.fitted.cost
    return [o.ids[-1] for o in others if o.fitted.cost - best.fitted.cost < AT_BEST * brought]


def _fitted_alone(study: Study, found: Search, name: str) -> dict[str, float]:
    """The parameters of an effect in an earlier round."""
    for step in found.rounds:
        for o in step.options:
            if o.ids[-1] == name:
                names = [q.name for q in study.catalogue[name].parameters]
                return {n: o.fitted.values[n] for n in names if n in o.fitted.values}
    return {}


def _drop(study: Study, found: Search) -> None:
    """Drop each effect whose removal costs almost nothing; for the others that cost is their gain."""
    for name in found.chosen.ids:
        rest = tuple(i for i in found.chosen.ids if i != name)
        without = fitted_option(study, rest, found.chosen.fitted.values, found.chosen.refined)
        if without is None:
            found.gains[name] = found.base.misfit - found.chosen.misfit
            continue
        found.gains[name] = without.misfit - found.chosen.misfit
        if without.fitted.cost - found.chosen.fitted.cost < CHANCE:
            found.chosen = without


def _refine(study: Study, found: Search, tell: Progress) -> None:
    """Use finer forms of the chosen effects where the recordings support them; then of promising rivals too."""
    coarse = found.chosen
    for name in coarse.ids:
        if clean(coarse.lack_of_fit) or not study.catalogue[name].refine or name in found.chosen.refined:
            continue
        finer = _finer(study, found.chosen, (name,), tell)
        if finer and finer.evidence > found.chosen.evidence + FINER_GAIN and not denied(found.chosen, finer):
            found.chosen = finer
    _refine_rivals(study, found, coarse, tell)


def _refine_rivals(study: Study, found: Search, coarse: Option, tell: Progress) -> None:
    """Refine the rivals that may pass the choice in a finer form, as it was refined; choose the best."""
    near = [r for r in found.rivals if stands_in(r, coarse, found.gains) or _promising(r, coarse, found.gains)]

    def refined(rival: Option) -> Option:
        finest = [i for i in rival.ids if i in found.chosen.refined or i not in coarse.ids]
        wanted = [i for i in finest if study.catalogue[i].refine]
        finer = _finer(study, rival, wanted, tell) if rival in near[:MOST_FINER] and wanted else None
        return finer if finer and finer.evidence > rival.evidence else rival

    everyone = sorted([found.chosen, *side_by_side(refined, found.rivals)], key=lambda o: -o.evidence)
    good = [o for o in everyone if o is found.chosen or not o.impossible]
    best = next(o for o in good if o.fitted.cost <= found.chosen.fitted.cost)
    pair = stands_in(best, found.chosen, found.gains)
    if pair:
        found.gains[pair[1]] = found.gains.pop(pair[0])
    found.chosen, found.rivals = best, [o for o in everyone if o is not best]


def _promising(rival: Option, coarse: Option, gains: Mapping[str, float]) -> bool:
    """Whether a rival brought a good part of what the last effect of the choice did, in their coarse forms."""
    alike = rival.ids[:-1] == coarse.ids[:-1] and rival.ids[-1] not in coarse.ids
    return alike and rival.misfit - coarse.misfit < PROMISING * gains.get(coarse.ids[-1], 0.0)


def _finer(study: Study, present: Option, names: Sequence[str], tell: Progress) -> Option | None:
    """The option with the finer form of some of its effects; None where that fails."""
    tell(f"finer form of {', '.join(names)}")
    return fitted_option(study, present.ids, present.fitted.values, (*present.refined, *names))
