"""The nuisance parameters of each record, estimated from it: switching instants, zeros, gains, hum, initial states.

Zeros of sensors and monitors differ between files by an unknown amount. Their spread is estimated together with the fit
(restricted maximum likelihood by expectation and maximisation, Laird and Ware, Biometrics 38 (1982) 963) about a mean
of its own, so that an offset common to all files is left to the effects that explain it. With fewer than LEAST_FILES
files the spread is the usual one that the plant declares.

Gains of monitors are treated in the same way, about 1. The filters of monitors delay them by a part of a sample,
equally in all files. This delay is estimated with the fit, up to the longest plausible one, and corrected. As channels
are sampled in turn, each also has a small unknown delay or lead.

The mean of neighbouring samples has less noise than each. A delay of half a sample takes such a mean, and a lag another
one, so both explain noise of a monitor that drives the model. How far the mean of a sample's neighbours replaces it is
therefore a nuisance parameter, too, where effects are sought: what it leaves to a delay is odd in time. Elsewhere it
would smooth the signal along with the noise. There, what a sensor drifts within a file is one instead.

Where an input switched between two samples, the instant within its bounds that best explains the following samples is
used, and its uncertainty is integrated out. The first of these samples decides: the plant has responded for a part of
the sampling interval, whatever the model lacks. Where a plant rings, or moves on from where it was, what an instant
changes lasts beyond the next switching: there all instants of a record are estimated together, from all that follows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Legendre

from ..protocol import Protocol
from . import hum as hums
from .cases import Case, Reading
from .compiled import Ids
from .drive import MIDWAY
from .instants import ON_CLOCK, EdgeResponse, bounds, edge_responses, part_on_clock, reach
from .marginal import Marginal, marginal
from .monitor_uncertainty import shifted
from .problem import Free, whitened
from .start import ZEROS
from .study import Nuisances, Piece, Study, carried
from .threads import side_by_side

# Set by judgement. Check: `pytest tests/test_adjust.py`,
# `python -m blind.score --nulls 12 --conventions monitor_zeros laser_zero --seed 1000`
LEAST_FILES = 3  # [1] files from which on a spread between them can be told

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions monitor_zeros laser_zero --seed 1000`
ITERATIONS = 40  # [1] of expectation and maximisation

# Set by judgement. Check: `python -m blind.score --nulls 12 --conventions monitor_zeros start --seed 1000`
SETTLES = 2  # [1] times that a model is fitted and the records' own numbers are taken there, at least
MOST_SETTLES = 6  # [1] the same at most

# Set by judgement. Check: `pytest tests/test_ringing_plants.py`
LASTS = 0.1  # [1] of what an edge's instant changes, as sum of squares, that comes after the next edge: then it lasts
MOST_LASTING = 64  # [1] edges of a record that are estimated together: each needs a simulation of its own
EDGE_STEP = 0.25  # [1] of the way to the farther bound: step of a difference quotient

# Set by judgement. Check: `pytest tests/test_adjust.py::test_monitors_behind_a_filter_are_late_alike_in_all_files`,
# `python -m blind.score --nulls 12 --conventions antialias --seed 1000`
LATEST = 1.0  # [samples] by which filters against aliasing make monitors late at most

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions antialias --seed 1000`
LATE = 0.5  # [samples] by which they usually do
TURN = 0.1  # [samples] by which channels are usually apart that are read in turn

# Set by judgement. Check: `pytest tests/test_adjust.py::test_gains_that_differ_between_files_come_out`,
# `python -m blind.score --nulls 12 --conventions monitor_gains --seed 1000`
MOST_GAIN = 6e-3  # [1] by which gains of a monitor differ between files at most
MOST_ZERO = 10.0  # [1] times the usual zero by which those of a sensor differ between files at most
ZERO_LEFT = 0.1  # [1] of a zero that is usually left where it was seen at rest and taken off

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions monitor_gains --seed 1000`
GAIN = 2e-3  # [1] by which they usually do

# Set by judgement. Check: `python -m blind.score --nulls 12 --conventions start --seed 1000`
START_STEP = 0.05  # [1] of a start's usual size: step of its difference quotient
STEP_PARTS = (1.0, 0.5, 0.25, 0.1, 0.03)  # [1] of a step to the most likely start, or instants, that are tried in turn
START_SPREAD = 1.0  # [1] of a start's usual size: prior of what is not known of it

# Set by theory: the mean of neighbours has less noise, so that a third of a sample is best replaced by it.
# Check: `pytest tests/test_adjust.py -k noise_of_a_monitor`
SMOOTHER = 0.5  # [1] share by which the mean of its neighbours usually replaces a sample

# Set by judgement: wide beside any. Check: `python -m blind.score --nulls 12 --conventions hum --seed 1000`
HUM_SIZE = 10.0  # [1] times the noise: prior of the amplitude of a line at mains frequency

# Set by judgement. Check: `pytest tests/test_adjust.py -k clock`
ANYWHERE = 0.8  # [1] of the sampling interval in which an edge's instant is unknown: samples on its way tell it else

# Set by judgement. Check: `python -m blind.score --nulls 12 --conventions drift --seed 1000`
DRIFTS = 5  # [1] polynomials that a drift within a file is made of

GAIN_OF, LATE_OF, SMOOTH_OF = "gain of ", "late ", "smooth "  # names of what a monitor has of its own beside its zero
DRIFT_OF = "drift "  # names of a sensor's drifts within a file, by number
EDGE_OF = "edge "  # name of an edge's instant, by its number, where what it changes lasts


@dataclass(frozen=True)
class _Linearised:
    """A piece linearised at the present model: its white residual and whitened columns, before any marginalisation.

    `windows` are the samples that depend on the instant of each edge, and their response to shifts within its bounds;
    `lasting` (k,) are the shifts [s] of edges that have a column in their place, and 0 for the other columns.
    """

    residual: np.ndarray
    windows: list[EdgeResponse]
    columns: np.ndarray
    lasting: np.ndarray

    def undecided(self) -> np.ndarray:
        """The residual (N,) with every edge at its first estimate, about which its prior is: what all edges have been
        shifted by alike may be the delay of their monitor."""
        found = self.residual - self.columns @ self.lasting
        for edge in self.windows:
            found[edge.where] += edge.change(0.0)
        return found


def adjusted(
    study: Study, ids: Ids, values: Mapping[str, float], free: Sequence[Free] = (), started: bool = True
) -> Study:
    """The study with nuisance parameters estimated at a model with effects `ids` and parameters `values` (SI).

    `free` are the parameters that are fitted while spreads are estimated. Unless `started`, states that are off an
    equilibrium at the start stay in it, and only their uncertainty is integrated out: at a model that is far off they
    would make up for it. A piece that the model cannot follow (a start beyond its fold) stays as it is.
    """
    fixed = study.shared(values) | study.geometry
    owned = side_by_side(lambda p: _with_columns(study, ids, fixed, p), study.pieces)
    work = replace(study, pieces=[p for p in owned if p is not None])
    linear = side_by_side(lambda p: _linearised(work, ids, fixed, p), work.pieces)
    spread, later = _spreads(work, ids, fixed, linear, free)
    priors = [np.array([_prior(work, p, name, spread) for name in p.nuisances.names]) for p in work.pieces]
    part = None if study.sought else _part_on_clock(work.pieces, linear, priors)
    pieces = [
        _settled(work, ids, fixed, p, s, sd, later, part) for p, s, sd in zip(work.pieces, linear, priors, strict=True)
    ]
    work = replace(work, pieces=pieces, spread=spread, late=later)
    begun = iter(side_by_side(lambda i: _begun(work, ids, fixed, pieces[i], linear[i], started), range(len(pieces))))
    everyone = [before if own is None else next(begun) for before, own in zip(study.pieces, owned, strict=True)]
    return replace(work, pieces=carried(everyone))


def _with_columns(study: Study, ids: Ids, values: Mapping[str, float], piece: Piece) -> Piece | None:
    """The piece with the columns of its nuisance parameters at the present model; None where that has no answer.

    They are in SI units, but those of starts, and of neighbours' means, in usual sizes.

    Near a fold it may have none with a nuisance parameter moved: that one is left out there.
    """
    columns: list[np.ndarray] = []
    names: list[str] = []
    rows = piece.case.parts()
    for reading, part in zip(piece.case.readings, rows, strict=True):
        if study.zero(reading.output) > 0:
            names.append(reading.output)
            columns.append(_placed(piece, part, np.ones(reading.times.size)))
            for name, drift in _drifts(study, reading):
                names.append(name)
                columns.append(_placed(piece, part, drift))
        for number, wave in enumerate(hums.waves(study.noise[reading.output].hum, reading.times).T):
            names.append(f"hum {number} {reading.output}")
            columns.append(_placed(piece, part, wave))
    monitors = [s.name for s in study.plant.inputs if study.zero(s.name) > 0]
    cases = [(name, *shifted(piece.case, name)) for name in monitors]
    cases += [(f"{GAIN_OF}{name}", _amplified(piece.case, name), GAIN) for name in monitors]
    cases += [(f"{LATE_OF}{name}", *_delayed(piece, name)) for name in monitors]
    if study.sought:
        cases += [(f"{SMOOTH_OF}{s.name}", _smoothed(piece, s.name), 1.0) for s in study.plant.inputs if s.linear]
    own = dict(piece.case.own)
    starts = [(name, size) for name, size in study.unknown(ids, piece).items()]
    moved = [replace(piece.case, own=own | {name: own.get(name, 0.0) + START_STEP * size}) for name, size in starts]
    switched = _lasting_edges(study, ids, values, piece)
    asked = [*(c for _, c, _ in cases), *moved, *(c for _, c, _ in switched)]
    here, *others = study.asked(ids, [piece.case, *asked]).possible(values)
    if here is None:
        return None
    steps = [(name, step) for name, _, step in cases] + [(f"start {name}", START_STEP) for name, _ in starts]
    steps += [(name, step) for name, _, step in switched]
    for (name, step), answer in zip(steps, others, strict=True):
        names.append(name)
        columns.append(np.zeros(here.size) if answer is None else (answer - here) / step)
    table = np.column_stack(columns) if columns else np.empty((piece.record.size, 0))
    return replace(piece, nuisances=Nuisances(tuple(names), table, np.zeros(len(names))))


def _drifts(study: Study, reading: Reading) -> list[tuple[str, np.ndarray]]:
    """By name, the forms (n,) in which a sensor may drift within a file: smooth ones, to 1 at its ends.

    None where effects are sought, one of which a drift may be, or with too few files to tell how much they drift.
    """
    if study.sought or len({p.source for p in study.pieces}) < LEAST_FILES:
        return []
    first, last = reading.times[[0, -1]]
    over = 2 * (reading.times - first) / ((last - first) or 1.0) - 1
    return [(f"{DRIFT_OF}{k} {reading.output}", Legendre.basis(k)(over)) for k in range(1, DRIFTS + 1)]


def _lasting_edges(study: Study, ids: Ids, values: Mapping[str, float], piece: Piece) -> list[tuple[str, Case, float]]:
    """Every edge by name, with the case in which it alone has moved and by how much [s], if what an instant changes
    lasts; none otherwise."""
    edges = piece.driven.edges
    if not 1 < len(edges) <= MOST_LASTING:
        return []

    def moved(number: int) -> tuple[str, Case, float]:
        edge, now = edges[number], float(piece.shifts[number])
        ends = np.array([edge.earliest, edge.latest]) - edge.time - now
        step = EDGE_STEP * float(ends[np.argmax(np.abs(ends))])
        shifts = np.where(np.arange(len(edges)) == number, now + step, piece.shifts)
        return f"{EDGE_OF}{number}", replace(piece.case, protocol=piece.driven_by(shifts)), step

    first, second = np.argsort([e.time for e in edges], kind="stable")[:2]
    _, case, step = moved(int(first))
    here, there = study.asked(ids, [piece.case, case]).possible(values)
    if here is None or there is None or step == 0.0:
        return []
    seen, rows = piece.case.readings[0], piece.case.parts()[0]
    squares = (there - here)[rows] ** 2
    later = float(np.sum(squares[seen.times > edges[second].latest]))
    if later <= LASTS * float(squares.sum()):
        return []
    return [m for m in map(moved, range(len(edges))) if m[2] != 0.0]


def _step_of(piece: Piece) -> float:
    """The time between samples of the first output [s]."""
    return float(np.median(np.diff(piece.case.readings[0].times)))


def _amplified(case: Case, name: str) -> Case:
    """The case with one of its inputs scaled by the usual error of a gain."""
    inputs = case.protocol.inputs
    return replace(case, protocol=Protocol(case.protocol.time, inputs | {name: inputs[name] * (1 + GAIN)}))


def _delayed(piece: Piece, name: str) -> tuple[Case, float]:
    """The case with one of its inputs earlier by the longest plausible delay, and that delay [s]."""
    by = LATE * _step_of(piece)
    return replace(piece.case, protocol=piece.case.protocol.with_delay(name, -by)), by


def _smoothed(piece: Piece, name: str) -> Case:
    """The case with one of its inputs replaced by the mean of what it is a sample before and after."""
    protocol, by = piece.case.protocol, _step_of(piece)
    beside = protocol.delayed({"before": (name, by), "after": (name, -by)})
    mean = 0.5 * (beside.inputs["before"] + beside.inputs["after"])
    inputs = {n: mean if n == name else beside.inputs[n] for n in protocol.inputs}
    return replace(piece.case, protocol=Protocol(beside.time, inputs))


def _placed(piece: Piece, part: slice, values: np.ndarray) -> np.ndarray:
    column = np.zeros(piece.record.size)
    column[part] = values
    return column


def _linearised(study: Study, ids: Ids, values: Mapping[str, float], piece: Piece) -> _Linearised:
    """The piece linearised: white residual, responses to its edges, columns of its nuisance parameters."""
    response = study.asked(ids, [piece.case])
    here = response.outputs_alone(values)[0]
    residual = whitened(piece.case, here - piece.record, study.noise, piece.weight)
    columns = whitened(piece.case, piece.nuisances.columns, study.noise, piece.weight)
    lasting = _lasting_shifts(piece)
    edges = [] if _lasting(piece) else edge_responses(study, response, values, piece)
    return _Linearised(residual, edges, columns, lasting)


def _lasting(piece: Piece) -> dict[int, int]:
    """The edges that are estimated together: of every nuisance parameter that is one's instant, the edge's number."""
    return {k: int(n.removeprefix(EDGE_OF)) for k, n in enumerate(piece.nuisances.names) if n.startswith(EDGE_OF)}


def _lasting_shifts(piece: Piece) -> np.ndarray:
    """The shift [s] of every nuisance parameter (k,) that is an edge's instant, 0 for the others."""
    lasting, found = _lasting(piece), np.zeros(len(piece.nuisances.names))
    found[list(lasting)] = piece.shifts[list(lasting.values())]
    return found


def _spreads(
    study: Study, ids: Ids, values: Mapping[str, float], linear: Sequence[_Linearised], free: Sequence[Free]
) -> tuple[dict[str, float], dict[str, float]]:
    """The standard deviation between files of every zero and gain by name (SI), and the delays of monitors (samples).

    With few files the spreads are the usual ones.
    """
    first = study.pieces[0]
    kinds = [
        n for n in dict.fromkeys(n for p in study.pieces for n in p.nuisances.names) if _usual(study, first, n) > 0
    ]
    if not study.filtered:
        kinds = [n for n in kinds if not n.startswith(LATE_OF)]
    usual = {n: _size(study, n) for n in kinds if not n.startswith(LATE_OF)}
    training = [(p, s) for p, s in zip(study.pieces, linear, strict=True) if not p.held_out]
    if not kinds or not training:
        return usual, {}
    problem = study.problem(ids, free, {n: v for n, v in values.items() if n not in {f.name for f in free}})
    fixed = [np.empty((p.record.size, 0)) for p, _ in training]
    if free:
        _, columns = problem.response.sensitivities(values, [f.name for f in free])
        slopes = np.array([f.slope(values[f.name]) for f in free])
        fixed = [
            whitened(p.case, c * slopes, study.noise, p.weight) for (p, _), c in zip(training, columns, strict=True)
        ]
    few = len({p.source for p, _ in training}) < LEAST_FILES
    variance, later = _estimated(study, kinds, training, fixed, few)
    found = {n: float(np.sqrt(v)) * usual[n] for n, v in zip(kinds, variance, strict=True) if n in usual}
    monitors = {s.name for s in study.plant.inputs}
    most = {
        n: MOST_GAIN if n.startswith(GAIN_OF) else (ZEROS if n in monitors else MOST_ZERO) * usual[n] for n in found
    }
    return {n: min(v, most[n]) for n, v in found.items()}, later


def _usual(study: Study, piece: Piece, name: str) -> float:
    """The usual size of a zero, a gain or a delay (SI); 0 for the other nuisance parameters."""
    if name.startswith(SMOOTH_OF):
        return 0.0
    return LATE * _step_of(piece) if name.startswith(LATE_OF) else _size(study, name) * _left(piece, name)


def _size(study: Study, name: str) -> float:
    """The usual size of a zero, a drift or a gain where nothing was taken off at rest (SI)."""
    if name.startswith(DRIFT_OF):
        name = name.split(" ", 2)[2]
    return GAIN if name.startswith(GAIN_OF) else study.zero(name)


def _left(piece: Piece, name: str) -> float:
    """The share of a zero that is left in a piece."""
    return ZERO_LEFT if name in piece.driven.zeros else 1.0


def zero_spread(study: Study, name: str) -> float:
    """By how much zeros of a signal differ between files (SI, rms): what was taken off at rest, and what is left."""
    files = list({p.source: p for p in study.pieces}.values())
    taken = [p.driven.zeros[name] for p in files if name in p.driven.zeros]
    left = study.spread[name] * np.array([_left(p, name) for p in files])
    return float(np.hypot(np.std(taken) if taken else 0.0, np.sqrt(np.mean(left**2))))


def _estimated(
    study: Study,
    kinds: Sequence[str],
    training: Sequence[tuple[Piece, _Linearised]],
    fixed: Sequence[np.ndarray],
    few: bool,
) -> tuple[np.ndarray, dict[str, float]]:
    """Expectation and maximisation over the normal equations of parameters, means and every file's deviations.

    Returns variances (k,) in units of the usual ones (1 where files are `few`), and mean delays in samples.
    """
    k, p, m = len(kinds), fixed[0].shape[1], len(training)
    size = p + k + m * k
    information, target = np.zeros((size, size)), np.zeros(size)
    for i, ((piece, linear), columns) in enumerate(zip(training, fixed, strict=True)):
        own = np.column_stack(
            [
                linear.columns[:, piece.nuisances.names.index(n)] * _usual(study, piece, n)
                if n in piece.nuisances.names
                else np.zeros(piece.record.size)
                for n in kinds
            ]
        )
        others = np.array([0.0 if n in kinds else _prior(study, piece, n, {}) for n in piece.nuisances.names])
        local = marginal(_windows(piece, linear, piece.shifts), linear.columns, others)
        together = local.apply(np.column_stack([columns, own, linear.undecided()]))
        gram = together.T @ together
        at = np.r_[0 : p + k, p + k + i * k : p + k + (i + 1) * k]
        wide = np.r_[0 : p + k, p : p + k]  # the mean and the deviation have the same columns
        information[np.ix_(at, at)] += gram[np.ix_(wide, wide)]
        target[at] -= gram[wide, -1]
    late = np.array([n.startswith(LATE_OF) for n in kinds])
    known = np.array([study.late.get(n.removeprefix(LATE_OF), 0.0) / LATE for n in kinds]) * late
    information[range(p), range(p)] += 1 / study.prior**2 if study.prior else 1e-9
    seen = np.array([not study.sought or any(_shown(piece, n) for piece, _ in training) for n in kinds])
    information[range(p, p + k), range(p, p + k)] += np.where(late, 1.0, np.where(seen, 1e6, 1e-6))
    alike = _alike(late)
    information[p : p + k, p : p + k] += alike
    target[p : p + k] -= known + alike @ known
    variance = np.where(late, (TURN / LATE) ** 2, 1.0)
    for _ in range(1 if few else ITERATIONS):
        penalised = information.copy()
        penalised[range(p + k, size), range(p + k, size)] += np.tile(1 / np.maximum(variance, 1e-8), m)
        scale = 1 / np.sqrt(np.diag(penalised))
        inverse = np.linalg.pinv(penalised * np.outer(scale, scale), hermitian=True) * np.outer(scale, scale)
        solved = inverse @ target
        found, uncertainty = solved[p + k :].reshape(m, k), np.diag(inverse)[p + k :].reshape(m, k)
        if not few:
            variance = np.where(late, variance, np.mean(found**2 + uncertainty, axis=0))
    means = np.clip((known + solved[p : p + k]) * LATE, 0.0, LATEST)
    later = {n.removeprefix(LATE_OF): float(v) for n, v, is_late in zip(kinds, means, late, strict=True) if is_late}
    return variance, later


def _shown(piece: Piece, name: str) -> bool:
    """Whether a piece shows at rest that a monitor is not off: then others have no zero in common that it lacks."""
    return name in piece.driven.zeros and float(piece.driven.protocol.inputs[name][0]) == 0.0


def _alike(late: np.ndarray) -> np.ndarray:
    """The information (k, k) that delays of monitors, where `late` (k,), are alike: their filters are of one kind."""
    count = int(late.sum())
    if count < 2:
        return np.zeros((late.size, late.size))
    centred = np.diag(late.astype(float)) - np.outer(late, late) / count
    return (LATE / TURN) ** 2 * centred


def _settled(
    study: Study,
    ids: Ids,
    values: Mapping[str, float],
    piece: Piece,
    linear: _Linearised,
    sd: np.ndarray,
    later: Mapping[str, float],
    part: float | None,
) -> Piece:
    """The piece with its edges at their most likely instants, and all nuisance parameters integrated out.

    `sd` (k,) are their priors, `later` is the delay, in samples, by which inputs are recorded late, and `part` that of
    the sampling at which edges happened, if they did so on one clock.
    """
    shifts, late = piece.shifts, {name: by * _step_of(piece) for name, by in later.items()}
    if linear.windows:
        left = _without_own(piece, linear, sd)
        best = np.array([m.best(left[m.where]) for m in linear.windows])
        if part is not None:
            low, high = bounds(piece)
            best = np.where(_wide(piece), low + part * (high - low), best)
        shifts = _kept_in_place(piece, best, late)
    elif _lasting(piece):
        shifts = _kept_in_place(piece, _together(study, ids, values, piece, linear, sd), late)
    made = marginal(_windows(piece, linear, shifts, part is not None), linear.columns, sd)
    piece = replace(piece, late=late)
    case = replace(piece.case, protocol=piece.driven_by(shifts))
    return replace(piece, case=case, shifts=shifts, marginal=made, nuisances=replace(piece.nuisances, sd=sd))


def _without_own(piece: Piece, linear: _Linearised, sd: np.ndarray) -> np.ndarray:
    """The residual (N,) at the most likely values of the nuisance parameters, whose priors are `sd` (k,), but edges."""
    sd = _undelayed(piece, sd)
    local = marginal(_windows(piece, linear, piece.shifts), np.empty((piece.record.size, 0)), np.empty(0))
    own = piece.nuisances.mean(local.apply(linear.columns), local.apply(linear.residual), sd)
    return linear.residual + linear.columns @ own


def _undelayed(piece: Piece, sd: np.ndarray) -> np.ndarray:
    """The priors (k,) without delays of inputs with edges, by which to tell their instants.

    A delay moves all edges of an input alike, which their instants do as well. What many share would be taken for one,
    and their instants would come near the likeliest ones only little by little.
    """
    switched = {f"{LATE_OF}{e.input}" for e in piece.driven.edges}
    return np.where([n in switched for n in piece.nuisances.names], 0.0, sd)


def _part_on_clock(
    pieces: Sequence[Piece], linear: Sequence[_Linearised], priors: Sequence[np.ndarray]
) -> float | None:
    """The part of the sampling interval at which all edges happened, where the samples behind them say so."""
    squares = []
    for piece, one, sd in zip(pieces, linear, priors, strict=True):
        if one.windows and not piece.held_out:
            left = _without_own(piece, one, sd)
            wide = zip(one.windows, _wide(piece), strict=True)
            squares += [m.squares(left[m.where]) for m, may_be_anywhere in wide if may_be_anywhere]
    return part_on_clock(squares)


def _wide(piece: Piece) -> np.ndarray:
    """Which edges (m,) may have happened anywhere between two samples."""
    low, high = bounds(piece)
    return high - low > ANYWHERE * _step_of(piece)


def _together(
    study: Study, ids: Ids, values: Mapping[str, float], piece: Piece, linear: _Linearised, sd: np.ndarray
) -> np.ndarray:
    """The shifts [s] of all edges together: a Gauss-Newton step, or the part of it that fits better.

    The other nuisance parameters are integrated out.
    """
    lasting, sd = _lasting(piece), _undelayed(piece, sd)
    mine, numbers = list(lasting), list(lasting.values())
    change = piece.nuisances.mean(linear.columns, linear.residual, sd, linear.lasting)
    others = sd.copy()
    others[mine] = 0.0
    left = marginal([], linear.columns, others)
    low, high = bounds(piece)

    def cost(shifts: np.ndarray) -> float:
        case = replace(piece.case, protocol=piece.driven_by(shifts))
        answer = study.asked(ids, [case]).possible(values)[0]
        if answer is None:
            return np.inf
        off = left.apply(whitened(case, answer - piece.record, study.noise, piece.weight))
        return float(off @ off + np.sum((shifts[numbers] / sd[mine]) ** 2))

    least = cost(piece.shifts)
    for part in STEP_PARTS:
        shifts = piece.shifts.copy()
        shifts[numbers] += part * change[mine]
        shifts = np.clip(shifts, low, high)
        if cost(shifts) < least:
            return shifts
    return piece.shifts


def _begun(
    study: Study, ids: Ids, values: Mapping[str, float], piece: Piece, linear: _Linearised, started: bool
) -> Piece:
    """The piece with its own start at the most likely one: a Gauss-Newton step, or the part of it that fits better.

    Far from the model's optimum a whole step may lead to where the plant has no rest, or moves quite differently.
    """
    sought = study.unknown(ids, piece) if started else study.plant.each_start
    if not sought:
        return piece
    local = Marginal(piece.marginal.windows)
    mean = piece.nuisances.mean(local.apply(linear.columns), local.apply(linear.residual), piece.nuisances.sd)
    found = dict(zip(piece.nuisances.names, mean, strict=True))
    others = np.array([not n.startswith("start ") for n in piece.nuisances.names])
    left = marginal(_windows(piece, linear, piece.shifts), linear.columns, piece.nuisances.sd * others)

    def cost(case: Case) -> float:
        answer = study.asked(ids, [case]).possible(values)[0]
        if answer is None:
            return np.inf
        return float(np.sum(left.apply(whitened(case, answer - piece.record, study.noise, piece.weight)) ** 2))

    least, own = cost(piece.case), piece.case.own
    for part in STEP_PARTS:
        begins = {n: own.get(n, 0.0) + part * size * float(found[f"start {n}"]) for n, size in sought.items()}
        case = replace(piece.case, own=dict(own) | _inside(study, begins))
        if cost(case) < least:
            return replace(piece, case=case)
    return piece


def _kept_in_place(piece: Piece, shifts: np.ndarray, late: Mapping[str, float]) -> np.ndarray:
    """Shifts of edges that leave them where they are, within their bounds, once monitors are found later than before.

    An edge happens at its recorded instant and shift less the delay of its monitor: both are told by the same samples.
    """
    edges = piece.driven.edges
    more = np.array([late.get(e.input, 0.0) - piece.late.get(e.input, 0.0) for e in edges])
    low, high = bounds(piece)
    return np.clip(shifts + more, low, high)


def _inside(study: Study, values: Mapping[str, float]) -> dict[str, float]:
    """Values of parameters, clipped to their bounds."""
    inside, known = {}, study.plant.model.quantities()
    for name, value in values.items():
        q = known.get(name)  # none where an effect's state is off
        low = -np.inf if q is None or q.minimum is None else q.minimum
        inside[name] = float(np.clip(value, low, np.inf if q is None or q.maximum is None else q.maximum))
    return inside


def _windows(
    piece: Piece, linear: _Linearised, shifts: np.ndarray, on_clock: bool = False
) -> list[tuple[slice, np.ndarray, float]]:
    """The samples of every edge, their column at a shift, and its prior [s]: small for those that are `on_clock`."""
    known = np.where(_wide(piece) & on_clock, ON_CLOCK * _step_of(piece), np.inf)
    return [
        (m.where, m.column(float(s)), min(reach(e), k))
        for m, s, e, k in zip(linear.windows, shifts, piece.driven.edges, known, strict=False)
    ]


def _prior(study: Study, piece: Piece, name: str, spread: Mapping[str, float]) -> float:
    """The prior standard deviation of a nuisance parameter (SI); the usual one where no `spread` is known."""
    if name in spread:
        return spread[name] * _left(piece, name)
    if name.startswith(EDGE_OF):
        return reach(piece.driven.edges[int(name.removeprefix(EDGE_OF))])
    if name.startswith("hum "):
        return HUM_SIZE * study.noise[name.rsplit(" ", 1)[1]].rms
    unheld = name.startswith(LATE_OF) and name.removeprefix(LATE_OF) in piece.driven.unheld
    kinds = {LATE_OF: (MIDWAY if unheld else TURN) * _step_of(piece), SMOOTH_OF: SMOOTHER, "start ": START_SPREAD}
    return next((size for kind, size in kinds.items() if name.startswith(kind)), _usual(study, piece, name))


def with_nuisances(study: Study, piece: Piece, answer: np.ndarray) -> np.ndarray:
    """A model's output (N,) for a piece, corrected by the most likely values of its nuisance parameters."""
    return answer + piece.nuisances.columns @ likeliest(study, piece, answer)


def likeliest(study: Study, piece: Piece, answer: np.ndarray) -> np.ndarray:
    """The most likely values (k,) of the nuisance parameters of a piece, for which a model has the output `answer`
    (N,)."""
    residual = whitened(piece.case, answer - piece.record, study.noise, piece.weight)
    columns = whitened(piece.case, piece.nuisances.columns, study.noise, piece.weight)
    local = Marginal(piece.marginal.windows)
    return piece.nuisances.mean(local.apply(columns), local.apply(residual), piece.nuisances.sd)
