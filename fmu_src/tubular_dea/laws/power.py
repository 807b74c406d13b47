"""A power law where the model is linear: outflow with the square root, the characteristic of a valve or sensor.

::

    signal' |       .-----   exponent 1/2
            |   .-'    .'
            | .'    .'       exponent 1
            |/   .'
            +--------------- signal

Equation: signal' = signal (signal^2 / reference^2 + 0.001^2)^((exponent - 1) / 2), which is reference
(signal / reference)^exponent to both sides, with a finite slope at 0. The reference is the nominal value of the signal:
there nothing changes.

Source: E. Torricelli, "Opera geometrica", 1644 (outflow with the square root of the level); IEC 60534-2-1 (valves).

Typical: 0.5 to 2.
"""

import sympy

from ..model.declare import Model
from ..model.effect import Effect
from ._site import SignalSite
from .places import Coefficient, Path

KINDS = (Path, Coefficient)
NEEDS = "a quantity that is not constant; not the load of an equilibrium curve"
WIDTH = sympy.Float(1e-3)  # of the reference: below it the law is linear


def law(at: SignalSite) -> Effect | None:
    """The signal to a power, relative to its nominal value."""
    if at.is_load or at.is_constant:
        return None
    straight = isinstance(at.place, Path) and not at.is_input  # a sensor is made so, a fan or a valve is not
    low, high = (0.4, 2.5) if straight else (0.1, 5.0)
    exponent = at.knob("exponent", "1", f"Exponent of {at.words}", 0.8, low, high, off=1.0, strengths=(-0.5, 1.0))

    def apply(model: Model) -> Model:
        model, signal = at.taken(model)
        model, reference = at.constant(
            model, "reference", at.unit, at.nominal, "Where the power changes nothing", before=at.name("from")
        )
        squared = (signal / reference) ** 2 + WIDTH**2
        return at.put(model, signal * squared ** ((exponent.symbol - 1) / 2))

    return at.effect(f"A power law holds for {at.words}", "Torricelli 1644", apply, exponent)
