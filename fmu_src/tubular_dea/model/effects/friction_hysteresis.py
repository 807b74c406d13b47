"""Rate-independent friction between the layers or in the clamps.

::

    sigma |    .-------->     sigma_friction
          |  .'
          | /  travel
    ------|/------- lambda_2
          |
        <-------'             -sigma_friction

Equation: dz/dt = (d(lambda_2)/dt - |d(lambda_2)/dt| z) / friction_travel (Dahl); sigma_hoop += sigma_friction z.

Source: Dahl, "A solid friction model", Aerospace Corp. TOR-0158(3107-18)-1 (1968).

Typical: 1 to 10 kPa of hoop stress, 0.002 to 0.02 of stretch.
"""

import sympy

from ..declare import Model, Quantity, State
from ..smooth import magnitude
from . import Effect
from ._signals import added

PARAMETERS = (
    Quantity("sigma_friction", "Pa", "Hoop stress of the friction", 0.0, "Dahl 1968", 0.0, 1e6, 3e3, "kPa"),
    Quantity("friction_travel", "1", "Hoop stretch after a reversal over which it builds up again", 5e-3, "Dahl 1968",
             1e-4, 1.0, 5e-3),
)


def _apply(model: Model) -> Model:
    grip = Quantity("friction_state", "1", "Friction over its largest value")
    speed, zero = model["lambda_2_rate"], sympy.Integer(0)
    derivative = (speed - magnitude(speed) * grip.symbol) / model["friction_travel"]
    model = model.extend(states=[State(grip, derivative, zero, zero)])
    return added(model, "sigma_hoop", model["sigma_friction"] * grip.symbol)


EFFECT = Effect(
    "friction_hysteresis", "mechanical", "Rate-independent friction", _apply, PARAMETERS,
    off={"sigma_friction": 0.0}, typical={"sigma_friction": 3e3, "friction_travel": 5e-3},
    shapes={"friction_travel": (1e-3, 5e-3, 2e-2, 0.1)},
)  # fmt: skip
