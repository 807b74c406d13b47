"""The recorded radius is late: exposure, transfer, a clock of its own.

Equation: measured_displacement(t) = sensor_signal(t - sensor_delay).

Source: data sheets of laser profile sensors (Gocator 2100: latency of one to several frames).

Typical: 2 to 40 ms.
"""

from ..declare import Delay, Model, Quantity
from . import Effect
from ._signals import sensor

LARGEST = 0.5  # s
PARAMETERS = (
    Quantity("sensor_delay", "s", "Delay of the recorded radius", 0.0, "Gocator 2100", 0.0, LARGEST, 0.01, "ms"),
)


def _apply(model: Model) -> Model:
    model = sensor(model)
    delayed = Quantity("delayed_reading", "m", "Reading of the sensor, delayed", nominal=1e-3, display_unit="mm")
    model = model.extend(delays=[Delay(delayed, of="sensor_signal", by="sensor_delay")])
    return model.replace("measured_displacement", delayed.symbol)


EFFECT = Effect(
    "sensor_delay", "sensor", "The recorded radius is late", _apply, PARAMETERS,
    off={"sensor_delay": 0.0}, typical={"sensor_delay": 0.012}, exact=True,
)  # fmt: skip
