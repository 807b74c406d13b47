"""The controller's region of attraction: simulated, and predicted from equilibria.

At a pressure p and a radius R the tube can be driven outwards if the voltage at the field limit balances less than p,
and inwards if zero voltage balances more than p: `holdable` gives both pressures. Between them every radius can be
held. From a start outside the reference the tube returns if it moves inwards without voltage; near the bounds it does
so slowly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.reduced import holdable
from ..progress import progress_bar
from .rig import Bench, TubeController, experiment

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
