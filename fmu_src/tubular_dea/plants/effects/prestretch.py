"""The tube is mounted stretched or compressed: at lambda = 1 the elastomer is not free of stress.

::

    ===|--> <------------>  <--|===      free length below 2 l_o: prestretch_1 > 1, above it < 1

Equation: lambda_1_elastic = prestretch_1 lambda_1, lambda_2_elastic = prestretch_2 lambda_2.

Source: Kofod, "The static actuation of dielectric elastomer actuators: how does pre-stretch improve actuation?",
J. Phys. D 41 (2008) 215405.

Typical: 2 to 10 % along the tube.
"""

from ...model.change import scaled
from ...model.declare import Model, Quantity
from ...model.effect import Effect
from ._signals import elastic_stretches

PARAMETERS = (
    Quantity("prestretch_1", "1", "Stretch along the tube as it is mounted", 1.0, "Kofod 2008", 0.7, 2.0),
    Quantity("prestretch_2", "1", "Hoop stretch as it is mounted", 1.0, "Kofod 2008", 0.7, 2.0),
)


def _apply(model: Model) -> Model:
    model = elastic_stretches(model)
    model = scaled(model, "lambda_1_elastic", model["prestretch_1"])
    return scaled(model, "lambda_2_elastic", model["prestretch_2"])


EFFECT = Effect(
    "prestretch",
    "mechanical",
    "The tube is mounted stretched or compressed",
    _apply,
    PARAMETERS,
    off={"prestretch_1": 1.0, "prestretch_2": 1.0},
    typical={"prestretch_1": 1.05, "prestretch_2": 1.0},
    refine=("prestretch_2",),
    exact=True,
)
