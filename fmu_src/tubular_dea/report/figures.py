"""Pictures as PNG, drawn with matplotlib."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from .colours import COLOURS

LABEL_LETTERS = 22  # that fit beside a panel in one line

Panels = Sequence[tuple[str, Mapping[str, np.ndarray]]]  # of each: axis label with unit, curves by legend name


class Picture(Figure):
    """A figure without a window, which a notebook shows as it is."""

    def _repr_png_(self) -> bytes:
        return png(self)


def sized(figure: Figure | None, width: float, height: float) -> Figure:
    """A picture of that size [inches], or the caller's own figure as it is."""
    if figure is not None:
        return figure
    drawn = Picture(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(drawn)
    return drawn


def time_panels(time: np.ndarray, panels: Panels, title: str = "") -> bytes:
    """`panels_figure` as the bytes of a PNG file."""
    return png(panels_figure(time, panels, title))


def panels_figure(time: np.ndarray, panels: Panels, title: str = "", figure: Figure | None = None) -> Figure:
    """One panel under another over a common time axis [s], in `figure` if it is given."""
    figure = sized(figure, 9, 1.2 + 1.7 * len(panels))
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for number, (axis, (label, curves)) in enumerate(zip(axes, panels, strict=True)):
        for offset, (name, values) in enumerate(curves.items()):
            # One colour a name where curves are compared, one a panel where they stand alone.
            colour = COLOURS[(offset if len(curves) > 1 else number) % len(COLOURS)]
            axis.plot(time, values, color=colour, linewidth=1.5, label=name or None)
        axis.set_ylabel(textwrap.fill(label, LABEL_LETTERS))
        axis.grid(alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
        if len(curves) > 1 and (number == 0 or list(curves) != list(panels[number - 1][1])):
            legend_above(axis)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(time[0], time[-1])
    if title:
        figure.suptitle(title)
    return figure


def legend_above(axis: Axes) -> None:
    """A legend in one line above the axes, where no curve runs."""
    names = len(axis.get_legend_handles_labels()[1])
    axis.legend(
        loc="lower right", bbox_to_anchor=(1, 1), borderaxespad=0.2, ncols=min(names, 7), frameon=False, fontsize=8
    )


def png(figure: Figure) -> bytes:
    """A figure as the bytes of a PNG file, without the drawing program's version or clock in it."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=130, metadata={"Software": None})
    return buffer.getvalue()
