"""Saturation: a sensor at 10 V, an amplifier, a pump or a valve at its limit.

::

    signal' |      .--------  centre + range
            |    .'
            +--.'----------- signal
            |.'
      ------'                 centre - range

Equation: signal' = signal - share ([signal - centre - range]+ - [centre - range - signal]+), [ ]+ the positive part.

Source: J.-J. E. Slotine, W. Li, "Applied Nonlinear Control", Prentice Hall 1991, section 5.2.

Typical: 0.5 to 1 of the largest value; beyond the largest value of a record it cannot be seen.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ..model.smooth import positive_part
from ._site import SignalSite
from .places import Coefficient, Path

KINDS = (Path, Coefficient)
NEEDS = "a quantity that is not constant; not the load of an equilibrium curve"
LEVELS = (0.35, 0.5, 0.7, 0.9, 1.2, 1.7, 2.4)  # of the nominal value
LOWER = (0.12, 0.2)  # the same, of a definition: how large it is in a model that lacks its limit is known least


def law(at: SignalSite) -> Effect | None:
    """The signal saturates."""
    if at.is_load or at.is_constant:
        return None
    n = at.nominal
    levels = (*LOWER, *LEVELS) if isinstance(at.place, Coefficient) else LEVELS
    end = at.knob(
        "range",
        at.unit,
        f"Largest {at.words}, from the centre",
        n,
        1e-3 * n,
        1e3 * n,
        shapes=[level * n for level in levels],
    )
    share = at.knob("share", "1", "Share of the signal that saturates", 1.0, 0.0, 1.0, off=0.0, on=1.0)
    centre = at.knob("centre", at.unit, "Middle of the range", 0.0, -100 * n, 100 * n, refine=True)

    def apply(model: Model) -> Model:
        model, signal = at.taken(model)
        middle, half = centre.symbol, end.symbol
        beyond = positive_part(signal - middle - half) - positive_part(middle - half - signal)
        return at.put(model, signal - share.symbol * beyond)

    return at.effect(f"Saturation limits {at.words}", "Slotine 1991", apply, end, share, centre)
