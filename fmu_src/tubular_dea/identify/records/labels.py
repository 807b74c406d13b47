"""Wrong labels: numbers in one unit under a heading with another one, as mmHg under [Pa]."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import combinations

from ...model.units import converted, factor, is_unit, parse
from ...recordings.table import either

# Set by convention: units that laboratories write, by SI unit. Check: `pytest tests/test_reading.py -k label`
USUAL: Mapping[str, tuple[str, ...]] = {
    "m": ("um", "mm", "cm", "inch", "m"),
    "Pa": ("Pa", "mbar", "kPa", "mmHg", "psi", "bar"),
    "V": ("mV", "V", "kV"),
    "A": ("uA", "mA", "A"),
    "rad": ("degrees", "rad"),
    "rad/s": ("rad/s", "deg/s", "rpm", "Hz"),
    "m3/s": ("mL/min", "mL/s", "L/min", "L/s"),
}
# Set by judgement. Check: `pytest tests/test_reading.py -k label`
MOST_TOLD = 3  # [1] units of which numbers may be that are told, those that make the most usual size first
CLEAR = 1.9  # [1] times that two units differ at least for one to be seen to stand for the other
FROM_USUAL = 50.0  # [1] times its usual size by which an output differs from that at most


def confused(si: str) -> dict[float, str]:
    """How many times too large numbers are that were mislabelled, and the labels, of all usual units of a kind."""
    found: dict[float, list[str]] = {}
    for unit, label in _pairs(si):
        times = float(f"{factor(label, si) / factor(unit, si):.6g}")
        found.setdefault(times, []).append(f"{unit} labelled {label}")
    return {times: " or ".join(words) for times, words in found.items()}


def _pairs(si: str) -> Iterator[tuple[str, str]]:
    """A unit, and another one that is clearly larger."""
    for one, other in combinations(sorted(USUAL.get(si, ()), key=lambda u: factor(u, si)), 2):
        if factor(other, si) >= CLEAR * factor(one, si):
            yield one, other


def matching(words: str, label: str) -> str:
    """Of alternatives such as "um labelled mm or mm labelled m" those that have the `label` of a file; "" if none."""
    alternatives = [w for w in words.split(" or ") if " labelled " in w and is_unit(label)]
    return " or ".join(w for w in alternatives if parse(w.partition(" labelled ")[2]) == parse(label))


def likely(largest: float, least: float, most: float, usual: float, si: str, label: str) -> str:
    """The units that numbers under a `label` may have been in instead, as "mmHg or kPa labelled Pa"; "" if none.

    `largest` (SI) is what the label makes of the largest of them; it is expected between `least` and `most`, and is
    `usual`ly so large. Units that laboratories write come into question.
    """
    if not is_unit(label) or parse(label).offset != parse(si).offset:
        return ""
    sizes = {u: abs(largest) * factor(u, si) / factor(label, si) for u in USUAL.get(si, ()) if u != label}
    low, high = max(least, usual / FROM_USUAL), most if least else min(most, usual * FROM_USUAL)
    possible = [u for u, size in sizes.items() if low <= size <= high]
    units = sorted(possible, key=lambda u: abs(math.log(sizes[u] / usual)))
    return f"{either(units[:MOST_TOLD])} labelled {label}" if units else ""


def as_written(value: float, si: str, label: str) -> str:
    """A value (SI) in the unit of a file."""
    return f"{converted(value, si, label):g} {label}".removesuffix(" 1")
