"""A preload: a constant part with the sign of the signal (brushes' contact voltage, yield stress, Coulomb's friction).

::

    signal' |      .'
            |    .'
            |  .'
            | | size
      ------+-|------------ signal
            |.'

Equation: signal' = signal + size tanh(signal / corner).

Source: A. Gelb, W. E. Vander Velde, "Multiple-Input Describing Functions and Nonlinear System Design", McGraw-Hill
1968, appendix B (preload); W. H. Herschel, R. Bulkley, Kolloid-Zeitschrift 39 (1926) 291 (yield stress).

Typical: 1 to 10 % of the nominal value.
"""

import sympy

from ..model.declare import Model
from ..model.effect import Effect
from ._site import SignalSite
from .places import Coefficient

KINDS = (Coefficient,)
CORNER = 0.01  # of the nominal value, within which it turns
NEEDS = "a definition that is not constant"


def law(at: SignalSite) -> Effect | None:
    """The signal has a constant part with its own sign."""
    if at.is_constant:
        return None
    size = at.knob(
        "size", at.unit, f"Part of {at.words} that is there at once", 0.05 * at.nominal, 0.0, 5 * at.nominal, off=0.0
    )

    def apply(model: Model) -> Model:
        model, signal = at.taken(model)
        model, corner = at.constant(
            model, "corner", at.unit, CORNER * at.nominal, "Within which the preload turns", before=at.name("from")
        )
        return at.put(model, signal + size.symbol * sympy.tanh(signal / corner))

    return at.effect(f"A preload adds to {at.words}", "Gelb 1968", apply, size)
