"""The elastomer softens on first loading: below the largest stretch so far it is weaker than it was.

::

    sigma |          .'  first loading
          |       .'/
          |    .' /      unloading and reloading, up to the largest stretch so far
          | .'_-'
          +------------- lambda_2

Equation: dW/dI_1 times 1 - mullins (1 - exp(-x - mullins_bend x^2)) - damage (1 - exp(-(m - 3) / 0.2)), where
x = (m - I_1) / (mullins_width + mullins_beta (m - 3)) and m is the largest I_1 so far: dm/dt = ramp(I_1 - m) / 5 ms.
`mullins` is made good on the way to m (Ogden and Roxburgh, whose error function is met within 0.2 % by a bend of 0.51),
`damage` stays (Simo).

Source: Ogden and Roxburgh, "A pseudo-elastic model for the Mullins effect in filled rubber", Proc. R. Soc. A 455
(1999) 2861; Simo, "On a fully three-dimensional finite-strain viscoelastic damage model", CMAME 60 (1987) 153.

Typical: 5 to 30 % within 0.1 to 0.5 of I_1 (the tube at 18.8 mm has I_1 - 3 = 0.2).
"""

import sympy

from ...model.change import at_rest, at_start, scaled
from ...model.declare import Model, Quantity, State
from ...model.effect import Effect
from ...model.smooth import positive_part, ramp

FOLLOWS = sympy.Float(5e-3)  # s: the maximum is followed this fast
CORNER = 1e-5  # of I_1, over which it begins to follow
DAMAGE_WIDTH = sympy.Float(0.2)
PARAMETERS = (
    Quantity("mullins", "1", "Softening below the largest deformation so far", 0.0, "Ogden 1999", -0.5, 0.95),
    Quantity("mullins_width", "1", "Distance of I_1 to its largest over which it comes", 0.2, "Ogden 1999", 1e-3, 20.0),
    Quantity("mullins_bend", "1", "How much more suddenly than exponentially it comes", 0.0, "Ogden 1999", 0.0, 10.0),
    Quantity("mullins_beta", "1", "Growth of the width with the largest deformation", 0.0, "Ogden 1999", 0.0, 10.0),
    Quantity("damage", "1", "Softening that stays, at large deformation", 0.0, "Simo 1987", -0.5, 0.95),
)


def _apply(model: Model) -> Model:
    largest = Quantity("I_1_largest", "1", "Largest first invariant so far", nominal=0.1)
    now = model["I_1"]
    grows = ramp(now - largest.symbol, CORNER) / FOLLOWS
    model = model.extend(states=[State(largest, grows, at_start(model, now), at_rest(model, now))])
    width = model["mullins_width"] + model["mullins_beta"] * positive_part(largest.symbol - 3)
    short = positive_part(largest.symbol - now) / width
    below = 1 - sympy.exp(-short - model["mullins_bend"] * short**2)
    broken = 1 - sympy.exp(-positive_part(largest.symbol - 3) / DAMAGE_WIDTH)
    return scaled(model, "dW_dI_1", 1 - model["mullins"] * below - model["damage"] * broken)


EFFECT = Effect(
    "mullins_softening",
    "mechanical",
    "The elastomer softens on first loading",
    _apply,
    PARAMETERS,
    off={"mullins": 0.0, "mullins_bend": 0.0, "mullins_beta": 0.0, "damage": 0.0},
    typical={"mullins": 0.15, "mullins_width": 0.2, "mullins_bend": 0.0, "mullins_beta": 0.0, "damage": 0.0},
    shapes={"mullins_width": (0.03, 0.2, 1.0)},
    refine=("mullins_bend", "mullins_beta", "damage"),
    lasting=True,
)
