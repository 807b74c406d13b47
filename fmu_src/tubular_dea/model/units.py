"""Units: SI inside, customary ones at the edges (XML display units, headings of recordings, the command line).

A unit is written as in Modelica: factors joined by ".", divisors after "/", exponents as trailing digits:
"Pa.s", "m3/s", "kg/m3"; the coefficient of a root may have a broken one, "m3/s/Pa0.5". `factor(unit)` is what one such
unit is in SI base units. Laboratories write in other ways, which are understood too: "µm", "cm H2O", "L·min^-1",
"psig", "seconds", "MBAR".
"""

from __future__ import annotations

import difflib
import itertools
import math
import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeAlias, TypeVar

import numpy as np

from ..errors import UserError

MOST_DIGITS = 9  # of a number that is known that well
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
BASE = ("kg", "m", "s", "A", "K", "mol")
_BRACKET = re.compile(r"\(([^()]*)\)")  # one that holds no others
PRODUCT = re.compile(r"(?<!\d)\.|\.(?!\d)")  # a dot between digits is that of a broken exponent
Amount = TypeVar("Amount", float, np.ndarray)
Power: TypeAlias = int | Fraction


@dataclass(frozen=True)
class Unit:
    """`factor` SI units of the dimension given by the exponents of `BASE`, from which trailing zeros
    may be left out; zero is at `offset` SI units."""

    factor: float
    exponents: tuple[Power, ...]
    offset: float = 0.0

    def __post_init__(self) -> None:
        missing = len(BASE) - len(self.exponents)
        object.__setattr__(self, "exponents", (*self.exponents, *(0,) * missing))

    @property
    def whole(self) -> bool:
        """Whether all exponents are whole numbers, as XML has them."""
        return all(e == int(e) for e in self.exponents)


_MMHG = 133.322
_NONE, _MASS, _LENGTH, _VOLUME = (0, 0, 0, 0, 0), (1, 0, 0, 0, 0), (0, 1, 0, 0, 0), (0, 3, 0, 0, 0)
_TIME, _RATE, _CURRENT, _WARMTH = (0, 0, 1, 0, 0), (0, 0, -1, 0, 0), (0, 0, 0, 1, 0), (0, 0, 0, 0, 1)
_PRESSURE = (1, -1, -2, 0, 0)

# Units and the prefixes that they are used with: no mega where milli is meant by who writes in capitals.
_PREFIXED = {
    "g": (Unit(1e-3, _MASS), "umk"),
    "m": (Unit(1.0, _LENGTH), "numcdk"),
    "s": (Unit(1.0, _TIME), "num"),
    "A": (Unit(1.0, _CURRENT), "numk"),
    "K": (Unit(1.0, _WARMTH), "m"),
    "mol": (Unit(1.0, (0, 0, 0, 0, 0, 1)), "umk"),
    "Hz": (Unit(1.0, _RATE), "mkM"),
    "N": (Unit(1.0, (1, 1, -2, 0, 0)), "umk"),
    "J": (Unit(1.0, (1, 2, -2, 0, 0)), "umk"),
    "W": (Unit(1.0, (1, 2, -3, 0, 0)), "umk"),
    "Pa": (Unit(1.0, _PRESSURE), "mhkMG"),
    "bar": (Unit(1e5, _PRESSURE), "um"),
    "L": (Unit(1e-3, _VOLUME), "umcd"),
    "V": (Unit(1.0, (1, 2, -3, -1, 0)), "numk"),
    "C": (Unit(1.0, (0, 0, 1, 1, 0)), "pnum"),
    "F": (Unit(1.0, (-1, -2, 4, 2, 0)), "pnum"),
    "Ohm": (Unit(1.0, (1, 2, -3, -2, 0)), "mkMG"),
    "H": (Unit(1.0, (1, 2, -2, -2, 0)), "num"),
    "Wb": (Unit(1.0, (1, 2, -2, -1, 0)), "um"),
    "T": (Unit(1.0, (1, 0, -2, -1, 0)), "um"),
}
_POWERS = {"p": 1e-12, "n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "d": 1e-1, "h": 1e2, "k": 1e3, "M": 1e6, "G": 1e9}

_NAMED = {
    **{name: unit for name, (unit, _) in _PREFIXED.items()},
    **{p + name: Unit(_POWERS[p] * unit.factor, unit.exponents) for name, (unit, ps) in _PREFIXED.items() for p in ps},
    "1": Unit(1.0, _NONE),
    "%": Unit(1e-2, _NONE),
    "rad": Unit(1.0, _NONE),
    "mrad": Unit(1e-3, _NONE),
    "urad": Unit(1e-6, _NONE),
    "deg": Unit(math.pi / 180, _NONE),
    "min": Unit(60.0, _TIME),
    "h": Unit(3600.0, _TIME),
    "d": Unit(86400.0, _TIME),
    "bpm": Unit(1 / 60, _RATE),
    "rpm": Unit(math.tau / 60, _RATE),
    "rev": Unit(math.tau, _NONE),
    "inch": Unit(0.0254, _LENGTH),
    "mil": Unit(25.4e-6, _LENGTH),
    "degC": Unit(1.0, _WARMTH, 273.15),
    "degF": Unit(5 / 9, _WARMTH, 459.67 * 5 / 9),
    "mmHg": Unit(_MMHG, _PRESSURE),
    "torr": Unit(101325 / 760, _PRESSURE),
    "inHg": Unit(25.4 * _MMHG, _PRESSURE),
    "cmH2O": Unit(98.0665, _PRESSURE),
    "mmH2O": Unit(9.80665, _PRESSURE),
    "inH2O": Unit(249.08891, _PRESSURE),
    "psi": Unit(6894.757293168361, _PRESSURE),
    "atm": Unit(101325.0, _PRESSURE),
}

# Other ways of writing them. A gauge reads against the atmosphere, as a transmural pressure is meant.
_ALSO = {
    "sec": "s",
    "secs": "s",
    "second": "s",
    "seconds": "s",
    "msec": "ms",
    "usec": "us",
    "minute": "min",
    "minutes": "min",
    "mins": "min",
    "hour": "h",
    "hours": "h",
    "hr": "h",
    "hrs": "h",
    "day": "d",
    "days": "d",
    "millisecond": "ms",
    "milliseconds": "ms",
    "microsecond": "us",
    "microseconds": "us",
    "meter": "m",
    "meters": "m",
    "metre": "m",
    "metres": "m",
    "millimeter": "mm",
    "millimeters": "mm",
    "millimetre": "mm",
    "millimetres": "mm",
    "micron": "um",
    "microns": "um",
    "micrometer": "um",
    "micrometers": "um",
    "micrometre": "um",
    "micrometres": "um",
    "in": "inch",
    "inches": "inch",
    "mils": "mil",
    "volt": "V",
    "volts": "V",
    "kilovolt": "kV",
    "kilovolts": "kV",
    "millivolt": "mV",
    "millivolts": "mV",
    "amp": "A",
    "amps": "A",
    "ampere": "A",
    "amperes": "A",
    "microamp": "uA",
    "microamps": "uA",
    "milliamp": "mA",
    "milliamps": "mA",
    "pascal": "Pa",
    "pascals": "Pa",
    "kilopascal": "kPa",
    "kilopascals": "kPa",
    "millibar": "mbar",
    "millibars": "mbar",
    "bars": "bar",
    "barg": "bar",
    "mbarg": "mbar",
    "psig": "psi",
    "kpag": "kPa",
    "mm.hg": "mmHg",
    "cm.h2o": "cmH2O",
    "mm.h2o": "mmH2O",
    "in.hg": "inHg",
    "in.h2o": "inH2O",
    "cmwc": "cmH2O",
    "mmwc": "mmH2O",
    "cc": "mL",
    "ccm": "mL/min",
    "sccm": "mL/min",
    "lpm": "L/min",
    "hertz": "Hz",
    "litre": "L",
    "liter": "L",
    "litres": "L",
    "liters": "L",
    "beats": "1",
    "beat": "1",
    "ohms": "Ohm",
    "percent": "%",
    "degree": "deg",
    "degrees": "deg",
    "celsius": "degC",
    "deg.c": "degC",
    "fahrenheit": "degF",
    "deg.f": "degF",
    "kelvin": "K",
    "hectopascal": "hPa",
    "rads": "rad",
    "revolution": "rev",
    "revolutions": "rev",
    "revs": "rev",
    "turn": "rev",
    "turns": "rev",
    "r/min": "rpm",
    "u/min": "rpm",
    "upm": "rpm",
    "radian": "rad",
    "radians": "rad",
    "vdc": "V",
    "adc": "A",
}
# Products written without a point; in any case, Nm would be a nanometre.
_JOINED = {"Nm": "N.m", "kNm": "kN.m", "mNm": "mN.m", "Ncm": "N.cm", "Nmm": "N.mm", "Ns": "N.s", "kNs": "kN.s"}
_JOINED |= {"Pas": "Pa.s", "mPas": "mPa.s", "kPas": "kPa.s", "MPas": "MPa.s", "Vs": "V.s", "As": "A.s", "Js": "J.s"}
_BY_CASE: dict[str, list[str]] = {}
for _name in _NAMED:
    _BY_CASE.setdefault(_name.lower(), []).append(_name)
_SIGNS = str.maketrans({"μ": "u", "Ω": "Ohm", "°": "deg", "·": ".", "⋅": ".", "×": ".", "*": ".", "^": None, "−": "-"})

ANGLES = ("rad", "mrad", "urad", "deg", "rpm", "rev")

PREFIXES = {-9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}

QUANTITY_NAMES = {
    "m": "Length",
    "m2": "Area",
    "m3": "Volume",
    "m3/s": "VolumeFlowRate",
    "s": "Time",
    "Pa": "Pressure",
    "V": "Voltage",
    "V/m": "ElectricFieldStrength",
    "A": "Current",
    "C": "Charge",
    "F": "Capacitance",
    "kg": "Mass",
    "kg/m3": "Density",
    "Pa.s": "Viscosity",
    "N": "Force",
    "J": "Energy",
    "K": "Temperature",
}


class UnitError(UserError, ValueError):
    """A unit that is not known, or two units that measure different things."""


def parse(text: str) -> Unit:
    """The unit that `text` names; `UnitError` with the known names if it cannot be read."""
    plain = _plain(text)
    single = _named(plain)
    if single:
        return single
    value = Unit(1.0, _NONE)
    numerator, *denominators = plain.split("/")
    for sign, product in [(1, numerator), *((-1, part) for part in denominators)]:
        for name in [product] if product.lower() in _ALSO else PRODUCT.split(product):
            value = _times(value, *_power(name.strip(), text), sign)
    return value


def is_unit(text: str) -> bool:
    """Whether `text` names a unit."""
    try:
        parse(text)
    except UnitError:
        return False
    return True


def factor(unit: str, expected: str) -> float:
    """How many `expected` one `unit` is: mmHg to Pa is 133.322. `UnitError` where the dimensions differ."""
    given, wanted = _alike(unit, expected)
    if given.offset != wanted.offset:
        raise UnitError(f"{unit!r} and {expected!r} have zeros of their own: no factor makes one the other")
    return given.factor / wanted.factor * math.tau ** float(_cycles(unit, expected) - _cycles(expected, unit))


def _cycles(unit: str, other: str) -> Power:
    """To what power `unit` counts cycles, where `other` counts angles to the same: 1 Hz is 2 pi rad/s, and 1/min is a
    revolution in a minute."""
    if (_named(_plain(unit)) and not unit.lower().endswith(("hz", "hertz"))) or _angles(unit):
        return 0
    own = named_powers(unit).items()
    cycles = sum(e if n.lower().endswith(("hz", "hertz")) else -e if n == "min" else 0 for n, e in own)
    return cycles if cycles == _angles(other) else 0


def _angles(unit: str) -> Power:
    """To what power a unit counts angles."""
    return sum(e for n, e in named_powers(unit).items() if _ALSO.get(n.lower(), n.lower()) in ANGLES)


def converted(values: Amount, unit: str, expected: str) -> Amount:
    """`values` in `unit` as they are in `expected`, where a zero may be another: 20 degC are 293.15 K."""
    given, wanted = parse(unit), parse(expected)
    if given.offset == wanted.offset or given.exponents != wanted.exponents:
        return values * factor(unit, expected)
    return (values * given.factor + (given.offset - wanted.offset)) / wanted.factor


def difference(values: Amount, unit: str, expected: str) -> Amount:
    """How much `values` in `unit` more are in `expected`, wherever their zeros are: 20 degC more are 20 K."""
    given, wanted = _alike(unit, expected)
    return values * given.factor / wanted.factor


def _alike(unit: str, expected: str) -> tuple[Unit, Unit]:
    """Both units; `UnitError` where the dimensions differ."""
    given, wanted = parse(unit), parse(expected)
    if given.exponents != wanted.exponents:
        raise UnitError(f"expected a unit like {expected!r} but was given {unit!r}")
    return given, wanted


def combined(*powers: tuple[str, int]) -> str:
    """The product of powers of units, written as a unit: ("V/s", 1), ("m", -3) is "V/s/m3". `UnitError` as `parse`."""
    exponents: dict[str, Power] = {}
    for text, power in powers:
        for name, own in named_powers(text).items():
            exponents[name] = exponents.get(name, 0) + own * power
    return written(exponents)


def named_powers(text: str) -> dict[str, Power]:
    """The units that `text` is made of, with their exponents: "N.s/m2" is N, s and m to 1, 1 and -2."""
    parse(text)
    exponents: dict[str, Power] = {}
    numerator, *denominators = _plain(text).split("/")
    for sign, product in [(1, numerator), *((-1, part) for part in denominators)]:
        for piece in [product] if _named(product) else PRODUCT.split(product):
            name, own = _split(piece)
            exponents[name] = exponents.get(name, 0) + sign * own
    exponents.pop("1", None)
    return exponents


def written(exponents: Mapping[str, Power]) -> str:
    """Such exponents as a unit."""
    above = ".".join(_written(name, e) for name, e in exponents.items() if e > 0)
    below = "".join(f"/{_written(name, -e)}" for name, e in exponents.items() if e < 0)
    return f"{above or '1'}{below}"


def quantity(text: str, expected: str) -> float:
    """The number in `text` in SI units: "95 mmHg" and "95mmHg" for "Pa" are 12665.6; a bare number is in `expected`.

    Raises `UnitError` for text that is not a finite number with an optional unit.
    """
    match = re.fullmatch(rf"\s*({NUMBER})\s*(\S*)\s*", text)
    value = float(match[1]) if match else float("nan")
    if match is None or not math.isfinite(value):
        unit = "" if expected == "1" else f" with a unit like {expected!r}"
        raise UnitError(f"expected a number{unit} but was given {text!r}")
    return converted(value, match[2], expected) if match[2] else value


def _plain(text: str) -> str:
    """As in Modelica: µ is u, a dot for every sign of a product, digits for exponents, no brackets; /s is 1/s."""
    plain = unicodedata.normalize("NFKC", text).translate(_SIGNS).strip().replace("..", "")
    while plain.startswith(("(", "[")) and plain.endswith((")", "]")) and not set("()") & set(plain[1:-1]):
        plain = plain[1:-1].strip()
    plain = re.sub(r"\s*([()])\s*", r"\1", plain.removeprefix("[").removesuffix("]").strip())
    plain = _without_brackets(re.sub(r"\s*([/.])\s*|\s+", lambda m: m[1] or ".", plain)).rstrip(")")
    return f"1{plain}" if plain.startswith("/") else plain


def _without_brackets(text: str) -> str:
    """Products and quotients in brackets, the innermost first, multiplied out: a/(b/c).d is c.a/b.d, where a product
    binds more than a quotient. What is nothing of the kind keeps its brackets, and is refused by whoever reads it."""
    while group := _BRACKET.search(text):
        before, after = text[: group.start()], text[group.end() :]
        above, *below = group[1].split("/")
        if re.match(r"[-0-9A-Za-z%]", after) or (before and before[-1] not in "/.("):
            break
        begin = before.rfind("(") + 1  # of the product or quotient around it
        if "/" in before[begin:]:
            text = before[:begin] + "".join(f"{one}." for one in below) + before[begin:] + (above or "1") + after
        else:
            opened = itertools.accumulate({"(": 1, ")": -1}.get(c, 0) for c in after)
            end = next((i for i, depth in enumerate(opened) if depth < 0), len(after))
            text = before + (above or "1") + after[:end] + "".join(f"/{one}" for one in below) + after[end:]
    return text


def _written(name: str, exponent: Power) -> str:
    return name if exponent == 1 else f"{name}{float(exponent):g}"


def _split(name: str) -> tuple[str, Power]:
    """Name and exponent of one factor: m and 3 of "m3"."""
    if _named(name):
        return name, 1
    bare = name.rstrip("-.0123456789")
    return bare, Fraction(name[len(bare) :]).limit_denominator(100)


def _power(name: str, text: str) -> tuple[Unit, Power]:
    unit = _named(name)
    if unit:
        return unit, 1
    match = re.fullmatch(r"([A-Za-z%]+)(-?\d+(?:\.\d+)?)", name)
    unit = _named(match[1]) if match else None
    if match is None or unit is None or abs(float(match[2])) > 9:
        alike = difflib.get_close_matches(name.lower(), _BY_CASE, n=3)
        close = [known for lower in alike for known in _BY_CASE[lower]][:3]
        hint = f"did you mean {', '.join(close)}?" if close else "as in Pa.s, mL/min, kV or degC"
        raise UnitError(f"cannot read the unit {text!r}: expected a known unit or a combination; {hint}")
    return unit, Fraction(match[2]).limit_denominator(100)


def _named(name: str) -> Unit | None:
    """The unit of a name, in any case where that is clear."""
    if name in _NAMED:
        return _NAMED[name]
    also = _JOINED.get(name) or _ALSO.get(name.lower())
    if also:
        return parse(also)
    same = _BY_CASE.get(name.lower(), [])
    return _NAMED[same[0]] if len(same) == 1 else None


def _times(value: Unit, other: Unit, exponent: Power, sign: int) -> Unit:
    power = exponent * sign
    exponents = tuple(a + power * b for a, b in zip(value.exponents, other.exponents, strict=True))
    return Unit(value.factor * float(other.factor**power), exponents)


def readable(value: float, unit: str) -> tuple[float, str]:
    """Factor and name of the unit in which an SI value has one to three digits before the point."""
    if value == 0 or not unit[0].isalpha() or unit[1:2].isdigit() or unit.startswith(("kg", "deg")):
        return 1.0, unit
    power = min(max(math.floor(math.log10(abs(value)) / 3), -3), 3) * 3
    return 10.0**power, PREFIXES[power] + unit


def in_words(value: float, unit: str, customary: str | None = None) -> str:
    """A difference or size [SI] in three digits: in the `customary` unit, if that is more than the SI unit with a
    prefix or another zero (mmHg, mL), else in SI with the prefix that suits it."""
    scale, shown = readable(value, unit)
    prefixed = [prefix + unit for prefix in PREFIXES.values()]
    if customary is not None and customary not in prefixed and parse(customary).offset == parse(unit).offset:
        scale, shown = factor(customary, unit), customary
    return f"{three(value / scale)} {shown}".removesuffix(" 1")


def in_units_of(value: float, told: Mapping[str, Any]) -> str:
    """An SI value as `in_words`, in the `unit` or the `display_unit` that a result gives for its errors."""
    return in_words(value, told["unit"], told.get("display_unit"))


def three(value: float, digits: int = 3) -> str:
    """A number in three digits (or more), without a power of ten where it has four or five before the point."""
    short = f"{value:.{digits}g}"
    return f"{float(short):.0f}" if 1e3 <= abs(float(short)) < 1e5 else short


def signed(value: float, digits: int) -> str:
    """A difference with its sign and so many decimals; nothing that rounds to 0 has one."""
    rounded = round(value, digits)
    return f"{rounded:+.{digits}f}" if rounded else f"{0:.{digits}f}"


def with_ends(value: float, ends: Sequence[float | None], least: int = 3) -> list[str]:
    """A value and the ends of its interval, in `least` digits, or in as many as tell them apart.

    An end that is None is "open". What is a thousandth of an interval about 0, or less, is 0.
    """
    low, high = ends
    if low is None or high is None or not 0 < (width := abs(high - low)) < math.inf:
        return [three(value, least), *("open" if end is None else three(end, least) for end in ends)]
    last = math.floor(math.log10(width)) - 1  # two digits of the interval

    def text(number: float) -> str:
        if low * high <= 0 and abs(number) <= 1e-3 * width:
            return "0"
        return three(number, min(max(least, math.floor(math.log10(abs(number))) - last + 1), MOST_DIGITS))

    return [text(value), *(text(end) for end in ends if end is not None)]
