"""A store that loses what is above a level (a rim, a relief valve, a thermostat); a part may go to the store below.

::

        |   |~~~~~.
        |   |  level  '.   overflow
        |___|           '.
          |    |         |
          '--> | below | <'  caught

Equation: spilled = overflow d^2 / (d + corner), d = [state - level]+ (the positive part); der(state) -= spilled;
der(below) += caught spilled. The corner is a thousandth of the nominal level.

Source: M. Schoukens, J. P. Noel, "Three benchmarks addressing open challenges in nonlinear system identification",
IFAC PapersOnLine 50 (2017) 446-451 (cascaded tanks with overflow).

Typical: at the nominal value, within the usual time there.
"""

import sympy

from ..model.declare import Model
from ..model.effect import Effect
from ..model.smooth import positive_part
from ._site import BalanceSite
from .places import Balance

KINDS = (Balance,)
NEEDS = "a store (no speed), and no equilibrium curve"
LEVELS = (0.5, 0.7, 0.9, 1.2, 1.7, 2.4, 3.5, 5.0)  # of the state's nominal value
STRENGTHS = (5.0, 30.0)  # over the usual time there: what runs over does so at once
CORNER = 1e-3  # of the state's nominal value: where it begins


def law(at: BalanceSite) -> Effect | None:
    """The store overflows above a level."""
    if at.moves or at.model.curve:
        return None
    n, below = at.nominal, at.receives
    usual = 1 / at.seconds
    overflow = at.knob(
        "overflow",
        "1/s",
        f"Rate at which {at.words} is lost above it",
        0.5 * usual,
        0.0,
        1e3 * usual,
        off=0.0,
        strengths=[strong * usual for strong in STRENGTHS],
        hard=True,
    )
    level = at.knob(
        "level", at.unit, "Level at which it begins", n, 0.0, 100 * n, shapes=[share * n for share in LEVELS]
    )

    def lose(model: Model) -> Model:
        return _lost(at, model, overflow.symbol, level.symbol)

    levels = {level.quantity.name: at.quantity.name}
    summary = f"A store loses what is above a level: {at.words}"
    if below is None:
        return at.effect(summary, "Schoukens 2017", lose, overflow, level, levels=levels)
    full = below.nominal / n
    caught = at.knob(
        "caught", at.per((below.unit, 1), (at.unit, -1)), f"What {below.name} gains of it", 0.5 * full, 0.0, 10 * full
    )

    def share(model: Model) -> Model:
        model = lose(model)
        return at.added(model, -caught.symbol * model[at.name("term")], below.name, "gain")

    return at.effect(summary, "Schoukens 2017", share, overflow, level, caught, levels=levels)


def _lost(at: BalanceSite, model: Model, overflow: sympy.Symbol, level: sympy.Symbol) -> Model:
    model, corner = at.constant(model, "corner", at.unit, CORNER * at.nominal, "Depth over which it begins")
    above = positive_part(at.quantity.symbol - level)
    return at.added(model, -overflow * above**2 / (above + corner))
