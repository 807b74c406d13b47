"""Detection of mislabelled columns: a factor or sign of one signal, or an exchange of two inputs, that makes the
records agree with the declared plant; in all files, or in one of them.

The ranges of single signals (`checks`) reveal kV labelled V, but kPa labelled mbar is a plausible pressure too. A plant
that responds ten times as strongly as declared is less likely than a wrong label. So the usual mistakes are tried on
every signal. Where one of them alone makes records agree that otherwise do not, it is reported. So is a place from
which an output counts, as the distance that a laser reads. Nothing is changed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ...kernel import KernelError
from ...model.declare import Model
from ...model.units import converted, three
from ...plants.plant import Output, Plant
from ...protocol import Protocol
from ...recordings.table import either
from ..records.experiment import RESTED, Experiment, Recordings
from ..records.labels import matching
from .compiled import Compiled
from .mistakes import TIME, Mislabelling, clock, corrected, mislabellings
from .response import RUN_AWAY

# Set by judgement: enough to tell factors. Check: `pytest tests/test_reading.py -k wrong_by_a_factor`
DRIVEN_SAMPLES = 600  # [samples] of an experiment that drive the plant
READINGS = 150  # [samples] of it that are looked at
FEW_TRIED = 3  # [1] experiments that are looked at
ROUGHLY = 1e-4  # [1] tolerance of the answers
STARTS_SOUGHT = 2  # [1] Gauss-Newton steps to a record's own start,
START_MOVED = 0.05  # [1] of its usual size by which it is moved for them
FARTHEST_START = 10.0  # [1] and usual sizes that a step takes at most
START_PARTS = (1.0, 0.3, 0.1, 0.03)  # [1] of a step that are tried in turn
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

# Set by measurement: with a pressure 7 or 10 times too large or too small, or a voltage a thousand times too small in
# one file the declared tube misses 21 % of it and more, put right as much as of the others (4 to 12 %). Check:
# `pytest tests/test_reading.py -k in_one_file`
ENOUGH_FOLLOWED = 2  # [files] that the declared plant follows, for one to be unlike them,
PER_ODD = 2  # [1] and as many for each one that it does not
LEFT_ALONE = 0.4  # [1] share of what is missed of one file that another factor may leave: the others speak for it
# Set by judgement. Check: `pytest tests/test_reading.py -k distance`
ANOTHER_PLACE = 20.0  # [1] times its usual zero by which an output is off that counts from another place


@dataclass(frozen=True)
class Thinned:
    """One experiment, thinned: what drove the plant, and at which times what was `seen` (n,) of its output.

    `units` are those of the file's columns, `zero` was subtracted from the numbers in the output's.
    """

    name: str
    driven: Protocol
    times: np.ndarray
    seen: np.ndarray
    units: Mapping[str, str]
    zero: float


class DeclaredAnswers:
    """What the declared plant answers, beside what was read of an output in all experiments that have it."""

    def __init__(self, recordings: Recordings, output: Output) -> None:
        self.plant, self.known, self.output = recordings.plant, recordings.known_parameters, output
        self.kernel = Compiled(self.plant, [o.name for o in recordings.fitted_outputs]).kernel()  # a study's: one build
        self.experiments = [e for e in recordings.experiments if output.name in e.outputs]

    def record(self, experiment: Experiment) -> Thinned:
        """An experiment, thinned."""
        driven, times, seen = coarse_record(experiment, self.output.name)
        units = experiment.source.units if experiment.source else {}
        return Thinned(experiment.name, driven, times, seen, units, _zero(self.plant, experiment, self.known))

    def answer(self, record: Thinned, wrong: Mislabelling | None = None) -> np.ndarray:
        """The answer (n,) to what drove the plant under this mistake; `KernelError` where there is none."""
        driven, times = corrected(self.plant, record.driven, record.units, wrong), record.times / clock(wrong)

        def at(starts: Mapping[str, float]) -> np.ndarray:
            known = self.known | dict(starts)
            return self.kernel.simulate(driven, times, known, ROUGHLY, max_steps=SCALE_STEPS).values[self.output.name]

        return from_best_start(self.plant, at, self.put_right(record, wrong))

    def put_right(self, record: Thinned, wrong: Mislabelling | None) -> np.ndarray:
        """What was seen, as it is if this mistake was made."""
        if wrong is None or wrong.signal != self.output.name:
            return record.seen
        rest = record.zero if wrong.factor > 0 else 0.0  # a laser that counts the other way does so from rest
        return (record.seen + rest) / wrong.factor - rest

    def missed(self, records: Sequence[Thinned], wrong: Mislabelling | None = None) -> float:
        """The relative error (rms) of the records under this mistake; infinite where the plant cannot be solved."""
        try:
            answers = [self.answer(record, wrong) for record in records]
        except KernelError:
            return float("inf")
        far = max(float(np.abs(a).max(initial=0.0)) for a in answers)
        if far > RUN_AWAY:
            return far
        seen = [self.put_right(record, wrong) for record in records]
        left = sum(float(np.sum((y - a) ** 2)) for y, a in zip(seen, answers, strict=True))
        size = sum(float(np.sum(y**2)) for y in seen)
        return float(np.sqrt(left / size)) if size > 0 else float("inf")

    def likely(
        self, records: Sequence[Thinned], tried: Iterable[Mislabelling], most: float
    ) -> list[tuple[float, Mislabelling]]:
        """The mistakes that leave less than `most` of the records, and about as much as the best one."""
        shares = sorted(((self.missed(records, w), w) for w in tried), key=lambda pair: pair[0])
        return [(share, w) for share, w in shares if share < min(most, MOST_LEFT, FACTOR_ALIKE * shares[0][0])]

    def label(self, record: Thinned, signal: str) -> str:
        """The unit of a signal in the file; "" where it is not known."""
        names = self.output.headings if signal == self.output.name else (signal,)
        return next((record.units[n] for n in names if n in record.units), "")

    def told(self, record: Thinned, likely: Sequence[Mislabelling]) -> str:
        """The question which of likely mistakes was made, without those that the file's labels contradict."""
        fitting = [(w, matching(w.words, self.label(record, w.signal))) for w in likely]
        agreed = [replace(w, words=words) for w, words in fitting if words or " labelled " not in w.words]
        chosen = [w for w in agreed if w.words or w.other] or list(likely)
        scaled = [f"{self.name(w.signal)} {_times(w.factor)}{f' ({w.words})' if w.words else ''}" for w in chosen]
        asked = [f"is {either([s for s, w in zip(scaled, chosen, strict=True) if not w.other])}"]
        exchanges = [f"are the columns of {w.signal} and {w.other} exchanged" for w in chosen if w.other]
        return " or ".join([*(a for a in asked if a != "is "), *exchanges])

    def name(self, signal: str) -> str:
        """A signal as it stands in the files."""
        return self.output.headings[0] if signal == self.output.name else signal


def findings(recordings: Recordings) -> list[str]:
    """Signals whose scale contradicts the declared plant, in words: by the first output that tells."""
    told = (_by_one_output(DeclaredAnswers(recordings, output)) for output in recordings.fitted_outputs)
    return next((said for said in told if said), [])


def _by_one_output(declared: DeclaredAnswers) -> list[str]:
    plant, records = declared.plant, [declared.record(e) for e in _informative(declared.experiments)]
    base = declared.missed(records)
    alone = list(_single_files(declared))
    if alone or not base > MISSED:
        return alone
    if RUN_AWAY < base < np.inf:
        return [_runs_away(plant)]
    found = declared.likely(records, mislabellings(plant, [declared.output.name]), LEFT * base)
    if not found:
        return [*_size_in_another_unit(declared, records, base), *_counted_from_elsewhere(declared, records, base)]
    now = "has no answer to them" if base == np.inf else f"misses {_percent(base)} of these records (rms)"
    return [
        f"{declared.told(records[0], [w for _, w in found])}? With the numbers as they are, the declared {plant.name} "
        f"{now}, else it misses {_percent(found[0][0])}; if so, correct it in the files (a unit or a factor also with "
        f"--columns, as in {_example(declared, found[0][1])})"
    ]


def _example(declared: DeclaredAnswers, wrong: Mislabelling) -> str:
    """How a column is put right on the command line."""
    if wrong.signal == TIME:
        return f"time=COLUMN[{wrong.words.partition(' labelled ')[0]}]"
    measured = declared.plant.quantity(declared.output.name)
    half = f"0.5 {measured.display_unit or measured.unit}"
    return f"{declared.output.headings[0]}=COLUMN[{half}] for a column that reads 1 for {half}"


def _single_files(declared: DeclaredAnswers) -> Iterator[str]:
    """A sentence for every file alone in which a factor is wrong, where the declared plant follows the others."""
    records = [declared.record(e) for e in declared.experiments]
    if len(records) <= ENOUGH_FOLLOWED:
        return
    missed = {record.name: declared.missed([record]) for record in records}
    followed = [share for share in missed.values() if share < MOST_LEFT]
    odd = [record for record in records if missed[record.name] > max(MISSED, min(followed, default=0.0) / LEFT_ALONE)]
    others = [missed[record.name] for record in records if record not in odd]
    if len(others) < max(ENOUGH_FOLLOWED, PER_ODD * len(odd)) or max(others) > MOST_LEFT:
        return
    tried = [w for w in mislabellings(declared.plant, [declared.output.name]) if w.of_one_file]
    for record in odd:
        found = declared.likely([record], tried, LEFT_ALONE * missed[record.name])
        if found:
            yield (
                f"{record.name}: {declared.told(record, [w for _, w in found])} there? As it is, the declared "
                f"{declared.plant.name} misses {_percent(missed[record.name])} of this file (rms), else "
                f"{_percent(found[0][0])}, and of the others {_percent(max(others))} at most; if so, correct it there"
            )


def _counted_from_elsewhere(declared: DeclaredAnswers, records: Sequence[Thinned], base: float) -> Iterator[str]:
    """A sentence where all that is wrong with an output that has a value at rest is from where it counts, and perhaps
    in which direction."""
    if declared.output.rest is None:
        return
    try:
        answers = [declared.answer(record) for record in records]
    except KernelError:
        return
    answered, seen = np.concatenate(answers), np.concatenate([record.seen for record in records])
    output, record = declared.output, records[0]
    for sign, grows in ((-1.0, "falls"), (1.0, "grows")):
        at_rest = float(np.mean(seen - sign * answered))
        left = float(np.sqrt(np.mean((seen - at_rest - sign * answered) ** 2)) / np.std(answered))
        usual = ANOTHER_PLACE * output.zero if output.zero else float(np.ptp(answered))
        if left < min(LEFT * base, MOST_LEFT) and abs(at_rest) > usual:
            yield _from_elsewhere(declared, record, at_rest + record.zero, sign, grows, (base, left))


def _size_in_another_unit(declared: DeclaredAnswers, records: Sequence[Thinned], base: float) -> Iterator[str]:
    """A sentence where an output that was taken for a change is a size in another unit: a radius in mm, labelled um."""
    output, size = declared.output, declared.output.size_at_rest
    if not size or any(record.zero for record in records):
        return
    at_rest = (declared.plant.model.parameter_values() | dict(declared.known))[size]
    label, heading = declared.label(records[0], output.name), output.headings[0]
    mine = [w for w in mislabellings(declared.plant, [output.name]) if w.signal == output.name]
    tried = [replace(w, words=words) for w in mine if (words := matching(w.words, label))]
    if not tried:
        return
    wholes = [[replace(r, seen=r.seen / w.factor - at_rest) for r in records] for w in tried]
    shares = [(declared.missed(whole), w) for whole, w in zip(wholes, tried, strict=True)]
    share, wrong = min(shares, key=lambda pair: pair[0])
    if share < min(LEFT * base, MOST_LEFT):
        yield (
            f"is {output.change} no change but a {heading}, {wrong.words}? With the numbers as they are, the declared "
            f"{declared.plant.name} misses {_percent(base)} of these records (rms), else {_percent(share)}; if so, say "
            f"--columns '{heading}=COLUMN[{wrong.words.partition(' labelled ')[0]}]'"
        )


def _from_elsewhere(
    declared: DeclaredAnswers, record: Thinned, at_rest: float, sign: float, grows: str, missed: tuple[float, float]
) -> str:
    """The question whether an output is a distance, say, that reads so much `at_rest` (SI)."""
    output, si = declared.output, declared.plant.quantity(declared.output.name).unit
    unit = declared.label(record, output.name) or si
    number, without = f"{converted(at_rest, si, unit):.5g}", output.change
    size = output.size_at_rest
    hint = f"if that is its size, set {size} in bench.toml, or else" if sign > 0 and size else "if so,"
    return (
        f"is {declared.name(output.name)} a distance from elsewhere, which {grows} as the {without} grows and "
        f"is {number} {unit} at rest? With the numbers as they are, the declared {declared.plant.name} misses "
        f"{_percent(missed[0])} of these records (rms), else {_percent(missed[1])}; {hint} say --columns "
        f"'{without}=COLUMN[{sign:g} {unit} from {number}]'"
    )


def from_best_start(plant: Plant, at: Callable[[Mapping[str, float]], np.ndarray], seen: np.ndarray) -> np.ndarray:
    """The answer `at` the starts that the plant leaves free, which are those that what was `seen` (n,) tells.

    Each step is the largest part of a Gauss-Newton step that comes closer: a whole one may lead to where a plant has no
    answer, as an armature beyond its stop.
    """
    sizes, model = plant.each_start, plant.model
    starts = {n: model.parameter_values()[n] for n in sizes}
    here = at(starts)
    for _ in range(STARTS_SOUGHT if sizes else 0):
        with suppress(KernelError):
            moved = [at(starts | {n: starts[n] + START_MOVED * size}) for n, size in sizes.items()]
            columns = np.column_stack([(m - here) / START_MOVED for m in moved])
            by, *_ = np.linalg.lstsq(columns, seen - here, rcond=None)
            away = dict(zip(sizes, np.clip(by, -FARTHEST_START, FARTHEST_START).tolist(), strict=True))
            starts, here = _closer(model, at, seen, (starts, here), {n: sizes[n] * a for n, a in away.items()})
    return here


def _closer(
    model: Model,
    at: Callable[[Mapping[str, float]], np.ndarray],
    seen: np.ndarray,
    before: tuple[dict[str, float], np.ndarray],
    step: Mapping[str, float],
) -> tuple[dict[str, float], np.ndarray]:
    """Starts and the answer there after the largest part of a `step` that comes closer to what was `seen` (n,) than
    `before`; those before where none does."""
    starts, here = before
    for part in START_PARTS:
        tried = {n: model.quantity(n).inside(starts[n] + part * by) for n, by in step.items()}
        with suppress(KernelError):
            answer = at(tried)
            if np.sum((answer - seen) ** 2) < np.sum((here - seen) ** 2):
                return tried, answer
    return before


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


def _informative(experiments: Sequence[Experiment]) -> list[Experiment]:
    """The experiments with the largest first outputs, of those that start from rest if there are any."""
    rested = [e for e in experiments if e.start == RESTED] or list(experiments)
    first = next(iter(rested[0].outputs))
    with_it = [e for e in rested if first in e.outputs]
    return sorted(with_it, key=lambda e: -float(np.nanmax(np.abs(e.outputs[first]))))[:FEW_TRIED]


def coarse_record(experiment: Experiment, output: str) -> tuple[Protocol, np.ndarray, np.ndarray]:
    """What drove the plant, thinned and with its noise, good enough to tell factors; times and what was read."""
    seen = np.flatnonzero(experiment.seen(output))
    taken = seen[:: max(1, seen.size // READINGS)]
    few = np.unique(np.linspace(0, experiment.time.size - 1, DRIVEN_SAMPLES).astype(int))
    driven = Protocol(experiment.time[few], {name: values[few] for name, values in experiment.inputs.items()})
    return driven, experiment.time[taken], experiment.outputs[output][taken]


def _zero(plant: Plant, experiment: Experiment, known: Mapping[str, float]) -> float:
    """What was subtracted from the file's numbers (a radius at rest); 0 for what is relative."""
    values = plant.model.parameter_values() | dict(known)
    for output in plant.outputs:
        for heading, parameter in output.columns.items():
            if parameter and experiment.source and heading in experiment.source.columns:
                return values[parameter]
    return 0.0
