"""Mistakes of labelling: numbers in another unit, of another quantity, of another sign or in another column."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from ...model.units import converted
from ...plants.plant import Plant
from ...protocol import Protocol
from ..records.labels import confused

# Set by convention: mistakes of laboratories. Check: `pytest tests/test_reading.py -k wrong_by_a_factor`
PEAKS = {2.0: "twice the voltage (peak to peak, or of two outputs)"}  # [1] how many times too large a voltage is then
ROUND = ("radi", "diam")  # words about what is
ACROSS = {2.0: "a diameter for a radius"}  # [1] the same for that
TIME = "time"
TIMES = {60.0: "s labelled min", 1e3: "ms labelled s"}  # [1] the same for the times of all records
OTHERWISE = {10.0: "", 1e3: ""}  # [1] the same for units that are not usual
INVERSE = {  # [1] the same, so many times too small
    "a diameter for a radius": "a radius for a diameter",
    PEAKS[2.0]: "half the voltage (an amplitude, or one output of two)",
}


@dataclass(frozen=True)
class Mislabelling:
    """A signal whose numbers are `factor` times what they should be, or those of the input `other`, and the other way
    round; `words` describe the mistake."""

    signal: str
    factor: float
    words: str
    other: str = ""

    @property
    def of_one_file(self) -> bool:
        """Whether it may be told where it was made in one file: not a sign (see `signs`) or a clock."""
        return self.factor > 0 and self.signal != TIME


def mislabellings(plant: Plant, outputs: Sequence[str]) -> Iterator[Mislabelling]:
    """All single mistakes."""
    for one, other in combinations([s.name for s in plant.inputs], 2):
        yield Mislabelling(one, 1.0, "", other)
    for name in [*(s.name for s in plant.inputs), *outputs]:
        quantity = plant.quantity(name)
        yield from _both_ways(name, confused(quantity.unit) or OTHERWISE)
        if quantity.unit == "V":
            yield from _both_ways(name, PEAKS)
        said = " ".join([name, quantity.description, *(h for o in plant.outputs if o.name == name for h in o.headings)])
        if any(word in said.lower() for word in ROUND):
            yield from _both_ways(name, ACROSS)
        yield Mislabelling(name, -1.0, "counted the other way")
    for one_clock in _both_ways(TIME, TIMES):
        if one_clock.factor > 1 or not plant.each_start:  # in slower times an unknown start counts less: no wrong unit
            yield one_clock


def _both_ways(name: str, factors: Mapping[float, str]) -> Iterator[Mislabelling]:
    """Numbers so many times too large, and so many times too small."""
    for factor, words in factors.items():
        yield Mislabelling(name, factor, words)
        swapped = " or ".join(_swapped(w) for w in words.split(" or "))
        yield Mislabelling(name, 1 / factor, INVERSE.get(words, swapped))


def _swapped(words: str) -> str:
    """`cm labelled mm` of `mm labelled cm`."""
    unit, labelled, label = words.partition(" labelled ")
    return label + labelled + unit


def corrected(plant: Plant, driven: Protocol, units: Mapping[str, str], wrong: Mislabelling | None) -> Protocol:
    """What drove the plant, with what was recorded wrongly put right; `units` are those of the file."""
    driven = Protocol(driven.time / clock(wrong), driven.inputs)
    if wrong is None or wrong.signal not in driven.inputs:
        return driven
    if wrong.other:
        return exchanged(plant, driven, units, wrong.signal, wrong.other)
    return Protocol(driven.time, driven.inputs | {wrong.signal: driven.inputs[wrong.signal] / wrong.factor})


def exchanged(plant: Plant, driven: Protocol, units: Mapping[str, str], one: str, other: str) -> Protocol:
    """What drove the plant with the numbers of two inputs' columns exchanged; `units` are those of the file."""
    si = {name: plant.quantity(name).unit for name in (one, other)}
    inputs = dict(driven.inputs)
    for to, of in ((one, other), (other, one)):
        written = converted(driven.inputs[of], si[of], units.get(of, si[of]))
        inputs[to] = converted(written, units.get(to, si[to]), si[to])
    return Protocol(driven.time, inputs)


def clock(wrong: Mislabelling | None) -> float:
    """How many times too large the times are."""
    return wrong.factor if wrong is not None and wrong.signal == TIME else 1.0
