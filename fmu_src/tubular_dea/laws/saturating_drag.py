"""Drag that saturates: proportional to slow speeds, constant at high ones, so that under friction a load still creeps.

::

    force |      .--------  force
          |    .'
      ----+---'------------ velocity
      ----.'|  speed
          |

Equation: der(velocity) -= force tanh(velocity / speed). Dry friction, which holds a load at rest, is another law.

Source: E. Pennestri, V. Rossi, P. Salvini, P. P. Valentini, "Review and comparison of dry friction force models",
Nonlinear Dynamics 83 (2016) 1785-1801 (a smoothed Coulomb friction, as most simulation tools have it).

Typical: 5 % of the balance, within 0.3 to 30 % of the usual speed.
"""

import sympy

from ..model.declare import Model
from ..model.effect import Effect
from ._site import BalanceSite
from .places import Balance

KINDS = (Balance,)
NEEDS = "the balance of a speed"
SPEEDS = (3e-3, 3e-2, 0.3)  # of the usual speed
SLOWEST = 1e-3  # of it: what creeps less is dry friction, and is told as that


def law(at: BalanceSite) -> Effect | None:
    """A drag that grows with the speed up to a largest value."""
    if not at.moves:
        return None
    v, n = at.quantity.symbol, at.nominal
    force = at.knob(
        "force", at.rate_unit, f"Largest drag on {at.words}", 0.05 * at.rate_size, 0.0, 20 * at.rate_size, off=0.0
    )
    speed = at.knob(
        "speed",
        at.unit,
        "Speed at which it has three quarters of that",
        0.03 * n,
        SLOWEST * n,
        n,
        shapes=[s * n for s in SPEEDS],
    )

    def apply(model: Model) -> Model:
        return at.added(model, -force.symbol * sympy.tanh(v / speed.symbol))

    summary = f"A drag that saturates acts on {at.words}"
    return at.effect(summary, "Pennestri 2016", apply, force, speed, limits=("dry_friction",))
