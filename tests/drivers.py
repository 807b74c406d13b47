"""Run an FMU through FMPy, by hand: FMPy's own simulate_fmu holds inputs during steps, which a ramp does not.

`Host` opens an FMU of either version; `co_simulate` and `integrate` run a reference case through it and
return lambda_2 at the case's samples.
"""

from __future__ import annotations

import ctypes
import shutil
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from types import TracebackType

import fmpy
import numpy as np
from fmpy import fmi3
from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE, fmi2ComponentEnvironment
from scipy.integrate import Radau

from scenarios import Case

INPUTS = ("pressure", "voltage")
CS, ME = "CoSimulation", "ModelExchange"


class Host:
    """One instance of an FMU, its variables by name, and the messages it logged."""

    def __init__(self, path: Path, kind: str = CS, logging: bool = False, intermediate=None, early: bool = False):
        self.description = fmpy.read_model_description(str(path))
        self.version = int(self.description.fmiVersion[0])
        self.kind = kind
        self.messages: list[str] = []
        self.vr = {v.name: v.valueReference for v in self.description.modelVariables}
        self._folder = tempfile.mkdtemp()
        fmpy.extract(str(path), self._folder)
        self._arguments = arguments = {
            "guid": self.description.guid if self.version == 2 else self.description.instantiationToken,
            "unzipDirectory": self._folder,
            "modelIdentifier": self.description.coSimulation.modelIdentifier,
            "instanceName": "tube",
        }
        self._functions: dict[str, Callable[..., int]] = {}
        if self.version == 2:
            self.fmu = (FMU2Slave if kind == CS else FMU2Model)(**arguments)
            self._callbacks = self._callbacks2()
            self.fmu.instantiate(callbacks=self._callbacks, loggingOn=logging)
        else:
            self.fmu = (fmi3.FMU3Slave if kind == CS else fmi3.FMU3Model)(**arguments)
            options = {"loggingOn": logging, "logMessage": self._log3}
            if kind == CS:
                options |= {"intermediateUpdate": intermediate, "earlyReturnAllowed": early}
            self.fmu.instantiate(**options)

    def _callbacks2(self) -> fmi2CallbackFunctions:
        def log(_environment, _name, _status, _category, message) -> None:
            self.messages.append(message.decode())

        callbacks = fmi2CallbackFunctions()
        self._logger = fmi2CallbackLoggerTYPE(log)
        callbacks.logger = self._logger
        callbacks.componentEnvironment = fmi2ComponentEnvironment()
        from fmpy.fmi2 import fmi2CallbackAllocateMemoryTYPE, fmi2CallbackFreeMemoryTYPE

        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
        return callbacks

    def _log3(self, _environment, _status, _category, message) -> None:
        self.messages.append(message.decode())

    def __enter__(self) -> Host:
        return self

    def __exit__(self, kind: type | None, value: BaseException | None, trace: TracebackType | None) -> None:
        self.fmu.freeInstance()
        shutil.rmtree(self._folder, ignore_errors=True)

    # Values ---------------------------------------------------------------------------------------

    def get(self, *names: str) -> list[float]:
        """Real values by name."""
        references = [self.vr[name] for name in names]
        return list(self.fmu.getReal(references) if self.version == 2 else self.fmu.getFloat64(references))

    def set(self, **values: float) -> None:
        """Set real variables by name."""
        references = [self.vr[name] for name in values]
        if self.version == 2:
            self.fmu.setReal(references, list(values.values()))
        else:
            self.fmu.setFloat64(references, list(values.values()))

    def set_boolean(self, name: str, value: bool) -> None:
        """Set a Boolean parameter."""
        self.fmu.setBoolean([self.vr[name]], [value])

    def set_input_derivatives(self, slopes: Iterable[float]) -> None:
        """First time derivatives of pressure [Pa/s] and voltage [V/s] for the next step (FMI 2)."""
        n = len(INPUTS)
        references = (ctypes.c_uint * n)(*(self.vr[name] for name in INPUTS))
        order = (ctypes.c_int * n)(*([1] * n))
        self.fmu.fmi2SetRealInputDerivatives(self.fmu.component, references, n, order, (ctypes.c_double * n)(*slopes))

    def call(self, function: str, *arguments: object) -> int:
        """The status of fmi2<function> or fmi3<function>, called as it is: nothing is checked, None is NULL."""
        name = f"fmi{self.version}{function}"
        if name not in self._functions:  # FMPy knows those of one interface only
            other = {
                FMU2Slave: FMU2Model,
                FMU2Model: FMU2Slave,
                fmi3.FMU3Slave: fmi3.FMU3Model,
                fmi3.FMU3Model: fmi3.FMU3Slave,
            }[type(self.fmu)]
            self._functions = other(**self._arguments)._functions | self.fmu._functions
        return self._functions[name](self.fmu.component, *arguments)

    def derivative(self, unknown: Iterable[str], known: Iterable[str], seed: Iterable[float]) -> np.ndarray:
        """The directional derivatives of `unknown` along `seed` in `known`."""
        references = [self.vr[name] for name in unknown], [self.vr[name] for name in known]
        return np.array(self.fmu.getDirectionalDerivative(*references, list(seed)))

    def output_derivatives(self, *names: str) -> list[float]:
        """First time derivatives of outputs."""
        references, n = [self.vr[name] for name in names], len(names)
        if self.version == 3:
            return self.fmu.getOutputDerivatives(references, [1] * n)
        values = (ctypes.c_double * n)()
        orders = (ctypes.c_int * n)(*[1] * n)
        self.fmu.fmi2GetRealOutputDerivatives(self.fmu.component, (ctypes.c_uint * n)(*references), n, orders, values)
        return list(values)

    # Saved states ---------------------------------------------------------------------------------

    def saved(self) -> bytes:
        """Everything that determines the future of the instance."""
        state = self.fmu.getFMUState()
        saved = self.fmu.serializeFMUState(state)
        self.fmu.freeFMUState(state)
        return bytes(saved)

    def restore(self, saved: bytes) -> None:
        """Continue from a saved state."""
        state = self.fmu.deserializeFMUState(saved)
        self.fmu.setFMUState(state)
        self.fmu.freeFMUState(state)

    # Life -----------------------------------------------------------------------------------------

    def initialize(self, tolerance: float | None = None, start: float = 0.0, stop: float | None = None) -> None:
        """Through initialization mode; model exchange ends in continuous-time mode."""
        self.enter(tolerance, start, stop)
        self.fmu.exitInitializationMode()
        if self.kind == ME:
            self.fmu.newDiscreteStates() if self.version == 2 else self.fmu.updateDiscreteStates()
            self.fmu.enterContinuousTimeMode()

    def enter(self, tolerance: float | None = None, start: float = 0.0, stop: float | None = None) -> None:
        """Into initialization mode."""
        if self.version == 2:
            self.fmu.setupExperiment(tolerance=tolerance, startTime=start, stopTime=stop)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(tolerance=tolerance, startTime=start, stopTime=stop)

    def step(self, time: float, size: float) -> None:
        """One communication step [s]."""
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=size)

    # Model exchange -------------------------------------------------------------------------------

    def states(self) -> np.ndarray:
        """The continuous states."""
        x = (ctypes.c_double * 4)()
        (self.fmu.getContinuousStates)(x, 4)
        return np.array(x)

    def derivatives(self, time: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """State derivatives at states `x` and inputs `u`."""
        self.place(time, x, u)
        dx = (ctypes.c_double * 4)()
        (self.fmu.getDerivatives if self.version == 2 else self.fmu.getContinuousStateDerivatives)(dx, 4)
        return np.array(dx)

    def place(self, time: float, x: np.ndarray, u: np.ndarray) -> None:
        """Set time, states and inputs."""
        self.fmu.setTime(time)
        self.fmu.setContinuousStates((ctypes.c_double * 4)(*x), 4)
        self.set(pressure=u[0], voltage=u[1])

    def jacobian(self, time: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """d(derivatives)/d(states) from the FMU's directional derivatives."""
        self.place(time, x, u)
        states = ["lambda_2", "lambda_2_rate", "sigma_vis1", "sigma_vis2"]
        unknown = [self.vr[f"der({name})"] for name in states]
        columns = [self.fmu.getDirectionalDerivative(unknown, [self.vr[name]], [1.0]) for name in states]
        return np.array(columns).T


def co_simulate(path: Path, case: Case, interpolated: bool) -> np.ndarray:
    """lambda_2 at the case's samples by co-simulation.

    With `interpolated` inputs (FMI 2) one step per sample follows ramps exactly. Otherwise inputs are held at
    their middle values during steps so short that the staircase moves lambda_2 by less than 1e-7: 0.1 ms while
    the tube still rings, 0.25 ms on the rest of a ramp.
    """
    with Host(path) as host:
        _set_inputs(host, case.pieces()[0][2])
        host.initialize()
        values = []
        grid, samples = _grid(case, interpolated)
        for start, end in zip(grid, grid[1:], strict=False):
            if start in samples:
                values.append(host.get("lambda_2")[0])
            u, slope = _inputs_after(case, start)
            _set_inputs(host, u if interpolated else u + slope * (end - start) / 2)
            if interpolated:
                host.set_input_derivatives(slope)
            host.step(start, end - start)
        values.append(host.get("lambda_2")[0])
    return np.array(values)


def integrate(path: Path, case: Case) -> np.ndarray:
    """lambda_2 at the case's samples by model exchange: SciPy's Radau with the FMU's Jacobian."""
    out = np.empty(case.time.size)
    with Host(path, ME) as host:
        _set_inputs(host, case.pieces()[0][2])
        host.initialize()
        x = host.states()
        out[0] = x[0]
        for start, end, u, slope in case.pieces():
            inputs = lambda t, u=u, slope=slope, start=start: u + slope * (t - start)  # noqa: E731
            solver = Radau(
                lambda t, y, i=inputs: host.derivatives(t, y, i(t)),
                start,
                x,
                end,
                rtol=1e-7,
                atol=[1e-9, 1e-6, 1e-2, 1e-2],
                jac=lambda t, y, i=inputs: host.jacobian(t, y, i(t)),
                first_step=1e-7,
            )
            while solver.status == "running":
                solver.step()
                inside = (case.time > solver.t_old) & (case.time <= solver.t + 1e-12)
                if inside.any():
                    out[inside] = solver.dense_output()(case.time[inside])[0]
            x = solver.y
    return out


def _set_inputs(host: Host, u: np.ndarray) -> None:
    host.set(pressure=u[0], voltage=u[1])


def _inputs_after(case: Case, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Inputs at `time` (after a jump there) and their slopes."""
    for start, end, u, slope in case.pieces():
        if start <= time < end:
            return u + slope * (time - start), slope
    raise AssertionError(f"{case.name}: {time} is outside the protocol")


def _grid(case: Case, interpolated: bool) -> tuple[np.ndarray, set[float]]:
    """Communication points, and which of them are samples."""
    points = [case.time, case.inputs["time"]]
    if not interpolated:
        for start, end, _, slope in case.pieces():
            if np.any(slope != 0):
                early = min(end, 0.3)
                points += [np.arange(start, early, 1e-4), np.arange(max(start, early), end, 2.5e-4)]
    merged = np.unique(np.round(np.concatenate(points), 9))
    return merged, set(np.round(case.time, 9))
