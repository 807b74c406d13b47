"""A compiled model: whole trajectories in one call, its equations at a point, its equilibrium curve."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from threading import Lock
from typing import TypeAlias

import numpy as np
import sympy

from ..emit.functions import layout
from ..errors import list_of_names
from ..model.declare import Model, nearest
from ..model.delays import input_delays, undelayed
from ..protocol import Protocol
from . import tangents
from .checks import (
    KernelError,
    ascending,
    by_name,
    check_mesh,
    check_protocol,
    check_value,
    declared,
    doubles,
    finite,
    known,
    parameter_array,
    positive,
    vector,
    whole,
)
from .failures import failure
from .library import kernel_library, pointer, trajectory_library
from .tangents import TangentLibrary

DEFAULT_TOLERANCE = 1e-6
ROOM, LEAST_ROOM = 8, 1000  # [1] steps for which there is room at first: for every point of a protocol, and at least
MOST_STEPS = 10_000_000
NO_LIMIT = 2**31 - 1  # what C's long holds everywhere

Vector: TypeAlias = Sequence[float] | np.ndarray


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

    def __iter__(self) -> Iterator[str]:
        return iter(self.values)


@dataclass(frozen=True)
class Driven:
    """A protocol that was checked for a model: breakpoints `points` (n,) [s], and `u` (n, inputs) as its library takes
    them."""

    protocol: Protocol
    points: np.ndarray
    u: np.ndarray


@dataclass(frozen=True)
class _Solved:
    """What the library found: states `x` and outputs `y` at samples, counts of steps, and `mesh` where it was kept."""

    x: np.ndarray
    y: np.ndarray
    steps: int
    rejected: int
    mesh: np.ndarray | None


class Kernel:
    """A model, compiled: its trajectories, equations, Jacobian and equilibrium curve from the C that the FMUs have.

    Compiling takes a few seconds once; the library is cached by its content.

    Parameters
    ----------
    model : Model
        A continuous model.
    observed : sequence of str, optional
        Outputs that sensitivities are taken of (default: what a sensor reports).
    differentiated : bool, optional
        Compile the sensitivities now, and not when they are first asked for, which takes half as long again if they
        are and half as long if they never are.

    Attributes
    ----------
    states, inputs, outputs : list of str
        Names in the model's order.
    defaults : dict of str to float
        The parameters' values (SI).

    Raises
    ------
    UserError
        For a sampled model, an unknown output, and where the compiler fails.

    Examples
    --------
    >>> import numpy as np
    >>> import tubular_dea as td
    >>> kernel = td.Kernel(td.tube())
    >>> kernel.states
    ['lambda_2', 'lambda_2_rate', 'sigma_vis1', 'sigma_vis2']
    >>> load, slope, (fold, pressure) = kernel.curve(np.linspace(1.0, 1.5, 6), {"voltage": 5000.0})
    >>> f"snap-through at {15 * fold:.1f} mm and {pressure / 133.322:.0f} mmHg"
    'snap-through at 24.0 mm and 135 mmHg'
    """

    def __init__(self, model: Model, observed: Sequence[str] = (), differentiated: bool = True) -> None:
        if not isinstance(model, Model):
            raise KernelError(f"model: expected a Model, as tube() or load() give it, but was given {model!r}")
        if model.discretes:
            raise KernelError(
                f"{model.name} is sampled at communication points; expected a continuous model here: run it as an FMU"
            )
        self.model = model
        self._undelayed, self._delayed = undelayed(model)
        self._observed = tangents.observed(self._undelayed, observed)
        arrays = layout(self._undelayed)
        self.states = [str(s) for s in arrays.x]
        self.inputs = [q.name for q in model.inputs]
        self._driven = [str(s) for s in arrays.u]
        self.outputs = [str(s) for s in arrays.y]
        self.defaults = model.parameter_values()
        self._parameters = {p.quantity.name: p.quantity for p in model.parameters}
        self._values = {*self.states, *self.inputs, *self.outputs, *model.outputs}
        self._values |= {model.curve.fold.name} if model.curve else set()
        self._need_fold = needs_fold(model)
        self._compiling = Lock()
        self._made: TangentLibrary | None = None
        self._library = self._tangents.library if differentiated else trajectory_library(self._undelayed)

    @property
    def _tangents(self) -> TangentLibrary:
        """The sensitivities, compiled by the first thread that asks for them."""
        with self._compiling:
            if self._made is None:
                library = kernel_library(self._undelayed, self._observed)
                self._made = TangentLibrary(self._undelayed, library, self._observed)
            return self._made

    def parameters(self, values: Mapping[str, float] | None = None) -> np.ndarray:
        """The parameter array with some values changed by name.

        Parameters
        ----------
        values : mapping of str to float, optional
            Values in SI units.

        Returns
        -------
        ndarray of shape (n,)
            All parameters in the order of `defaults`.

        Raises
        ------
        UserError
            For unknown names and for values that the model does not take.
        """
        return parameter_array(self.model.name, self._parameters, {} if values is None else values)

    def driven(self, protocol: Protocol) -> Driven:
        """A protocol for many runs, checked once.

        Parameters
        ----------
        protocol : Protocol
            Breakpoints of all inputs.

        Returns
        -------
        Driven
            What `simulate` and `mesh` take in the protocol's place.

        Raises
        ------
        UserError
            For a protocol that `simulate` would refuse.
        """
        check_protocol(self.model, protocol)
        return self._laid_out(protocol, self.inputs)

    def simulate(
        self,
        protocol: Protocol | Driven,
        times: np.ndarray,
        parameters: Mapping[str, float] | None = None,
        tolerance: float = DEFAULT_TOLERANCE,
        with_fold: bool = False,
        sensitivities: Sequence[str] = (),
        mesh: np.ndarray | None = None,
        max_steps: int = MOST_STEPS,
        total_steps: int = NO_LIMIT,
        wanted: Sequence[str] | None = None,
        keep_mesh: bool = False,
    ) -> Trajectory:
        """The response to inputs over time, and its derivatives to parameters where they are asked for.

        Parameters
        ----------
        protocol : Protocol or Driven
            Breakpoints of all inputs; for many runs of the same, what `driven` makes of it.
        times : ndarray of shape (n,)
            Ascending times inside the protocol [s].
        parameters : mapping of str to float, optional
            Values that differ from the model's, in SI units.
        tolerance : float
            Relative error, about.
        with_fold : bool
            Compute the fold of the equilibrium curve at every sample, and what needs it (about 2 us each).
        sensitivities : sequence of str
            Parameters (tunable, or in a start value) to which the states and the measured output are differentiated:
            the exact derivative of the discrete solution over its mesh.
        mesh : ndarray of shape (m,), optional
            Internal steps of an earlier trajectory to keep: values then are a smooth function of the parameters, and
            `tolerance` is ignored.
        max_steps : int
            Internal steps at most between two points of the protocol (without sensitivities).
        total_steps : int
            Internal steps at most in the whole run (without sensitivities).
        wanted : sequence of str, optional
            Values to hand over (default: all); of few of them a short run is quicker.
        keep_mesh : bool
            Hand over where the internal steps end, too.

        Returns
        -------
        Trajectory
            States, outputs and inputs by name, each of shape (n,).

        Raises
        ------
        UserError
            Where the integration fails, with time and reason, and where there is no rest state to start at.

        Examples
        --------
        >>> import numpy as np
        >>> import tubular_dea as td
        >>> ramp = td.Protocol.of([0, 1, 2], pressure=[0, 12666, 12666], voltage=[0, 0, 5000])
        >>> run = td.Kernel(td.tube()).simulate(ramp, np.linspace(0, 2, 5), sensitivities=["C_1"])
        >>> run.sensitivities["measured_displacement"].shape
        (5, 1)
        """
        values, driven = self.parameters(parameters), self._checked(protocol)
        protocol, sensitivities = driven.protocol, list_of_names("sensitivities", sensitivities)
        points, u = self._drive(driven, values)
        times = ascending("sample times", times, points[0], points[-1])
        positive("tolerance", tolerance)
        wanted = None if wanted is None else known(self.model, "wanted", wanted, self._values)
        if sensitivities or mesh is not None:
            if with_fold:
                raise KernelError("the fold has no sensitivities here; ask for it without `sensitivities` and `mesh`")
            return self._differentiated(protocol, points, u, times, values, tolerance, sensitivities, mesh, wanted)
        sampled, here, earlier = self._samples(protocol, times, values)
        needed = _up_to(points, times)
        most = whole("max_steps", max_steps), whole("total_steps", total_steps)
        found = self._solved(points[needed], u[needed], values, tolerance, most, sampled, with_fold, keep_mesh)
        named = self._named(protocol, times, found.x[here], found.y[here], with_fold, wanted)
        values_later = self._delayed_values(found.y, earlier)
        return Trajectory(times, named | values_later, found.steps, found.rejected, mesh=found.mesh)

    def _solved(
        self,
        points: np.ndarray,
        u: np.ndarray,
        values: np.ndarray,
        tolerance: float,
        most: tuple[int, int],
        sampled: np.ndarray,
        with_fold: bool,
        keep_mesh: bool,
    ) -> _Solved:
        """A call of the library: states and outputs at `sampled` times, and where the steps end. `most` are the steps
        between two points and in all."""
        x, y = np.empty((sampled.size, len(self.states))), np.empty((sampled.size, len(self.outputs) + 1))
        mesh = np.empty(ROOM * points.size + LEAST_ROOM if keep_mesh else 0)
        counts, reached = (ctypes.c_long * 2)(), ctypes.c_double()
        while True:
            status = self._library.kernel_trajectory(
                pointer(values),
                ctypes.c_long(points.size),
                pointer(points),
                pointer(u),
                ctypes.c_double(tolerance),
                ctypes.c_long(most[0]),
                ctypes.c_long(most[1]),
                ctypes.c_long(sampled.size),
                pointer(sampled),
                ctypes.c_int(with_fold),
                pointer(x),
                pointer(y),
                ctypes.c_long(mesh.size),
                pointer(mesh),
                counts,
                ctypes.byref(reached),
            )
            if status:
                raise KernelError(failure(self.model, status, reached.value))
            if not keep_mesh or counts[0] <= mesh.size:
                return _Solved(x, y, counts[0], counts[1], mesh[: counts[0]].copy() if keep_mesh else None)
            mesh = np.empty(counts[0])

    def mesh(
        self,
        protocol: Protocol | Driven,
        parameters: Mapping[str, float] | None = None,
        tolerance: float = DEFAULT_TOLERANCE,
    ) -> np.ndarray:
        """Where the integrator's steps end, to be kept while parameters change.

        Parameters
        ----------
        protocol, parameters, tolerance
            As in `simulate`.

        Returns
        -------
        ndarray of shape (m,)
            Times [s].
        """
        values = self.parameters(parameters)
        return self._mesh(*self._drive(self._checked(protocol), values), values, positive("tolerance", tolerance))

    def _mesh(self, points: np.ndarray, u: np.ndarray, values: np.ndarray, tolerance: float) -> np.ndarray:
        found = self._solved(points, u, values, tolerance, (MOST_STEPS, NO_LIMIT), np.empty(0), False, True)
        return found.mesh if found.mesh is not None else np.empty(0)

    def _differentiated(
        self,
        protocol: Protocol,
        points: np.ndarray,
        u: np.ndarray,
        times: np.ndarray,
        values: np.ndarray,
        tolerance: float,
        names: Sequence[str],
        mesh: np.ndarray | None,
        wanted: Sequence[str] | None,
    ) -> Trajectory:
        """The trajectory over a mesh, with derivatives to `names`."""
        needed = _up_to(points, times)
        if mesh is None:
            mesh = self._mesh(points[needed], u[needed], values, tolerance)
        mesh = ascending("mesh", mesh, points[0], points[-1])
        check_mesh(mesh, points[needed])
        sampled, here, earlier = self._samples(protocol, times, values)
        columns = [name for name in names if name not in self._delayed.values()]
        states = [s for s in self.states if wanted is None or s in wanted]
        found = self._tangents.run(values, points[needed], u[needed], mesh, columns, sampled, bool(states))
        if found.status:
            raise KernelError(failure(self.model, found.status, found.reached))
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

        derivatives = {state: spread(found.x_tangent[here, :, self.states.index(state)]) for state in states}
        for i, output in enumerate(self._observed):
            delay = self._delayed.get(output)
            at = earlier[delay] if delay else here
            derivatives[output] = spread(found.observed_tangent[at, :, i])
            for place in [p for p, name in enumerate(names) if name == delay]:
                moving = times - self._value(values, delay or "") > protocol.time[0]  # before, all is as at the start
                derivatives[output][:, place] = -found.observed_rate[at, i] * moving
        named = self._named(protocol, times, found.x[here], found.y[here], False, wanted)
        named |= self._delayed_values(found.y, earlier)
        return Trajectory(times, named, mesh.size, 0, tuple(names), derivatives, mesh)

    def _value(self, values: np.ndarray, name: str) -> float:
        return float(values[list(self.defaults).index(name)])

    def _checked(self, protocol: Protocol | Driven) -> Driven:
        if not isinstance(protocol, Driven):
            return self.driven(protocol)
        if protocol.u.shape[1] != len(self.inputs):
            raise KernelError(f"protocol: it was laid out for another model; expected {', '.join(self.inputs)}")
        return protocol

    def _drive(self, driven: Driven, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Breakpoints and inputs, delayed ones among them."""
        delays = input_delays(self.model)
        if delays:
            by = dict(zip(self.defaults, values, strict=True))
            later = driven.protocol.delayed({d.quantity.name: (d.of, by[d.by]) for d in delays})
            driven = self._laid_out(later, self._driven)
        return driven.points, driven.u

    def _laid_out(self, protocol: Protocol, inputs: Sequence[str]) -> Driven:
        points, u = (np.ascontiguousarray(a, dtype=float) for a in (protocol.time, protocol.table(inputs)))
        return Driven(protocol, points, u)

    def _samples(
        self, protocol: Protocol, times: np.ndarray, values: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | slice, dict[str, np.ndarray]]:
        """Times to sample at, the places of `times` among them, and for each delay of outputs those of when it was."""
        if not self._delayed:
            return times, slice(None), {}
        by = dict(zip(self.defaults, values, strict=True))
        then = {name: np.maximum(times - by[name], protocol.time[0]) for name in set(self._delayed.values())}
        sampled, places = np.unique(np.concatenate([times, *then.values()]), return_inverse=True)
        split = np.split(places, len(then) + 1)
        return sampled, split[0], dict(zip(then, split[1:], strict=True))

    def _delayed_values(self, y: np.ndarray, earlier: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Delayed outputs, as they were."""
        return {name: y[earlier[by], self.outputs.index(name)].copy() for name, by in self._delayed.items()}

    def _named(
        self,
        protocol: Protocol,
        times: np.ndarray,
        x: np.ndarray,
        y: np.ndarray,
        with_fold: bool,
        wanted: Sequence[str] | None,
    ) -> dict[str, np.ndarray]:
        """Values by name, each an array of its own; all of them, or the `wanted` ones."""

        def those(names: Sequence[str]) -> list[tuple[int, str]]:
            return [(i, name) for i, name in enumerate(names) if wanted is None or name in wanted]

        values = {name: x[:, i].copy() for i, name in those(self.states)}
        values |= {name: y[:, i].copy() for i, name in those(self.outputs)}
        driven = [name for _, name in those(self.inputs)]
        if driven:
            values |= protocol.at(times, driven)
        curve = self.model.curve
        if curve and with_fold:
            values[curve.fold.name] = y[:, -1].copy()
        elif curve:
            for name in self._need_fold:
                values.pop(name, None)
        return values

    def derivatives(
        self, x: Vector, u: Vector, parameters: Mapping[str, float] | None = None, time: float = 0.0
    ) -> np.ndarray:
        """The rates of the states at a point.

        Parameters
        ----------
        x : array of shape (n,)
            States, in the order of `states` (SI units).
        u : array of shape (k,)
            Inputs, in the order of `inputs`.
        parameters : mapping of str to float, optional
            Values that differ from the model's.
        time : float
            Time [s].

        Returns
        -------
        ndarray of shape (n,)
            d(states)/dt.

        Examples
        --------
        >>> import tubular_dea as td
        >>> at_rest = td.Kernel(td.tube()).derivatives([1.0, 0.0, 0.0, 0.0], [0.0, 0.0])
        >>> float(abs(at_rest).max())
        0.0
        """
        dx = np.empty(len(self.states))
        self._at_point(self._library.kernel_derivatives, x, u, parameters, time, dx)
        return finite("derivatives", dx)

    def jacobian(
        self, x: Vector, u: Vector, parameters: Mapping[str, float] | None = None, time: float = 0.0
    ) -> np.ndarray:
        """The derivatives of the states' rates to the states, at a point.

        Parameters
        ----------
        x, u, parameters, time
            As in `derivatives`.

        Returns
        -------
        ndarray of shape (n, n)
            d(derivatives)/d(states).
        """
        n = len(self.states)
        J, dx_dt = np.empty((n, n)), np.empty(n)
        self._at_point(self._library.kernel_jacobian, x, u, parameters, time, J, dx_dt)
        return finite("jacobian", J)

    def _at_point(
        self,
        function: Callable[..., None],
        x: Vector,
        u: Vector,
        parameters: Mapping[str, float] | None,
        time: float,
        *results: np.ndarray,
    ) -> None:
        """Call a C function of a point, which writes to `results`; the inputs stand still there."""
        x, u = vector("states", x, self.states), self._with_delayed(vector("inputs", u, self.inputs))
        arrays = (x, u, np.zeros(len(self._driven)), self.parameters(parameters), *results)
        (now,) = vector("time", [time], ["time [s]"])
        function(ctypes.c_double(now), *map(pointer, arrays))

    def curve(
        self, unknown: np.ndarray, inputs: Mapping[str, float], parameters: Mapping[str, float] | None = None
    ) -> tuple[np.ndarray, np.ndarray, tuple[float, float]]:
        """The equilibrium curve: what load holds the model at rest at each value of an unknown.

        Parameters
        ----------
        unknown : ndarray of shape (n,)
            Values of the unknown (of the tube: the stretch lambda_2).
        inputs : mapping of str to float
            The other inputs in SI units (default: 0); the load itself has no say.
        parameters : mapping of str to float, optional
            Values that differ from the model's.

        Returns
        -------
        load : ndarray of shape (n,)
            Of the tube: the pressure [Pa].
        slope : ndarray of shape (n,)
            Its derivative to the unknown.
        fold : tuple of float
            Unknown and load at the end of the first rising branch, where a tube snaps through.

        Raises
        ------
        UserError
            For a model without such a curve, and for inputs that it does not have.
        """
        if self.model.curve is None:
            raise KernelError(f"{self.model.name} has no equilibrium curve")
        unknown = doubles(self.model.curve.unknown, unknown)
        if unknown.ndim != 1 or not np.all(np.isfinite(unknown)):
            raise KernelError(f"{self.model.curve.unknown}: expected a list of finite numbers")
        quantities = {q.name: q for q in self.model.inputs}
        for name, value in by_name("inputs", inputs).items():
            check_value(declared(self.model.name, "input", name, quantities), value)
        loads, slope, fold = np.empty_like(unknown), np.empty_like(unknown), np.empty(2)
        u = self._with_delayed(np.array([float(inputs.get(name, 0.0)) for name in self.inputs]))
        self._library.kernel_curve(
            pointer(u),
            pointer(self.parameters(parameters)),
            ctypes.c_long(unknown.size),
            pointer(unknown),
            pointer(loads),
            pointer(slope),
            pointer(fold),
        )
        finite("curve", loads)
        return loads, slope, (float(fold[0]), float(fold[1]))

    def _with_delayed(self, u: np.ndarray) -> np.ndarray:
        """Inputs, and behind them what is delayed, at rest."""
        delayed = [u[self.inputs.index(d.of)] for d in input_delays(self.model)]
        return np.array([*u, *delayed], dtype=float)


def _up_to(points: np.ndarray, times: np.ndarray) -> slice:
    """The breakpoints up to the last of `times`, with a jump there, or to the next one behind; all without times."""
    if not times.size or times[-1] == points[-1]:
        return slice(points.size)
    return slice(max(int(np.searchsorted(points, times[-1])) + 1, int(np.searchsorted(points, times[-1], "right"))))


def needs_fold(model: Model) -> list[str]:
    """The outputs that need the fold."""
    if model.curve is None:
        return []
    reached = {model.curve.fold.symbol}
    for definition in model.definitions:
        if sympy.sympify(definition.expression).free_symbols & reached:
            reached.add(definition.quantity.symbol)
    return [name for name in model.outputs if model.quantity(name).symbol in reached]
