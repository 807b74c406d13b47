"""Signals at which effects act: those that the base model does not distinguish get a name of their own.

Each function returns the model with that signal; where it is there already, the model itself. Effects that act on
one signal form a chain: each takes the expression of the signal as it finds it.
"""

from __future__ import annotations

import sympy

from ...model.change import added, arriving, reading, tapped
from ...model.declare import Definition, Model, Quantity


def electrodes(model: Model) -> Model:
    """`electrode_voltage` and its rate: what reaches the layers; `capacitance_rate` for the current."""
    if "capacitance_rate" in model.quantities():
        return model
    model = arriving(model, "voltage", "electrode_voltage")
    slope = Quantity("capacitance_rate", "F/s", "Rate of the capacitance", nominal=1e-8)
    capacitance, voltage, moving = (model[n] for n in ("capacitance", "electrode_voltage", "electrode_voltage_rate"))
    model = model.extend(definitions=[Definition(slope, 2 * capacitance * area_growth(model))], before="current")
    return model.replace("current", capacitance * moving + voltage * slope.symbol)


def area_growth(model: Model) -> sympy.Expr:
    """The rate of the layers' area, as a share of it [1/s]."""
    return (model["dlambda_1_dlambda_2"] / model["lambda_1"] + 1 / model["lambda_2"]) * model["lambda_2_rate"]


def dielectric(model: Model) -> Model:
    """`active_field` (what polarises the elastomer) and `eps_effective` (its relative permittivity)."""
    model = electrodes(model)
    seen = Quantity("active_field", "V/m", "Field that polarises the elastomer", nominal=5e7, display_unit="V/um")
    effective = Quantity("eps_effective", "1", "Relative permittivity in the present state")
    first = ("eps_effective",) if effective.name in model.quantities() else ()  # a drift of it may be there already
    model = tapped(model, seen, model["electric_field"], (*first, "sigma_maxwell"))
    return tapped(model, effective, model["eps_r"], ("sigma_maxwell", "capacitance"))


def elastic_stretches(model: Model) -> Model:
    """`lambda_1_elastic` to `lambda_3_elastic`: the stretches that the elastomer's energy is a function of."""
    if "lambda_2_elastic" in model.quantities():
        return model
    one, two, three = (Quantity(f"lambda_{i}_elastic", "1", f"Elastic stretch {i}") for i in (1, 2, 3))
    model = tapped(model, three, model["lambda_3"], ("I_1", "sigma_m", "sigma_hoop"))
    model = tapped(model, one, model["lambda_1"], ("lambda_3_elastic", "I_1", "sigma_m"))
    model = tapped(model, two, model["lambda_2"], ("lambda_3_elastic", "I_1", "sigma_hoop"))
    return model.replace(three.name, 1 / (one.symbol * two.symbol))


def wall_pressure(model: Model) -> Model:
    """`wall_pressure` (the pressure on the wall) and, at rest, `wall_pressure_held`."""
    return arriving(model, "pressure", "wall_pressure")


def sensor(model: Model) -> Model:
    """`sensor_signal`: what the sensor makes of the displacement, before any delay."""
    return reading(model, "measured_displacement", "sensor_signal")


def pushed(model: Model, pressure: sympy.Expr) -> Model:
    """A radial pressure against the wall's stretching, in the equation of motion and at rest alike."""
    names = [d.quantity.name for d in model.definitions]
    surface = model["A_3"] if names.index("A_3") < names.index("F_cir") else model.expression("A_3")
    return added(model, "F_cir", pressure * surface)
