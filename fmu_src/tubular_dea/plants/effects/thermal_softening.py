"""The elastomer warms by its losses and softens (or stiffens, by rubber elasticity) as it does.

Equation: d(warmth)/dt = (E^2 / (50 V/um)^2 lambda_2^heat_stretch + heat_viscous q - warmth) / tau_thermal;
dW/dI_1 times 1 - thermal_softening warmth, where q = (sigma_eta + sigma_vis) d(lambda_1)/dt / (100 kW/m3) is the
power that the dampers and branches take up.

Source: Kleo, Moessinger, Foerster-Zuegel, Schlaak, Wallmersperger, "Numerical study of the thermal
behavior of dielectric elastomer actuators", Smart Mater. Struct. 29 (2020) 104001.

Typical: 1 to 10 % at 50 V/um within 1 to 30 s (thin walls cool fast).
"""

import sympy

from ...model.change import at_rest, scaled
from ...model.declare import Model, Quantity, State
from ...model.effect import Effect

REFERENCE = sympy.Float(5e7)  # V/m
POWER = sympy.Float(1e5)  # W/m3
PARAMETERS = (
    Quantity("thermal_softening", "1", "Loss of stiffness after long at 50 V/um", 0.0, "Kleo 2020", -0.5, 0.3, 0.05),
    Quantity("tau_thermal", "s", "Time constant of warming and cooling", 5.0, "Kleo 2020", 0.05, 1e3),
    Quantity(
        "heat_viscous", "1", "Viscous losses of 100 kW/m3 over electrical ones at 50 V/um", 0.0, "Kleo 2020", 0.0, 100.0
    ),
    Quantity(
        "heat_stretch",
        "1",
        "Exponent of the electrical losses' further growth with stretch",
        0.0,
        "Kleo 2020",
        -6.0,
        6.0,
    ),
)


def _apply(model: Model) -> Model:
    warmth = Quantity("warmth", "1", "Temperature rise over that at rest under 50 V/um")
    losses = (model["electric_field"] / REFERENCE) ** 2 * model["lambda_2"] ** model["heat_stretch"]
    friction = (model["sigma_eta"] + model["sigma_vis"]) * model["dlambda_1_dlambda_2"] * model["lambda_2_rate"] / POWER
    heating = losses + model["heat_viscous"] * friction
    cooling = (heating - warmth.symbol) / model["tau_thermal"]
    model = model.extend(states=[State(warmth, cooling, sympy.Integer(0), at_rest(model, losses))])
    return scaled(model, "dW_dI_1", 1 - model["thermal_softening"] * warmth.symbol)


EFFECT = Effect(
    "thermal_softening",
    "mechanical",
    "The elastomer warms by its losses and softens",
    _apply,
    PARAMETERS,
    off={"thermal_softening": 0.0},
    refine=("heat_viscous", "heat_stretch"),
    typical={"thermal_softening": 0.05, "tau_thermal": 5.0, "heat_viscous": 0.0, "heat_stretch": 0.0},
    shapes={"tau_thermal": (0.5, 2.0, 8.0, 30.0)},
)
