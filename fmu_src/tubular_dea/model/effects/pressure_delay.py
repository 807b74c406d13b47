"""The pressure reaches the wall later than the monitor reads it: a wave's way, or clocks that differ.

Equation: wall_pressure(t) = pressure(t - pressure_delay).

Source: transport delay; 1 m of air takes 3 ms, an unsynchronised data logger up to tens of ms.

Typical: 2 to 40 ms.
"""

from ..declare import Delay, Model, Quantity
from . import Effect
from ._signals import wall_pressure

LARGEST = 0.5  # s
PARAMETERS = (
    Quantity("pressure_delay", "s", "Delay between the recorded pressure and the wall", 0.0, "Transport delay", 0.0,
             LARGEST, 0.01, "ms"),
)


def _apply(model: Model) -> Model:
    model = wall_pressure(model)
    delayed = Quantity("delayed_pressure", "Pa", "Recorded pressure, delayed", nominal=1e4, display_unit="mmHg")
    model = model.extend(delays=[Delay(delayed, of="pressure", by="pressure_delay")])
    return model.replace("delivered_pressure", delayed.symbol)


EFFECT = Effect(
    "pressure_delay", "pressure", "The wall feels the recorded pressure later", _apply, PARAMETERS,
    off={"pressure_delay": 0.0}, typical={"pressure_delay": 0.012}, exact=True,
)  # fmt: skip
