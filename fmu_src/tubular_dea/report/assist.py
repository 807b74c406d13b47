"""The report on an assisted heart: one HTML page with figures to zoom, and the same figures as PNG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from matplotlib.figure import Figure
from plotly.subplots import make_subplots

from ..cosim.beats import beats
from ..cosim.course import Course
from ..cosim.master import Run
from ..files import write_atomically
from .figures import png, sized
from .page import Page
from .rhythm import GREY, ML, MMHG, Panel, Trace, panels, window

HEADER = ("figure (assisted beats)", "without", "with, mean ± sd", "worst", "change")
MARKS = {"triangle": ("triangle-down", "v"), "cross": ("x", "x")}  # as plotly and as matplotlib call them
PULSE = "rgba(200, 64, 47, 0.12)"
BESIDE = 0.05  # of its span that is free on either side of a loop

Loops = dict[str, tuple[np.ndarray, np.ndarray]]


def write(
    out: Path,
    runs: Mapping[str, Run],
    course: Course,
    notes: Sequence[str],
    limits: Mapping[str, float],
    ecg: tuple[np.ndarray, np.ndarray] | None = None,
) -> list[Path]:
    """Write report.html, pressure_volume_loops.png and beats.png to `out`; `runs` are "without assist", "with assist".

    `limits` may hold `electric_field` [V/m] and `snap_through_margin` [Pa]; `ecg` is time [s] and signal [mV].
    """
    page = Page("The assisted heart", course.verdict.text)
    for note in notes:
        page.text(note)
    page.heading("With and without assist")
    page.text(f"Means over {course.judged_words}.")
    page.table(HEADER, course.rows())
    page.heading("The whole run")
    page.table(["quantity", "value"], course.counts())
    page.heading("Pressure and volume of the left ventricle")
    loops = pressure_volume(runs, course.judged[-1])
    page.figure(plotly_loops(loops), "One beat each; the area is the stroke work.")
    made = panels(runs, window(runs["with assist"], course), limits, ecg)
    page.heading("Beats over time")
    page.figure(plotly_panels(made), "Shaded: pulses. Drag to zoom, double-click to go back.")
    paths = [out / "pressure_volume_loops.png", out / "beats.png"]
    write_atomically(paths[0], png(draw_loops(loops)))
    write_atomically(paths[1], png(draw_panels(made)))
    return [page.write(out / "report.html"), *paths]


def pressure_volume(runs: Mapping[str, Run], number: int) -> Loops:
    """Loops of one beat by its number: volume [mL], pressure [mmHg]."""
    shown = {name: beats(run)[number] for name, run in runs.items()}
    return {
        name: (beat["heart.ventricular_volume"] * ML, beat["heart.ventricular_pressure"] * MMHG)
        for name, beat in shown.items()
    }


def loop_colours(names: Sequence[str]) -> dict[str, str]:
    """Grey for the first run, which has no assist; then one colour each."""
    from .colours import COLOURS

    return {name: GREY if i == 0 else COLOURS[(i - 1) % len(COLOURS)] for i, name in enumerate(names)}


def plotly_loops(loops: Loops) -> go.Figure:
    """Pressure over volume, to zoom."""
    figure, colours = go.Figure(), loop_colours(list(loops))
    for name, (x, y) in loops.items():
        figure.add_trace(go.Scatter(x=x, y=y, name=name, line={"color": colours[name], "width": 2}))
    volumes = np.concatenate([x for x, _ in loops.values()])
    room = BESIDE * float(np.ptp(volumes))  # or the sides of a loop, which are upright, lie on the frame
    figure.update_xaxes(title="volume [mL]", range=[float(volumes.min()) - room, float(volumes.max()) + room])
    return figure.update_yaxes(title="pressure [mmHg]", rangemode="tozero").update_layout(height=480)


def draw_loops(loops: Loops, figure: Figure | None = None) -> Figure:
    """Pressure over volume, as a picture, in `figure` if it is given."""
    figure = sized(figure, 7.5, 5)
    axis, colours = figure.subplots(), loop_colours(list(loops))
    for name, (x, y) in loops.items():
        axis.plot(x, y, color=colours[name], linewidth=2, label=name)
    axis.set_xlabel("volume [mL]")
    axis.set_ylabel("pressure [mmHg]")
    axis.grid(alpha=0.3)
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(loc="upper left", bbox_to_anchor=(1, 1), frameon=False, fontsize=8)
    return figure


def plotly_panels(made: Sequence[Panel]) -> go.Figure:
    """Panels over a common time, each with a legend of its own to its right, clear of the toolbar."""
    figure = make_subplots(rows=len(made), cols=1, shared_xaxes=True, vertical_spacing=0.02)
    for row, panel in enumerate(made, start=1):
        legend = "legend" if row == 1 else f"legend{row}"
        for name, curve in panel.curves.items():
            figure.add_trace(_trace(name, curve, legend), row=row, col=1)
        for number, (begin, end) in enumerate(panel.spans):
            named = {"name": panel.spans_name, "legend": legend, "showlegend": number == 0}
            figure.add_vrect(x0=begin, x1=end, fillcolor=PULSE, line_width=0, row=row, col=1, **named)
        axis = figure.layout["yaxis" if row == 1 else f"yaxis{row}"]
        placed = {"x": 1.01, "xanchor": "left", "y": axis.domain[1], "yanchor": "top", "font": {"size": 11}}
        figure.update_layout({legend: placed})
        figure.update_yaxes(title_text=panel.label.replace(" [", "<br>["), row=row, col=1)
    figure.update_xaxes(title_text="time [s]", row=len(made), col=1)
    return figure.update_layout(height=190 * len(made))


def _trace(name: str, curve: Trace, legend: str) -> go.Scatter:
    how: dict[str, object] = {
        "mode": "lines",
        "line": {"color": curve.colour, "width": curve.width, "dash": "dash" if curve.dash else "solid"},
    }
    if curve.mark:
        how = {"mode": "markers", "marker": {"color": curve.colour, "symbol": MARKS[curve.mark][0], "size": 9}}
    return go.Scatter(x=curve.time, y=curve.values, name=name, legend=legend, **how)


def draw_panels(made: Sequence[Panel], figure: Figure | None = None) -> Figure:
    """The same as a picture, in `figure` if it is given."""
    figure = sized(figure, 11, 1 + 1.6 * len(made))
    axes = figure.subplots(len(made), 1, sharex=True)
    for axis, panel in zip(axes, made, strict=True):
        for name, c in panel.curves.items():
            style = {"marker": MARKS[c.mark][1], "linestyle": ""} if c.mark else {"linestyle": "--" if c.dash else "-"}
            axis.plot(c.time, c.values, color=c.colour, linewidth=c.width, label=name, **style)
        for number, (begin, end) in enumerate(panel.spans):
            name = "" if number else panel.spans_name
            axis.axvspan(begin, end, color="#c8402f", alpha=0.1, linewidth=0, label=name)
        axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8)
        axis.set_ylabel(panel.label.replace(" [", "\n["))
        axis.grid(alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
    axes[-1].set_xlabel("time [s]")
    return figure
