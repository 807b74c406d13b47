"""The laser's scale is off: it reads a share of the displacement.

Equation: sensor_signal += (radius_gain - 1) (sensor_signal + gain_from): gain_from = 0 scales the displacement,
gain_from = r_o the radius.

Source: data sheets of laser profile sensors (Gocator 2100: linearity, and the angle at which it looks).

Typical: 0.97 to 1.03.
"""

from ...model.change import added
from ...model.declare import Model, Quantity
from ...model.effect import Effect
from ._signals import sensor

PARAMETERS = (
    Quantity("radius_gain", "1", "Recorded displacement over the true one", 1.0, "Gocator 2100", 0.2, 5.0),
    Quantity(
        "gain_from",
        "m",
        "Distance of the point that the scale leaves alone, inwards from r_o",
        0.0,
        "Gocator 2100",
        -0.02,
        0.02,
        1e-2,
        "mm",
    ),
)


def _apply(model: Model) -> Model:
    model = sensor(model)
    seen = model.expression("sensor_signal") + model["gain_from"]
    return added(model, "sensor_signal", (model["radius_gain"] - 1) * seen)


EFFECT = Effect(
    "radius_gain",
    "sensor",
    "The recorded radius's scale is off",
    _apply,
    PARAMETERS,
    off={"radius_gain": 1.0},
    typical={"radius_gain": 1.03, "gain_from": 0.0},
    refine=("gain_from",),
    exact=True,
)
