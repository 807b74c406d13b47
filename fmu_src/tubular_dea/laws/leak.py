"""A leak: what a balance holds goes away in proportion to it, or through a hole; of a speed, a viscous drag.

::

     in --->.-------.
            | ~~~~~ |---> leak x
            '-------'

Equation: der(x) -= leak x (x^2 / reference^2 + 0.001^2)^((exponent - 1) / 2), with the nominal value of x as reference.
The exponent is 1, or what fits best if the records ask for it (not of a speed): 1/2 for a turbulent orifice.

Source: H. E. Merritt, "Hydraulic Control Systems", Wiley 1967 (laminar leakage, orifices, viscous damping).

Typical: a tenth of the balance at the nominal value.
"""

import sympy

from ..model.declare import Model
from ..model.effect import Effect
from ._site import BalanceSite
from .places import Balance

KINDS = (Balance,)
NEEDS = "nothing else"
WIDTH = sympy.Float(1e-3)  # of the reference: below it the leak is laminar


def law(at: BalanceSite) -> Effect:
    """What leaves in proportion to what is there."""
    x, size = at.quantity.symbol, at.rate_size / at.nominal
    unit = at.per((at.rate_unit, 1), (at.unit, -1))
    leak = at.knob("", unit, f"Leak of {at.words} over it", 0.1 * size, 0.0, 1e3 * size, off=0.0)
    if at.moves:
        return at.effect(
            f"A viscous drag acts on {at.words}", "Merritt 1967", lambda m: at.added(m, -leak.symbol * x), leak
        )
    exponent = at.knob("exponent", "1", f"Power of {at.words} that leaks", 1.0, 0.3, 3.0, refine=True)

    def apply(model: Model) -> Model:
        model, reference = at.constant(model, "reference", at.unit, at.nominal, "Where its power changes nothing")
        squared = (x / reference) ** 2 + WIDTH**2
        return at.added(model, -leak.symbol * x * squared ** ((exponent.symbol - 1) / 2))

    return at.effect(f"{at.words} leaks away in proportion to it", "Merritt 1967", apply, leak, exponent)
