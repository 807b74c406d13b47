"""A second way from a store to the one below: a leak between chambers, a wall between rooms.

::

        |       |   leak   |       |
        | state |---->---->| below |
        '-------'          '-------'

Equation: flow = exchange (state - below); der(state) -= flow; der(below) += caught flow. What is caught is the capacity
of the one store over that of the other, and 1 of two that are alike.

Source: H. E. Merritt, "Hydraulic Control Systems", Wiley 1967 (cross-port leakage).

Typical: a tenth of the balance where the two differ by the nominal value.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ._site import BalanceSite, alike
from .places import Balance

KINDS = (Balance,)
NEEDS = "a store (no speed) with a store of the same kind `below` it"
MOST_CAUGHT = 100.0  # of what flows: a small store beside a large one


def law(at: BalanceSite) -> Effect | None:
    """What flows to the other store in proportion to the difference."""
    other = at.receives
    if at.moves or other is None or not alike(at.unit, other.unit):
        return None
    size = at.rate_size / at.nominal
    unit = at.per((at.rate_unit, 1), (at.unit, -1))
    exchange = at.knob("", unit, f"Rate of what flows to {other.name}", 0.1 * size, 0.0, 1e3 * size, off=0.0)
    caught = at.knob("caught", "1", f"What {other.name} gains of it", 1.0, 0.0, MOST_CAUGHT)
    difference = at.quantity.symbol - other.symbol

    def apply(model: Model) -> Model:
        model = at.added(model, -exchange.symbol * difference)
        return at.added(model, -caught.symbol * model[at.name("term")], other.name, "gain")

    return at.effect(f"{at.words} leaks into {other.name}", "Merritt 1967", apply, exchange, caught)
