"""A preload: a constant part with the sign of a quantity (brushes' contact voltage, yield stress, Coulomb's friction).

::

    signal' |      .'
            |    .'
            |  .'
            | | size
      ------+-|------------ of
            |.'

Equation: signal' = signal + size tanh((of - turn) / corner), where turn = 0. Of a recorded speed that
drives the model, it is the friction in a force that is computed from it.

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
CORNER = 0.01  # of the nominal value of `of`, within which it turns
NEEDS = "`of`, a state; of a definition, an input or a definition too"


def law(at: SignalSite) -> Effect | None:
    """The signal has a constant part with the sign of another quantity."""
    of = at.other
    if of is None or (at.is_constant and of.name not in [s.quantity.name for s in at.model.states]):
        return None
    n = at.nominal
    size = at.knob("size", at.unit, f"Part of {at.words} that is there at once", 0.05 * n, 0.0, 5 * n, off=0.0)
    # Where no record passes it, a preload is an offset, or another curve.
    turn = at.knob("turn", of.unit, f"The {of.name} at which it turns", 0.0, -of.nominal, of.nominal, on=0.0)

    def apply(model: Model) -> Model:
        model, signal = at.taken(model)
        model, corner = at.constant(
            model, "corner", of.unit, CORNER * of.nominal, "Within which the preload turns", before=at.name("from")
        )
        return at.put(model, signal + size.symbol * sympy.tanh((of.symbol - turn.symbol) / corner))

    levels = {turn.quantity.name: of.name}
    return at.effect(f"A preload adds to {at.words}", "Gelb 1968", apply, size, turn, levels=levels)
