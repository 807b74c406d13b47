"""Softening of a coefficient with the largest excursion so far: Mullins' effect, damage, wear-in.

::

    stress |        .'
           |      .'.'
           |    .'.'       softer below the largest strain so far
           |  .'.'
           +------------- strain

Equation: largest follows |x| upwards; coefficient' = coefficient (1 - softening (1 - exp(-(largest - |x|) / width)) -
damage (1 - exp(-largest / width))), x the quantity `of`.

Source: R. W. Ogden, D. G. Roxburgh, "A pseudo-elastic model for the Mullins effect in filled rubber", Proc. R. Soc. A
455 (1999) 2861-2877; J. C. Simo, Comput. Methods Appl. Mech. Eng. 60 (1987) 153-173 (damage).

Typical: 10 to 30 %.
"""

import sympy

from ..model.declare import Model
from ..model.effect import Effect
from ..model.smooth import magnitude, positive_part
from ._site import SignalSite
from .places import Coefficient

KINDS = (Coefficient,)
NEEDS = "`of`, the quantity whose excursions count"
FOLLOWS, CORNER = 0.02, 1e-4  # of the usual time, and of the nominal value: how the largest follows
WIDTHS = (0.03, 0.2, 1.0)  # of the nominal value


def law(at: SignalSite) -> Effect | None:
    """Softer below the largest excursion so far."""
    of = at.other
    if of is None:
        return None
    n = of.nominal
    softer = at.knob("loss", "1", f"Loss of {at.words} below the largest {of.name}", 0.15, -1.0, 0.95, off=0.0)
    width = at.knob(
        "width",
        of.unit,
        "Distance from the largest over which it comes",
        0.2 * n,
        1e-4 * n,
        100 * n,
        shapes=[w * n for w in WIDTHS],
    )
    # a gain would make up for the loss, and what is left depends on the present excursion alone
    damage = at.knob("damage", "1", "Loss that stays", 0.0, 0.0, 0.95, off=0.0, refine=True)

    def apply(model: Model) -> Model:
        model, coefficient = at.taken(model)
        now = magnitude(of.symbol)
        model, follows = at.constant(
            model, "follows", "s", FOLLOWS * at.seconds, "How fast the largest follows", before=at.name("from")
        )
        model, corner = at.constant(
            model, "corner", of.unit, CORNER * n, "Distance over which it begins to follow", before=at.name("from")
        )
        model, largest = at.state(
            model,
            "largest",
            of.unit,
            f"Largest {of.name} so far",
            lambda z: positive_part(now - z) ** 2 / (positive_part(now - z) + corner) / follows,
            now,
            n,
        )
        below = 1 - sympy.exp(-positive_part(largest - now) / width.symbol)
        stays = 1 - sympy.exp(-largest / width.symbol)
        return at.put(model, coefficient * (1 - softer.symbol * below - damage.symbol * stays))

    return at.effect(
        f"The largest {of.name} so far softens {at.words}", "Ogden 1999", apply, softer, width, damage, lasting=True
    )
