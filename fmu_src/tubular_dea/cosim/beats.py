"""Indices of one beat for heart and tube: volumes, pressures, work, energies and the usual clinical indices.

A beat goes from R wave to R wave. `INDICES` lists the functions `Beat -> number`, each with its formula and its source;
`measure` applies them all. An index that a beat does not have (no blood was ejected, nothing was scheduled) is None
there and omitted from the result: no value is invented, and none is NaN.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..errors import UserError
from ..model.units import factor
from .master import Run

EARLY = 1 / 3  # of diastole is early
EJECTING = 5e-6  # m3/s: a larger aortic flow is ejection; closed valves leak 0.01 mL/s, ejection peaks near 500 mL/s


class BeatError(UserError, ValueError):
    """A run that holds no whole beat."""


@dataclass(frozen=True)
class Beat:
    """One beat of a run: `values` by "part.variable" at `time` [s], both R waves included."""

    time: np.ndarray
    values: Mapping[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.values[name]

    def has(self, name: str) -> bool:
        """Whether the run recorded it."""
        return name in self.values

    @property
    def period(self) -> float:
        """Length [s]."""
        return float(self.time[-1] - self.time[0])

    @cached_property
    def ejection(self) -> tuple[float, float] | None:
        """When the aortic valve opened and closed [s]: the flow passes `EJECTING`; None where it never does."""
        flow = self["heart.aortic_flow"] - EJECTING
        out = np.flatnonzero(flow > 0)
        if not out.size or out[-1] == flow.size - 1:
            return None
        return self._crossing(flow, int(out[0]) - 1) if out[0] else float(self.time[0]), self._crossing(flow, out[-1])

    def _crossing(self, values: np.ndarray, row: int) -> float:
        """Where the straight line between a row and the next is zero [s]."""
        a, b = values[row], values[row + 1]
        return float(self.time[row] + (self.time[row + 1] - self.time[row]) * a / (a - b))

    def integral(self, values: np.ndarray, start: float, stop: float) -> float:
        """Of `values` over time between two times [s]; straight between rows."""
        inside = (self.time > start) & (self.time < stop)
        time = np.concatenate([[start], self.time[inside], [stop]])
        return float(np.trapezoid(np.interp(time, self.time, values), time))

    def at(self, name: str, time: float) -> float:
        """A value at a time [s]."""
        return float(np.interp(time, self.time, self[name]))


Index = Callable[[Beat], float | None]


def stroke_volume(beat: Beat) -> float:
    """Largest volume of the ventricle before its least one, minus that."""
    volume = beat["heart.ventricular_volume"]
    return end_diastolic_volume(beat) - float(volume.min())


def cardiac_output(beat: Beat) -> float:
    """Stroke volume over the length of the beat."""
    return stroke_volume(beat) / beat.period


def ejection_fraction(beat: Beat) -> float:
    """Stroke volume over end-diastolic volume."""
    return stroke_volume(beat) / end_diastolic_volume(beat)


def stroke_work(beat: Beat) -> float:
    """Integral of p_v dV out of the ventricle: the area of the pressure-volume loop."""
    return _change(beat, "heart.ventricular_work")


def stroke_work_per_stroke_volume(beat: Beat) -> float | None:
    """Stroke work over stroke volume: the mean pressure against which blood is moved."""
    volume = stroke_volume(beat)
    return stroke_work(beat) / volume if beat.ejection and volume > 0 else None


def pressure_volume_area(beat: Beat) -> float | None:
    """Stroke work + p_es (V_es - V_0) / 2, the energy still in the elastance when the aortic valve closes.

    It goes in proportion with the oxygen consumed: H. Suga, Am. J. Physiol. 236 (1979) H498-H505.
    """
    return stroke_work(beat) + beat.at("heart.ventricular_energy", beat.ejection[1]) if beat.ejection else None


def cardiac_power_output(beat: Beat) -> float:
    """Mean aortic pressure times cardiac output: R. Fincke et al., J. Am. Coll. Cardiol. 44 (2004) 340-348."""
    return mean_aortic_pressure(beat) * cardiac_output(beat)


def end_diastolic_volume(beat: Beat) -> float:
    """Largest volume of the ventricle before it is least."""
    volume = beat["heart.ventricular_volume"]
    return float(volume[: int(volume.argmin()) + 1].max())


def end_diastolic_pressure(beat: Beat) -> float:
    """Aortic pressure when the aortic valve opens: what the ventricle has to overcome."""
    return beat.at("heart.aortic_pressure", beat.ejection[0] if beat.ejection else beat.time[0])


def peak_aortic_pressure(beat: Beat) -> float:
    """Largest aortic pressure until the valve closes."""
    last = beat.ejection[1] if beat.ejection else beat.time[-1]
    return float(beat["heart.aortic_pressure"][beat.time <= last].max())


def peak_diastolic_pressure(beat: Beat) -> float | None:
    """Largest aortic pressure after the valve has closed."""
    if beat.ejection is None:
        return None
    return float(beat["heart.aortic_pressure"][beat.time >= beat.ejection[1]].max())


def mean_aortic_pressure(beat: Beat) -> float:
    """Over the beat."""
    return beat.integral(beat["heart.aortic_pressure"], beat.time[0], beat.time[-1]) / beat.period


def early_diastolic_pressure(beat: Beat) -> float | None:
    """Mean aortic pressure over the first third of diastole, from the closure of the valve on."""
    if beat.ejection is None:
        return None
    length = EARLY * (beat.time[-1] - beat.ejection[1])
    return beat.integral(beat["heart.aortic_pressure"], beat.ejection[1], beat.ejection[1] + length) / length


def tension_time_index(beat: Beat) -> float | None:
    """Integral of the ventricle's pressure from R to the closure of the aortic valve: what systole demands.

    S. J. Sarnoff et al., Am. J. Physiol. 192 (1958) 148-156.
    """
    return beat.integral(beat["heart.ventricular_pressure"], beat.time[0], beat.ejection[1]) if beat.ejection else None


def diastolic_pressure_time_index(beat: Beat) -> float | None:
    """Integral of aortic minus ventricular pressure from the closure to the next R: what the coronaries are offered.

    G. D. Buckberg et al., Circ. Res. 30 (1972) 67-81.
    """
    difference = beat["heart.aortic_pressure"] - beat["heart.ventricular_pressure"]
    return beat.integral(difference, beat.ejection[1], beat.time[-1]) if beat.ejection else None


def subendocardial_viability_ratio(beat: Beat) -> float | None:
    """SEVR: diastolic pressure-time index over tension-time index (Buckberg et al. 1972)."""
    offered, demanded = diastolic_pressure_time_index(beat), tension_time_index(beat)
    return None if offered is None or demanded is None else offered / demanded


def electrical_energy(beat: Beat) -> float | None:
    """Energy that does not come back to the amplifier: work, and heat of the wall and of electrodes that resist.

    It is the loop of the amplifier's voltage over charge.
    """
    source = next((name for name in VOLTAGES if beat.has(name)), None)
    if source is None or not beat.has("tube.charge"):
        return None
    voltage, charge = beat[source], beat["tube.charge"]
    return float(np.sum((voltage[1:] + voltage[:-1]) / 2 * np.diff(charge)))


def mechanical_energy(beat: Beat) -> float:
    """Work the tube does on the blood."""
    return -_change(beat, "heart.tube_work")


def largest_field(beat: Beat) -> float | None:
    """Of the active layers."""
    return float(beat["tube.electric_field"].max()) if beat.has("tube.electric_field") else None


def smallest_margin(beat: Beat) -> float | None:
    """Pressure left before the tube snaps through, at the least."""
    return float(beat["tube.snap_through_margin"].min()) if beat.has("tube.snap_through_margin") else None


VOLTAGES = ("controller.voltage", "scheduler.voltage")  # the tube's is the first one there is


@dataclass(frozen=True)
class ShownIndex:
    """An index as it is shown: label, unit, its SI unit, and which way it gets `worse` (+1 larger, -1 smaller, 0)."""

    index: Index
    label: str
    unit: str
    si: str
    worse: int = 0

    @property
    def name(self) -> str:
        """Its place in `measure`'s result."""
        return self.index.__name__


INDICES = (
    ShownIndex(stroke_volume, "stroke volume", "mL", "m3", -1),
    ShownIndex(cardiac_output, "cardiac output", "L/min", "m3/s", -1),
    ShownIndex(ejection_fraction, "ejection fraction", "%", "1", -1),
    ShownIndex(stroke_work, "stroke work", "mJ", "J", 1),
    ShownIndex(stroke_work_per_stroke_volume, "stroke work per stroke volume", "mmHg", "Pa", 1),
    ShownIndex(pressure_volume_area, "pressure-volume area", "mJ", "J", 1),
    ShownIndex(cardiac_power_output, "cardiac power output", "W", "W", -1),
    ShownIndex(end_diastolic_volume, "end-diastolic volume", "mL", "m3", 1),
    ShownIndex(end_diastolic_pressure, "end-diastolic aortic pressure", "mmHg", "Pa", 1),
    ShownIndex(peak_aortic_pressure, "peak systolic aortic pressure", "mmHg", "Pa", 1),
    ShownIndex(peak_diastolic_pressure, "peak diastolic aortic pressure", "mmHg", "Pa", -1),
    ShownIndex(mean_aortic_pressure, "mean aortic pressure", "mmHg", "Pa", -1),
    ShownIndex(early_diastolic_pressure, "mean aortic pressure in early diastole", "mmHg", "Pa", -1),
    ShownIndex(tension_time_index, "tension-time index", "mmHg.s", "Pa.s", 1),
    ShownIndex(diastolic_pressure_time_index, "diastolic pressure-time index", "mmHg.s", "Pa.s", -1),
    ShownIndex(subendocardial_viability_ratio, "subendocardial viability ratio (SEVR)", "1", "1", -1),
    ShownIndex(electrical_energy, "electrical energy per beat, with all losses", "mJ", "J", 1),
    ShownIndex(mechanical_energy, "work of the tube on the blood per beat", "mJ", "J", -1),
    ShownIndex(largest_field, "largest field", "V/um", "V/m", 1),
    ShownIndex(smallest_margin, "smallest margin to snap-through", "mmHg", "Pa", -1),
)


def r_wave_rows(run: Run) -> np.ndarray:
    """Rows of `run` at the ventricle's R waves (the master lands on them)."""
    cycle = np.floor(run["heart.phase"] + 1e-5)
    return np.flatnonzero(np.diff(cycle, prepend=cycle[0] - 1) > 0)


def beats(run: Run) -> list[Beat]:
    """The whole beats of a run."""
    rows = r_wave_rows(run)
    return [
        Beat(run.time[a : b + 1], {n: v[a : b + 1] for n, v in run.values.items()})
        for a, b in zip(rows[:-1], rows[1:], strict=True)
    ]


def measure(beat: Beat) -> dict[str, float]:
    """The indices that this beat has, in SI units."""
    found = {figure.name: figure.index(beat) for figure in INDICES}
    return {name: value for name, value in found.items() if value is not None}


def shown(figure: ShownIndex) -> float:
    """Factor from SI to the unit in which the figure is shown."""
    return 100.0 if figure.unit == "%" else factor(figure.si, figure.unit)


def _change(beat: Beat, name: str) -> float:
    """Over the beat."""
    return float(beat[name][-1] - beat[name][0])
