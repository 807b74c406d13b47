"""Drag with the square of the speed: turbulence in a damper, air, an orifice.

::

    force |       .'
          |    .-'
      ----+--''--------- velocity
      .-' |
    .'    |

Equation: der(velocity) -= drag v |v|.

Source: H. E. Merritt, "Hydraulic Control Systems", Wiley 1967 (orifices); S. F. Hoerner, "Fluid-Dynamic Drag", 1965.

Typical: a tenth of the balance at the nominal velocity.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ..model.smooth import magnitude
from ._site import BalanceSite
from .places import Balance

KINDS = (Balance,)
NEEDS = "the balance of a speed"


def law(at: BalanceSite) -> Effect | None:
    """Drag with the square of the velocity."""
    if not at.moves:
        return None
    v, size = at.quantity.symbol, at.rate_size / at.nominal**2
    drag = at.knob(
        "",
        at.per((at.rate_unit, 1), (at.unit, -2)),
        f"Quadratic drag on {at.words}",
        0.1 * size,
        0.0,
        1e3 * size,
        off=0.0,
    )

    def apply(model: Model) -> Model:
        return at.added(model, -drag.symbol * v * magnitude(v))

    return at.effect(f"A quadratic drag acts on {at.words}", "Hoerner 1965", apply, drag)
