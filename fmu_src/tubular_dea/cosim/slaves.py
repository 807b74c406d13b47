"""FMI 2 co-simulation slaves, loaded through FMPy: unpacked, checked, initialised; their messages kept."""

from __future__ import annotations

import contextlib
import ctypes
import itertools
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import fmpy
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    printLogMessage,
)

from ..errors import UserError
from ..files import FullDiskError, unpack, working_folder
from .system import Port, Ports

SWEEPS = 50  # at most, to find the initial values of connected slaves


class SlaveError(UserError, RuntimeError):
    """A slave that cannot be loaded, or that refuses to start; the text carries its own message."""


class Slave:
    """One loaded FMU. Use as a context; the library is unloaded at the end."""

    def __init__(self, name: str, path: Path) -> None:
        self.name = name
        self.messages: list[str] = []
        self._instance = f"{name}-{next(_NUMBERS)}"
        _MESSAGES[self._instance] = self.messages
        with contextlib.ExitStack() as stack:
            self._folder = stack.enter_context(working_folder(f"{name}: {path.name}"))
            self._load(path)
            self._kept = stack.pop_all()

    def _load(self, path: Path) -> None:
        try:
            unpack(path, self._folder)
            self.description = fmpy.read_model_description(str(self._folder), validate=False)
        except FullDiskError:
            raise
        except Exception as problem:  # FMPy and its parsers may raise anything
            why = str(problem) or type(problem).__name__
            raise SlaveError(
                f"{self.name}: {path} cannot be read as an FMU: {why}; expected an archive with a valid description"
            ) from None
        if self.description.fmiVersion != "2.0" or self.description.coSimulation is None:
            raise SlaveError(
                f"{self.name}: expected an FMI 2.0 co-simulation FMU but {path.name} is not; "
                f"it is FMI {self.description.fmiVersion}"
            )
        try:
            self.fmu = FMU2Slave(
                guid=self.description.guid,
                unzipDirectory=str(self._folder),
                modelIdentifier=self.description.coSimulation.modelIdentifier,
                instanceName=self._instance,
            )
            self.fmu.instantiate(callbacks=_CALLBACKS)
        except Exception as problem:
            raise SlaveError(f"{self.name}: {path.name} cannot be instantiated: {self.said() or problem}") from None

    def __enter__(self) -> Slave:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Free the instance and unload the library."""
        if self._instance in _MESSAGES:
            self.fmu.freeInstance()
            del _MESSAGES[self._instance]
            self._kept.close()

    def said(self) -> str:
        """The last message of the slave."""
        return self.messages[-1] if self.messages else ""

    def ports(self) -> Ports:
        """The Real inputs and outputs, and the names of the parameters."""
        reals = [v for v in self.description.modelVariables if v.type == "Real"]

        def of(causality: str) -> dict[str, Port]:
            return {
                v.name: Port(v.valueReference, _unit(v), abs(float(v.nominal or 1)) or 1.0, v.variability != "discrete")
                for v in reals
                if v.causality == causality
            }

        names = tuple(v.name for v in self.description.modelVariables if v.causality == "parameter")
        return Ports(of("input"), of("output"), names)

    def set(self, name: str, value: float) -> None:
        """Set a start value by name, whatever its type."""
        variable = next(v for v in self.description.modelVariables if v.name == name)
        reference = [variable.valueReference]
        try:
            if variable.type == "Boolean":
                self.fmu.setBoolean(reference, [bool(value)])
            elif variable.type in ("Integer", "Enumeration"):
                self.fmu.setInteger(reference, [int(value)])
            else:
                self.fmu.setReal(reference, [float(value)])
        except Exception as problem:
            raise SlaveError(f"{self.name}.{name}: {self.said() or problem}") from None

    def address(self, function: str) -> int:
        """The address of one of the FMU's functions."""
        return int(ctypes.cast(getattr(self.fmu.dll, function), ctypes.c_void_p).value or 0)


# FMPy's proxy, which formats messages with C's variadic arguments, knows one logger for all FMUs: ours finds the slave
# by its instance name, and leaves the messages of other FMUs to FMPy's own.
_NUMBERS = itertools.count()
_MESSAGES: dict[str, list[str]] = {}


def _log(environment: Any, name: bytes, status: int, category: bytes, message: bytes) -> None:
    messages = _MESSAGES.get((name or b"").decode(errors="replace"))
    if messages is None:
        printLogMessage(environment, name, status, category, message)
    elif status > 0:
        messages.append((message or b"").decode(errors="replace"))


def _callbacks() -> fmi2CallbackFunctions:
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(_log)
    callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
    try:
        from fmpy.logging import addLoggerProxy
    except (ImportError, OSError):  # FMPy has no proxy for this platform: messages are not formatted
        return callbacks
    addLoggerProxy(ctypes.byref(callbacks))
    return callbacks


_CALLBACKS = _callbacks()


def _unit(variable: Any) -> str | None:
    declared = getattr(variable.declaredType, "unit", None) if variable.declaredType else None
    return variable.unit or declared


def initialise(
    slaves: Mapping[str, Slave],
    source: Mapping[str, str],
    known: Mapping[str, float],
    parameters: Mapping[str, float],
    start: float,
    stop: float,
    tolerance: float | None,
) -> None:
    """All slaves through initialization, connected values included: swept until none changes.

    `known` are the values of source signals at the start, `source` maps "part.input" to what drives it.
    """
    for part, slave in slaves.items():
        _call(slave, "setup", lambda s: s.fmu.setupExperiment(tolerance=tolerance, startTime=start, stopTime=stop))
        for name, value in parameters.items():
            if name.partition(".")[0] == part:
                slave.set(name.partition(".")[2], value)
        _call(slave, "initialization", lambda s: s.fmu.enterInitializationMode())
    _sweep(slaves, source, known)
    for slave in slaves.values():
        _call(slave, "initialization", lambda s: s.fmu.exitInitializationMode())


def _sweep(slaves: Mapping[str, Slave], source: Mapping[str, str], known: Mapping[str, float]) -> None:
    ports = {part: slave.ports() for part, slave in slaves.items()}
    last: dict[str, float] = {}
    for _ in range(SWEEPS):
        values: dict[str, float] = {}
        for target, origin in source.items():
            part, variable = target.split(".", 1)
            from_part, output = origin.split(".", 1)
            if origin in known:
                value = known[origin]
            else:
                reference = ports[from_part].outputs[output].reference
                value = _call(slaves[from_part], "initialization", lambda s, r=reference: s.fmu.getReal([r]))[0]
            reference = ports[part].inputs[variable].reference
            _call(slaves[part], "initialization", lambda s, r=reference, v=value: s.fmu.setReal([r], [v]))
            values[target] = value
        if all(abs(values[t] - last.get(t, float("inf"))) <= 1e-9 * (abs(values[t]) + 1e-12) for t in values):
            return
        last = values
    raise SlaveError(
        f"the initial values of {', '.join(source)} do not settle: the connections form a loop at the start"
    )


def _call(slave: Slave, what: str, function: Any) -> Any:
    try:
        return function(slave)
    except Exception as problem:
        raise SlaveError(f"{slave.name}, {what}: {slave.said() or problem}") from None
