"""A resistance that grows with the flow: turbulence, sudden changes of section, a valve.

::

    drop |           .'   part 1: with the square of q
         |        .'.'
         |    . '.'       part 0: R q
         |.'.'
         +------------|-- q
                 reference

Equation: q ((1 - part) + part |q| / reference) = q_linear, where q_linear is what the model has. `part` is the share of
the resistance at the reference, the nominal flow, that grows with the flow: drop = R (1 - part) q + R part / reference
q |q|. Solved: q = 2 q_linear / (1 - part + sqrt((1 - part)^2 + 4 part (|q_linear| / reference + WIDTH))).

Source: I. E. Idelchik, "Handbook of Hydraulic Resistance", 3rd ed., Begell House 1996; D. F. Young, F. Y. Tsai, "Flow
characteristics in models of arterial stenoses", J. Biomech. 6 (1973) 395-410.

Typical: 0.1 to 1.
"""

import sympy

from ..model.declare import Model
from ..model.effect import Effect
from ..model.smooth import magnitude
from ._site import SignalSite
from .places import Coefficient

KINDS = (Coefficient,)
NEEDS = "a quantity that is not constant"
WIDTH = sympy.Float(1e-4)  # of the reference: below it the resistance is linear


def law(at: SignalSite) -> Effect | None:
    """What flows meets a resistance that grows with it."""
    if at.is_constant:
        return None
    part = at.knob("part", "1", f"Part of the resistance to {at.words} that is quadratic", 0.2, 0.0, 1.0, off=0.0)

    def apply(model: Model) -> Model:
        model, linear = at.taken(model)
        model, reference = at.constant(
            model, "reference", at.unit, at.nominal, "Where the resistance stays as it is", before=at.name("from")
        )
        rest, grown = 1 - part.symbol, part.symbol * (magnitude(linear) / reference + WIDTH)
        return at.put(model, 2 * linear / (rest + sympy.sqrt(rest**2 + 4 * grown)))

    return at.effect(f"A quadratic resistance opposes {at.words}", "Idelchik 1996", apply, part)
