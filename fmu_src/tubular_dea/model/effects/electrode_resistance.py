"""Electrodes charge with a lag: their resistance and the capacitance of the layers.

::

    V o---/\\/\\/\\---+---o V_e        tau_e = R C
          R         = C
       o-----------+---o

Equation: dV_e/dt = (V - V_e) / tau, tau = tau_e (1 + n ((lambda_1 lambda_2)^2 - 1)). The field, the charge and the
current are those of V_e. n = 1 is the capacitance of the stretched tube behind a constant resistance (the charge that
the tube's own motion draws is left out), n = 0 a constant lag.

Source: Graf and Maas, "A model of the electrodynamic field distribution for optimized electrode design for
dielectric electroactive polymer transducers", Smart Mater. Struct. 21 (2012) 094001.

Typical: carbon electrodes of 100 kOhm to 1 MOhm at 9 to 20 nF: 1 to 20 ms.
"""

from ..declare import Model, Quantity, State
from . import Effect
from ._signals import at_rest, at_start, electrodes, filtered

PARAMETERS = (
    Quantity("tau_e", "s", "Time constant of the electrodes", 0.01, "Graf 2012", 1e-4, 10.0, 0.01, "ms"),
    Quantity("tau_e_stretch", "1", "1: the lag is that of the present capacitance, 0: it is constant", 1.0,
             "Graf 2012", -0.1, 5.0),
    Quantity("electrode_share", "1", "Share of the layers whose electrodes lag", 0.0, "Graf 2012", 0.0, 1.0),
)


def _apply(model: Model) -> Model:
    model = electrodes(model)
    drive = model.expression("electrode_voltage")
    slow = Quantity("lagging_voltage", "V", "Voltage behind the electrodes' resistance", nominal=5e3, display_unit="kV")
    share, n = model["electrode_share"], model["tau_e_stretch"]
    tau = model["tau_e"] * (1 + n * ((model["lambda_1"] * model["lambda_2"]) ** 2 - 1))
    charging = (drive - slow.symbol) / tau
    state = State(slow, charging, at_start(model, drive), at_rest(model, drive))
    model = model.extend(states=[state])
    model = filtered(model, "electrode_voltage", share, slow.symbol, "voltage_before_electrodes")
    return filtered(model, "electrode_voltage_rate", share, charging, "voltage_rate_before_electrodes")


EFFECT = Effect(
    "electrode_resistance", "electrical", "The electrodes charge with a lag (R C)", _apply, PARAMETERS,
    off={"electrode_share": 0.0}, on={"electrode_share": 1.0}, refine=("tau_e_stretch",),
    typical={"tau_e": 0.01, "tau_e_stretch": 1.0, "electrode_share": 1.0},
    shapes={"tau_e": (0.002, 0.006, 0.02, 0.06, 0.2)},
)  # fmt: skip
