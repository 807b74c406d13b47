"""A dead zone: nothing happens near zero (overlap of a valve, stiction in a drive, a threshold).

::

    signal' |        .'
            |      .'
      ------+-----'---------- signal
        .'  |    width
      .'    |

Equation: signal' = signal - ([signal + width]+ - [signal - width]+ - width), [ ]+ the positive part.

Source: J.-J. E. Slotine, W. Li, "Applied Nonlinear Control", Prentice Hall 1991, section 5.2.

Typical: 1 to 10 % of the nominal value.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ..model.smooth import positive_part
from ._site import SignalSite
from .places import Coefficient, Path

KINDS = (Path, Coefficient)
MOST = 0.25  # of the nominal value
MOST_WITHIN = (
    5.0  # of that of a definition: what opens above a threshold (a collapsible tube, a relief valve) flows more
)
NEEDS = "a quantity that is not constant; not the load of an equilibrium curve"


def law(at: SignalSite) -> Effect | None:
    """The signal is zero below a threshold."""
    if at.is_load or at.is_constant:
        return None
    n = at.nominal
    most = (MOST_WITHIN if isinstance(at.place, Coefficient) else MOST) * n
    width = at.knob("width", at.unit, f"Largest {at.words} that does nothing", 0.05 * n, 0.0, most, off=0.0)

    def apply(model: Model) -> Model:
        model, signal = at.taken(model)
        w = width.symbol
        swallowed = positive_part(signal + w) - positive_part(signal - w) - w
        return at.put(model, signal - swallowed)

    return at.effect(f"A dead zone suppresses small {at.words}", "Slotine 1991", apply, width)
