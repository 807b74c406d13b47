"""From recorded inputs to the protocol that drives the model: monitors without their noise, switching where it was."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

import numpy as np

from ..protocol import Protocol
from .bench import Bench
from .data import Experiment
from .monitors import QUIET, jumps, noise_level, polyline, resolution


@dataclass(frozen=True)
class Drive:
    """`protocol` of one experiment, and what was taken away: `noise` (standard deviation, SI) by input.

    `corners` are the times (k,) [s] at which the line through each continuous input bends.
    """

    protocol: Protocol
    noise: dict[str, float]
    corners: dict[str, np.ndarray]


def drive(experiment: Experiment, bench: Bench, noise: dict[str, float] | None = None) -> Drive:
    """The protocol behind the recorded monitors; `noise` gives levels that bench.toml states."""
    levels = {s.name: (noise or {}).get(s.name, _level(experiment.inputs[s.name])) for s in bench.inputs}
    lines = []
    for signal in bench.inputs:
        values = experiment.inputs[signal.name]
        make = _held if signal.held else _continuous
        lines.append(make(experiment.time, values, levels[signal.name]))
    corners = {s.name: times for s, (times, _) in zip(bench.inputs, lines, strict=True) if not s.held}
    return Drive(joined(lines, [s.name for s in bench.inputs]), levels, corners)


def _level(values: np.ndarray) -> float:
    """The noise of a monitor, not less than its resolution makes; without any, every sample would be an event."""
    return max(noise_level(values), resolution(values) / float(np.sqrt(12.0)), QUIET * float(np.ptp(values)))


def _continuous(time: np.ndarray, values: np.ndarray, noise: float) -> tuple[np.ndarray, np.ndarray]:
    line = polyline(time, values, noise)
    return time[line.corners], line.values


def _held(time: np.ndarray, values: np.ndarray, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Pieces between jumps. A value holds from its sample to the next: what moves steadily lies half a sample late."""
    late = 0.5 * float(np.median(np.diff(time)))
    edges = [0, *jumps(values, noise), values.size]
    times, levels = [], []
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        corner_times, corner_values = _continuous(time[a:b], values[a:b], noise)
        end = time[b] if b < values.size else time[-1]
        inside = np.clip(corner_times + late, time[a], end)
        inside[0] = time[a]
        times.append(np.append(inside, end))
        levels.append(np.append(corner_values, corner_values[-1]))
    return np.concatenate(times), np.concatenate(levels)


def joined(lines: list[tuple[np.ndarray, np.ndarray]], names: list[str]) -> Protocol:
    """All inputs on one grid of breakpoints; a time is doubled where any input jumps."""
    single = reduce(np.union1d, [times for times, _ in lines])
    doubled = reduce(np.union1d, [times[1:][np.diff(times) == 0] for times, _ in lines])
    grid = np.sort(np.concatenate([single, doubled]))
    second = np.append(False, np.diff(grid) == 0)
    inputs = {}
    for name, (times, values) in zip(names, lines, strict=True):
        before = _at(times, values, grid, "left")
        after = _at(times, values, grid, "right")
        inputs[name] = np.where(second, after, before)
        inputs[name][0] = after[0]
    return Protocol(grid, inputs)


def _at(times: np.ndarray, values: np.ndarray, grid: np.ndarray, side: str) -> np.ndarray:
    """Values on the grid, taken from one side where a time is doubled."""
    if side == "left":
        right = np.clip(np.searchsorted(times, grid, side="left"), 1, times.size - 1)
    else:
        right = np.clip(np.searchsorted(times, grid, side="right"), 1, times.size - 1)
    left = right - 1
    span = times[right] - times[left]
    part = np.clip(np.divide(grid - times[left], span, out=np.ones_like(span), where=span > 0), 0, 1)
    return values[left] + part * (values[right] - values[left])
