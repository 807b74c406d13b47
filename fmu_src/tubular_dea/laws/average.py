"""A moving average: a laser that averages its last readings, a smoothing filter of an instrument.

::

    signal ---[ mean over the last `window` ]--->

Equation: window^2/12 d2(mean)/dt2 + window/2 d(mean)/dt + mean = signal; signal' = signal + share (mean - signal).
These are the first terms of (window s) / (1 - exp(-window s)); the next is of the fourth order. It is the Bessel filter
of second order, so an instrument with that one is found as well: its cut-off is at 0.43 / window.

Source: S. W. Smith, "The Scientist and Engineer's Guide to Digital Signal Processing", 1997, chapter 15 (averages);
W. E. Thomson, "Delay networks having maximally flat frequency characteristics", Proc. IEE 96 (1949) 487-490.

Typical: the usual time there; where none is declared, an instrument's is a tenth of the plant's own times.
"""

import sympy

from ..model.declare import Model
from ..model.effect import Effect
from ._site import SignalSite
from .places import Path

KINDS = (Path,)
NEEDS = "an output"
WINDOWS = (0.3, 1.0, 3.0, 10.0, 30.0)  # of the usual time there: each is as late as one of the lag's time constants


def law(at: SignalSite) -> Effect | None:
    """What is put out is the mean of the last moments."""
    if at.is_input:
        return None
    usual = at.seconds
    window = at.knob(
        "window",
        "s",
        f"How long {at.words} is averaged",
        usual * at.quickness,
        0.01 * usual,
        1000 * usual,
        shapes=[w * usual for w in WINDOWS],
        trade=1,
    )
    share = at.knob("share", "1", "Share of the signal that is averaged", 1.0, 0.0, 1.0, off=0.0, on=1.0)

    def apply(model: Model) -> Model:
        model, signal = at.taken(model)
        model, mean = at.swinging(model, signal, sympy.sqrt(12) / window.symbol, sympy.sqrt(3) / 2)
        return at.put(model, signal + share.symbol * (mean - signal))

    return at.effect(f"A moving average smooths {at.words}", "Thomson 1949", apply, window, share)
