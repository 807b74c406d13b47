"""A drift with time: a zero that warms up, a coefficient that ages, fills or wears.

::

    signal' - signal |        .-----   1 / levelling: how soon it levels off
                     |     .'
                     |  .'             slope: drift
                     +------------- time since the start

Equation: signal' = signal + drift g; of a coefficient, coefficient' = coefficient (1 + drift g); g = t / (1 + levelling
t), t since the start of the recording. levelling = 0 is a straight line.

Source: E. O. Doebelin, "Measurement Systems", 5th ed., McGraw-Hill 2004 (drift of zero and span).

Typical: 1 % of the nominal value within ten of the usual times there.
"""

import sympy

from ..model.declare import Model
from ..model.effect import Effect
from ._site import SignalSite
from .places import Coefficient, Path

KINDS = (Path, Coefficient)
NEEDS = "nothing else"


def law(at: SignalSite) -> Effect:
    """The signal drifts, or the coefficient does."""
    factor = isinstance(at.place, Coefficient)
    unit, size = ("1", 1.0) if factor else (at.unit, at.nominal)
    usual = size / at.seconds
    drift = at.knob(
        "", at.per((unit, 1), ("s", -1)), f"Drift of {at.words}", 1e-3 * usual, -10 * usual, 10 * usual, off=0.0
    )
    levelling = at.knob(
        "levelling", "1/s", "One over the time in which it levels off", 0.0, 0.0, 1 / at.seconds, refine=True
    )

    def apply(model: Model) -> Model:
        model, signal = at.taken(model)
        model, t = at.state(
            model, "time", "s", "Time since the start", lambda _: sympy.Integer(1), sympy.Integer(0), at.seconds
        )
        gone = drift.symbol * t / (1 + levelling.symbol * t)
        return at.put(model, signal * (1 + gone) if factor else signal + gone)

    return at.effect(f"A drift in time changes {at.words}", "Doebelin 2004", apply, drift, levelling, lasting=factor)
