"""What a model answers to every experiment, and how that moves with its parameters; one thread an experiment."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ..kernel import Kernel, KernelError
from ..protocol import Protocol
from .threads import side_by_side

T = TypeVar("T")

TOLERANCE = 1e-6  # of the kernel; the numerics gate compares with a halved one
FINE = 1e-7  # where differences are taken
LEAST_STEPS, STEPS_A_SAMPLE = 100_000, 20  # internal steps after which a search gives a trajectory up


@dataclass(frozen=True)
class Case:
    """What one experiment asks of the model: inputs, and the times (n,) at which the sensor was read."""

    protocol: Protocol
    times: np.ndarray


class Response:
    """A compiled model on a set of cases; `measured` names the output that the sensor reports."""

    def __init__(
        self,
        kernel: Kernel,
        cases: Sequence[Case],
        measured: str,
        values: Mapping[str, float] | None = None,
    ) -> None:
        self.kernel = kernel
        self.cases = list(cases)
        self.measured = measured
        self.fixed = dict(values or {})

    def outputs(self, values: Mapping[str, float], tolerance: float = TOLERANCE) -> list[np.ndarray]:
        """The measured output of every case, each (n,); `KernelError` where one cannot be computed."""
        parameters = self.fixed | dict(values)
        return self._all(lambda case: self._output(case, parameters, tolerance))

    def outputs_alone(self, values: Mapping[str, float], tolerance: float = TOLERANCE) -> list[np.ndarray]:
        """As `outputs`, in the calling thread: for callers that are many threads themselves."""
        parameters = self.fixed | dict(values)
        return [self._output(case, parameters, tolerance) for case in self.cases]

    def _output(self, case: Case, parameters: Mapping[str, float], tolerance: float) -> np.ndarray:
        """The measured output of a case. A search may come to tubes that burst and ring: they are given up early."""
        allowed = LEAST_STEPS + STEPS_A_SAMPLE * (case.times.size + case.protocol.time.size)
        run = self.kernel.simulate(case.protocol, case.times, parameters, tolerance, max_steps=allowed)
        return run[self.measured]

    def sensitivities(
        self, values: Mapping[str, float], names: Sequence[str]
    ) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """The outputs, each (n,), and their derivatives with respect to `names`, each (n, len(names)).

        The derivatives are exact for the discrete solution (at the integrator's own steps), so that the cost is smooth.
        """
        if not names:
            outputs = self.outputs(values)
            return outputs, [np.empty((y.size, 0)) for y in outputs]
        parameters = self.fixed | dict(values)

        def one(case: Case) -> tuple[np.ndarray, np.ndarray]:
            run = self.kernel.simulate(case.protocol, case.times, parameters, TOLERANCE, sensitivities=names)
            return run[self.measured], run.sensitivities[self.measured]

        pairs = self._all(one)
        return [a for a, _ in pairs], [b for _, b in pairs]

    def _all(self, work: Callable[[Case], T]) -> list[T]:
        """`work` of every case; those with most events begin, so that no long one is left over at the end."""
        order = sorted(range(len(self.cases)), key=lambda i: -self.cases[i].protocol.time.size)
        done = dict(zip(order, side_by_side(lambda i: work(self.cases[i]), order), strict=True))
        return [done[i] for i in range(len(self.cases))]



__all__ = ["Case", "KernelError", "Response"]
