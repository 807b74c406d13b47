"""The controller's region of attraction: simulated, predicted from equilibria, and drawn.

At a pressure p and a radius R the tube can be driven outwards if the voltage at the field limit balances less than p,
and inwards if zero voltage balances more than p: `holdable` gives both pressures. Between them every radius can be
held. From a start outside the reference the tube returns if it moves inwards without voltage; near the bounds it does
so slowly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tubular_dea.control.rig import Bench, TubeController, experiment
from tubular_dea.model.reduced import holdable
from tubular_dea.progress import progress_bar
from tubular_dea.report.figures import png

MMHG = 133.322
PRESSURES, RADII = np.arange(60.0, 181.0, 10.0) * MMHG, np.arange(16e-3, 28.1e-3, 1e-3)
STOP, BAND = 3.0, 100e-6  # s, m: reached is within the band at the end


@dataclass(frozen=True)
class Attraction:
    """`reached` over (pressure, start radius), and what is `expected` from equilibria."""

    reached: np.ndarray
    expected: np.ndarray

    @property
    def surprises(self) -> int:
        """Points at which the two differ."""
        return int(np.sum(self.reached != self.expected))


def attraction(reference: float, field: float) -> Attraction:
    """Every start of the map: at rest at a radius, released under a constant pressure with the controller on."""
    reached = np.zeros((PRESSURES.size, RADII.size), bool)
    expected = np.zeros_like(reached)
    low, high = holdable(reference, field)
    with progress_bar(total=reached.size, unit="run", desc=f"{field * 1e-6:g} V/um") as bar:
        for i, pressure in enumerate(PRESSURES):
            for j, radius in enumerate(RADII):
                reached[i, j] = _reaches(float(pressure), float(radius), reference, field)
                inwards = radius <= reference or pressure < holdable(float(radius), field)[1]
                expected[i, j] = low < pressure < high and inwards
                bar.update()
    return Attraction(reached, expected)


def _reaches(pressure: float, radius: float, reference: float, field: float) -> bool:
    controller = TubeController({"field_limit": field, "largest_radius": 32e-3}, ["mode"])
    record = experiment(Bench(lambda t: pressure, lambda t: reference, radius), controller, STOP)
    controller.close()
    return bool(abs(record.error[-1]) < BAND)


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
