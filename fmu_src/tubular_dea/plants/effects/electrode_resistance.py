"""Electrodes charge with a lag: their resistance and the capacitance of the layers.

::

    V o---/\\/\\/\\---+---o V_e        tau_e = R C
          R         = C
       o-----------+---o

Equation: V_e = V_1 + electrode_line (V_1 - V_2), d(tau V_1)/dt = V - V_1, d(tau V_2)/dt = 4 (V - V_2),
tau = tau_e (1 + n ((lambda_1 lambda_2)^2 - 1)). The field, the charge and the current are those of V_e. n = 1 is the
capacitance of the stretched tube behind a constant resistance, whose charge tau V_1 / R follows what flows in: a tube
that expands lowers the voltage at its layers. n = 0 is a constant lag. electrode_line = 0 is one resistance, about 1/3
electrodes that resist along their length, whose far end begins to charge late.

Source: Graf and Maas, "A model of the electrodynamic field distribution for optimized electrode design for
dielectric electroactive polymer transducers", Smart Mater. Struct. 21 (2012) 094001.

Typical: carbon electrodes of 100 kOhm to 1 MOhm at 9 to 20 nF: 1 to 20 ms.
"""

from sympy import Expr

from ...model.change import at_rest, at_start, filtered
from ...model.declare import Model, Quantity, State
from ...model.effect import Effect
from ._signals import area_growth, electrodes

PARAMETERS = (
    Quantity("tau_e", "s", "Time constant of the electrodes", 0.01, "Graf 2012", 1e-4, 10.0, 0.01, "ms"),
    Quantity(
        "tau_e_stretch",
        "1",
        "How the lag grows with stretch: 1 as the capacitance, 0 not at all",
        1.0,
        "Graf 2012",
        -0.1,
        5.0,
    ),
    Quantity(
        "electrode_line",
        "1",
        "Resistance along the electrodes: 0 at one place, 1/3 along their length",
        0.0,
        "Graf 2012",
        -0.3,
        3.0,
    ),
    Quantity("electrode_share", "1", "Share of the layers whose electrodes lag", 0.0, "Graf 2012", 0.0, 1.0),
)


def _apply(model: Model) -> Model:
    model = electrodes(model)
    drive = model.expression("electrode_voltage")
    share, line, n = model["electrode_share"], model["electrode_line"], model["tau_e_stretch"]
    capacitance = (model["lambda_1"] * model["lambda_2"]) ** 2  # over that of the tube without load
    tau = model["tau_e"] * (1 + n * (capacitance - 1))
    tau_rate = 2 * model["tau_e"] * n * capacitance * area_growth(model)
    near, near_rate = _lagging(model, "lagging_voltage", drive, tau, tau_rate)
    far, far_rate = _lagging(model, "lagging_voltage_2", drive, tau / 4, tau_rate / 4)
    model = model.extend(states=[near, far])
    voltage = near.quantity.symbol + line * (near.quantity.symbol - far.quantity.symbol)
    model = filtered(model, "electrode_voltage", share, voltage, "voltage_before_electrodes")
    rate = near_rate + line * (near_rate - far_rate)
    return filtered(model, "electrode_voltage_rate", share, rate, "voltage_rate_before_electrodes")


def _lagging(model: Model, name: str, drive: Expr, tau: Expr, tau_rate: Expr) -> tuple[State, Expr]:
    """A voltage that follows `drive` with a time constant `tau` that changes at `tau_rate`, and its rate."""
    slow = Quantity(name, "V", "Voltage behind the electrodes' resistance", nominal=5e3, display_unit="kV")
    charging = (drive - (1 + tau_rate) * slow.symbol) / tau
    return State(slow, charging, at_start(model, drive), at_rest(model, drive)), charging


EFFECT = Effect(
    "electrode_resistance",
    "electrical",
    "The electrodes charge with a lag (R C)",
    _apply,
    PARAMETERS,
    off={"electrode_share": 0.0},
    on={"electrode_share": 1.0},
    refine=("tau_e_stretch", "electrode_line"),
    trades={"tau_e": 1},
    typical={"tau_e": 0.01, "tau_e_stretch": 1.0, "electrode_line": 0.0, "electrode_share": 1.0},
    shapes={"tau_e": (0.002, 0.006, 0.02, 0.06, 0.2)},
)
