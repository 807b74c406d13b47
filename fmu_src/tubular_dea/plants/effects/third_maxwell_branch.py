"""A third relaxation time beside the two of Table III.

::

    sigma_vis  o--+--/\\/\\--[ ]--+--o   k_1, eta_1
                  +--/\\/\\--[ ]--+      k_2, eta_2
                  +--/\\/\\--[ ]--+      k_3, eta_3 = k_3 tau_3

Equation: sigma_vis += k_3 e, de/dt = d(lambda_1)/dt - e / tau_3, with e the strain of the branch's spring.

Source: equations (9) and (10) of the paper with j = 3, which its conclusion mentions.

Typical: k_3 0.5 to 10 MPa with tau_3 0.02 to 30 s (Table III has 0.33 and 2.7 s).
"""

import sympy

from ...model.change import added
from ...model.declare import Model, Quantity, State
from ...model.effect import Effect

PARAMETERS = (
    Quantity("k_3", "Pa", "Stiffness of Maxwell branch 3", 0.0, "Eq. (10)", -1e6, 1e9, 2e6, "MPa"),
    Quantity("tau_3", "s", "Relaxation time of Maxwell branch 3", 0.05, "Eq. (10)", 1e-3, 1e3),
)


def _apply(model: Model) -> Model:
    strain = Quantity("branch_3_strain", "1", "Strain of the spring of Maxwell branch 3", nominal=0.01)
    stretching, zero = model["dlambda_1_dlambda_2"] * model["lambda_2_rate"], sympy.Integer(0)
    relaxing = stretching - strain.symbol / model["tau_3"]
    model = model.extend(states=[State(strain, relaxing, zero, zero)])
    return added(model, "sigma_vis", model["k_3"] * strain.symbol)


EFFECT = Effect(
    "third_maxwell_branch",
    "mechanical",
    "A third relaxation time",
    _apply,
    PARAMETERS,
    off={"k_3": 0.0},
    typical={"k_3": 4e6, "tau_3": 0.05},
    shapes={"tau_3": (0.01, 0.05, 1.0, 10.0)},
)
