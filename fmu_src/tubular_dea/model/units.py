"""Units: SI inside, customary ones at the edges (XML display units, CSV headers, the command line).

A unit is written as in Modelica: factors joined by ".", divisors after "/", exponents as trailing digits:
"Pa.s", "m3/s", "kg/m3". `factor(unit)` is what one such unit is in SI base units.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from ..errors import UserError

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
BASE = ("kg", "m", "s", "A", "K")


@dataclass(frozen=True)
class Unit:
    """`factor` SI units of the dimension given by the exponents of kg, m, s, A, K."""

    factor: float
    exponents: tuple[int, ...]


_MMHG = 133.322

_NAMED = {
    "1": Unit(1.0, (0, 0, 0, 0, 0)), "%": Unit(1e-2, (0, 0, 0, 0, 0)), "rad": Unit(1.0, (0, 0, 0, 0, 0)),
    "kg": Unit(1.0, (1, 0, 0, 0, 0)), "g": Unit(1e-3, (1, 0, 0, 0, 0)),
    "m": Unit(1.0, (0, 1, 0, 0, 0)), "mm": Unit(1e-3, (0, 1, 0, 0, 0)), "um": Unit(1e-6, (0, 1, 0, 0, 0)),
    "s": Unit(1.0, (0, 0, 1, 0, 0)), "ms": Unit(1e-3, (0, 0, 1, 0, 0)), "min": Unit(60.0, (0, 0, 1, 0, 0)),
    "Hz": Unit(1.0, (0, 0, -1, 0, 0)),
    "A": Unit(1.0, (0, 0, 0, 1, 0)), "mA": Unit(1e-3, (0, 0, 0, 1, 0)), "uA": Unit(1e-6, (0, 0, 0, 1, 0)),
    "K": Unit(1.0, (0, 0, 0, 0, 1)),
    "N": Unit(1.0, (1, 1, -2, 0, 0)), "J": Unit(1.0, (1, 2, -2, 0, 0)), "mJ": Unit(1e-3, (1, 2, -2, 0, 0)),
    "W": Unit(1.0, (1, 2, -3, 0, 0)),
    "Pa": Unit(1.0, (1, -1, -2, 0, 0)), "kPa": Unit(1e3, (1, -1, -2, 0, 0)), "MPa": Unit(1e6, (1, -1, -2, 0, 0)),
    "mmHg": Unit(_MMHG, (1, -1, -2, 0, 0)),
    "L": Unit(1e-3, (0, 3, 0, 0, 0)), "mL": Unit(1e-6, (0, 3, 0, 0, 0)),
    "V": Unit(1.0, (1, 2, -3, -1, 0)), "kV": Unit(1e3, (1, 2, -3, -1, 0)),
    "C": Unit(1.0, (0, 0, 1, 1, 0)), "uC": Unit(1e-6, (0, 0, 1, 1, 0)),
    "F": Unit(1.0, (-1, -2, 4, 2, 0)), "nF": Unit(1e-9, (-1, -2, 4, 2, 0)),
    "Ohm": Unit(1.0, (1, 2, -3, -2, 0)),
}  # fmt: skip

QUANTITY_NAMES = {
    "m": "Length", "m2": "Area", "m3": "Volume", "m3/s": "VolumeFlowRate", "s": "Time", "Pa": "Pressure",
    "V": "Voltage", "V/m": "ElectricFieldStrength", "A": "Current", "C": "Charge", "F": "Capacitance",
    "kg": "Mass", "kg/m3": "Density", "Pa.s": "Viscosity", "N": "Force", "J": "Energy", "K": "Temperature",
}  # fmt: skip


class UnitError(UserError, ValueError):
    """A unit that is not known, or two units that measure different things."""


def parse(text: str) -> Unit:
    """The unit that `text` names; `UnitError` with the known names if it cannot be read."""
    value = Unit(1.0, (0,) * len(BASE))
    numerator, *denominators = text.strip().split("/")
    for sign, product in [(1, numerator), *((-1, part) for part in denominators)]:
        for name in product.split("."):
            value = _times(value, *_power(name.strip(), text), sign)
    return value


def factor(unit: str, expected: str) -> float:
    """How many `expected` one `unit` is: mmHg to Pa is 133.322. `UnitError` where the dimensions differ."""
    given, wanted = parse(unit), parse(expected)
    if given.exponents != wanted.exponents:
        raise UnitError(f"expected a unit like {expected!r} but was given {unit!r}")
    return given.factor / wanted.factor


def quantity(text: str, expected: str) -> float:
    """The number in `text` in SI units: "95 mmHg" and "95mmHg" for "Pa" are 12665.6; a bare number is in `expected`.

    Raises `UnitError` for text that is not a finite number with an optional unit.
    """
    match = re.fullmatch(rf"\s*({NUMBER})\s*(\S*)\s*", text)
    value = float(match[1]) if match else float("nan")
    if match is None or not math.isfinite(value):
        raise UnitError(f"expected a number with a unit like {expected!r} but was given {text!r}")
    return value * (factor(match[2], expected) if match[2] else 1.0)


def _power(name: str, text: str) -> tuple[Unit, int]:
    if name in _NAMED:
        return _NAMED[name], 1
    match = re.fullmatch(r"([A-Za-z%]+)(-?\d+)", name)
    if not match or match[1] not in _NAMED:
        raise UnitError(f"cannot read the unit {text!r}: expected a combination of {', '.join(_NAMED)}")
    return _NAMED[match[1]], int(match[2])


def _times(value: Unit, other: Unit, exponent: int, sign: int) -> Unit:
    power = exponent * sign
    exponents = tuple(a + power * b for a, b in zip(value.exponents, other.exponents, strict=True))
    return Unit(value.factor * other.factor**power, exponents)
