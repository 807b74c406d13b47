"""Pictures as PNG, drawn with matplotlib."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

COLOURS = ("#c8402f", "#2a6f97", "#e8a200", "#3a7d44", "#7b4f9d", "#5b6b7a")


def time_panels(time: np.ndarray, panels: Sequence[tuple[str, Mapping[str, np.ndarray]]], title: str = "") -> bytes:
    """One panel under another over a common time axis [s]: (axis label with unit, curves by legend name)."""
    figure = Figure(figsize=(9, 1.2 + 1.7 * len(panels)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for number, (axis, (label, curves)) in enumerate(zip(axes, panels, strict=True)):
        for offset, (name, values) in enumerate(curves.items()):
            # One colour a name where curves are compared, one a panel where they stand alone.
            colour = COLOURS[(offset if len(curves) > 1 else number) % len(COLOURS)]
            axis.plot(time, values, color=colour, linewidth=1.5, label=name or None)
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
        if len(curves) > 1:
            place = {"loc": "lower right", "bbox_to_anchor": (1, 1), "ncols": len(curves)}  # above, off the curves
            axis.legend(frameon=False, fontsize=8, borderaxespad=0.2, **place)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(time[0], time[-1])
    if title:
        figure.suptitle(title)
    return png(figure)


def png(figure: Figure) -> bytes:
    """A figure as the bytes of a PNG file, without the drawing program's version or clock in it."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=130, metadata={"Software": None})
    return buffer.getvalue()
