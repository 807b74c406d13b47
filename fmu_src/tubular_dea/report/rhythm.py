"""What a run of the assisted heart shows over time, as panels: rhythm with its pulses, pressures, tube, energies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..cosim.beats import r_wave_rows
from ..cosim.course import Course
from ..cosim.master import Run
from ..model.units import factor
from .colours import COLOURS

SHOWN_BEATS = 3  # where all of them are alike
ABOUT = 3  # beats shown before and after one that was refused
MMHG, ML, MICRO = factor("Pa", "mmHg"), factor("m3", "mL"), 1e-6
GREY, DARK = "#9aa5b1", "#1b2733"


@dataclass(frozen=True)
class Trace:
    """Values over time, and how they are drawn: a line, or marks at points."""

    time: np.ndarray
    values: np.ndarray
    colour: str
    width: float = 2.0
    dash: bool = False
    mark: str = ""  # "", "triangle" or "cross"


@dataclass(frozen=True)
class Panel:
    """One axis: label with unit, curves by legend name, and spans (begin, end) that are shaded, with their name."""

    label: str
    curves: dict[str, Trace]
    spans: list[tuple[float, float]] = field(default_factory=list)
    spans_name: str = ""


def window(assisted: Run, course: Course) -> tuple[float, float]:
    """The time [s] worth showing: about the first refused beat, or the last beats."""
    rows = r_wave_rows(assisted)
    refused = [i for i, f in enumerate(course.fates) if f not in ("assisted", "learning")]
    if refused and len(refused) < len(course.fates) - course.fates.count("learning"):
        first, last = max(0, refused[0] - ABOUT), min(rows.size - 1, refused[0] + 1 + ABOUT)
    else:
        first, last = max(0, rows.size - 1 - SHOWN_BEATS), rows.size - 1
    return float(assisted.time[rows[first]]), float(assisted.time[rows[last]])


def panels(
    runs: Mapping[str, Run],
    span: tuple[float, float],
    limits: Mapping[str, float],
    ecg: tuple[np.ndarray, np.ndarray] | None = None,
) -> list[Panel]:
    """All panels over `span` [s]. `runs`: the first without assist; `limits` by variable; `ecg`: time [s], signal."""
    assisted = list(runs.values())[-1]
    pulses = [(max(a, span[0]), min(b, span[1])) for a, b in pulse_times(assisted) if b > span[0] and a < span[1]]
    pressures = _curves(runs, span, "heart.aortic_pressure", MMHG, "aortic, ")
    pressures |= _curves(runs, span, "heart.ventricular_pressure", MMHG, "ventricular, ", 1.0)
    whose = "pulse" if len(runs) == 2 else f"pulse, {list(runs)[-1]}"
    made = [_rhythm(assisted, span, (pulses, whose), ecg), Panel("pressure [mmHg]", pressures, pulses, whose)]
    for label, variable, scale in (
        ("displacement [mm]", "tube.radial_displacement", 1e3),
        ("tube flow [mL/s]", "tube.tube_flow", ML),
        ("voltage [kV]", "tube.voltage", 1e-3),
        ("field [V/um]", "tube.electric_field", MICRO),
        ("margin to snap-through [mmHg]", "tube.snap_through_margin", MMHG),
    ):
        curves = _curves(runs, span, variable, scale)
        limit = limits.get(variable.partition(".")[2])
        if limit is not None:
            curves["limit"] = Trace(np.array(span), np.full(2, limit * scale), DARK, 1.0, dash=True)
        made.append(Panel(label, curves))
    return [*made, Panel("energy [mJ]", _energies(runs, span))]


def pulse_times(run: Run) -> list[tuple[float, float]]:
    """Start and end [s] of each pulse."""
    on = np.concatenate([[0], run["scheduler.on"] > 0.5, [0]]).astype(int)
    # Outputs show a step late what was decided at its start.
    at = run.time[np.concatenate([[0], np.arange(run.time.size)])]
    begin, end = np.flatnonzero(np.diff(on) == 1), np.flatnonzero(np.diff(on) == -1)
    return [(float(at[a]), float(at[b])) for a, b in zip(begin, end, strict=True)]


def voltage(run: Run) -> np.ndarray:
    """What the tube is given: of the controller, where there is one, or the scheduler [V]."""
    return run["controller.voltage"] if "controller.voltage" in run.values else run["scheduler.voltage"]


def _curves(
    runs: Mapping[str, Run],
    span: tuple[float, float],
    variable: str,
    scale: float,
    prefix: str = "",
    width: float = 2.0,
) -> dict[str, Trace]:
    curves = {}
    for number, (name, run) in enumerate(runs.items()):
        inside = (run.time >= span[0]) & (run.time <= span[1])
        values = voltage(run) if variable == "tube.voltage" else run[variable]
        colour = GREY if number == 0 else COLOURS[(number - 1) % len(COLOURS)]
        curves[prefix + name] = Trace(run.time[inside], values[inside] * scale, colour, width)
    return curves


def _rhythm(
    run: Run,
    span: tuple[float, float],
    pulses: tuple[list[tuple[float, float]], str],
    ecg: tuple[np.ndarray, np.ndarray] | None,
) -> Panel:
    """The ECG (of a heart that has none: its activation), its R waves as they were taken, and the named pulses."""
    if ecg is None:
        label, trace = "activation", (run.time, run["heart.activation"])
    else:
        label, trace = "ECG [mV]", ecg
    inside = (trace[0] >= span[0]) & (trace[0] <= span[1]) & np.isfinite(trace[1])
    time, values = trace[0][inside], trace[1][inside]
    curves = {"ECG" if ecg is not None else "ventricle": Trace(time, values, COLOURS[1], 1.2)}
    top = float(values.max()) if values.size else 1.0
    early = _counted(run, "premature_beats")
    taken = np.setdiff1d(_counted(run, "beats"), early)
    for name, at, colour, mark in (
        ("R wave", taken, COLOURS[3], "triangle"),
        ("premature R wave", early, COLOURS[2], "triangle"),
        ("rejected R wave", _counted(run, "ignored_edges"), COLOURS[0], "cross"),
    ):
        shown = at[(at >= span[0]) & (at <= span[1])]
        if shown.size:
            curves[name] = Trace(shown, np.full(shown.size, 1.12 * top), colour, mark=mark)
    return Panel(label, curves, *pulses)


def _counted(run: Run, name: str) -> np.ndarray:
    """The times [s] at which a counter of the scheduler went up."""
    return np.asarray(run.time[np.flatnonzero(np.diff(run[f"scheduler.{name}"]) > 0)])


def _energies(runs: Mapping[str, Run], span: tuple[float, float]) -> dict[str, Trace]:
    """What each assisted run has put into the electrodes and given to the blood [mJ], since the start of the time shown
    (and what the electrodes held then)."""
    curves = {}
    for number, (name, run) in enumerate(list(runs.items())[1:]):
        inside = (run.time >= span[0]) & (run.time <= span[1])
        volt, charge, given = voltage(run)[inside], run["tube.charge"][inside], run["heart.tube_work"][inside]
        put = np.concatenate([[charge[0] * volt[0] / 2], (volt[1:] + volt[:-1]) / 2 * np.diff(charge)])
        colour, time = COLOURS[number % len(COLOURS)], run.time[inside]
        curves[f"into the electrodes, {name}"] = Trace(time, np.cumsum(put) * 1e3, colour)
        curves[f"to the blood, {name}"] = Trace(time, (given[0] - given) * 1e3, colour, 1.0, dash=True)
    return curves
