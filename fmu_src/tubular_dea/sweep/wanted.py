"""The results wanted of every row, as short text, and the probes that compute them.

Of trajectories ("over the last T" and "from T" narrow the window; T in s or as an expression in braces):

    final NAME      min NAME      max NAME      mean NAME      swing NAME (max - min)
    change NAME (end - start)      NAME at 2.5 s
    time NAME rises above 16 mm      time NAME falls below 16 mm      snapped      time of snap      steps
    NAME every 0.1 s (a column for each of these times)

Of rest states: the name of a variable alone.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..kernel.batch import Probe, Results
from .expression import Number, PlanError, Values, number

FORMS = (
    '"final NAME", "min NAME", "max NAME", "mean NAME over the last 1 s", "swing NAME", "change NAME", '
    '"NAME at 2.5 s", '
    '"NAME every 0.1 s", "time NAME rises above 16 mm", "time NAME falls below 16 mm", "snapped", "time of snap", '
    '"steps"'
)
MOST_SAMPLES = 1000  # of one variable in a row
Units = Callable[[str], str]  # the SI unit of a variable


@dataclass(frozen=True)
class Wanted:
    """A column of the results: its `probes` and how they are put together ("", "difference", "snapped", "steps")."""

    column: str
    unit: str
    description: str
    probes: tuple[Probe, ...]
    combine: str = ""
    time: Number | None = None
    from_end: bool = False

    @property
    def names(self) -> set[str]:
        """The names that its time uses."""
        return set(self.time.names) if self.time else set()

    def placed(self, values: Values, stop: np.ndarray) -> list[Probe]:
        """The probes with their times [s] for every row."""
        if self.time is None:
            return list(self.probes)
        time = self.time(values)
        return [replace(p, time=np.maximum(stop - time, 0.0) if self.from_end else time) for p in self.probes]

    def value(self, results: Results, place: int) -> np.ndarray:
        """The column from the probes' values, the first of which is at `place`."""
        if self.combine == "steps":
            return results.steps.astype(float)
        first = results.values[:, place]
        if self.combine == "difference":
            return first - results.values[:, place + 1]
        if self.combine == "snapped":
            return np.where(results.status == 0, np.isfinite(first).astype(float), np.nan)
        return first


def wanted(text: str, units: Units, rest: bool, column: str | None = None) -> Wanted:
    """The column that `text` asks for; `PlanError` with the accepted forms for anything else."""
    words = text.split()
    if rest:
        if len(words) != 1:
            raise PlanError(f"outputs: expected the name of a variable for rest states but was given {text!r}")
        return Wanted(column or text, units(text), text, (Probe("final", text),))
    made = _special(words) or _passing(words, units) or _at(words, units) or _window(words, units)
    if made is None:
        raise PlanError(f"outputs: cannot read {text!r}; expected {FORMS}")
    return replace(made, column=column or made.column, description=text)


def spelled_out(text: str, stop: Number) -> list[str]:
    """`text`, or "NAME every T" as one "NAME at t" for each time from 0 to `stop` [s]."""
    match = re.fullmatch(r"\s*(\S+) every (.+)", text)
    if not match:
        return [text]
    step = number(match[2], "s", f"outputs: {text}").constant
    if stop.constant is None or step is None or not 0 < step <= stop.constant <= MOST_SAMPLES * step:
        expected = f"a stop that is the same for all rows, and at most {MOST_SAMPLES} samples"
        raise PlanError(f"outputs: {text}: expected {expected}")
    count = int(stop.constant / step * (1 + 1e-12))
    return [f"{match[1]} at {min(k * step, stop.constant):.12g} s" for k in range(count + 1)]


def _special(words: list[str]) -> Wanted | None:
    snap = (Probe("rise", "beyond_fold", None, 0.0),)
    return {
        "snapped": Wanted("snapped", "1", "", snap, "snapped"),
        "time of snap": Wanted("time_of_snap", "s", "", snap),
        "steps": Wanted("steps", "1", "", (), "steps"),
    }.get(" ".join(words))


def _passing(words: list[str], units: Units) -> Wanted | None:
    match = re.fullmatch(r"time (\S+) (rises above|falls below) (.+)", " ".join(words))
    if not match:
        return None
    name, verb, text = match.groups()
    threshold = number(text, units(name), f"outputs: {' '.join(words)}")
    if threshold.constant is None:
        raise PlanError(f"outputs: {' '.join(words)}: expected a threshold that is the same for all rows")
    kind = "rise" if verb == "rises above" else "fall"
    column = f"time_{name}_{verb.split()[1]}_{_slug(text)}"
    return Wanted(column, "s", "", (Probe(kind, name, None, threshold.constant),))


def _at(words: list[str], units: Units) -> Wanted | None:
    if len(words) < 3 or words[1] != "at":
        return None
    text = " ".join(words[2:])
    return Wanted(
        f"{words[0]}_at_{_slug(text)}",
        units(words[0]),
        "",
        (Probe("at", words[0]),),
        time=number(text, "s", f"outputs: {' '.join(words)}"),
    )


def _window(words: list[str], units: Units) -> Wanted | None:
    match = re.fullmatch(r"(final|min|max|mean|swing|change) (\S+)(?: (over the last|from) (.+))?", " ".join(words))
    if not match or (match[1] == "final" and match[3]):
        return None
    kind, name, window, text = match.groups()
    kinds = {"swing": ("max", "min"), "change": ("final", "at")}.get(kind, (kind,))
    probes = tuple(Probe(k, name) for k in kinds)
    time = number(text, "s", f"outputs: {' '.join(words)}") if window else None
    return Wanted(
        f"{kind}_{name}",
        units(name),
        "",
        probes,
        "difference" if len(probes) == 2 else "",
        time,
        window == "over the last",
    )


def _slug(text: str) -> str:
    return re.sub(r"[^\w.]+", "_", text.strip("{}")).strip("_")
