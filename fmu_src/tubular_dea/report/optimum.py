"""The best pulse for a patient: the map of all timings with the optimum and the default, and the benefit."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from matplotlib.figure import Figure
from matplotlib.patheffects import AbstractPathEffect, withStroke

from ..control.optimum import ALIKE, BEGINS, ENDS, LATE, OBJECTIVES, Optimum, Pulse
from ..cosim.course import Course
from ..cosim.master import Run
from ..files import write_atomically
from ..model.units import signed
from .assist import plotly_loops, plotly_panels, pressure_volume
from .compare import table
from .figures import png, sized
from .page import Page
from .rhythm import panels, window

OUTLINE: list[AbstractPathEffect] = [
    withStroke(linewidth=3, foreground="#1b2733")
]  # of names, which stand on any colour
ROBUSTNESS = ("disturbed", "change", "limits of field and margin")


def write(out: Path, best: Optimum, runs: Mapping[str, Run], courses: Mapping[str, Course], command: str) -> list[Path]:
    """Write optimum.html and optimum.png to `out`."""
    page = Page("The best pulse", sentence(best, courses["default"]))
    page.text("To run it:")
    page.lines(command, drawing=True)
    page.heading("Every timing, each at its best voltage within the limits")
    page.figure(_plotly_map(best), _map_words(best))
    page.heading("Sensitivity to disturbances")
    page.text(
        f"Of pulses that gain alike (within {100 * ALIKE:g} %), even if they end {1e3 * LATE:g} ms later, the one that "
        "begins last is taken: one that begins earlier may gain as little as that more."
    )
    page.table(ROBUSTNESS, robustness(best))
    page.heading("The optimum and the default, as the scheduler runs them")
    page.table(*table(courses))
    page.figure(plotly_loops(pressure_volume(runs, min(c.judged[-1] for c in courses.values()))), "One beat each.")
    made = panels(runs, window(runs["optimum"], courses["optimum"]), {})
    page.figure(plotly_panels(made), "Shaded: pulses of the optimum.")
    write_atomically(out / "optimum.png", png(draw_map(best)))
    return [page.write(out / "optimum.html"), out / "optimum.png"]


def sentence(best: Optimum, default: Course) -> str:
    """The optimum in words, beside the default pulse as the scheduler ran it."""
    begin, end = 1e3 * best.pulse.begin * best.period, 1e3 * best.pulse.end * best.period
    words, place = OBJECTIVES[best.objective][1], "before" if best.ahead < 0 else "after"
    return (
        f"The best pulse is {best.pulse.voltage / 1e3:.2f} kV from {begin:.0f} to {end:.0f} ms after the R wave, "
        f"starting {abs(1e3 * best.ahead):.0f} ms {place} ejection would begin without it: {words} changes by "
        f"{signed(100 * best.gain, 1)} % at {best.figures['largest_field'] * 1e-6:.1f} V/um "
        f"(the default: {signed(100 * best.default_gain, 1)} %{_vetoed(default)})."
    )


def _vetoed(course: Course) -> str:
    """How often the scheduler refuses a pulse, in words; empty where it never does."""
    vetoed = course.fates.count("vetoed")
    return f" if it were run, but the scheduler vetoes it in {vetoed} of {len(course.fates)} beats" if vetoed else ""


def _map_words(best: Optimum) -> str:
    return (
        f"Change of {OBJECTIVES[best.objective][1]} [%], of the pulse or of one that ends {1e3 * LATE:g} ms later, "
        "whichever is worse, at the best of a few voltages: the pulse alone may gain more. Empty: the pulse would end "
        "before it starts, be too short or too long, or no voltage meets the limits. The optimum is "
        "between the cells' timings and voltages, and may gain more than any of them. The default is marked at its "
        "timing; its "
        f"voltage is {best.default.voltage / 1e3:g} kV."
    )


def robustness(best: Optimum) -> list[list[str]]:
    """Rows (disturbance, change of the objective, whether limits are met)."""
    return [[c.what, f"{signed(100 * c.gain, 2)} %", "met" if c.within else "exceeded"] for c in best.robustness]


def _marks(best: Optimum) -> list[tuple[str, Pulse, str, str]]:
    """Name, pulse and symbol (as plotly and as matplotlib call it)."""
    return [("optimum", best.pulse, "star", "*"), ("default", best.default, "circle", "o")]


def _plotly_map(best: Optimum) -> go.Figure:
    scale = 1e3 * best.period
    outlined = {"color": "white", "size": 13, "shadow": "1px 1px 2px black, -1px -1px 2px black"}
    grid = go.Heatmap(
        x=BEGINS * scale, y=ENDS * scale, z=100 * best.gains.T, colorscale="Viridis_r", colorbar={"title": "%"}
    )
    figure = go.Figure(grid)
    for name, pulse, symbol, _ in _marks(best):
        marker = {"symbol": symbol, "size": 15, "color": "#c8402f", "line": {"color": "white", "width": 1}}
        figure.add_trace(
            go.Scatter(
                x=[pulse.begin * scale],
                y=[pulse.end * scale],
                mode="markers+text",
                text=[name],
                textposition="top center",
                textfont=outlined,
                name=name,
                marker=marker,
                showlegend=False,
            )
        )
    figure.add_vline(x=1e3 * best.without["ejection_begins"], line_dash="dash")
    figure.update_xaxes(title="start of the pulse after R [ms]; dashed: ejection begins")
    return figure.update_yaxes(title="end of the pulse after R [ms]").update_layout(height=520)


def draw_map(best: Optimum, figure: Figure | None = None) -> Figure:
    """The map as a picture, in `figure` if it is given."""
    figure = sized(figure, 8, 6)
    axis = figure.subplots()
    scale = 1e3 * best.period
    image = axis.pcolormesh(BEGINS * scale, ENDS * scale, np.ma.masked_invalid(100 * best.gains.T), cmap="viridis_r")
    figure.colorbar(image, label=f"change of {OBJECTIVES[best.objective][1]} [%]")
    for name, pulse, _, symbol in _marks(best):
        place = (pulse.begin * scale, pulse.end * scale)
        axis.plot(*place, symbol, color="#c8402f", markersize=14, markeredgecolor="white")
        beside = axis.annotate(name, place, xytext=(8, 8), textcoords="offset points", color="white", weight="bold")
        beside.set_path_effects(OUTLINE)
    begins = 1e3 * best.without["ejection_begins"]
    axis.axvline(begins, color="#1b2733", linestyle="--", linewidth=1)
    axis.text(begins + 3, axis.get_ylim()[0] + 8, "ejection begins", rotation=90, va="bottom", color="#1b2733")
    axis.set_xlabel("start of the pulse after R [ms]")
    axis.set_ylabel("end of the pulse after R [ms]")
    axis.set_title(
        f"Best of a few voltages within the limits at every timing; optimum {best.pulse.voltage / 1e3:.2f} kV"
    )
    return figure
