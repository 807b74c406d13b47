"""A radius to hold during pulses, if the tube can be held there; and how well it was."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import ArgumentError
from ..model.reduced import holdable
from ..model.tube_controller import REFERENCE, tube_controller
from ..model.units import factor
from .heart_assist import controller_field
from .master import Run

RADIUS = "controller.reference_radius"
FIELD = "controller.field_limit"
TIME_CONSTANTS = 3  # of the closed loop, after which 5 % of an error are left: the convention for a settled one
BY_FIELD, AT_NO_VOLTAGE = 1, 2  # controller.limited


@dataclass(frozen=True)
class Held:
    """How well `radius` [m] was held in the pulses.

    From `rise` [s] after the start of each on (the longest): `largest` [m], the deviation of the largest size, negative
    where it is below, and `rms` [m], over the time. Of the whole pulses: `below`, the share of their time in which the
    limit of the field, `field` [V/m], held the tube below the radius, and `above`, that in which it was above although
    it had no voltage.
    """

    radius: float
    field: float
    rise: float
    largest: float
    rms: float
    below: float
    above: float

    @property
    def text(self) -> str:
        """All of it in words."""
        side = "below" if self.largest < 0 else "above"
        beyond = f"{1e3 * abs(self.largest):.2g} mm ({side}), {1e3 * self.rms:.2g} mm rms"
        said = (
            f"The radius to hold was {_mm(self.radius)} mm: from {1e3 * self.rise:.0f} ms after the start of a pulse "
            f"on, the largest deviation from it was {beyond}."
        )
        if self.below:
            held = (
                f"{1e-6 * self.field:.3g} V/um held the tube below it in {100 * self.below:.2g} % of the pulses' time"
            )
            said += f" The field limit of {held}."
        if self.above:
            said += f" In {100 * self.above:.2g} % of the pulses' time it was above, with no voltage left to take away."
        return said if self.below or self.above else f"{said} No limit kept the tube from it."


def held_radius(radius: float, settings: Mapping[str, float], without: Run) -> dict[str, float]:
    """The settings that hold `radius` [m] below the scheduler's field limit; an error where that is impossible.

    `without`: the run without assist, whose aortic pressures the tube has to be held against.
    """
    field = settings.get(FIELD, controller_field(settings))
    if not REFERENCE.allows(radius):
        raise ArgumentError(
            "controller",
            f": expected {_mm(REFERENCE.minimum)} to {_mm(REFERENCE.maximum)} mm but was given {_mm(radius)} mm",
        )
    low, high = holdable(radius, field)
    pressure = without["heart.aortic_pressure"]
    if low > pressure.max() or high < pressure.max():
        mmhg = factor("Pa", "mmHg")
        raise ArgumentError(
            "controller",
            f": {_mm(radius)} mm is outside the reachable set: below {field * 1e-6:.0f} V/um the tube is "
            f"held there under {low * mmhg:.0f} to {high * mmhg:.0f} mmHg, but this patient's systole reaches "
            f"{pressure.max() * mmhg:.0f} mmHg",
        )
    return {RADIUS: radius, FIELD: field}


def how_held(run: Run, settings: Mapping[str, float]) -> Held | None:
    """How well the radius in the `settings` was held in the run; None where no pulse was long enough to get there."""
    on, radius = run["scheduler.on"] > 0.5, settings[RADIUS]
    begins = np.flatnonzero(np.diff(on.astype(int), prepend=0) == 1)
    if not begins.size:
        return None
    start = begins[np.maximum(np.searchsorted(begins, np.arange(on.size), side="right") - 1, 0)]
    rise = _rise(np.abs(radius - run["tube.radius"][start]), settings)
    error, limited = run["tube.radius"] - radius, run["controller.limited"]
    span = np.diff(run.time, append=run.time[-1])
    there = on & (run.time - run.time[start] >= rise) & (span > 0)
    if not there.any():
        return None
    return Held(
        radius,
        settings[FIELD],
        float(rise[there].max()),
        float(error[there][np.argmax(np.abs(error[there]))]),
        float(np.sqrt(np.average(error[there] ** 2, weights=span[there]))),
        float(np.average((limited == BY_FIELD) & (error < 0), weights=span * on)),
        float(np.average((limited == AT_NO_VOLTAGE) & (error > 0), weights=span * on)),
    )


def _rise(distance: np.ndarray, settings: Mapping[str, float]) -> np.ndarray:
    """The time [s] that the controller takes over a distance [m]: its reference's, and until the tube has followed."""
    declared = {f"controller.{name}": value for name, value in tube_controller().parameter_values().items()}
    known = {**declared, **settings}
    gain = known["controller.tracking_gain"]
    return distance / known["controller.reference_rate"] + (TIME_CONSTANTS / gain if gain else math.inf)


def _mm(radius: float | None) -> str:
    return f"{1e3 * (radius or 0.0):g}"
