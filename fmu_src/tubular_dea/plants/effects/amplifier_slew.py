"""The amplifier's current is limited: the voltage of a capacitive load follows along a ramp.

::

    V ____                I_max / C
          |   V_a      .-'
          |         .-'
          |______.-'________

Equation: dV_a/dt = s tanh((V - V_a) / b), s = slew_rate / (1 + n ((lambda_1 lambda_2)^2 - 1)),
b = s tau_a / (1 + s tau_a / 100 V), tau_a = 1 ms: what is nearer than b follows as through a lag, of 1 ms where s is
small and of none where s knows no limit. n = 1 is a current limit slew_rate C_rest into the capacitance of the
stretched tube, n = 0 a limit of the slew rate.

Source: data sheets of high-voltage amplifiers, Trek 10/10B-HS (10 mA, 700 V/us) and small EMCO modules.

Typical: 0.1 to 1 mA into 10 nF: 10 to 100 kV/s, so that 4 kV take 40 to 400 ms.
"""

import sympy

from ...model.change import at_rest, at_start, filtered
from ...model.declare import Model, Quantity, State
from ...model.effect import Effect
from ._signals import electrodes

SETTLING = sympy.Float(1e-3)  # s: how fast a slow amplifier follows small changes
NEARBY = sympy.Float(100.0)  # V: from where on a fast one follows through a lag
PARAMETERS = (
    Quantity(
        "slew_rate",
        "V/s",
        "Largest rate of the amplifier's voltage into the tube at rest",
        5e4,
        "Trek 10/10B-HS",
        1e2,
        1e8,
        5e4,
        "kV/s",
    ),
    Quantity("slew_stretch", "1", "What is limited: 0 the rate, 1 the current", 0.0, "Trek 10/10B-HS", -0.1, 5.0),
    Quantity("slew_share", "1", "Share of the voltage that is limited", 0.0, "Trek 10/10B-HS", 0.0, 1.0),
)


def _apply(model: Model) -> Model:
    model = electrodes(model)
    wanted = model.expression("electrode_voltage")
    given = Quantity("amplifier_voltage", "V", "Voltage that the amplifier reaches", nominal=5e3, display_unit="kV")
    growth = (model["lambda_1"] * model["lambda_2"]) ** 2 - 1
    limit = model["slew_rate"] / (1 + model["slew_stretch"] * growth)
    nearby = limit * SETTLING / (1 + limit * SETTLING / NEARBY)
    rate = limit * sympy.tanh((wanted - given.symbol) / nearby)
    model = model.extend(states=[State(given, rate, at_start(model, wanted), at_rest(model, wanted))])
    model = filtered(model, "electrode_voltage", model["slew_share"], given.symbol, "wanted_voltage")
    return filtered(model, "electrode_voltage_rate", model["slew_share"], rate, "wanted_voltage_rate")


EFFECT = Effect(
    "amplifier_slew",
    "electrical",
    "The amplifier's current or slew rate is limited",
    _apply,
    PARAMETERS,
    off={"slew_share": 0.0},
    on={"slew_share": 1.0},
    refine=("slew_stretch",),
    trades={"slew_rate": -1},
    typical={"slew_rate": 5e4, "slew_stretch": 0.0, "slew_share": 1.0},
    shapes={"slew_rate": (1e4, 3e4, 1e5, 3e5)},
)
