"""A store that does not fall below a level: a current behind a diode, a flow behind a check valve, an empty tank.

::

    state |.
          | '.            .'
    level |   '.________.'      what the balance would take below is held back
          |     '.    .'
          |       '..'  without

Equation: der(state) += part [-rest]+ gate, rest what the balance gives without it, [ ]+ the positive part; gate goes
from 0 to 1 as the state falls by `corner` below the level. With a part of 1 the state stays there until the balance
raises it again. The corner is a thousandth of the nominal value.

Source: R. W. Erickson, D. Maksimovic, "Fundamentals of Power Electronics", 3rd ed., Springer 2020, ch. 5 (a
diode ends the current of a coil: discontinuous conduction).

Typical: at zero, a tenth of what would be taken.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ..model.smooth import positive_part
from . import spill_over
from ._site import BalanceSite
from .places import Balance

KINDS = (Balance,)
NEEDS = spill_over.NEEDS
LEVELS = (-0.5, -0.2, 0.0, 0.2, 0.5)  # of the state's nominal value
PARTS = (0.5, 1.0)  # once it is held, nothing is as it was: the tangent at "off" says little
CORNER = 1e-3  # of the state's nominal value: where it is held


def law(at: BalanceSite) -> Effect | None:
    """The store is held at a level."""
    if at.moves or at.model.curve:
        return None
    n = at.nominal
    part = at.knob("part", "1", f"Part of what would take {at.words} lower", 0.1, 0.0, 1.0, off=0.0, strengths=PARTS)
    level = at.knob(
        "level", at.unit, "Level where it is held", 0.0, -100 * n, 100 * n, shapes=[share * n for share in LEVELS]
    )

    def apply(model: Model) -> Model:
        model, corner = at.constant(model, "corner", at.unit, CORNER * n, "Depth over which it is caught")
        model, rest = at.rest(model)
        below = positive_part(level.symbol - at.quantity.symbol) / corner
        gate = below - positive_part(below - 1)
        return at.added(model, part.symbol * positive_part(-rest) * gate)

    return at.effect(
        f"A store falls more slowly, or not at all, below a level: {at.words}",
        "Erickson 2020",
        apply,
        part,
        level,
        levels={level.quantity.name: at.quantity.name},
    )
