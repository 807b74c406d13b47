"""The report on an assisted heart: one HTML page with figures to zoom, and the same figures as PNG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from plotly.subplots import make_subplots

from ..cosim.beats import last_beats
from ..cosim.master import Run
from ..files import write_atomically
from ..model.units import factor
from .figures import COLOURS, legend_above, png
from .page import Page

SHOWN_BEATS = 3
MMHG, ML, MICRO = factor("Pa", "mmHg"), factor("m3", "mL"), 1e-6
GREY = "#9aa5b1"
ENERGIES = {"into the electrodes": COLOURS[2], "to the blood": COLOURS[1]}

Curves = dict[str, tuple[np.ndarray, np.ndarray]]  # legend name -> (x, y)


def write(
    out: Path,
    runs: Mapping[str, Run],
    table: Sequence[tuple[str, str, str, str]],
    title: str,
    notes: Sequence[str],
    limits: Mapping[str, float],
) -> list[Path]:
    """Write report.html, pressure_volume_loops.png and beats.png to `out`; `runs` are "without assist", "with assist".

    `limits` may hold `electric_field` [V/m] and `snap_through_margin` [Pa].
    """
    page = Page(title, notes[0])
    for note in notes[1:]:
        page.text(note)
    page.heading("With and without assist")
    page.table(["the last whole beat", "without", "with", "change"], table)
    page.heading("Pressure and volume of the left ventricle")
    loops = pressure_volume(runs)
    page.figure(_plotly_loops(loops), "One beat each; the area is the stroke work.")
    panels = beats(runs, limits)
    page.heading("The last beats")
    page.figure(
        _plotly_panels(panels), "Time since the start of the beats shown. Drag to zoom, double-click to go back."
    )
    paths = [out / "pressure_volume_loops.png", out / "beats.png"]
    write_atomically(paths[0], _png_loops(loops))
    write_atomically(paths[1], _png_panels(panels))
    return [page.write(out / "report.html"), *paths]


def pressure_volume(runs: Mapping[str, Run]) -> Curves:
    """Loops of the last beat: volume [mL], pressure [mmHg]."""
    loops = {}
    for name, run in runs.items():
        rows = last_beats(run)
        loops[name] = (run["heart.ventricular_volume"][rows] * ML, run["heart.ventricular_pressure"][rows] * MMHG)
    return loops


def beats(runs: Mapping[str, Run], limits: Mapping[str, float]) -> list[tuple[str, Curves]]:
    """Panels over time [s] of the last beats: (axis label, curves)."""
    wanted = (
        ("pressure [mmHg]", "heart.aortic_pressure", MMHG, "aortic, "),
        ("displacement [mm]", "tube.radial_displacement", 1e3, ""),
        ("tube flow [mL/s]", "tube.tube_flow", ML, ""),
        ("voltage [kV]", "scheduler.voltage", 1e-3, ""),
        ("field [V/um]", "tube.electric_field", MICRO, ""),
        ("margin to snap-through [mmHg]", "tube.snap_through_margin", MMHG, ""),
    )
    panels: list[tuple[str, Curves]] = []
    for label, variable, scale, prefix in wanted:
        curves: Curves = {}
        for name, run in runs.items():
            rows = last_beats(run, min(SHOWN_BEATS, _whole_beats(run)))
            time = run.time[rows] - run.time[rows][0]
            curves[prefix + name] = (time, run[variable][rows] * scale)
            if variable == "heart.aortic_pressure":
                curves[f"ventricular, {name}"] = (time, run["heart.ventricular_pressure"][rows] * scale)
        limit = limits.get(variable.partition(".")[2])
        if limit is not None:
            curves["limit"] = (time[[0, -1]], np.full(2, limit * scale))
        panels.append((label, curves))
    panels.append(("energy [mJ]", _energies(runs["with assist"])))
    return panels


def _energies(run: Run) -> Curves:
    """What has gone into the electrodes and come out to the blood, since the start of the beats shown [mJ]."""
    rows = last_beats(run, min(SHOWN_BEATS, _whole_beats(run)))
    time = run.time[rows] - run.time[rows][0]
    voltage, charge = run["scheduler.voltage"][rows], run["tube.charge"][rows]
    electrical = np.concatenate([[0.0], np.cumsum((voltage[1:] + voltage[:-1]) / 2 * np.diff(charge))])
    given = run["heart.tube_work"][rows]
    return {
        "into the electrodes": (time, electrical * 1e3),
        "to the blood": (time, (given[0] - given) * 1e3),
    }


def _whole_beats(run: Run) -> int:
    from ..cosim.beats import r_wave_rows

    return max(1, r_wave_rows(run).size - 1)


def _style(name: str) -> tuple[str, str, float]:
    """Colour, dash and width of a curve: without assist grey, limits dashed, the ventricle thin."""
    if name in ENERGIES:
        return ENERGIES[name], "solid", 2.0
    if name == "limit":
        return "#1b2733", "dash", 1.0
    colour = COLOURS[0] if "with assist" in name else GREY
    return colour, "solid", 1.0 if name.startswith("ventricular") else 2.0


def _plotly_loops(loops: Curves) -> go.Figure:
    figure = go.Figure()
    for name, (x, y) in loops.items():
        figure.add_trace(go.Scattergl(x=x, y=y, name=name, line={"color": _style(name)[0], "width": 2}))
    figure.update_layout(xaxis_title="volume [mL]", yaxis_title="pressure [mmHg]", height=480)
    return figure


def _plotly_panels(panels: Sequence[tuple[str, Curves]]) -> go.Figure:
    figure = make_subplots(rows=len(panels), cols=1, shared_xaxes=True, vertical_spacing=0.025)
    named: set[str] = set()
    for row, (label, curves) in enumerate(panels, start=1):
        for name, (x, y) in curves.items():
            colour, dash, width = _style(name)
            figure.add_trace(
                go.Scattergl(x=x, y=y, name=name, mode="lines", showlegend=name not in named,
                             line={"color": colour, "dash": dash, "width": width}),
                row=row, col=1,
            )  # fmt: skip
        named |= set(curves)
        figure.update_yaxes(title_text=label.replace(" [", "<br>["), row=row, col=1)
    figure.update_xaxes(title_text="time [s]", row=len(panels), col=1)
    figure.update_layout(height=210 * len(panels), legend={"orientation": "h", "y": 1.005, "yanchor": "bottom"})
    return figure


def _png_loops(loops: Curves) -> bytes:
    figure = Figure(figsize=(6.5, 5), layout="constrained")
    FigureCanvasAgg(figure)
    axis = figure.subplots()
    for name, (x, y) in loops.items():
        axis.plot(x, y, color=_style(name)[0], linewidth=2, label=name)
    axis.set_xlabel("volume [mL]")
    axis.set_ylabel("pressure [mmHg]")
    axis.grid(alpha=0.3)
    axis.spines[["top", "right"]].set_visible(False)
    legend_above(axis)
    return png(figure)


def _png_panels(panels: Sequence[tuple[str, Curves]]) -> bytes:
    figure = Figure(figsize=(9, 1 + 1.6 * len(panels)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(panels), 1, sharex=True)
    named: set[str] = set()
    for axis, (label, curves) in zip(axes, panels, strict=True):
        for name, (x, y) in curves.items():
            colour, dash, width = _style(name)
            shown = None if name in named else name
            axis.plot(x, y, color=colour, linestyle="--" if dash == "dash" else "-", linewidth=width, label=shown)
        if not named >= set(curves):
            legend_above(axis)
        named |= set(curves)
        axis.set_ylabel(label.replace(" [", "\n["))
        axis.grid(alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
    axes[-1].set_xlabel("time [s]")
    return png(figure)
