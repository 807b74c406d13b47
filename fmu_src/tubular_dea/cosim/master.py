"""Running a coupled system: the C master (native/master*.c) over slaves that FMPy has loaded.

Schemes: "jacobi" (every slave uses what the others had at the start of the step), "gauss-seidel" (slaves use what those
before them have at its end), "implicit" (the step is repeated, with all slaves rolled back, until both sides
of the interface agree; a quasi-Newton method whose Jacobian is kept from step to step). `order` 1 extrapolates unknown
inputs linearly, 0 holds them. FMPy, ecos and libcosim also do explicit runs; the implicit scheme, rollback with step
control, exact event times and the check of stability are added here.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .. import tabular
from ..errors import UserError
from ..export.compile import cached_library, host, native_source
from ..export.package import MASTER_SOURCES
from ..files import write_atomically
from ..model.declare import nearest
from ..protocol import Protocol
from .slaves import Slave, initialise
from .system import Ports, System, Wiring, wire

SCHEMES = ("jacobi", "gauss-seidel", "implicit")
ROWS = 2048  # communication points between two looks at progress
MOST_STEPS = 1e7  # whose results, some sixty numbers each, take 5 GB of memory


class MasterError(UserError, RuntimeError):
    """A run that cannot begin as asked, or that ended early; the text gives time and reason."""


@dataclass(frozen=True)
class Options:
    """How to step.

    `step` [s] is the communication step (the largest one where `variable`); `tolerance` is relative to each signal's
    nominal value: of the iteration, or of the step where `variable`. `order` of the extrapolation, 0 or 1. `cubic`:
    interpolate by cubics where slaves provide the rates of their outputs, else linearly. `restart`: length of the first
    step after an event, of `step`, doubled from step to step (1: no such). `refine`: fixed steps with a larger error
    than this are divided (0: none; implicit scheme only). `slave_tolerance` goes to the slaves' own integrators.
    `iterations` at most, in a step. `smallest` [s]: shorter steps end the run; default step / 1000.
    """

    scheme: str = "implicit"
    step: float = 1e-3
    order: int = 0
    cubic: bool = True
    restart: float = 0.05
    refine: float = 5e-3
    variable: bool = False
    tolerance: float = 1e-6
    slave_tolerance: float | None = 1e-6
    iterations: int = 25
    smallest: float | None = None


@dataclass(frozen=True)
class Run:
    """What was computed: values by "part.variable" at `time` [s]; `step` [s], `iterations` and `error` of the steps
    that ended there. `reason` says why the run ended before its stop time ("" where it did not)."""

    time: np.ndarray
    values: dict[str, np.ndarray]
    units: dict[str, str]
    step: np.ndarray
    iterations: np.ndarray
    error: np.ndarray
    rejected: int
    reason: str

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.values:
            raise KeyError(f"no value {name!r}{nearest(name, self.values)}")
        return self.values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.values)

    def completed(self) -> Run:
        """This run; `MasterError` with time and reason where it ended early."""
        if self.reason:
            raise MasterError(self.reason)
        return self

    def write(self, path: Path) -> Path:
        """All values as a CSV file with units in its header."""
        return write_atomically(path, tabular.text(self.time, self.values, self.units).encode())


Progress = Callable[[float], None]


def simulate(
    system: System,
    stop: float,
    options: Options | None = None,
    start: float = 0.0,
    progress: Progress = lambda time: None,
) -> Run:
    """Run `system` from `start` to `stop` [s]; `progress` receives the time now and then.

    Raises `CouplingError`, `SlaveError` or `MasterError` for what is wrong before the run starts; what goes wrong later
    ends the run, and `Run.reason` says it.
    """
    with Simulation(system, start, stop, options or Options()) as simulation:
        return simulation.run(progress)


class Simulation:
    """Loaded and initialised slaves, ready to run once. Use as a context."""

    def __init__(self, system: System, start: float, stop: float, options: Options) -> None:
        _check(options, start, stop)
        self._stack = ExitStack()
        self._options, self._start, self._stop = options, start, stop
        try:
            self._slaves = {n: self._stack.enter_context(Slave(n, p)) for n, p in system.slaves.items()}
            ports = {name: slave.ports() for name, slave in self._slaves.items()}
            wiring = wire(system, ports)
            known = {f"{n}.{s}": p.at(np.array([start]))[s][0] for n, p in system.sources.items() for s in p.inputs}
            initialise(self._slaves, wiring.source, known, system.parameters, start, stop, options.slave_tolerance)
            self._signals = _SignalNumbers(system, ports, wiring)
            self._keep: list[object] = []  # arrays that the C master points to
            self._library = _library()
            self._master = self._new(system, ports, wiring)
        except BaseException:
            self._stack.close()
            raise

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *_: object) -> None:
        self._library.master_free(self._master)
        self._stack.close()

    def run(self, progress: Progress = lambda time: None) -> Run:
        """Step to the end, or until the run fails."""
        width = 4 + len(self._signals.names)
        blocks, n, where = [], ctypes.c_long(), ctypes.c_int()
        status = _GOING
        while status == _GOING:
            rows = np.empty((ROWS, width))
            status = self._library.master_run(
                self._master,
                rows.ctypes.data_as(ctypes.c_void_p),
                ctypes.c_long(ROWS),
                ctypes.byref(n),
                ctypes.byref(where),
            )
            blocks.append(rows[: n.value])
            if n.value:
                progress(float(rows[n.value - 1, 0]))
        table = np.concatenate(blocks)
        counts = (ctypes.c_long * 3)()
        self._library.master_counts(self._master, counts)
        reached = float(table[-1, 0]) if len(table) else self._start
        values = {name: table[:, 4 + i].copy() for i, name in enumerate(self._signals.names)}
        return Run(
            table[:, 0].copy(),
            values,
            self._signals.units,
            table[:, 1].copy(),
            table[:, 2].copy(),
            table[:, 3].copy(),
            counts[2],
            self._reason(status, where.value, reached),
        )

    def _reason(self, status: int, where: int, time: float) -> str:
        if status == _DONE:
            return ""
        o = self._options
        signal = self._signals.names[where] if 0 <= where < len(self._signals.names) else ""
        ended = f"the run ended at {time:.6g} s: "
        if status == _SLAVE:
            slave = self._slaves[self._signals.order[where]]
            return f"{ended}{slave.name} refused: {slave.said() or 'it gave no reason'}"
        if status == _DIVERGED:
            return (
                f"{ended}the {o.scheme} scheme diverges: {signal} swings back and forth with the step ({o.step:g} s) "
                "and does not calm down, because a slave's answer within a step is larger than what caused it; use the "
                "implicit scheme, or a much shorter step"
            )
        if status == _STUCK:
            what = (
                "its error stays above the tolerance"
                if o.variable
                else f"it does not converge in {o.iterations} iterations"
            )
            return f"{ended}the interface at {signal}: {what} even with the smallest step; use a larger tolerance"
        return ended + {_NOT_FINITE: f"{signal} is not a finite number", _MEMORY: "out of memory"}.get(
            status, f"{status}"
        )

    def _new(self, system: System, ports: Mapping[str, Ports], wiring: Wiring) -> int:
        """The C master for this system."""
        signals, o = self._signals, self._options
        slaves = (_SlaveLayout * len(wiring.order))(*(self._slave(p, ports[p], wiring) for p in wiring.order))
        tables = (_TableLayout * max(1, signals.n_tables))(
            *(self._table(name, system.sources) for name in signals.names[: signals.n_tables])
        )
        settings = _SettingsLayout(
            SCHEMES.index(o.scheme),
            o.order,
            o.cubic,
            o.restart,
            o.variable,
            self._start,
            self._stop,
            o.step,
            o.refine,
            o.tolerance,
            o.smallest or o.step / 1000,
            o.iterations,
            *wiring.loop,
            *self._ints(signals.unknown),
            *self._ints(signals.events),
            *self._ints(signals.watched),
        )
        scale = self._array(ctypes.c_double, signals.scale)
        new = self._library.master_new
        new.restype = ctypes.c_void_p
        master = new(
            ctypes.byref(settings), len(wiring.order), slaves, signals.n_tables, tables, len(signals.names), scale
        )
        if not master:
            raise MasterError("out of memory")
        return int(master)

    def _slave(self, part: str, ports: Ports, wiring: Wiring) -> _SlaveLayout:
        slave, signals = self._slaves[part], self._signals
        abilities = slave.description.coSimulation
        inputs = [name for name in ports.inputs if f"{part}.{name}" in wiring.source]
        shared = [name for name in ports.outputs if f"{part}.{name}" in wiring.source.values()]

        def function(name: str, able: bool = True) -> int:
            return slave.address(name) if able else 0

        rolls = bool(abilities.canGetAndSetFMUstate)
        sloped = bool(abilities.maxOutputDerivativeOrder) and all(ports.outputs[n].continuous for n in shared)
        return _SlaveLayout(
            slave.fmu.component,
            function("fmi2SetReal"),
            function("fmi2SetRealInputDerivatives", bool(abilities.canInterpolateInputs)),
            function("fmi2GetReal"),
            function("fmi2GetRealOutputDerivatives", sloped),
            function("fmi2DoStep"),
            function("fmi2GetFMUstate", rolls),
            function("fmi2SetFMUstate", rolls),
            function("fmi2FreeFMUstate", rolls),
            len(inputs),
            self._array(ctypes.c_uint, [ports.inputs[n].reference for n in inputs]),
            self._array(ctypes.c_int, [signals.index(wiring.source[f"{part}.{n}"]) for n in inputs]),
            self._array(ctypes.c_int, [wiring.sampled[f"{part}.{n}"] for n in inputs]),
            len(ports.outputs),
            self._array(ctypes.c_uint, [p.reference for p in ports.outputs.values()]),
            signals.index(f"{part}.{next(iter(ports.outputs))}") if ports.outputs else 0,
            len(shared),
            self._array(ctypes.c_uint, [ports.outputs[n].reference for n in shared]),
            self._array(ctypes.c_int, [signals.index(f"{part}.{n}") for n in shared]),
        )

    def _table(self, signal: str, sources: Mapping[str, Protocol]) -> _TableLayout:
        """A known signal from the start of the run on."""
        source, name = signal.split(".", 1)
        protocol = sources[source]
        later = protocol.time > self._start
        now = protocol.at(np.array([self._start]))[name]
        time = np.concatenate([[self._start], protocol.time[later]])
        values = np.concatenate([now, protocol.inputs[name][later]])
        return _TableLayout(len(time), self._array(ctypes.c_double, time), self._array(ctypes.c_double, values), 0)

    def _ints(self, values: list[int]) -> tuple[int, ctypes.Array[ctypes.c_int]]:
        return len(values), self._array(ctypes.c_int, values)

    def _array(self, kind: Any, values: Collection[Any]) -> ctypes.Array[Any]:
        array: ctypes.Array[Any] = (kind * max(1, len(values)))(*values)
        self._keep.append(array)
        return array


class _SignalNumbers:
    """Every signal by number: known ones first, then the outputs of each slave in stepping order."""

    def __init__(self, system: System, ports: Mapping[str, Ports], wiring: Wiring) -> None:
        self.order = wiring.order
        tables = [f"{name}.{signal}" for name, protocol in system.sources.items() for signal in protocol.inputs]
        self.n_tables = len(tables)
        outputs = {f"{part}.{name}": port for part in wiring.order for name, port in ports[part].outputs.items()}
        self.names = [*tables, *outputs]
        self._places = {name: i for i, name in enumerate(self.names)}
        self.scale = [1.0] * len(tables) + [port.nominal for port in outputs.values()]
        self.units = {name: port.unit or "1" for name, port in outputs.items()}
        followed = {s: t for t, s in wiring.source.items() if not wiring.sampled[t] and s in outputs}
        self.watched = [self._places[s] for s in followed]
        self.unknown = sorted(
            {
                self._places[s]
                for t, s in wiring.source.items()
                if s in followed and not wiring.sampled[t] and self._goes_back(s, t)
            }
        )
        self.events = [self._places[name] for name in system.events]

    def index(self, name: str) -> int:
        return self._places[name]

    def _goes_back(self, source: str, target: str) -> bool:
        """Whether the source is stepped with or after the slave that uses it."""
        return self.order.index(source.partition(".")[0]) >= self.order.index(target.partition(".")[0])


def _check(options: Options, start: float, stop: float) -> None:
    if options.scheme not in SCHEMES:
        raise MasterError(f"scheme: expected {', '.join(SCHEMES)} but was given {options.scheme!r}")
    if not (np.isfinite(options.step) and options.step > 0):
        raise MasterError(f"step: expected a positive number of seconds but was given {options.step:g}")
    if not (np.isfinite(stop) and stop > start):
        raise MasterError(f"stop: expected a time after the start {start:g} s but was given {stop:g}")
    if not options.tolerance > 0:
        raise MasterError(f"tolerance: expected a positive number but was given {options.tolerance:g}")
    if (stop - start) / options.step > MOST_STEPS:
        raise MasterError(f"step: {options.step:g} s makes more than {MOST_STEPS:g} steps; expected fewer")


# The C side ---------------------------------------------------------------------------------------------------

_GOING, _DONE, _SLAVE, _DIVERGED, _STUCK, _MEMORY, _NOT_FINITE = range(7)


class _SlaveLayout(ctypes.Structure):
    _fields_ = (
        *(
            (name, ctypes.c_void_p)
            for name in (
                "component",
                "set_real",
                "set_derivatives",
                "get_real",
                "get_derivatives",
                "do_step",
                "get_state",
                "set_state",
                "free_state",
            )
        ),
        ("n_inputs", ctypes.c_int),
        ("inputs", ctypes.POINTER(ctypes.c_uint)),
        ("signals", ctypes.POINTER(ctypes.c_int)),
        ("held", ctypes.POINTER(ctypes.c_int)),
        ("n_outputs", ctypes.c_int),
        ("outputs", ctypes.POINTER(ctypes.c_uint)),
        ("first", ctypes.c_int),
        ("n_shared", ctypes.c_int),
        ("shared", ctypes.POINTER(ctypes.c_uint)),
        ("shared_signals", ctypes.POINTER(ctypes.c_int)),
    )


class _TableLayout(ctypes.Structure):
    _fields_ = (
        ("n", ctypes.c_long),
        ("time", ctypes.POINTER(ctypes.c_double)),
        ("value", ctypes.POINTER(ctypes.c_double)),
        ("at", ctypes.c_long),
    )


class _SettingsLayout(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int) for name in ("scheme", "order", "cubic")),
        ("restart", ctypes.c_double),
        ("variable", ctypes.c_int),
        *((name, ctypes.c_double) for name in ("start", "stop", "step", "refine", "tolerance", "smallest")),
        *((name, ctypes.c_int) for name in ("iterations", "loop_first", "loop_last", "n_unknown")),
        ("unknown", ctypes.POINTER(ctypes.c_int)),
        ("n_events", ctypes.c_int),
        ("events", ctypes.POINTER(ctypes.c_int)),
        ("n_watched", ctypes.c_int),
        ("watched", ctypes.POINTER(ctypes.c_int)),
    )


def _library() -> ctypes.CDLL:
    library = ctypes.CDLL(str(cached_library({n: native_source(n) for n in MASTER_SOURCES}, host())))
    library.master_run.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
    library.master_free.argtypes = [ctypes.c_void_p]
    library.master_counts.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
    return library
