"""The wall is viscous in hoop direction too: the paper's dampers all act along the generatrix.

::

    sigma_hoop  o--+--/\\/\\--[ ]--+--o    k_hoop, eta = k_hoop tau_hoop
                   |             |
                   +-----[ ]-----+       eta_hoop

Equation: sigma_hoop += k_hoop e + eta_hoop d(lambda_2)/dt, de/dt = d(lambda_2)/dt - e / tau_hoop, with e the strain
of the branch's spring.

Source: Gu, Gupta, Zhu, Zhu, "Modeling of viscoelastic electromechanical behavior in a soft dielectric elastomer
actuator", IEEE Trans. Robot. 33 (2017) 1263 (Maxwell branches in every direction).

Typical: k_hoop 20 to 100 kPa with 0.05 to 2 s; eta_hoop 0.1 to 5 kPa s.
"""

import sympy

from ...model.change import added
from ...model.declare import Model, Quantity, State
from ...model.effect import Effect

PARAMETERS = (
    Quantity("eta_hoop", "Pa.s", "Damping in hoop direction", 0.0, "Gu 2017", 0.0, 1e7, 1e3, "kPa.s"),
    Quantity("k_hoop", "Pa", "Stiffness of the hoop direction's Maxwell branch", 0.0, "Gu 2017", -1e5, 1e8, 5e4, "kPa"),
    Quantity("tau_hoop", "s", "Relaxation time of that branch", 0.3, "Gu 2017", 1e-3, 1e3),
)


def _apply(model: Model) -> Model:
    strain = Quantity("hoop_branch_strain", "1", "Strain of the spring of the hoop branch", nominal=0.1)
    speed, zero = model["lambda_2_rate"], sympy.Integer(0)
    relaxing = speed - strain.symbol / model["tau_hoop"]
    model = model.extend(states=[State(strain, relaxing, zero, zero)])
    return added(model, "sigma_hoop", model["k_hoop"] * strain.symbol + model["eta_hoop"] * speed)


EFFECT = Effect(
    "hoop_viscoelasticity",
    "mechanical",
    "The wall is viscous in hoop direction too",
    _apply,
    PARAMETERS,
    off={"eta_hoop": 0.0, "k_hoop": 0.0},
    typical={"eta_hoop": 1e3, "k_hoop": 5e4, "tau_hoop": 0.3},
    shapes={"tau_hoop": (0.03, 0.3, 3.0)},
)
