"""Bench recordings: a folder of CSV files, one experiment each, with quantity and unit in the header.

A recording that cannot mean what its header says is refused with file, line and column: time that goes back,
mmHg labelled Pa, kV labelled V, a sensor that stands still or has run into its stop, a radius below the tube's own.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import UserError
from ..model.units import UnitError, factor, quantity
from ..tabular import TableError, headings, rows
from . import checks
from .bench import TUBE, Bench, Signal

SHORTEST, COARSEST = 0.3, 0.5  # s that a recording lasts, and between its samples


class DataError(UserError, ValueError):
    """Recordings that cannot be used; the text names file, line and column and says what was expected."""


@dataclass(frozen=True)
class Experiment:
    """One recording in SI units: `time` (n,), `inputs` by name, each (n,), and `output` (n,), NaN where missing.

    `lines` are the numbers of the samples' lines in the file.
    """

    name: str
    time: np.ndarray
    inputs: dict[str, np.ndarray]
    output: np.ndarray
    lines: np.ndarray

    @property
    def seen(self) -> np.ndarray:
        """Where the output was recorded, shape (n,)."""
        return np.isfinite(self.output)


@dataclass(frozen=True)
class Recordings:
    """All experiments of a folder and what its bench.toml says: `geometry` by parameter name, noise by signal name."""

    bench: Bench
    experiments: list[Experiment]
    geometry: dict[str, float] = field(default_factory=dict)
    noise: dict[str, float] = field(default_factory=dict)
    source: str = ""


def read_folder(folder: Path, bench: Bench = TUBE) -> Recordings:
    """Every `*.csv` of a folder, in the order of their names, and its optional bench.toml."""
    if not folder.is_dir():
        raise DataError(
            f"{folder}: expected a folder of CSV files but there is {'a file' if folder.exists() else 'nothing'}"
        )
    files = sorted(folder.glob("*.csv"))
    if not files:
        raise DataError(f"{folder}: no experiment usable: expected CSV files headed {bench.example()!r} but found none")
    geometry, noise = _bench_file(folder / "bench.toml", bench)
    rest = geometry.get("r_o", bench.rest)
    experiments = [read_experiment(path, bench, rest) for path in files]
    return Recordings(bench, experiments, geometry, noise, folder.name)


def read_experiment(path: Path, bench: Bench = TUBE, rest: float = TUBE.rest) -> Experiment:
    """One CSV file, checked. `rest` is subtracted from a radius to make it the model's displacement [m]."""
    try:
        table = rows(path)
    except TableError as problem:
        raise DataError(str(problem)) from None
    if not table:
        raise DataError(f"{path}: expected the header {bench.example()!r} but the file is empty")
    columns = _columns(path, table[0][1], bench)
    if len(table) - 1 < bench.least_samples:
        raise DataError(
            f"{path}: too few samples: {len(table) - 1} lines below the header; expected at least {bench.least_samples}"
        )
    for line, cells in table[1:]:
        if any(cells[len(table[0][1]) :]):
            raise DataError(
                f"{path}, line {line}: {len(cells)} cells below {len(table[0][1])} headings; expected one each, with "
                "points in the numbers: decimal commas?"
            )
    lines = np.array([line for line, _ in table[1:]])
    values = {name: _values(path, table[1:], name, place, scale) for name, (place, scale) in columns.items()}
    time = values.pop("time")
    _check_time(path, lines, time)
    name = next(n for n in bench.output_names if n in values)
    zero = rest if name in bench.absolute_names else 0.0
    inputs = {s.name: _filled(path, time, values[s.name], s) for s in bench.inputs}
    for finding in checks.findings(inputs, values[name], bench, lines, name, zero):
        raise DataError(f"{path}, {finding}")
    return Experiment(path.stem, time, inputs, values[name] - zero, lines)


def _columns(path: Path, header: list[str], bench: Bench) -> dict[str, tuple[int, float]]:
    """Place and factor to SI of time, inputs and the output, whichever of its names is there."""
    units = (
        {"time": "s"} | {s.name: s.unit for s in bench.inputs} | dict.fromkeys(bench.output_names, bench.output.unit)
    )
    try:
        cells = headings(path, header, units)
    except TableError as problem:
        raise DataError(str(problem)) from None
    for name in ["time", *(s.name for s in bench.inputs)]:
        if name not in cells:
            raise DataError(f"{path}, line 1: column '{name} [{units[name]}]' is missing; found {', '.join(header)}")
    outputs = [name for name in bench.output_names if name in cells]
    if len(outputs) != 1:
        wanted = " or ".join(f"'{name} [{bench.output.unit}]'" for name in bench.output_names)
        raise DataError(f"{path}, line 1: expected one column {wanted} but found {', '.join(header)}")
    found = {}
    for name in ["time", *(s.name for s in bench.inputs), *outputs]:
        try:
            found[name] = (cells[name].place, factor(cells[name].unit, units[name]))
        except UnitError as problem:
            raise DataError(f"{path}, line 1, column {name!r}: {problem}") from None
    return found


def _values(path: Path, table: list[tuple[int, list[str]]], name: str, place: int, scale: float) -> np.ndarray:
    """A column in SI units; NaN for an empty cell or one that says nan."""
    values = np.empty(len(table))
    for i, (line, row) in enumerate(table):
        cell = row[place] if place < len(row) else ""
        try:
            values[i] = float(cell) * scale if cell else math.nan
        except ValueError:
            raise DataError(f"{path}, line {line}, column {name!r}: expected a number but found {cell!r}") from None
        if math.isinf(values[i]):
            raise DataError(f"{path}, line {line}, column {name!r}: expected a finite number but found {cell!r}")
    return values


def _filled(path: Path, time: np.ndarray, values: np.ndarray, signal: Signal) -> np.ndarray:
    """An input with its gaps closed: the last value where the signal is held, a straight line where it is not."""
    there = np.flatnonzero(np.isfinite(values))
    if there.size < max(2, values.size // 2):
        raise DataError(f"{path}, column {signal.name!r}: expected numbers but more than half of the lines have none")
    if signal.held:
        last = np.clip(np.searchsorted(there, np.arange(values.size), side="right") - 1, 0, None)
        return values[there[last]]
    return np.interp(time, time[there], values[there])


def _check_time(path: Path, lines: np.ndarray, time: np.ndarray) -> None:
    missing = np.flatnonzero(~np.isfinite(time))
    if missing.size:
        raise DataError(f"{path}, line {lines[missing[0]]}, column 'time': expected a number but found none")
    back = np.flatnonzero(np.diff(time) <= 0)
    if back.size:
        i = int(back[0])
        raise DataError(
            f"{path}, line {lines[i + 1]}, column 'time': expected ascending times but {time[i + 1]:g} s follows "
            f"{time[i]:g} s; sort the lines and remove doubles"
        )
    span, step = float(time[-1] - time[0]), float(np.median(np.diff(time)))
    if span < SHORTEST or step > COARSEST:
        label = "s labelled ms" if span < SHORTEST else "ms labelled s"
        raise DataError(
            f"{path}, lines {lines[0]} to {lines[-1]}, column 'time': {span:g} s in steps of {step:g} s; expected at "
            f"least {SHORTEST:g} s in steps of at most {COARSEST:g} s: {label}?"
        )


def _bench_file(path: Path, bench: Bench) -> tuple[dict[str, float], dict[str, float]]:
    """Geometry (SI, by parameter name) and noise levels (SI, by signal name) from bench.toml, if it is there."""
    if not path.exists():
        return {}, {}
    try:
        text = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as problem:
        raise DataError(f"{path}: cannot be read as TOML: {problem}") from None
    unknown = sorted(set(text) - {"geometry", "noise", "sampling"})
    if unknown:
        raise DataError(f"{path}: expected the tables geometry, noise and sampling but found {unknown[0]!r}")
    for name, table in text.items():
        if not isinstance(table, dict):
            raise DataError(f"{path}: expected a table [{name}] but found {name} = {str(table)[:40]!r}")
    signals = {s.name: s.unit for s in bench.inputs} | dict.fromkeys(bench.output_names, bench.output.unit)
    units = {name: q.unit for name, q in bench.geometry.items()}
    geometry = {k: _amount(path, k, v, units) for k, v in text.get("geometry", {}).items()}
    for name, value in geometry.items():
        q = bench.geometry[name]
        if not q.allows(value):
            raise DataError(
                f"{path}: {name}: expected {q.minimum:g} to {q.maximum:g} {q.unit} but found {value:g}; a number "
                "without a unit is in SI"
            )
    noise = {k: _amount(path, k, v, signals) for k, v in text.get("noise", {}).items()}
    return geometry, noise


def _amount(path: Path, name: str, value: object, units: Mapping[str, str]) -> float:
    """A number in SI units, or a text with a unit, as in `r_o = "15 mm"`."""
    if name not in units:
        raise DataError(f"{path}: {name!r} is not known; expected some of {', '.join(units)}")
    if isinstance(value, int) and abs(value) > 1e300:  # Python would not even print it
        raise DataError(f"{path}: {name}: expected a number with a unit like {units[name]!r} but found a huge integer")
    try:
        amount = quantity(str(value), units[name])
    except UnitError as problem:
        raise DataError(f"{path}: {name}: {problem}") from None
    if amount <= 0:
        raise DataError(f"{path}: {name}: expected more than 0 but found {value!r}")
    return amount
