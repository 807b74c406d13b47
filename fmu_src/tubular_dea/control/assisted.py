"""Many assisted hearts at once: pulses of any timing and voltage, each a trajectory of the batch kernel.

Tube and heart are one system of equations here. For a steady rhythm the output of the scheduler and its
amplifier is known: the same pulse every beat, with flanks limited by slew rate or current. (The amplifier's own lag
of 0.5 ms is left out; `tubular-dea assist` runs the optimum with it.)
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from ..kernel import Kernel
from ..kernel.batch import Batch, Breakpoints, Probe
from ..model.dea import tubular_dea
from ..model.declare import Model
from ..sweep.models import assisted_heart

# Beats until the last one is taken as the steady one: two more change the gain of a pulse by less than 0.05 %
# (`pytest tests/test_optimum.py -k steady`).
BEATS = 10

# Of 3000 random pulses the index of the best one errs by 5e-5 at most. With 1e-6, a step across the opening of a valve
# is now and then accepted that should not be, and errs by 7e-3: a search for the best pulse is drawn to just these
# (`pytest tests/test_optimum.py -k spike`).
TOLERANCE = 1e-7
ROWS = 64  # of a piece of work for one thread
OPEN = 5e-6  # m3/s: aortic flow of ejection, as in cosim.beats


@dataclass(frozen=True)
class Pulses:
    """One pulse a beat for each row: begin and end [s] after R (a begin may be negative), and voltage [V]."""

    on: np.ndarray
    off: np.ndarray
    voltage: np.ndarray

    @classmethod
    def of(cls, on: float | np.ndarray, off: float | np.ndarray, voltage: float | np.ndarray) -> Pulses:
        """Pulses from numbers or arrays of one length."""
        wide = np.broadcast_arrays(np.atleast_1d(on), off, voltage)
        return cls(*(np.asarray(a, float) for a in wide))

    def __getitem__(self, rows: slice | np.ndarray) -> Pulses:
        return Pulses(self.on[rows], self.off[rows], self.voltage[rows])


class AssistedHeart:
    """A patient with a tube, under pulses whose flanks have the slope `rate` [V/s]."""

    def __init__(self, patient: Mapping[str, float], rate: float, tube: Model | None = None) -> None:
        self.period, self._rate = 1 / patient["heart_rate"], rate
        self._tube = Kernel(tube or tubular_dea())
        start = self.rest_stretch(patient["aortic_pressure_start"])
        self._parameters = {f"heart_{n}": v for n, v in patient.items()} | {"tube_lambda_2_start": start}
        self._batch = Batch(assisted_heart(tube), _probes(self.period))

    def rest_stretch(self, pressure: float, voltage: float = 0.0) -> float:
        """lambda_2 of the tube at rest."""
        stretches = np.linspace(0.9, 2.0, 2001)
        load, _, (fold, _) = self._tube.curve(stretches, {"voltage": voltage})
        rising = stretches <= fold
        return float(np.interp(pressure, load[rising], stretches[rising]))

    def tube_values(self) -> dict[str, float]:
        """Parameters of the tube (SI)."""
        return dict(self._tube.defaults)

    def snap_through_pressure(self, voltage: np.ndarray) -> np.ndarray:
        """The fold [Pa] at each voltage."""
        grid = np.linspace(0.0, max(1.0, float(voltage.max())), 60)
        folds = [self._tube.curve(np.array([1.2]), {"voltage": v})[2][1] for v in grid]
        return np.interp(voltage, grid, folds)

    def run(self, pulses: Pulses, rate: float = 1.0, tolerance: float = TOLERANCE) -> dict[str, np.ndarray]:
        """Figures of the last beat by name, NaN where a row failed; `rate` is of the heart, over the patient's own."""
        pieces = [slice(i, i + ROWS) for i in range(0, pulses.on.size, ROWS)]
        with ThreadPoolExecutor(os.cpu_count()) as threads:
            found = list(threads.map(lambda piece: self._rows(pulses[piece], rate, tolerance), pieces))
        return {name: np.concatenate([f[name] for f in found]) for name in found[0]}

    def _rows(self, pulses: Pulses, rate: float, tolerance: float) -> dict[str, np.ndarray]:
        period = self.period / rate
        parameters = {**self._parameters, "heart_heart_rate": 1 / period}
        inputs = {"tube_voltage": self._voltage(pulses, period)}
        results = self._batch.trajectories(
            pulses.on.size, parameters, inputs, BEATS * period, tolerance, _probes(period)
        )
        v = dict(zip(PROBED, results.values.T, strict=True))
        volume = v["largest_volume"] - v["smallest_volume"]
        work = v["work"] - v["work_before"]
        return {
            "stroke_volume": volume,
            "stroke_work": work,
            "stroke_work_per_stroke_volume": work / volume,
            "mean_aortic_pressure": v["mean_pressure"],
            "ejection_begins": v["ejection_begins"] - (BEATS - 1) * period,
            "largest_field": v["largest_field"],
            "smallest_margin": self.snap_through_pressure(pulses.voltage) - v["largest_pressure"],
        }

    def _voltage(self, pulses: Pulses, period: float) -> Breakpoints:
        """A trapezium for every beat; one whose begin lies before the first R wave is cut there."""
        begin = np.arange(BEATS + 1) * period
        on, off = pulses.on[:, None] + begin, pulses.off[:, None] + begin
        rise = np.minimum(pulses.voltage / self._rate, pulses.off - pulses.on)[:, None]
        top = rise * self._rate
        time = np.stack([on, on + rise, off, off + rise], axis=-1)
        value = np.stack([0 * on, top + 0 * on, top + 0 * on, 0 * on], axis=-1)
        rows = pulses.on.size
        return Breakpoints(time.reshape(rows, -1), value.reshape(rows, -1))


PROBED = (
    "work_before",
    "work",
    "smallest_volume",
    "largest_volume",
    "mean_pressure",
    "largest_pressure",
    "ejection_begins",
    "largest_field",
)


def _probes(period: float) -> list[Probe]:
    """In the order of `PROBED`: over the last beat."""
    last = (BEATS - 1) * period
    return [
        Probe("at", "heart_ventricular_work", last),
        Probe("final", "heart_ventricular_work"),
        Probe("min", "heart_ventricular_volume", last),
        Probe("max", "heart_ventricular_volume", last),
        Probe("mean", "heart_aortic_pressure", last),
        Probe("max", "heart_aortic_pressure", last),
        Probe("rise", "heart_aortic_flow", last, OPEN),
        Probe("max", "tube_electric_field", last),
    ]
