"""The emitted C, compiled for this machine and called from Python: whole trajectories in one call.

The integrator, the equations and the starting rules are the very sources that go into the FMUs.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import sympy

from .emit.functions import layout
from .errors import UserError
from .export.package import core_sources
from .export.remembered import remembered_library
from .model.declare import Model, nearest
from .model.delays import input_delays, punctual
from .protocol import Protocol
from .tangents import TangentLibrary, pointer

DEFAULT_TOLERANCE = 1e-6
MOST_STEPS = 10_000_000


class KernelError(UserError, RuntimeError):
    """A trajectory that could not be computed; the text says at which time and why."""


@dataclass(frozen=True)
class Trajectory:
    """Values by name at `time` [s]: states and outputs, each of shape (n,), in SI units.

    `steps` and `rejected` count the integrator's internal steps. Where sensitivities were asked for, `sensitivities`
    has, by name, the derivatives of the states and of the measured output to `parameters`, each of shape (n, m), and
    `mesh` the ends of the internal steps.
    """

    time: np.ndarray
    values: dict[str, np.ndarray]
    steps: int
    rejected: int
    parameters: tuple[str, ...] = ()
    sensitivities: dict[str, np.ndarray] = field(default_factory=dict)
    mesh: np.ndarray | None = None

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.values:
            raise KeyError(f"no value {name!r}{nearest(name, self.values)}")
        return self.values[name]


class Kernel:
    """A model, compiled. Compiling takes a few seconds once; the library is cached by its content."""

    def __init__(self, model: Model) -> None:
        if model.discretes:
            raise KernelError(
                f"{model.name} is sampled at communication points; expected a continuous model here: run it as an FMU"
            )
        self.model = model
        self._punctual, self._late = punctual(model)
        arrays = layout(self._punctual)
        self.states = [str(s) for s in arrays.x]
        self.inputs = [q.name for q in model.inputs]
        self._driven = [str(s) for s in arrays.u]
        self.outputs = [str(s) for s in arrays.y]
        self.defaults = model.parameter_values()
        self._library = ctypes.CDLL(str(_library(self._punctual)))
        self._need_fold = _needs_fold(model)

    def parameters(self, values: Mapping[str, float] | None = None) -> np.ndarray:
        """The parameter array with some values changed by name (SI units); `KernelError` for unknown names."""
        values = values or {}
        unknown = [name for name in values if name not in self.defaults]
        if unknown:
            raise KernelError(f"{self.model.name} has no parameter {unknown[0]!r}{nearest(unknown[0], self.defaults)}")
        return np.array([float(values.get(name, default)) for name, default in self.defaults.items()])

    def simulate(
        self,
        protocol: Protocol,
        times: np.ndarray,
        parameters: Mapping[str, float] | None = None,
        tolerance: float = DEFAULT_TOLERANCE,
        with_fold: bool = False,
        sensitivities: Sequence[str] = (),
        mesh: np.ndarray | None = None,
        max_steps: int = MOST_STEPS,
    ) -> Trajectory:
        """The response to `protocol`, sampled at ascending `times` [s] inside it.

        `with_fold` also computes the snap-through pressure and margin at every sample (about 2 us each).
        `sensitivities` names tunable parameters to which the states and the measured output are differentiated: the
        exact derivative of the discrete solution over its mesh. `mesh` keeps the internal steps of an earlier
        trajectory (and ignores `tolerance`): values then are a smooth function of the parameters.
        Raises `KernelError` where the integration fails (without sensitivities, also where it tries more than
        `max_steps` internal steps between two points of the protocol) or there is no rest state to start at.
        """
        times = np.ascontiguousarray(times, dtype=float)
        if times.size and (np.any(np.diff(times) < 0) or times[0] < protocol.time[0] or times[-1] > protocol.time[-1]):
            raise KernelError(
                f"sample times: expected ascending times from {protocol.time[0]:g} to {protocol.time[-1]:g} s"
            )
        values = self.parameters(parameters)
        if sensitivities or mesh is not None:
            if with_fold:
                raise KernelError("the fold has no sensitivities here; ask for it without `sensitivities` and `mesh`")
            return self._differentiated(protocol, times, values, tolerance, sensitivities, mesh)
        sampled, here, earlier = self._samples(protocol, times, values)
        x, y = np.empty((sampled.size, len(self.states))), np.empty((sampled.size, len(self.outputs) + 1))
        points, u = self._drive(protocol, values)
        counts, reached = (ctypes.c_long * 2)(), ctypes.c_double()
        status = self._library.kernel_trajectory(
            pointer(values), ctypes.c_long(points.size), pointer(points), pointer(u),
            ctypes.c_double(tolerance), ctypes.c_long(max_steps), ctypes.c_long(sampled.size), pointer(sampled),
            ctypes.c_int(with_fold), pointer(x), pointer(y), counts, ctypes.byref(reached),
        )  # fmt: skip
        if status:
            raise KernelError(_failure(self.model, status, reached.value))
        named = self._named(protocol, times, x[here], y[here], with_fold)
        return Trajectory(times, named | self._late_values(y, earlier), counts[0], counts[1])

    def mesh(
        self, protocol: Protocol, parameters: Mapping[str, float] | None = None, tolerance: float = DEFAULT_TOLERANCE
    ) -> np.ndarray:
        """Where the integrator's steps end [s], to be kept while parameters change."""
        values = self.parameters(parameters)
        return self._mesh(*self._drive(protocol, values), values, tolerance)

    def _mesh(self, points: np.ndarray, u: np.ndarray, values: np.ndarray, tolerance: float) -> np.ndarray:
        mesh, status, reached = self._tangents.mesh(values, points, u, tolerance)
        if status:
            raise KernelError(_failure(self.model, status, reached))
        return mesh

    @cached_property
    def _tangents(self) -> TangentLibrary:
        return TangentLibrary(self._punctual)

    def _differentiated(
        self, protocol: Protocol, times: np.ndarray, values: np.ndarray, tolerance: float, names: Sequence[str],
        mesh: np.ndarray | None,
    ) -> Trajectory:  # fmt: skip
        """The trajectory over a mesh, with derivatives to `names`."""
        points, u = self._drive(protocol, values)
        mesh = self._mesh(points, u, values, tolerance) if mesh is None else np.ascontiguousarray(mesh, dtype=float)
        sampled, here, earlier = self._samples(protocol, times, values)
        columns = [name for name in names if name not in self._late.values()]
        found = self._tangents.run(values, points, u, mesh, columns, sampled)
        if found.status:
            raise KernelError(_failure(self.model, found.status, found.reached))
        if not np.all(np.isfinite(found.observed_tangent)):
            raise KernelError("sensitivities that are no finite numbers: the parameters are far from any usual size")
        places = [i for i, name in enumerate(names) if name in columns]

        def spread(tangent: np.ndarray) -> np.ndarray:
            """With a column of zeros for what only delays an output; nothing is copied where there is no such."""
            if len(places) == len(names):
                return tangent
            full = np.zeros((times.size, len(names)))
            full[:, places] = tangent
            return full

        derivatives = {state: spread(found.x_tangent[here, :, i]) for i, state in enumerate(self.states)}
        for i, output in enumerate(self._tangents.observed):
            late = self._late.get(output)
            at = earlier[late] if late else here
            derivatives[output] = spread(found.observed_tangent[at, :, i])
            for place in [p for p, name in enumerate(names) if name == late]:
                derivatives[output][:, place] = -found.observed_rate[at, i]
        named = self._named(protocol, times, found.x[here], found.y[here], False) | self._late_values(found.y, earlier)
        return Trajectory(times, named, mesh.size, 0, tuple(names), derivatives, mesh)

    def _drive(self, protocol: Protocol, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Breakpoints and inputs, delayed ones among them."""
        delays = input_delays(self.model)
        if delays:
            by = dict(zip(self.defaults, values, strict=True))
            protocol = protocol.delayed({d.quantity.name: (d.of, by[d.by]) for d in delays})
        return np.ascontiguousarray(protocol.time), np.ascontiguousarray(protocol.table(self._driven))

    def _samples(
        self, protocol: Protocol, times: np.ndarray, values: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | slice, dict[str, np.ndarray]]:
        """Times to sample at, the places of `times` among them, and for each delay of outputs those of when it was."""
        if not self._late:
            return times, slice(None), {}
        by = dict(zip(self.defaults, values, strict=True))
        then = {name: np.maximum(times - by[name], protocol.time[0]) for name in set(self._late.values())}
        sampled, places = np.unique(np.concatenate([times, *then.values()]), return_inverse=True)
        split = np.split(places, len(then) + 1)
        return sampled, split[0], dict(zip(then, split[1:], strict=True))

    def _late_values(self, y: np.ndarray, earlier: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Outputs that are late, as they were."""
        return {name: y[earlier[by], self.outputs.index(name)].copy() for name, by in self._late.items()}

    def _named(
        self, protocol: Protocol, times: np.ndarray, x: np.ndarray, y: np.ndarray, with_fold: bool
    ) -> dict[str, np.ndarray]:
        values = {name: x[:, i].copy() for i, name in enumerate(self.states)}
        values |= {name: y[:, i].copy() for i, name in enumerate(self.outputs)}
        values |= {name: column for name, column in protocol.at(times).items() if name in self.inputs}
        curve = self.model.curve
        if curve and with_fold:
            values[curve.fold.name] = y[:, -1].copy()
        elif curve:
            for name in self._need_fold:
                values.pop(name, None)
        return values

    def derivatives(
        self, x: np.ndarray, u: np.ndarray, parameters: Mapping[str, float] | None = None, time: float = 0.0
    ) -> np.ndarray:
        """State derivatives at states `x` and inputs `u` (SI units, in the model's order)."""
        dx, du = np.empty(len(self.states)), np.zeros(len(self._driven))
        x, u = np.ascontiguousarray(x, float), self._with_delayed(u)
        self._library.kernel_derivatives(ctypes.c_double(time), pointer(x), pointer(u), pointer(du),
                                         pointer(self.parameters(parameters)), pointer(dx))  # fmt: skip
        return dx

    def jacobian(
        self, x: np.ndarray, u: np.ndarray, parameters: Mapping[str, float] | None = None, time: float = 0.0
    ) -> np.ndarray:
        """d(derivatives)/d(states), shape (n, n)."""
        n = len(self.states)
        J, dx_dt, du = np.empty((n, n)), np.empty(n), np.zeros(len(self._driven))
        x, u = np.ascontiguousarray(x, float), self._with_delayed(u)
        self._library.kernel_jacobian(ctypes.c_double(time), pointer(x), pointer(u), pointer(du),
                                      pointer(self.parameters(parameters)), pointer(J), pointer(dx_dt))  # fmt: skip
        return J

    def curve(
        self, unknown: np.ndarray, inputs: Mapping[str, float], parameters: Mapping[str, float] | None = None
    ) -> tuple[np.ndarray, np.ndarray, tuple[float, float]]:
        """The equilibrium curve over `unknown` (lambda_2): load [Pa], its slope, and the fold (unknown, load)."""
        unknown = np.ascontiguousarray(unknown, float)
        load, slope, fold = np.empty_like(unknown), np.empty_like(unknown), np.empty(2)
        u = self._with_delayed(np.array([float(inputs.get(name, 0.0)) for name in self.inputs]))
        failed = self._library.kernel_curve(pointer(u), pointer(self.parameters(parameters)),
                                            ctypes.c_long(unknown.size), pointer(unknown), pointer(load),
                                            pointer(slope), pointer(fold))  # fmt: skip
        if failed:
            raise KernelError(f"{self.model.name} has no equilibrium curve")
        return load, slope, (float(fold[0]), float(fold[1]))

    def _with_delayed(self, u: np.ndarray) -> np.ndarray:
        """Inputs, and behind them what is delayed, at rest."""
        late = [u[self.inputs.index(d.of)] for d in input_delays(self.model)]
        return np.array([*u, *late], dtype=float)


def _needs_fold(model: Model) -> list[str]:
    """The outputs that cannot be had without the fold."""
    if model.curve is None:
        return []
    reached = {model.curve.fold.symbol}
    for definition in model.definitions:
        if sympy.sympify(definition.expression).free_symbols & reached:
            reached.add(definition.quantity.symbol)
    return [name for name in model.outputs if model.quantity(name).symbol in reached]


def _library(model: Model) -> Path:
    native = ("kernel.c", "kernel.h", "pieces.c", "pieces.h")
    return remembered_library(model, "kernel", lambda: core_sources(model, *native))


def _floors(model: Model) -> str:
    """In words: a state with a minimum came to it."""
    names = [f"{model.states[place].quantity.name} would come to {floor:g}" for place, floor in model.floors().items()]
    return " or ".join(names)


def _failure(model: Model, status: int, time: float) -> str:
    reasons = {
        -1: "there is no rest state to start at: the pressure is beyond the fold at this voltage; lower one of them, "
        "or do not start at equilibrium",
        2: "too many internal steps were needed; use a larger tolerance",
        3: "no step size, however small, solves the equations; check inputs and parameters",
        4: f"{_floors(model)}, where the equations end; check start, inputs and parameters",
    }
    return f"the trajectory ended at {time:.6g} s: {reasons.get(status, f'status {status}')}"
