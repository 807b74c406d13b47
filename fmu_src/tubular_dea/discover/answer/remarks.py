"""Remarks beside the verdict: implausible parameters, oscillations, starts, too few recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...identify.records.start import UNKNOWN
from ...identify.study.nuisances import GAIN, LATE_OF, own_numbers, step_of, zero_spread
from ...identify.study.remembered import at_corners
from ...identify.study.spreads import most_spread
from ...identify.study.study import Piece, Study
from ...model.declare import Quantity
from ...model.effect import Effect
from ...model.units import in_units_of, in_words
from ..alternatives.input_noise import allowed_rms
from ..engine import Discovery
from ..options.acceptance import PREDICTED, STRONG, clean, far, noise_alone, size_interval
from ..options.options import Option
from ..options.residuals import LackOfFit
from ..scores.parameters import at_bounds, implausible, strengths_at_bounds
from ..search.rounds import Round
from .oscillations import Oscillation

# Set by judgement. Check: `python -m blind.score --foreign 12 --seed 1000`
FEW_EXPERIMENTS = 3  # [1] experiments below which a verdict rests on little
AT_MOST = 0.99  # [1] of the largest spread that zeros may have: from there on it is a bound, no estimate
ODD = 1.4  # [1] times the usual error of a file from which on one is odd: nine samples that a laser lost made 4
FEW_ODD = 1 / 3  # [1] share of the files that are odd at most; with more, they differ in what was done
DROWNED = 0.5  # [1] share of an output's deviation from its mean from which on noise may be all that it shows
MOVES = 10.0  # [1] times a monitor's noise that an input spans in some experiment, else it hardly moves


def remarks(found: Discovery, waves: Sequence[Oscillation] = ()) -> list[str]:
    """Sentences, the most important first; `waves` are oscillations that no recorded input drives."""
    swinging = [_swinging(found, w) for w in waves]
    said = [
        *counted_backwards(found),
        *implausible_zero(found),
        *unlike(found),
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
        *swinging,
    ]
    said += [
        *_held_anew(found),
        *_partly(found),
        *_starts(found),
        *_in_a_row(found),
        *_spread(found),
        *_wandering(found),
        *_coloured(found),
    ]
    little = thin(found)
    return [*said, f"The result is based on little data: {little}."] if little else said


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
        told = [_delay(study, p, name, own[LATE_OF + name]) for p, own in pieces if LATE_OF + name in own]
        if told and float(np.median([moved for _, moved in told])) > 1.0:
            by, step = (float(np.median(each)) for each in ([by for by, _ in told], [step_of(p) for p, _ in pieces]))
            found[name] = f"{in_words(abs(by), 's')} ({abs(by) / step:.2g} samples) {'late' if by > 0 else 'early'}"
    return found


def _delay(study: Study, piece: Piece, name: str, own: float) -> tuple[float, float]:
    """How late a monitor is in a record [s], `own` of it beside what all have in common, and by how much (rms) that
    moves the output that it moves most, in units of its noise."""
    by = piece.late.get(name, 0.0) + own
    column = piece.nuisances.columns[:, piece.nuisances.names.index(LATE_OF + name)] * by
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
                f"{_told(by, study.plant.model.quantities()[output])} (rms) in a file; errors contain that. The "
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
    left = max(named.lack_of_fit.excess, gain)
    return [
        f"Beside {' and '.join(named.ids)}, {name} would explain {gain / left:.0%} of what is left. That is "
        f"{gain / (found.base.cost - named.cost):.1%} of what is explained already, which another form of the same may "
        "do, so it is not named: it may be there all the same."
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


def _told(value: float, q: Quantity) -> str:
    """A value [SI] in the unit in which its quantity is shown, or one that makes a short number."""
    return in_words(value, q.unit, q.display_unit)


def _unit(effect: Effect, parameter: str) -> str:
    """The unit of an effect's parameter behind a number."""
    unit = next(q.unit for q in effect.parameters if q.name == parameter)
    return "" if unit == "1" else f" {unit}"


def _swinging(found: Discovery, wave: Oscillation) -> str:
    q, (name, amplitude) = found.study.plant.quantity(wave.output), wave.largest
    reading = next(o.headings[0] for o in found.study.plant.outputs if o.name == wave.output)
    return (
        f"The {reading} oscillates at {wave.frequency:.4g} Hz, which no recorded input does, by up to "
        f"{_told(amplitude, q)}, most in {name}. Look for something that runs at this "
        "frequency near the plant or in its supply (a pump, a fan, a shaker, a regulator), and record it."
    )


def _implausible(found: Discovery) -> list[str]:
    said = []
    for name in implausible(found.study.plant, found.named.fitted):
        value, usual = found.named.fitted.values[name], found.study.plant.model.parameter_values()[name]
        q = found.study.plant.quantity(name)
        lacks = "unless that was a first guess, it compensates for something that the model lacks"
        why = "look at the geometry and at the units" if found.verdict == "no_effect" else lacks
        said.append(f"{name} was fitted to {_told(value, q)} (declared: {_told(usual, q)}): {why}.")
    return said


def _as_declared(found: Discovery) -> list[str]:
    """Parameters that no fit may change, where nothing explains records that are far from the model."""
    if found.verdict != "unexplained" or not far(found.named):
        return []
    fixed = [p.quantity for p in found.study.plant.model.parameters if not p.tunable and not p.start]
    known = found.study.plant.model.parameter_values() | found.recordings.geometry
    values = [f"{q.name} = {_told(known[q.name], q)}" for q in fixed if known[q.name]]
    may = "One of them may be wrong, unless it only scales others, which are fitted."
    return [f"Taken as declared, and not fitted: {', '.join(values)}. {may}"] if values else []


def odd_files(found: Discovery, after: Mapping[str, Any]) -> list[str]:
    """A few files with a far larger error than the others: something may have happened in these alone; `after` are the
    errors of the first output as `outcome.errors` gives them."""
    each = {name: e["rmse"] for name, e in after["per_experiment"].items() if e["rmse"] is not None}
    usual = float(np.median([*each.values()])) if each else 0.0
    odd = {name: rms for name, rms in each.items() if rms > ODD * usual}
    if not usual or not 0 < len(odd) <= FEW_ODD * len(each):
        return []
    most = max(odd, key=lambda name: odd[name])
    rest = f"in {' and '.join(odd)} it is up to" if len(odd) > 1 else f"in {most} it is"
    return [
        f"The error is {in_units_of(usual, after)} in most files, and {rest} "
        f"{in_units_of(odd[most], after)}: look there for something that happened in no other file, to the sensor "
        f"or to the {found.study.plant.name}."
    ]


def thin(found: Discovery) -> str:
    """Why these recordings can show little; "" where they are many."""
    files = {p.source for p in found.study.pieces}
    if len(files) < FEW_EXPERIMENTS:
        what = "one experiment" if len(files) == 1 else f"{len(files)} experiments"
        return f"there {'is' if len(files) == 1 else 'are'} only {what}"
    ratio = found.named.lack_of_fit.ratio
    if found.verdict == "no_effect" and ratio > PREDICTED:
        return f"the error is {ratio:.1f} times the noise, and they hardly tell how large that is"
    return ""


def loud(found: Discovery) -> str:
    """Why it is open whether a residual beside which nothing is named is noise: no stretch is quiet, or noise may be
    all that there is; "" where it is not."""
    if found.verdict != "no_effect":
        return ""
    if drowned := hidden_by_noise(found):
        return drowned
    if clean(found.named.lack_of_fit) or _quiet(found):
        return ""
    return f"no stretch is quiet, and {_slow_part(found.named.lack_of_fit, 'could be told')}"


def hidden_by_noise(found: Discovery) -> str:
    """Which output hardly moves by more than its noise and that of the inputs, with their edges, allow; "" for none."""
    for name, allowed in allowed_rms(found.study).items():
        read = [
            p.record[part]
            for p in found.study.pieces
            for reading, part in zip(p.case.readings, p.case.parts, strict=True)
            if reading.output == name
        ]
        noise = found.study.noise[name]  # where it is slow, it weighs more on averages than it is large
        most = float(np.sqrt(noise.rms**2 + max(allowed**2 - noise.slow**2, 0.0)))
        share = most / max(float(np.std(np.concatenate(read))), 1e-300)
        if share > DROWNED:
            return f"what noise may make of {name}, the inputs' too, is {share:.2g} times as large as all that it does"
    return ""


def _quiet(found: Discovery) -> bool:
    """Whether quiet stretches tell the noise of every output."""
    return all(noise.quiet for noise in found.study.noise.values())


def _slow_part(state: LackOfFit, told: str) -> str:
    """How the slow part of a residual compares with the noise that was `told`."""
    return f"the slow part of the residual is {state.coloured**0.5:.1f} times that of the noise that {told}"


def still(found: Discovery) -> str:
    """Which inputs barely move in any experiment, nor from one to the next; "" where all do."""
    names = [s.name for s in found.study.plant.inputs if not _moves(found, s.name)]
    return f"{' and '.join(names)} barely move{'s' if len(names) == 1 else ''} in any experiment" if names else ""


def _moves(found: Discovery, name: str) -> bool:
    values = np.concatenate([p.case.protocol.inputs[name] for p in found.study.pieces])
    return float(np.ptp(values)) > MOVES * found.study.monitor_noise.get(name, 0.0)


def _partly(found: Discovery) -> list[str]:
    """What is left where it is more than noise is in no interval."""
    if found.verdict not in ("partly_explained", "unexplained") or found.strained:
        return []
    return [
        "The intervals of parameters hold if nothing else is missing. For what is, the parameters may compensate, and "
        "their true values may be outside."
    ]


def _starts(found: Discovery) -> list[str]:
    """Files that do not begin at rest, and files that follow others."""
    own, starts = {p.source for p in found.study.pieces if p.loose}, found.recordings.starts
    after = [e for e in found.recordings.experiments if e.follows]
    loaded = [e.name for e in found.recordings.experiments if starts[e.name] == UNKNOWN and not e.follows]
    free, settled = ([n for n in loaded if (n in own) == is_free] for is_free in (True, False))
    said = []
    if after:
        pairs = ", ".join(f"{e.name} follows {e.follows}" for e in after)
        said.append(
            f"As bench.toml says ([order]), {pairs}: each is computed from where the one before it ends; in between, "
            "the plant is under the inputs with which the next one begins."
        )
    if free:
        said.append(
            f"{', '.join(free)} begin{'s' if len(free) == 1 else ''} under load: the states at the start are "
            "estimated from the record, and a slow effect may hide in them. If a file began at rest under its first "
            'load, say so in bench.toml ([start] and NAME = "equilibrium"): smaller effects can then be seen in it.'
        )
    if settled:
        effects = " and ".join(found.search.chosen.ids) or "an effect"
        said.append(
            f"{', '.join(settled)} begin{'s' if len(settled) == 1 else ''} under load, and at equilibrium with it: "
            f"together with {effects}, this explains more than unknown states at every start. If it was not so, say so "
            'in bench.toml: [start] and NAME = "unknown".'
        )
    return said


def _in_a_row(found: Discovery) -> list[str]:
    """That files of one specimen belong together, where what was found outlasts a record."""
    lasting = [n for n in found.named.ids if found.study.catalogue[n].lasting]
    files = found.recordings.experiments
    if not lasting or len(files) < 2 or any(e.follows for e in files):
        return []
    return [
        f"What {' and '.join(lasting)} change{'s' * (len(lasting) == 1)} outlasts a record, but each was computed as "
        "if nothing had been done to the plant before. If files were recorded one after the other, say when each began "
        "([order] in bench.toml)."
    ]


def _spread(found: Discovery) -> list[str]:
    """Zeros that differ from file to file by more than what is usual on the bench, but for one told by `shifted`."""
    said, lacks = [], not noise_alone(found.named)
    for name in found.study.spread:
        told_before = found.shifted is not None and found.shifted.output == name
        if not told_before and 0 < found.study.zero(name) < (spread := zero_spread(found.study, name)):
            told = _told(spread, found.study.plant.quantity(name))
            if lacks:
                said.append(
                    f"In the fits the zero of {name} differs by {told} from file to file: it may make up for what the "
                    "model lacks."
                )
            elif found.study.spread[name] >= AT_MOST * most_spread(found.study, name):
                said.append(
                    f"By how much the zero of {name} differs from file to file, these recordings do not tell: up to "
                    f"{told} was allowed for. Record each file from rest, or its zero before."
                )
            else:
                said.append(f"The zero of {name} differs by {told} from file to file.")
    return said


def implausible_zero(found: Discovery) -> list[str]:
    """A zero that no sensor has."""
    if found.shifted is None:
        return []
    shift = found.shifted
    q = found.study.plant.quantity(shift.output)
    off, usual = (_told(v, q) for v in (shift.value, found.study.zero(shift.output)))
    return [
        f"In {shift.piece}, {shift.output} would have to read {off} too much; its zero is usually {usual}. The plant "
        "differs between the files, or the model lacks what shifts it. Errors are computed without this shift."
    ]


def disagree(found: Discovery) -> bool:
    """Whether all that is missing is that files differ: with gains that no monitor has, the base explains them."""
    return found.verdict == "unexplained" and found.unlike is not None and noise_alone(found.named)


def unlike(found: Discovery) -> list[str]:
    """Gains that no monitor has, file by file."""
    if found.unlike is None:
        return []
    changes = found.unlike.changes
    inputs = dict.fromkeys(name for own in changes.values() for name in own)
    large = [n for n in inputs if max(abs(own.get(n, 0.0)) for own in changes.values()) > GAIN]
    each = {n: [f"{own[n]:+.1%} in {piece}" for piece, own in changes.items() if n in own] for n in large}
    told = [f"{n} {', '.join(files)}" for n, files in each.items()]
    moved = _told(found.unlike.value, found.study.plant.quantity(found.unlike.output))
    together = "The files are explained together only as if gains of monitors changed between them"
    if not noise_alone(found.named):
        together = "In the fits gains of monitors changed between the files, which may make up for what the model lacks"
    return [
        f"{together} ({'; '.join(told)}). In "
        f"{found.unlike.piece} that of {found.unlike.input} moves {found.unlike.output} by {moved} (rms). Monitors "
        f"hardly change by more than {GAIN:.1%}: is it another {found.study.plant.name} in some files, was a part of "
        "it lost, or a scale set anew? All errors here allow for these gains (`records` in result.json); parameters "
        "are those of a mean of the files."
    ]


def unexplained_output(found: Discovery) -> list[str]:
    """An output beside those of the fits that shows what the model does not have."""
    missed = found.missed
    if missed is None:
        return []
    size = _told(missed.value, found.study.plant.quantity(missed.output))
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
        f"The zero of the {reading} drifts slowly within files, most in {name} ({_told(rms, q)} "
        "rms), as zeros of sensors do. A slow effect of this size would look the same: let the sensor warm up."
    ]


def _coloured(found: Discovery) -> list[str]:
    """A remark where the residual is noise only if noise is slow, which no record shows."""
    state = found.named.lack_of_fit
    if clean(state) or not noise_alone(found.named):
        return []
    quiet = _quiet(found)
    told = (
        "quiet stretches tell. It may be noise that is slower than these stretches last" if quiet else "could be told"
    )
    also = "or a weak effect: record longer ones, in which nothing moves" if quiet else "as no stretch is quiet"
    part = _slow_part(state, told)
    return [f"{part[0].upper()}{part[1:]}, {also}."]
