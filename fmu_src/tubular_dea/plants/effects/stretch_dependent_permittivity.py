"""The permittivity changes with stretch (electrostriction).

Equation: eps = eps_r exp(eps_stretch (lambda_1 + lambda_2 - 2)). A permittivity that depends on the stretch
also pulls: beside eps_o eps E^2, the stress along i gets -1/2 lambda_i d(eps_o eps)/d(lambda_i) E^2 (times
`electrostriction`: 1 by thermodynamics, 0 where only the permittivity is to change).

Source: Zhao and Suo, "Electrostriction in elastic dielectrics undergoing large deformation", J. Appl. Phys. 104
(2008) 123530.

Typical: -0.05 to -0.3 for VHB and silicones.
"""

from sympy import exp

from ...model.change import added, scaled
from ...model.declare import Model, Quantity
from ...model.effect import Effect
from ._signals import dielectric

PARAMETERS = (
    Quantity(
        "eps_stretch", "1", "Change of ln(permittivity) with lambda_1 + lambda_2", 0.0, "Zhao 2008", -2.0, 2.0, 0.1
    ),
    Quantity("electrostriction", "1", "Share of the stress that goes with it", 1.0, "Zhao 2008", 0.0, 1.0),
)


def _apply(model: Model) -> Model:
    model = dielectric(model)
    slope, one, two = model["eps_stretch"], model["lambda_1"], model["lambda_2"]
    model = scaled(model, "eps_effective", exp(slope * (one + two - 2)))
    eps = model["eps_o"] * model["eps_effective"]
    pull = model["electrostriction"] * slope / 2 * model["phi"] * eps * model["active_field"] ** 2
    model = added(model, "sigma_m", -pull * one)
    model = added(model, "sigma_hoop", -pull * two)
    speed = (model["dlambda_1_dlambda_2"] + 1) * model["lambda_2_rate"]
    return added(model, "capacitance_rate", model["capacitance"] * slope * speed)


EFFECT = Effect(
    "stretch_dependent_permittivity",
    "electrical",
    "The permittivity changes with stretch (electrostriction)",
    _apply,
    PARAMETERS,
    off={"eps_stretch": 0.0},
    typical={"eps_stretch": -0.2, "electrostriction": 1.0},
    refine=("electrostriction",),
)
