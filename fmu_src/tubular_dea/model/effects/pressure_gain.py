"""The pressure monitor's scale is off.

Equation: wall_pressure = pressure_gain pressure.

Source: data sheets of pressure transmitters (Baumer PBMN: span error and its drift).

Typical: 0.97 to 1.03.
"""

from ..declare import Model, Quantity
from . import Effect
from ._signals import scaled, wall_pressure

PARAMETERS = (
    Quantity("pressure_gain", "1", "Pressure at the wall over the recorded one", 1.0, "Baumer PBMN", 0.2, 5.0),
)


def _apply(model: Model) -> Model:
    model = wall_pressure(model)
    gain, held = model["pressure_gain"], model["wall_equilibrium_pressure"]
    model = scaled(model, "wall_pressure", gain)
    return model.replace("equilibrium_pressure", model.expression("equilibrium_pressure").subs(held, held / gain))


EFFECT = Effect(
    "pressure_gain", "pressure", "The recorded pressure's scale is off", _apply, PARAMETERS,
    off={"pressure_gain": 1.0}, typical={"pressure_gain": 1.03}, exact=True,
)  # fmt: skip
