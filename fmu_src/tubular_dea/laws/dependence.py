"""A coefficient or a signal that depends on another quantity: temperature, position, another channel.

::

    coefficient' / coefficient |      .'   slope: dependence
                               |   .'
                           1 --+.'-------- of - start

Equation: coefficient' = coefficient exp(slope (of - start)), which keeps its sign at any value, also beyond what was
recorded; a signal' = signal + slope (of - start). The start is where the other quantity begins as declared (as 293 K;
its nominal value where that is free), so that parameters keep their meaning there. What is bent besides is another law:
with a bend as well, it would be any curve, and would fit better than the law that holds.

Source: E. O. Doebelin, "Measurement Systems", 5th ed., McGraw-Hill 2004 (modifying and interfering inputs).

Typical: 5 % of the coefficient (of the signal) at the nominal value of the other quantity.
"""

import sympy

from ..model.declare import Model
from ..model.effect import Effect
from ._site import SignalSite
from .places import Coefficient, Path

KINDS = (Path, Coefficient)
NEEDS = "`of`, the quantity it depends on; not the load of an equilibrium curve"


def law(at: SignalSite) -> Effect | None:
    """A factor (for signals a term) that goes with another quantity."""
    of = at.other
    if of is None or at.is_load:
        return None
    factor = isinstance(at.place, Coefficient)
    unit, size = ("1", 1.0) if factor else (at.unit, at.nominal)
    one = size / of.nominal
    slope = at.knob(
        "slope",
        at.per((unit, 1), (of.unit, -1)),
        f"{'Relative change' if factor else 'Change'} of {at.words} with {of.name}",
        0.05 * one,
        -20 * one,
        20 * one,
        off=0.0,
    )

    def apply(model: Model) -> Model:
        model, signal = at.taken(model)
        model, start = at.start_of(model, of)
        change = slope.symbol * (of.symbol - start)
        return at.put(model, signal * sympy.exp(change) if factor else signal + change)

    return at.effect(f"A dependence on {of.name} changes {at.words}", "Doebelin 2004", apply, slope)
