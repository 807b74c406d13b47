"""A relaxing branch: a spring in series with a damper (Maxwell), a pore or side chamber that fills slowly.

::

      displacement             level |  |____|  | side
       o---[ spring ]---[ damper ]---|     |  |__| store
                                     o

Equation: d(slow)/dt = (x - slow) / tau; der(state) -= stiffness (x - slow), x the displacement (in a store, the state).

Source: J. C. Maxwell, "On the dynamical theory of gases", Phil. Trans. R. Soc. 157 (1867) 49-88; R. M. Christensen,
"Theory of Viscoelasticity", 2nd ed., Academic Press 1982.

Typical: a tenth of the balance, within 0.1 to 10 of the usual times there.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ._site import BalanceSite
from .places import Balance

KINDS = (Balance,)
NEEDS = "nothing else"
TIMES = (0.1, 1.0, 10.0)  # of the usual time there
LONGEST = 20.0  # longer, and it holds the plant at its start


def law(at: BalanceSite) -> Effect:
    """A term that follows changes and then relaxes."""
    x = at.coordinate
    unit, size = at.per((at.rate_unit, 1), (x.unit, -1)), at.rate_size / x.nominal
    stiffness = at.knob("stiffness", unit, f"Branch on {x.name}", 0.1 * size, -0.2 * size, 1e4 * size, off=0.0)
    tau = at.knob(
        "tau",
        "s",
        "Time within which it relaxes",
        at.seconds,
        1e-2 * at.seconds,
        LONGEST * at.seconds,
        shapes=[share * at.seconds for share in TIMES],
    )

    def apply(model: Model) -> Model:
        model, slow = at.state(
            model, "slow", x.unit, f"Relaxed {x.name}", lambda z: (x.symbol - z) / tau.symbol, x.symbol, x.nominal
        )
        return at.added(model, -stiffness.symbol * (x.symbol - slow))

    return at.effect(f"A relaxing branch acts on {at.words}", "Christensen 1982", apply, stiffness, tau)
