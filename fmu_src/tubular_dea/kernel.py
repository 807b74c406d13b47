"""The emitted C, compiled for this machine and called from Python: whole trajectories in one call.

The integrator, the equations and the starting rules are the very sources that go into the FMUs.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .emit import c
from .emit.functions import layout
from .emit.variables import variables
from .errors import UserError
from .export.compile import cached_library, host, native_source
from .export.package import CORE_HEADERS, CORE_SOURCES
from .model.declare import Model, nearest
from .protocol import Protocol

DEFAULT_TOLERANCE = 1e-6


class KernelError(UserError, RuntimeError):
    """A trajectory that could not be computed; the text says at which time and why."""


@dataclass(frozen=True)
class Trajectory:
    """Values by name at `time` [s]: states and outputs, each of shape (n,), in SI units.

    `steps` and `rejected` count the integrator's internal steps.
    """

    time: np.ndarray
    values: dict[str, np.ndarray]
    steps: int
    rejected: int

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.values:
            raise KeyError(f"no value {name!r}{nearest(name, self.values)}")
        return self.values[name]


class Kernel:
    """A model, compiled. Compiling takes a few seconds once; the library is cached by its content."""

    def __init__(self, model: Model) -> None:
        self.model = model
        arrays = layout(model)
        self.states = [str(s) for s in arrays.x]
        self.inputs = [str(s) for s in arrays.u]
        self.outputs = [str(s) for s in arrays.y]
        self.defaults = model.parameter_values()
        self._library = ctypes.CDLL(str(_library(model)))
        self._need_fold = [v.name for v in variables(model) if v.needs_fold]

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
    ) -> Trajectory:
        """The response to `protocol`, sampled at ascending `times` [s] inside it.

        `with_fold` also computes the snap-through pressure and margin at every sample (about 2 us each).
        Raises `KernelError` where the integration fails or there is no rest state to start at.
        """
        times = np.ascontiguousarray(times, dtype=float)
        if times.size and (np.any(np.diff(times) < 0) or times[0] < protocol.time[0] or times[-1] > protocol.time[-1]):
            raise KernelError(
                f"sample times: expected ascending times from {protocol.time[0]:g} to {protocol.time[-1]:g} s"
            )
        x = np.empty((times.size, len(self.states)))
        y = np.empty((times.size, len(self.outputs) + 1))
        points, u = np.ascontiguousarray(protocol.time), np.ascontiguousarray(protocol.table(self.inputs))
        counts, reached = (ctypes.c_long * 2)(), ctypes.c_double()
        status = self._library.kernel_trajectory(
            _pointer(self.parameters(parameters)), ctypes.c_long(points.size), _pointer(points), _pointer(u),
            ctypes.c_double(tolerance), ctypes.c_long(times.size), _pointer(times), ctypes.c_int(with_fold),
            _pointer(x), _pointer(y), counts, ctypes.byref(reached),
        )  # fmt: skip
        if status:
            raise KernelError(_failure(status, reached.value))
        return Trajectory(times, self._named(protocol, times, x, y, with_fold), counts[0], counts[1])

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
        dx, du = np.empty(len(self.states)), np.zeros(len(self.inputs))
        x, u = np.ascontiguousarray(x, float), np.ascontiguousarray(u, float)
        self._library.kernel_derivatives(ctypes.c_double(time), _pointer(x), _pointer(u), _pointer(du),
                                         _pointer(self.parameters(parameters)), _pointer(dx))  # fmt: skip
        return dx

    def jacobian(
        self, x: np.ndarray, u: np.ndarray, parameters: Mapping[str, float] | None = None, time: float = 0.0
    ) -> np.ndarray:
        """d(derivatives)/d(states), shape (n, n)."""
        n = len(self.states)
        J, dx_dt, du = np.empty((n, n)), np.empty(n), np.zeros(len(self.inputs))
        x, u = np.ascontiguousarray(x, float), np.ascontiguousarray(u, float)
        self._library.kernel_jacobian(ctypes.c_double(time), _pointer(x), _pointer(u), _pointer(du),
                                      _pointer(self.parameters(parameters)), _pointer(J), _pointer(dx_dt))  # fmt: skip
        return J

    def curve(
        self, unknown: np.ndarray, inputs: Mapping[str, float], parameters: Mapping[str, float] | None = None
    ) -> tuple[np.ndarray, np.ndarray, tuple[float, float]]:
        """The equilibrium curve over `unknown` (lambda_2): load [Pa], its slope, and the fold (unknown, load)."""
        unknown = np.ascontiguousarray(unknown, float)
        load, slope, fold = np.empty_like(unknown), np.empty_like(unknown), np.empty(2)
        u = np.array([float(inputs.get(name, 0.0)) for name in self.inputs])
        failed = self._library.kernel_curve(_pointer(u), _pointer(self.parameters(parameters)),
                                            ctypes.c_long(unknown.size), _pointer(unknown), _pointer(load),
                                            _pointer(slope), _pointer(fold))  # fmt: skip
        if failed:
            raise KernelError(f"{self.model.name} has no equilibrium curve")
        return load, slope, (float(fold[0]), float(fold[1]))


def _library(model: Model) -> Path:
    code = {"model.c": c.source(model), "model.h": c.header(model)}
    code |= {name: native_source(name) for name in (*CORE_SOURCES, *CORE_HEADERS, "kernel.c", "kernel.h")}
    return cached_library(code, host())


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)


def _failure(status: int, time: float) -> str:
    reasons = {
        -1: "there is no rest state to start at: the pressure is beyond the fold at this voltage; lower one of them, "
        "or do not start at equilibrium",
        2: "too many internal steps were needed; use a larger tolerance",
        3: "no step size, however small, solves the equations; check inputs and parameters",
    }
    return f"the trajectory ended at {time:.6g} s: {reasons.get(status, f'status {status}')}"
