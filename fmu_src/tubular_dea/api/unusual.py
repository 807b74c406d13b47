"""What is odd about a set of recordings though each file can be read: sizes, spikes, gaps, copies of other files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ..identify.records.checks import STRUCTURE, at_limit
from ..identify.records.experiment import Experiment, Recordings
from ..identify.records.spikes import spikes
from ..identify.records.start import begun_elsewhere
from ..identify.signals.monitors import equal_stretches, noise_level
from ..identify.signals.sampling import usual_step
from ..model.declare import Quantity
from ..model.units import converted, three
from ..recordings.table import moving

# Set by judgement: signals of the examples reach 0.5 to 9 times their nominal values. Check: `pytest
# tests/test_recordings.py -k odd`
FACTOR = 100.0  # [1] times its declared size that a signal is too large or too small for its unit
UNLIKE = 10.0  # [1] times what it spans in the other files, and more than what answers it, that one signal spans
HELD = 0.5  # [1] share of what another input spans in the other files, below which it is that which drives these
TAILS = 0.005  # [1] share of the samples at either end of what it spans, of which a few may be spikes
ELSEWHERE = 2.0  # [1] times what an input spans in all other files together, that it lies beyond them in one
KELVIN = 273.15  # [K] that a temperature is off where degC and K are confused
CLOCKS = (60.0, 3600.0, 1e3, 1e6)  # [1] times that a clock in another unit is too fast or too slow,
SAME_CLOCK = 0.01  # [1] and by which that may be off
FLICKERS, FAINT = 2, 1e-3  # [times] that a set point leaves its value for a sample, by [1] of its span at most
OTHERS = 2  # [files] in which a signal moves too, for one to be unlike them
SPIKES, BEYOND = 3, 100.0  # [samples] and [1] times what all others come to: samples that stand alone
STUCK, STUCK_BESIDE = 20, 4  # [samples] and [1] times any other run: readings that repeat, of a sensor that is stuck,
MOVED_SHARE = 0.05  # [1] of its span by which an input moves meanwhile
JUMP = 5.0  # [1] times any other step from sample to sample that an output jumps by where two records are joined
CENTRED_FILES, ROUNDED = 3, 1e-3  # [files] and [1] of its span: records whose mean is nothing but for rounding
MISTYPED = 50.0  # [1] times the noise that records of so many samples show, by which a stated one is another unit
FEWEST = 20  # [samples] of these
GAPS = 0.1  # [1] share of samples without a number that is worth a sentence


def findings(recordings: Recordings) -> list[str]:
    """All of it, in words."""
    signals = (_starts, _spikes, _jumps, _sizes, _centred, _unlike, _elsewhere, _kelvin, _flickers, _stuck, _ended)
    return [said for one in (*signals, _clocks, _gaps, _copies, _stated) for said in one(recordings)]


def _sizes(recordings: Recordings) -> Iterator[str]:
    """Signals far from the size that the plant declares."""
    plant = recordings.plant
    most = {s.name: s.most for s in plant.inputs} | {o.name: o.most for o in plant.outputs}
    for name, declared in most.items():
        q = plant.quantity(name)
        records = [_together(v) for e in recordings.experiments if (v := _values(e, name)).size]
        largest = max((float(np.abs(v).max()) for v in records), default=0.0)
        large = largest > max(FACTOR * q.nominal, declared if np.isfinite(declared) else 0.0)
        if large or (0 < largest < q.nominal / FACTOR and any(map(_moves, records))):
            unit = "" if q.unit == "1" else f" {q.unit}"
            yield (
                f"{name} reaches {largest:.3g}{unit} in these records, {largest / q.nominal:.2g} times its declared "
                f"size (nominal: {q.nominal:.3g}{unit}): is its unit in the files right? If so, correct nominal"
            )


def _starts(recordings: Recordings) -> Iterator[str]:
    """Outputs that begin in all files elsewhere than where the plant is declared to start."""
    for output in recordings.plant.outputs:
        if apart := begun_elsewhere(recordings, output):
            q, (first, read, declared) = recordings.plant.quantity(output.name), apart
            yield (
                f"{output.name} begins with {_in_file(first, q, read)} in {first.name}, in every file far from what "
                f"the declared start says, {_in_file(first, q, declared)} there: is that start right?"
            )


def _spikes(recordings: Recordings) -> Iterator[str]:
    """Samples that stand alone, far from all others, and single ones of inputs: those of outputs are left out.

    An output that depends on rates has such samples where an input switches: the charging of a capacitance. What was
    commanded is as it stands in the file.
    """
    left_out = recordings.commanded | {o.name for o in recordings.plant.outputs if o.feels_rates}
    for e in recordings.experiments:
        for name, values in ((n, v) for n, v in (*e.inputs.items(), *e.outputs.items()) if n not in left_out):
            there = np.flatnonzero(np.isfinite(values))
            alone = there[_alone(values[there])]
            if name in e.inputs:
                alone = np.union1d(alone, spikes(values))
            if alone.size:
                yield _stands_alone(e, recordings.plant.quantity(name), values, alone)


def _stands_alone(e: Experiment, quantity: Quantity, values: np.ndarray, alone: np.ndarray) -> str:
    """What is said of samples that stand `alone`, in the unit of the file and with the line of the first."""
    first, times = int(alone[0]), f"{alone.size} sample{'s' if alone.size > 1 else ''}"
    at = "in" if e.source else "at"
    return (
        f"{e.name}: {quantity.name} is {_in_file(e, quantity, values[first])} {at} {_place(e, first)}, far from the "
        f"others ({times}): is it a spike? If so, leave its cell empty"
    )


def _in_file(e: Experiment, quantity: Quantity, value: float) -> str:
    """A value (SI) in the unit of the file."""
    shown = quantity.display_unit or quantity.unit
    unit = e.source.units.get(quantity.name, shown) if e.source else shown
    return f"{converted(value, quantity.unit, unit):.4g} {unit}".removesuffix(" 1")


def _place(e: Experiment, sample: int) -> str:
    """Where a sample stands."""
    return f"{e.source.row} {e.lines[sample]}" if e.source else f"{e.time[sample] - e.time[0]:.4g} s"


def _jumps(recordings: Recordings) -> Iterator[str]:
    """Outputs that jump once, far beyond what they move by elsewhere, while no input does: records that were joined.

    A plant with a fold may snap through.
    """
    for e in recordings.experiments if recordings.plant.model.curve is None else ():
        for name, values in e.outputs.items():
            there = np.flatnonzero(np.isfinite(values))
            steps = np.abs(np.diff(values[there]))
            if steps.size < STUCK:
                continue
            k = int(np.argmax(steps))
            usual = max(float(np.delete(steps, k).max()), STRUCTURE / JUMP * noise_level(values[there]))
            after = int(there[k + 1])
            aside = slice(max(int(there[k]) - 1, 0), after + 1)
            driven = any(np.ptp(v[aside]) > MOVED_SHARE * np.ptp(v) for v in e.inputs.values())
            stood = np.ptp(values[there[max(k - STUCK, 0) : k + 1]]) == 0  # a sensor that was stuck
            if steps[k] > JUMP * usual and not (driven or stood):
                by = recordings.plant.quantity(name).told(float(f"{steps[k]:.3g}"))
                yield (
                    f"{e.name}: {name} jumps by {by} in one sample ({_place(e, after)}), while no input does: are two "
                    "recordings joined there, or was the sensor moved? If so, give what follows a file of its own"
                )


def _centred(recordings: Recordings) -> Iterator[str]:
    """Signals that do not begin with nothing, and whose mean is nothing in every file: of which it was taken off."""
    plant, experiments = recordings.plant, recordings.experiments
    names = [*(s.name for s in plant.inputs), *(o.name for o in plant.outputs)]
    centred = [name for name in names if _is_centred([v for e in experiments if (v := _values(e, name)).size])]
    if centred:
        yield (
            f"the mean of {' and of '.join(centred)} is 0 in every file: was it taken off? If so, give the numbers as "
            "they were measured: where a plant rests is part of what it does"
        )


def _is_centred(records: Sequence[np.ndarray]) -> bool:
    """Whether the means of a signal's records are nothing but for rounding, though some do not begin with nothing."""
    begun = [v for v in records if _moves(v) and abs(v[0]) > STRUCTURE * noise_level(v)]
    return len(begun) >= CENTRED_FILES and all(abs(v.mean()) <= ROUNDED * float(np.ptp(v)) for v in records)


def _unlike(recordings: Recordings) -> Iterator[str]:
    """Signals that span far more or less in one file than in the others, though what answers them does not."""
    experiments = recordings.experiments
    inputs = [*dict.fromkeys(name for e in experiments for name in e.inputs)]
    outputs = [*dict.fromkeys(name for e in experiments for name in e.outputs)]
    ratios = {name: _ratios(experiments, name) for name in (*inputs, *outputs)}
    rates = {name: _ratios(experiments, name, rate=True) for name in inputs}  # a current follows the voltage's
    whole = {name: _ratios(experiments, name, tails=0.0) for name in ratios}  # spikes of a current, too, change by it
    sizes = {name: _size_ratios(experiments, name) for name in ratios}  # another unit makes what is held larger, too
    for name, answers in [*((n, outputs) for n in inputs), *((n, inputs) for n in outputs)]:
        for file, ratio in ratios[name].items():
            beside = [r[a][file] for r in (ratios, rates) for a in answers if file in r.get(a, {})]
            size = sizes[name][file]
            larger = min(ratio, whole[name][file], size) > UNLIKE and ratio > UNLIKE * max(beside, default=np.inf)
            smaller = max(ratio, whole[name][file], size) < 1 / UNLIKE and ratio < min(beside, default=0.0) / UNLIKE
            others = [ratios[n].get(file, 0.0) for n in inputs if n != name] if name in inputs else []
            driven = any(others)  # by another input, as it may be; or the other files are, that hold this one
            if (larger and min(others, default=1.0) > HELD) or (smaller and not driven):
                yield (
                    f"{file}: {name} spans {ratio:.2g} times what it spans in the other files, and "
                    f"{' and '.join(answers)} no such multiple: is its unit in this file right?"
                )


def _elsewhere(recordings: Recordings) -> Iterator[str]:
    """Inputs that move far beyond all that they are in the other files, where no output does: degF for degC."""
    experiments, plant = recordings.experiments, recordings.plant
    ends = {
        name: _ends(experiments, name) for name in (*(s.name for s in plant.inputs), *(o.name for o in plant.outputs))
    }
    for name in [s.name for s in plant.inputs]:
        moves = {file: span for file, span in ends[name].items() if span[1] > span[0]}
        for e in experiments if len(moves) > OTHERS else ():
            answered = any(_beyond(e.name, {f: ends[n][f] for f in moves if f in ends[n]}, 0.0) for n in e.outputs)
            if _beyond(e.name, moves, ELSEWHERE) and not answered:
                low, high = (_in_file(e, plant.quantity(name), end) for end in moves[e.name])
                yield (
                    f"{e.name}: {name} lies between {low} and {high}, far from what it is in the other files, and no "
                    "output does: is its unit in this file right?"
                )


def _kelvin(recordings: Recordings) -> Iterator[str]:
    """Temperatures that stand still in every file, and in one of them as far from the others as K from degC."""
    for name in (s.name for s in recordings.plant.inputs):
        quantity, ends = recordings.plant.quantity(name), _ends(recordings.experiments, name)
        if quantity.unit not in ("K", "degC") or any(low < high for low, high in ends.values()):
            continue
        for e in (e for e in recordings.experiments if e.name in ends):
            here, others = ends[e.name][0], [level for file, (level, _) in ends.items() if file != e.name]
            if len(others) < OTHERS or np.min(np.abs(here - np.array(others))) < 0.5 * KELVIN:
                continue
            if any(min(others) <= here + by <= max(others) for by in (KELVIN, -KELVIN)):
                yield (
                    f"{e.name}: {name} is {_in_file(e, quantity, here)}, as far from what it is in the other files as "
                    "K from degC: is its unit in this file right?"
                )


def _clocks(recordings: Recordings) -> Iterator[str]:
    """Files whose samples are as far apart as those of all others on a clock in another unit."""
    steps = {e.name: usual_step(e.time) for e in recordings.experiments if e.time.size > 1}
    for file, step in steps.items():
        others = [other for name, other in steps.items() if name != file]
        if len(others) < OTHERS or max(others) > (1 + SAME_CLOCK) * min(others):
            continue
        ratio = step / others[0]
        if any(abs(r / by - 1) < SAME_CLOCK for r in (ratio, 1 / ratio) for by in CLOCKS):
            yield (
                f"{file}: its samples are {three(step)} s apart, those of the other files {three(others[0])} s: is the "
                "unit of its times right?"
            )


def _flickers(recordings: Recordings) -> Iterator[str]:
    """Inputs that are said to have no noise, and yet leave the value that they are held at for a sample."""
    for name in (s.name for s in recordings.plant.inputs if s.held and s.name in recordings.commanded):
        for e in recordings.experiments:
            by = _flickered(_values(e, name))
            if by.size >= FLICKERS:
                most = recordings.plant.quantity(name).told(float(by.max()))
                yield (
                    f"{e.name}: {name} is said to have no noise, but leaves its value for a sample {by.size} "
                    f"times (by {most}): was it measured? If so, leave that line of bench.toml out"
                )
                break


def _flickered(values: np.ndarray) -> np.ndarray:
    """By how much an input (n,) leaves a value for a sample, each time; nothing where most of its small moves do not
    come back, as those of a rounded sine do at its turning points."""
    step = np.diff(values)
    small = (step != 0) & (np.abs(step) <= FAINT * np.ptp(values))
    back = small[1:] & (step[:-1] == -step[1:])
    back[1:] &= step[:-2] == 0
    back[:-1] &= step[2:] == 0
    by = np.abs(step[1:][back])
    return by if 4 * by.size > np.count_nonzero(small) else by[:0]


def _ends(experiments: Sequence[Experiment], name: str) -> dict[str, tuple[float, float]]:
    """The least and the largest value of a signal in every file that has it."""
    records = {e.name: v for e in experiments if (v := _values(e, name)).size}
    return {file: (float(values.min()), float(values.max())) for file, values in records.items()}


def _beyond(file: str, ends: Mapping[str, tuple[float, float]], by: float) -> bool:
    """Whether a signal lies in one file beyond all others, `by` times what it spans in these."""
    others = [span for other, span in ends.items() if other != file]
    if file not in ends or not others:
        return False
    low, high = min(low for low, _ in others), max(high for _, high in others)
    return max(ends[file][0] - high, low - ends[file][1]) > by * (high - low)


def _ratios(experiments: Sequence[Experiment], name: str, rate: bool = False, tails: float = TAILS) -> dict[str, float]:
    """By file in which a signal moves, what it (or its rate) spans there over what it usually spans in the others, but
    for a share `tails` of the samples at either end."""
    moving = {e.name: _values(e, name, rate) for e in experiments if _moves(_together(_values(e, name)))}
    spans = {file: float(np.subtract(*np.quantile(v, (1 - tails, tails)))) for file, v in moving.items()}
    spans = {file: span for file, span in spans.items() if span > 0}  # 0: it moves in too few samples to tell
    usual = {file: [s for other, s in spans.items() if other != file] for file in spans}
    return {f: spans[f] / float(np.median(u)) for f, u in usual.items() if len(u) >= OTHERS}


def _size_ratios(experiments: Sequence[Experiment], name: str) -> dict[str, float]:
    """By file, the largest size of a signal over its usual one in the others."""
    sizes = {e.name: float(np.abs(_together(v)).max()) for e in experiments if (v := _values(e, name)).size}
    usual = {
        file: float(np.median([s for other, s in sizes.items() if other != file] or [size]))
        for file, size in sizes.items()
    }
    return {file: size / max(usual[file], 1e-300) for file, size in sizes.items()}


def _together(values: np.ndarray) -> np.ndarray:
    """Values without those that stand alone."""
    return values[~_alone(values)]


def _alone(values: np.ndarray) -> np.ndarray:
    """Which of the values, all finite, are few and far beyond all others; (n,) of bool."""
    away = np.abs(values - np.median(values)) if values.size else values
    limit = BEYOND * float(np.sort(away)[-SPIKES - 1]) if values.size > SPIKES else np.inf
    found: np.ndarray = away > limit if limit > 0 else np.zeros(values.size, dtype=bool)
    return found


def _gaps(recordings: Recordings) -> Iterator[str]:
    """Outputs with many samples that hold no number."""
    for e in recordings.experiments:
        for name, values in e.outputs.items():
            empty = int(np.count_nonzero(~np.isfinite(values)))
            if empty > GAPS * values.size:
                said = f"{e.name}: {empty} of {values.size} samples of {name} are left out"
                yield f"{said}: they hold no number, or repeat the one before"


def _stuck(recordings: Recordings) -> Iterator[str]:
    """Outputs that repeat one reading for long, and no other one, while an input moves: a sensor that is stuck, but for
    what is at the end of all that it reads."""
    for e in recordings.experiments:
        for name, values in ((n, v[np.isfinite(v)]) for n, v in e.outputs.items()):
            where = np.flatnonzero(np.isfinite(e.outputs[name]))
            begins, lasts = equal_stretches(values)
            longest = int(np.argmax(lasts))
            first, count = int(begins[longest]), int(lasts[longest])
            others = int(np.delete(lasts, longest).max(initial=1))
            if count < max(STUCK, STUCK_BESIDE * others) or values[first] in (values.min(), values.max()):
                continue
            held = slice(int(where[first]), int(where[first + count - 1]) + 1)
            moved = [n for n, v in e.inputs.items() if np.ptp(v[held]) > MOVED_SHARE * np.ptp(v)]
            if moved:
                yield _stands_still(e, recordings.plant.quantity(name), values[first], held, moved)


def _ended(recordings: Recordings) -> Iterator[str]:
    """Outputs whose noise is gone where they are largest or smallest: the sensor may be at the end of what it reads."""
    for name in (o.name for o in recordings.plant.outputs):
        found = []
        for e in (e for e in recordings.experiments if e.seen(name).any()):
            seen = np.flatnonzero(e.seen(name))
            found += [(e, there) for there in [seen[at_limit(e.outputs[name][seen])]] if there.size]
        if found:
            first, there = found[0]
            value = _in_file(first, recordings.plant.quantity(name), first.outputs[name][there[0]])
            yield (
                f"{first.name}: {name} is {value} in {there.size} samples from {_place(first, int(there[0]))} on, and "
                f"never beyond{_and_files(len(found) - 1)}: is the sensor at its limit? If so, leave these cells "
                "empty, or see whether a saturation is named"
            )


def _and_files(more: int) -> str:
    """As many more files, in words."""
    return f" (and so in {more} more file{'s' if more > 1 else ''})" if more else ""


def _stands_still(e: Experiment, quantity: Quantity, value: float, held: slice, moved: Sequence[str]) -> str:
    """What is said of samples that all hold one value, while inputs moved."""
    return (
        f"{e.name}: {quantity.name} is {_in_file(e, quantity, value)} in all {held.stop - held.start} samples from "
        f"{_place(e, held.start)} on, while {moving(moved)}: is the sensor stuck? If so, leave these cells empty"
    )


def _copies(recordings: Recordings) -> Iterator[str]:
    """Experiments that hold the same numbers: one that is held out tests nothing then."""
    seen: dict[bytes, str] = {}
    for e in recordings.experiments:
        numbers = b"".join(np.ascontiguousarray(v).tobytes() for v in (*e.inputs.values(), *e.outputs.values()))
        first = seen.setdefault(numbers, e.name)
        if first != e.name:
            yield f"{first} and {e.name} hold the same numbers: held out, one tests nothing of the other; remove one"


def _stated(recordings: Recordings) -> Iterator[str]:
    """Noise that bench.toml gives, far from what differs from sample to sample."""
    names = {s.name: s.name for s in recordings.plant.inputs}
    names |= {heading: o.name for o in recordings.plant.outputs for heading in (*o.headings, o.name)}
    for said, level in recordings.noise.items():
        records = [v for e in recordings.experiments if (v := _values(e, names[said])).size > FEWEST]
        seen = float(np.median([noise_level(v) for v in records])) if records else 0.0
        if level and seen and not seen / MISTYPED < level < seen * MISTYPED:
            q = recordings.plant.quantity(names[said])
            yield (
                f"bench.toml: [noise] {said} is {q.in_words(level)}, but from sample to sample "
                f"these records tell {q.in_words(seen)}: is its unit right?"
            )


def _values(experiment: Experiment, name: str, rate: bool = False) -> np.ndarray:
    values = (experiment.inputs | experiment.outputs).get(name, np.empty(0))
    there = np.isfinite(values)
    return np.diff(values[there]) / np.diff(experiment.time[there]) if rate and values.size else values[there]


def _moves(values: np.ndarray) -> bool:
    return values.size > 3 and float(np.ptp(values)) > STRUCTURE * noise_level(values)
