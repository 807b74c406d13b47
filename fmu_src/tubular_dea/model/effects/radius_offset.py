"""The laser's zero is off.

Equation: sensor_signal += radius_offset.

Source: data sheets of laser profile sensors (Gocator 2100: zero after warming up).

Typical: 10 to 200 um.
"""

from ..declare import Model, Quantity
from . import Effect
from ._signals import added, sensor

PARAMETERS = (
    Quantity("radius_offset", "m", "Recorded radius minus the true one", 0.0, "Gocator 2100", -5e-3, 5e-3, 1e-4, "um"),
)


def _apply(model: Model) -> Model:
    return added(sensor(model), "sensor_signal", model["radius_offset"])


EFFECT = Effect(
    "radius_offset", "sensor", "The recorded radius has an offset", _apply, PARAMETERS,
    off={"radius_offset": 0.0}, typical={"radius_offset": 5e-5}, exact=True,
)  # fmt: skip
