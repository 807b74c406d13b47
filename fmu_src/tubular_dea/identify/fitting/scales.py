"""Detection of mislabelled columns: a factor or sign of one signal, or an exchange of two inputs, that makes the
records agree with the declared plant.

The ranges of single signals (`checks`) reveal kV labelled V, but kPa labelled mbar is a plausible pressure too. A plant
that responds ten times as strongly as declared is less likely than a wrong label. So the factors of usual mistakes are
tried on every signal. Where one of them alone makes records agree that otherwise do not, it is reported. Nothing is
changed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ...kernel import KernelError
from ...model.units import converted, three
from ...plants.plant import Plant
from ...protocol import Protocol
from ..records.experiment import RESTED, Experiment, Recordings
from .compiled import Compiled
from .response import RUN_AWAY

# Set by judgement: enough to tell factors. Check: `pytest tests/test_reading.py -k wrong_by_a_factor`
DRIVEN_SAMPLES = 600  # [samples] of an experiment that drive the plant
READINGS = 150  # [samples] of it that are looked at
FEW_TRIED = 3  # [1] experiments that are looked at
ROUGHLY = 1e-4  # [1] tolerance of the answers
STARTS_SOUGHT = 2  # [1] Gauss-Newton steps to a record's own start,
START_MOVED = 0.05  # [1] of its usual size by which it is moved for them
FARTHEST_START = 10.0  # [1] and usual sizes that a step takes at most
SCALE_STEPS = 10_000  # [1] internal steps after which an answer is given up: the plant diverges

# Set by measurement: the bench's and the laboratory's tubes, whatever they hide, are missed by up to 22 %, and no
# factor leaves a third of that (largest reduction: 1.7 times); with a factor wrong on purpose 26 to 999 % are, and the
# right one leaves 3 %. Check: `pytest tests/test_reading.py -k wrong_by_a_factor`,
# `python -m blind.score --nulls 60 --seed 1000`
MISSED = 0.15  # [1] of a record (rms) that the declared plant misses before anything is said
LEFT = 1 / 3  # [1] share of that which another factor may leave
TOLD_SHARE = 10.0  # [1] of a record: a larger share that is missed is told as "all" of it
MOST_LEFT = 0.3  # [1] of the record that it may leave: a plant whose model lacks much is no wrong unit
FACTOR_ALIKE = 2.0  # [1] times the misfit of the best factor: another one explains the record as well

# Set by convention: units and mistakes of laboratories. Check: `pytest tests/test_reading.py -k wrong_by_a_factor`
# [1] by SI unit, how many times too large a number is that was mislabelled so
FACTORS: Mapping[str, Mapping[float, str]] = {
    "m": {10.0: "mm labelled cm", 25.4: "mm labelled inch", 1e3: "um labelled mm or mm labelled m"},
    "Pa": {
        10.0: "mbar labelled kPa",
        100.0: "Pa labelled mbar or Pa labelled hPa",
        1e3: "Pa labelled kPa",
        7.50062: "mmHg labelled kPa",
        6.89476: "kPa labelled psi",
        68.9476: "mbar labelled psi",
        133.322: "Pa labelled mmHg",
    },
    "V": {1e3: "V labelled kV or mV labelled V", 2.0: "twice the voltage (peak to peak, or of two outputs)"},
    "A": {1e3: "uA labelled mA or mA labelled A", 1e6: "uA labelled A"},
    "rad": {57.2958: "degrees labelled rad"},
    "rad/s": {9.5493: "rpm labelled rad/s", 57.2958: "degrees per second labelled rad/s", 6.28319: "rad/s labelled Hz"},
    "m3/s": {60.0: "mL/min labelled mL/s", 16.6667: "mL/s labelled L/min", 1e3: "mL/s labelled L/s"},
}
ROUND = ("radi", "diam")  # words about what is
ACROSS = {2.0: "a diameter for a radius"}  # [1] the same for that
TIME = "time"
TIMES = {60.0: "s labelled min", 1e3: "ms labelled s"}  # [1] the same for the times of all records
OTHERWISE = {10.0: "", 1e3: ""}  # [1] the same for any other unit
INVERSE = {  # the same, so many times too small
    "a diameter for a radius": "a radius for a diameter",
    "mm labelled cm": "cm labelled mm",
    "twice the voltage (peak to peak, or of two outputs)": "half the voltage (an amplitude, or one output of two)",
}


@dataclass(frozen=True)
class Mislabelling:
    """A signal whose numbers are `factor` times what they should be, or those of the input `other`, and the other way
    round; `words` describe the mistake."""

    signal: str
    factor: float
    words: str
    other: str = ""


def mislabellings(plant: Plant, outputs: Sequence[str]) -> Iterator[Mislabelling]:
    """All single mistakes."""
    for one, other in combinations([s.name for s in plant.inputs], 2):
        yield Mislabelling(one, 1.0, "", other)
    for name in [*(s.name for s in plant.inputs), *outputs]:
        quantity = plant.quantity(name)
        yield from _both_ways(name, FACTORS.get(quantity.unit, OTHERWISE))
        said = " ".join([name, quantity.description, *(h for o in plant.outputs if o.name == name for h in o.headings)])
        if any(word in said.lower() for word in ROUND):
            yield from _both_ways(name, ACROSS)
        yield Mislabelling(name, -1.0, "counted the other way")
    if not plant.each_start:  # in slow times a start that is not known does not count: that is no wrong unit
        yield from _both_ways(TIME, TIMES)


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


def findings(recordings: Recordings) -> list[str]:
    """Signals whose scale contradicts the declared plant, in words."""
    plant, chosen = recordings.plant, _informative(recordings.experiments)
    output = next(o for o in plant.outputs if chosen and o.name in recordings.experiments[chosen[0]].outputs)
    parameters = recordings.known_parameters
    kernel = Compiled(plant, [o.name for o in recordings.fitted_outputs]).kernel()  # a study's, so compiled once
    experiments = [recordings.experiments[i] for i in chosen]
    records = [coarse_record(e, output.name) for e in experiments]
    units = [e.source.units if e.source else {} for e in experiments]
    zero = _zero(plant, experiments[0], parameters)

    def answer(driven: Protocol, times: np.ndarray, seen: np.ndarray) -> np.ndarray:
        def at(starts: Mapping[str, float]) -> np.ndarray:
            known = parameters | dict(starts)
            return kernel.simulate(driven, times, known, ROUGHLY, max_steps=SCALE_STEPS).values[output.name]

        return from_best_start(plant, at, seen)

    def missed(wrong: Mislabelling | None) -> float:
        """The relative error (rms) of the records under this mistake; infinite where the plant cannot be solved."""
        scale = wrong.factor if wrong and wrong.signal == output.name else 1.0
        rest = zero if scale > 0 else 0.0  # a laser that counts the other way does so from where the plant rests
        seen = [(y + rest) / scale - rest for *_, y in records]
        clock = _clock(wrong)
        driven = [_corrected(plant, d, u, wrong) for (d, *_), u in zip(records, units, strict=True)]
        try:
            answers = [answer(d, t / clock, y) for d, (_, t, _), y in zip(driven, records, seen, strict=True)]
        except KernelError:
            return float("inf")
        far = max(float(np.abs(a).max(initial=0.0)) for a in answers)
        if far > RUN_AWAY:
            return far
        left = sum(float(np.sum((y - a) ** 2)) for y, a in zip(seen, answers, strict=True))
        size = sum(float(np.sum(y**2)) for y in seen)
        return float(np.sqrt(left / size)) if size > 0 else float("inf")

    def name(signal: str) -> str:
        """As it stands in the files."""
        return output.headings[0] if signal == output.name else signal

    base = missed(None)
    if not base > MISSED:
        return []
    if RUN_AWAY < base < np.inf:
        return [_runs_away(plant)]
    tried = sorted(((missed(w), w) for w in mislabellings(plant, [output.name])), key=lambda pair: pair[0])
    most = min(LEFT * base, MOST_LEFT, FACTOR_ALIKE * tried[0][0])
    likely = [w for share, w in tried if share < most]
    if not likely:
        return []
    scaled = [f"{name(w.signal)} {_times(w.factor)}{f' ({w.words})' if w.words else ''}" for w in likely if not w.other]
    asked = [f"is {' or '.join(scaled)}"] if scaled else []
    asked += [f"are the columns of {w.signal} and {w.other} exchanged" for w in likely if w.other]
    return [
        f"{' or '.join(asked)}? With the numbers as they are, the declared {plant.name} misses {_percent(base)} of "
        f"these records (rms), else {_percent(tried[0][0])}; if so, correct it in the files (a unit or a factor "
        f"also with --columns, as in {output.headings[0]}=COLUMN[0.5 mm] for a column that reads 1 for 0.5 mm)"
    ]


def from_best_start(plant: Plant, at: Callable[[Mapping[str, float]], np.ndarray], seen: np.ndarray) -> np.ndarray:
    """The answer `at` the starts that the plant leaves free, which are those that what was `seen` (n,) tells."""
    sizes, model = plant.each_start, plant.model
    starts = {n: model.parameter_values()[n] for n in sizes}
    here = at(starts)
    for _ in range(STARTS_SOUGHT if sizes else 0):
        moved = [at(starts | {n: starts[n] + START_MOVED * size}) for n, size in sizes.items()]
        columns = np.column_stack([(m - here) / START_MOVED for m in moved])
        by, *_ = np.linalg.lstsq(columns, seen - here, rcond=None)
        away = np.clip(by, -FARTHEST_START, FARTHEST_START)
        sought = {n: starts[n] + by * sizes[n] for n, by in zip(sizes, away.tolist(), strict=True)}
        starts = {n: model.quantity(n).inside(value) for n, value in sought.items()}
        here = at(starts)
    return here


def _runs_away(plant: Plant) -> str:
    """What to look at where a plant runs away at its declared values."""
    model = plant.model
    negative = [(n, v) for n, v in model.parameter_values().items() if v < 0]
    below = [f"{n} = {v:g} {model.quantity(n).unit}".removesuffix(" 1") for n, v in negative]
    first = f" ({', '.join(below)})" if below else ""
    return (
        f"has a parameter the wrong sign{first}, or the wrong size? At its declared values {plant.name} runs away "
        "under these inputs"
    )


def _percent(share: float) -> str:
    return f"{share:.0%}" if share < TOLD_SHARE else "all"


def _times(factor: float) -> str:
    if factor < 0:
        return "of the wrong sign"
    return f"{three(factor)} times too large" if factor > 1 else f"{three(1 / factor)} times too small"


def _informative(experiments: Sequence[Experiment]) -> list[int]:
    """The experiments with the largest outputs, of those that start from rest if there are any."""
    rested = [i for i, e in enumerate(experiments) if e.start == RESTED] or list(range(len(experiments)))
    first = next(iter(experiments[rested[0]].outputs))
    with_it = [i for i in rested if first in experiments[i].outputs]
    return sorted(with_it, key=lambda i: -float(np.nanmax(np.abs(experiments[i].outputs[first]))))[:FEW_TRIED]


def coarse_record(experiment: Experiment, output: str) -> tuple[Protocol, np.ndarray, np.ndarray]:
    """What drove the plant, thinned and with its noise, good enough to tell factors; times and what was read."""
    seen = np.flatnonzero(experiment.seen(output))
    taken = seen[:: max(1, seen.size // READINGS)]
    few = np.unique(np.linspace(0, experiment.time.size - 1, DRIVEN_SAMPLES).astype(int))
    driven = Protocol(experiment.time[few], {name: values[few] for name, values in experiment.inputs.items()})
    return driven, experiment.time[taken], experiment.outputs[output][taken]


def _corrected(plant: Plant, driven: Protocol, units: Mapping[str, str], wrong: Mislabelling | None) -> Protocol:
    """What drove the plant, with what was recorded wrongly put right; `units` are those of the file."""
    driven = Protocol(driven.time / _clock(wrong), driven.inputs)
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


def _clock(wrong: Mislabelling | None) -> float:
    """How many times too large the times are."""
    return wrong.factor if wrong is not None and wrong.signal == TIME else 1.0


def _zero(plant: Plant, experiment: Experiment, known: Mapping[str, float]) -> float:
    """What was subtracted from the file's numbers (a radius at rest); 0 for what is relative."""
    values = plant.model.parameter_values() | dict(known)
    for output in plant.outputs:
        for heading, parameter in output.columns.items():
            if parameter and experiment.source and heading in experiment.source.columns:
                return values[parameter]
    return 0.0
