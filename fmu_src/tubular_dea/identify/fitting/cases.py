"""What is simulated for each experiment, and which experiments share a trajectory.

Experiments that follow one another without rest carry their history: the inputs of the last one begin with those of all
others. One trajectory of it answers them all, so that a row of ten costs as much as its last one alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ...protocol import Protocol
from ..signals.quiet import LEAST_STRETCH, Clock, basis

# Set by judgement: far below any sampling interval, far above what rounding changes when clocks are set.
# Check: `pytest tests/test_cases.py`
SAME_INSTANT = 1e-9  # [s] within which two instants are one


@dataclass(frozen=True)
class Reading:
    """An output and the times (n,) at which it was read; `relative_noise` (n,) is that of each reading over the usual
    one, where it is not the same for all."""

    output: str
    times: np.ndarray
    relative_noise: np.ndarray | None = None

    def where(self, kept: np.ndarray) -> Reading:
        """Some of the readings, `kept` (n,) of bool."""
        relative = None if self.relative_noise is None else self.relative_noise[kept]
        return Reading(self.output, self.times[kept], relative)

    def evened(self, values: np.ndarray) -> np.ndarray:
        """Values (n,) or columns (n, k) of the readings, over their relative noise: that of all is the usual one."""
        if self.relative_noise is None:
            return values
        return np.asarray(values / self.relative_noise.reshape(-1, *[1] * (values.ndim - 1)))

    @cached_property
    def clock(self) -> Clock:
        """The usual step between the times, and the parts of them without a gap."""
        return Clock.of(self.times)


@dataclass(frozen=True)
class Case:
    """The simulation of one experiment: inputs, readings with their times, and `own` values of parameters (SI).

    Within the times `rings` (begin, end) [s] of its clock the plant rings freely, as no record shows: readings are what
    is slow of it there.
    """

    protocol: Protocol
    readings: tuple[Reading, ...]
    own: Mapping[str, float] = field(default_factory=dict)
    rings: tuple[tuple[float, float], ...] = ()

    @property
    def times(self) -> np.ndarray:
        """The times of all readings, one after the other, shape (N,)."""
        return np.concatenate([r.times for r in self.readings])

    @property
    def outputs(self) -> list[str]:
        """What was read."""
        return [r.output for r in self.readings]

    @cached_property
    def instants(self) -> np.ndarray:
        """Every time at which anything was read, ascending."""
        if len(self.readings) == 1:
            return self.readings[0].times
        return np.unique(self.times)

    def read(self, values: Mapping[str, np.ndarray]) -> np.ndarray:
        """What the sensors report, (N,) or (N, m), from values at `instants` by output."""
        if len(self.readings) == 1:
            found = values[self.readings[0].output]
        else:
            found = np.concatenate([values[r.output][np.searchsorted(self.instants, r.times)] for r in self.readings])
        if not self._ringing:
            return found
        found = found.copy()
        for rows, slow in self._ringing:
            found[rows] = slow @ (slow.T @ found[rows])
        return found

    @cached_property
    def _ringing(self) -> list[tuple[slice, np.ndarray]]:
        """The readings in which the plant rings freely, and what is slow there (n, p), orthonormal."""
        found = []
        for begin, end in self.rings:
            for reading, rows in zip(self.readings, self.parts, strict=True):
                first, last = np.searchsorted(reading.times, [begin, end])
                if last - first >= LEAST_STRETCH:
                    inside = slice(rows.start + int(first), rows.start + int(last))
                    found.append((inside, basis(last - first, reading.clock.step)))
        return found

    @cached_property
    def parts(self) -> list[slice]:
        """Where each reading stands in the N values."""
        ends = np.cumsum([0, *(r.times.size for r in self.readings)])
        return [slice(int(a), int(b)) for a, b in zip(ends[:-1], ends[1:], strict=True)]


@dataclass(frozen=True)
class SharedTrajectory:
    """A trajectory: that of `case`, at `times` (n,). It answers `cases`, by their numbers, each at its `places`."""

    case: Case
    times: np.ndarray
    cases: dict[int, Case]
    places: dict[int, np.ndarray | slice]

    def read(self, values: Mapping[str, np.ndarray]) -> dict[int, np.ndarray]:
        """The readings of every case, each (N,) or (N, m), from values at `times` by output."""
        return {i: c.read({n: values[n][self.places[i]] for n in c.outputs}) for i, c in self.cases.items()}


def shared_trajectories(cases: Sequence[Case]) -> list[SharedTrajectory]:
    """The trajectories that answer all cases; those with most events begin, so that no long one is left at the end."""
    left = sorted(range(len(cases)), key=lambda i: -cases[i].protocol.time.size)
    found = []
    while left:
        last = cases[left[0]]
        row = {i: cases[i] for i in left if i == left[0] or _begins_with(last, cases[i])}
        left = [i for i in left if i not in row]
        if len(row) == 1:
            found.append(SharedTrajectory(last, last.instants, row, dict.fromkeys(row, slice(None))))
            continue
        on_clock = {i: _on_clock_of(last, case) for i, case in row.items()}
        times = np.unique(np.concatenate(list(on_clock.values())))
        found.append(SharedTrajectory(last, times, row, {i: np.searchsorted(times, at) for i, at in on_clock.items()}))
    return found


def _begins_with(last: Case, case: Case) -> bool:
    """Whether the inputs of `last` begin with all those of `case`, on whatever clock, and both start alike."""
    here, there = case.protocol.time, last.protocol.time
    n = here.size
    if n >= there.size or abs((there[n - 1] - there[0]) - (here[-1] - here[0])) > SAME_INSTANT:
        return False
    same_times = np.all(np.abs((there[:n] - there[0]) - (here - here[0])) < SAME_INSTANT)
    same = all(np.array_equal(last.protocol.inputs[name][:n], v) for name, v in case.protocol.inputs.items())
    return bool(same_times) and same and case.own == last.own and case.outputs == last.outputs


def _on_clock_of(last: Case, case: Case) -> np.ndarray:
    """The instants of a case on the clock of the `last` one; those at a breakpoint are at the same one there."""
    if case is last:
        return case.instants
    here, there = case.protocol.time, last.protocol.time
    place = np.minimum(np.searchsorted(here, case.instants), here.size - 1)
    return np.where(here[place] == case.instants, there[place], case.instants + (there[0] - here[0]))
