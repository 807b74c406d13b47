"""A quadratic term: asymmetric nonlinearity of a sensor, a coefficient or a spring.

::

    signal' |      .'
            |    .'
            | .-'
            +----------- signal

Equation: signal' = signal + quadratic signal^2; in a balance, der(velocity) -= quadratic displacement^2.

Source: E. O. Doebelin, "Measurement Systems", 5th ed., McGraw-Hill 2004 (nonlinearity); A. H. Nayfeh, D. T. Mook,
"Nonlinear Oscillations", Wiley 1979.

Typical: 5 % of the signal, a tenth of the balance, at the nominal value.
"""

from ..model.declare import Model
from ..model.effect import Effect
from ._site import BalanceSite, SignalSite
from .places import Balance, Coefficient, Path

KINDS = (Path, Coefficient, Balance)
NEEDS = "a `displacement` in a balance; a quantity that is not constant; not the load of an equilibrium curve"


def law(at: SignalSite | BalanceSite) -> Effect | None:
    """The square is added."""
    return polynomial(at, 2, "quadratic", "Nayfeh 1979")


def polynomial(at: SignalSite | BalanceSite, power: int, word: str, source: str) -> Effect | None:
    """A power is added, of the signal or of the displacement."""
    if isinstance(at, BalanceSite):
        return None if at.displaced is None or at.model.curve else _spring(at, power, word, source)
    if at.is_load or at.is_constant:
        return None
    size = at.nominal ** (1 - power)
    bend = at.knob(
        "",
        at.per((at.unit, 1 - power)),
        f"{word.capitalize()} term of {at.words}",
        0.05 * size,
        -10 * size,
        10 * size,
        off=0.0,
    )

    def apply(model: Model) -> Model:
        model, signal = at.taken(model)
        return at.put(model, signal + bend.symbol * signal**power)

    return at.effect(f"A {word} term acts on {at.words}", source, apply, bend)


def _spring(at: BalanceSite, power: int, word: str, source: str) -> Effect:
    x = at.coordinate
    unit, size = at.per((at.rate_unit, 1), (x.unit, -power)), at.rate_size / x.nominal**power
    spring = at.knob("", unit, f"{word.capitalize()} spring on {x.name}", 0.1 * size, -100 * size, 100 * size, off=0.0)

    def apply(model: Model) -> Model:
        return at.added(model, -spring.symbol * x.symbol**power)

    return at.effect(f"A {word} spring acts on {at.words}", source, apply, spring)
