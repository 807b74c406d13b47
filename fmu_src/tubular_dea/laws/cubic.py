"""A cubic term: symmetric hardening or softening, as of Duffing's spring, a sensor or an amplifier.

::

    force |        /
          |     .-'
          +-----'-------  displacement
          |  .-'
          | /

Equation: signal' = signal + cubic signal^3; in a balance, der(velocity) -= cubic displacement^3.

Source: G. Duffing, "Erzwungene Schwingungen bei veraenderlicher Eigenfrequenz", Vieweg 1918; T. Wigren, J. Schoukens,
"Three free data sets for development and benchmarking in nonlinear system identification", ECC 2013.

Typical: 5 % of the signal, a tenth of the balance, at the nominal value.
"""

from ..model.effect import Effect
from . import quadratic
from ._site import BalanceSite, SignalSite
from .places import Balance, Coefficient, Path
from .quadratic import polynomial

KINDS = (Path, Coefficient, Balance)
NEEDS = quadratic.NEEDS


def law(at: SignalSite | BalanceSite) -> Effect | None:
    """The third power is added."""
    return polynomial(at, 3, "cubic", "Duffing 1918")
