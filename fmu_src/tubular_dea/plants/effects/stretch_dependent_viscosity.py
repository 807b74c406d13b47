"""The viscosities change with stretch.

Equation: eta_o by exp(eta_stretch (lambda_2 - 1)), the relaxation rates of the Maxwell branches by
exp(-branch_stretch (lambda_2 - 1)).

Source: Bergstroem and Boyce, "Constitutive modeling of the large strain time-dependent behavior of elastomers",
J. Mech. Phys. Solids 46 (1998) 931: the creep rate depends on the chains' stretch.

Typical: -2 to 4: a factor of 0.6 to 3 between 0 and 25 % stretch.
"""

from sympy import exp

from ...model.change import scaled
from ...model.declare import Model, Quantity
from ...model.effect import Effect

BRANCHES = ("sigma_vis1", "sigma_vis2", "branch_3_strain")
PARAMETERS = (
    Quantity(
        "eta_stretch",
        "1",
        "Growth of the damper's viscosity with the hoop stretch",
        0.0,
        "Bergstroem 1998",
        -10.0,
        10.0,
    ),
    Quantity(
        "branch_stretch",
        "1",
        "Growth of the branches' viscosity with the hoop stretch",
        0.0,
        "Bergstroem 1998",
        -10.0,
        10.0,
    ),
)


def _apply(model: Model) -> Model:
    strain = model["lambda_2"] - 1
    slower = exp(-model["branch_stretch"] * strain)
    for state in model.states:
        if state.quantity.name in BRANCHES:
            spring, flow = state.derivative.as_independent(state.quantity.symbol, as_Add=True)
            model = model.drive(state.quantity.name, spring + flow * slower)
    return scaled(model, "sigma_eta", exp(model["eta_stretch"] * strain))


EFFECT = Effect(
    "stretch_dependent_viscosity",
    "mechanical",
    "The viscosities change with stretch",
    _apply,
    PARAMETERS,
    off={"eta_stretch": 0.0, "branch_stretch": 0.0},
    typical={"eta_stretch": 3.0, "branch_stretch": 0.0},
    refine=("branch_stretch",),
)
