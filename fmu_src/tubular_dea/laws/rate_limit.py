"""A rate limit: the slew rate of an amplifier, a servo valve, a pump that runs up.

::

    signal   ___|-----      signal'  ___/-----   slope: limit

Equation: d(reached)/dt = limit tanh((signal - reached) / b), b = limit settling / (1 + limit settling / b_most);
signal' = signal + share (reached - signal). What is nearer than b follows as through a lag: of `settling`, a fiftieth
of the usual time there, where the limit is small, and of none where there is no limit (b_most: a fiftieth of the usual
signal).

Source: H. E. Merritt, "Hydraulic Control Systems", Wiley 1967; data sheets of amplifiers (Trek 10/10B-HS: slew rate).

Typical: the nominal value within three of the usual times there.
"""

import sympy

from ..model.declare import Model
from ..model.effect import Effect
from ._site import SignalSite
from .places import Path

KINDS = (Path,)
NEEDS = "nothing else"
SETTLING = 0.02  # of the usual time: shorter than what can be told apart, longer than the integrator minds
NEARBY = 0.02  # of the usual signal: the same
SPEEDS = (0.03, 0.1, 0.3, 1.0, 3.0)  # nominal values within the usual time


def law(at: SignalSite) -> Effect:
    """The signal changes no faster than a limit."""
    fast = at.nominal / at.seconds
    limit = at.knob(
        "limit",
        at.per((at.unit, 1), ("s", -1)),
        f"Largest rate of {at.words}",
        0.3 * fast,
        1e-6 * fast,
        1e6 * fast,
        shapes=[speed * fast for speed in SPEEDS],
        trade=-1,
    )
    share = at.knob("share", "1", "Share of the signal that is limited", 1.0, 0.0, 1.0, off=0.0, on=1.0)

    def apply(model: Model) -> Model:
        close = "From where on it follows through a lag"
        model, most = at.constant(model, "close", at.unit, NEARBY * at.nominal, close)

        def rate(signal: sympy.Symbol, z: sympy.Symbol, settling: sympy.Symbol) -> sympy.Expr:
            nearby = limit.symbol * settling / (1 + limit.symbol * settling / most)
            return limit.symbol * sympy.tanh((signal - z) / nearby)

        reached, quick = f"What {at.words} has reached", "How fast small changes follow"
        model, signal, z = at.chased(model, ("reached", reached), ("settling", SETTLING, quick), rate)
        return at.put(model, signal + share.symbol * (z - signal))

    return at.effect(f"A rate limit acts on {at.words}", "Merritt 1967", apply, limit, share)
