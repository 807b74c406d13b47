"""Inputs over time: linear between breakpoints, with jumps.

A time listed twice is a jump: the first row holds until then, the second from then on. Protocols come from
CSV files with units in their headers, or from short specifications: "95 mmHg", "step 0 6 kV at 1",
"ramp 0 95 mmHg from 0 to 1", "pulses 0 5 kV every 0.8 from 0.1 for 0.3".
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from .errors import UserError
from .model.units import NUMBER, UnitError, factor, quantity
from .tabular import TableError, headings, rows

STOP, INTERVAL = 5.0, 0.01  # s: end of a run, and time between its samples, that is not told otherwise

WORDS = ("at", "until", "from", "to", "every", "for")  # before the times of a specification

MOST_PULSES = 10_000

ROUNDING = 1e-14  # [1] of a value, and of a time, that a few operations may err by

LATER = "later"  # name of an input that is late, while it is made


class ProtocolError(UserError, ValueError):
    """An input specification or file that cannot be used; the text names the place and what was expected."""


@dataclass(frozen=True)
class Protocol:
    """Breakpoints `time` [s], shape (n,), and `inputs` by name, each of shape (n,), in SI units."""

    time: np.ndarray
    inputs: dict[str, np.ndarray]

    def __post_init__(self) -> None:
        if not isinstance(self.inputs, Mapping):
            raise ProtocolError(f"inputs: expected values by name, as in a dict, but was given {self.inputs!r}")
        # Whoever makes one by hand may have lists, or whole numbers, into which no parts of a second would fit.
        object.__setattr__(self, "time", _doubles("time", self.time))
        object.__setattr__(self, "inputs", {name: _doubles(name, values) for name, values in self.inputs.items()})

    @staticmethod
    def of(time: Sequence[float] | np.ndarray, **inputs: Sequence[float] | np.ndarray) -> Protocol:
        """A protocol, checked.

        Parameters
        ----------
        time : array of shape (n,)
            Times [s] that do not decrease; a repeated time is a jump.
        **inputs : array of shape (n,)
            Values of each input at these times, in SI units.

        Returns
        -------
        Protocol
            The inputs over time, linear between the times.

        Raises
        ------
        UserError
            Unless the times are finite and do not decrease, and every input has as many finite values.

        Examples
        --------
        >>> import tubular_dea as td
        >>> step = td.Protocol.of([0, 1, 1, 3], pressure=[12666] * 4, voltage=[0, 0, 5000, 5000])
        >>> step.at([0.5, 2.0])["voltage"].tolist()
        [0.0, 5000.0]
        """
        made = Protocol(
            _doubles("time", time).copy(), {name: _doubles(name, values).copy() for name, values in inputs.items()}
        )
        grid = made.time
        if (
            grid.ndim != 1
            or grid.size < 2
            or not np.all(np.isfinite(grid))
            or np.any(np.diff(grid) < 0)
            or grid[-1] <= grid[0]
        ):
            raise ProtocolError(
                "time: expected at least two finite times that do not descend, the last above the first"
            )
        for name, values in made.inputs.items():
            if values.shape != grid.shape:
                raise ProtocolError(f"{name}: expected {grid.size} values but was given {values.size}")
            if not np.all(np.isfinite(values)):
                raise ProtocolError(f"{name}: expected finite values but was given {values[~np.isfinite(values)][0]}")
        return made

    @property
    def jumps(self) -> np.ndarray:
        """The times at which some input jumps."""
        return np.unique(self.time[1:][np.diff(self.time) == 0])

    def table(self, names: Sequence[str]) -> np.ndarray:
        """The inputs `names` as an array of shape (n, len(names)); `ProtocolError` for one that is missing."""
        missing = [name for name in names if name not in self.inputs]
        if missing:
            raise ProtocolError(f"the protocol lacks {', '.join(missing)}; it has {', '.join(self.inputs)}")
        columns = np.array([self.inputs[name] for name in names], dtype=float)
        return columns.reshape(len(names), self.time.size).T

    def at(self, times: Sequence[float] | np.ndarray, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
        """The inputs `names` (default: all) at `times`; at a jump, the value after it."""
        chosen, wanted = self.inputs if names is None else names, np.asarray(times, float)
        places = self._places(wanted, np.searchsorted(self.time, wanted, side="right"))
        return {name: places.of(self.inputs[name]) for name in chosen}

    def holding(self, held: Sequence[str], means: Sequence[str] = ()) -> Protocol:
        """The protocol in which the inputs `held` keep each value until the next time, and `means` have each one since
        the time before.

        Where a time is listed twice, whoever wrote it knew what came before the jump: there all inputs stay straight.
        """
        first = np.flatnonzero(np.append(True, np.diff(self.time) > 0))
        last, paired = np.append(first[1:] - 1, self.time.size - 1), np.append(np.diff(first) > 1, False)
        paired[-1] = last[-1] > first[-1]
        begins, ends = ({name: values[rows] for name, values in self.inputs.items()} for rows in (last[:-1], first[1:]))
        for name in held:
            ends[name] = np.where(paired[1:], ends[name], begins[name])
        for name in means:
            begins[name] = np.where(paired[:-1], begins[name], ends[name])
        table = {n: np.append(np.column_stack([begins[n], ends[n]]).ravel(), v[-1]) for n, v in self.inputs.items()}
        time = np.append(np.repeat(self.time[first], 2)[1:-1], self.time[-1])
        jumps = np.any([np.append(True, np.diff(values) != 0) for values in table.values()], axis=0)
        known = np.isin(time, self.time[first[paired]])
        kept = np.append(True, np.diff(time) > 0) | jumps | known
        return Protocol(time[kept], {name: values[kept] for name, values in table.items()})

    def delayed(self, signals: Mapping[str, tuple[str, float]]) -> Protocol:
        """The protocol with more inputs: for each name, another input (name, delay [s]), exactly, as it was then.

        Before the start an input is taken to have been as it is there. Breakpoints of what is delayed are added;
        those nearer than 1 ns to one that is there fall on it.
        """
        marks = known = np.unique(self.time)
        delays = dict.fromkeys(by for _, by in signals.values())
        for by in delays:
            marks = _merged(marks, known + by)
        places = {by: self._sides(known, marks - by) for by in {0.0: None, **delays}}
        inputs = {name: places[0.0].of(values) for name, values in self.inputs.items()}
        inputs |= {name: places[by].of(self.inputs[of]) for name, (of, by) in signals.items()}
        return Protocol(_both_sides(marks), inputs)

    def with_delay(self, name: str, by: float) -> Protocol:
        """The protocol with one of its inputs later by some time [s]; earlier where that is negative."""
        moved = self.delayed({LATER: (name, by)})
        return Protocol(moved.time, {n: moved.inputs[LATER if n == name else n] for n in self.inputs}).simplified()

    def simplified(self) -> Protocol:
        """The same inputs without breakpoints at which none of them bends or jumps by more than rounding: the
        integrator ends a step at every breakpoint."""
        table = np.array([*self.inputs.values()]).reshape(-1, self.time.size)
        doubled = np.append(False, (np.diff(self.time) == 0) & np.all(np.diff(table) == 0, axis=0))
        time, table = self.time[~doubled], table[:, ~doubled]
        span, change = time[2:] - time[:-2], table[:, 2:] - table[:, :-2]
        slope = np.divide(change, span, out=np.zeros_like(change), where=span > 0)
        off = np.abs(table[:, 1:-1] - table[:, :-2] - slope * (time[1:-1] - time[:-2]))
        size = np.abs(table).max(axis=1, keepdims=True) + np.abs(time).max() * np.abs(slope)
        jumps = (np.diff(time) == 0)[:-1] | (np.diff(time) == 0)[1:]
        kept = np.concatenate([[True], jumps | np.any(off > ROUNDING * size, axis=0), [True]])
        names = list(self.inputs)
        return Protocol(time[kept], {name: table[row, kept] for row, name in enumerate(names)})

    def with_time(self, time: float) -> Protocol:
        """The protocol with a breakpoint at a time [s] inside it."""
        if np.any(np.abs(self.time - time) <= 1e-9):
            return self
        place = int(np.searchsorted(self.time, time))
        there = self.at([time])
        return Protocol(
            np.insert(self.time, place, time),
            {name: np.insert(values, place, there[name][0]) for name, values in self.inputs.items()},
        )

    def _sides(self, known: np.ndarray, marks: np.ndarray) -> _Places:
        """Where marks are of a grid that holds every inner one twice, after the first time and before the second: those
        nearer than 1 ns to a breakpoint, of which the different ones are `known`, are on it."""
        near = np.clip(np.searchsorted(known, marks), 1, known.size - 1)
        before, after = known[near - 1], known[near]
        closest = np.where(marks - before < after - marks, before, after)
        snapped = np.where(np.abs(marks - closest) < 1e-9, closest, marks)
        right = np.empty(2 * marks.size - 2, dtype=int)
        right[0::2] = np.searchsorted(self.time, snapped[:-1], side="right")
        right[1::2] = np.searchsorted(self.time, snapped[1:], side="left")
        return self._places(_both_sides(snapped), right)

    def _places(self, times: np.ndarray, right: np.ndarray) -> _Places:
        """Where times are, of which the breakpoints `right` of them are known."""
        right = np.clip(right, 1, self.time.size - 1)
        span = self.time[right] - self.time[right - 1]
        part = np.clip(np.divide(times - self.time[right - 1], span, out=np.ones_like(span), where=span > 0), 0, 1)
        return _Places(right - 1, part)


def _doubles(name: str, given: Sequence[float] | np.ndarray) -> np.ndarray:
    """`given` as an array of doubles; `ProtocolError` for what holds no numbers."""
    try:
        return np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        raise ProtocolError(f"{name}: expected numbers but was given {given!r}") from None


@dataclass(frozen=True)
class _Places:
    """Times (n,) between breakpoints: the number `left` of the one before each, and how far they are to the next."""

    left: np.ndarray
    part: np.ndarray

    def of(self, values: np.ndarray) -> np.ndarray:
        """Values of an input there, from those at the breakpoints."""
        before = values[self.left]
        return before + self.part * (values[self.left + 1] - before)


def _both_sides(marks: np.ndarray) -> np.ndarray:
    """Marks (n,) with every inner one twice, (2n - 2,)."""
    return np.repeat(marks, 2)[1:-1]


def _merged(marks: np.ndarray, more: np.ndarray) -> np.ndarray:
    """`marks` and those of `more` that lie inside it and not within 1 ns of a mark."""
    inside = more[(more > marks[0]) & (more < marks[-1])]
    near = np.clip(np.searchsorted(marks, inside), 1, marks.size - 1)
    apart = np.minimum(np.abs(inside - marks[near - 1]), np.abs(marks[near] - inside)) > 1e-9
    return np.sort(np.concatenate([marks, inside[apart]]))


def from_specifications(specifications: Mapping[str, str], units: Mapping[str, str], stop: float) -> Protocol:
    """A protocol over 0 to `stop` [s] from one short specification per input (see the module's text).

    `units` gives the SI unit of each input. Raises `ProtocolError` that names the input and the accepted forms.
    """
    if not (math.isfinite(stop) and stop > 0):
        raise ProtocolError(f"stop time: expected a positive number of seconds but was given {stop:g}")
    pieces = {name: _pieces(name, text, units[name], stop) for name, text in specifications.items()}
    marks = sorted({0.0, stop, *(t for times, _ in pieces.values() for t in times)})
    jumps = {t for times, _ in pieces.values() for t, then in pairwise(times) if t == then}
    grid = [t for mark in marks for t in ([mark, mark] if mark in jumps else [mark])]
    inputs = {name: _on_grid(grid, times, values) for name, (times, values) in pieces.items()}
    return Protocol.of(grid, **inputs)


def _on_grid(grid: list[float], times: list[float], values: list[float]) -> np.ndarray:
    """Values of one input on a grid that holds all breakpoints; the first of a doubled time is its left side."""
    here, known = np.array(grid), np.array(values)
    after = np.diff(here, prepend=np.nan) == 0
    first, last = np.searchsorted(times, here, "left"), np.searchsorted(times, here, "right") - 1
    found = np.where(after, known[last], known[np.minimum(first, last)])
    return np.where(np.isin(here, times), found, np.interp(here, times, known))


def _pieces(name: str, text: str, unit: str, stop: float) -> tuple[list[float], list[float]]:
    words = re.sub(rf"({NUMBER})(?=[A-Za-z])", r"\1 ", text).split()
    try:
        if words and words[0] == "step":
            return _step(words, unit, stop)
        if words and words[0] == "ramp":
            return _ramp(words, unit, stop)
        if words and words[0] == "pulses":
            return _pulses(words, unit, stop)
        value = quantity(text, unit)
        return [0.0, stop], [value, value]
    except (ValueError, IndexError) as problem:
        course = words[:1] in (["step"], ["ramp"], ["pulses"]) or re.match(rf"\s*{NUMBER}", text)
        if course and isinstance(problem, UnitError | ProtocolError):
            raise ProtocolError(f"{name}: {problem}") from None
        example = {"V": "5 kV", "Pa": "95 mmHg"}.get(unit, f"1 {unit}".removesuffix(" 1"))
        raise ProtocolError(
            f'{name}: cannot read {text!r}; expected "{example}", "step 0 {example} at 1", "step 0 {example} at 1 '
            f'until 3", "ramp 0 {example} from 0 to 1" or "pulses 0 {example} every 1 from 0.2 for 0.3", the times '
            "in s or another unit; a file holds all inputs and is given as inputs (--inputs FILE)"
        ) from None


def _finite(word: str) -> float:
    value = float(word)
    if not math.isfinite(value):
        raise ValueError
    return value


def _instant(words: list[str], after: str) -> float:
    """The time [s] after a word, as in "at 1" or "at 500 ms"."""
    place = words.index(after) + 1
    return quantity(" ".join([words[place], *(u for u in words[place + 1 : place + 2] if u not in WORDS)]), "s")


def _step(words: list[str], unit: str, stop: float) -> tuple[list[float], list[float]]:
    low, high = _finite(words[1]), _finite(words[2])
    at = words.index("at")
    scale = factor(words[3], unit) if at == 4 else 1.0
    on = _instant(words, "at")
    off = _instant(words, "until") if "until" in words else stop
    _check_times(on, off, stop)
    times, values = [0.0, on, on, off], [low, low, high, high]
    if off < stop:
        times, values = [*times, off, stop], [*values, low, low]
    return times, [v * scale for v in values]


def _check_times(begin: float, end: float, stop: float) -> None:
    """`ProtocolError` unless both times [s] rise within the run."""
    if begin >= stop or end > stop:
        late = begin if begin >= stop else end
        raise ProtocolError(
            f"{late:g} s is not before the end of the run ({stop:g} s); choose it earlier, or a later end"
        )
    if begin < 0:  # the end may be that of the run, which was not given here
        raise ProtocolError(f"expected times from 0 s on but was given {begin:g} s")
    if begin >= end:
        raise ProtocolError(f"expected times that rise but was given {begin:g} and {end:g} s")


def _ramp(words: list[str], unit: str, stop: float) -> tuple[list[float], list[float]]:
    low, high = _finite(words[1]), _finite(words[2])
    begin = words.index("from")
    scale = factor(words[3], unit) if begin == 4 else 1.0
    start, end = _instant(words, "from"), _instant(words, "to")
    _check_times(start, end, stop)
    times = [0.0, *([start] if start > 0 else []), end, *([stop] if end < stop else [])]
    values = [low, *([low] if start > 0 else []), high, *([high] if end < stop else [])]
    return times, [v * scale for v in values]


def _pulses(words: list[str], unit: str, stop: float) -> tuple[list[float], list[float]]:
    low, high = _finite(words[1]), _finite(words[2])
    scale = factor(words[3], unit) if words.index("every") == 4 else 1.0
    every, begin, length = (_instant(words, word) for word in ("every", "from", "for"))
    _check_times(begin, stop, stop)
    if not 0 < length < every:
        raise ProtocolError(f"expected pulses of less than the {every:g} s between them but was given {length:g} s")
    if (stop - begin) / every > MOST_PULSES:
        raise ProtocolError(f"expected at most {MOST_PULSES} pulses but was given {(stop - begin) / every:.6g}")
    starts = begin + every * np.arange(math.ceil((stop - begin) / every))
    on = starts[stop - starts > 1e-9]
    off = np.minimum(on + length, stop)
    times = [0.0, *np.column_stack([on, on, off, off]).ravel().tolist(), stop]
    values = [low, *[low, high, high, low] * on.size, low]
    end = -2 if off[-1] == stop else None  # a pulse that lasts to the end has none of its own
    return times[:end], [v * scale for v in values[:end]]


def read_csv(path: Path, units: Mapping[str, str]) -> Protocol:
    """A protocol from a CSV file whose header names quantity and unit: `time [s],pressure [mmHg],voltage [kV]`.

    `units` gives the SI unit of each input that must be there; other columns are left alone. Raises
    `ProtocolError` that names the file, the line and the column.
    """
    try:
        table = rows(path)
        if len(table) < 3:
            raise ProtocolError(
                f"{path}: expected a header and at least two lines of numbers below it but found "
                f"{max(0, len(table) - 1)}"
            )
        columns = _columns(path, table[0][1], {"time": "s", **units})
    except TableError as problem:
        raise ProtocolError(str(problem)) from None
    data = {name: _column(path, table[1:], place, name, scale) for name, (place, scale) in columns.items()}
    time = data.pop("time")
    for (line, _), before, after in zip(table[2:], time, time[1:], strict=False):
        if after < before:
            raise ProtocolError(f"{path}, line {line}: time goes back from {before:g} to {after:g} s; sort the lines")
    return Protocol.of(time, **data)


def _columns(path: Path, header: list[str], units: Mapping[str, str]) -> dict[str, tuple[int, float]]:
    """Place and factor to SI of each wanted column."""
    found: dict[str, tuple[int, float]] = {}
    for name, cell in headings(path, header, units).items():
        try:
            found[name] = (cell.place, factor(cell.unit, units[name]))
        except UnitError as problem:
            raise ProtocolError(f"{path}, line 1: column {name!r}: {problem}") from None
    missing = [f"'{name} [{unit}]'" for name, unit in units.items() if name not in found]
    if missing:
        raise ProtocolError(f"{path}, line 1: expected a column {', '.join(missing)} but found {', '.join(header)}")
    return found


def _column(path: Path, table: list[tuple[int, list[str]]], place: int, name: str, scale: float) -> list[float]:
    values = []
    for line, row in table:
        cell = row[place] if place < len(row) else ""
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ProtocolError(f"{path}, line {line}, column {name!r}: expected a finite number but found {cell!r}")
        values.append(value * scale)
    return values
