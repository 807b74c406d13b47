"""An offset: a zero error of a sensor or of an input; in a balance a constant load or inflow.

::

    signal ---(+)--->  signal + offset
               ^
             offset

Equation: signal' = signal + offset; in a balance, der(state) += offset. Into a store something may flow all the time
(offset > 0); out of it not, as it may be empty.

Source: E. O. Doebelin, "Measurement Systems", 5th ed., McGraw-Hill 2004 (zero and span of instruments).

Typical: 2 % of the nominal value.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ._site import BalanceSite, SignalSite
from .places import Balance, Path

KINDS = (Path, Balance)
NEEDS = "nothing else"
MOST = 0.05  # of the nominal value: what is further off is no matter of a zero
LOAD = 1.0  # of the balance of a speed: a lift's motor carries its weight
INFLOW = 1.0  # of the balance of a store: what drains it may end at a level of its own (a venous pressure)


def law(at: SignalSite | BalanceSite) -> Effect:
    """A constant is added."""
    if isinstance(at, BalanceSite):
        return _load(at)
    size = at.nominal
    zero = at.knob("", at.unit, f"Offset of {at.words}", 0.02 * size, -MOST * size, MOST * size, off=0.0)

    def apply(model: Model) -> Model:
        model, signal = at.taken(model)
        return at.put(model, signal + zero.symbol, lambda held: held - zero.symbol)

    return at.effect(f"The zero of {at.words} is off", "Doebelin 2004", apply, zero, exact=True)


def _load(at: BalanceSite) -> Effect:
    size = at.rate_size
    low, high = (-LOAD * size, LOAD * size) if at.moves else (0.0, INFLOW * size)
    load = at.knob("", at.rate_unit, f"Constant term on {at.words}", 0.02 * size, low, high, off=0.0)

    def apply(model: Model) -> Model:
        return at.added(model, load.symbol)

    return at.effect(f"A constant term acts on {at.words}", "Doebelin 2004", apply, load, exact=True)
