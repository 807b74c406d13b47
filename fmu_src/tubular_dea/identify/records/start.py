"""The initial state of a recording: rest, equilibrium under its first inputs, or unknown.

A file that begins with loaded inputs and a moved output was cut from a longer run, or the plant stood under load. Its
states at the start are then unknown: where the plant has an equilibrium, it starts there, and by how much each state is
off is one of the record's own numbers (`adjust`), which the record itself determines.

What rests at zero inputs shows the zeros of their monitors: what a line through one begins with. They are taken off
before anything is fitted, because a plant without damping at rest rings under them, in a way that no straight line in
the zero describes. A zero that all files have in common may be an effect and stays. What monitors show may be a small
load as well, as in a closed circuit at rest: the plant starts at equilibrium with it, which is rest where it is none.

What moves from the first sample on begins with nothing, for the same reason, up to a sample earlier: a sampling clock
seldom begins with the plant. When it began is one of the record's own numbers too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import sympy
from scipy.special import ndtr, stdtrit

from ...laws.places import Path
from ...model.declare import Model
from ...model.sizes import evaluator
from ...model.starts import unknowns
from ...plants.plant import Input, Output, Plant
from .experiment import RESTED, UNKNOWN, Experiment, Recordings

if TYPE_CHECKING:
    from ..inputs.drive import Drive
    from ..inputs.held import HeldLine

# Set by judgement. Check: `pytest tests/test_start.py`,
# `python -m blind.score --nulls 12 --conventions start --seed 1000`
FIRST_SAMPLES = 12  # [samples] that tell what a record begins with, and within which what begins is changed
CLEARLY = 5.0  # [standard errors] of it that are a load
ZEROS = 3.0  # [1] usual zeros of its signal that are one
SEVERAL = 3  # [1] files at rest from which on it can be told what their zeros have in common
MOVED = 3.0  # [standard deviations] of a monitor's noise by which a line that rests wanders at most
SPIKE = 8.0  # [standard deviations] up to which a single corner of it is noise
IN_COMMON = 4.0  # [standard deviations of a normal number] of chance that the mean of zeros is zero, if it is not
AT_FIRST = 0.5  # [1] of rigs that begin with a sample; the others do so anywhere between two
BEGINS = 40  # [1] places between two samples that are compared
LARGE_SHARE = 0.99  # [1] quantile of a signal that stands for its largest value
FAINT_SIGNAL = 0.02  # [1] of a signal's largest value: less is none, where its zero is not known

# Set by judgement. Check: `pytest tests/test_adjust.py::test_monitors_behind_a_filter_are_late_alike_in_all_files`,
# `python -m blind.score --nulls 12 --conventions antialias --seed 1000`
LATEST = 2  # [samples] by which filters against aliasing make monitors late at most


def detected(experiment: Experiment, plant: Plant) -> str:
    """The kind of start of a recording, from its first samples; unknown under a load that has moved the output.

    A static law's output moves at once; what effects remember under a load is unknown. A plant without an equilibrium
    that is declared to start somewhere has not done so where its output begins elsewhere.
    """
    static = not plant.model.states
    if not static and (not experiment.outputs or not (plant.model.curve or unknowns(plant.model))):
        return RESTED
    loaded = _loaded(experiment, plant)
    if static:
        return UNKNOWN if loaded else RESTED
    first, *others = [o for o in plant.outputs if o.name in experiment.outputs]
    told = [first, *(o for o in others if not plant.model.curve and not _fits_change_start(plant, o))]
    return UNKNOWN if loaded and any(_begun_off(experiment, plant, o) for o in told) else RESTED


def with_unknown_starts(recordings: Recordings) -> Recordings | None:
    """The recordings with an unknown start of files that begin under load, though no output tells that they begin
    elsewhere than as declared; None where there are none. A cylinder is at any place, but declared to stand still."""
    plant = recordings.plant
    if plant.model.curve or not plant.model.states or not unknowns(plant.model):
        return None

    def may_move(e: Experiment) -> bool:
        return e.start == RESTED and not e.start_said and not e.follows and _loaded(e, plant)

    moving = [may_move(e) for e in recordings.experiments]
    if not any(moving):
        return None
    changed = zip(recordings.experiments, moving, strict=True)
    return replace(recordings, experiments=[replace(e, start=UNKNOWN) if moves else e for e, moves in changed])


def _loaded(experiment: Experiment, plant: Plant) -> bool:
    """Whether an input clearly begins elsewhere than at rest."""
    return any(_begins_off(experiment.time, experiment.inputs[s.name], s.known_zero) for s in plant.inputs)


def _begun_off(experiment: Experiment, plant: Plant, output: Output) -> bool:
    """Whether an output clearly begins elsewhere than at rest, or than where the plant is declared to start."""
    seen = experiment.seen(output.name)
    rest = output.rest if plant.model.curve else _declared_reading(experiment, plant, output.name)
    values = experiment.outputs[output.name][seen]
    return rest is not None and _begins_off(experiment.time[seen], values - rest, output.known_zero)


def _declared_reading(experiment: Experiment, plant: Plant, output: str) -> float | None:
    """What an output (SI) reads first if a plant starts as declared under an experiment's first inputs; None where that
    depends on numbers of each record."""
    model, expression = plant.model, _at_declared_start(plant.model, output)
    first = {name: float(values[0]) for name, values in experiment.inputs.items()}
    known = {p.quantity.name: p.quantity.value for p in model.parameters if p.start != "each"} | first
    symbols, value = evaluator(expression)
    if not {str(s) for s in symbols} <= known.keys():
        return None
    found = value(*(known[str(s)] for s in symbols))
    return found if np.isfinite(found) else None


def _fits_change_start(plant: Plant, output: Output) -> bool:
    """Whether what an output reads at the declared start depends on parameters that a fit may change."""
    fitted = {p.quantity.symbol for p in plant.model.parameters if p.tunable}
    return bool(_at_declared_start(plant.model, output.name).free_symbols & fitted)


def _at_declared_start(model: Model, output: str) -> sympy.Expr:
    """An output over inputs and parameters where the states start as declared."""
    known_as = {d.quantity.symbol: d.expression for d in model.definitions}
    known_as |= {s.quantity.symbol: s.start for s in model.states}
    expression = sympy.sympify(model.expression(output))
    while expression.free_symbols & known_as.keys():
        expression = expression.xreplace(known_as)
    return expression


def begun_elsewhere(recordings: Recordings, output: Output) -> tuple[Experiment, float, float] | None:
    """The first file that is computed from the declared start, what an output reads first, and would read (SI).

    None unless all such files begin elsewhere; where that depends on parameters, which a fit may change; and where it
    is zero, as then the sensor's own zero is as likely.
    """
    plant, first = recordings.plant, None
    if plant.model.curve or not plant.model.states or _fits_change_start(plant, output):
        return None
    for e in recordings.experiments:
        if recordings.starts[e.name] != RESTED or e.follows or output.name not in e.outputs:
            continue
        seen, declared = e.seen(output.name), _declared_reading(e, plant, output.name)
        values = e.outputs[output.name][seen]
        if not declared or not _begins_off(e.time[seen], values - declared, output.known_zero):
            return None
        first = first or (e, float(values[0]), declared)
    return first


def _begins_off(time: np.ndarray, values: np.ndarray, zero: float) -> bool:
    """Whether a signal is clearly not zero at its first sample, by the straight line through the first of them."""
    if time.size < FIRST_SAMPLES:
        return False
    line = np.column_stack([np.ones(FIRST_SAMPLES), time[:FIRST_SAMPLES] - time[0]])
    found, *_ = np.linalg.lstsq(line, values[:FIRST_SAMPLES], rcond=None)
    variance = float(np.sum((values[:FIRST_SAMPLES] - line @ found) ** 2)) / (FIRST_SAMPLES - 2)
    error = np.sqrt(variance * np.linalg.inv(line.T @ line)[0, 0])
    least = ZEROS * zero if zero > 0 else FAINT_SIGNAL * float(np.quantile(np.abs(values), LARGE_SHARE))
    return bool(abs(found[0]) > max(CLEARLY * error, least))


def zeroed(
    experiments: Sequence[Experiment], drives: Sequence[Drive], plant: Plant, effects: bool = True
) -> list[Drive]:
    """The drives without the zeros of monitors, where experiments begin at rest.

    Where `effects` are sought, a zero that they have in common stays.
    """
    resting = [i for i, e in enumerate(experiments) if e.start == RESTED]
    if plant.model.curve is None:
        return list(drives)
    zeros: list[dict[str, float]] = [{} for _ in drives]
    still: list[dict[str, int]] = [{} for _ in drives]
    levels: dict[str, float] = {}
    loads: dict[str, float] = {}
    for signal in plant.inputs:
        shown = {i: _at_rest(experiments[i], drives[i], signal.name) for i in resting}
        seen = {i: rest for i, rest in shown.items() if rest and abs(rest[0]) <= ZEROS * signal.known_zero}
        found = np.array([zero for zero, _ in seen.values()])
        effect = effects and _may_be_off(plant, signal.name)
        levels[signal.name] = _in_common(found, signal.known_zero) if effect else 0.0
        if signal.name == plant.model.curve.load and found.size:
            loads[signal.name] = abs(float(found.mean()) - levels[signal.name])
        for i, (zero, points) in seen.items():
            zeros[i][signal.name], still[i][signal.name] = zero - levels[signal.name], points
        for i in resting:
            if signal.linear and i not in seen and _may_begin_with_nothing(experiments[i], drives[i], signal):
                still[i][signal.name] = 1  # it moves at once, from nothing
    shown_at_rest = [{n: z.get(n, 0.0) + level for n, level in levels.items()} for z in zeros]
    latest = LATEST if may_be_filtered(drives) else 0
    begun = [
        _from_nothing(e, d, plant, s, r, latest)
        for e, d, s, r in zip(experiments, drives, still, shown_at_rest, strict=True)
    ]
    return [d.without(z, s, levels, loads) if s else d for (d, s), z in zip(begun, zeros, strict=True)]


def may_be_filtered(drives: Sequence[Drive]) -> bool:
    """Whether the monitors of some records may have a filter: not where inputs switch from one sample to the next."""
    return not any(d.edges and not d.shown for d in drives)


def _may_begin_with_nothing(experiment: Experiment, driven: Drive, signal: Input) -> bool:
    """Whether an input may have begun with nothing: with less than a zero and what it moves by in a sample."""
    line, time = driven.lines[signal.name], experiment.time
    first, second = np.interp(time[:2], line.time, line.values)
    moves = 0.0 if line.edge[0] >= 0 or abs(second) < abs(first) else abs(second - first)
    return bool(abs(first) <= ZEROS * signal.known_zero + moves)


def _from_nothing(
    experiment: Experiment,
    driven: Drive,
    plant: Plant,
    still: Mapping[str, int],
    nothing: Mapping[str, float],
    latest: int,
) -> tuple[Drive, dict[str, int]]:
    """The drive with lines that move at once begun at what is `nothing` there, and how many points are `still`: two
    where they begin after the first sample.

    A point some samples from the start sees to it that only up to there they are changed.
    """
    at = float(experiment.time[min(FIRST_SAMPLES, experiment.time.size - 1)])
    lines, begun, points = dict(driven.lines), {}, dict(still)
    for signal in plant.inputs:
        if still.get(signal.name) == 1:
            line = lines[signal.name].with_time(at)
            begins = _begun(experiment, driven, signal, line, nothing[signal.name], latest)
            lines[signal.name], begun[signal.name] = line.begun_at(begins[0]), begins[1]
            points[signal.name] += begins[0] > line.time[0]
    return replace(driven, lines=lines, begun=begun), points


def _begun(
    experiment: Experiment, driven: Drive, signal: Input, line: HeldLine, nothing: float, latest: int
) -> tuple[float, float]:
    """When an input that moves from the first sample on began to, and the standard deviation of that [s].

    It began with the first sample, as where one clock runs both, anywhere in the interval before, or behind a filter
    seems to `latest` samples later at most. From `nothing` on, a line through the first samples leaves there, but for
    the noise and the zero of its monitor.
    """
    time, part = experiment.time, np.arange(-BEGINS, latest * BEGINS + 1) / BEGINS
    samples = min(FIRST_SAMPLES, max(int(np.searchsorted(time, line.time[1])), 2), time.size)
    after, values = (time[:samples] - time[0]) / (time[1] - time[0]), experiment.inputs[signal.name][:samples] - nothing
    noise = np.hypot(driven.noise[signal.name], np.ptp(values) / samples / BEGINS)  # and how finely it is tried
    if noise == 0.0:
        return float(time[0]), 0.0
    left = np.array([_left_of_hinge(after - by, values / noise, signal.known_zero / noise) for by in part])
    chance = np.where(part == 0, AT_FIRST, (1 - AT_FIRST) / BEGINS) * np.exp(0.5 * (left.min() - left))
    mean = float(np.average(part, weights=chance))
    spread = float(np.sqrt(np.average((part - mean) ** 2, weights=chance)))
    return float(time[0] + mean * (time[1] - time[0])), spread * float(time[1] - time[0])


def _left_of_hinge(after: np.ndarray, values: np.ndarray, zero: float) -> float:
    """What a line from 0 at `after` (n,) = 0, bent where that is long enough to tell, leaves of `values` (n,), squared;
    `zero` is the standard deviation of an offset. Both are in units of the noise."""
    moved, bent = np.maximum(after, 0.0), after.size > FIRST_SAMPLES // 2
    terms = np.column_stack([moved, *([moved**2] if bent else []), np.full(after.size, zero)])
    prior = np.append(np.zeros(terms.shape[1] - 1), 1.0)
    rows, target = np.vstack([terms, prior]), np.append(values, 0.0)
    solved, *_ = np.linalg.lstsq(rows, target, rcond=None)
    return float(np.sum((rows @ solved - target) ** 2))


def _in_common(zeros: np.ndarray, usual: float) -> float:
    """What zeros (k,) of a monitor have in common, if more than chance gives, or in few files more than `usual`."""
    if zeros.size < SEVERAL:
        return float(zeros.mean()) if zeros.size and abs(zeros.mean()) > usual else 0.0
    error = float(np.std(zeros, ddof=1)) / float(np.sqrt(zeros.size))
    surely = -float(stdtrit(zeros.size - 1, ndtr(-IN_COMMON)))  # few files tell little of their spread
    return float(zeros.mean()) if abs(zeros.mean()) > surely * error else 0.0


def _at_rest(experiment: Experiment, driven: Drive, name: str) -> tuple[float, int] | None:
    """What a monitor shows before anything moves, and how many points its line has there: within noise about it.

    Where it moves at once, that is what it clearly begins with; None where nothing tells.
    """
    line = driven.lines[name]
    points = _still(np.abs(line.values - line.values[0]), driven.noise[name])
    time, values = line.time[:points], line.values[:points]
    if np.searchsorted(experiment.time, time[-1]) < FIRST_SAMPLES:
        return _clear_begin(experiment, line, name)
    return float(np.trapezoid(values, time) / (time[-1] - time[0])), points


def _still(off: np.ndarray, noise: float) -> int:
    """How many points (k,) of a line that is `off` its first one come before it moves.

    It leaves for good: noise with a memory wanders off, too, and comes back, and would make a tube at rest ring.
    """
    far, away = off > SPIKE * noise, off > MOVED * noise
    if far.any():
        return int(np.flatnonzero(~away[: int(np.argmax(far))])[-1]) + 1
    moved = away & np.append(away[1:], away[-1])
    return int(np.argmax(moved)) if moved.any() else off.size


def _clear_begin(experiment: Experiment, line: HeldLine, name: str) -> tuple[float, int] | None:
    """What a monitor begins with, by a parabola through the samples of its line's first piece, if that is clearly
    something: more than what it moves by in a sample, as it may have begun to move that much earlier."""
    if line.time.size < 2 or np.any(line.edge[:2] >= 0):
        return None
    samples = int(np.searchsorted(experiment.time, line.time[1]))
    if samples < FIRST_SAMPLES:
        return None
    time = experiment.time[:samples] - experiment.time[0]
    (_, slope, first), covariance = np.polyfit(time / time[1], experiment.inputs[name][:samples], 2, cov=True)
    clear = abs(first) > CLEARLY * np.sqrt(covariance[-1, -1]) + abs(slope)
    return (float(first), 1) if clear else None


def _may_be_off(plant: Plant, name: str) -> bool:
    """Whether an offset of this input is among the effects."""
    return any(isinstance(p, Path) and p.name == name and p.asks("offset") for p in plant.places)


def anywhere(plant: Plant) -> bool:
    """Whether every state of a plant starts free in each record: then what effects add has no known start either."""
    return bool(plant.each_start) and not unknowns(plant.model)


def is_loose(recordings: Recordings, experiment: Experiment) -> bool:
    """Whether nothing tells what an experiment starts from: it begins under load, or the plant starts anywhere and
    bench.toml does not say that it rested."""
    begun = recordings.begun_by(experiment)
    return begun.start == UNKNOWN or (not begun.start_said and anywhere(recordings.plant))
