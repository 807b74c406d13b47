"""The wall moves more than its own mass: fluid inside and outside, a sensor's target, leads.

Equation: m += added_mass in equation (16).

Source: Paidoussis, "Fluid-structure interactions", vol. 2: inertia of the fluid that a shell moves.

Typical: 1 to 100 g; the water inside at rest is 35 g.
"""

from ...model.change import added
from ...model.declare import Model, Quantity
from ...model.effect import Effect

PARAMETERS = (
    Quantity("added_mass", "kg", "Mass that moves with the wall", 0.0, "Paidoussis 2016", -4e-3, 100.0, 0.01, "g"),
)


def _apply(model: Model) -> Model:
    return added(model, "m", model["added_mass"])


EFFECT = Effect(
    "added_mass",
    "mechanical",
    "Fluid or a target moves with the wall",
    _apply,
    PARAMETERS,
    off={"added_mass": 0.0},
    typical={"added_mass": 0.035},
    strengths={"added_mass": (0.02, 0.03, 0.045, 0.065, 0.1, 0.14, 0.2)},
)
