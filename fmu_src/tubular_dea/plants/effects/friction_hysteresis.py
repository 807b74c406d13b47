"""Rate-independent friction between the layers or in the clamps: the wall sticks until the load has turned far enough.

::

    p |      .--------->      friction_pressure
      |     /       /
      |    /       /          elastic over friction_travel, at every turn
      |   /       /
      |  <--------'           -friction_pressure
      +------------------ lambda_2

Equation: F_cir += friction_pressure z A_3; dz/dt = (v - [v z]+ z [z^2 - c]+ / (1 - c)) / friction_travel, where
v = d(lambda_2)/dt, [ ]+ is the positive part and c = friction_onset: elastic up to z^2 = c and on every way back,
sliding at z = 1. Unlike in Dahl's model small vibrations (the monitors' noise) do not wear the friction down.

Source: Dupont, Hayward, Armstrong, Altpeter, "Single state elastoplastic friction models", IEEE Trans. Automat. Contr.
47 (2002) 787.

Typical: 50 to 300 Pa, which is 10 to 60 um, built up over 0.005 to 0.02 of stretch.
"""

import sympy

from ...model.declare import Model, Quantity, State
from ...model.effect import Effect
from ...model.smooth import positive_part
from ._signals import pushed

PARAMETERS = (
    Quantity("friction_pressure", "Pa", "Pressure that friction takes up", 0.0, "Dupont 2002", 0.0, 2e4, 150.0, "mmHg"),
    Quantity("friction_travel", "1", "Stretch over which it builds up", 0.01, "Dupont 2002", 2e-4, 1.0, 0.01),
    Quantity("friction_onset", "1", "Square of its share at which sliding begins", 0.95, "Dupont 2002", 0.0, 0.98),
)


def _apply(model: Model) -> Model:
    grip = Quantity("friction_state", "1", "Friction over its largest value")
    z, v, c, zero = grip.symbol, model["lambda_2_rate"], model["friction_onset"], sympy.Integer(0)
    sliding = positive_part(v * z) * z * positive_part(z**2 - c) / (1 - c)
    model = model.extend(states=[State(grip, (v - sliding) / model["friction_travel"], zero, zero)])
    return pushed(model, model["friction_pressure"] * z)


EFFECT = Effect(
    "friction_hysteresis",
    "mechanical",
    "Rate-independent friction",
    _apply,
    PARAMETERS,
    off={"friction_pressure": 0.0},
    refine=("friction_onset",),
    delicate=True,
    typical={"friction_pressure": 150.0, "friction_travel": 0.01, "friction_onset": 0.95},
    shapes={"friction_travel": (2e-3, 1e-2, 5e-2)},
)
