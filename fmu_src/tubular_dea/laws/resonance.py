"""A resonance in a signal's path: a line with mass and volume, the membrane of a sensor, a fixture.

::

    signal ---[ omega^2 / (s^2 + 2 damping omega s + omega^2) ]--->

Equation: d2(swing)/dt2 = omega^2 (signal - swing) - 2 damping omega d(swing)/dt;
signal' = signal + share (swing - signal).

Source: E. O. Doebelin, "Measurement Systems", 5th ed., McGraw-Hill 2004, section 6.6 (transmission lines).

Typical: an angular frequency of one over the usual time there, damped critically; where none is declared, an instrument
is as late as one with a lag.
"""

from dataclasses import replace

from ..model.declare import Model
from ..model.effect import Effect
from ._site import SignalSite
from .places import Path

KINDS = (Path,)
NEEDS = "nothing else"
AS_LATE = 4.0  # over the usual time there: twice the damping over it is as long as a lag usually is
FREQUENCIES, DAMPINGS = (0.3, 1.0, 3.0), (0.4, 1.5)  # over the usual time there


def law(at: SignalSite) -> Effect:
    """The signal follows as a damped oscillator does."""
    usual = 1 / at.seconds
    omega = at.knob(
        "omega",
        "1/s",
        f"Angular eigenfrequency of {at.words}",
        usual,
        0.02 * usual,
        200 * usual,
        shapes=[f * usual for f in FREQUENCIES],
        trade=-1,
    )
    if at.quickness < 1:
        omega = replace(omega, typical=AS_LATE / at.quickness * usual)
    damping = at.knob("damping", "1", "Its damping ratio", 1.0, 0.02, 50.0, shapes=DAMPINGS)
    share = at.knob("share", "1", "Share of the signal that resonates", 1.0, 0.0, 1.0, off=0.0, on=1.0)

    def apply(model: Model) -> Model:
        model, signal = at.taken(model)
        model, swing = at.swinging(model, signal, omega.symbol, damping.symbol)
        return at.put(model, signal + share.symbol * (swing - signal))

    summary = f"A lag of second order (a line, a filter, a resonance) acts on {at.words}"
    return at.effect(summary, "Doebelin 2004", apply, omega, damping, share, limits=("lag",))
