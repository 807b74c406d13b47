"""Dry friction, independent of speed: it sticks until the load has reversed far enough.

::

    force |      .--------->      force
          |     /       /
          |    /       /          elastic over `travel`, at every turn
          |   /       /
          |  <--------'           -force
          +------------------ displacement

Equation: der(velocity) -= force z (1 + breakaway / (1 + (v / speed)^2)); travel dz/dt = v - [v z]+ z [z^2 - onset]+ /
(1 - onset), [ ]+ the positive part: elastic up to z^2 = onset and on every way back, sliding at z = 1. Small vibrations
do not wear it down. Beside the force of sliding, `breakaway` holds at rest and fades with the speed (Stribeck).

Source: P. Dupont, V. Hayward, B. Armstrong, F. Altpeter, "Single state elastoplastic friction models", IEEE Trans.
Automat. Contr. 47 (2002) 787-792; B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, "A survey of models, analysis
tools and compensation methods for the control of machines with friction", Automatica 30 (1994) 1083-1138 (Stribeck).

Typical: 5 % of the balance, within 0.1 to 10 % of the displacement; breakaway 0 to 1, within 1 to 10 % of the speed.
"""

import sympy

from ..model.declare import Model
from ..model.effect import Effect
from ..model.smooth import positive_part
from ._site import BalanceSite
from .places import Balance

KINDS = (Balance,)
NEEDS = "the balance of a speed"
SHORTEST = 1e-7  # of it: the least travel, as a slide with ideal friction moves on by the root of it at every turn
TRAVELS = (1e-3, 1e-2, 1e-1)  # of the displacement's usual size


def law(at: BalanceSite) -> Effect | None:
    """Elastoplastic friction."""
    if not at.moves:
        return None
    v, (length, size) = at.quantity.symbol, at.travelled
    force = at.knob(
        "force", at.rate_unit, f"Dry friction on {at.words}", 0.05 * at.rate_size, 0.0, 20 * at.rate_size, off=0.0
    )
    travel = at.knob(
        "travel",
        length,
        "Displacement within which it builds up",
        0.01 * size,
        SHORTEST * size,
        10 * size,
        shapes=[t * size for t in TRAVELS],
    )
    onset = at.knob("onset", "1", "Square of its share at which sliding begins", 0.95, 0.0, 0.98, refine=True)
    more = at.knob("breakaway", "1", "What it has more at rest, over its size", 0.0, 0.0, 3.0, refine=True)
    speed = at.knob(
        "speed",
        at.unit,
        "Speed at which half of that is left",
        0.05 * at.nominal,
        1e-4 * at.nominal,
        at.nominal,
        refine=True,
    )

    def apply(model: Model) -> Model:
        c = onset.symbol
        model, z = at.state(
            model,
            "state",
            "1",
            "Friction over its largest value",
            lambda z: (v - positive_part(v * z) * z * positive_part(z**2 - c) / (1 - c)) / travel.symbol,
            sympy.Integer(0),
        )
        stribeck = 1 + more.symbol / (1 + (v / speed.symbol) ** 2)
        return at.added(model, -force.symbol * z * stribeck)

    return at.effect(
        f"Dry friction acts on {at.words}", "Dupont 2002", apply, force, travel, onset, more, speed, delicate=True
    )
