"""Rectification: what a sensor or a drive that does not see the sign makes of a signal (a pulse counter, a diode).

::

    signal' | '.      .'
            |   '.  .'   part = 1
      ------+-----''-----------  signal
            |   .'
            | .'         part = 0

Equation: signal' = signal + part (|signal| - signal): all of it with a part of 1, its positive half with 0.5.

Source: T. Wigren, J. Schoukens, "Coupled electric drives data set and reference models", Uppsala University 2017 (pulse
counters measure a speed without its sign).

Typical: a tenth of the negative half.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ..model.smooth import magnitude
from ._site import SignalSite
from .places import Path

KINDS = (Path,)
NEEDS = "a quantity that is not constant; not the load of an equilibrium curve"
MOST = 1.2  # a part of 1 is inside the bounds


def law(at: SignalSite) -> Effect | None:
    """The negative half is turned over, or a part of it."""
    if at.is_load or at.is_constant:
        return None
    part = at.knob("part", "1", f"Part of negative {at.words} that is turned over", 0.1, 0.0, MOST, off=0.0)

    def apply(model: Model) -> Model:
        model, signal = at.taken(model)
        return at.put(model, signal + part.symbol * (magnitude(signal) - signal))

    return at.effect(f"Negative {at.words} is rectified", "Wigren 2017", apply, part, exact=True)
