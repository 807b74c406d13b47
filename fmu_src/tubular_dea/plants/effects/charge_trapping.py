"""Charge creeps into the elastomer while the voltage is on, and out again: dielectric absorption or leakage.

::

    E |  .--------.             field of the electrodes
      |  |  '- . _|             field in the elastomer: falls by the trapped charge
      |__|        |_ . - '      and is reversed for a while after discharge

Equation: dV_t/dt = (trap_fraction V_e - V_t) / tau_trap; active_field = E - V_t lambda_1 lambda_2 / h_ao.
A negative trap_fraction is slow polarisation: the permittivity creeps up.

Source: Di Lillo, Schmidt, Carnelli, Ermanni, Kovacs, Mazza, Bergamini, "Measurement of insulating and dielectric
properties of acrylic elastomer membranes at high electric fields", J. Appl. Phys. 111 (2012) 024904.

Typical: 2 to 15 % of the voltage within 0.3 to 10 s.
"""

from ...model.change import added, at_rest, at_start
from ...model.declare import Model, Quantity, State
from ...model.effect import Effect
from ._signals import dielectric

PARAMETERS = (
    Quantity("trap_fraction", "1", "Share of the voltage that trapped charge takes", 0.0, "Di Lillo 2012", -0.9, 0.9),
    Quantity("tau_trap", "s", "Time constant of trapping and release", 1.0, "Di Lillo 2012", 0.01, 1e3),
)


def _apply(model: Model) -> Model:
    model = dielectric(model)
    trapped = Quantity(
        "trapped_voltage", "V", "Voltage of the trapped charge for trap_fraction = 1", nominal=5e3, display_unit="kV"
    )
    voltage = model["electrode_voltage"]
    state = State(
        trapped, (voltage - trapped.symbol) / model["tau_trap"], at_start(model, voltage) * 0, at_rest(model, voltage)
    )
    model = model.extend(states=[state])
    screened = model["trap_fraction"] * trapped.symbol * model["lambda_1"] * model["lambda_2"] / model["h_ao"]
    return added(model, "active_field", -screened)


EFFECT = Effect(
    "charge_trapping",
    "electrical",
    "Trapped charge screens the field (dielectric absorption, leakage)",
    _apply,
    PARAMETERS,
    off={"trap_fraction": 0.0},
    typical={"trap_fraction": 0.08, "tau_trap": 1.0},
    shapes={"tau_trap": (0.1, 0.3, 1.0, 3.0, 10.0)},
)
