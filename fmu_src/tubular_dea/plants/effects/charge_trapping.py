"""Charge creeps into the elastomer while the voltage is on, and out again: dielectric absorption or leakage.

::

    E |  .--------.             field of the electrodes
      |  |  '- . _|             field in the elastomer: falls by the trapped charge
      |__|        |_ . - '      and is reversed for a while after discharge

Equation: dV_t/dt = (trap_fraction V_e - V_t) / tau_trap; active_field = E - V_t lambda_1 lambda_2 / h_ao.
A negative trap_fraction is slow polarisation: the permittivity creeps up. Absorption has no single time constant: a
share `deep_traps` of the charge takes ten times as long.

Source: Di Lillo, Schmidt, Carnelli, Ermanni, Kovacs, Mazza, Bergamini, "Measurement of insulating and dielectric
properties of acrylic elastomer membranes at high electric fields", J. Appl. Phys. 111 (2012) 024904.

Typical: 2 to 15 % of the voltage within 0.3 to 10 s.
"""

import sympy

from ...model.change import added, at_rest, at_start
from ...model.declare import Model, Quantity, State
from ...model.effect import Effect
from ._signals import dielectric

PARAMETERS = (
    Quantity("trap_fraction", "1", "Share of the voltage that trapped charge takes", 0.0, "Di Lillo 2012", -0.9, 0.9),
    Quantity("tau_trap", "s", "Time constant of trapping and release", 1.0, "Di Lillo 2012", 0.01, 1e3),
    Quantity("deep_traps", "1", "Share of trapped charge that takes ten times as long", 0.0, "Di Lillo 2012", 0.0, 1.0),
)
DEEPER = 10.0  # [1] times as long as the other charge that charge in deep traps takes: a decade, by convention


def _apply(model: Model) -> Model:
    model = dielectric(model)
    tau, deep = model["tau_trap"], model["deep_traps"]
    trapped = _charge(model, "trapped_voltage", "the trapped charge", tau)
    deeply = _charge(model, "deeply_trapped_voltage", "the charge in deep traps", DEEPER * tau)
    model = model.extend(states=[trapped, deeply])
    voltage = (1 - deep) * trapped.quantity.symbol + deep * deeply.quantity.symbol
    screened = model["trap_fraction"] * voltage * model["lambda_1"] * model["lambda_2"] / model["h_ao"]
    return added(model, "active_field", -screened)


def _charge(model: Model, name: str, words: str, tau: sympy.Expr) -> State:
    """The voltage of charge that follows the electrodes' with a time constant."""
    quantity = Quantity(name, "V", f"Voltage of {words} for trap_fraction = 1", nominal=5e3, display_unit="kV")
    voltage = model["electrode_voltage"]
    return State(quantity, (voltage - quantity.symbol) / tau, at_start(model, voltage) * 0, at_rest(model, voltage))


EFFECT = Effect(
    "charge_trapping",
    "electrical",
    "Trapped charge screens the field, or slow polarisation strengthens it (dielectric absorption)",
    _apply,
    PARAMETERS,
    off={"trap_fraction": 0.0},
    typical={"trap_fraction": 0.08, "tau_trap": 1.0, "deep_traps": 0.0},
    shapes={"tau_trap": (0.1, 0.3, 1.0, 3.0, 10.0)},
    refine=("deep_traps",),
)
