"""The first round begun once more at the declared values, with starts of the records that belong to these.

Where starts are unknown, a base that lacks something may end far from the plant, and the starts with it: the current of
a coil behind a diode was twenty times too large at all of them. From there no fit with the diode comes back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...identify.fitting.compiled import Ids
from ...identify.fitting.fit import Fit
from ...identify.study.adjust import adjusted
from ...identify.study.study import Study
from ...identify.threads import side_by_side
from ...kernel import KernelError
from ..options.acceptance import clean
from ..options.options import Option, fitted_option
from ..options.refit import best_of_starts, cheapest_starts, start_values
from ..scores import bank
from ..scores.parameters import declared_values, lost
from .revision import Search
from .rounds import FAINT_SCORE, MOST_REFITS, REFITS, Progress, Round, decided, worth_finishing
from .settle import as_read, fit_as_declared, iterated

# Set by measurement: of the strengths of a mass next to that of a fluid of 28 g, one led to it and one did not.
# Check: `pytest tests/test_declared_starts.py -k several_strengths`
STARTS_BEGUN = 2  # [1] other strengths that are begun where an effect's score leads nowhere: those that cost least


def with_declared_starts(found: Search, step: Round, tell: Progress) -> Round:
    """The first round with what scores best at the declared values begun there, if its base is far from these, starts
    were estimated with it, and nothing that begins at it leaves noise alone, not even with the records' own numbers
    taken anew. The search goes on with the best one's own numbers."""
    base, study = found.base, found.study
    started = any(study.unknown((), p) for p in study.pieces)
    if not (step.options and started and lost(study.plant, base.fitted)):
        return step
    if clean(step.options[0].lack_of_fit) or clean(iterated(study, step.options[0])[1].lack_of_fit):
        return step
    tell("the same from the declared values")
    try:
        tried = begun_as_declared(study, base, [o.ids[0] for o in step.options[:REFITS]])
    except KernelError:  # the model has no answer at its declared values
        return step
    best = {o.ids: (study, o) for o in step.options}
    for own, one in tried:
        if one.ids not in best or one.evidence > best[one.ids][1].evidence:
            best[one.ids] = own, one
    both = sorted(best.values(), key=lambda s: -s[1].evidence)
    if both[0][0] is study:
        return step
    again = decided(both[0][0], base, found.chosen, replace(step, options=[o for _, o in both]))
    if again.accepted:
        found.study = best[again.options[0].ids][0]
    return replace(again, reason=f"{again.reason}, begun at the declared values with starts of its own")


def _of_other_strengths(study: Study, score: bank.Score, start: dict[str, float]) -> list[dict[str, float]]:
    """The start with each strength at which secants are taken: where a response turns with its size, a score hardly
    tells that. Of a fluid of 28 g it told 10, and no step from there explained more than the base does."""
    effect = study.catalogue[score.id]
    return [start | {name: effect.off[name] + by} for name, values in effect.strengths.items() for by in values]


def _begun(
    study: Study, ids: Ids, start: dict[str, float], others: Sequence[dict[str, float]], enough: float
) -> Fit | None:
    """The model with effects `ids` after a few steps from `start`; where that costs `enough` or more, from the
    likeliest of the `others` too, the best of them all."""
    begun = best_of_starts(study, ids, [start], ())
    if begun is not None and begun.cost < enough:
        return begun
    tried = [begun, best_of_starts(study, ids, cheapest_starts(study, ids, others, STARTS_BEGUN), ())]
    return min((f for f in tried if f is not None), key=lambda f: f.cost, default=None)


def begun_as_declared(study: Study, base: Option, known: Sequence[str] = ()) -> list[tuple[Study, Option]]:
    """The `known` candidates and those that score best at the declared values, with records' own numbers as these make
    them likely, begun where their scores say they are; each with its study. The best few after some steps are fitted
    until they converge."""
    values = declared_values(study.plant, base.fitted)
    anew = adjusted(as_read(study, ()), (), values, base.fitted.free, started=False)
    there = fit_as_declared(anew, base.fitted)
    if there is None:
        return []
    ranked = bank.best_of_each(bank.scores(bank.candidates(anew, there), there.residual, there.jacobian))
    least = FAINT_SCORE * ranked[0].statistic
    best = [s for i, s in enumerate(ranked) if s.id in known or (i < MOST_REFITS and s.statistic > least)]
    study.compiled.gather((), [s.id for s in best])

    def begin(score: bank.Score) -> tuple[Study, Ids, Fit] | None:
        start, ids = start_values(there, score), (score.id,)
        own = adjusted(anew, ids, start, base.fitted.free, started=False)
        begun = _begun(own, ids, start, _of_other_strengths(study, score, start), base.cost)
        return None if begun is None else (own, ids, begun)

    def finish(begun: tuple[Study, Ids, Fit]) -> tuple[Study, Option] | None:
        own, ids, fitted = begun
        one = fitted_option(own, ids, fitted.values, ())
        return None if one is None else iterated(own, one)

    first = sorted((b for b in side_by_side(begin, best) if b is not None), key=lambda b: b[-1].cost)
    near = [b for b in first[:REFITS] if b[-1].cost < worth_finishing(base.cost, first[0][-1].cost)]
    return [one for one in side_by_side(finish, near) if one is not None]
