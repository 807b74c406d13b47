"""From recordings to a verdict: the steps of a discovery in order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import ArgumentError, UserError
from ..identify.fitting.fit import NORMAL_95, Fit
from ..identify.records.experiment import Recordings
from ..identify.records.start import with_unknown_starts
from ..identify.study.free_rings import with_slow_rings
from ..identify.study.noise_limit import quieter, with_noise_of
from ..identify.study.study import PRIOR, Study, study
from ..identify.threads import one_blas_thread
from .alternatives import assumed_zeros, input_noise, numerics, zeros
from .alternatives.backwards import Backwards, backwards
from .alternatives.settled_start import started_at_equilibrium
from .alternatives.unlike_files import Unlike, unlike_files
from .experiments import next_experiment
from .experiments.next_experiment import Proposal
from .judgement import Judgement, competitors, held_ratio, judge
from .options import acceptance, base, residuals
from .options.options import Option, fitted_option, option
from .recalibration import base_settled, recalibrated
from .scores import channels
from .scores.channels import Isolation
from .scores.held_out import with_held_out
from .scores.power import Sizes, detection_limits, needed
from .search import second_output, selection
from .search.restored import restored, restoring
from .search.revision import Search, with_limits, with_usual_sizes
from .search.rounds import take_round
from .search.settle import iterated

# Set by convention. Check: `pytest tests/test_discover.py::test_the_same_recordings_and_seed_give_the_same_result`
SEED = 20240  # [1] of all random numbers: the same recordings give the same answer

# Set by judgement. Check: `python -m blind.score --nulls 12 --conventions files --seed 1000`
LEAST_SAMPLES = 300  # [samples] in training: fewer tell no effect from noise

# Set by judgement: a search of seconds is not repeated for less.
# Check: `pytest tests/test_unquiet.py tests/test_input_noise.py`
ALLOWED_LESS = 0.7  # [1] times what an output was allowed to be off: with less, a search is repeated

# Set by judgement: bounds the cost. Check: `pytest tests/test_unquiet.py`
MOST_QUIETER = 2  # [1] times that a search is repeated because the noise turned out to be less

# Set by judgement: bounds the cost. Check: `pytest tests/test_settled_start.py`
WORTH = 0.5  # [1] share of what starts and effects explained that a first effect may leave to the next ones

# Set by measurement: a drift of C_1 by 0.2 %/s left 0.4 %, which zeros and gains of monitors took once it was there.
# Check: `pytest tests/test_settled_start.py -k drift`
SETTLED_AFTER = 0.05  # [1] share of what starts explained that an effect may leave to be settled, if they left noise

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Discovery:
    """The result of a discovery and how it was found: the source of result.json and the report.

    `repeated` is True where all records repeat one course at one operating point. `limits` are detection limits.
    `strained` are parameters of the plant that are implausible with the chosen effects, though they were not without
    them, or their declared values are good ones, where that is all that speaks against these; beside effects a gain
    that no monitor has in some file, in words, is one of them; `restoring` are effects with which they would be
    plausible where none was found. `turned` are outputs that seem to be counted the other way.
    `hidden`: weights hide what the choice leaves where inputs switch.
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
    unlike: Unlike | None = None
    limits: dict[str, Sizes] = field(default_factory=dict)
    held_at_first: tuple[str, ...] = ()
    strained: tuple[str, ...] = ()
    restoring: dict[str, list[str]] = field(default_factory=dict)
    turned: Backwards | None = None
    hidden: bool = False

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
    held_out = None if held_out is None else recordings.with_parts(held_out)
    fitted_with = [e for e in recordings.experiments if e.name not in (held_out or ())]
    if not fitted_with:
        raise ArgumentError("hold_out", ": all experiments are held out; name fewer, so that some are left to fit")
    read = sum(int(e.seen(o.name).sum()) for e in fitted_with for o in recordings.fitted_outputs)
    _check_enough(recordings, read, "samples of the experiments that are not held out" if held_out else "samples")
    recordings, prepared, work, fitted = _begun_as_told(recordings, seed, held_out, tell)
    turned = backwards(prepared, work, fitted, lambda other: recalibrated(other, seed, False)[1])
    if turned is not None:
        tell(f"is {' and '.join(turned.outputs)} counted the other way? Change the sign in the files, if so")
    numeric, found = _found(prepared, work, fitted, recordings, seed, tell)
    other = _held_out_anew(prepared, found) if held_out is None else None
    if other is not None:
        tell(f"the held-out experiments hardly show {', '.join(found.chosen.ids)}: others are held out now")
        numeric, found = _found(other, *recalibrated(other, seed, True), recordings, seed, tell)
    work, fitted = found.study, found.base.fitted
    isolated = None
    if found.chosen.ids or not acceptance.clean(found.base.lack_of_fit):
        tell("isolate the channel of the residual")
        known = found.rounds[0].listed if found.rounds else []
        isolated = channels.isolate(found.base_study, (), fitted, found.base.lack_of_fit.excess, known)
    tell("verdict")
    with_usual_sizes(found)
    with_limits(found, tell)
    judged = judge(found, turned is not None)
    work = found.study
    before = residuals.tests(found.base_study, (), fitted)
    after = residuals.tests(work, found.chosen.ids, found.chosen.fitted)
    found.chosen = judged.described
    return Discovery(
        recordings=recordings,
        study=work,
        verdict=judged.word,
        search=found,
        isolated=isolated,
        equivalent=judged.equivalent,
        tests_before=before,
        tests_after=after,
        numeric=numeric,
        caused=input_noise.caused_rms(found.base_study, fitted.values),
        held_ratio=judged.held_ratio,
        proposal=next_experiment.propose(work, competitors(found, judged.equivalent)),
        repeated=judged.repeated,
        wandering=judged.wandering,
        shifted=judged.shifted,
        missed=judged.missed,
        unlike=judged.unlike,
        hidden=judged.hidden,
        limits=_limits(found),
        held_at_first=() if other is None else tuple(p.name for p in prepared.held_out),
        strained=judged.strained,
        restoring=_restoring(found, judged, tell),
        turned=turned,
    )


def _begun(
    recordings: Recordings, seed: int, held_out: Sequence[str] | None, tell: Progress
) -> tuple[Study, Study, Fit]:
    """The study as it is prepared, and as its base was recalibrated, with that."""
    tell("monitors and noise")
    work = with_slow_rings(study(recordings, held_out, PRIOR))
    if held_out is None:
        work = with_held_out(work)
    _check_enough(recordings, sum(p.record.size for p in work.training), "samples in training")
    tell("recalibrate the base model")
    prepared = work
    work, fitted = recalibrated(work, seed, held_out is None)
    if held_out is None and _seen_elsewhere(work, fitted):
        tell("what the base lacks shows in the held-out experiments alone: these take part now, and others not")
        work, fitted = recalibrated(_exchanged(work), seed, True)
    return prepared, work, fitted


def _begun_as_told(
    recordings: Recordings, seed: int, held_out: Sequence[str] | None, tell: Progress
) -> tuple[Recordings, Study, Study, Fit]:
    """The same with the recordings: where the base leaves noise alone only if files under load may have begun with
    anything, they did."""
    begun = _begun(recordings, seed, held_out, tell)
    moving = with_unknown_starts(recordings)
    if moving is None or acceptance.clean(option(begun[1], (), begun[2]).lack_of_fit):
        return recordings, *begun
    tell("the same from unknown starts")
    other = _begun(moving, seed, held_out, tell)
    clean = acceptance.clean(option(other[1], (), other[2]).lack_of_fit)
    return (moving, *other) if clean else (recordings, *begun)


def _restoring(found: Search, judged: Judgement, tell: Progress) -> dict[str, list[str]]:
    """The effects with which parameters would be plausible that are not without them, and which."""
    if found.chosen.ids:
        tried = found.rounds[-1].options if found.rounds and found.rounds[-1].present == found.chosen.ids else []
        return restoring(found.study, tried, judged.strained)
    if judged.word != "no_effect" or not judged.strained:
        return {}
    tell(f"with which effect would {' and '.join(judged.strained)} be plausible?")
    return restored(found.base_study, found.base, judged.strained)


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
    found = _with_firm_monitors(_searched(work, fitted, numeric, seed, tell), numeric, seed, tell)
    found = _from_equilibrium(prepared, found, recordings, seed, tell)
    return numeric, _with_zeros(found, numeric, seed, tell)


def _with_zeros(found: Search, numeric: float, seed: int, tell: Progress) -> Search:
    """The search with zeros of a usual size for signals of which the plant declares none, if these leave noise alone
    with fewer effects than were `found`."""
    complete = assumed_zeros.enough(found.study, found.chosen)
    allowed = None if complete and not found.chosen.ids else assumed_zeros.with_assumed(found.base_study)
    if allowed is None:
        return found
    tell("do zeros of sensors explain as much?")
    if not assumed_zeros.explain(found, allowed):
        return found
    other = _searched(*base_settled(allowed, found.base.fitted, seed), numeric, seed, tell)
    fewer = not complete or len(other.chosen.ids) < len(found.chosen.ids)
    return other if fewer and assumed_zeros.enough(other.study, other.chosen) else found


def _with_firm_monitors(found: Search, numeric: float, seed: int, tell: Progress) -> Search:
    """The search with zeros and gains of monitors as firm as they usually are, where some gains change from file to
    file as no monitor's do, if effects then explain everything, and no more of them than were `found`.

    What drifts over files recorded one after the other is like a gain and a zero of each. Friction and a softening
    that were found beside gains of 1 to 2 % fit better without.
    """
    chosen, study = found.chosen, found.study if found.chosen.ids else found.base_study
    if unlike_files(study, chosen) is None:
        return found
    tell("gains of monitors changed between files as they hardly do: is it an effect?")
    firm = replace(found.base_study, firm=True)
    firm_found = _searched(*base_settled(firm, found.base.fitted, seed), numeric, seed, tell)
    ids = firm_found.chosen.ids
    few = not chosen.ids or len(ids) <= len(chosen.ids)
    return firm_found if ids and few and acceptance.noise_alone(firm_found.chosen) else found


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
        tell("recalibrate the base model once more, from a better start")
        other, deeper = base_settled(found.study, deeper, seed)  # the choice's own numbers may have made it better
        if selection.deeper_than_base(found, deeper):
            found = selection.forward_selection(other, deeper, numeric, seed, tell)
    for repeated in range(MOST_QUIETER):
        less = _with_less_noise(found, monitors=repeated == 0)
        if less is None:
            break
        tell("the noise is less")
        work, fitted = base_settled(less, found.base.fitted, seed)
        found = selection.forward_selection(work, fitted, numeric, seed, tell, found.rounds)
    return found


def _with_less_noise(found: Search, monitors: bool) -> Study | None:
    """The base's study with the noise that the choice leaves room for; None where that is about as much as before, or
    where it is less of `monitors` alone and these are not asked.

    What the base lacks was taken for noise of a sensor where no stretch is quiet, and for noise of a monitor where the
    supply wanders.
    """
    ids, fitted, study = found.chosen.ids, found.chosen.fitted, found.study
    if acceptance.far(found.chosen):
        return None
    limited = with_noise_of(study, fitted, ids)
    if quieter(study, limited):
        return replace(found.base_study, noise=limited.noise)
    if not ids or not monitors:
        return None
    moved = input_noise.input_sensitivities(study, fitted.values, ids)
    less = _told_less(found, study, fitted.values, moved)
    if less is None and (settled := _settled_beside_least(found, moved)) is not None:
        less = _told_less(found, *settled, moved)
    return less


def _told_less(
    found: Search, study: Study, values: dict[str, float], moved: input_noise.InputSensitivities
) -> Study | None:
    """The base's study with the noise of monitors that the outputs of a `study` tell at `values` (SI) with the choice's
    effects; None where that is about as much as before."""
    told = input_noise.told_by_outputs(study, values, moved, found.chosen.ids)
    before, after = (input_noise.allowed_rms(s) for s in (found.study, input_noise.weighted(told, moved)))
    if all(after[name] > ALLOWED_LESS * rms for name, rms in before.items()):
        return None
    return replace(found.base_study, monitor_noise=told.monitor_noise)


def _settled_beside_least(
    found: Search, moved: input_noise.InputSensitivities
) -> tuple[Study, dict[str, float]] | None:
    """The choice's study and parameters (SI) once instants and zeros are settled beside as little noise of monitors as
    there may be; None where there cannot be less.

    Beside much of it instants are hardly known, and what they leave looks like it: the noise that the base's misfit was
    taken for stays, though the choice leaves none.
    """
    study, chosen = found.study, found.chosen
    least = input_noise.at_least(study)
    if least is None:
        return None
    quiet = input_noise.weighted(least, moved)
    begun = fitted_option(quiet, chosen.ids, chosen.fitted.values, chosen.refined)
    if begun is None:
        return None
    settled, one = iterated(quiet, begun)
    return replace(settled, monitor_noise=study.monitor_noise), one.fitted.values


def _from_equilibrium(prepared: Study, found: Search, recordings: Recordings, seed: int, tell: Progress) -> Search:
    """The search from starts at equilibrium, if what it finds explains as much as was `found` with states at the start
    of every file, but for what these may take from the misfit by chance: it varies as chi squared does. Where nothing
    was found it has to explain more once it is settled, and held-out data to support it; where what was found explains
    as much from an equilibrium too, there is no other explanation. A lag of a laser was found alone: that the tube
    softens in each file was in the states at its start."""
    other = started_at_equilibrium(prepared, [p.name for p in found.study.held_out], recordings)
    if other is None:
        return found
    tell("the same from starts at equilibrium")
    work, fitted = base_settled(other, base.recalibrate(other, 1, seed, found.base.fitted.values), seed)
    numeric, alone = numerics.numeric_gain(work, fitted.values), option(work, (), fitted)
    known = found.rounds[0].options if found.chosen.ids else ()
    first = take_round(work, alone, alone, numeric, seed, tell, known)
    free = sum(len(found.study.unknown(found.chosen.ids, p)) for p in found.study.pieces)
    by_chance = NORMAL_95 * float(np.sqrt(2 * free))
    explained = residuals.excess(found.study, found.chosen.squares)
    reached = min((residuals.excess(work, o.squares) for o in first.options), default=np.inf) - explained
    share = WORTH if found.chosen.ids else SETTLED_AFTER
    if reached > max(by_chance, share * (residuals.excess(work, alone.squares) - explained)):
        return found
    if first.options[0].ids[-1] in found.chosen.ids and reached < by_chance:
        return found
    again = selection.forward_selection(work, fitted, numeric, seed, tell, [first])
    return again if _as_close(found, again, by_chance) and _explains_more(found, again, by_chance) else found


def _as_close(found: Search, again: Search, by_chance: float) -> bool:
    """Whether the search `again` comes as close to the records as `found` but for chance, beside the sensors' noise:
    what inputs may have done is taken for more where more is left.

    A start in the middle of a beat, taken for an equilibrium, left 12.5 um where 6.5 were left with states of its own,
    and a stop and a viscosity made up for the rest; 16.1 um beside 15.9 were a stop.
    """
    before, after = (
        residuals.sensor_squares(s.study, s.chosen.ids, s.chosen.fitted.values, found.study.noise)
        for s in (found, again)
    )
    return after <= before + by_chance


def _explains_more(found: Search, again: Search, by_chance: float) -> bool:
    """Whether the effects of the search `again`, from starts at equilibrium, take the place of what was `found`."""
    if not again.chosen.ids:
        return False
    before, after = (residuals.excess(s.study, s.chosen.squares) for s in (found, again))
    if found.chosen.ids:
        return after < before + by_chance
    return after < before and acceptance.confirmed(again.base, again.chosen)


def _exchanged(work: Study) -> Study:
    """The study in which the pieces held out so far take part, and others are held out: as many as usual, all where
    none of them alone would do."""
    other = with_held_out(work, needed=[p.name for p in work.held_out])
    same = [p.held_out for p in other.pieces] == [p.held_out for p in work.pieces]
    return replace(work, pieces=[replace(p, held_out=not p.held_out) for p in work.pieces]) if same else other


def _seen_elsewhere(work: Study, fitted: Fit) -> bool:
    """Whether a base that leaves noise in training does not predict the held-out experiments, which suffice for a
    fit."""
    alone = option(work, (), fitted)
    enough = sum(p.record.size for p in work.held_out) >= LEAST_SAMPLES
    return enough and acceptance.clean(alone.lack_of_fit) and held_ratio(work, alone) > acceptance.PREDICTED
