"""What a run means for heart and tube: one beat's volumes, pressures, work and energies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import UserError
from ..model.units import factor
from .master import Run

EARLY = 1 / 3  # of diastole is early


class BeatError(UserError, ValueError):
    """A run that holds no whole beat."""


@dataclass(frozen=True)
class Figure:
    """One number of the comparison: what it is, the unit it is shown in, and its place in `measure`'s result (SI)."""

    name: str
    label: str
    unit: str
    si: str


FIGURES = (
    Figure("stroke_volume", "stroke volume", "mL", "m3"),
    Figure("cardiac_output", "cardiac output", "L/min", "m3/s"),
    Figure("stroke_work", "stroke work", "mJ", "J"),
    Figure("stroke_work_per_stroke_volume", "stroke work per stroke volume", "mmHg", "Pa"),
    Figure("end_diastolic_volume", "end-diastolic volume", "mL", "m3"),
    Figure("end_diastolic_pressure", "end-diastolic aortic pressure", "mmHg", "Pa"),
    Figure("peak_aortic_pressure", "peak aortic pressure", "mmHg", "Pa"),
    Figure("mean_aortic_pressure", "mean aortic pressure", "mmHg", "Pa"),
    Figure("early_diastolic_pressure", "mean aortic pressure in early diastole", "mmHg", "Pa"),
    Figure("electrical_energy", "electrical energy converted per beat", "mJ", "J"),
    Figure("mechanical_energy", "work of the tube on the blood per beat", "mJ", "J"),
    Figure("largest_field", "largest field", "V/um", "V/m"),
    Figure("smallest_margin", "smallest margin to snap-through", "mmHg", "Pa"),
)


def r_wave_rows(run: Run) -> np.ndarray:
    """Rows of `run` at the ventricle's R waves (the master lands on them)."""
    cycle = np.floor(run["heart.phase"] + 1e-5)
    return np.flatnonzero(np.diff(cycle, prepend=cycle[0] - 1) > 0)


def last_beats(run: Run, n: int = 1) -> slice:
    """The rows of the last `n` whole beats, both R waves included."""
    rows = r_wave_rows(run)
    if rows.size < n + 1:
        raise BeatError(f"expected a run of at least {n} whole beats but it has {max(0, rows.size - 1)}; run it longer")
    return slice(int(rows[-1 - n]), int(rows[-1]) + 1)


def measure(run: Run, rows: slice | None = None) -> dict[str, float]:
    """The figures of one beat, in SI units; of the last whole one by default."""
    rows = rows or last_beats(run)
    time, v = run.time[rows], {name: values[rows] for name, values in run.values.items()}
    period = float(time[-1] - time[0])
    volume, pressure = v["heart.ventricular_volume"], v["heart.aortic_pressure"]
    stroke_volume = float(np.ptp(volume))
    stroke_work = float(v["heart.ventricular_work"][-1] - v["heart.ventricular_work"][0])
    figures = {
        "stroke_volume": stroke_volume,
        "cardiac_output": stroke_volume / period,
        "stroke_work": stroke_work,
        "stroke_work_per_stroke_volume": stroke_work / stroke_volume,
        "end_diastolic_volume": float(volume.max()),
        "end_diastolic_pressure": float(pressure[0]),
        "peak_aortic_pressure": float(pressure.max()),
        "mean_aortic_pressure": _mean(time, pressure),
        "early_diastolic_pressure": _early_diastolic(time, v),
        "mechanical_energy": float(v["heart.tube_work"][0] - v["heart.tube_work"][-1]),
        "electrical_energy": _electrical(v) if "scheduler.voltage" in v else 0.0,
    }
    if "tube.electric_field" in v:
        figures["largest_field"] = float(v["tube.electric_field"].max())
        figures["smallest_margin"] = float(v["tube.snap_through_margin"].min())
    return figures


def compare(passive: Mapping[str, float], assisted: Mapping[str, float]) -> list[tuple[str, str, str, str]]:
    """Rows (figure with unit, without assist, with assist, change) in customary units."""
    rows = []
    for figure in FIGURES:
        if figure.name not in passive or figure.name not in assisted:
            continue
        scale = factor(figure.si, figure.unit)
        a, b = passive[figure.name] * scale, assisted[figure.name] * scale
        # A percentage says something where both have the same sign and size.
        alike = a * b > 0 and 0.1 < abs(b / a) < 10
        change = f"{b - a + 0.0:+.2f}" + (f" ({100 * (b / a - 1):+.1f} %)" if alike else "")
        rows.append((f"{figure.label} [{figure.unit}]", f"{a:.2f}", f"{b:.2f}", change))
    augmentation = (assisted["early_diastolic_pressure"] - passive["early_diastolic_pressure"]) * factor("Pa", "mmHg")
    rows.append(("early-diastolic augmentation [mmHg]", "", f"{augmentation:+.2f}", ""))
    return rows


def tube_work(run: Run, rows: slice | None = None) -> tuple[float, float]:
    """Work [J] the windkessel has given to the tube, and work the tube has received by its own pressure and volume.

    The first is integrated inside the windkessel. The second is p dV, step by step, from the pressure the tube was
    given and the volume and flow it reports at both ends (a trapezoid with end correction, of fourth order).
    """
    rows = rows or slice(0, run.time.size)
    h = np.diff(run.time[rows])
    p, volume, flow = (run[name][rows] for name in ("heart.aortic_pressure", "tube.tube_volume", "tube.tube_flow"))
    slope = np.diff(p) / h
    integral = h / 2 * (volume[1:] + volume[:-1]) + h**2 / 12 * (flow[:-1] - flow[1:])
    received = float(np.sum(p[1:] * volume[1:] - p[:-1] * volume[:-1] - slope * integral))
    given = float(run["heart.tube_work"][rows][-1] - run["heart.tube_work"][rows][0])
    return given, received


def _mean(time: np.ndarray, values: np.ndarray) -> float:
    return float(np.trapezoid(values, time) / (time[-1] - time[0]))


def _early_diastolic(time: np.ndarray, v: Mapping[str, np.ndarray]) -> float:
    """Mean aortic pressure over the first third of diastole: from the end of the ejection on."""
    ejecting = np.flatnonzero(v["heart.aortic_flow"] > 0.05 * v["heart.aortic_flow"].max())
    closed = time[ejecting[-1]]
    window = (time >= closed) & (time <= closed + EARLY * (time[-1] - closed))
    return _mean(time[window], v["heart.aortic_pressure"][window])


def _electrical(v: Mapping[str, np.ndarray]) -> float:
    """Energy that goes into the electrodes and does not come back: the loop of voltage over charge."""
    voltage, charge = v["scheduler.voltage"], v["tube.charge"]
    return float(np.sum((voltage[1:] + voltage[:-1]) / 2 * np.diff(charge)))
