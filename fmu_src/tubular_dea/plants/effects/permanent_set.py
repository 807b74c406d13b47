"""The wall does not come back quite to its length: after a large stretch it is longer at rest.

Equation: lambda_2_elastic = lambda_2 / (1 + permanent_set m); dm/dt = ramp(lambda_2 - 1 - m) / tau_set: m follows the
largest strain so far and does not go back.

Source: Dorfmann and Ogden, "A constitutive model for the Mullins effect with permanent set in particle-reinforced
rubber", Int. J. Solids Struct. 41 (2004) 1855.

Typical: 1 to 10 % of the largest strain, within 0.1 to 10 s.
"""

from ...model.change import scaled
from ...model.declare import Model, Quantity, State
from ...model.effect import Effect
from ...model.smooth import positive_part, ramp
from ._signals import elastic_stretches

CORNER = 1e-5  # strain over which it begins to follow
PARAMETERS = (
    Quantity("permanent_set", "1", "Share of the largest strain that stays", 0.0, "Dorfmann 2004", -0.5, 0.9, 0.05),
    Quantity("tau_set", "s", "Time constant at which it builds up", 1.0, "Dorfmann 2004", 5e-3, 1e3),
)


def _apply(model: Model) -> Model:
    model = elastic_stretches(model)
    largest = Quantity("set_strain", "1", "Strain that the set has followed so far", nominal=0.1)
    strain = model["lambda_2"] - 1
    grows = ramp(strain - largest.symbol, CORNER) / model["tau_set"]
    start = positive_part(model["lambda_2_start"] - 1)
    model = model.extend(states=[State(largest, grows, start, positive_part(strain))])
    return scaled(model, "lambda_2_elastic", 1 / (1 + model["permanent_set"] * largest.symbol))


EFFECT = Effect(
    "permanent_set",
    "mechanical",
    "Part of the largest strain stays",
    _apply,
    PARAMETERS,
    off={"permanent_set": 0.0},
    typical={"permanent_set": 0.05, "tau_set": 1.0},
    shapes={"tau_set": (0.02, 0.3, 3.0)},
    lasting=True,
)
