"""From recordings to a verdict: the steps of a discovery in order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import ArgumentError, UserError
from ..identify.fitting.fit import AGREE, NORMAL_95, Fit
from ..identify.fitting.problem import Problem
from ..identify.records.data import Recordings
from ..identify.study.adjust import MOST_SETTLES, SETTLES, adjusted
from ..identify.study.common_nuisances import common_nuisances
from ..identify.study.monitor_uncertainty import with_monitor_noise
from ..identify.study.noise_limit import quieter, with_noise_of
from ..identify.study.procedure import ordered_fit
from ..identify.study.study import PRIOR, Piece, Study, study
from ..identify.threads import one_blas_thread, side_by_side
from .alternatives import input_noise, numerics, wander, zeros
from .alternatives.backwards import Backwards, backwards
from .alternatives.operating_point import repeats
from .alternatives.settled_start import started_at_equilibrium
from .experiments import next_experiment
from .experiments.next_experiment import Proposal
from .options import acceptance, base, residuals
from .options.options import Option, fitted_option, option
from .scores import channels
from .scores.channels import Isolation
from .scores.held_out import with_held_out
from .scores.parameters import base_parameters, implausible
from .scores.power import Sizes, detection_limits, needed
from .search import equivalence, second_output, selection
from .search.law_uncertainty import still_there, with_law, with_rivals
from .search.revision import Search, with_usual_sizes
from .search.rounds import take_round
from .search.settle import iterated

# Set by convention. Check: `pytest tests/test_discover.py::test_the_same_recordings_and_seed_give_the_same_result`
SEED = 20240  # [1] of all random numbers: the same recordings give the same answer

# Set by judgement. Check: `python -m blind.score --nulls 12 --conventions files --seed 1000`
LEAST_SAMPLES = 300  # [samples] in training: fewer tell no effect from noise

# Set by judgement: bounds on the cost. Check: `python -m blind.score --singles 2 --seed 1000`
MOST_ALIKE = 4  # [1] rivals that are looked at again with a choice that lost an effect

# Set by judgement: bounds the cost. Check: `pytest tests/test_unquiet.py`
MOST_QUIETER = 2  # [1] times that a search is repeated because the noise turned out to be less

# Set by judgement. Check: `python -m blind.score --nulls 12 --conventions antialias edges --seed 1000`
SAME_DELAY = 0.04  # [samples] up to which delays of monitors have settled

# Set by judgement: bounds the cost. Check: `pytest tests/test_settled_start.py`
WORTH = 0.5  # [1] share of what starts and effects explained that a first effect may leave to the next ones

# Set by measurement: a shape along the axis and a laser on the cap, taken for a stiffening wall, 1.11 and 1.04; right
# answers beside parameters far from declared ones, 2.2 and 3.5. Check: `pytest tests/test_acceptance.py -k implausible`
WELL_DECLARED = 2.0  # [1] times the residual (rms) of the refitted base that good declared values leave at most

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Discovery:
    """The result of a discovery and how it was found: the source of result.json and the report.

    `repeated` is True where all records repeat one course at one operating point. `limits` are detection limits.
    `strained` are parameters of the plant that are implausible with the chosen effects, though they were not without
    them, or their declared values are good ones, where that is all that speaks against these. `turned` are outputs that
    seem to be counted the other way.
    `held_at_first` are experiments that were held out until these turned out not to show what the others do.
    """

    recordings: Recordings
    study: Study
    verdict: str
    search: Search
    isolated: Isolation | None
    equivalent: dict[str, list[str]]
    tests_before: dict[str, float]
    tests_after: dict[str, float]
    numeric: float
    caused: dict[str, float]
    held_ratio: float
    proposal: Proposal | None
    repeated: bool
    wandering: tuple[str, float] | None = None
    shifted: zeros.Shift | None = None
    missed: second_output.Missed | None = None
    limits: dict[str, Sizes] = field(default_factory=dict)
    held_at_first: tuple[str, ...] = ()
    strained: tuple[str, ...] = ()
    turned: Backwards | None = None

    @property
    def base(self) -> Option:
        """The recalibrated base model."""
        return self.search.base

    @property
    def chosen(self) -> Option:
        """The model with the effects that were accepted."""
        return self.search.chosen

    @property
    def named(self) -> Option:
        """The model with the effects that are named: none where the residual stays unexplained."""
        return self.base if self.verdict == "unexplained" else self.search.chosen

    @property
    def named_study(self) -> Study:
        """The study with the records' own numbers that belong to `named`."""
        return self.study if self.named.ids else self.search.base_study

    @property
    def chosen_gains(self) -> dict[str, float]:
        """The gain of each effect of the choice."""
        return self.search.gains


@one_blas_thread
def discover(
    recordings: Recordings, tell: Progress = lambda what: None, seed: int = SEED, held_out: Sequence[str] | None = None
) -> Discovery:
    """The discovery over some recordings of a plant; the same recordings and seed give the same result."""
    if not recordings.plant.catalogue:
        raise UserError(
            f"{recordings.plant.name}: nothing may be missing, as it has no places: expected places=[...] in its "
            "declaration (identify only fits its parameters)"
        )
    fitted_with = [e for e in recordings.experiments if e.name not in (held_out or ())]
    if not fitted_with:
        raise ArgumentError("hold_out", ": all experiments are held out; name fewer, so that some are left to fit")
    read = sum(int(e.seen(o.name).sum()) for e in fitted_with for o in recordings.fitted_outputs)
    _check_enough(recordings, read, "samples")
    prepared, work, fitted = _begun(recordings, seed, held_out, tell)
    turned = backwards(prepared, work, fitted, lambda other: _recalibrated(other, seed, False)[1])
    if turned is not None:
        tell(f"is {' and '.join(turned.outputs)} counted the other way? Change the sign in the files, if so")
    numeric, found = _found(prepared, work, fitted, recordings, seed, tell)
    other = _held_out_anew(prepared, found) if held_out is None else None
    if other is not None:
        tell(f"the held-out experiments hardly show {', '.join(found.chosen.ids)}: others are held out now")
        numeric, found = _found(other, *_recalibrated(other, seed, True), recordings, seed, tell)
    work, fitted = found.study, found.base.fitted
    isolated = None
    if found.chosen.ids or not acceptance.clean(found.base.lack_of_fit):
        tell("isolate the channel of the residual")
        known = found.rounds[0].listed if found.rounds else []
        isolated = channels.isolate(found.base_study, (), fitted, found.base.lack_of_fit.excess, known)
    tell("verdict")
    with_usual_sizes(found)
    repeated = repeats(work.pieces)
    equivalent, described = _judged(work, found, repeated)
    while not supported(work, found, described):
        found.chosen = _withdrawn(work, found, described)
        work = found.study
        equivalent, described = _judged(work, found, repeated)
    held = _held_ratio(work, found.chosen)
    wandering = _wandering(work, found)
    shifted = zeros.impossible(work, found.chosen)
    missed = second_output.missed(work, found.chosen)
    odd = [one is not None for one in (wandering, shifted, missed, turned)]
    verdict = decide(found, held, equivalent, *odd)
    strained = _strained(found, described) if verdict in ("effect_found", "ambiguous") else ()
    if strained:
        verdict = "partly_explained"
    before = residuals.tests(found.base_study, (), fitted)
    after = residuals.tests(work, found.chosen.ids, found.chosen.fitted)
    found.chosen = described
    caused = input_noise.caused_rms(found.base_study, fitted.values)
    return Discovery(
        recordings,
        work,
        verdict,
        found,
        isolated,
        equivalent,
        before,
        after,
        numeric,
        caused,
        held,
        next_experiment.propose(work, _competitors(found, equivalent)),
        repeated,
        wandering,
        shifted,
        missed,
        _limits(found),
        () if other is None else tuple(p.name for p in prepared.held_out),
        strained,
        turned,
    )


def _begun(
    recordings: Recordings, seed: int, held_out: Sequence[str] | None, tell: Progress
) -> tuple[Study, Study, Fit]:
    """The study as it is prepared, and as its base was recalibrated, with that."""
    tell("monitors and noise")
    work = study(recordings, held_out, PRIOR)
    if held_out is None:
        work = with_held_out(work)
    _check_enough(recordings, sum(p.record.size for p in work.training), "samples in training")
    tell("recalibrate the base model")
    prepared = work
    work, fitted = _recalibrated(work, seed, held_out is None)
    if held_out is None and _seen_elsewhere(work, fitted):
        tell("what the base lacks shows in the held-out experiments alone: these take part now, and the others not")
        pieces = [replace(p, held_out=not p.held_out) for p in work.pieces]
        work, fitted = _recalibrated(replace(work, pieces=pieces), seed, False)
    return prepared, work, fitted


def _limits(found: Search) -> dict[str, Sizes]:
    """The detection limits of all effects beside the base: what acceptance asks of a score there."""
    if not found.rounds:
        return {}
    first, base = found.rounds[0], found.base
    least = needed(first.threshold * base.lack_of_fit.by_chance)
    return detection_limits(found.base_study, base.fitted, first.guessed, least)


def _check_enough(recordings: Recordings, count: int, what: str) -> None:
    """`UserError` where so many samples are too few."""
    if count < LEAST_SAMPLES:
        raise UserError(
            f"{recordings.source}: {count} {what} are too few to distinguish an effect from noise; "
            f"expected at least {LEAST_SAMPLES}: record longer, or more experiments"
        )


def _found(
    prepared: Study, work: Study, fitted: Fit, recordings: Recordings, seed: int, tell: Progress
) -> tuple[float, Search]:
    """What numerical errors may gain, and the search."""
    numeric = numerics.numeric_gain(work, fitted.values)
    return numeric, _from_equilibrium(prepared, _searched(work, fitted, numeric, seed, tell), recordings, seed, tell)


def _held_out_anew(prepared: Study, found: Search) -> Study | None:
    """The study with experiments held out that show what was found, where the present ones do not support it though
    it gains much and experiments left out in turn do; None where they do, and where there are no others."""
    base, chosen = found.base, found.chosen
    if not chosen.ids or acceptance.far(chosen) or acceptance.confirmed(base, chosen):
        return None
    if base.cost - chosen.cost < acceptance.STRONG * found.rounds[0].threshold or chosen.across >= base.across:
        return None
    other = with_held_out(prepared, chosen.ids)
    return None if [p.held_out for p in other.pieces] == [p.held_out for p in prepared.pieces] else other


def _searched(work: Study, fitted: Fit, numeric: float, seed: int, tell: Progress) -> Search:
    """The search; once more where its choice shows a better base, or that the noise is less than the base's residual
    allowed.

    Without quiet stretches a residual is all that limits the noise, and what the base lacks adds to it.
    """
    found = selection.forward_selection(work, fitted, numeric, seed, tell)
    deeper = selection.base_from_choice(found)
    if deeper is not None:
        tell("the base where the choice ended")
        other, deeper = _base_settled(found.study, deeper, seed)  # the choice's own numbers may have made it better
        if selection.deeper_than_base(found, deeper):
            found = selection.forward_selection(other, deeper, numeric, seed, tell)
    for _ in range(MOST_QUIETER):
        limited = with_noise_of(found.study, found.chosen.fitted, found.chosen.ids)
        if acceptance.far(found.chosen) or not quieter(found.study, limited):
            break
        tell("the noise is less")
        work, fitted = _base_settled(replace(found.base_study, noise=limited.noise), found.base.fitted, seed)
        found = selection.forward_selection(work, fitted, numeric, seed, tell, found.rounds)
    return found


def _from_equilibrium(prepared: Study, found: Search, recordings: Recordings, seed: int, tell: Progress) -> Search:
    """The search from starts at equilibrium, if what it finds explains as much as was `found` with states at the start
    of every file: each of these takes one from the misfit by chance, and their sum varies as chi squared does. Where
    nothing was found it has to explain more, and held-out data to support it; where what was found explains most from
    an equilibrium too, there is no other explanation."""
    other = started_at_equilibrium(prepared, [p.name for p in found.study.held_out], recordings)
    if other is None:
        return found
    tell("the same from starts at equilibrium")
    work, fitted = _base_settled(other, base.recalibrate(other, 1, seed, found.base.fitted.values), seed)
    numeric, alone = numerics.numeric_gain(work, fitted.values), option(work, (), fitted)
    known = found.rounds[0].options if found.chosen.ids else ()
    first = take_round(work, alone, alone, numeric, seed, tell, known)
    free = sum(len(found.study.unknown(found.chosen.ids, p)) for p in found.study.pieces)
    by_chance = free + NORMAL_95 * float(np.sqrt(2 * free))
    reached = min((o.squares for o in first.options), default=np.inf) - found.chosen.squares
    if reached > max(by_chance, WORTH * (alone.squares - found.chosen.squares) if found.chosen.ids else 0.0):
        return found
    if first.options[0].ids[-1] in found.chosen.ids:
        return found
    again = selection.forward_selection(work, fitted, numeric, seed, tell, [first])
    return again if _explains_more(found, again, by_chance) else found


def _explains_more(found: Search, again: Search, by_chance: float) -> bool:
    """Whether the effects of the search `again`, from starts at equilibrium, take the place of what was `found`."""
    if not again.chosen.ids:
        return False
    if found.chosen.ids:
        return again.chosen.squares < found.chosen.squares + by_chance
    return again.chosen.squares < found.chosen.squares and acceptance.confirmed(again.base, again.chosen)


def _judged(work: Study, found: Search, repeated: bool) -> tuple[dict[str, list[str]], Option]:
    """What would do in place of each effect of the choice, and the choice as it is reported; `repeated`: all records
    repeat one course."""
    form = equivalence.form_share(found.chosen, repeated)
    equivalent = equivalence.equivalents(found.chosen, found.rivals, found.gains, form)
    equivalent = second_output.distinguished(work, found, equivalent)
    return equivalent, _described(work, found.chosen, _equals(found, equivalent), found.gains)


def _wandering(work: Study, found: Search) -> tuple[str, float] | None:
    """Where the first output's zero wanders most, and by how much [SI], if the choice leaves no more than that."""
    chosen = found.chosen
    if acceptance.clean(chosen.lack_of_fit) or not acceptance.clean(wander.without(work, chosen)):
        return None
    tried = [r for r in found.rounds if r.present == chosen.ids]
    if tried and wander.leaves(work, chosen, tried[-1].options, tried[-1].threshold):
        return None
    return wander.largest(work, chosen)


def decide(
    found: Search,
    held_ratio: float,
    equivalent: dict[str, list[str]],
    wanders: bool = False,
    shifted: bool = False,
    missed: bool = False,
    turned: bool = False,
) -> str:
    """no_effect, effect_found, ambiguous, partly_explained or unexplained.

    `wanders` is whether what the choice leaves is no more than zeros of sensors that wander, as they do; `shifted`
    whether a file would need a zero that no sensor has; `missed` whether an output that takes no part in fits shows
    something that the model does not have; `turned` whether one is counted the other way, so that what explains it is
    not there.
    """
    if turned:
        return "unexplained"
    state, before = found.chosen.lack_of_fit, found.base.lack_of_fit
    if shifted:
        return "partly_explained" if found.chosen.ids and acceptance.earned(found.base, found.chosen) else "unexplained"
    alone = acceptance.noise_alone(state)
    noise = wanders or alone
    if not found.chosen.ids:
        most = acceptance.PREDICTED if alone else acceptance.ALMOST_RATIO
        return "no_effect" if noise and held_ratio <= most and not missed else "unexplained"
    if not noise and not acceptance.nearly(state, before, held_ratio):
        return "partly_explained" if acceptance.earned(found.base, found.chosen) else "unexplained"
    if held_ratio > acceptance.PREDICTED and acceptance.earned(found.base, found.chosen):
        return "partly_explained"
    return "ambiguous" if any(equivalent.values()) else "effect_found"


def _strained(found: Search, described: Option) -> tuple[str, ...]:
    """The parameters of the plant that are implausible with the effects of the choice, and speak against these.

    Then the effects stand for something else, or for a part of it, and these parameters make up for the rest. Those
    that are as far off without the effects may be first guesses, unless the declared values are good ones.
    """
    plant = found.study.plant
    far = implausible(plant, described.fitted)
    before = implausible(plant, found.base.fitted) if far and not _well_declared(found) else ()
    return tuple(n for n in far if n not in before)


def _well_declared(found: Search) -> bool:
    """Whether the base with the declared values explains nearly as much as refitted: these are no first guesses."""
    declared = found.base_study.problem((), [], found.study.plant.model.parameter_values()).residuals(np.empty(0))
    return float(declared @ declared) <= WELL_DECLARED**2 * found.base.fitted.cost


def supported(work: Study, found: Search, described: Option) -> bool:
    """Whether every chosen effect has a strength inside its bounds and an interval that excludes its off value, and
    held-out data support the choice."""
    if not described.ids:
        return True
    return not _vague(work, found, described) and acceptance.confirmed(found.base, found.chosen)


def _vague(work: Study, found: Search, described: Option) -> dict[str, str]:
    """Why effects are not supported, by id: too small a gain, an interval that includes the value at which they are
    off, or a strength at a bound."""
    state = described.lack_of_fit
    slow = residuals.slow_variance(described.fitted, work.training) if acceptance.far(described) else state.by_chance
    why = {}
    for name in described.ids:
        if name in described.impossible:
            why[name] = "it would need an implausible strength, or a level that no record passes"
        elif not acceptance.bounded_away(work.catalogue[name], described.fitted):
            why[name] = "the interval of its size includes nothing"
        elif _no_more_than_a_zero(work, found, described, name):
            why[name] = "a zero no larger than that signal usually has explains as much"
        elif found.gains.get(name, np.inf) < acceptance.EARNS * slow:
            why[name] = "beside the others it gains no more than chance can"
        elif _little_beside_no_noise(work, found, described, name):
            why[name] = "it gains little, and what is left is as far from white noise as without it"
    return why


def _little_beside_no_noise(work: Study, found: Search, described: Option, name: str) -> bool:
    """Whether an effect gains little, and what the choice leaves is no white noise, no more than what the base leaves.

    Then something else is missing (a pulsation that nobody recorded): beside it more is explained by chance than beside
    noise.
    """
    if not found.rounds or found.gains.get(name, np.inf) >= acceptance.STRONG * found.rounds[0].threshold:
        return False
    before = residuals.tests(found.base_study, (), found.base.fitted)["whiteness"]
    after = residuals.tests(work, described.ids, described.fitted)["whiteness"]
    return after > max(acceptance.NOT_WHITE, acceptance.AS_LITTLE_WHITE * before)


def _no_more_than_a_zero(work: Study, found: Search, described: Option, name: str) -> bool:
    """Whether an effect, or one that is equivalent to it, is an offset as all zeros of a signal may have in common."""
    if zeros.as_usual(work, described, name):
        return True
    pairs = ((r, equivalence.stands_in(r, found.chosen, found.gains)) for r in found.rivals)
    return any(pair and pair[0] == name and zeros.as_usual(work, rival, pair[1]) for rival, pair in pairs)


def _withdrawn(work: Study, found: Search, described: Option) -> Option:
    """The choice (and its rivals) without its least supported effect; the base, if that was the only one."""
    vague = _vague(work, found, described)
    least = min(vague or described.ids, key=lambda n: found.gains.get(n, 0.0))
    found.withdrawn[least] = vague.get(least, "data that took part in no fit do not support it")

    def without(one: Option) -> Option | None:
        rest = tuple(i for i in one.ids if i != least)
        return fitted_option(work, rest, one.fitted.values, one.refined) if rest else None

    alike = [r for r in found.rivals if least in r.ids and len({*r.ids} - {*found.chosen.ids}) == 1]
    fewer, *others = side_by_side(without, [found.chosen, *alike[:MOST_ALIKE]])
    before = [o for step in found.rounds for o in step.options if fewer and len(o.ids) == len(fewer.ids)]
    found.rivals = [*(o for o in others if o is not None), found.chosen, *found.rivals, *before]
    if fewer is not None:
        return fewer
    found.study = found.base_study
    return found.base


def _recalibrated(work: Study, seed: int, chosen: bool) -> tuple[Study, Fit]:
    """The base fitted, and refitted with nuisance parameters estimated and samples weighted for the monitors' noise.

    `chosen`: the held-out experiments are not the user's choice. Those at which the base then has no answer (a start
    beyond its fold) take part in the fit.
    """
    if any(work.unknown((), p) for p in work.pieces):
        # A fit needs a first estimate of where the plant starts. The declared values are passed whole, with the switch
        # of the start: without it the base of lab-4 ends in a wrong optimum.
        work = adjusted(work, (), work.plant.model.parameter_values(), base_parameters(work.plant), started=False)
    fitted = base.recalibrate(work, seed=seed)
    if chosen and (fewer := _with_those_followed(work, fitted)) is not None:
        work, fitted = fewer, base.recalibrate(fewer, seed=seed)
    work, fitted = _base_settled(work, fitted, seed)
    if chosen and (fewer := _with_those_followed(work, fitted)) is not None:
        work, fitted = _base_settled(fewer, base.recalibrate(fewer, 1, seed, fitted.values), seed)
    lost = base.elsewhere(work, fitted)
    if lost is not None:
        moved, again = iterated(work, option(work, (), lost))
        if again.fitted.cost < fitted.cost - AGREE:
            return _base_settled(moved, again.fitted, seed)
    return work, fitted


def _base_settled(work: Study, fitted: Fit, seed: int) -> tuple[Study, Fit]:
    """The base and the records' own numbers, each taken anew at the other: until delays of monitors have settled, then
    until the base gains no more. At a low sampling rate, instants and viscosities follow each other slowly."""
    for number in range(MOST_SETTLES):
        before = work.late
        work = adjusted(with_noise_of(work, fitted), (), fitted.values, base_parameters(work.plant))
        if number == 0:
            work = input_noise.bounded_by_outputs(work, fitted.values)
        gains = input_noise.input_gains(work, fitted.values)
        work = input_noise.weighted(input_noise.told_by_outputs(work, fitted.values, gains), gains)
        fitted = base.recalibrate(work, 1, seed, fitted.values)
        moved = max((abs(by - before.get(name, 0.0)) for name, by in work.late.items()), default=0.0)
        if number + 1 >= SETTLES and moved < SAME_DELAY:
            break
    work, last = iterated(work, option(work, (), fitted))
    return work, last.fitted


def _with_those_followed(work: Study, fitted: Fit) -> Study | None:
    """The study with only those held out at which the base has an answer; None where it has one at all of them."""
    followed = [not p.held_out or _follows(work, fitted, p) for p in work.pieces]
    if all(followed):
        return None
    return replace(
        work, pieces=[replace(p, held_out=p.held_out and f) for p, f in zip(work.pieces, followed, strict=True)]
    )


def _follows(work: Study, fitted: Fit, piece: Piece) -> bool:
    """Whether the base model has an answer at a piece."""
    return work.asked((), [piece.case]).possible(work.shared(fitted.values))[0] is not None


def _described(work: Study, option: Option, rivals: Sequence[Option], gains: Mapping[str, float]) -> Option:
    """The option as reported: branches in order, intervals that include the monitors' noise and other forms of laws."""

    def in_order(one: Option) -> tuple[Problem, Fit]:
        fixed = {n: v for n, v in one.fitted.values.items() if n not in one.fitted.names}
        problem = work.problem(one.ids, one.fitted.free, fixed)
        return problem, ordered_fit(work.plant, problem, one.fitted)

    problem, fitted = in_order(option)
    if acceptance.far(option):  # the misfit, not noise or another law, determines the uncertainty
        slow = residuals.slow_variance(fitted, work.training)
        return replace(option, fitted=fitted.with_covariance(fitted.covariance * slow))
    wider = with_monitor_noise(problem, fitted, [p.driven for p in work.training], work.monitor_noise)
    wider = common_nuisances(work, zeros=True).widened(fitted, wider)
    wider = with_rivals(wider, [in_order(r)[1] for r in rivals])
    wider = with_law(work, problem, option.ids, wider)
    wider = wider.with_covariance(wider.covariance * option.lack_of_fit.by_chance)
    return replace(option, fitted=still_there(work, option.ids, fitted, wider, gains))


def _seen_elsewhere(work: Study, fitted: Fit) -> bool:
    """Whether a base that leaves noise in training does not predict the held-out experiments, which suffice for a
    fit."""
    alone = option(work, (), fitted)
    enough = sum(p.record.size for p in work.held_out) >= LEAST_SAMPLES
    return enough and acceptance.clean(alone.lack_of_fit) and _held_ratio(work, alone) > acceptance.PREDICTED


def _held_ratio(work: Study, chosen: Option) -> float:
    if not work.held_out:
        return 1.0
    return float((chosen.unseen_squares / residuals.expected_squares(work, work.held_out)) ** 0.5)


def _equals(found: Search, equivalent: dict[str, list[str]]) -> list[Option]:
    """The rivals that are equivalent to the chosen model."""
    return [r for r in found.rivals if any(i in names for names in equivalent.values() for i in r.ids)]


def _competitors(found: Search, equivalent: dict[str, list[str]]) -> list[Option]:
    """The chosen model and its equivalents; without any, the nearest rival or the base."""
    nearest = _equals(found, equivalent) or found.rivals[:1] or ([found.base] if found.chosen.ids else [])
    if not nearest and found.rounds and found.rounds[-1].options:
        nearest = found.rounds[-1].options[:1]
    return [found.chosen, *nearest]
