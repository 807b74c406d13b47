"""The region of attraction of the controller, as a picture."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..control.region import MMHG, PRESSURES, RADII, Attraction
from ..model.reduced import holdable
from .figures import png


def draw_region(reference: float, maps: dict[float, Attraction]) -> bytes:
    """A panel for each field limit (PNG)."""
    figure = Figure(figsize=(5.6 * len(maps), 5), layout="constrained")
    FigureCanvasAgg(figure)
    fine = np.linspace(RADII[0] - 5e-4, RADII[-1] + 5e-4, 200)
    for axis, (field, found) in zip(figure.subplots(1, len(maps), squeeze=False)[0], maps.items(), strict=True):
        p, r = np.meshgrid(PRESSURES / MMHG, RADII * 1e3, indexing="ij")
        for reached, colour, name in ((True, "#3a7d44", "reached"), (False, "#c8402f", "not reached")):
            shown = found.reached == reached
            axis.scatter(p[shown], r[shown], c=colour, s=40, label=name)
        bounds = np.array([holdable(float(x), field) for x in fine]) / MMHG
        axis.plot(bounds[:, 1], fine * 1e3, color="#1b2733", label="rests without voltage")
        axis.plot(bounds[:, 0], fine * 1e3, color="#1b2733", linestyle="--", label="rests at the field limit")
        axis.axhline(reference * 1e3, color="#2a6f97", linewidth=1)
        axis.set_title(f"reference {reference * 1e3:g} mm, field limit {field * 1e-6:g} V/um", fontsize=10)
        axis.set_xlabel("pressure [mmHg]")
        axis.set_ylabel("radius at the start [mm]")
        axis.set_xlim(55, 185)
        axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=4, frameon=False, fontsize=8)
    return png(figure)
