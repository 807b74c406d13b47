"""The outputs of a model in every experiment, and their sensitivities to parameters; one thread per trajectory."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np

from ...kernel import NO_LIMIT, Driven, Kernel, KernelError, Trajectory
from ..threads import free_processors, side_by_side
from .cases import Case, SharedTrajectory, shared_trajectories

T = TypeVar("T")

# Set by judgement: the numerics gate (discover/alternatives/numerics.py) compares with a halved one.
# Check: `python -m blind.score --nulls 60 --seed 1000`
TOLERANCE = 1e-6  # [1] of the kernel
FINER = 10.0  # [1] by how much less where differences are taken, or a step has no derivative

# Set by measurement: on 31 000 samples with 15 um of noise it errs by 10 nm at most (squares of all together: 0.001),
# and a discovery takes two thirds of the time. With 0.018 together a cost is so rough that a fit stalls. With 1e-4,
# which errs by 4 nm on heartbeats at 60 Hz, it takes half of that, but a drive's instants and its gain, which depend on
# each other, settled where 24 more were left. Check: `pytest tests/test_study.py -k tolerance`,
# `pytest tests/test_unusual_recordings.py -k without_pressure`,
# `pytest tests/test_known_benchmarks.py -k without_its_sign`
ROUGH = 1e-5  # [1] of the kernel, where what it changes is
NEGLIGIBLE = 0.005  # [squared standard deviations] of all samples together

# Set by measurement: fewer cost as much. Check: `pytest tests/test_sensitivities.py`
COLUMNS_TOGETHER = 4  # [1] columns of sensitivities that the kernel works on at once (COLUMNS_WIDE in tangent.c)

# Set by judgement. Check: `python -m blind.score --singles 2 --seed 1000`
LEAST_STEPS = 100_000  # [1] internal steps after which a search gives a trajectory up, at least

# Set by measurement: a tube that was released rings for up to 110 000 steps of a fine tolerance, until the method has
# damped it. Check: `pytest tests/test_study.py -k rings_out`
RINGS_OUT = 200_000  # [1] such steps that are allowed in every pause beside these
PAUSE = 10.0  # [s] between two points of the inputs, at least

# Set by measurement: models of tubes, tanks, drives and flows that others measured take 0.3 to 1.6. A lag that stands
# for a viscosity leaves a ten-thousandth of that and takes 4.6: the model rings faster than is sampled.
# Check: `python -m measured.table`, `pytest tests/test_identify.py -k rings`
STEPS_SHOWN = 2.5  # [1] steps for every sample and point of inputs beyond which a model moves faster than these show
CHEAP_STEPS = 20_000  # [1] steps that are always allowed: few samples may follow many a switch

# Set by theory: squares of it are still numbers. Check: `pytest tests/test_plant_files.py -k runs_away`
RUN_AWAY = 1e50  # [SI] that no plant reaches
STEPS_A_SAMPLE = 20  # [1] and so many more for every sample and point of its inputs


class Response:
    """A compiled model on a set of cases."""

    def __init__(
        self,
        kernel: Kernel,
        cases: Sequence[Case],
        values: Mapping[str, float] | None = None,
        tolerance: float = TOLERANCE,
    ) -> None:
        self.kernel = kernel
        self.tolerance = tolerance
        self.cases = list(cases)
        self.fixed = dict(values or {})
        self.shared = shared_trajectories(self.cases)
        self._driven: dict[int, Driven] = {}
        self._meshes: dict[int, tuple[dict[str, float], np.ndarray]] = {}

    @property
    def steps(self) -> int:
        """The steps in which the integrator computed the last outputs."""
        return sum(mesh.size for _, mesh in self._meshes.values())

    @property
    def most_steps(self) -> float:
        """The steps of a model that moves as fast as the records can show, or that costs little."""
        points = sum(s.times.size + s.case.protocol.time.size for s in self.shared)
        return max(STEPS_SHOWN * points, CHEAP_STEPS)

    def of(self, cases: Sequence[Case]) -> Response:
        """The same model on other cases."""
        return Response(self.kernel, cases, self.fixed, self.tolerance)

    def by(self, kernel: Kernel) -> Response:
        """The same cases by another model."""
        return Response(kernel, self.cases, self.fixed, self.tolerance)

    def outputs(self, values: Mapping[str, float], finer: float = 1.0, total_steps: float = np.inf) -> list[np.ndarray]:
        """What is read in every case, each (N,); `KernelError` where it cannot be computed, or a trajectory takes more
        than `total_steps`. `finer` divides the tolerance."""
        parameters = self.fixed | dict(values)
        return self._joined(self._all(lambda shared: self._outputs(shared, parameters, finer, finer == 1, total_steps)))

    def outputs_alone(self, values: Mapping[str, float], finer: float = 1.0) -> list[np.ndarray]:
        """As `outputs`, in the calling thread: for callers that are many threads themselves."""
        parameters = self.fixed | dict(values)
        return self._joined([self._outputs(shared, parameters, finer) for shared in self.shared])

    def possible(self, values: Mapping[str, float]) -> list[np.ndarray | None]:
        """As `outputs_alone`, with None for cases that cannot be computed (a start beyond a fold)."""
        try:
            return list(self.outputs_alone(values))
        except KernelError:
            return [self._possible(case, self.fixed | dict(values)) for case in self.cases]

    def _possible(self, case: Case, parameters: dict[str, float]) -> np.ndarray | None:
        try:
            return self._outputs(shared_trajectories([case])[0], parameters)[0]
        except KernelError:
            return None

    def trajectories(self, values: Mapping[str, float]) -> list[Trajectory]:
        """All states and outputs of every case at the instants at which anything was read."""
        parameters = self.fixed | dict(values)
        return side_by_side(
            lambda case: self.kernel.simulate(case.protocol, case.instants, self._of(case, parameters)), self.cases
        )

    def _outputs(
        self,
        shared: SharedTrajectory,
        parameters: dict[str, float],
        finer: float = 1.0,
        keep_mesh: bool = False,
        total_steps: float = np.inf,
    ) -> dict[int, np.ndarray]:
        """The readings of every case that shares a trajectory.

        Models that diverge or ring during a fit are given up early. Where the steps end is kept, as sensitivities at
        the same parameters are asked for next, if the point is good.
        """
        case = shared.case
        pauses = int(np.count_nonzero(np.diff(case.protocol.time) > PAUSE))
        allowed = LEAST_STEPS + RINGS_OUT * pauses + STEPS_A_SAMPLE * (shared.times.size + case.protocol.time.size)
        found = self.kernel.simulate(
            self._drive(case),
            shared.times,
            self._of(case, parameters),
            self.tolerance / finer,
            max_steps=allowed,
            total_steps=int(min(total_steps, NO_LIMIT)),
            wanted=case.outputs,
            keep_mesh=keep_mesh,
        )
        self._check_stays(found.values)
        if found.mesh is not None:
            self._meshes[id(shared)] = (parameters, found.mesh)
        return shared.read(found.values)

    def _drive(self, case: Case) -> Driven:
        """What drives one of `cases`, checked for this model."""
        if id(case) not in self._driven:
            self._driven[id(case)] = self.kernel.driven(case.protocol)
        return self._driven[id(case)]

    def _mesh(self, shared: SharedTrajectory, parameters: dict[str, float]) -> np.ndarray:
        """Where the integrator's steps end."""
        known = self._meshes.get(id(shared))
        if known is not None and known[0] == parameters:
            return known[1]
        return self.kernel.mesh(self._drive(shared.case), self._of(shared.case, parameters), self.tolerance)

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

        def one(shared: SharedTrajectory) -> tuple[dict[int, np.ndarray], dict[int, np.ndarray]]:
            of = self._of(shared.case, parameters)

            def over(mesh: np.ndarray) -> list[Trajectory]:
                return side_by_side(lambda share: self._differentiated(shared, of, share, mesh), shares)

            try:
                parts = over(self._mesh(shared, parameters))
            except KernelError:  # in a step across a turn of friction, rounding decides whether there is an answer
                parts = over(self.kernel.mesh(self._drive(shared.case), of, self.tolerance / FINER))
            columns = [shared.read(part.sensitivities) for part in parts]
            return shared.read(parts[0].values), {i: np.column_stack([c[i] for c in columns]) for i in shared.cases}

        pairs = self._all(one)
        return self._joined([a for a, _ in pairs]), self._joined([b for _, b in pairs])

    def _shares(self, names: Sequence[str]) -> list[Sequence[str]]:
        """The names, divided among the processors where there are fewer trajectories than processors.

        Not into less than the kernel works on at once.
        """
        count = max(1, free_processors() // len(self.shared))
        size = max(COLUMNS_TOGETHER, -(-len(names) // count))
        return [names[i : i + size] for i in range(0, len(names), size)]

    def _differentiated(
        self, shared: SharedTrajectory, values: Mapping[str, float], names: Sequence[str], mesh: np.ndarray
    ) -> Trajectory:
        found = self.kernel.simulate(
            self._drive(shared.case), shared.times, values, sensitivities=names, mesh=mesh, wanted=shared.case.outputs
        )
        self._check_stays(found.sensitivities)
        return found

    def _check_stays(self, found: Mapping[str, np.ndarray]) -> None:
        """`KernelError` where a plant, or its derivatives, grow beyond what can be reckoned with."""
        if any(float(np.abs(v).max(initial=0.0)) > RUN_AWAY for v in found.values()):
            raise KernelError(f"{self.kernel.model.name} runs away: it reaches more than {RUN_AWAY:g}")

    def _all(self, work: Callable[[SharedTrajectory], T]) -> list[T]:
        return side_by_side(work, self.shared)

    def _joined(self, found: Sequence[Mapping[int, np.ndarray]]) -> list[np.ndarray]:
        """What was found of every case, in their order."""
        by_number = {i: values for part in found for i, values in part.items()}
        return [by_number[i] for i in range(len(self.cases))]
