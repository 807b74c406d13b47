"""The chains of the network come to their full length: the stress rises without bound (Gent).

::

    dW/dI_1 |            |
            |           .'
            |________.-'
            +-------------|-- I_1 - 3
                         J_m

Equation: dW/dI_1 += mu_gent x / (1 - x), x = (I_1 - 3) / J_m; the pole is rounded over 1 % of J_m.

Source: Gent, "A new constitutive relation for rubber", Rubber Chem. Technol. 69 (1996) 59.

Typical: mu_gent 10 to 300 kPa, J_m 1 to 10 (the tube at 25 mm has I_1 - 3 = 1.3).
"""

from sympy import Float, sqrt

from ...model.change import added
from ...model.declare import Model, Quantity
from ...model.effect import Effect

ROUNDING = Float(1e-4)
PARAMETERS = (
    Quantity("mu_gent", "Pa", "Stiffness that grows towards the limit", 0.0, "Gent 1996", -1e6, 1e8, 5e4, "kPa"),
    Quantity("J_m", "1", "Limit of I_1 - 3", 2.0, "Gent 1996", 0.05, 1e3),
)


def _apply(model: Model) -> Model:
    x = (model["I_1"] - 3) / model["J_m"]
    left = (1 - x + sqrt((1 - x) ** 2 + ROUNDING)) / 2
    return added(model, "dW_dI_1", model["mu_gent"] * x / left)


EFFECT = Effect(
    "strain_stiffening",
    "mechanical",
    "The network's stretch is limited (Gent)",
    _apply,
    PARAMETERS,
    off={"mu_gent": 0.0},
    typical={"mu_gent": 5e4, "J_m": 2.0},
    shapes={"J_m": (0.4, 0.8, 1.6, 5.0)},
)
