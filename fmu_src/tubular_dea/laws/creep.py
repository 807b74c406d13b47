"""Creep: a part of a signal follows slowly, as in load cells, dielectrics (absorption) and elastomers.

::

    signal   ___|-----      signal'  ___|.---   the last part within tau

Equation: d(slow)/dt = (signal - slow) / tau; signal' = signal + creep (slow - signal).

Source: OIML R 60 (creep of load cells); S. Westerlund, L. Ekstam, "Capacitor theory", IEEE Trans. Dielectr. Electr.
Insul. 1 (1994) 826-839.

Typical: 1 to 10 % within one to a hundred of the usual times there. A negative part is an overshoot.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ._site import SignalSite
from .places import Path

KINDS = (Path,)
NEEDS = "nothing else"
TIMES = (1.0, 10.0, 100.0)  # of the usual time there


def law(at: SignalSite) -> Effect:
    """A part of the signal follows slowly."""
    part = at.knob("part", "1", f"Part of {at.words} that is slow", 0.05, -0.2, 0.5, off=0.0)
    tau = at.time_constant("Time within which it follows", 10.0, 5e-2, 300.0, TIMES)

    def apply(model: Model) -> Model:
        model, signal, slow = at.followed(model, tau, "as it creeps")
        return at.put(model, signal + part.symbol * (slow - signal))

    return at.effect(f"A part of {at.words} comes slowly, or goes again", "OIML R 60", apply, part, tau)
