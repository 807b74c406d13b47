"""A pure delay: transport, exposure and transfer, clocks that differ.

::

    signal(t) ---[ wait ]--->  signal(t - delay)

Equation: signal'(t) = signal(t - delay); before the start everything is as it is there. What drives the plant may
also act before it is recorded, where the place says that its record may be `delayed`: the delay is negative then. (An
FMU, which is given what drives it, cannot look ahead: a negative delay is none there.)

Source: J. E. Normey-Rico, E. F. Camacho, "Control of Dead-time Processes", Springer 2007.

Typical: half the usual time there.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ._site import SignalSite
from .places import Path

KINDS = (Path,)
NEEDS = "a signal that the model does not delay already"
LONGEST = 25.0  # of the usual time there: what the memory is made for
STRENGTHS = (0.3, 0.8)  # of the usual time there: where a plant rings, its response turns with a delay


def law(at: SignalSite) -> Effect | None:
    """The signal is delayed."""
    if at.is_late:
        return None
    most = LONGEST * at.seconds
    # A held input steps at samples: the tangent at no delay sees it come later alone, and not that it came before.
    sides = (1, -1) if at.may_be_delayed and at.place.name in at.held else (1,)
    delay = at.knob(
        "",
        "s",
        f"Delay of {at.words}",
        0.5 * at.seconds,
        -most if at.may_be_delayed else 0.0,
        most,
        off=0.0,
        strengths=[side * strong * at.seconds for side in sides for strong in STRENGTHS],
    )

    def apply(model: Model) -> Model:
        return at.delayed(model, delay)

    either = " (where negative, it acts before it is recorded)" if at.may_be_delayed else ""
    return at.effect(f"A pure delay acts on {at.words}{either}", "Normey-Rico 2007", apply, delay, exact=True)
