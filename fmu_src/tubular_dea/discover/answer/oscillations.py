"""Oscillations that no recorded input drives: lines in the sensor's spectrum that are not mains hum.

The noise estimate finds them in quiet parts of the records and removes them (`Noise.lines`). Here their frequency is
refined over all records, and their amplitude is determined in the residual of each. Where the model oscillates more
with it, an input drives it, and the residual is what the model misses of that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...identify.records.experiment import Experiment
from ...identify.signals.sampling import usual_step
from ...identify.study.nuisances import with_nuisances
from ...identify.study.study import Piece, Study
from ..engine import Discovery

Record = tuple[str, np.ndarray, np.ndarray]  # a piece's name, its times [s] and residual, each (n,)

# Set by judgement: about what a block of the estimate of noise resolves (LINE_BLOCK of identify/signals/hum.py).
# Check: `pytest tests/test_discover.py::test_an_oscillation_that_no_input_drives_is_told`
LINE_NEAR = 0.06  # [Hz] around a line's frequency within which it is made finer; less where blocks are longer,
# beside a plant that goes slower than usual
LINE_PLACES = 61  # [1] places there that are compared
LINE_TOLD = 4.0  # [standard errors] of an amplitude from which on it is told

# Set by theory: white noise in a mean with the weights of Hann, two phases. Check: `pytest tests/test_oscillations.py`
WINDOW = 3.0  # [1] over the number of samples: squared error of an amplitude, in units of the noise

# Set by judgement. Check: `pytest tests/test_oscillations.py`
OWN_SHARE = 0.05  # [1] of the variance of a residual that a wave has at least
MOSTLY_ONE = 0.4  # [1] of the variance of an input that one wave has
OVERTONES = 9  # [1] times its frequency that a law makes of a wave, at most
PARTS = 8  # [1] equal parts of a record in most of which a line is, or it is the trace of a few events
STEADY = 0.5  # [1] of its amplitude in the whole record that it has there at least


@dataclass(frozen=True)
class Oscillation:
    """An oscillation of `frequency` [Hz] in the output `output`; its amplitude (SI) by the names of the pieces.

    `recorded` are inputs that oscillate with it in their records, but by so little that it was taken for their noise.
    """

    output: str
    frequency: float
    amplitudes: dict[str, float]
    recorded: tuple[str, ...] = ()

    @property
    def largest(self) -> tuple[str, float]:
        """The piece in which it is largest, and its amplitude there (SI)."""
        name = max(self.amplitudes, key=lambda n: self.amplitudes[n])
        return name, self.amplitudes[name]


def oscillations(found: Discovery) -> list[Oscillation]:
    """The significant oscillations in the residual of the named model."""
    study, named = found.study, found.named
    if not any(noise.lines for noise in study.noise.values()):
        return []
    answers = study.response(named.ids, study.pieces).outputs(named.fitted.values)
    left: dict[str, list[Record]] = {}
    driven: dict[tuple[str, str], np.ndarray] = {}
    for piece, answer in zip(study.pieces, answers, strict=True):
        residual = piece.record - with_nuisances(study, piece, answer)
        for reading, part in zip(piece.case.readings, piece.case.parts, strict=True):
            left.setdefault(reading.output, []).append((piece.name, reading.times, residual[part]))
            driven[reading.output, piece.name] = answer[part]
    told: list[Oscillation] = []
    for output, records in left.items():
        noise = study.noise[output]
        for line in noise.lines:
            near = LINE_NEAR / max(noise.pace, 1.0)
            fine = _finest(line, records, near)
            if any(w.output == output and abs(w.frequency - fine) < near for w in told):
                continue
            amplitudes = {name: abs(_wave(fine, times, residual)) for name, times, residual in records}
            errors = {
                name: noise.slow_at(usual_step(times)) * np.sqrt(WINDOW / times.size) for name, times, _ in records
            }
            follows = {name: abs(_wave(fine, times, driven[output, name])) for name, times, _ in records}
            told_in = {n for n, e in errors.items() if amplitudes[n] > max(LINE_TOLD * e, follows[n])}
            seen = [r for r in records if r[0] in told_in and _by_itself(study, fine, amplitudes[r[0]], r)]
            if any(_steady(fine, times, residual) for _, times, residual in seen):
                told.append(Oscillation(output, fine, amplitudes, _recorded(found, fine, [name for name, *_ in seen])))
    return told


def _recorded(found: Discovery, frequency: float, names: Sequence[str]) -> tuple[str, ...]:
    """The inputs whose records oscillate too, in all of the pieces with these names, beyond what drives the model."""
    experiments = {e.name: e for e in found.recordings.experiments}
    there = [(p, experiments[p.source]) for p in found.study.pieces if p.name in names and p.source in experiments]

    def oscillates(name: str, piece: Piece, experiment: Experiment) -> bool:
        inside = (experiment.time >= piece.case.protocol.time[0]) & (experiment.time <= piece.case.protocol.time[-1])
        times = experiment.time[inside]
        lost = experiment.inputs[name][inside] - piece.case.protocol.at(times)[name]
        return abs(_wave(frequency, times, lost)) > LINE_TOLD * float(np.std(lost)) * np.sqrt(WINDOW / times.size)

    inputs = [s.name for s in found.study.plant.inputs]
    return tuple(n for n in inputs if there and all(oscillates(n, p, e) for p, e in there))


def _by_itself(study: Study, frequency: float, amplitude: float, record: Record) -> bool:
    """Whether a wave is more than a part of what the model misses, and no overtone of what an input does, which a
    plant's own laws make (friction)."""
    name, times, residual = record
    if 0.5 * amplitude**2 < OWN_SHARE * float(np.var(residual)):
        return False
    inputs = next(p for p in study.pieces if p.name == name).case.protocol.at(times)
    return not any(_overtone(frequency, times, inputs[s.name]) for s in study.plant.inputs)


def _overtone(frequency: float, times: np.ndarray, values: np.ndarray) -> bool:
    """Whether a frequency is a multiple of that of an input which is mostly one wave."""
    grid = np.fft.rfftfreq(times.size, usual_step(times))[1:]
    spectrum = np.abs(np.fft.rfft((values - values.mean()) * np.hanning(times.size)))[1:]
    ground = float(grid[int(np.argmax(spectrum))])
    times_as_high = round(frequency / ground)
    mostly = 0.5 * abs(_wave(ground, times, values)) ** 2 > MOSTLY_ONE * float(np.var(values))
    return mostly and 2 <= times_as_high <= OVERTONES and abs(frequency / times_as_high - ground) < grid[0]


def _finest(line: float, records: list[Record], near: float) -> float:
    """The frequency with the largest amplitude in the records, each with its own phase, no farther than `near` [Hz]
    from a line."""
    grid = line + np.linspace(-near, near, LINE_PLACES)
    power = [sum(times.size * abs(_wave(f, times, residual)) ** 2 for _, times, residual in records) for f in grid]
    return float(grid[int(np.argmax(power))])


def _steady(frequency: float, times: np.ndarray, values: np.ndarray) -> bool:
    """Whether a wave is in most parts of a record, not only where something has just happened."""
    parts = zip(np.array_split(times, PARTS), np.array_split(values, PARTS), strict=True)
    usual = float(np.median([abs(_wave(frequency, t, v)) for t, v in parts]))
    return usual >= STEADY * abs(_wave(frequency, times, values))


def _wave(frequency: float, times: np.ndarray, values: np.ndarray) -> complex:
    """The complex amplitude of a wave in some values, their mean taken out; their ends count least (Hann), as what a
    model misses slowly would otherwise look like a wave of any frequency."""
    turns, weight = np.exp(-2j * np.pi * frequency * (times - times[0])), np.hanning(times.size)
    return complex(2 * np.sum(weight * turns * (values - np.average(values, weights=weight))) / weight.sum())
