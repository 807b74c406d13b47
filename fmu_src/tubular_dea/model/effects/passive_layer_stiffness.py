"""Passive layers and electrodes, stiffer than the elastomer, carry part of the hoop stress.

Equation: sigma_hoop += mu_passive (lambda_2^2 - 1 / lambda_2), sigma_m += passive_axial mu_passive
(lambda_1^2 - 1 / lambda_1): neo-Hookean strips. Layers alike in both directions would only change C_1.

Source: Rosset and Shea, "Flexible and stretchable electrodes for dielectric elastomer actuators", Appl. Phys. A 110
(2013) 281, on the stiffness that electrodes add.

Typical: 5 to 50 kPa.
"""

from ..declare import Model, Quantity
from . import Effect
from ._signals import added

PARAMETERS = (
    Quantity("mu_passive", "Pa", "Shear modulus of the passive layers, over the whole wall", 0.0, "Rosset 2013", -2e5,
             1e7, 2e4, "kPa"),
    Quantity("passive_axial", "1", "Share of it along the generatrix", 0.0, "Rosset 2013", -1.0, 10.0),
)


def _apply(model: Model) -> Model:
    mu, one, two = model["mu_passive"], model["lambda_1"], model["lambda_2"]
    model = added(model, "sigma_m", model["passive_axial"] * mu * (one**2 - 1 / one))
    return added(model, "sigma_hoop", mu * (two**2 - 1 / two))


EFFECT = Effect(
    "passive_layer_stiffness", "mechanical", "Passive layers carry part of the hoop stress", _apply, PARAMETERS,
    off={"mu_passive": 0.0}, typical={"mu_passive": 2e4, "passive_axial": 0.0}, refine=("passive_axial",),
)  # fmt: skip
