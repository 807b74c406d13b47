"""A bench for controllers: the tube as an FMU under a disturbing pressure, with the errors of a sensor and a loop.

Between tube and controller: noise and delay of the displacement's sensor, parameters of the tube that the controller
does not know. Every sample of the controller is one communication step. Usage::

    bench = Bench(lambda t: 140 * 133.322, lambda t: 25e-3, start=25.3e-3, noise=15e-6, delay=2)
    record = experiment(bench, TubeController({"field_limit": 85e6}), stop=1.0)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Protocol

import numpy as np

from ..cosim.slaves import Slave
from ..emit.variables import guid
from ..export.cache import cache_folder
from ..export.package import native_fmu
from ..model.dea import tubular_dea
from ..model.declare import Model
from ..model.tube_controller import tube_controller

STEP = 1e-3  # s

Pressure = Callable[[float], float]


@dataclass(frozen=True)
class Bench:
    """One experiment: `pressure` [Pa] and `reference` [m] over time, the tube at radius `start` [m] (still, its
    branches relaxed), its parameters; noise [m rms], delay [samples] and seed of the sensor; the first voltage [V]."""

    pressure: Pressure
    reference: Callable[[float], float]
    start: float
    tube: Mapping[str, float] = field(default_factory=dict)
    noise: float = 0.0
    delay: int = 0
    seed: int = 0
    voltage: float = 0.0


@dataclass(frozen=True)
class Record:
    """What happened: time [s], true radius [m], voltage [V], pressure [Pa], reference [m], and outputs by name."""

    time: np.ndarray
    radius: np.ndarray
    voltage: np.ndarray
    pressure: np.ndarray
    reference: np.ndarray
    outputs: dict[str, np.ndarray]

    @property
    def error(self) -> np.ndarray:
        """Radius minus reference [m]."""
        return self.radius - self.reference

    def settled(self, band: float) -> float:
        """The time from which on the radius stays within `band` [m] of the reference; inf where it does not."""
        out = np.flatnonzero(np.abs(self.error) > band)
        if not out.size:
            return float(self.time[0])
        return float(self.time[out[-1] + 1]) if out[-1] + 1 < self.time.size else float("inf")


class Controller(Protocol):
    """Anything that turns measurements into a voltage, once a sample."""

    def start(self, reference: float, pressure: float, displacement: float) -> None:
        """Before the first sample."""

    def sample(self, time: float, reference: float, pressure: float, displacement: float) -> float:
        """One sample at `time` [s]; the voltage [V] at the end of the sample."""

    def outputs(self) -> Mapping[str, float]:
        """Further recorded values."""


def fmu(model: Model) -> Path:
    """The native FMI 2 FMU, from the cache."""
    path = cache_folder() / "fmus" / guid(model).strip("{}") / f"{model.name}.fmu"
    return path if path.exists() else native_fmu(model, 2, path)


def experiment(bench: Bench, controller: Controller, stop: float) -> Record:
    """Run `controller` on `bench` for `stop` [s]."""
    random = np.random.default_rng(bench.seed)
    steps = round(stop / STEP)
    r_o = tubular_dea().parameter_values()["r_o"]
    rows, outputs = np.empty((steps + 1, 5)), []
    with Tube(bench) as tube:
        past = [tube.radius - r_o] * (bench.delay + 1)
        controller.start(bench.reference(0.0), bench.pressure(0.0), past[0])
        voltage = bench.voltage
        for k in range(steps + 1):
            time = k * STEP
            rows[k] = time, tube.radius, voltage, bench.pressure(time), bench.reference(time)
            outputs.append(controller.outputs())
            if k == steps:
                break
            measured = past[-1 - bench.delay] + bench.noise * random.standard_normal()
            before, voltage = voltage, controller.sample(time, bench.reference(time), bench.pressure(time), measured)
            tube.step(time, bench.pressure(time + STEP), before, voltage)
            past.append(tube.radius - r_o)
    named = {name: np.array([o[name] for o in outputs]) for name in outputs[0]} if outputs else {}
    return Record(rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3], rows[:, 4], named)


class Tube:
    """The tube's FMU, started at rest at a radius; the voltage goes straight over each step."""

    def __init__(self, bench: Bench) -> None:
        self._slave = Slave("tube", fmu(tubular_dea()))
        names = {v.name: v.valueReference for v in self._slave.description.modelVariables}
        self._inputs, self._radius = [names["pressure"], names["voltage"]], [names["radius"]]
        r_o = bench.tube.get("r_o", tubular_dea().parameter_values()["r_o"])
        self._slave.fmu.setupExperiment(startTime=0.0, tolerance=1e-6)
        for name, value in {**bench.tube, "lambda_2_start": bench.start / r_o}.items():
            self._slave.set(name, value)
        self._slave.fmu.enterInitializationMode()
        self._slave.fmu.setReal(self._inputs, [bench.pressure(0.0), bench.voltage])
        self._slave.fmu.exitInitializationMode()
        self.radius = float(self._slave.fmu.getReal(self._radius)[0])

    def step(self, time: float, pressure: float, before: float, voltage: float) -> None:
        """To `time` + STEP, under `pressure` and a voltage that goes from `before` to `voltage`."""
        self._slave.fmu.setReal(self._inputs, [pressure, (before + voltage) / 2])
        self._slave.fmu.doStep(time, STEP)
        self.radius = float(self._slave.fmu.getReal(self._radius)[0])

    def __enter__(self) -> Tube:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._slave.close()


class TubeController:
    """The FMU, with parameters of its own."""

    RECORDED = ("mode", "limited", "reference", "estimated_radius", "bias", "expected_field")

    def __init__(self, values: Mapping[str, float] | None = None, recorded: Sequence[str] = RECORDED) -> None:
        self._values, self._recorded = dict(values or {}), list(recorded)
        self._slave: Slave | None = None

    def start(self, reference: float, pressure: float, displacement: float) -> None:
        """A fresh instance."""
        self.close()
        slave = self._slave = Slave("controller", fmu(tube_controller()))
        names = {v.name: v.valueReference for v in slave.description.modelVariables}
        self._inputs = [names[n] for n in ("reference_radius", "pressure", "displacement")]
        self._outputs = [names[n] for n in ("voltage", *self._recorded)]
        slave.fmu.setupExperiment(startTime=0.0, tolerance=1e-6)
        for name, value in self._values.items():
            slave.set(name, value)
        slave.fmu.enterInitializationMode()
        slave.fmu.setReal(self._inputs, [reference, pressure, displacement])
        slave.fmu.exitInitializationMode()

    def sample(self, time: float, reference: float, pressure: float, displacement: float) -> float:
        """One step of the FMU."""
        assert self._slave is not None, "started"
        self._slave.fmu.setReal(self._inputs, [reference, pressure, displacement])
        self._slave.fmu.doStep(time, STEP)
        return float(self._slave.fmu.getReal(self._outputs[:1])[0])

    def outputs(self) -> Mapping[str, float]:
        """The recorded ones."""
        assert self._slave is not None, "started"
        return dict(zip(self._recorded, self._slave.fmu.getReal(self._outputs[1:]), strict=True))

    def close(self) -> None:
        """Free the instance."""
        if self._slave is not None:
            self._slave.close()
            self._slave = None


@cache
def rest_voltage(radius: float, pressure: float) -> float:
    """The voltage [V] at which the tube rests at `radius` under `pressure`, stably or not; NaN where none does."""
    from ..model.reduced import reduced

    values = tubular_dea().parameter_values()
    at = {"lambda_2": radius / values["r_o"], **values}
    elastic, electric = (
        float(reduced()[n].subs({s: at[str(s)] for s in reduced()[n].free_symbols})) for n in ("elastic", "electric")
    )
    squared = (elastic - pressure) / electric
    return float(np.sqrt(squared)) if squared >= 0 else float("nan")
