"""Long gaps in a record, or in an input's cells: where that moves about them, nobody knows what it did, nor where the
plant is after that. What comes after such a gap is an experiment of its own, whose start is unknown.

Across a gap a held input keeps its last value: a heater that happened to be at its largest before 15 hours were lost
heated on, and a saturation of the heater explained why the room stayed cooler.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ...plants.plant import Input, Plant
from ...recordings.table import moving
from ..signals.monitors import LARGEST, noise_level
from ..signals.quiet import steady
from .experiment import UNKNOWN, Experiment

# Set by judgement: where an input switches in a brief gap, the instant is found. Check: `pytest tests/test_gaps.py`
MISSING = 8.0  # [samples] that are missing in a long gap, at least
ABOUT = 4  # [1] times as many samples as that, on either side, that tell how an input moves there
OF_SPAN = 0.05  # [1] share of its span by which an input is elsewhere after as long, to be unknown in the gap,
OF_NOISE = 5.0  # [standard deviations] of its noise, and by so many


def cut(experiment: Experiment, plant: Plant) -> list[Experiment]:
    """The experiment, or its parts before, between and after long gaps about which an input moves, each long enough.

    One whose place among others bench.toml tells ([order]) is left as it is: these follow all of it.
    """
    if experiment.begins is not None:
        return [experiment]
    experiment = _certain(experiment)
    time = experiment.time
    if not plant.model.remembers:
        return [experiment]
    steps = np.diff(time)
    usual = float(np.median(steps))
    even = np.pad(steady(time), 1, constant_values=True)
    alone = even[:-2] & even[2:]  # not where samples are rare for a while, as a recorder may write them at rest
    long = np.flatnonzero((steps > (MISSING + 0.5) * usual) & alone)  # the last samples before
    lost = {int(at): round(float(steps[at]) / usual) - 1 for at in long}
    told = {at: names for at, n in lost.items() if (names := _moving(experiment, plant.inputs, at, n))}
    cuts = [0, *(at + 1 for at in told), time.size]
    parts = [p for a, b in pairwise(cuts) if _read_in(experiment, p := slice(a, b), plant.least_samples)]
    if len(cuts) == 2 or not parts:
        return [experiment]
    said = [_said(experiment, at, lost[at], names) for at, names in told.items()]
    if (short := time.size - sum(p.stop - p.start for p in parts)) > 0:
        said.append(f"{short} samples between gaps are too few to be fitted, and left out")
    for name, values in experiment.outputs.items():
        few = [p for p in parts if name not in _read_in(experiment, p, plant.least_samples)]
        if number := sum(int(np.isfinite(values[p]).sum()) for p in few):
            said.append(f"{number} readings of {name} between gaps are too few to be fitted, and left out")
    source = experiment.source and replace(experiment.source, remarks=(*experiment.source.remarks, *said))
    first = replace(experiment, source=source)
    return [_part(first, part, number, plant.least_samples) for number, part in enumerate(parts)]


def guessed(values: Mapping[str, np.ndarray], inputs: Sequence[Input]) -> np.ndarray | None:
    """The rows (n,) of a file in which the cells of an input that moves about them are empty for long; None if there
    are none.

    Any number there is a guess. Long is so for that input: it may have been read less often than others.
    """
    rows = np.zeros(next(iter(values.values())).size, dtype=bool)
    for signal in inputs:
        there = np.flatnonzero(np.isfinite(values[signal.name]))
        steps = np.diff(there)
        usual = float(np.median(steps)) if steps.size else 1.0
        for at in np.flatnonzero(steps > (MISSING + 0.5) * usual):
            if _moves(values[signal.name][there], signal, int(at), round(float(steps[at]) / usual) - 1):
                rows[there[at] + 1 : there[at + 1]] = True
    return rows if rows.any() else None


def _certain(experiment: Experiment) -> Experiment:
    """The experiment without samples at which an input is a guess: they are lost."""
    if experiment.guessed is None:
        return experiment
    return replace(_of_rows(experiment, ~experiment.guessed), guessed=None)


def _of_rows(experiment: Experiment, rows: slice | np.ndarray) -> Experiment:
    """Some samples of an experiment."""
    return replace(
        experiment,
        time=experiment.time[rows],
        inputs={n: v[rows] for n, v in experiment.inputs.items()},
        outputs={n: v[rows] for n, v in experiment.outputs.items()},
        lines=experiment.lines[rows],
        trigger=None if experiment.trigger is None else experiment.trigger[rows],
    )


def _read_in(experiment: Experiment, part: slice, least: int) -> list[str]:
    """The outputs of which a part has so many readings at least."""
    return [name for name, values in experiment.outputs.items() if np.isfinite(values[part]).sum() >= least]


def _moving(experiment: Experiment, inputs: Sequence[Input], at: int, lost: int) -> list[str]:
    """The inputs that move about a gap after sample `at`, in which so many samples are missing."""
    return [s.name for s in inputs if _moves(experiment.inputs[s.name], s, at, lost)]


def _moves(values: np.ndarray, signal: Input, at: int, lost: int) -> bool:
    """Whether an input (n,) moves about a gap after sample `at`, in which so many samples are missing."""
    if float(np.ptp(values)) <= signal.little:
        return False
    near = values[max(at + 1 - ABOUT * lost, 0) : at + 1], values[at + 1 : at + 1 + ABOUT * lost]
    moved = np.concatenate([_elsewhere(v, lost, signal.held) for v in near])
    noise = min(noise_level(values), LARGEST * float(np.abs(values).max()))  # more may be the signal itself
    least = max(OF_SPAN * float(np.ptp(values)), OF_NOISE * noise)
    across = 0.0 if signal.held else _beside_the_line(*near, lost)
    return moved.size > 0 and max(float(np.sqrt(np.mean(moved**2))), across) > least


def _beside_the_line(before: np.ndarray, after: np.ndarray, lost: int) -> float:
    """By how much the values on either side of a gap, gone on with as they go there, miss the line across at its
    middle: a ramp that ended in the gap does."""
    count = min(max(lost // 2, 2), before.size, after.size)
    if count < 2:
        return 0.0
    x = np.arange(count)
    (rise, end), (fall, begin) = np.polyfit(x - count + 1, before[-count:], 1), np.polyfit(x, after[:count], 1)
    middle, half = 0.5 * (end + begin), 0.5 * (lost + 1)
    return float(max(abs(end + rise * half - middle), abs(begin - fall * half - middle)))


def _elsewhere(values: np.ndarray, lost: int, held: bool) -> np.ndarray:
    """By how much values (n,) are off, in the middle of so many samples, what they were before or the line across."""
    lost = min(lost, max(values.size // 2, 1))
    middle, before = values[lost // 2 : values.size - lost + lost // 2], values[: values.size - lost]
    return middle - (before if held else 0.5 * (before + values[lost:]))


def _said(experiment: Experiment, at: int, lost: int, names: list[str]) -> str:
    """What is said of a gap after sample `at`, in which so many are missing."""
    row = experiment.source.row if experiment.source else "sample"
    return (
        f"{lost} samples are missing after {row} {experiment.lines[at]}, near where {moving(names)}: what comes after "
        "them is an experiment of its own, whose start is unknown"
    )


def _part(experiment: Experiment, part: slice, number: int, least: int) -> Experiment:
    """A part of an experiment, with outputs of so many readings at least; the first keeps its name, and if it is at its
    begin its start."""
    read, found = _read_in(experiment, part, least), _of_rows(experiment, part)
    found = replace(
        found,
        name=f"{experiment.name}_part{number + 1}" if number else experiment.name,
        outputs={n: v if n in read else np.full_like(v, np.nan) for n, v in found.outputs.items()},
        part_of=experiment.name,
    )
    return found if part.start == 0 else replace(found, start=UNKNOWN, start_said=True)
