"""The inputs of a sweep over time, as short text in which any number may be an expression in braces.

    95 mmHg        {pressure}        step 0 {amplitude} at 1 s until {off}        ramp 0 120 mmHg from 0 to 4
    pulses 0 {amplitude} every {1 / heart_rate} from {delay} for 0.3 s (<= 10 000)

or a file with columns `time [s]` and the input, with a factor: { file = "beat.csv", scale = "{strength}" }.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import UserError
from ..kernel.batch import Breakpoints
from ..model.units import NUMBER
from ..protocol import MOST_PULSES, read_csv
from .expression import Number, PlanError, Values, number

FORMS = (
    '"95 mmHg", "step 0 6 kV at 1 until 3", "ramp 0 95 mmHg from 0 to 1", "pulses 0 5 kV every 0.8 from 0.1 for 0.3"'
)
CLAUSES = {"step": ("at",), "ramp": ("from", "to"), "pulses": ("every", "from", "for")}
OPTIONAL = {"step": ("until",), "ramp": (), "pulses": ()}


@dataclass(frozen=True)
class Template:
    """One input: `kind` is "level", "step", "ramp", "pulses" or "record"; numbers as that kind has them."""

    kind: str
    values: tuple[Number, ...]
    times: tuple[tuple[str, Number], ...] = ()
    record: tuple[tuple[float, float], ...] = ()

    @property
    def names(self) -> set[str]:
        """The names that its numbers use."""
        return {name for n in (*self.values, *(t for _, t in self.times)) for name in n.names}

    def breakpoints(self, values: Values, stop: np.ndarray) -> Breakpoints:
        """Its course for all rows that `values` describe, up to the latest `stop` [s]."""
        if self.kind == "level":
            return Breakpoints(np.zeros((1, 1)), self.values[0](values))
        if self.kind == "record":
            time, course = np.array(self.record).T
            return Breakpoints(time[None, :], self.values[0](values) * course[None, :])
        low, high = (value(values) for value in self.values)
        at = {word: time(values) for word, time in self.times}
        if self.kind == "ramp":
            return _breakpoints([at["from"], at["to"]], [low, high])
        if self.kind == "step":
            ends = [at["until"]] * 2 if "until" in at else []
            return _breakpoints([at["at"], at["at"], *ends], [low, high, high, low][: 2 + len(ends)])
        return _pulses(low, high, at, stop)


def template(name: str, given: object, unit: str, folder: Path) -> Template:
    """A template from a plan's text, number or table; `PlanError` naming the input for anything else."""
    place = f"[inputs] {name}"
    if isinstance(given, dict):
        return _record(place, name, given, unit, folder)
    if isinstance(given, int | float) and not isinstance(given, bool):
        return Template("level", (number(given, unit, place),))
    if not isinstance(given, str):
        raise PlanError(f"{place}: expected one of {FORMS} but was given {given!r}")
    apart = re.sub(rf"(?<![\w.{{])({NUMBER})(?![eE][-+]?\d)(?=[A-Za-z])", r"\1 ", given)  # 6kV, but not 1e-3
    words = re.findall(r"\{[^}]*\}|[^\s{]+", apart)
    if words and words[0] in CLAUSES:
        return _clauses(place, words, unit)
    return Template("level", (number(given, unit, place),))


def _clauses(place: str, words: list[str], unit: str) -> Template:
    """Two values with an optional unit, then the words of that kind with a time each."""
    kind, rest = words[0], words[1:]
    keywords = {*CLAUSES[kind], *OPTIONAL[kind]}
    head = next((i for i, word in enumerate(rest) if word in keywords), len(rest))
    parts: dict[str, str] = {}
    word = ""
    for token in rest[head:]:
        if token in keywords and token not in parts:
            word, parts[token] = token, ""
        else:
            parts[word] = f"{parts[word]} {token}".strip()
    if head not in (2, 3) or not all(parts.get(word) for word in CLAUSES[kind]):
        raise PlanError(f"{place}: cannot read {' '.join(words)!r}; expected one of {FORMS} (times in s)")
    suffix = f" {rest[2]}" if head == 3 else ""
    values = tuple(number(v if v.startswith("{") else v + suffix, unit, place) for v in rest[:2])
    return Template(kind, values, tuple((word, number(text, "s", place)) for word, text in parts.items()))


def _record(place: str, name: str, given: dict[str, object], unit: str, folder: Path) -> Template:
    unknown = sorted(set(given) - {"file", "scale"})
    if unknown or "file" not in given:
        raise PlanError(f"{place}: expected file and scale but was given {', '.join(sorted(given))}")
    scale = given.get("scale", 1.0)
    if not isinstance(scale, str | int | float):
        raise PlanError(f"{place}: scale: expected a number or an expression in braces but was given {scale!r}")
    try:
        protocol = read_csv(folder / str(given["file"]), {name: unit})
    except UserError as problem:
        raise PlanError(f"{place}: {problem}") from None
    points = zip(protocol.time.tolist(), protocol.inputs[name].tolist(), strict=True)
    return Template("record", (number(scale, "1", place),), (), tuple(points))


def _breakpoints(times: list[np.ndarray], values: list[np.ndarray]) -> Breakpoints:
    return Breakpoints(np.hstack(np.broadcast_arrays(*times)), np.hstack(np.broadcast_arrays(*values)))


def _pulses(low: np.ndarray, high: np.ndarray, at: dict[str, np.ndarray], stop: np.ndarray) -> Breakpoints:
    every, begin, length = at["every"], at["from"], at["for"]
    with np.errstate(divide="ignore", invalid="ignore"):
        counts = (np.max(stop) - begin) / every
    sane = (every > 0) & (counts <= MOST_PULSES)
    every = np.where(sane, every, np.nan)  # such a row says that its input is not finite
    first = begin + every * np.arange(max(1, int(np.ceil(np.max(counts, where=sane, initial=1.0)))))
    time = np.stack(np.broadcast_arrays(first, first, first + length, first + length), axis=-1)
    value = np.stack(np.broadcast_arrays(low, high, high, low), axis=-1)
    n = first.shape[1]
    return Breakpoints(time.reshape(first.shape[0], -1), np.tile(value.reshape(value.shape[0], -1), (1, n)))
