"""A relaxing branch: a spring in series with a damper (Maxwell), a pore or side chamber that fills slowly.

::

      displacement             level |  |____|  | side
       o---[ spring ]---[ damper ]---|     |  |__| store
                                     o

Equation: d(slow)/dt = (x - slow) / tau; der(state) -= stiffness (x - slow), x the displacement (in a store, the state).
Of a stress that inputs alone move: stress' = stress + part (stress - slow), x the stress itself.

Source: J. C. Maxwell, "On the dynamical theory of gases", Phil. Trans. R. Soc. 157 (1867) 49-88; R. M. Christensen,
"Theory of Viscoelasticity", 2nd ed., Academic Press 1982.

Typical: a tenth of the balance, within 0.1 to 10 of the usual times there.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ._site import BalanceSite, SignalSite
from .places import Balance, Coefficient

KINDS = (Balance, Coefficient)
NEEDS = "a balance, or a definition that inputs alone move"
TIMES = (0.1, 1.0, 10.0)  # of the usual time there
LONGEST = 20.0  # longer, and it holds a store at its start
SLOW_TIMES = (*TIMES, 100.0)  # in the balance of a speed, where the usual time is that of a ringing
SLOWEST = 300.0
STRESS_TIMES = (0.1, 1.0, 10.0, 100.0)  # of the usual time of a stress without a balance


def law(at: SignalSite | BalanceSite) -> Effect | None:
    """A term that follows changes and then relaxes."""
    if isinstance(at, BalanceSite):
        return _branch(at)
    return _stress(at) if at.is_static and not at.is_constant else None


def _stress(at: SignalSite) -> Effect:
    part = at.knob("part", "1", f"Branch over {at.words} at rest", 0.1, 0.0, 100.0, off=0.0)
    tau = at.time_constant("Time within which it relaxes", 10.0, 5e-2, 500.0, STRESS_TIMES)

    def apply(model: Model) -> Model:
        model, stress, slow = at.followed(model, tau, "relaxed")
        return at.put(model, stress + part.symbol * (stress - slow))

    return at.effect(f"A relaxing branch stiffens {at.words}", "Christensen 1982", apply, part, tau)


def _branch(at: BalanceSite) -> Effect:
    x = at.coordinate
    unit, size = at.per((at.rate_unit, 1), (x.unit, -1)), at.rate_size / x.nominal
    stiffness = at.knob("stiffness", unit, f"Branch on {x.name}", 0.1 * size, -0.2 * size, 1e4 * size, off=0.0)
    longest, times = (SLOWEST, SLOW_TIMES) if at.moves else (LONGEST, TIMES)
    tau = at.time_constant("Time within which it relaxes", 1.0, 1e-2, longest, times)

    def apply(model: Model) -> Model:
        model, slow = at.state(
            model, "slow", x.unit, f"Relaxed {x.name}", lambda z: (x.symbol - z) / tau.symbol, x.symbol, x.nominal
        )
        return at.added(model, -stiffness.symbol * (x.symbol - slow))

    return at.effect(f"A relaxing branch acts on {at.words}", "Christensen 1982", apply, stiffness, tau)
