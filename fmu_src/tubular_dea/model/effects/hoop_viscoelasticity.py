"""The wall is viscous in hoop direction too: the paper's dampers all act along the generatrix.

::

    sigma_hoop  o--+--/\\/\\--[ ]--+--o    k_hoop, eta = k_hoop tau_hoop
                   |             |
                   +-----[ ]-----+       eta_hoop

Equation: sigma_hoop += sigma_hoop_vis + eta_hoop d(lambda_2)/dt,
d(sigma_hoop_vis)/dt = k_hoop d(lambda_2)/dt - sigma_hoop_vis / tau_hoop.

Source: Gu, Gupta, Zhu, Zhu, "Modeling of viscoelastic electromechanical behavior in a soft dielectric elastomer
actuator", IEEE Trans. Robot. 33 (2017) 1263 (Maxwell branches in every direction).

Typical: k_hoop 20 to 100 kPa with 0.05 to 2 s; eta_hoop 0.1 to 5 kPa s.
"""

import sympy

from ..declare import Model, Quantity, State
from . import Effect
from ._signals import added

PARAMETERS = (
    Quantity("eta_hoop", "Pa.s", "Damping in hoop direction", 0.0, "Gu 2017", 0.0, 1e7, 1e3, "kPa.s"),
    Quantity("k_hoop", "Pa", "Stiffness of the Maxwell branch in hoop direction", 0.0, "Gu 2017", -1e5, 1e8, 5e4, "kPa"),
    Quantity("tau_hoop", "s", "Relaxation time of that branch", 0.3, "Gu 2017", 1e-3, 1e3),
)


def _apply(model: Model) -> Model:
    stress = Quantity("sigma_hoop_vis", "Pa", "Stress of the Maxwell branch in hoop direction", nominal=1e4,
                      display_unit="kPa")  # fmt: skip
    speed, zero = model["lambda_2_rate"], sympy.Integer(0)
    relaxing = model["k_hoop"] * speed - stress.symbol / model["tau_hoop"]
    model = model.extend(states=[State(stress, relaxing, zero, zero)])
    return added(model, "sigma_hoop", stress.symbol + model["eta_hoop"] * speed)


EFFECT = Effect(
    "hoop_viscoelasticity", "mechanical", "The wall is viscous in hoop direction too", _apply, PARAMETERS,
    off={"eta_hoop": 0.0, "k_hoop": 0.0}, typical={"eta_hoop": 1e3, "k_hoop": 5e4, "tau_hoop": 0.3},
    shapes={"tau_hoop": (0.03, 0.3, 3.0)},
)  # fmt: skip
