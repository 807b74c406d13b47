"""Controllers to compare the tube controller with: a constant voltage, and a PI controller with the same limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..model.dea import tubular_dea
from .rig import STEP

SLEW = 10e-3 / 30e-9 * STEP  # V a sample: 10 mA into the 30 nF of the tube at 25 mm, as the tube controller's amplifier


@dataclass
class Constant:
    """The open loop."""

    voltage: float

    def start(self, reference: float, pressure: float, displacement: float) -> None:
        """Nothing."""

    def sample(self, time: float, reference: float, pressure: float, displacement: float) -> float:
        """The same voltage."""
        return self.voltage

    def outputs(self) -> Mapping[str, float]:
        """None."""
        return {}


@dataclass
class PI:
    """Voltage = resting voltage + proportional e + integral of e, e = reference - radius; clamped, with anti-windup.

    It is given the resting voltage at the reference under the mean pressure, which the tube controller finds itself.
    `smoothing` is the part of a new measurement in the filtered one.
    Gains: `python tests/benchmarks/controller.py tune`.
    """

    rest: float
    field_limit: float
    proportional: float = 6.7e6  # V/m
    integral: float = 6.2e8  # V/(m s)
    smoothing: float = 0.6
    _sum: float = field(default=0.0, init=False)
    _radius: float = field(default=0.0, init=False)
    _voltage: float = field(default=0.0, init=False)

    def start(self, reference: float, pressure: float, displacement: float) -> None:
        """From rest."""
        self._sum, self._voltage = 0.0, self.rest
        self._radius = displacement + tubular_dea().parameter_values()["r_o"]

    def sample(self, time: float, reference: float, pressure: float, displacement: float) -> float:
        """One sample."""
        v = tubular_dea().parameter_values()
        self._radius += self.smoothing * (displacement + v["r_o"] - self._radius)
        error = reference - self._radius
        wanted = self.rest + self.proportional * error + self._sum
        stretch = self._radius / v["r_o"]
        along = np.sqrt(1 + (v["r_o"] / v["l_o"]) ** 2 * (stretch - 1) ** 2)
        largest = self.field_limit * v["h_ao"] / (along * stretch)
        given = float(np.clip(np.clip(wanted, 0.0, largest), self._voltage - SLEW, self._voltage + SLEW))
        if given == wanted:
            self._sum += self.integral * error * STEP
        self._voltage = given
        return given

    def outputs(self) -> Mapping[str, float]:
        """None."""
        return {}
