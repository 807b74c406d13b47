"""The outputs of a model in every experiment, and their sensitivities to parameters; one thread per experiment."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

import numpy as np

from ..kernel import Kernel, KernelError, Trajectory
from ..protocol import Protocol
from .threads import free_processors, side_by_side

T = TypeVar("T")

# Set by judgement: the numerics gate (discover/numerics.py) compares with a halved one.
# Check: `python -m blind.score --nulls 60 --seed 1000`
TOLERANCE = 1e-6  # [1] of the kernel
FINE = 1e-7  # [1] of the kernel where differences are taken

# Set by measurement: fewer cost as much. Check: `pytest tests/test_sensitivities.py`
COLUMNS_TOGETHER = 8  # [1] columns of sensitivities that the kernel works on at once (COLUMNS_WIDE in tangent.c)

# Set by judgement. Check: `python -m blind.score --singles 2 --seed 1000`
LEAST_STEPS = 100_000  # [1] internal steps after which a search gives a trajectory up, at least
STEPS_A_SAMPLE = 20  # [1] and so many more for every sample and point of its inputs


@dataclass(frozen=True)
class Reading:
    """An output and the times (n,) at which it was read."""

    output: str
    times: np.ndarray


@dataclass(frozen=True)
class Case:
    """The simulation of one experiment: inputs, readings with their times, and `own` values of parameters (SI)."""

    protocol: Protocol
    readings: tuple[Reading, ...]
    own: Mapping[str, float] = field(default_factory=dict)

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
            return values[self.readings[0].output]
        return np.concatenate([values[r.output][np.searchsorted(self.instants, r.times)] for r in self.readings])

    def parts(self) -> list[slice]:
        """Where each reading stands in the N values."""
        ends = np.cumsum([0, *(r.times.size for r in self.readings)])
        return [slice(int(a), int(b)) for a, b in zip(ends[:-1], ends[1:], strict=True)]


class Response:
    """A compiled model on a set of cases."""

    def __init__(self, kernel: Kernel, cases: Sequence[Case], values: Mapping[str, float] | None = None) -> None:
        self.kernel = kernel
        self.cases = list(cases)
        self.fixed = dict(values or {})

    def outputs(self, values: Mapping[str, float], tolerance: float = TOLERANCE) -> list[np.ndarray]:
        """What is read in every case, each (N,); `KernelError` where it cannot be computed."""
        parameters = self.fixed | dict(values)
        return self._all(lambda case: self._output(case, parameters, tolerance))

    def outputs_alone(self, values: Mapping[str, float], tolerance: float = TOLERANCE) -> list[np.ndarray]:
        """As `outputs`, in the calling thread: for callers that are many threads themselves."""
        parameters = self.fixed | dict(values)
        return [self._output(case, parameters, tolerance) for case in self.cases]

    def possible(self, values: Mapping[str, float]) -> list[np.ndarray | None]:
        """As `outputs_alone`, with None for cases that cannot be computed (a start beyond a fold)."""
        found: list[np.ndarray | None] = []
        for case in self.cases:
            try:
                found.append(self._output(case, self.fixed | dict(values), TOLERANCE))
            except KernelError:
                found.append(None)
        return found

    def trajectories(self, values: Mapping[str, float]) -> list[Trajectory]:
        """All states and outputs of every case at the instants at which anything was read."""
        parameters = self.fixed | dict(values)
        return self._all(lambda case: self.kernel.simulate(case.protocol, case.instants, self._of(case, parameters)))

    def _output(self, case: Case, parameters: Mapping[str, float], tolerance: float) -> np.ndarray:
        """The readings of a case. Models that diverge or ring during a fit are given up early."""
        allowed = LEAST_STEPS + STEPS_A_SAMPLE * (case.instants.size + case.protocol.time.size)
        run = self.kernel.simulate(
            case.protocol, case.instants, self._of(case, parameters), tolerance, max_steps=allowed, wanted=case.outputs
        )
        return case.read(run.values)

    def _of(self, case: Case, parameters: Mapping[str, float]) -> dict[str, float]:
        """The parameters of a case: those that are searched for go before its own."""
        return {n: v for n, v in case.own.items() if n in self.kernel.defaults} | dict(parameters)

    def sensitivities(
        self, values: Mapping[str, float], names: Sequence[str]
    ) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """What is read, each (N,), and its derivatives with respect to `names`, each (N, len(names)).

        The derivatives are exact for the discrete solution (at the integrator's own steps), so that the cost is smooth.
        """
        if not names:
            outputs = self.outputs(values)
            return outputs, [np.empty((y.size, 0)) for y in outputs]
        parameters = self.fixed | dict(values)
        shares = self._shares(names)

        def one(case: Case) -> tuple[np.ndarray, np.ndarray]:
            of = self._of(case, parameters)
            mesh = self.kernel.mesh(case.protocol, of, TOLERANCE)
            runs = side_by_side(lambda share: self._differentiated(case, of, share, mesh), shares)
            return case.read(runs[0].values), np.column_stack([case.read(run.sensitivities) for run in runs])

        pairs = self._all(one)
        return [a for a, _ in pairs], [b for _, b in pairs]

    def _shares(self, names: Sequence[str]) -> list[Sequence[str]]:
        """The names, divided among the processors where there are fewer cases than processors.

        Not into less than the kernel works on at once.
        """
        count = max(1, free_processors() // len(self.cases))
        size = max(COLUMNS_TOGETHER, -(-len(names) // count))
        return [names[i : i + size] for i in range(0, len(names), size)]

    def _differentiated(
        self, case: Case, values: Mapping[str, float], names: Sequence[str], mesh: np.ndarray
    ) -> Trajectory:
        return self.kernel.simulate(
            case.protocol, case.instants, values, sensitivities=names, mesh=mesh, wanted=case.outputs
        )

    def _all(self, work: Callable[[Case], T]) -> list[T]:
        """`work` of every case; those with most events begin, so that no long one is left over at the end."""
        order = sorted(range(len(self.cases)), key=lambda i: -self.cases[i].protocol.time.size)
        done = dict(zip(order, side_by_side(lambda i: work(self.cases[i]), order), strict=True))
        return [done[i] for i in range(len(self.cases))]


__all__ = ["Case", "KernelError", "Reading", "Response"]
