"""Passive layers and electrodes, stiffer than the elastomer, carry part of the hoop stress.

::

    sigma_hoop |      .-'  elastomer (exponent 2)
               |    .' _.-  layers (exponent 1): stiff at first, less so when stretched
               | .'.-
               +------------|-- lambda_2

Equation: sigma_hoop += 2 mu_passive / passive_exponent (lambda_2^a - lambda_2^(-a/2)), a = passive_exponent: strips
of Ogden's material. With the elastomer's own exponent, 2, they would only change C_1 to C_3, whatever they are.

Source: Ogden, "Large deformation isotropic elasticity", Proc. R. Soc. A 326 (1972) 565; Rosset and Shea, "Flexible and
stretchable electrodes for dielectric elastomer actuators", Appl. Phys. A 110 (2013) 281, on the stiffness that
electrodes add.

Typical: 5 to 50 kPa; below zero where the layers stiffen with stretch, as C_1 then has what they add at first.
"""

from ...model.change import added
from ...model.declare import Model, Quantity
from ...model.effect import Effect

PARAMETERS = (
    Quantity(
        "mu_passive",
        "Pa",
        "Shear modulus of the passive layers, over the whole wall",
        0.0,
        "Rosset 2013",
        -2e5,
        1e7,
        2e4,
        "kPa",
    ),
    Quantity("passive_exponent", "1", "Ogden's exponent of their stress", 1.0, "Ogden 1972", 0.2, 10.0),
)


def _apply(model: Model) -> Model:
    two, exponent = model["lambda_2"], model["passive_exponent"]
    return added(model, "sigma_hoop", 2 * model["mu_passive"] / exponent * (two**exponent - two ** (-exponent / 2)))


EFFECT = Effect(
    "passive_layer_stiffness",
    "mechanical",
    "Passive layers carry part of the hoop stress",
    _apply,
    PARAMETERS,
    off={"mu_passive": 0.0},
    typical={"mu_passive": 2e4, "passive_exponent": 1.0},
    refine=("passive_exponent",),
)
