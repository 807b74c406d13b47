"""Revision of the effects found so far: some are replaced, dropped, or given their finer form."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

from ...identify.study.study import Study
from ...identify.threads import side_by_side
from ..options.acceptance import bounded_away, clean, denied, far
from ..options.options import Option, finer_form, fitted_option
from ..options.refit import best_of_starts
from ..scores.parameters import at_bounds, unusual
from .equivalence import CHANCE, FORM_SHARE, error_reach, stands_in, told_apart
from .rounds import AT_BEST, Progress, Round
from .settle import iterated

# Set by judgement: very strong evidence, and a bound on the cost. Check: `pytest tests/test_revision.py`,
# `python -m blind.score --pairs 20 --seed 1000`
FINER_GAIN = 10.0  # [log evidence] that a finer form must bring
MOST_FINER = 4  # [1] rivals that are refined with the choice
PROMISING = 0.7  # [1] share of the choice's gain that a rival may lose whose finer form is tried
EXCHANGED = 2  # [1] earlier rivals that are tried in place of an effect

# Set by measurement: a drive with dry friction and an offset of its force. Alone, dry friction is behind a quadratic
# resistance and three more, together the two leave an eighth. Check: `pytest tests/test_revision.py`
FAR_EXCHANGED = 6  # [1] the same where models are far from the plant

# Set by measurement: a mass of 0.29 kg (0.035 is usual) stood for an average over 16 ms in the laser beside its lag.
# Check: `pytest tests/test_revision.py -k usual`
TOO_UNUSUAL = 5.0  # [1] times its usual size (and an equivalent's) from which on that equivalent is chosen


@dataclass
class Search:
    """The rounds, the base, the final option, its rivals (best first), and the gain of each of its effects.

    `study` has the nuisance parameters as estimated with the choice, `base_study` as estimated with the base.
    `withdrawn` says of effects why they were taken back.
    """

    base: Option
    chosen: Option
    study: Study
    base_study: Study
    rounds: list[Round] = field(default_factory=list)
    rivals: list[Option] = field(default_factory=list)
    gains: dict[str, float] = field(default_factory=dict)
    withdrawn: dict[str, str] = field(default_factory=dict)


def revise(found: Search, tell: Progress) -> None:
    """After a round: replace earlier effects by rivals, drop effects, refine forms, where that is better."""
    if len(found.chosen.ids) > 1:
        _exchange(found, tell)
        _drop(found)
    coarse = found.chosen
    _refine(found, tell)
    if len(coarse.ids) > 1 and found.chosen is not coarse:  # an earlier one may have stood for the finer form
        _drop(found)


def _exchange(found: Search, tell: Progress) -> None:
    """Replace an earlier effect by a close rival of its round where that fits better with the later effects, or where
    it cannot be as it was fitted with them."""
    for place, name in enumerate(found.chosen.ids[:-1]):
        tried = [_fairly(found, o) for o in _in_place_of(found, place, name, tell)]
        study, best = _better(found, name, tried)
        others = [o for o in (found.chosen, *(o for _, o in tried)) if o is not best]
        found.study, found.chosen = study, best
        found.rivals = sorted([*others, *found.rivals], key=lambda o: -o.evidence)


def _in_place_of(found: Search, place: int, name: str, tell: Progress) -> Iterator[Option]:
    """The choice with rivals of the effect `name` of round `place` in its place."""
    rest = tuple(i for i in found.chosen.ids if i != name)
    for rival in _earlier_rivals(found, place)[: FAR_EXCHANGED if far(found.chosen) else EXCHANGED]:
        tell(f"{rival} in place of {name}")
        usual = dict(found.study.catalogue[rival].typical) | _fitted_alone(found, rival)
        start = dict(found.chosen.fitted.values) | usual
        other = fitted_option(found.study, (rival, *rest), start, found.chosen.refined)
        if other is not None:
            yield other


def _fairly(found: Search, other: Option) -> tuple[Study, Option]:
    """Another option and its study: where models are far and it fits better but predicts worse, with nuisance
    parameters of its own, as the start of a held-out experiment belongs to the model that it was estimated with."""
    chosen = found.chosen
    if far(chosen) and other.cost < chosen.cost and other.held_out > chosen.held_out:
        return iterated(found.study, other)
    return found.study, other


def _better(found: Search, name: str, tried: Sequence[tuple[Study, Option]]) -> tuple[Study, Option]:
    """The best of the choice and of options (each with its study) that have another effect, their first, in place of
    `name`; among equals the choice, or else the effect of the most usual size."""
    present = (found.study, found.chosen)
    good = [t for t in tried if t[1].ids[0] not in t[1].impossible]
    _, best = max(good, key=lambda t: t[1].evidence, default=present)
    ahead = 2 * (best.evidence - found.chosen.evidence)
    if name not in found.chosen.impossible and ahead <= error_reach(found.chosen):
        return present
    equal = [t for t in good if t[1] is best or 2 * (best.evidence - t[1].evidence) < error_reach(best)]
    catalogue = found.study.catalogue
    return min(equal, key=lambda t: unusual(catalogue[t[1].ids[0]], t[1].fitted), default=present)


def _earlier_rivals(found: Search, place: int) -> list[str]:
    """The rivals of the effect at `place` that were behind by no more than a few times the gain of later effects; the
    best of that round among them, where another one took its place."""
    if place >= len(found.rounds):
        return []
    listed = found.rounds[place].options
    brought = listed[0].cost - found.chosen.cost
    near = [o.ids[-1] for o in listed if o.cost - listed[0].cost < AT_BEST * brought]
    return [name for name in near if name not in found.chosen.ids]


def _fitted_alone(found: Search, name: str) -> dict[str, float]:
    """The parameters of an effect in an earlier round."""
    for step in found.rounds:
        for o in step.options:
            if o.ids[-1] == name:
                names = [q.name for q in found.study.catalogue[name].parameters]
                return {n: o.fitted.values[n] for n in names if n in o.fitted.values}
    return {}


def reconsider(found: Search) -> None:
    """Drop effects once more where the numbers of the records' own have moved one to where it may be off: an echo and a
    delay that were two delays have become the same one."""
    effects = [found.study.catalogue[i] for i in found.chosen.ids]
    if len(effects) > 1 and not all(bounded_away(e, found.chosen.fitted) for e in effects):
        _drop(found)


def _drop(found: Search) -> None:
    """Drop each effect whose removal costs almost nothing; for the others that cost is their gain."""
    for name in found.chosen.ids:
        rest = tuple(i for i in found.chosen.ids if i != name)
        without = fitted_option(found.study, rest, found.chosen.fitted.values, found.chosen.refined)
        if without is None:
            found.gains[name] = found.chosen.gain_over(found.base)
            continue
        found.gains[name] = found.chosen.gain_over(without)
        if without.cost - found.chosen.cost < CHANCE:
            found.chosen = without


def _refine(found: Search, tell: Progress) -> None:
    """Use finer forms of the chosen effects where the recordings support them; then of promising rivals too."""
    coarse = found.chosen
    for name in coarse.ids:
        effect = found.study.catalogue[name]
        if not effect.refine or name in found.chosen.refined or (effect.delicate and clean(coarse.lack_of_fit)):
            continue
        tell(f"finer form of {name}")
        finer = finer_form(found.study, found.chosen, [name])
        if finer and finer.evidence > found.chosen.evidence + FINER_GAIN and not denied(found.chosen, finer):
            found.chosen = finer
    _refine_rivals(found, coarse, tell)


def _refine_rivals(found: Search, coarse: Option, tell: Progress) -> None:
    """Refine the rivals that may pass the choice in a finer form, as it was refined; choose the best."""
    near = [r for r in found.rivals if stands_in(r, coarse, found.gains) or _promising(r, coarse, found.gains)]

    def refined(rival: Option) -> Option:
        finest = [i for i in rival.ids if i in found.chosen.refined or i not in coarse.ids]
        wanted = [i for i in finest if found.study.catalogue[i].refine]
        if rival not in near[:MOST_FINER] or not wanted:
            return rival
        tell(f"finer form of {', '.join(wanted)}")
        finer = finer_form(found.study, rival, wanted)
        return finer if finer and finer.evidence > rival.evidence else rival

    everyone = sorted([found.chosen, *side_by_side(refined, found.rivals)], key=lambda o: -o.evidence)
    good = [o for o in everyone if o is found.chosen or (_one_other(found.chosen, o) and not o.impossible)]
    best = next(o for o in good if o.cost <= found.chosen.cost)
    if 2 * (best.evidence - found.chosen.evidence) < error_reach(found.chosen):
        best = found.chosen
    for before, after in zip(_without(found.chosen, best), _without(best, found.chosen), strict=True):
        found.gains[after] = found.gains.pop(before)
    found.chosen, found.rivals = best, [o for o in everyone if o is not best]


def _one_other(chosen: Option, rival: Option) -> bool:
    """Whether a rival has another effect in place of one of the choice, or the same."""
    return len(rival.ids) == len(chosen.ids) and len(_without(rival, chosen)) <= 1


def _without(option: Option, other: Option) -> list[str]:
    """The effects of an option that another one does not have."""
    return [i for i in option.ids if i not in other.ids]


def with_usual_sizes(found: Search) -> None:
    """Choose an equivalent of usual size in place of an effect that is far larger than such effects are, and one that
    may be there in place of one that cannot be as it was fitted.

    A mass of sixty tubes, where a delay of one sample explains as much, would be the last that anybody looks for.
    What explains less by a share of the gain, as another form of the same effect may, does not explain as much; but it
    does in place of what cannot be: of a leak, an overflow at a level that no record reached left 50 less of 569 000.
    """
    impossible = found.chosen.impossible
    for rival in found.rivals:
        pair = stands_in(rival, found.chosen, found.gains, FORM_SHARE if impossible else 0.0)
        if pair is None or (impossible and pair[0] not in impossible):
            continue
        if impossible or (_as_clean(found.chosen, rival) and _more_usual(found, pair, rival)):
            _choose(found, rival, pair)
            return


def with_limits(found: Search, tell: Progress) -> None:
    """Choose a limit of an effect in its place where it explains as much, fitted from where that one ended; of one that
    ended at a bound, where it does but for its form.

    A lag of 15 ms of a valve was a resonance with a damping of 8: alone it had ended at another optimum, twice as far
    from the records, from which no step led to where both are.
    """
    catalogue = found.study.catalogue
    pairs = [(name, limit) for name in found.chosen.ids for limit in catalogue[name].limits if limit in catalogue]
    for name, limit in pairs:
        chosen = found.chosen
        if name not in chosen.ids or limit in chosen.ids:
            continue
        tell(f"{limit} in place of {name}")
        ids = tuple(limit if i == name else i for i in chosen.ids)
        start = dict(chosen.fitted.values) | dict(catalogue[limit].typical)
        shapes = [
            dict(zip(catalogue[limit].shapes, s, strict=True)) for s in product(*catalogue[limit].shapes.values())
        ]
        begun = best_of_starts(found.study, ids, [start | shape for shape in shapes], chosen.refined)
        other = None if begun is None else fitted_option(found.study, ids, begun.values, chosen.refined)
        ended = at_bounds(catalogue[name], chosen.fitted)
        reach = told_apart(chosen, found.gains.get(name, 0.0)) if ended else CHANCE
        if other is not None and not other.impossible and chosen.misfit > other.misfit - reach:
            found.study, other = iterated(found.study, other)
            _choose(found, other, (name, limit))


def _choose(found: Search, other: Option, pair: tuple[str, str]) -> None:
    """Choose another option, which has the second effect of a pair in place of the first."""
    found.gains[pair[1]] = found.gains.pop(pair[0], 0.0) + other.gain_over(found.chosen)
    rest = [found.chosen, *(r for r in found.rivals if r is not other)]
    found.chosen, found.rivals = other, sorted(rest, key=lambda o: -o.evidence)


def _as_clean(chosen: Option, rival: Option) -> bool:
    """Whether a rival leaves noise alone where the choice does."""
    return clean(rival.lack_of_fit) or not clean(chosen.lack_of_fit)


def _more_usual(found: Search, pair: tuple[str, str], rival: Option) -> bool:
    """Whether the second effect of a pair, as a rival has it, is of a far more usual size than the choice's first."""
    name, other = (found.study.catalogue[i] for i in pair)
    return unusual(name, found.chosen.fitted) > TOO_UNUSUAL * max(1.0, unusual(other, rival.fitted))


def _promising(rival: Option, coarse: Option, gains: Mapping[str, float]) -> bool:
    """Whether a rival brought a good part of what the last effect of the choice did, in their coarse forms."""
    alike = rival.ids[:-1] == coarse.ids[:-1] and rival.ids[-1] not in coarse.ids
    return alike and rival.misfit - coarse.misfit < PROMISING * gains.get(coarse.ids[-1], 0.0)
