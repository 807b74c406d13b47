"""Checks of recordings: each yields what is wrong as "line N, column 'name': ..."."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from ...model.declare import Quantity
from ...model.units import converted
from ...plants.plant import Input, Output, Plant
from ...stretches import true_stretches
from ..signals.monitors import QUIET, changes_by_itself, noise_level, noise_of_differences, resolution
from .labels import as_written, likely

# Set by convention: weather, and places up to 1 km. Check: `pytest tests/test_data.py -k absolute`
AIR = (0.88e5, 1.07e5)  # [Pa] that the air's pressure is

# Set by judgement. Check: `pytest tests/test_data.py tests/test_unusual_recordings.py`
STANDSTILL = 25  # [samples] equal in a row that a noisy sensor never gives
SATURATED = 0.03  # [1] share of all samples that read the extreme where a sensor has run into its stop
COARSE_SENSOR = 3.0  # [1] steps of its resolution: a sensor with less noise may well give equal samples in a row
AT_STOP = 2.0  # [1] times its noise below the extreme in which such a run stays: of the noise alone, one is shorter
AWAY = 0.05  # [1] of what a sensor shows by which a reading is no longer at its stop
QUIETER = 0.4  # [1] times the noise elsewhere that there is at most where a sensor has run into a stop in front of it
ALIVE = 0.1  # [1] share of samples that differ from the one before in a record that its noise keeps moving
LIVELY = 0.7  # [1] the same of a record whose noise is some steps of its resolution, where it does not stand still
LOW_ORDER = 3  # [1] of the differences that are left of noise, and of a fast sine
HIGH_ORDER = 8  # [1] of the differences that are left of noise, but not of what is smooth, as a commanded sine is
SMOOTHED_OUT = 0.1  # [1] share of the third differences: 0.04 for a sine of 6 samples, 0.97 for noise of memory 0.97
STRUCTURE = 20.0  # [1] times the noise a signal must span to count as one
CONSTANT = 12.0  # [1] times the noise that a constant record spans at most,
NOISE_ALONE = 1.5  # [1] and its standard deviation is: what moves by six times the noise between two levels has 3
NOTHING = 0.02  # [1] of the least that is usual: what is smaller is no signal with a wrong unit
BELOW_REST = 0.05  # [1] of its size at rest by which a plant is not smaller
SMOOTHED = 9  # [samples] over which noise is averaged for that

LEFT_OUT = "empty these cells or leave the experiment out"


def inputs(
    recorded: Mapping[str, np.ndarray],
    plant: Plant,
    lines: np.ndarray,
    commanded: Collection[str] = (),
    units: Mapping[str, str] = MappingProxyType({}),
) -> Iterator[str]:
    """The faults of a recording's inputs (n,) (SI units, NaN where missing), the most obvious first.

    `lines` (n,) are those of the file, `units` how its columns are labelled. What was `commanded` and not measured may
    rest as long as it likes, as may what is held and changes by more than the noise of a monitor (a heating that is off
    at night).
    """
    for signal in plant.inputs:
        seen = np.flatnonzero(np.isfinite(recorded[signal.name]))
        values, there = recorded[signal.name][seen], lines[seen]
        label = units.get(signal.name, "")
        yield from _wrong_unit(values, signal.name, signal, plant.quantity(signal.name), label, there)
        command = signal.name in commanded or (signal.held and changes_by_itself(values))
        if not command:
            units_of = (plant.quantity(signal.name).unit, label or plant.quantity(signal.name).unit)
            for finding in _standstill(values, signal.name, there, units_of, (np.max,), signal):
                hint = f"{signal.name} = 0 below [noise] in bench.toml says that it was commanded, and not measured"
                yield f"{finding}; {hint}"


def output(
    recorded: np.ndarray,
    signal: Output,
    plant: Plant,
    lines: np.ndarray,
    name: str,
    rest: float,
    rests: bool = False,
    label: str = "",
    waits: np.ndarray | None = None,
) -> Iterator[str]:
    """The faults of an output (n,) (SI), as in the file's column `name`, in the unit of its `label`; NaN where missing.

    `rest` is what it reads at rest, and `rests` whether it may do so all the time, as another output moves. While no
    input moves it yet, `waits` (n,), it is at no stop.
    """
    seen = np.flatnonzero(np.isfinite(recorded))
    if seen.size < plant.least_samples:
        none = "; leave the experiment out" if seen.size < recorded.size else ""
        yield (
            f"column {name!r}: too few samples: {seen.size} numbers in {recorded.size} rows; expected at least "
            f"{plant.least_samples}{none}"
        )
        return
    values, there = recorded[seen], lines[seen]
    yield from _wrong_unit(values, name, signal, plant.quantity(signal.name), label, there)
    if not rests:
        yield from constant(values, name, there, "the output moves")
    if not rests and not _may_stand_still(plant, signal):
        units = (plant.quantity(signal.name).unit, label or plant.quantity(signal.name).unit)
        yield from _standstill(values, name, there, units)
        driven = np.ones(seen.size, dtype=bool) if waits is None else ~waits[seen]
        yield from _quiet_stop(values, name, there, units, driven)
    parameter = signal.size_at_rest
    if signal.rest is not None and parameter:
        yield from _below_rest(values, name, there, rest, signal, plant.quantity(parameter), label)


def _may_stand_still(plant: Plant, signal: Output) -> bool:
    """Whether an effect at the plant's places may explain that the output stands still."""
    return any(place.name == signal.name and place.asks("saturation") for place in plant.places)


def _wrong_unit(
    values: np.ndarray, name: str, signal: Input | Output, quantity: Quantity, label: str, lines: np.ndarray
) -> Iterator[str]:
    problem = mislabelled(values, signal, quantity, label)
    if problem:
        yield f"line {lines[int(np.argmax(np.abs(values)))]}, column {name!r}: {problem}"


def mislabelled(values: np.ndarray, signal: Input | Output, quantity: Quantity, label: str = "") -> str:
    """Why the largest of a signal's values (n,) (SI), if it is more than noise, contradicts the `label` that its column
    has ("": the SI unit); "" if it does not."""
    unit = quantity.unit
    label = label or unit
    largest = float(values[int(np.argmax(np.abs(values)))])
    top, span, noise = abs(largest), float(np.ptp(values)), noise_level(values)
    if np.count_nonzero(np.diff(values)) >= STANDSTILL or _flickers(values):  # a monitor, no steps of a set point
        noise = max(noise, resolution(values))
    what = f"the largest value is {as_written(largest, unit, label)}; expected"
    wrong = (
        likely(largest, signal.least, signal.most, quantity.nominal, unit, label)
        or "another unit, or a divider or gain left out"
    )
    if top > signal.most:
        absolute = unit == "Pa" and AIR[0] < float(values.min()) < AIR[1]
        if absolute:
            air = as_written(float(values[0]), unit, label).split()[0]
            right = f"{signal.name}=COLUMN[1 {label} from {air}] in --columns is right"
            wrong = f"an absolute pressure, with the air's? If so, {right}"
            return f"{what} at most {as_written(signal.most, unit, label)}: {wrong}"
        return f"{what} at most {as_written(signal.most, unit, label)}: {wrong}?"
    if 0 < top < signal.least and span > STRUCTURE * noise and top > NOTHING * signal.least:
        return f"{what} at least {as_written(signal.least, unit, label)}: {wrong}?"
    return ""


def _flickers(values: np.ndarray) -> bool:
    """Whether what is off the commonest value is so for single samples, as the last bit of a coarse monitor is."""
    known, counts = np.unique(values, return_counts=True)
    off = values != known[int(np.argmax(counts))]
    return values.size >= STANDSTILL and not np.any(off[1:] & off[:-1])


def constant(values: np.ndarray, name: str, lines: np.ndarray, wanted: str) -> Iterator[str]:
    """A finding where `values` (n,) are only noise; `wanted` describes what was expected."""
    noise = noise_level(values)
    if np.ptp(values) == 0 or (np.ptp(values) <= CONSTANT * noise and np.std(values) <= NOISE_ALONE * noise):
        beside = f" beside noise of {noise:.3g}" if noise > 0 else ""
        yield (
            f"lines {lines[0]} to {lines[-1]}, column {name!r}: a constant record ({values.mean():g}{beside}) contains "
            f"no information; expected one in which {wanted}"
        )


def _standstill(
    values: np.ndarray,
    name: str,
    lines: np.ndarray,
    units: tuple[str, str],
    stops: Sequence[Callable[[np.ndarray], float]] = (np.max, np.min),
    driven: Input | None = None,
) -> Iterator[str]:
    """A run of equal values that the sensor's own noise would never give; at the extreme it is a saturation.

    `units` are the SI unit and that of the file. A signal written by a computer may stand still. An input is 0 before
    and after a plant is `driven`, and one that is held may be 0 in between.
    """
    if not _noisy(values):
        return
    for extreme in _limits(values, stops):
        there = np.flatnonzero(values == extreme)
        yield (
            f"line {lines[there[0]]}, column {name!r}: the sensor is saturated: {there.size} of "
            f"{values.size} samples read {as_written(extreme, *units)}; {LEFT_OUT}"
        )
    if np.count_nonzero(np.diff(values)) < ALIVE * values.size:
        return
    for begin, end in _still(values):
        off = driven is not None and (driven.held or begin == 0 or end == values.size - 1)
        if values[begin] != 0 or not off:
            yield (
                f"lines {lines[begin]} to {lines[end]}, column {name!r}: the sensor is frozen: {end - begin + 1} equal "
                f"values {as_written(float(values[begin]) + 0.0, *units)}; {LEFT_OUT}"
            )


def _quiet_stop(
    values: np.ndarray, name: str, lines: np.ndarray, units: tuple[str, str], driven: np.ndarray
) -> Iterator[str]:
    """A run at an extreme with far less noise than elsewhere: behind its stop a sensor shows its converter's alone.

    Where inputs are as they were at first, not `driven` (n,), it is where it rests, whatever its noise elsewhere.
    """
    if noise_level(values) <= COARSE_SENSOR * resolution(values):
        return
    for side, words in ((1.0, "largest"), (-1.0, "least")):
        turned = side * values
        extreme = float(turned.max())
        away = values[turned < extreme - AWAY * float(np.ptp(values))]  # most of them may be at the stop
        noise = max(noise_level(values), noise_level(away))
        runs = true_stretches(driven & (turned >= extreme - AT_STOP * noise))
        there = [np.arange(a, b) for a, b in runs if b - a >= STANDSTILL]
        count = sum(r.size for r in there)
        if count < SATURATED * values.size:
            continue
        quiet = float(np.median([noise_level(values[r]) for r in there]))
        elsewhere = noise_level(np.delete(values, np.concatenate(there)))
        if quiet < QUIETER * elsewhere:
            read, own, other = (as_written(float(f"{v:.3g}"), *units) for v in (side * extreme, quiet, elsewhere))
            yield (
                f"line {lines[there[0][0]]}, column {name!r}: the sensor is saturated: {count} of {values.size} "
                f"samples are at the {words} reading, {read}, with noise of {own} where it is {other} elsewhere; "
                f"{LEFT_OUT}"
            )


def _limits(values: np.ndarray, stops: Sequence[Callable[[np.ndarray], float]] = (np.max, np.min)) -> list[float]:
    """The extremes of a noisy sensor's readings that many samples share: it has run into its stop there."""
    extremes = [stop(values) for stop in stops if values.size]
    return [e for e in extremes if np.count_nonzero(values == e) >= max(STANDSTILL, SATURATED * values.size)]


def at_limit(values: np.ndarray) -> np.ndarray:
    """Which of a sensor's readings, all numbers, are its stop and tell nothing of its noise; (n,) of bool.

    Elsewhere noise moves it from nearly every sample to the next: what comes of rounding alone may stand still at rest.
    """
    there = np.isin(values, _limits(values))
    if not there.any():
        return there
    free = np.diff(values)[~(there[1:] & there[:-1])]
    noise, left = (_differing(values, order) for order in (LOW_ORDER, HIGH_ORDER))
    moved = noise > resolution(values) and left > SMOOTHED_OUT * noise
    lively = np.count_nonzero(free) >= LIVELY * free.size
    return there if moved and lively else np.zeros(values.size, dtype=bool)


def _still(values: np.ndarray) -> list[tuple[int, int]]:
    """The first and the last sample of every run of STANDSTILL equal values or more."""
    return [(a, b) for a, b in true_stretches(np.diff(values) == 0) if b - a + 1 >= STANDSTILL]


def _noisy(values: np.ndarray) -> bool:
    """Neighbouring values differ by noise, some steps of their resolution and a share of the span; nearly all of them
    do, but where the sensor stands still or has run into a stop. What is smooth where it moves is no noise."""
    step = np.abs(np.diff(values))
    free = (step > 0) | ((values[1:] != values.min()) & (values[1:] != values.max()))
    for begin, end in _still(values):
        free[begin:end] = False
    if np.count_nonzero(step[free]) < LIVELY * np.count_nonzero(free):
        return False
    noise, left = (_differing(values, order) for order in (LOW_ORDER, HIGH_ORDER))
    if left < SMOOTHED_OUT * noise:
        return False
    return noise > max(QUIET * float(np.ptp(values)), COARSE_SENSOR * resolution(values))


def _differing(values: np.ndarray, order: int) -> float:
    """The noise of which differences of that order speak, over samples that all differ; 0 where these are few."""
    moving = np.convolve(np.diff(values) != 0, np.ones(order), mode="valid") == order
    if moving.sum() < STANDSTILL:
        return 0.0
    return float(noise_of_differences(np.diff(values, order)[moving], order))


def _below_rest(
    values: np.ndarray, name: str, lines: np.ndarray, rest: float, signal: Output, size: Quantity, label: str
) -> Iterator[str]:
    """Smoothed over a few samples, so that noise about rest is no finding; `size` is the plant's."""
    smooth = np.convolve(values, np.ones(SMOOTHED) / SMOOTHED, mode="valid")
    lowest = int(np.argmin(smooth))
    if smooth[lowest] >= rest - BELOW_REST * float(size.value or 0.0):
        return
    wanted = " or ".join(
        f"a {heading!r} that starts at {size.name if parameter else 0}"
        for heading, parameter in list(signal.columns.items())[:2]
    )
    unit = label or size.unit
    low, high, zero = (converted(float(v), size.unit, unit) for v in (smooth[lowest], smooth.max(), rest))
    yield (
        f"line {lines[lowest + SMOOTHED // 2]}, column {name!r}: {low:.4g} {unit} is below the {name} at rest, "
        f"{zero:g} {unit}; expected {wanted}, or set {size.name} in bench.toml"
        f"{_turned(signal, unit, zero if zero - high < high - low else None) if zero - low > high - zero else ''}"
    )


def _turned(signal: Output, unit: str, rest: float | None) -> str:
    """How to say that an output counts the other way, from what it reads at `rest` (None: not known)."""
    reading = "READING_AT_REST" if rest is None else f"{rest:g}"
    counted = f"-1 {unit} from {reading}" if rest != 0 else f"-1 {unit}"
    return f'; if it counts the other way, write {signal.change} = "COLUMN [{counted}]" below [columns] there'
