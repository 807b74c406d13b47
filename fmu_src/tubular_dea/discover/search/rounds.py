"""One round of the forward selection: scores of the catalogue, refits of the best candidates, acceptance of one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from ...identify.fitting.compiled import Ids
from ...identify.fitting.fit import Fit, FitError
from ...identify.study.study import Study
from ...identify.threads import side_by_side
from ..alternatives.forms import explained_by_form
from ..alternatives.rounding import explained_by_rounding
from ..alternatives.wander import explained_by_wandering
from ..options.acceptance import FALSE_ALARMS, STRONG, accept, clean, denied, far, no_further_effect
from ..options.options import Option, finer_form, fitted_option, option, problem_of
from ..options.refit import FIRST_STEPS, FULL_STEPS, first_refit, fit_effects, further
from ..scores import bank
from ..scores.bank import Score
from ..scores.bootstrap import NullScores, null_scores
from ..scores.parameters import base_parameters, lost, unusual
from ..scores.power import Guess, guesses, needed
from .equivalence import CHANCE, error_reach
from .settle import fit_as_declared

# Set by judgement: what is refitted costs seconds, what is not cannot win.
# Check: `pytest tests/test_rounds.py tests/test_acceptance.py`,
# `python -m blind.score --singles 2 --pairs 20 --seed 1000`
REFITS = 5  # [1] best candidates that are refitted in any case
NEAR_SCORE = 0.6  # [1] share of the best score from which on candidates are refitted too
WEAK_NEAR = 100.0  # [squared standard deviations] below the best score: where evidence is weak, all these are near
MOST_REFITS = 10  # [1] candidates refitted at most
STANDING = 0.5  # [1] share of the threshold from which on a candidate may be refitted at all
SHAPES = 2  # [1] shapes of a candidate from which its refit starts at most
SHAPE_NEAR = 0.5  # [1] share of the best shape's score from which on the next one is a start too
AT_BEST = 2.5  # [1] times its score that a further effect may be hoped to gain when refitted
LEAST_REACH = 500.0  # [squared standard deviations] above the best refit within which others are refitted to the end
REACH_SHARE = 0.3  # [1] the same as a share of the best refit's gain
RESTARTED = 3  # [1] best refits that start again from the declared values, where they leave more than noise

# Set by judgement. Check: `pytest tests/test_rounds.py`, `python -m blind.score --singles 2 --seed 8000`
UNDENIED = 0.5  # [1] share of the best one's gain from which on an effect is taken that held-out data do not deny

# Set by measurement: of 24 nulls of mixed conventions, effects that gained 1.1 to 1.7 times the threshold were named in
# three; none gained more. Check: `python -m blind.score --nulls 24 --seed 7000 --no-identify`
NULL_MARGIN = 2.0  # [1] times the bootstrap's threshold that a score has to reach

# Set by measurement: of plants that others measured, winners scored 0.7 of the best and more.
# Check: `pytest tests/test_rounds.py`, `python -m measured.table`
FAINT_SCORE = 0.03  # [1] share of the best score: no candidate with less is refitted, not even where models are far
ALL_REFITS = 24  # [1] candidates refitted at most where models are so far that scores at "off" say little

# Set by measurement: a base that has compensated for a delay of 6 ms leaves 56 000 more than noise, the best score is
# 11 000, that of the delay 2 000. Check: `python -m blind.score --singles 1 --only sensor_delay --seed 9700`
PROMISES = 0.5  # [1] share of what is left that the best score promises at least where scores are relied on

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Round:
    """One round: scores of the catalogue, the largest scores of nulls, refitted options (best first), the decision.

    `guessed` are sizes at which effects would be seen (in the first round), `listed` the candidates with their columns,
    both kept where they are needed again.
    """

    present: Ids
    scores: list[Score]
    null: NullScores
    threshold: float
    options: list[Option]
    accepted: bool
    reason: str
    guessed: list[Guess] = field(default_factory=list, repr=False)
    listed: list[bank.Candidate] = field(default_factory=list, repr=False)


def take_round(
    study: Study, base: Option, chosen: Option, numeric: float, seed: int, tell: Progress, known: Sequence[Option] = ()
) -> Round:
    """Seek one effect in addition to those of `chosen`; `numeric` is the gain that numerical errors may cause.

    `known` are the options of the same round at another level of noise (best first): refits start from these, and the
    last of them are not refitted again.
    """
    tell("scores of the catalogue")
    blank, start = _scored(study, chosen, numeric, seed)
    starts = [start, *_as_declared(study, chosen)]
    hopeless = _hopeless(base, chosen, blank)
    if hopeless and len(starts) == 1:
        return replace(blank, reason=hopeless)
    most = ALL_REFITS if not hopeless and _astray(chosen, blank.scores[0]) else MOST_REFITS
    shortlist = [] if hopeless else _shortlist(blank.scores, blank.threshold, most)
    shortlist += [name for one in starts[1:] for name in one.best]
    behind = [o.ids[-1] for o in known[REFITS:]]
    shortlist = [i for i in dict.fromkeys(shortlist) if i not in behind]
    study.compiled.gather(chosen.ids, shortlist)
    options = _refits(study, chosen, starts, shortlist, {o.ids[-1]: o.fitted for o in known}, tell)
    if not options:
        return replace(blank, reason="no candidate could be refitted")
    options = _as_finer(study, chosen, options, blank.threshold, tell)
    return decided(study, base, chosen, replace(blank, options=options))


def _scored(study: Study, chosen: Option, numeric: float, seed: int) -> tuple[Round, _Start]:
    """The round with the scores of the catalogue, and where refits start."""
    listed = bank.candidates(study, chosen.fitted, chosen.ids)
    start = _Start(chosen.fitted, bank.scores(listed, chosen.fitted.residual, chosen.fitted.jacobian))
    null = null_scores(listed, chosen.fitted.jacobian, seed=seed)
    threshold = max(NULL_MARGIN * null.threshold(FALSE_ALARMS), numeric)
    guessed = [] if chosen.ids else guesses(listed, chosen.fitted.jacobian, needed(threshold))
    kept = [] if chosen.ids or study.plant.latent else listed
    ranked = bank.best_of_each(start.scored)
    return Round(chosen.ids, ranked, null, threshold, [], False, "", guessed, kept), start


def _hopeless(base: Option, chosen: Option, step: Round) -> str:
    """Why no candidate of a round is worth a refit; "" if one is."""
    best = next(iter(step.scores), None)
    if best is None or best.statistic <= step.threshold:
        return "no score exceeds what chance gives"
    return no_further_effect(base, chosen, AT_BEST * best.statistic, best.id) if chosen.ids else ""


def decided(study: Study, base: Option, chosen: Option, step: Round) -> Round:
    """The round with its options in order, and whether the first of them is accepted."""
    judged = [_said(study, base, chosen, o, step.threshold) for o in step.options]
    if any(s.accepted for _, s in judged):  # what sensors explain is no rival of what they do not
        judged = [(o, s) for o, s in judged if not s.imitated]
    options, said = [o for o, _ in judged], [s for _, s in judged]
    good = _undenied(chosen, options, [i for i, s in enumerate(said) if s.accepted])
    best = _preferred(study, options, good) if good else 0
    options = [options[best], *options[:best], *options[best + 1 :]]
    return replace(step, options=options, accepted=said[best].accepted, reason=said[best].reason)


@dataclass(frozen=True)
class _Said:
    """Whether an option is accepted, why (not), and whether what sensors do explains as much."""

    accepted: bool
    reason: str
    imitated: bool = False


def _said(study: Study, base: Option, chosen: Option, one: Option, threshold: float) -> tuple[Option, _Said]:
    """An option, in its finer form where only that is told from what sensors do, and what is said of it over the
    choice."""
    accepted, reason = accept(base, chosen, one, threshold)
    if accepted and explained_by_wandering(study, chosen, one, threshold):
        finer = _finer(study, one)
        if finer and not explained_by_wandering(study, chosen, finer, threshold):
            return _said(study, base, chosen, finer, threshold)
        return one, _Said(False, f"a slowly wandering zero of the sensor explains as much as {one.ids[-1]}", True)
    if accepted and explained_by_rounding(study, chosen, one, threshold):
        return one, _Said(False, f"the coarse steps of the sensor's readings explain as much as {one.ids[-1]}", True)
    if accepted and explained_by_form(study, chosen, one, threshold):
        found = ", ".join(chosen.ids)
        return one, _Said(False, f"another form of {found} explains as much as {one.ids[-1]}", True)
    return one, _Said(accepted, reason)


def _finer(study: Study, one: Option) -> Option | None:
    """An option with its last effect in its finer form; None where it has none, or that cannot be fitted."""
    name = one.ids[-1]
    if name in one.refined or not study.catalogue[name].refine:
        return None
    return finer_form(study, one, [name])


def _as_finer(
    study: Study, chosen: Option, options: Sequence[Option], threshold: float, tell: Progress
) -> list[Option]:
    """Options in their finer forms where these tell more, if the best one tells something but little.

    So it is with weak effects and with further ones: of a drift that levels off, its straight form may tell a tenth.
    """
    most = max(chosen.cost - o.cost for o in options)
    if most < threshold or (most >= STRONG * threshold and not chosen.ids):
        return list(options)
    tell("refits in finer forms")
    near = [o for o in options if o.cost < chosen.cost]
    finer = {o.ids: f for o, f in zip(near, side_by_side(lambda o: _finer(study, o), near), strict=True) if f}
    better = [f if (f := finer.get(o.ids)) and f.evidence > o.evidence else o for o in options]
    return sorted(better, key=lambda o: -o.evidence)


def _undenied(chosen: Option, options: Sequence[Option], good: Sequence[int]) -> Sequence[int]:
    """Of the options at `good`, those that held-out experiments do not deny, if the best is denied and they gain nearly
    as much; else all: one of two effects alone may predict worse than none."""
    if not good or not denied(chosen, options[good[0]]):
        return good
    gains = [chosen.cost - o.cost for o in options]
    sound = [i for i in good if not denied(chosen, options[i]) and gains[i] > UNDENIED * gains[good[0]]]
    return sound or good


def _preferred(study: Study, options: Sequence[Option], good: Sequence[int]) -> int:
    """The best of the options at `good`; among equals, a fault of an instrument goes before an effect of the plant."""
    reach = max(CHANCE, error_reach(options[good[0]]))
    equal = [i for i in good if 2 * (options[good[0]].evidence - options[i].evidence) < reach]
    if reach > CHANCE:
        return min(equal, key=lambda i: unusual(study.catalogue[options[i].ids[-1]], options[i].fitted))
    return next((i for i in equal if study.catalogue[options[i].ids[-1]].recording), good[0])


def _astray(chosen: Option, best: Score) -> bool:
    """Whether scores at the choice say little of refits: it is far off, or they promise little of what it leaves."""
    left = chosen.lack_of_fit
    return far(chosen) or (not clean(left) and best.statistic < PROMISES * left.excess)


def _shortlist(ranked: Sequence[Score], threshold: float, most: int) -> list[str]:
    """The ids to refit: the best few, and all whose scores are near the best."""
    standing = [s for s in ranked if s.statistic > STANDING * threshold]
    best = standing[0].statistic
    least = FAINT_SCORE * best if most > MOST_REFITS else min(NEAR_SCORE * best, best - WEAK_NEAR)
    near = [s for s in standing if s.statistic >= least]
    return [s.id for s in standing[: max(REFITS, min(len(near), most))]]


@dataclass(frozen=True)
class _Start:
    """Where refits start: a fit of the present model, and the scores there."""

    fitted: Fit
    scored: list[Score]

    @property
    def best(self) -> list[str]:
        """The candidates that score best."""
        return [s.id for s in bank.best_of_each(self.scored)[:REFITS]]

    def refit(self, study: Study, chosen: Option, name: str) -> Fit | None:
        """A candidate after a few steps from here."""
        shapes = [s for s in self.scored if s.id == name and s.statistic > 0]
        return first_refit(study, chosen.ids, self.fitted, _distinct(shapes), chosen.refined) if shapes else None


def _as_declared(study: Study, chosen: Option) -> list[_Start]:
    """The base as it was declared, where its fit is far from the plant and from that.

    A base that cannot follow the records may have ended where it hardly moves, and nothing scores there.
    """
    if chosen.ids or not far(chosen) or not lost(study.plant, chosen.fitted):
        return []
    fitted = fit_as_declared(study, chosen.fitted)
    if fitted is None:
        return []
    return [_Start(fitted, bank.scores(bank.candidates(study, fitted), fitted.residual, fitted.jacobian))]


def _refits(
    study: Study, chosen: Option, starts: Sequence[_Start], ids: Sequence[str], known: Mapping[str, Fit], tell: Progress
) -> list[Option]:
    """The candidates refitted: each for a few steps (from its `known` fit), those close to the best until they
    converge."""

    def begin(name: str) -> Fit | None:
        tell(f"refit with {name}")
        if name in known:
            with suppress(FitError):  # with the records' own numbers of another study the model may have no answer
                return fit_effects(study, (*chosen.ids, name), known[name].values, FIRST_STEPS, chosen.refined)
        found = [one.refit(study, chosen, name) for one in starts]
        return min((f for f in found if f is not None), key=lambda f: f.cost, default=None)

    begun = {name: fitted for name, fitted in zip(ids, side_by_side(begin, ids), strict=True) if fitted is not None}
    most = worth_finishing(chosen.fitted.cost, min((f.cost for f in begun.values()), default=0.0))

    def finish(name: str) -> Option:
        together, fitted = (*chosen.ids, name), begun[name]
        if fitted.cost < most:
            tell(f"refit with {name}")
            fitted = further(study, together, fitted, FULL_STEPS, chosen.refined)
        return option(study, together, fitted, chosen.refined)

    options = sorted(side_by_side(finish, begun), key=lambda o: -o.evidence)
    shortlist = [o for o in options[:RESTARTED] if not clean(options[0].lack_of_fit) or _near(o, options[0])]
    again = side_by_side(lambda o: _from_declared(study, o), shortlist)
    options = [*again, *(o for o in options if not any(o is w for w in shortlist))]
    first = max(options, key=lambda o: o.evidence, default=None)
    return sorted(side_by_side(lambda o: _from_best(study, o, first), options), key=lambda o: -o.evidence)


def worth_finishing(before: float, best: float) -> float:
    """The cost up to which refits that have begun go on, where the best one of them costs `best`."""
    return best + max(LEAST_REACH, REACH_SHARE * (before - best))


def _near(one: Option, best: Option) -> bool:
    """Whether an option is close enough to the best to overtake it."""
    return 2 * (best.evidence - one.evidence) < LEAST_REACH


def _from_declared(study: Study, found: Option) -> Option:
    """The option, refitted from the declared values if its residual is more than noise: without the effect, the base
    may have converged far away."""
    if clean(found.lack_of_fit):
        return found
    return _from(study, found, study.plant.model.parameter_values())


def _from(study: Study, found: Option, values: Mapping[str, float]) -> Option:
    """The option, refitted from other `values` (SI) of some parameters if it explains more from there."""
    again = fitted_option(study, found.ids, found.fitted.values | dict(values), found.refined)
    return again if again and again.fitted.cost < found.fitted.cost else found


def _from_best(study: Study, found: Option, best: Option | None) -> Option:
    """The option, refitted with the parameters of the base where the best option ended, if it explains more there.

    A base that makes up for a lag of 14 ms has lost a branch of its Maxwell elements, and one refit may come back from
    there where another does not.
    """
    if best is None or found is best:
        return found
    there = {f.name: best.fitted.values[f.name] for f in base_parameters(study.plant)}
    problem = problem_of(study, found)
    squares = problem.residuals(problem.scaled(found.fitted.values | there)) ** 2
    return found if float(np.sum(squares)) >= found.fitted.cost else _from(study, found, there)


def _distinct(shapes: Sequence[Score]) -> list[Score]:
    """The best shape, and the second where its score is nearly as large."""
    return [s for s in shapes[:SHAPES] if s.statistic > SHAPE_NEAR * shapes[0].statistic]
