"""What a recording cannot be: each check yields what is wrong as "line N, column 'name': ..."."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from .bench import Bench, Signal
from .monitors import noise_level

STANDSTILL = 25  # equal samples in a row that a noisy sensor never gives
STRUCTURE = 20.0  # times the noise a signal must span to count as one


def findings(
    time: np.ndarray, inputs: Mapping[str, np.ndarray], output: np.ndarray, bench: Bench, lines: np.ndarray
) -> Iterator[str]:
    """All that is wrong with a recording, the plainest first."""
    for signal in bench.inputs:
        yield from _wrong_unit(inputs[signal.name], signal, lines)
    seen = np.flatnonzero(np.isfinite(output))
    name = bench.output.name
    if seen.size < bench.least_samples:
        yield f"column {name!r}: too few samples: {seen.size} numbers; expected at least {bench.least_samples}"
        return
    values, there = output[seen], lines[seen]
    yield from _wrong_unit(values + bench.rest, bench.output, there)
    yield from _constant(values, name, there)
    yield from _standstill(values, name, there)
    if bench.rest:
        yield from _below_rest(values, bench, there)


def _wrong_unit(values: np.ndarray, signal: Signal, lines: np.ndarray) -> Iterator[str]:
    problem = mislabelled(values, signal)
    if problem:
        yield f"line {lines[int(np.argmax(np.abs(values)))]}, column {signal.name!r}: {problem}"


def mislabelled(values: np.ndarray, signal: Signal) -> str:
    """What the largest value says against the unit of a signal that is more than noise about zero; "" for nothing."""
    largest = float(values[int(np.argmax(np.abs(values)))])
    top, span, noise = abs(largest), float(np.ptp(values)), noise_level(values)
    what = f"the largest value is {largest:g} {signal.unit}"
    if top > signal.most:
        return f"{what}; expected at most {signal.most:g} {signal.unit}: {signal.mislabelled[1]}?"
    if 0 < top < signal.least and span > STRUCTURE * noise and top > 0.02 * signal.least:
        return f"{what}; expected some hundred or thousand: {signal.mislabelled[0]}?"
    return ""


def _constant(values: np.ndarray, name: str, lines: np.ndarray) -> Iterator[str]:
    if np.ptp(values) <= 12.0 * noise_level(values) or np.ptp(values) == 0:
        yield (
            f"lines {lines[0]} to {lines[-1]}, column {name!r}: a constant record ({values.mean():g}) determines "
            "nothing; expected one in which the output moves"
        )


def _standstill(values: np.ndarray, name: str, lines: np.ndarray) -> Iterator[str]:
    """A run of equal values that the sensor's own noise would never give; at the extreme it is a saturation."""
    equal = np.diff(values) == 0
    if equal.mean() > 0.5:
        return  # a noiseless or coarse record: standing still means nothing
    for extreme in (values.max(), values.min()):
        there = np.flatnonzero(values == extreme)
        if there.size >= max(STANDSTILL, 0.03 * values.size):
            yield (
                f"line {lines[there[0]]}, column {name!r}: the sensor has run into its stop (saturated): {there.size} "
                f"of {values.size} samples read {extreme:g}; leave these cells empty or the experiment out"
            )
    edges = np.flatnonzero(np.diff(np.concatenate([[False], equal, [False]]).astype(int)))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if end - begin + 1 >= STANDSTILL:
            yield (
                f"lines {lines[begin]} to {lines[end]}, column {name!r}: the sensor is frozen: {end - begin + 1} equal "
                f"values {values[begin]:g}; leave these cells empty or the experiment out"
            )


def _below_rest(values: np.ndarray, bench: Bench, lines: np.ndarray) -> Iterator[str]:
    """Smoothed over a few samples, so that noise about rest is no finding."""
    smooth = np.convolve(values, np.ones(9) / 9, mode="valid")
    lowest = int(np.argmin(smooth))
    if smooth[lowest] < -0.05 * bench.rest:
        yield (
            f"line {lines[lowest + 4]}, column {bench.output.name!r}: {smooth[lowest] + bench.rest:.4g} m is below the "
            f"tube's own radius {bench.rest:g} m; expected a radius (or 'displacement'), or set r_o in bench.toml"
        )
