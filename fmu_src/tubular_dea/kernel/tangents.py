"""Trajectories with their sensitivities: the derivative of the discrete solution to parameters, by its own steps.

A mesh (where the integrator's steps end) is chosen once and can be kept while parameters change: then values are a
smooth function of the parameters, and the sensitivities are its exact derivatives (to about eight digits). Nothing is
global and the library releases Python's lock, so trajectories can run in threads.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..emit import sensitivities
from ..emit.functions import layout
from ..emit.variables import variables
from ..errors import UserError
from ..model.declare import Model, nearest
from .checks import known
from .library import pointer


class SensitivityError(UserError, ValueError):
    """Sensitivities that cannot be taken; the text says to what they can be."""


@dataclass(frozen=True)
class Sensitivities:
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
    """What the compiled `library` of `model` has of sensitivities, those of the outputs `observed`."""

    def __init__(self, model: Model, library: ctypes.CDLL, observed: tuple[str, ...]) -> None:
        self.observed = observed
        self.columns = [str(symbol) for symbol in sensitivities.columns(model)]
        by_delay = {d.quantity.name: d.by for d in model.delays}
        self.places = {name: i for i, name in enumerate(self.columns) if name not in by_delay}
        self.places |= {by_delay[name]: i for i, name in enumerate(self.columns) if name in by_delay}
        self._sizes = {p.quantity.name: max(abs(p.quantity.value or 0.0), p.quantity.nominal) for p in model.parameters}
        self._n_states, self._n_outputs = len(model.states), len(layout(model).y)
        self.library = library

    def check(self, names: Sequence[str]) -> None:
        """`SensitivityError` for a name that is neither a tunable parameter nor one that sets a start value."""
        for name in names:
            if name not in self.places:
                raise SensitivityError(
                    f"no sensitivity to {name!r}: expected a parameter that is tunable or sets a start value"
                    f"{nearest(name, self.places)}"
                )

    def run(
        self,
        parameters: np.ndarray,
        points: np.ndarray,
        u: np.ndarray,
        mesh: np.ndarray,
        names: Sequence[str],
        times: np.ndarray,
        of_states: bool = True,
    ) -> Sensitivities:
        """The trajectory over `mesh` at `times`, with its derivatives to the parameters `names`: of the outputs, and
        `of_states` if asked for (else `x_tangent` has no rows)."""
        self.check(names)
        times = np.ascontiguousarray(times, dtype=float)
        n, m = times.size, len(names)
        columns = np.array([self.places[name] for name in names], dtype=np.intc)
        sizes = np.array([self._sizes[name] for name in names], dtype=float)  # a declaration may give integers
        x, y, reached = np.empty((n, self._n_states)), np.empty((n, self._n_outputs + 1)), ctypes.c_double()
        x_tangent = np.empty((n if of_states else 0, m, self._n_states))
        observed, rate = np.empty((n, m, len(self.observed))), np.empty((n, len(self.observed)))
        status = self.library.kernel_tangents(
            pointer(parameters),
            ctypes.c_long(points.size),
            pointer(points),
            pointer(u),
            ctypes.c_long(mesh.size),
            pointer(mesh),
            ctypes.c_long(m),
            pointer(columns),
            pointer(sizes),
            ctypes.c_long(n),
            pointer(times),
            pointer(x),
            pointer(y),
            pointer(x_tangent) if of_states else None,
            pointer(observed),
            pointer(rate),
            ctypes.byref(reached),
        )
        return Sensitivities(x, y, x_tangent, observed, rate, status, reached.value)


def observed(model: Model, wanted: Sequence[str] = ()) -> tuple[str, ...]:
    """Those of `wanted` that are definitions; without any, what a sensor reports where the model says so, else all."""
    defined = {d.quantity.name for d in model.definitions}
    known(model, "observed", wanted, model.quantities())
    if wanted:
        return tuple(name for name in wanted if name in defined)
    reported = tuple(name for name in model.sensors if name in model.outputs)
    if reported:
        return reported
    with_fold = {v.name for v in variables(model) if v.needs_fold}
    return tuple(name for name in model.outputs if name in defined and name not in with_fold)
