"""A slow release: what drives the plant rises at once, and falls with a time constant.

::

    signal   __|-----|______      signal'  __|-----\\.__      tau
                                                     '---

Equation: d(held)/dt = (signal - held) / tau where the signal is below, else (signal - held) / settling, a fiftieth of
the usual time there; signal' = signal + share (held - signal).

Source: P. Beater, "Pneumatic Drives", Springer 2007 (chambers fill faster than they vent); data sheets of high-voltage
modules (EMCO Q series: without a load the output falls through a bleeder alone).

Typical: half the usual time there. A module of 5 kV with 1 nF and a bleeder of 100 MOhm takes 0.1 s.
"""

import sympy

from ..model.declare import Model
from ..model.effect import Effect
from ..model.smooth import ramp
from . import lag
from ._site import SignalSite
from .places import Path

KINDS = (Path,)
NEEDS = "an input"
SETTLING = 0.02  # of the usual time: shorter than what can be told apart, longer than the integrator minds
CORNER = 1e-4  # of the nominal value: a rise as small follows like a fall, so that the slope has no kink there


def law(at: SignalSite) -> Effect | None:
    """What drives the plant falls more slowly than it rises."""
    if not at.drives:
        return None
    tau = at.time_constant(f"Time constant with which {at.words} falls", 0.5, 5e-3, 500.0, lag.TIMES, trade=1)
    share = at.knob("share", "1", "Share of the signal that falls slowly", 1.0, 0.0, 1.0, off=0.0, on=1.0)

    def apply(model: Model) -> Model:
        held, quick = f"What {at.words} is held at", "How fast a rise follows"
        model, corner = at.constant(model, "corner", at.unit, CORNER * at.nominal, "Rises that follow slowly, too")

        def rate(signal: sympy.Symbol, z: sympy.Symbol, settling: sympy.Symbol) -> sympy.Expr:
            rise = ramp(signal - z, corner)
            return rise / settling + (signal - z - rise) / tau.symbol

        model, signal, z = at.chased(model, ("held", held), ("settling", SETTLING, quick), rate)
        return at.put(model, signal + share.symbol * (z - signal))

    return at.effect(f"What gives {at.words} releases it slowly", "Beater 2007", apply, tau, share)
