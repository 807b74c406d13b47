"""A housing around the tube stops it.

::

    p |              |
      |            .-|   wall of the housing at r_o lambda_2_stop
      |        .-'   |
      +--------------|-- R

Equation: F_cir += stop_stiffness x^2 / (x + stop_corner) A_3, x = lambda_2 - lambda_2_stop where that is positive:
a spring that comes in over `stop_corner`.

Source: a penalty spring; Wriggers, "Computational contact mechanics", 2nd ed.

Typical: 0.03 to 10 MPa per unit of stretch (10 MPa: 95 mmHg deflect it by 0.02 mm; 0.03 MPa is a soft sleeve).
"""

from ...model.declare import Model, Quantity
from ...model.effect import Effect
from ...model.smooth import positive_part
from ._signals import pushed

PARAMETERS = (
    Quantity(
        "stop_stiffness",
        "Pa",
        "Pressure of the stop for a stretch of 1 beyond it",
        0.0,
        "Wriggers 2006",
        0.0,
        1e9,
        1e5,
        "kPa",
    ),
    Quantity("lambda_2_stop", "1", "Hoop stretch at which the stop begins", 1.25, "Wriggers 2006", 0.7, 3.0),
    Quantity("stop_corner", "1", "Stretch over which contact begins", 2e-4, "Wriggers 2006", 1e-6, 0.3, 2e-4),
)


def _apply(model: Model) -> Model:
    beyond = positive_part(model["lambda_2"] - model["lambda_2_stop"])
    return pushed(model, model["stop_stiffness"] * beyond**2 / (beyond + model["stop_corner"]))


EFFECT = Effect(
    "rigid_stop",
    "mechanical",
    "A housing stops the tube",
    _apply,
    PARAMETERS,
    off={"stop_stiffness": 0.0},
    typical={"stop_stiffness": 5e4, "lambda_2_stop": 1.25, "stop_corner": 2e-4},
    refine=("stop_corner",),
    hard=("stop_stiffness",),
    levels={"lambda_2_stop": "lambda_2"},
    shapes={"lambda_2_stop": (1.1, 1.15, 1.2, 1.25, 1.3, 1.4)},
)
