"""A leak: what a balance holds goes away in proportion to it; of a speed, a viscous drag.

::

     in --->.-------.
            | ~~~~~ |---> leak x
            '-------'

Equation: der(x) -= leak x.

Source: H. E. Merritt, "Hydraulic Control Systems", Wiley 1967 (laminar leakage, viscous damping).

Typical: a tenth of the balance at the nominal value.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ._site import BalanceSite
from .places import Balance

KINDS = (Balance,)
NEEDS = "nothing else"


def law(at: BalanceSite) -> Effect:
    """What leaves in proportion to what is there."""
    x, size = at.quantity.symbol, at.rate_size / at.nominal
    unit = at.per((at.rate_unit, 1), (at.unit, -1))
    leak = at.knob("", unit, f"Leak of {at.words} over it", 0.1 * size, 0.0, 1e3 * size, off=0.0)

    def apply(model: Model) -> Model:
        return at.added(model, -leak.symbol * x)

    what = f"A viscous drag acts on {at.words}" if at.moves else f"{at.words} leaks away in proportion to it"
    return at.effect(what, "Merritt 1967", apply, leak)
