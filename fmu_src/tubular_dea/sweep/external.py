"""Rows of a sweep by an FMU made elsewhere, through FMPy: one simulation a row, slower, the same plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import fmpy
import numpy as np

from ..kernel.batch import Breakpoints, Probe, Results
from .models import ExternalFmu
from .unpacked import unpacked

SAMPLES = 500  # communication points a trajectory
FAILED = 4


class ExternalRows:
    """Trajectories of an FMU, with the interface of `Batch`."""

    threads = False  # an FMU need not bear two callers in one process

    def __init__(self, fmu: ExternalFmu, probes: Sequence[Probe]) -> None:
        self.probes = tuple(probes)
        self._folder, self._description = unpacked(fmu)
        self._types = {v.name: v.type for v in self._description.modelVariables}

    def trajectories(
        self,
        rows: int,
        parameters: Mapping[str, float | np.ndarray],
        inputs: Mapping[str, Breakpoints],
        stop: float | np.ndarray,
        tolerance: float,
    ) -> Results:
        """As `Batch.trajectories`; extremes and crossings are those of SAMPLES + 1 samples."""
        values = np.full((rows, len(self.probes)), np.nan)
        status, reached = np.zeros(rows, np.int32), np.zeros(rows)
        stops = np.broadcast_to(np.reshape(np.asarray(stop, float), -1), (rows,))
        for row in range(rows):
            given = {n: float(np.broadcast_to(v, (rows,))[row]) for n, v in parameters.items()}
            try:
                series = self._run(given, _row(inputs, row), float(stops[row]), tolerance)
                values[row] = [_reduce(p, series, row) for p in self.probes]
            except Exception:  # an FMU may fail in any way; its row says so
                status[row] = FAILED
        return Results(values, status, reached, np.zeros(rows, int))

    def _run(
        self, given: dict[str, float], inputs: dict[str, tuple[np.ndarray, np.ndarray]], stop: float, tolerance: float
    ) -> Any:
        marks = np.unique(np.concatenate([[0.0, stop], *(t[(t > 0) & (t < stop)] for t, _ in inputs.values())]))
        grid = np.repeat(marks, 2)[1:-1] if len(marks) > 1 else marks
        table = np.zeros(grid.size, dtype=[("time", float), *((n, float) for n in inputs)])
        table["time"] = grid
        second = np.r_[False, np.diff(grid) == 0]
        for name, (times, values) in inputs.items():
            table[name] = [_value(times, values, t, after) for t, after in zip(grid, second, strict=True)]
        return fmpy.simulate_fmu(
            self._folder,
            stop_time=stop,
            output_interval=stop / SAMPLES,
            relative_tolerance=tolerance,
            model_description=self._description,
            start_values={n: self._typed(n, v) for n, v in given.items()},
            input=table if inputs else None,
            output=[p.variable for p in self.probes],
        )

    def _typed(self, name: str, value: float) -> float | int | bool:
        kind = self._types[name]
        return bool(value) if kind == "Boolean" else int(value) if "Int" in kind else value


def _row(inputs: Mapping[str, Breakpoints], row: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    def pick(a: np.ndarray) -> np.ndarray:
        return a[row if a.shape[0] > 1 else 0]

    return {name: (pick(b.time), pick(b.value)) for name, b in inputs.items()}


def _value(times: np.ndarray, values: np.ndarray, t: float, after: bool) -> float:
    """The input at `t`, before or after a jump there."""
    k = int(np.searchsorted(times, t, side="right" if after else "left"))
    if k == 0:
        return float(values[0])
    if k == times.size:
        return float(values[-1])
    return float(np.interp(t, times[k - 1 : k + 1], values[k - 1 : k + 1]))


def _reduce(probe: Probe, series: Any, row: int) -> float:
    time, value = series["time"], series[probe.variable]
    start = (
        0.0
        if probe.time is None
        else float(np.reshape(np.asarray(probe.time, float), -1)[row if np.size(probe.time) > 1 else 0])
    )
    if probe.kind == "at":
        return float(np.interp(start, time, value))
    inside = time >= start - 1e-12
    time, value = time[inside], value[inside]
    if probe.kind == "mean":
        return float(np.trapezoid(value, time) / (time[-1] - time[0]))
    if probe.kind in ("rise", "fall"):
        sign = 1.0 if probe.kind == "rise" else -1.0
        past = np.flatnonzero(sign * (value - probe.threshold) >= 0)
        return float(time[past[0]]) if past.size else float("nan")
    return float({"final": value[-1], "min": value.min(), "max": value.max()}[probe.kind])
