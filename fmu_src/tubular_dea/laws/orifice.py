"""What flows through an orifice is driven by the pressure that the load leaves of the supply: a servo valve.

::

    flow' |------.          supply
          |        '.        --[ orifice ]--> flow' --[ load: of ]
          |          \
          +-----------|-- of
                    supply

Equation: flow' = flow sqrt([1 - share s load / nominal]+), s the sign of the flow, load and nominal those of `of`; the
supply is nominal / share. The flow vanishes where the load takes all of the supply, and grows where it pulls. The load
counts from 0; a pressure that is declared to start at that of the air is an absolute one, and counts from there.

Source: H. E. Merritt, "Hydraulic Control Systems", Wiley 1967, section 5.2 (flow of a four-way valve).

Typical: the nominal load pressure is 0.3 to 0.9 of the supply.
"""

import sympy

from ..model.declare import Model, Quantity
from ..model.effect import Effect
from ..model.scales import at_first
from ..model.smooth import magnitude, positive_part
from ._site import SignalSite, alike
from .places import Coefficient

KINDS = (Coefficient,)
NEEDS = "a definition that an input moves, at once or through a spool, and `of`, what loads it (no temperature)"
TURNS = 1e-3  # of the flow's nominal value: where its sign turns
AIR, NEARLY = 101_325.0, 0.1  # Pa; how far an absolute pressure starts from it at most, as a part of it
LEAST = 1e-6  # of the supply: below it the root is straight


def law(at: SignalSite) -> Effect | None:
    """A flow that falls with the root of what the load leaves."""
    of = at.other
    if of is None or not at.is_steered or alike(of.unit, "K"):
        return None
    share = at.knob("share", "1", f"Usual {of.name} over the supply of {at.words}", 0.4, 0.0, 5.0, off=0.0)

    def apply(model: Model) -> Model:
        model, flow = at.taken(model)
        model, start = at.start_of(model, of) if _absolute(at.model, of) else (model, sympy.Integer(0))
        model, full = at.constant(model, "full", of.unit, of.nominal, f"Usual {of.name}", before=at.name("from"))
        model, turns = at.constant(
            model, "turns", at.unit, TURNS * at.nominal, "Flow at which its sign turns", before=at.name("from")
        )
        left = 1 - share.symbol * flow / (magnitude(flow) + turns) * (of.symbol - start) / full
        below = sympy.Float(LEAST**0.5)
        opened = (sympy.sqrt(positive_part(left) + LEAST) - below) / (sympy.sqrt(1 + sympy.Float(LEAST)) - below)
        return at.put(model, flow * opened)

    return at.effect(f"{of.name} takes from the pressure that drives {at.words}", "Merritt 1967", apply, share)


def _absolute(model: Model, of: Quantity) -> bool:
    """Whether a pressure starts at that of the air."""
    return alike(of.unit, "Pa") and abs(at_first(model, of.name) / AIR - 1) < NEARLY
