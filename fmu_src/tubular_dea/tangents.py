"""Trajectories with their sensitivities: the derivative of the discrete solution to parameters, by its own steps.

A mesh (where the integrator's steps end) is chosen once and can be kept while parameters change: then values are a
smooth function of the parameters, and the sensitivities are its exact derivatives (to about eight digits). Nothing is
global and the library releases Python's lock, so trajectories can run in threads.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .emit import sensitivities
from .emit.functions import layout
from .emit.variables import variables
from .errors import UserError
from .export.compile import processor_flags
from .export.package import core_sources
from .export.remembered import remembered_library
from .model.declare import Model, nearest

DEFAULT_OBSERVED = "measured_displacement"


class SensitivityError(UserError, ValueError):
    """Sensitivities that cannot be taken; the text says to what they can be."""


@dataclass(frozen=True)
class Tangent:
    """Results at n samples: `x` (n, states), `y` (n, outputs + 1), and their derivatives to m columns:
    `x_tangent` (n, m, states), `observed_tangent` (n, m, observed); `observed_rate` (n, observed) is the observed
    outputs' rate in time. `status` and `reached` as the kernel has them."""

    x: np.ndarray
    y: np.ndarray
    x_tangent: np.ndarray
    observed_tangent: np.ndarray
    observed_rate: np.ndarray
    status: int
    reached: float


class TangentLibrary:
    """The compiled model with its gradients. `observed` are the outputs whose derivatives are wanted."""

    def __init__(self, model: Model, observed: Sequence[str] = ()) -> None:
        self.observed = tuple(observed) or _measured(model)
        self.columns = [str(symbol) for symbol in sensitivities.columns(model)]
        by_delay = {d.quantity.name: d.by for d in model.delays}
        self.places = {name: i for i, name in enumerate(self.columns) if name not in by_delay}
        self.places |= {by_delay[name]: i for i, name in enumerate(self.columns) if name in by_delay}
        self._sizes = {p.quantity.name: max(abs(p.quantity.value or 0.0), p.quantity.nominal) for p in model.parameters}
        self._n_states, self._n_outputs = len(model.states), len(layout(model).y)
        self._library = ctypes.CDLL(str(_library(model, self.observed)))
        self._library.kernel_mesh.restype = ctypes.c_long

    def check(self, names: Sequence[str]) -> None:
        """`SensitivityError` for a name that is no tunable parameter."""
        for name in names:
            if name not in self.places:
                hint = nearest(name, self.places)
                raise SensitivityError(f"no sensitivity to {name!r}: expected a tunable parameter{hint}")

    def mesh(
        self, parameters: np.ndarray, points: np.ndarray, u: np.ndarray, tolerance: float
    ) -> tuple[np.ndarray, int, float]:  # fmt: skip
        """Where the integrator's steps end; the kernel's status, and the time it reached."""
        room, reached = 8 * points.size + 1000, ctypes.c_double()
        while True:
            mesh = np.empty(room)
            n = self._library.kernel_mesh(
                pointer(parameters), ctypes.c_long(points.size), pointer(points), pointer(u),
                ctypes.c_double(tolerance), ctypes.c_long(room), pointer(mesh), ctypes.byref(reached),
            )  # fmt: skip
            if n < 0:
                return np.empty(0), int(n) + 20, reached.value
            if n <= room:
                return mesh[:n].copy(), 0, reached.value
            room = n

    def run(
        self, parameters: np.ndarray, points: np.ndarray, u: np.ndarray, mesh: np.ndarray, names: Sequence[str],
        times: np.ndarray,
    ) -> Tangent:  # fmt: skip
        """The trajectory over `mesh` at `times`, with its derivatives to the parameters `names`."""
        self.check(names)
        times = np.ascontiguousarray(times, dtype=float)
        n, m = times.size, len(names)
        columns = np.array([self.places[name] for name in names], dtype=np.intc)
        sizes = np.array([self._sizes[name] for name in names])
        x, y, reached = np.empty((n, self._n_states)), np.empty((n, self._n_outputs + 1)), ctypes.c_double()
        x_tangent = np.empty((n, m, self._n_states))
        observed, rate = np.empty((n, m, len(self.observed))), np.empty((n, len(self.observed)))
        status = self._library.kernel_tangents(
            pointer(parameters), ctypes.c_long(points.size), pointer(points), pointer(u), ctypes.c_long(mesh.size),
            pointer(mesh), ctypes.c_long(m), pointer(columns), pointer(sizes), ctypes.c_long(n), pointer(times),
            pointer(x), pointer(y), pointer(x_tangent), pointer(observed),
            pointer(rate), ctypes.byref(reached),
        )  # fmt: skip
        return Tangent(x, y, x_tangent, observed, rate, status, reached.value)


def _library(model: Model, observed: tuple[str, ...]) -> Path:
    def sources() -> dict[str, str]:
        code = core_sources(model, "sensitivity.c", "kernel.h", "tangent.c", "tangent.h", "pieces.c", "pieces.h")
        code |= {"gradients.h": sensitivities.header(model, observed)}
        return code | {"gradients.c": sensitivities.source(model, observed)}

    return remembered_library(model, f"tangents of {observed}", sources, processor_flags())


def _measured(model: Model) -> tuple[str, ...]:
    """What a sensor reports where the model says so, else every output that is a definition."""
    if DEFAULT_OBSERVED in model.outputs:
        return (DEFAULT_OBSERVED,)
    defined = {d.quantity.name for d in model.definitions}
    late = {v.name for v in variables(model) if v.needs_fold}
    return tuple(name for name in model.outputs if name in defined and name not in late)


def pointer(array: np.ndarray) -> ctypes.c_void_p:
    """The address of a contiguous array, as a C function takes it; the caller keeps the array alive."""
    return array.ctypes.data_as(ctypes.c_void_p)
