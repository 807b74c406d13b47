"""Many trajectories or rest states in one call of the compiled model, reduced to probed numbers.

The same equations and method as `trajectories.py`, eight rows at a time in the processor's vector units. A call
holds no lock, so threads share the work; a row has the same bits whatever other rows are computed with it.
"""

from __future__ import annotations

import ctypes
import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy

from ..emit.functions import layout
from ..emit.jacobian import needed
from ..model.declare import Model, Quantity, nearest
from ..model.delays import input_delays, output_delays
from .checks import KernelError, by_name, check_rows, declared, doubles, positive, vector, whole
from .library import batch_library

KINDS = ("final", "min", "max", "mean", "at", "rise", "fall")
SOURCES = ("state", "output", "input", "fold", "fold_place", "beyond_fold", "time")
MAX_STEPS = 1_000_000
END = Quantity("stop", "s", "end of a row", minimum=0.0)
MESSAGES = {
    0: "",
    -1: "there is no rest state: the load is beyond the fold at these inputs, or below the curve",
    2: f"more than {MAX_STEPS} internal steps were needed",
    3: "no step size, however small, solves the equations",
    4: "a state would come to its minimum, where the equations end; check inputs and parameters",
}


@dataclass(frozen=True)
class Probe:
    """A number wanted of every row: `kind` (one of KINDS) of `variable`.

    `variable` is a state, a definition, an input, "time", the model's fold, "fold_place" (where the fold is) or
    "beyond_fold" (how far the unknown of the curve is beyond it). `time` [s], a number or one for each row, is the
    instant for "at" and the start of the window otherwise; `threshold` is what "rise" and "fall" pass.
    """

    kind: str
    variable: str
    time: float | np.ndarray | None = None
    threshold: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise KernelError(f"probe: expected one of the kinds {', '.join(KINDS)} but was given {self.kind!r}")
        vector(f"{self}: threshold", [self.threshold], ["threshold"])

    def __str__(self) -> str:
        return f"probe {self.kind} {self.variable}"


@dataclass(frozen=True)
class Breakpoints:
    """An input over time: straight between (`time` [s], `value`), level outside; a time listed twice is a jump.

    Both have the shape (rows, n), or (1, n) where all rows share them. That times do not descend and that all is finite
    is not checked: a plan of thousands has rows in which it is not so, and these are its to tell.
    """

    time: np.ndarray
    value: np.ndarray


@dataclass(frozen=True)
class Results:
    """`values` of shape (rows, probes), NaN where a row failed; `status` (see MESSAGES); `reached` [s]; steps."""

    values: np.ndarray
    status: np.ndarray
    reached: np.ndarray
    steps: np.ndarray

    def message(self, row: int) -> str:
        """Why the row failed; empty if it did not."""
        return message(int(self.status[row]), float(self.reached[row]))


def message(status: int, reached: float) -> str:
    """The text for a status: empty for 0."""
    reason = MESSAGES.get(status, f"status {status}")
    return f"ended at {reached:.6g} s: {reason}" if status > 0 else reason


class _InputLayout(ctypes.Structure):
    _fields_ = (
        ("n", ctypes.c_long),
        ("time", ctypes.c_void_p),
        ("value", ctypes.c_void_p),
        ("time_stride", ctypes.c_long),
        ("value_stride", ctypes.c_long),
    )


class _ProbeLayout(ctypes.Structure):
    _fields_ = (
        ("kind", ctypes.c_int),
        ("source", ctypes.c_int),
        ("index", ctypes.c_int),
        ("time", ctypes.c_void_p),
        ("time_stride", ctypes.c_long),
        ("threshold", ctypes.c_double),
    )


class _BatchLayout(ctypes.Structure):
    _fields_ = (
        ("n", ctypes.c_long),
        ("p", ctypes.c_void_p),
        ("inputs", ctypes.c_void_p),
        ("start", ctypes.c_double),
        ("tolerance", ctypes.c_double),
        ("stop", ctypes.c_void_p),
        ("stop_stride", ctypes.c_long),
        ("max_steps", ctypes.c_long),
        ("n_probes", ctypes.c_long),
        ("probes", ctypes.c_void_p),
        ("with_fold", ctypes.c_int),
        *((name, ctypes.c_void_p) for name in ("results", "status", "reached", "steps")),
    )


class Batch:
    """A model and the probes wanted of it, compiled for this machine's vector units (a few seconds, once)."""

    def __init__(self, model: Model, probes: Sequence[Probe]) -> None:
        self.model = _instant(_lean(model, probes))
        self._delays = input_delays(model)
        self.probes = tuple(probes)
        arrays = layout(self.model)
        self.inputs = [str(s) for s in arrays.u]
        self._defaults = self.model.parameter_values()
        self._parameters = {p.quantity.name: p.quantity for p in self.model.parameters}
        self._input_quantities = {q.name: q for q in model.inputs}
        places = {"state": arrays.x, "output": arrays.y, "input": arrays.u}
        self._places = {
            str(s): (SOURCES.index(kind), i) for kind, symbols in places.items() for i, s in enumerate(symbols)
        }
        self._with_fold = _uses_fold(self.model)
        self._library = batch_library(self.model)

    def parameters(self, rows: int, values: Mapping[str, float | np.ndarray]) -> np.ndarray:
        """Parameters of shape (rows, n): defaults, and `values` by name (SI units), each a number or one a row.

        `KernelError` for the first value that the model does not take, with its row.
        """
        p = np.tile(np.array(list(self._defaults.values())), (rows, 1))
        names = list(self._defaults)
        for name, value in by_name("parameters", values).items():
            q, column = declared(self.model.name, "parameter", name, self._parameters), _column(name, value, rows)
            check_rows(q, column)
            p[:, names.index(name)] = column[:, 0]
        return p

    def trajectories(
        self,
        rows: int,
        parameters: Mapping[str, float | np.ndarray],
        inputs: Mapping[str, Breakpoints],
        stop: float | np.ndarray,
        tolerance: float = 1e-6,
        probes: Sequence[Probe] | None = None,
    ) -> Results:
        """The probes of `rows` trajectories from 0 to `stop` [s]; inputs that are not given are 0.

        `probes` are the same as those that were declared, but for their times. A row that stops at 0 is not computed.
        """
        p, inputs = self.parameters(whole("rows", rows), parameters), self._courses(rows, inputs)
        positive("tolerance", tolerance)
        held: list[np.ndarray] = []  # arrays that C points into

        def pointer(array: np.ndarray) -> int:
            held.append(array)
            return int(array.ctypes.data)

        def table(array: np.ndarray) -> tuple[int, int]:
            flat = np.ascontiguousarray(array, float)
            return pointer(flat), flat.shape[1] if flat.shape[0] > 1 else 0

        none = Breakpoints(np.zeros((1, 1)), np.zeros((1, 1)))
        given = [inputs.get(name, none) for name in self.inputs[: len(self.inputs) - len(self._delays)]]
        for delay in self._delays:
            by = np.reshape(np.asarray(parameters.get(delay.by, self._defaults[delay.by]), float), (-1, 1))
            now = inputs.get(delay.of, none)
            given.append(Breakpoints(now.time + by, now.value))
        c_inputs = (_InputLayout * max(1, len(given)))()
        for place, b in zip(c_inputs, given, strict=False):
            place.n = b.time.shape[1]
            (place.time, place.time_stride), (place.value, place.value_stride) = table(b.time), table(b.value)
        stops, stop_stride = table(_stops(stop, rows))
        results = Results(
            np.empty((rows, len(self.probes))), np.empty(rows, np.int32), np.empty(rows), np.empty(rows, ctypes.c_long)
        )
        c_probes = self._c_probes(self.probes if probes is None else self._placed(probes), rows, table)
        batch = _BatchLayout(
            rows,
            pointer(p),
            ctypes.addressof(c_inputs),
            0.0,
            tolerance,
            stops,
            stop_stride,
            MAX_STEPS,
            len(self.probes),
            ctypes.addressof(c_probes),
            int(self._with_fold),
            pointer(results.values),
            pointer(results.status),
            pointer(results.reached),
            pointer(results.steps),
        )
        self._library.batch_trajectories(ctypes.byref(batch))
        return results

    def _courses(self, rows: int, inputs: Mapping[str, Breakpoints]) -> dict[str, Breakpoints]:
        """The inputs as arrays of doubles; `KernelError` for what C could not use: it reads all rows of every array."""
        courses = {}
        for name, given in by_name("inputs", inputs).items():
            declared(self.model.name, "input", name, self._input_quantities)
            if not isinstance(given, Breakpoints):
                raise KernelError(f"{name}: expected Breakpoints but was given {given!r}")
            course = Breakpoints(doubles(f"{name}: time", given.time), doubles(f"{name}: value", given.value))
            for what, array in (("time", course.time), ("value", course.value)):
                if array.ndim != 2 or array.shape[0] not in (1, rows) or array.shape[1] != course.time.shape[1]:
                    raise KernelError(
                        f"{name}: {what}: expected the shape (1, n) or ({rows}, n) but was given {array.shape}"
                    )
            if not course.time.size:
                raise KernelError(f"{name}: time: expected at least one breakpoint but was given none")
            courses[name] = course
        return courses

    def _placed(self, probes: Sequence[Probe]) -> Sequence[Probe]:
        """`probes`; `KernelError` unless they are those that were declared, but for their times."""
        expected, given = ([(p.kind, p.variable, p.threshold) for p in listed] for listed in (self.probes, probes))
        if expected != given:
            raise KernelError(
                f"probes: expected {', '.join(map(str, self.probes))}, as declared, but was given "
                f"{', '.join(map(str, probes)) or 'none'}"
            )
        return probes

    def rest(
        self, rows: int, parameters: Mapping[str, float | np.ndarray], inputs: Mapping[str, float | np.ndarray]
    ) -> Results:
        """The probed variables of `rows` rest states on the first rising branch, under constant inputs (SI units)."""
        if self.model.curve is None:
            raise KernelError(f"{self.model.name} has no equilibrium curve, so that there are no rest states to sweep")
        p, u = self.parameters(whole("rows", rows), parameters), np.zeros((rows, len(self.inputs)))
        for name in by_name("inputs", inputs):
            declared(self.model.name, "input", name, self._input_quantities)
        settled = {**inputs, **{d.quantity.name: inputs.get(d.of, 0.0) for d in self._delays}}
        for i, name in enumerate(self.inputs):
            u[:, i] = _column(name, settled.get(name, 0.0), rows)[:, 0]
        values, status = np.empty((rows, len(self.probes))), np.empty(rows, np.int32)
        probes = self._c_probes(self.probes, rows, lambda array: (0, 0))
        self._library.batch_rest(
            ctypes.c_long(rows),
            ctypes.c_void_p(p.ctypes.data),
            ctypes.c_void_p(u.ctypes.data),
            ctypes.c_long(len(self.probes)),
            probes,
            ctypes.c_void_p(values.ctypes.data),
            ctypes.c_void_p(status.ctypes.data),
        )
        return Results(values, status, np.zeros(rows), np.zeros(rows, ctypes.c_long))

    def _c_probes(
        self, given: Sequence[Probe], rows: int, table: Callable[[np.ndarray], tuple[int, int]]
    ) -> ctypes.Array[_ProbeLayout]:
        probes = (_ProbeLayout * max(1, len(given)))()
        for place, probe in zip(probes, given, strict=False):
            place.kind = KINDS.index(probe.kind)
            place.source, place.index = self._source(probe.variable)
            place.threshold = probe.threshold
            if probe.time is not None:
                place.time, place.time_stride = table(_column(f"{probe}: time", probe.time, rows))
        return probes

    def _source(self, name: str) -> tuple[int, int]:
        if self.model.curve and name == self.model.curve.fold.name:
            return SOURCES.index("fold"), 0
        return self._places[name] if name in self._places else (SOURCES.index(name), 0)


def _column(name: str, given: float | np.ndarray, rows: int) -> np.ndarray:
    """Numbers of shape (1, 1), for all rows, or (rows, 1), one a row; `KernelError` for any other number of them."""
    values = np.reshape(doubles(name, given), (-1, 1))
    if values.shape[0] not in (1, rows):
        raise KernelError(f"{name}: expected one number or {rows}, one a row, but was given {values.shape[0]}")
    return values


def _stops(given: float | np.ndarray, rows: int) -> np.ndarray:
    """Where rows end [s], as `_column` has numbers; `KernelError` for one that is no time from 0 on."""
    stops = _column("stop", given, rows)
    check_rows(END, stops)
    return stops


def _lean(model: Model, probes: Sequence[Probe]) -> Model:
    """The model with no outputs but those that are probed: nothing is computed in vain."""
    known = {q.name for q in model.inputs} | {s.quantity.name for s in model.states} | {"time"}
    known |= {model.curve.fold.name, "fold_place", "beyond_fold"} if model.curve else set()
    definitions = {d.quantity.name for d in model.definitions}
    for probe in probes:
        if not isinstance(probe, Probe):
            raise KernelError(f"probes: expected each as Probe(kind, variable) but was given {probe!r}")
        if probe.variable not in known | definitions:
            hint = nearest(probe.variable, sorted(known | definitions))
            raise KernelError(f"{model.name} has no variable {probe.variable!r}{hint}")
    wanted = dict.fromkeys(p.variable for p in probes if p.variable in definitions)
    return dataclasses.replace(model, outputs=tuple(wanted))


def _instant(model: Model) -> Model:
    """The model with one more input for each delayed one; `KernelError` where something wanted is delayed itself."""
    delayed = {d.quantity.symbol for d in output_delays(model)}
    kept = []
    for d in model.definitions:
        if not delayed & sympy.sympify(d.expression).free_symbols:
            kept.append(d)
            continue
        delayed.add(d.quantity.symbol)
        if d.quantity.name in model.outputs:
            raise KernelError(f"{model.name}: {d.quantity.name} is delayed; want what it is read from")
    more = (d.quantity for d in input_delays(model))
    return dataclasses.replace(model, inputs=(*model.inputs, *more), definitions=tuple(kept), delays=())


def _uses_fold(model: Model) -> bool:
    if model.curve is None:
        return False
    outputs = [model[name] for name in model.outputs]
    return any(model.curve.fold.symbol in d.expression.free_symbols for d in needed(model, outputs))
