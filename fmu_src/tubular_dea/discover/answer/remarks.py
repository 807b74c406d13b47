"""Remarks beside the verdict: what its answer does not say by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...identify.study.nuisances import DELAY_OF, own_numbers, step_of
from ...identify.study.remembered import at_corners
from ...identify.study.study import Piece, Study
from ...model.effect import Effect
from ...model.units import in_words, three
from ...recordings.table import FEW, either, some
from ..engine import Discovery
from ..options.acceptance import STRONG, clean, far, noise_alone, size_interval
from ..options.options import Option
from ..scores.parameters import at_bounds, implausible, strengths_at_bounds
from ..search.rounds import Round
from . import between_files, follows, jumps, reservations, when
from .left_over import Left, left_over
from .oscillations import Oscillation

# Set by judgement. Check: `pytest tests/test_report_words.py -k far_from_their_declared`
MANY = 3  # [1] parameters far off, from which on one signal's unit is more likely than so many first guesses


def remarks(found: Discovery, waves: Sequence[Oscillation] = ()) -> list[str]:
    """Sentences, the most important first; `waves` are oscillations that no recorded input drives."""
    swinging = [_swinging(found, w) for w in waves]
    said = [
        *counted_backwards(found),
        *between_files.implausible_zero(found),
        *between_files.unlike(found),
        *between_files.assumed(found),
        *unexplained_output(found),
        *_one_point(found),
        *_ended(found),
        *_early(found),
        *_late(found),
        *_remembered(found),
        *_beyond(found),
        *not_named(found),
        *_implausible(found),
        *_as_declared(found),
        *_told_of_the_rest(found),
        *swinging,
    ]
    said += [
        *_held_anew(found),
        *_partly(found),
        *between_files.starts(found),
        *between_files.in_a_row(found),
        *between_files.spread(found),
        *_wandering(found),
        *_coloured(found),
        *_growing(found),
    ]
    thin = reservations.thin(found)
    return [*said, f"The result is based on little data: {thin}."] if thin else said


def counted_backwards(found: Discovery) -> list[str]:
    """Outputs whose sign seems to be wrong."""
    if found.turned is None:
        return []
    headings = {o.name: o.headings[0] for o in found.study.plant.outputs}
    said = " and ".join(headings[name] for name in found.turned.outputs)
    one = len(found.turned.outputs) == 1
    return [
        f"{said} seem{'s' * one} to be counted the other way: with {'its' if one else 'their'} sign changed, the "
        f"refitted {found.study.plant.name} misses {found.turned.left:.0%} of what it misses now. If so, change that "
        "in the files (or the sign of an input that drives it)."
    ]


def _one_point(found: Discovery) -> list[str]:
    """A remark if all records repeat one course and effects are named from them."""
    if not found.repeated or not found.named.ids:
        return []
    said = "All recordings repeat one course at one operating point: the model is validated only there."
    held = " Held-out data repeat the data of the fits, and cannot show which law is right."
    return [said + held * bool(found.study.held_out)]


def _held_anew(found: Discovery) -> list[str]:
    """A remark if others are held out than at first: what is held out was chosen after a look at the data."""
    if not found.held_at_first:
        return []
    first, now = (", ".join(names) for names in (found.held_at_first, [p.name for p in found.study.held_out]))
    return [f"Held out at first were {first}, which hardly show what the other experiments do; held out now are {now}."]


def _ended(found: Discovery) -> list[str]:
    """Parameters of the named effects that ended at a bound: their intervals are open there."""
    said = []
    for name in found.named.ids:
        effect = found.study.catalogue[name]
        for parameter, side in at_bounds(effect, found.named.fitted).items():
            low, high = size_interval(effect, found.named.fitted, parameter)
            end, least = ("largest", f"at least {low:.3g}") if side > 0 else ("least", f"at most {high:.3g}")
            q = next(q for q in effect.parameters if q.name == parameter)
            far = q.minimum if side > 0 else q.maximum
            anything = far is not None and (low <= far if side > 0 else high >= far)
            shown = "do not tell it" if anything else f"only show that it is {least}{_unit(effect, parameter)}"
            said.append(f"The fit of {parameter} ended at its {end} allowed value: these recordings {shown}.")
    return said


def _early(found: Discovery) -> list[str]:
    """Inputs that act before they are recorded: in an FMU, which is given what drives it, they do not."""
    values = found.named.fitted.values
    early = [d for d in found.study.compiled.model(found.named.ids).delays if values.get(d.by, 0.0) < 0]
    return [
        f"The {d.of} acts {in_words(-values[d.by], 's')} before it is recorded ({d.by} is negative). An FMU cannot "
        f"look ahead, so there it acts when it is given: give it the {d.of} earlier by as much."
        for d in early
    ]


def _late(found: Discovery) -> list[str]:
    """Monitors whose delay is allowed for, where that moves an output by more than its noise."""
    now = _delays(found.named_study, found.named)
    if found.verdict in ("unexplained", "partly_explained"):
        return [
            f"In the fit the recorded {name} is {by}. Filters against aliasing make it so; here it may make up for "
            "what the model lacks."
            for name, by in now.items()
        ]
    said = [
        f"The recorded {name} was found to be {by}, as filters against aliasing or channels read in turn make it. "
        "All errors here allow for that; the FMU does not, and needs what it is given shifted by as much."
        for name, by in now.items()
    ]
    before = _delays(found.search.base_study, found.base) if found.named.ids else {}
    return said + [
        f"The error before allows for a recorded {name} that is {by}: without that it is larger."
        for name, by in before.items()
        if name not in now
    ]


def _delays(study: Study, option: Option) -> dict[str, str]:
    """By how much monitors were found to be late, in words, where that moves an output by more than its noise."""
    pieces, found = own_numbers(study, option.ids, option.fitted.values), {}
    for name in (s.name for s in study.plant.inputs):
        told = [_delay(study, p, name, own[DELAY_OF + name]) for p, own in pieces if DELAY_OF + name in own]
        if told and float(np.median([moved for _, moved in told])) > 1.0:
            by, step = (float(np.median(each)) for each in ([by for by, _ in told], [step_of(p) for p, _ in pieces]))
            count = f"{abs(by) / step:.2g}"
            samples = f"{count} sample{'' if count == '1' else 's'}"
            found[name] = f"{in_words(abs(by), 's')} ({samples}) {'late' if by > 0 else 'early'}"
    return found


def _delay(study: Study, piece: Piece, name: str, own: float) -> tuple[float, float]:
    """How late a monitor is in a record [s], `own` of it beside what all have in common, and by how much (rms) that
    moves the output that it moves most, in units of its noise."""
    by = piece.delays.get(name, 0.0) + own
    column = piece.nuisances.columns[:, piece.nuisances.names.index(DELAY_OF + name)] * by
    parts = zip(piece.case.readings, piece.case.parts, strict=True)
    moved = [float(np.sqrt(np.mean(column[rows] ** 2))) / study.noise[reading.output].rms for reading, rows in parts]
    return by, max(moved)


def _remembered(found: Discovery) -> list[str]:
    """Monitors whose noise the plant remembers, with how far that moves an output, and what is left beside it."""
    study, option = found.named_study, found.named
    pieces, said = own_numbers(study, option.ids, option.fitted.values), []
    for name in (s.name for s in study.plant.inputs):
        told = [moved for p, own in pieces if (moved := _walk(p, name, own))]
        if told:
            output, by = max(told, key=lambda t: t[1])
            said.append(
                f"The plant remembers the noise of the recorded {name}, which leads {output} astray by up to "
                f"{study.plant.model.quantities()[output].in_words(by)} (rms) in a file; errors contain that. The "
                "verdict rests on what is left beside the likeliest course of that noise in each file."
            )
    return said


def _walk(piece: Piece, name: str, own: Mapping[str, float]) -> tuple[str, float] | None:
    """The output that remembered noise of an input moves most, and by how much [SI, rms]; None where none is."""
    mine = at_corners(piece, name)
    if not mine.any():
        return None
    moved = piece.nuisances.columns[:, mine] @ np.array([*own.values()])[mine]
    parts = zip(piece.case.readings, piece.case.parts, strict=True)
    by = {reading.output: float(np.sqrt(np.mean(moved[rows] ** 2))) for reading, rows in parts}
    most = max(by, key=lambda output: by[output])
    return most, by[most]


def _beyond(found: Discovery) -> list[str]:
    """Effects that explained more than the accepted ones, but only with an implausible strength."""
    said = []
    for step in found.search.rounds:
        best = max(step.options, key=lambda o: o.evidence, default=found.base)
        for name in best.pinned:
            effect = found.study.catalogue[name]
            for parameter in strengths_at_bounds(effect, best.fitted):
                end = f"{best.fitted.values[parameter]:.3g}{_unit(effect, parameter)}"
                said.append(
                    f"{name} would explain more, but its {parameter} would have to be beyond {end}, the end of its "
                    "range. So something else acts there, or its range in the plant is too narrow."
                )
    return list(dict.fromkeys(said))


def not_named(found: Discovery) -> list[str]:
    """An effect beside the named ones that these data would bear, but that another form of these may stand for."""
    named = found.named
    rounds = found.search.rounds if named.ids else []
    if not rounds or rounds[-1].accepted:
        return []
    name, gain = _next(rounds[-1], named)
    if not name or gain < STRONG * rounds[-1].threshold:
        return []
    left, share = max(named.lack_of_fit.excess, gain), gain / (found.base.cost - named.cost)
    beside = f"{share:.1%} of what" if share < 1 else f"{share:.3g} times what"
    return [
        f"Beside {' and '.join(named.ids)}, {name} would explain {gain / left:.0%} of what is left. That is "
        f"{beside} is explained already, which another form of the same may do, so it is not named: it may be there "
        "all the same."
    ]


def _next(step: Round, named: Option) -> tuple[str, float]:
    """The effect that explains most beside the named ones, and its gain: as refitted, else its score; "" for none."""
    if not step.options:
        score = next(iter(step.scores), None)
        return ("", 0.0) if score is None else (score.id, score.statistic)
    best = max(step.options, key=lambda o: o.evidence)
    more = [i for i in best.ids if i not in named.ids]
    alone = len(more) == 1 and len(best.ids) == len(named.ids) + 1 and not best.impossible
    return (more[0], named.cost - best.cost) if alone else ("", 0.0)


def _unit(effect: Effect, parameter: str) -> str:
    """The unit of an effect's parameter behind a number."""
    unit = next(q.unit for q in effect.parameters if q.name == parameter)
    return "" if unit == "1" else f" {unit}"


def _told_of_the_rest(found: Discovery) -> list[str]:
    """Of what no effect explains, when it is, when it jumps, and which unused columns it follows."""
    if found.verdict not in ("unexplained", "partly_explained"):
        return []
    rest = [*left_over(found)]
    brief = when.brief_misses(rest, found.named_study.noise)
    return [*_at_times(brief), *_jumping(found, jumps.jumps(rest)), *_following(found, rest)]


def _at_times(told: Sequence[when.Stretch]) -> list[str]:
    if not told:
        return []
    where = " and ".join(f"{t.name} from {t.begin:.4g} to {t.end:.4g} s" for t in told)
    return [f"More than half of what is left beyond noise is in {where}: what happened then, unrecorded?"]


def _jumping(found: Discovery, told: Sequence[jumps.Jumps]) -> list[str]:
    if not told:
        return []
    largest = max(told, key=lambda one: one.largest)
    by = found.study.plant.quantity(largest.of).in_words(largest.largest)
    files = [f"{one.name} at {_listed(one.times)}" for one in told]
    return [
        f"What is left jumps while the model stands still, by up to {by}: in {some(files, FEW)}. Did something slip or "
        "let go there, or was the sensor moved?"
    ]


def _listed(times: Sequence[float]) -> str:
    more = len(times) - FEW
    again = f" and {more} times more" if more > 1 else " and once more" if more == 1 else ""
    return f"{', '.join(f'{t:.4g}' for t in times[:FEW])} s{again}"


def _following(found: Discovery, rest: Sequence[Left]) -> list[str]:
    told = follows.columns_followed(found, rest)
    return [
        f"What is left follows the column {heading!r}, which is not used{_with_lag(one)}: it explains {one.part:.0%} "
        "of the slower part. If that acts on the plant, declare it as an input."
        for heading, one in sorted(told.items(), key=lambda pair: -pair[1].part)
    ]


def _with_lag(one: follows.Followed) -> str:
    return f", with a lag of about {one.lag:.1g} s" if one.lag else ""


def _swinging(found: Discovery, wave: Oscillation) -> str:
    q, (name, amplitude) = found.study.plant.quantity(wave.output), wave.largest
    reading = next(o.headings[0] for o in found.study.plant.outputs if o.name == wave.output)
    if wave.recorded:
        return (
            f"The {reading} oscillates at {wave.frequency:.4g} Hz by up to {q.in_words(amplitude)}, most in {name}, as "
            f"the record of {either(wave.recorded)} does, by so little that it was taken for noise there: that is in "
            "no model's answer, and is no effect."
        )
    return (
        f"The {reading} oscillates at {wave.frequency:.4g} Hz, which no recorded input does, by up to "
        f"{q.in_words(amplitude)}, most in {name}. Look for something that runs at this "
        "frequency near the plant or in its supply (a pump, a fan, a shaker, a regulator), and record it."
    )


def _implausible(found: Discovery) -> list[str]:
    said, plant = [], found.study.plant
    far_off = implausible(plant, found.named.fitted)
    if found.verdict == "no_effect" and len(far_off) >= MANY:
        said, far_off = [_many_far_off(found, far_off)], []
    for name in far_off:
        value, usual = found.named.fitted.values[name], plant.model.parameter_values()[name]
        q = plant.quantity(name)
        lacks = "unless that was a first guess, it compensates for something that the model lacks"
        units = "look at the geometry and at the units" if plant.geometry else "look at the units"
        why = units if found.verdict == "no_effect" else lacks
        said.append(f"{name} was fitted to {q.in_words(value)} (declared: {q.in_words(usual)}): {why}.")
    return [*said, *(_restoring(found, name, plausible) for name, plausible in found.restoring.items())]


def _many_far_off(found: Discovery, names: Sequence[str]) -> str:
    """That many parameters are far from their declared values: all of them follow a signal in another unit."""
    plant, declared = found.study.plant, found.study.plant.model.parameter_values()
    times = [f"{n} {three(found.named.fitted.values[n] / declared[n])}" for n in names]
    signals = [*(s.name for s in plant.inputs), *(o.headings[0] for o in plant.outputs if o.required)]
    return (
        f"{len(names)} parameters were fitted far from their declared values ({', '.join(times)} times these): is the "
        f"unit of {either(signals)} another one than the files say? Unless they were first guesses, something is wrong."
    )


def _restoring(found: Discovery, name: str, plausible: Sequence[str]) -> str:
    """That an effect may hide in parameters, which would be plausible with it."""
    beside = f"Beside {' and '.join(found.named.ids)}, with" if found.named.ids else "With"
    summary = found.study.catalogue[name].summary
    return (
        f"{beside} {name} ({summary[0].lower()}{summary[1:]}), {' and '.join(plausible)} would be plausible, and as "
        "much would be explained: these recordings do not tell whether it is there."
    )


def _as_declared(found: Discovery) -> list[str]:
    """Parameters that no fit may change, where nothing explains records that are far from the model."""
    if found.verdict != "unexplained" or not far(found.named):
        return []
    fixed = [p.quantity for p in found.study.plant.model.parameters if not p.tunable and not p.start]
    known = found.study.plant.model.parameter_values() | found.recordings.geometry
    values = [f"{q.name} = {q.in_words(known[q.name])}" for q in fixed if known[q.name]]
    may = "One of them may be wrong, unless it only scales others, which are fitted."
    return [f"Taken as declared, and not fitted: {', '.join(values)}. {may}"] if values else []


def _partly(found: Discovery) -> list[str]:
    """What is left where it is more than noise is in no interval."""
    if found.verdict not in ("partly_explained", "unexplained") or found.strained:
        return []
    return [
        "The intervals of parameters hold if nothing else is missing. For what is, the parameters may compensate, and "
        "their true values may be outside."
    ]


def unexplained_output(found: Discovery) -> list[str]:
    """An output beside those of the fits that shows what the model does not have."""
    missed = found.missed
    if missed is None:
        return []
    size = found.study.plant.quantity(missed.output).in_words(missed.value)
    return [
        f"In {missed.piece}, {missed.output} differs by {size} (rms) between stretches in which it is next to nothing "
        "as the model has it: something acts on it that the model lacks (a leakage, for instance, or its monitor)."
    ]


def _wandering(found: Discovery) -> list[str]:
    """A sensor whose zero wanders within files, where that is all that is left."""
    if found.wandering is None:
        return []
    output, (name, rms) = found.study.plant.outputs[0], found.wandering
    q = found.study.plant.quantity(output.name)
    reading = output.headings[0]
    return [
        f"The zero of the {reading} drifts slowly within files, most in {name} ({q.in_words(rms)} "
        "rms), as zeros of sensors do. A slow effect of this size would look the same: let the sensor warm up."
    ]


def _growing(found: Discovery) -> list[str]:
    """A remark where the noise of a sensor is not the same at all readings."""
    headings = {o.name: o.headings[0] for o in found.study.plant.outputs}
    relative: dict[str, list[np.ndarray]] = {}
    for reading in (r for p in found.study.pieces for r in p.case.readings):
        if reading.relative_noise is not None:
            relative.setdefault(reading.output, []).append(reading.relative_noise)
    ends = {name: np.concatenate(own) for name, own in relative.items()}
    return [
        f"The noise of {headings[name]} is not the same at all readings: at one end of them it is "
        f"{own.max() / own.min():.2g} times as large as at the other. Each sample weighs as its own noise says."
        for name, own in ends.items()
    ]


def _coloured(found: Discovery) -> list[str]:
    """A remark where the residual is noise only if noise is slow, which no record shows."""
    state = found.named.lack_of_fit
    if clean(state) or not noise_alone(found.named):
        return []
    quiet = reservations.quiet(found)
    told = (
        "quiet stretches tell. It may be noise that is slower than these stretches last"
        if quiet
        else "could be estimated"
    )
    also = "or a weak effect: record longer ones, in which nothing moves" if quiet else "as no stretch is quiet"
    part = reservations.slow_part(state, told)
    return [f"{part[0].upper()}{part[1:]}, {also}."]
