"""Warming by its own losses: a coefficient follows a flow's square slowly, as a coil's resistance that of its current.

::

    coefficient' / coefficient |      .----- 1 + rise (flow / usual)^2
                               |   .'
                             1 +--'--------- within tau of a step of the flow

Equation: d(warmth)/dt = ((of / usual)^2 - warmth) / tau; coefficient' = coefficient (1 + rise warmth), `usual` the
nominal value of the flow, or force, of which losses go with the square.

Source: W. Leonhard, "Control of Electrical Drives", 3rd ed., Springer 2001, ch. 4 (heating of a homogeneous body).

Typical: 10 % at the nominal value, within ten to a thousand of the usual times there. Copper rises by 4 % in 10 K.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ._site import SignalSite
from .places import Coefficient

KINDS = (Coefficient,)
NEEDS = "`of`, the quantity whose square warms it"
TIMES = (10.0, 100.0, 1000.0)  # of the usual time there


def law(at: SignalSite) -> Effect | None:
    """A factor that rises slowly with the square of another quantity."""
    of = at.other
    if of is None:
        return None
    rise = at.knob("rise", "1", f"Rise of {at.words} at the usual {of.name}", 0.1, -0.9, 5.0, off=0.0)
    tau = at.time_constant("Time within which it warms up", 100.0, 1.0, 1e4, TIMES)

    def apply(model: Model) -> Model:
        model, coefficient = at.taken(model)
        model, usual = at.constant(model, "usual", of.unit, of.nominal, f"Usual {of.name}", before=at.name("from"))
        heat = (of.symbol / usual) ** 2
        model, warmth = at.state(model, "warmth", "1", "Warmth", lambda w: (heat - w) / tau.symbol, heat)
        return at.put(model, coefficient * (1 + rise.symbol * warmth))

    return at.effect(f"{at.words.capitalize()} warms up by {of.name}", "Leonhard 2001", apply, rise, tau, lasting=True)
