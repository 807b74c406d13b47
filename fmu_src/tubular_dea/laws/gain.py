"""A gain error: the scale of a sensor, or of an input, is off.

::

    signal ---[ gain ]--->  gain signal

Equation: signal' = gain signal; of a temperature, whose zero is elsewhere on each scale, from where it starts:
signal' = signal + (gain - 1) (signal - start).

Source: E. O. Doebelin, "Measurement Systems", 5th ed., McGraw-Hill 2004 (zero and span of instruments).

Typical: 0.97 to 1.03.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ._site import SignalSite, alike
from .places import Path

KINDS = (Path,)
NEEDS = "nothing else"


def law(at: SignalSite) -> Effect:
    """The signal times a factor."""
    gain = at.knob("", "1", f"Factor on {at.words}", 1.03, 0.2, 5.0, off=1.0)

    def apply(model: Model) -> Model:
        model, signal = at.taken(model)
        if alike(at.unit, "K"):
            model, start = at.start_of(model, at.quantity)
            return at.put(model, start + gain.symbol * (signal - start))
        return at.put(model, gain.symbol * signal, lambda held: held / gain.symbol)

    return at.effect(f"The scale of {at.words} is off", "Doebelin 2004", apply, gain, exact=True)
