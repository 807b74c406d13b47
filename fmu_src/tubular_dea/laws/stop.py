"""A stop above a displacement: a housing, a cushion, a string that becomes taut.

::

    force |          /
          |         /  stiffness
          +--------'------- displacement
                 level

Equation: der(velocity) -= stiffness d^2 / (d + corner), d = [displacement - level]+, [ ]+ the positive part.

Source: P. Wriggers, "Computational Contact Mechanics", 2nd ed., Springer 2006 (penalty contact).

Typical: at half the nominal displacement; above the largest of a record it cannot be seen.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ..model.smooth import positive_part
from ._site import BalanceSite
from .places import Balance

KINDS = (Balance,)
NEEDS = "a `displacement`, and no equilibrium curve"
LEVELS = (-1.0, -0.5, -0.2, 0.0, 0.2, 0.5, 1.0)  # of the displacement's nominal value


def law(at: BalanceSite) -> Effect | None:
    """A spring that acts above a level."""
    return None if at.displaced is None or at.model.curve else one_sided(at, 1, "above")


def one_sided(at: BalanceSite, side: int, word: str) -> Effect:
    """The stop above (`side` 1) or below (-1) a level."""
    x = at.coordinate
    unit, size = at.per((at.rate_unit, 1), (x.unit, -1)), at.rate_size / x.nominal
    stiffness = at.knob(
        "stiffness", unit, f"Stiffness of the stop of {x.name}", 0.5 * size, 0.0, 1e4 * size, off=0.0, hard=True
    )
    level = at.knob(
        "level",
        x.unit,
        "Where it begins",
        side * 0.5 * x.nominal,
        -100 * x.nominal,
        100 * x.nominal,
        shapes=[share * x.nominal for share in LEVELS],
    )
    corner = at.knob(
        "corner",
        x.unit,
        "Displacement over which contact begins",
        1e-3 * x.nominal,
        1e-6 * x.nominal,
        x.nominal,
        refine=True,
    )

    def apply(model: Model) -> Model:
        beyond = positive_part(side * (x.symbol - level.symbol))
        return at.added(model, -side * stiffness.symbol * beyond**2 / (beyond + corner.symbol))

    levels = {level.quantity.name: x.name}
    return at.effect(
        f"A stop {word} a level of {x.name}", "Wriggers 2006", apply, stiffness, level, corner, levels=levels
    )
