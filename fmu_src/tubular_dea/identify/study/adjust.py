"""The nuisance parameters of each record, estimated from it: switching instants, zeros, gains, hum, initial states.

What they are is said in `nuisances`, and how much they differ between files in `spreads`.

Where an input switched between two samples, the instant within its bounds that best explains the following samples is
used, and its uncertainty is integrated out. The first of these samples decides: the plant has responded for a part of
the sampling interval, whatever the model lacks. Where a plant rings, or moves on from where it was, what an instant
changes lasts beyond the next switching: there all instants of a record are estimated together, from all that follows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..fitting.cases import Case
from ..fitting.compiled import Ids
from ..fitting.marginal import Marginal, marginal
from ..fitting.problem import Free, whitened
from ..records.start import LATEST
from ..threads import side_by_side
from .arrivals import sent_as_recorded, with_arrivals
from .instants import bounds, into_bounds, part_on_clock
from .linearised import Linearised, common_shift, lasting_edges, linearised_piece, wide, windows_of
from .nuisances import (
    DELAY_OF,
    DRIFT_OF,
    GAIN_OF,
    SMOOTH_OF,
    START_OF,
    prior,
    start_columns,
    step_of,
    with_columns,
    without_delays,
)
from .remembered import NOISE_OF
from .spreads import Common, most_spread, spreads
from .study import Piece, Study, carried

# Set by judgement. Check: `python -m blind.score --nulls 12 --conventions monitor_zeros start --seed 1000`
SETTLES = 2  # [1] times that a model is fitted and the records' own numbers are taken there, at least
MOST_SETTLES = 6  # [1] the same at most

# Set by judgement. Check: `python -m blind.score --nulls 12 --conventions start --seed 1000`
STEP_PARTS = (1.0, 0.5, 0.25, 0.1, 0.03)  # [1] of a step to the most likely start, or instants, that are tried in turn

# Set by judgement. Check: `pytest tests/test_adjust.py -k makes_up_for_a_model`
INCREDIBLE = 3.0  # [1] times the largest usual spread beyond which no zero, gain, delay or drift is one
NO_NOISE = 8.0  # [standard deviations] of a monitor's noise at a corner beyond which it is none
NARROWER = tuple(2.0**k for k in range(13))  # [1] times by which their priors are narrowed, until they are credible


def adjusted(
    study: Study, ids: Ids, values: Mapping[str, float], free: Sequence[Free] = (), started: bool = True
) -> Study:
    """The study with nuisance parameters estimated at a model with effects `ids` and parameters `values` (SI).

    `free` are the parameters that are fitted while spreads are estimated. Unless `started`, states that are off an
    equilibrium at the start stay in it, and only their uncertainty is integrated out: at a model that is far off they
    would make up for it. A piece that the model cannot follow (a start beyond its fold) stays as it is.
    """
    given = study
    study, values = with_arrivals(study, ids, study.shared(values), [f.name for f in free])
    fixed = values | study.geometry
    owned = side_by_side(lambda p: with_columns(study, ids, fixed, p), study.pieces)
    known = [p for p in owned if p is not None]
    work = replace(
        study, pieces=known, remembering=any(n.startswith(NOISE_OF) for p in known for n in p.nuisances.names)
    )
    if not work.pieces:
        return given
    linear = side_by_side(lambda p: linearised_piece(work, ids, fixed, p), work.pieces)
    spread, common = spreads(work, ids, fixed, linear, free)
    priors = [np.array([prior(work, p, name, spread) for name in p.nuisances.names]) for p in work.pieces]
    if not all(_noise_alone(p, s, sd) for p, s, sd in zip(work.pieces, linear, priors, strict=True) if not p.held_out):
        return adjusted(replace(study, remembering=False), ids, values, free, started)
    priors = [_credible(work, p, s, sd) for p, s, sd in zip(work.pieces, linear, priors, strict=True)]
    left = [_without_own(p, s, sd) for p, s, sd in zip(work.pieces, linear, priors, strict=True)]
    part = None if study.sought else _part_on_clock(work.pieces, linear, left)
    alike = _moved_alike(work, ids, free, linear, left)
    pieces = [
        _settled(work, ids, fixed, p, s, rest, sd, common, part, alike)
        for p, s, rest, sd in zip(work.pieces, linear, left, priors, strict=True)
    ]
    pieces = sent_as_recorded(pieces)
    work = replace(work, pieces=pieces, spread=spread, delays=common.delays, longer=common.longer)
    begun = iter(side_by_side(lambda i: _begun(work, ids, fixed, pieces[i], linear[i], started), range(len(pieces))))
    everyone = [before if own is None else next(begun) for before, own in zip(study.pieces, owned, strict=True)]
    return with_starts_at(replace(work, pieces=carried(everyone)), ids, values)


def with_starts_at(study: Study, ids: Ids, values: Mapping[str, float]) -> Study:
    """The study with what unknown starts change at parameters `values` (SI), and at the present starts and instants.

    Where they change a record by thousands of times its noise, and a parameter does nearly the same, what they change
    a thousandth of a rad away, or with an edge elsewhere, says that the parameter is determined.
    """
    fixed = study.shared(values) | study.geometry
    return replace(study, pieces=side_by_side(lambda p: _with_starts_at(study, ids, fixed, p), study.pieces))


def _with_starts_at(study: Study, ids: Ids, values: Mapping[str, float], piece: Piece) -> Piece:
    own = piece.nuisances
    known = [f"{START_OF}{name}" for name in study.unknown(ids, piece)]  # of this model: others stay as they are
    mine = np.array([k for k, name in enumerate(own.names) if name in known], dtype=int)
    if not mine.size:
        return piece
    columns = own.columns.copy()
    columns[:, mine] = start_columns(study, ids, values, piece)[:, [known.index(own.names[k]) for k in mine]]
    white = whitened(piece.case, columns[:, mine], study.noise, piece.weight)
    made = piece.marginal.with_columns_at(mine, white, own.sd[mine])
    return replace(piece, marginal=made, nuisances=replace(own, columns=columns))


def with_all_columns(study: Study, ids: Ids, values: Mapping[str, float]) -> list[Piece | None]:
    """The pieces with what their nuisance parameters change at a model; None where that has no answer."""
    fixed = study.shared(values) | study.geometry
    return side_by_side(lambda p: with_columns(study, ids, fixed, p), study.pieces)


def _settled(
    study: Study,
    ids: Ids,
    values: Mapping[str, float],
    piece: Piece,
    linear: Linearised,
    left: np.ndarray,
    sd: np.ndarray,
    common: Common,
    part: float | None,
    alike: Mapping[str, float],
) -> Piece:
    """The piece with its edges at their most likely instants, and all nuisance parameters integrated out.

    `sd` (k,) are their priors, `left` (N,) the residual without all but edges, `common` what all files have in common,
    `part` that of the sampling at which edges happened, if they did so on one clock, and `alike` what the edges of
    inputs are moved by beside [s].
    """
    shifts, delays = piece.shifts, {name: by * step_of(piece) for name, by in common.delays.items()}
    if linear.windows:
        best = np.array([m.best(left[m.where]) for m in linear.windows])
        if part is not None:
            low, high = bounds(piece)
            best = np.where(wide(piece), low + part * (high - low), best)
        best += [alike.get(e.input, 0.0) for e in piece.driven.edges]
        shifts = _kept_in_place(piece, best, delays)
    elif lasting_edges(piece):
        shifts = _kept_in_place(piece, _together(study, ids, values, piece, linear, sd), delays)
    columns, own = linear.columns, sd
    if linear.windows and (part is not None or len(piece.case.readings) > 1):
        column, deviation = common_shift(study, ids, values, replace(piece, delays=delays), shifts, part is not None)
        columns, own = np.column_stack([columns, column]), np.append(sd, deviation)
    made = marginal(windows_of(piece, linear, shifts, part is not None), columns, own)
    piece = replace(piece, delays=delays, longer=common.longer)
    case = replace(piece.case, protocol=piece.driven_by(shifts))
    return replace(piece, case=case, shifts=shifts, marginal=made, nuisances=replace(piece.nuisances, sd=sd))


def _noise_alone(piece: Piece, linear: Linearised, sd: np.ndarray) -> bool:
    """Whether a piece needs no more of a monitor's noise at corners than there is, where the priors are `sd` (k,).

    Asked of what the sensors tell alone: weights for noise that is counted by a static gain would hide it.
    """
    noise = np.array([n.startswith(NOISE_OF) for n in piece.nuisances.names], dtype=bool) & (sd > 0)
    if not noise.any():
        return True
    own = piece.nuisances.mean(linear.columns / piece.weight[:, None], linear.residual / piece.weight, sd)
    return bool(np.all(np.abs(own[noise]) <= NO_NOISE * sd[noise]))


def _credible(study: Study, piece: Piece, linear: Linearised, sd: np.ndarray) -> np.ndarray:
    """Priors (k,) narrowed until nothing that a monitor has of its own, and no drift, is far beyond what those are.

    Where a model misses a record by far, columns taken at other parameters would make up for what it lacks: a second
    gain of 1 beside the model's own is a second time constant.
    """
    limits = np.array([_limit(study, piece, name) for name in piece.nuisances.names])
    judged = np.isfinite(limits)
    local = marginal(windows_of(piece, linear, piece.shifts), np.empty((piece.record.size, 0)), np.empty(0))
    columns, residual = local.apply(linear.columns), local.apply(linear.residual)
    for times in NARROWER if judged.any() else ():
        narrow = np.where(judged, sd / times, sd)
        own = piece.nuisances.mean(columns, residual, narrow)
        if np.all(np.abs(own[judged]) <= limits[judged]):
            return narrow
    return np.where(judged, 0.0, sd)


def _limit(study: Study, piece: Piece, name: str) -> float:
    """How far a nuisance parameter may be from nothing (SI); infinity where that is not limited."""
    if name.startswith(SMOOTH_OF):
        return INCREDIBLE  # neighbours that replace a sample wholly are 1
    if name.startswith(DELAY_OF):
        return INCREDIBLE * LATEST * step_of(piece)
    monitor = any(s.name == name for s in study.plant.inputs)
    return INCREDIBLE * most_spread(study, name) if monitor or name.startswith((GAIN_OF, DRIFT_OF)) else np.inf


def _without_own(piece: Piece, linear: Linearised, sd: np.ndarray) -> np.ndarray:
    """The residual (N,) at the most likely values of the nuisance parameters, whose priors are `sd` (k,), but edges;
    as it is where no edge has a window, as nobody asks."""
    if not linear.windows:
        return linear.residual
    sd = without_delays(piece, sd)
    local = marginal(windows_of(piece, linear, piece.shifts), np.empty((piece.record.size, 0)), np.empty(0))
    own = piece.nuisances.mean(local.apply(linear.columns), local.apply(linear.residual), sd)
    return linear.residual + linear.columns @ own


def _moved_alike(
    study: Study, ids: Ids, free: Sequence[Free], linear: Sequence[Linearised], left: Sequence[np.ndarray]
) -> dict[str, float]:
    """By how much [s] all edges of an input have to be moved so that each is likeliest within its bounds, where a
    fitted delay of that input makes up for it: else the delay stays where fits began, however far off the bounds."""
    fitted, found = {f.name for f in free}, {}
    for name in {d.of for d in study.compiled.model(ids).delays if d.by in fitted}:
        told = []
        for piece, one, rest in zip(study.pieces, linear, left, strict=True):
            if one.windows and not piece.held_out and piece.arrived is None:
                each = zip(piece.driven.edges, one.windows, *bounds(piece), strict=True)
                told += [
                    (*m.likeliest(rest[m.where]), low, high)
                    for e, m, low, high in each
                    if e.input == name and m.answers.size
                ]
        if told:
            found[name] = into_bounds(*np.array(told).T)
    return found


def _part_on_clock(pieces: Sequence[Piece], linear: Sequence[Linearised], left: Sequence[np.ndarray]) -> float | None:
    """The part of the sampling interval at which all edges happened, where the samples behind them say so."""
    squares = []
    for piece, one, rest in zip(pieces, linear, left, strict=True):
        if one.windows and not piece.held_out:
            each = zip(one.windows, wide(piece), strict=True)
            squares += [m.squares(rest[m.where]) for m, may_be_anywhere in each if may_be_anywhere]
    return part_on_clock(squares)


def _together(
    study: Study, ids: Ids, values: Mapping[str, float], piece: Piece, linear: Linearised, sd: np.ndarray
) -> np.ndarray:
    """The shifts [s] of all edges together: a Gauss-Newton step, or the part of it that fits better.

    The other nuisance parameters are integrated out.
    """
    lasting, sd = lasting_edges(piece), without_delays(piece, sd)
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
    study: Study, ids: Ids, values: Mapping[str, float], piece: Piece, linear: Linearised, started: bool
) -> Piece:
    """The piece with its own start at the most likely one: a Gauss-Newton step, or the part of it that fits better.

    Far from the model's optimum a whole step may lead to where the plant has no rest, or moves quite differently.
    """
    sought = {n: s for n, s in study.unknown(ids, piece).items() if started or n in study.plant.each_start}
    if not sought:
        return piece
    local = Marginal(piece.marginal.windows)
    mean = piece.nuisances.mean(local.apply(linear.columns), local.apply(linear.residual), piece.nuisances.sd)
    found = dict(zip(piece.nuisances.names, mean, strict=True))
    others = np.array([not n.startswith(START_OF) for n in piece.nuisances.names])
    left = marginal(windows_of(piece, linear, piece.shifts), linear.columns, piece.nuisances.sd * others)

    def cost(case: Case) -> float:
        answer = study.asked(ids, [case]).possible(values)[0]
        if answer is None:
            return np.inf
        return float(np.sum(left.apply(whitened(case, answer - piece.record, study.noise, piece.weight)) ** 2))

    least, own = cost(piece.case), piece.case.own
    for part in STEP_PARTS:
        begins = {n: own.get(n, 0.0) + part * size * float(found[f"{START_OF}{n}"]) for n, size in sought.items()}
        case = replace(piece.case, own=dict(own) | _inside(study, begins))
        if cost(case) < least:
            return replace(piece, case=case)
    return piece


def _kept_in_place(piece: Piece, shifts: np.ndarray, delays: Mapping[str, float]) -> np.ndarray:
    """Shifts of edges that leave them where they are, within their bounds, once monitors are found later than before.

    An edge happens at its recorded instant and shift less the delay of its monitor: both are told by the same samples.
    """
    edges = piece.driven.edges
    more = np.array([delays.get(e.input, 0.0) - piece.delays.get(e.input, 0.0) for e in edges])
    low, high = bounds(piece)
    return np.clip(shifts + more, low, high)


def _inside(study: Study, values: Mapping[str, float]) -> dict[str, float]:
    """Values of parameters, clipped to their bounds."""
    inside, known = {}, study.plant.model.quantities()
    for name, value in values.items():
        q = known.get(name)  # none where an effect's state is off
        inside[name] = value if q is None else q.inside(value)
    return inside
