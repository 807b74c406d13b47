"""Several settings of the assisted heart side by side: one table, one figure."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ..cosim.beats import INDICES, shown
from ..cosim.course import SETTLED, Course
from ..cosim.master import Run
from ..files import write_atomically
from ..model.units import signed
from .assist import draw_panels, plotly_loops, plotly_panels, pressure_volume
from .figures import png
from .page import Page
from .rhythm import Panel, panels, window


def write(out: Path, runs: Mapping[str, Run], courses: Mapping[str, Course], note: str) -> list[Path]:
    """Write comparison.html and comparison.png to `out`; the first of `runs` is the one without assist."""
    page = Page("Settings of the assisted heart compared", note)
    for name, course in courses.items():
        page.text(f"{name}: {course.verdict.text}")
    page.heading(f"Means over the assisted beats from the {SETTLED} on")
    page.table(*table(courses))
    page.heading("Pressure and volume of the left ventricle")
    page.figure(plotly_loops(pressure_volume(runs, min(c.judged[-1] for c in courses.values()))), "One beat each.")
    page.heading("Beats over time")
    last, made = list(courses)[-1], beats_of(runs, courses)
    hidden = "A curve that is not seen lies below others: a click on a name hides one."
    page.figure(
        plotly_panels(made),
        f"Shaded: pulses of {last}, the last setting. {hidden} Drag to zoom, double-click to go back.",
    )
    write_atomically(out / "comparison.png", png(draw_panels(made)))
    return [page.write(out / "comparison.html"), out / "comparison.png"]


def beats_of(runs: Mapping[str, Run], courses: Mapping[str, Course]) -> list[Panel]:
    """All runs over the last beats of the last of them."""
    last = list(courses)[-1]
    return panels(runs, window(runs[last], courses[last]), {})


def table(courses: Mapping[str, Course]) -> tuple[list[str], list[list[str]]]:
    """Header, and a row for each figure: without assist, then each setting with its change."""
    header = ["mean over the assisted beats (all, if none is)", "without", *courses]
    rows = []
    first = next(iter(courses.values()))
    for figure in INDICES:
        scale, base = shown(figure), first.without.get(figure.name)
        cells = [f"{base.mean * scale:.2f}" if base else "-"]
        for course in courses.values():
            spread, change = course.assisted.get(figure.name), course.change(figure.name)
            text = f"{spread.mean * scale:.2f}" if spread else "-"
            cells.append(text + (f" ({signed(100 * change, 1)} %)" if change is not None else ""))
        rows.append([f"{figure.label} [{figure.unit}]", *cells])
    rows.append(
        [
            "beats assisted, of whole beats",
            "-",
            *(f"{c.fates.count('assisted')} of {len(c.fates)}" for c in courses.values()),
        ]
    )
    rows.append(
        ["largest field of the whole run [V/um]", "-", *(f"{c.largest_field * 1e-6:.2f}" for c in courses.values())]
    )
    return header, rows
