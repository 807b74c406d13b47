"""A radius to hold during pulses, if the tube can be held there."""

from __future__ import annotations

from collections.abc import Mapping

from ..errors import ArgumentError
from ..model.reduced import holdable
from ..model.tube_controller import REFERENCE
from ..model.units import factor
from .heart_assist import controller_field
from .master import Run

RADIUS = "controller.reference_radius"
FIELD = "controller.field_limit"


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


def _mm(radius: float | None) -> str:
    return f"{1e3 * (radius or 0.0):g}"
