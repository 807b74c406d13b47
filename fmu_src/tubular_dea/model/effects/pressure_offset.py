"""The pressure monitor has an offset, or the outside is not at the pressure it is taken to be.

Equation: wall_pressure = pressure + pressure_offset.

Source: data sheets of pressure transmitters (Baumer PBMN: 0.1 to 0.5 % of 0.4 to 1 bar).

Typical: 50 to 500 Pa.
"""

from ..declare import Model, Quantity
from . import Effect
from ._signals import added, wall_pressure

PARAMETERS = (
    Quantity("pressure_offset", "Pa", "Pressure at the wall minus the recorded one", 0.0, "Baumer PBMN", -2e4, 2e4,
             200.0, "mmHg"),
)


def _apply(model: Model) -> Model:
    model = wall_pressure(model)
    offset, held = model["pressure_offset"], model["wall_equilibrium_pressure"]
    model = added(model, "wall_pressure", offset)
    return model.replace("equilibrium_pressure", model.expression("equilibrium_pressure").subs(held, held - offset))


EFFECT = Effect(
    "pressure_offset", "pressure", "The recorded pressure has an offset", _apply, PARAMETERS,
    off={"pressure_offset": 0.0}, typical={"pressure_offset": 200.0}, exact=True,
)  # fmt: skip
