"""An echo of an input: a reflected wave, a line without termination.

::

    signal ----+----------------(+)--->
               |                 ^
               '---[ wait ]---[ part ]

Equation: signal'(t) = signal(t) + part (signal(t - delay) - signal(t)): at rest nothing changes.

Source: N. Westerhof, P. Sipkema, G. C. van den Bos, G. Elzinga, "Forward and backward waves in the arterial system",
Cardiovasc. Res. 6 (1972) 648-656; D. M. Pozar, "Microwave Engineering", Wiley 2011 (reflections on lines).

Typical: 10 to 50 %, after one to ten of the usual times there.
"""

from ..model.change import delayed_input
from ..model.declare import Model
from ..model.effect import Effect
from ._site import SignalSite
from .places import Path

KINDS = (Path,)
NEEDS = "an input"
TIMES = (1.0, 3.0, 10.0)  # of the usual time there
MOST = 0.9  # what all comes later is a delay
LONGEST = 50.0  # of the usual time there: what the memory is made for


def law(at: SignalSite) -> Effect | None:
    """A part of what drives the plant comes later."""
    if not at.is_input:
        return None
    part = at.knob("part", "1", f"Part of {at.words} that comes later", 0.1, -2.0, MOST, off=0.0)
    delay = at.knob(
        "delay",
        "s",
        "By how much",
        3 * at.seconds,
        0.0,
        LONGEST * at.seconds,
        shapes=[share * at.seconds for share in TIMES],
    )

    def apply(model: Model) -> Model:
        model, signal = at.taken(model)
        model, delayed = delayed_input(model, at.place.name, at.name("late"), delay.quantity.name)
        return at.put(model, signal + part.symbol * (delayed - signal))

    return at.effect(f"An echo follows {at.words}", "Westerhof 1972", apply, part, delay)
