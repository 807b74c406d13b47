"""The elastomer softens on first loading: below the largest stretch so far it is weaker than it was.

::

    sigma |          .'  first loading
          |       .'/
          |    .' /      unloading and reloading, up to the largest stretch so far
          | .'_-'
          +------------- lambda_2

Equation: dW/dI_1 times 1 - mullins tanh((m - lambda_2) / mullins_width) - damage (1 - exp(-(m - 1) / 0.2)), where
m is the largest lambda_2 so far: dm/dt = ramp(lambda_2 - m) / 5 ms. `mullins` recovers towards m (Ogden and
Roxburgh), `damage` stays (Simo).

Source: Ogden and Roxburgh, "A pseudo-elastic model for the Mullins effect in filled rubber", Proc. R. Soc. A 455
(1999) 2861; Simo, "On a fully three-dimensional finite-strain viscoelastic damage model", CMAME 60 (1987) 153.

Typical: 5 to 30 % within 0.05 to 0.3 of stretch.
"""

import sympy

from ..declare import Model, Quantity, State
from ..smooth import positive_part, ramp
from . import Effect
from ._signals import scaled

FOLLOWS = sympy.Float(5e-3)  # s: the maximum is followed this fast
CORNER = 1e-5  # stretch over which it begins to follow
DAMAGE_WIDTH = sympy.Float(0.2)
PARAMETERS = (
    Quantity("mullins", "1", "Softening below the largest stretch so far", 0.0, "Ogden 1999", -0.5, 0.95),
    Quantity("mullins_width", "1", "Stretch below the largest at which it is complete", 0.1, "Ogden 1999", 1e-3, 5.0),
    Quantity("damage", "1", "Softening that stays, at large stretch", 0.0, "Simo 1987", -0.5, 0.95),
)


def _apply(model: Model) -> Model:
    largest = Quantity("lambda_2_largest", "1", "Largest hoop stretch so far")
    stretch = model["lambda_2"]
    grows = ramp(stretch - largest.symbol, CORNER) / FOLLOWS
    model = model.extend(states=[State(largest, grows, model["lambda_2_start"], stretch)])
    below = sympy.tanh(positive_part(largest.symbol - stretch) / model["mullins_width"])
    broken = 1 - sympy.exp(-positive_part(largest.symbol - 1) / DAMAGE_WIDTH)
    return scaled(model, "dW_dI_1", 1 - model["mullins"] * below - model["damage"] * broken)


EFFECT = Effect(
    "mullins_softening", "mechanical", "The elastomer softens on first loading", _apply, PARAMETERS,
    off={"mullins": 0.0, "damage": 0.0}, typical={"mullins": 0.15, "mullins_width": 0.1, "damage": 0.0},
    shapes={"mullins_width": (0.02, 0.1, 0.5)}, refine=("damage",),
)  # fmt: skip
