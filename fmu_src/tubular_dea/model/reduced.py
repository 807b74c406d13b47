"""The tube without the inertia of its wall, as pressures: elastic, electric, of the Maxwell branches, of the damper.

Equation (16) at rest gives the pressure that balances the wall, `equilibrium_pressure`; it is linear in the rate of the
stretch, in the stresses of the branches and in the square of the voltage. Its parts are taken from the declaration.
"""

from __future__ import annotations

from functools import cache

import sympy

from .dea import tubular_dea
from .declare import Model

# name -> unit, description, nominal
PARTS = {
    "elastic": ("Pa", "Pressure that holds the wall at rest without voltage", 1e4),
    "electric": ("Pa/V2", "Pressure of the voltage, of its square", 1e-4),
    "share": ("1", "Pressure of a branch's stress, of that", 1e-2),
    "damping": ("Pa.s", "Pressure of the damper, of the rate of the stretch", 1e3),
    "along": ("1", "Slope of lambda_1 over lambda_2", 0.1),
    "field_share": ("1/m", "Field, of the voltage", 1e4),
    "capacity": ("F", "Capacitance", 1e-8),
}


@cache
def reduced() -> dict[str, sympy.Expr]:
    """Each of `PARTS` as an expression in lambda_2 and the tube's parameters."""
    tube = tubular_dea()
    balance = expanded(tube, "equilibrium_pressure")
    rate, volt = tube["lambda_2_rate"], tube["voltage"]
    stress_1, stress_2 = tube["sigma_vis1"], tube["sigma_vis2"]
    still = {rate: 0, stress_1: 0, stress_2: 0}
    parts = {
        "elastic": balance.xreplace({**still, volt: sympy.Integer(0)}),
        "electric": -sympy.diff(balance, volt, 2).xreplace(still) / 2,
        "share": sympy.diff(balance, stress_1),
        "damping": sympy.diff(balance, rate),
        "along": expanded(tube, "dlambda_1_dlambda_2"),
        "field_share": sympy.diff(expanded(tube, "electric_field"), volt),
        "capacity": expanded(tube, "capacitance"),
    }
    return {name: sympy.sympify(e).xreplace({k: sympy.Integer(0) for k in (*still, volt)}) for name, e in parts.items()}


def holdable(radius: float, field: float) -> tuple[float, float]:
    """Least and largest pressure [Pa] under which the tube can be held at `radius` [m] below `field` [V/m]."""
    values = tubular_dea().parameter_values()
    at = {**values, "lambda_2": radius / values["r_o"]}
    elastic, electric, share = (
        float(reduced()[n].subs({s: at[str(s)] for s in reduced()[n].free_symbols}))
        for n in ("elastic", "electric", "field_share")
    )
    return elastic - electric * (field / share) ** 2, elastic


def expanded(model: Model, name: str) -> sympy.Expr:
    """A definition in states, inputs and parameters alone."""
    definitions = {d.quantity.symbol: sympy.sympify(d.expression) for d in model.definitions}
    expression = definitions[model[name]]
    while inner := expression.free_symbols & definitions.keys():
        expression = expression.xreplace({s: definitions[s] for s in inner})
    return expression
