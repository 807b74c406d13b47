"""The laser smooths what it reads.

Equation: d(lagging_reading)/dt = (reading - lagging_reading) / tau_sensor; sensor_signal = lagging_reading.

Source: data sheets of laser profile sensors (Gocator 2100: temporal filters over several profiles).

Typical: 2 to 30 ms.
"""

from ..declare import Model, Quantity, State
from . import Effect
from ._signals import at_rest, at_start, filtered, sensor

PARAMETERS = (
    Quantity("tau_sensor", "s", "Time constant of the sensor", 0.01, "Gocator 2100", 1e-4, 10.0, 0.01, "ms"),
    Quantity("sensor_share", "1", "Share of the reading that is smoothed", 0.0, "Gocator 2100", 0.0, 1.0),
)


def _apply(model: Model) -> Model:
    model = sensor(model)
    drive = model.expression("sensor_signal")
    slow = Quantity("lagging_reading", "m", "Smoothed reading of the sensor", nominal=1e-3, display_unit="mm")
    state = State(slow, (drive - slow.symbol) / model["tau_sensor"], at_start(model, drive), at_rest(model, drive))
    model = model.extend(states=[state])
    return filtered(model, "sensor_signal", model["sensor_share"], slow.symbol, "sensor_signal_before_lag")


EFFECT = Effect(
    "sensor_lag", "sensor", "The sensor smooths what it reads", _apply, PARAMETERS,
    off={"sensor_share": 0.0}, on={"sensor_share": 1.0}, typical={"tau_sensor": 0.01, "sensor_share": 1.0},
    shapes={"tau_sensor": (0.003, 0.01, 0.03, 0.1, 0.3)},
)  # fmt: skip
