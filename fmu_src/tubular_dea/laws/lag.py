"""A first-order lag: a sensor's filter, an amplifier with a capacitive load, a flow that develops.

::

    signal ---[ 1 / (tau s + 1) ]--->

Equation: d(slow)/dt = (signal - slow) / tau; signal' = signal + share (slow - signal).

Source: E. O. Doebelin, "Measurement Systems", 5th ed., McGraw-Hill 2004 (first-order instruments).

Typical: half the usual time there; where none is declared, an instrument's is a twentieth of the plant's own times.
"""

from dataclasses import replace

from ..model.declare import Model
from ..model.effect import Effect
from ._site import SignalSite
from .places import Coefficient, Path

KINDS = (Path, Coefficient)
NEEDS = "a quantity that is not constant"
TIMES = (0.15, 0.5, 1.5, 5.0, 15.0)  # of the usual time there


def law(at: SignalSite) -> Effect | None:
    """The signal follows with a time constant."""
    if at.is_constant:
        return None
    tau = at.time_constant(f"Time constant of {at.words}", 0.5, 5e-3, 500.0, TIMES, trade=1)
    tau = replace(tau, typical=tau.typical * at.quickness)
    share = at.knob("share", "1", "Share of the signal that lags", 1.0, 0.0, 1.0, off=0.0, on=1.0)

    def apply(model: Model) -> Model:
        model, signal, slow = at.followed(model, tau, "smoothed")
        return at.put(model, signal + share.symbol * (slow - signal))

    return at.effect(f"A lag smooths {at.words}", "Doebelin 2004", apply, tau, share)
