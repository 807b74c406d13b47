"""A lead: an inertance behind a resistance, a coil, a damper beside a spring, a record that comes late.

::

    signal ---+--------------------------(+)--->
              |                           ^
              '---[ lead s / (tau s + 1) ]'

Equation: d(slow)/dt = (signal - slow) / tau; signal' = signal + lead (signal - slow) / tau: the signal and `lead` times
its rate, taken over a short time tau, as rates of what is recorded with noise can be. What is held between samples has
no rate there, and what a state moves has its own balance.

Source: N. Stergiopulos, B. E. Westerhof, N. Westerhof, "Total arterial inertance as the fourth element of the
windkessel model", Am. J. Physiol. 276 (1999) H81-H88; E. O. Doebelin, "Measurement Systems", 5th ed., McGraw-Hill 2004.

Typical: half the usual time there, its rate taken over a tenth.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ._site import SignalSite
from .places import Coefficient, Path

KINDS = (Path, Coefficient)
NEEDS = "an input that is not held and whose rate the model does not use, or a definition that such inputs alone move"
LONGEST = 50.0  # of the usual time there
TIMES = (0.005, 0.03, 0.2)  # of the usual time there, over which the rate is taken
SLOWEST = 0.5  # longer, and it is a relaxing branch


def law(at: SignalSite) -> Effect | None:
    """The signal and a part of its rate."""
    if at.is_constant or not at.has_rate or (isinstance(at.place, Path) and not at.is_input):
        return None
    lead = at.knob("", "s", f"Lead of {at.words}", 0.5 * at.seconds, 0.0, LONGEST * at.seconds, off=0.0)
    tau = at.time_constant("Time over which its rate is taken", 0.1, 1e-3, SLOWEST, TIMES)

    def apply(model: Model) -> Model:
        model, signal, slow = at.followed(model, tau, "a moment ago")
        return at.put(model, signal + lead.symbol * (signal - slow) / tau.symbol)

    why = ", as where its monitor lags" if isinstance(at.place, Path) else ""
    return at.effect(f"The rate of {at.words} adds to it{why}", "Stergiopulos 1999", apply, lead, tau)
