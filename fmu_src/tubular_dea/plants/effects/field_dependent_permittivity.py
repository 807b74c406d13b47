"""The permittivity changes with the field: saturation, or more polarisation near breakdown.

Equation: eps = eps_r (1 + eps_field x^2 (1 + eps_saturation) / (1 + eps_saturation x^2)), x = E / (100 V/um): the
secant D / E, so that the Maxwell stress stays E D. However soon it levels off, eps_field is the change at 100 V/um.

Source: Tagarielli, Hildick-Smith, Huber, "Electro-mechanical properties and electrostriction response of a rubbery
polymer for EAP applications", Int. J. Solids Struct. 49 (2012) 3409.

Typical: -0.1 to -0.3 at 100 V/um.
"""

import sympy

from ...model.change import added, scaled
from ...model.declare import Model, Quantity
from ...model.effect import Effect
from ._signals import area_growth, dielectric

REFERENCE = sympy.Float(1e8)  # V/m
PARAMETERS = (
    Quantity("eps_field", "1", "Change of the permittivity at 100 V/um", 0.0, "Tagarielli 2012", -0.8, 3.0, 0.1),
    Quantity("eps_saturation", "1", "Levelling off of that change", 0.0, "Tagarielli 2012", 0.0, 20.0),
)


def _apply(model: Model) -> Model:
    model = dielectric(model)
    x = model["active_field"] / REFERENCE
    levelled = (1 + model["eps_saturation"] * x**2) / (1 + model["eps_saturation"])
    factor = 1 + model["eps_field"] * x**2 / levelled
    model = scaled(model, "eps_effective", factor)
    area_over_thickness = model["lambda_1"] * model["lambda_2"] / model["h_ao"]
    field_rate = model["active_field"] * area_growth(model) + model["electrode_voltage_rate"] * area_over_thickness
    slope = 2 * model["eps_field"] * x / (levelled**2 * (1 + model["eps_saturation"]))
    change = slope * field_rate / REFERENCE
    return added(model, "capacitance_rate", model["capacitance"] * change / factor)


EFFECT = Effect(
    "field_dependent_permittivity",
    "electrical",
    "The permittivity changes with the field",
    _apply,
    PARAMETERS,
    off={"eps_field": 0.0},
    typical={"eps_field": -0.2, "eps_saturation": 0.0},
    refine=("eps_saturation",),
)
