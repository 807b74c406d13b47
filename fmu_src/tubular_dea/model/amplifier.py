"""The high-voltage amplifier: it follows a target with a lag, no faster than its slew rate and its current allow.

Equation: dV/dt = f tanh((V_target - V) / (f amplifier_time)), f = min(slew_rate, current_limit / load).

Citation: the limits are those of a Trek 10/10B-HS class amplifier (10 kV, 10 mA; slew rate above 1 kV/ms).
"""

from __future__ import annotations

import sympy
from sympy import Min, tanh

from .declare import Definition, Quantity, State

QUANTITIES = tuple(
    Quantity(name, unit, description, value, "", low, high, nominal=value, display_unit=display)
    for name, unit, description, value, low, high, display in (
        ("amplifier_time", "s", "Time constant of the amplifier", 5e-4, 1e-6, 1.0, "ms"),
        ("slew_rate", "V/s", "Fastest change of the voltage", 1e6, 1.0, 1e12, None),
        ("current_limit", "A", "Largest current of the amplifier", 10e-3, 1e-9, 1e3, "mA"),
    )
)
VOLTAGE = Quantity("voltage", "V", "Voltage of the amplifier", nominal=5e3, display_unit="kV")


def amplifier(load: sympy.Symbol) -> tuple[tuple[Definition, ...], State]:
    """Definitions and the state `voltage`, which follows `target_voltage`; `load` is the capacitance it charges."""
    s = {q.name: q.symbol for q in QUANTITIES}
    rate, target = sympy.Symbol("fastest", real=True), sympy.Symbol("target_voltage", real=True)
    speed = Definition(
        Quantity("fastest", "V/s", "Fastest change of the voltage: slew rate or current limit", nominal=1e6),
        Min(s["slew_rate"], s["current_limit"] / load),
    )
    change = rate * tanh((target - VOLTAGE.symbol) / (rate * s["amplifier_time"]))
    current = Definition(
        Quantity("amplifier_current", "A", "Current into the load capacitance", nominal=1e-3, display_unit="mA"),
        load * change,
    )
    return (speed, current), State(VOLTAGE, change, sympy.Integer(0), sympy.Integer(0))
