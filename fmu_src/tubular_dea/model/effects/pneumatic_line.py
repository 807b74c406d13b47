"""A line and a volume lie between the pressure monitor and the tube.

::

    monitor o---====== line ======---( tube )      mass of the air column, spring of the volume

Equation: d2(p_line)/dt2 = omega^2 (p - p_line) - 2 line_damping omega d(p_line)/dt, omega = line_omega;
wall_pressure = p_line. A damping far above 1 is a first-order lag of 2 line_damping / omega.

Source: Doebelin, "Measurement systems", 5th ed., on tubes and volumes in front of a transducer.

Typical: omega 20 to 300 1/s, damping 0.3 to 3.
"""

import sympy

from ..declare import Model, Quantity, State
from . import Effect
from ._signals import at_rest, at_start, filtered, wall_pressure

PARAMETERS = (
    Quantity("line_omega", "1/s", "Angular eigenfrequency of the line", 60.0, "Doebelin 2004", 1.0, 1e4, 60.0),
    Quantity("line_damping", "1", "Damping ratio of the line", 1.0, "Doebelin 2004", 0.05, 50.0),
    Quantity("line_share", "1", "Share of the pressure that comes through the line", 0.0, "Doebelin 2004", 0.0, 1.0),
)


def _apply(model: Model) -> Model:
    model = wall_pressure(model)
    drive = model.expression("wall_pressure")
    pressure = Quantity("line_pressure", "Pa", "Pressure behind the line", nominal=1e4, display_unit="mmHg")
    speed = Quantity("line_pressure_rate", "Pa/s", "Its rate", nominal=1e5)
    omega, zero = model["line_omega"], sympy.Integer(0)
    swing = omega**2 * (drive - pressure.symbol) - 2 * model["line_damping"] * omega * speed.symbol
    model = model.extend(states=[
        State(pressure, speed.symbol, at_start(model, drive), at_rest(model, drive)),
        State(speed, swing, zero, zero),
    ])  # fmt: skip
    return filtered(model, "wall_pressure", model["line_share"], pressure.symbol, "pressure_before_line")


EFFECT = Effect(
    "pneumatic_line", "pressure", "A line with mass and volume delays the pressure", _apply, PARAMETERS,
    off={"line_share": 0.0}, on={"line_share": 1.0},
    typical={"line_omega": 60.0, "line_damping": 1.0, "line_share": 1.0},
    shapes={"line_omega": (15.0, 50.0, 150.0), "line_damping": (0.4, 1.5)},
)  # fmt: skip
