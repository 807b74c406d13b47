"""The parallel damper thins (or thickens) with the rate: what the paper's conclusion suspects.

::

    eta |-------.                 eta_o below rate_eta
        |        '-._
        |            '-._         slope thinning on double logarithmic axes
        +----------------- log |d(lambda_1)/dt|

Equation: eta = eta_o (1 + (d(lambda_1)/dt / rate_eta)^2)^(thinning / 2): Carreau's law with n = 1 + thinning.

Source: Carreau, "Rheological equations from molecular network theories", Trans. Soc. Rheol. 16 (1972) 99.

Typical: thinning -0.2 to -0.6 from 0.1 1/s on.
"""

from sympy import exp, log

from ...model.change import scaled
from ...model.declare import Model, Quantity
from ...model.effect import Effect

PARAMETERS = (
    Quantity(
        "thinning",
        "1",
        "Exponent of the damper's viscosity over the rate; below 0 it thins",
        0.0,
        "Carreau 1972",
        -0.99,
        1.0,
    ),
    Quantity(
        "rate_eta", "1/s", "Rate of lambda_1 from which on the viscosity changes", 0.1, "Carreau 1972", 1e-4, 1e3, 0.1
    ),
)


def _apply(model: Model) -> Model:
    speed = model["dlambda_1_dlambda_2"] * model["lambda_2_rate"] / model["rate_eta"]
    return scaled(model, "sigma_eta", exp(model["thinning"] / 2 * log(1 + speed**2)))


EFFECT = Effect(
    "rate_dependent_viscosity",
    "mechanical",
    "The damper thins or thickens with the rate",
    _apply,
    PARAMETERS,
    off={"thinning": 0.0},
    typical={"thinning": -0.4, "rate_eta": 0.1},
    shapes={"rate_eta": (0.003, 0.03, 0.3)},
)
