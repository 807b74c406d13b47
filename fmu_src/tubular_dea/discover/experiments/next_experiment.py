"""Design of the next experiment: the feasible protocol on which the competing models differ most.

The expected discrimination is half the squared distance between the models' outputs in units of the sensor's noise, as
far as neither parameters within their uncertainty nor zeros and delays of the new record would make up for it (Box and
Hill, Technometrics 9 (1967) 57). Nothing is proposed that tells less than one of the recordings does.
Feasible protocols are those of the plant (`Plant.experiments`), or steps and sweeps of every input within the recorded
range, on which the output stays near the range where it was recorded (a push to one side runs a slide into its end).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ...identify.fitting.cases import Case, Reading
from ...identify.fitting.marginal import beside_windows
from ...identify.fitting.problem import whitened
from ...identify.signals.sampling import usual_step
from ...identify.study.monitor_uncertainty import shifted
from ...identify.study.nuisances import TURN, USUAL_DELAY
from ...identify.study.study import Study
from ...identify.threads import side_by_side
from ...kernel import KernelError
from ...laws.places import Balance, Coefficient
from ...model.units import factor
from ...plants.plant import Plant
from ...protocol import Protocol
from ..options.options import Option

# Set by judgement. Check: `pytest tests/test_plants.py -k sweeps`
WITHIN = 0.85  # [1] of the largest inputs recorded
OTHERS = 0.5  # [1] of the way to their largest values: where the inputs stay that are not moved
BEYOND = 0.5  # [1] of an output's recorded range that a proposed experiment may leave it by
DIFFER = 3.0  # [standard deviations] of the noise by which models differ at least where an experiment tells them apart
SLOWEST_TURNS = 3.0  # [1] turns that a sweep would make in its time at its slowest frequency
FASTEST_TURN = 10.0  # [samples] of a turn at its fastest
STAIRS = (0.0, 0.3, 0.0, 0.6, 0.2, 1.0, 0.4, 0.8, 0.0, 0.5)  # [1] of the largest: the levels of a staircase


@dataclass(frozen=True)
class Proposal:
    """A protocol in words, and its discrimination between the two closest models (log likelihood)."""

    words: str
    discrimination: float

    @property
    def deviations(self) -> float:
        """The distance of the two closest models in standard deviations of the noise."""
        return float(np.sqrt(2 * self.discrimination))


def propose(study: Study, options: Sequence[Option]) -> Proposal | None:
    """The protocol that best discriminates the two closest of `options`; None where fewer than two are given, or none
    tells more than what was recorded."""
    if len(options) < 2:
        return None
    reading = study.pieces[0].case.readings[0]

    def proposal(named: tuple[str, Case]) -> Proposal | None:
        words, case = named
        try:
            told = _discrimination(study, options, case, study.plant.experiments is None)
        except KernelError:
            return None
        return None if told is None else Proposal(words, told)

    cases = [
        (words, Case(p, (Reading(reading.output, np.arange(p.time[0], p.time[-1], reading.clock.step)),)))
        for words, p in feasible(study).items()
    ]
    recorded = [(p.name, replace(p.case, readings=p.case.readings[:1])) for p in study.pieces]
    told = side_by_side(proposal, [*cases, *recorded])
    best = max((p for p in told[: len(cases)] if p), key=lambda p: p.discrimination, default=None)
    known = max((p.discrimination for p in told[len(cases) :] if p), default=0.0)
    return best if best is not None and best.discrimination > known else None


def _discrimination(study: Study, options: Sequence[Option], case: Case, bounded: bool) -> float | None:
    """What an experiment tells of the two closest models (log likelihood); None where one leaves what was recorded, if
    that is `bounded`."""
    answers, loose = [], []
    for one in options:
        free = one.fitted.free
        outputs, columns = study.asked(one.ids, [case]).sensitivities(one.fitted.values, [f.name for f in free])
        slopes = np.array([f.slope(one.fitted.values[f.name]) for f in free])
        answers.append(outputs[0])
        loose.append(columns[0] * slopes @ _root(one.fitted.covariance))
    if bounded and not _within(study, case.readings[0].output, answers):
        return None
    own = _own_numbers(study, options[0], case, answers[0])
    white = whitened(case, np.hstack([np.column_stack(answers), *loose, own]), study.noise)
    # Distances are the same in the few directions that these columns span.
    white = np.asarray(np.linalg.qr(white, mode="r"))
    sizes = [len(answers), *(columns.shape[1] for columns in loose), own.shape[1]]
    answer, *each, own = np.split(white, np.cumsum(sizes)[:-1], axis=1)
    told = []
    for i, j in combinations(range(len(options)), 2):
        beside = np.hstack([each[i], each[j], own])
        apart = answer[:, i] - answer[:, j]
        told.append(float(np.sum(beside_windows((), beside, np.ones(beside.shape[1])).apply(apart) ** 2)) / 2)
    return min(told)


def _root(covariance: np.ndarray) -> np.ndarray:
    """A matrix whose product with itself turned is the covariance (k, k)."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _own_numbers(study: Study, option: Option, case: Case, answer: np.ndarray) -> np.ndarray:
    """What zeros and delays of usual size change in a new record (N, columns)."""
    step = case.readings[0].clock.step
    by, usually = TURN * step, (USUAL_DELAY if study.filtered else TURN) * step
    zeros = [(*shifted(case, s.name), study.zero(s.name)) for s in study.plant.inputs if study.zero(s.name) > 0]
    delays = [replace(case, protocol=case.protocol.with_delay(s.name, -by)) for s in study.plant.inputs]
    moved = [*zeros, *((c, by, usually) for c in delays)]
    others = study.asked(option.ids, [c for c, _, _ in moved]).possible(option.fitted.values)
    columns = [(o - answer) / of * size for o, (_, of, size) in zip(others, moved, strict=True) if o is not None]
    return np.column_stack([np.full(answer.size, study.zero(case.readings[0].output)), *columns])


def at_channel(plant: Plant, channel: str) -> str:
    """What to do in a channel in which something acts that no effect explains, so that it can be followed."""
    place = next((p for p in plant.places if (p.channel or p.name) == channel), None)
    if isinstance(place, Coefficient):
        others = " and ".join(s.name for s in plant.inputs)
        if place.of in {s.name for s in plant.inputs}:
            return f"record steps of {place.of} of several heights, as {channel} may depend on more than {place.of}"
        if not place.of:
            return f"repeat one course of {others} around several levels, as what acts there may depend on more"
        if any(isinstance(p, Balance) and p.name == place.of and p.displacement for p in plant.places):  # a speed
            return f"repeat one course of {others} in several sizes, as {channel} may depend on more than {place.of}"
        return f"repeat one course of {others} at several levels of {place.of}, as {channel} may depend on more than it"
    if isinstance(place, Balance):
        itself = "" if place.name in _measured(plant) else f"{place.name} itself too, or "
        return f"repeat an experiment and measure {itself}what else acts on {'it' if itself else place.name}"
    where = "" if channel == "sensor" else f" in the {channel} channel"
    return f"repeat an experiment with a second sensor{where}"


def _measured(plant: Plant) -> set[str]:
    """The quantities that an output reads as they are."""
    read = {o.name for o in plant.outputs}
    return {str(d.expression) for d in plant.model.definitions if d.quantity.name in read}


def _within(study: Study, output: str, answers: Sequence[np.ndarray]) -> bool:
    """Whether an output stays about where it was recorded."""
    parts = [
        p.record[rows]
        for p in study.pieces
        for r, rows in zip(p.case.readings, p.case.parts, strict=True)
        if r.output == output
    ]
    low, high = min(float(part.min()) for part in parts), max(float(part.max()) for part in parts)
    room = BEYOND * (high - low)
    return all(bool(np.all((a > low - room) & (a < high + room))) for a in answers)


def kind(plant: Plant) -> str:
    """Which experiments are feasible, in words."""
    if plant.experiments is not None:
        return f"of those declared for the {plant.name}"
    if not plant.inputs:
        return "without an input"
    return f"of steps and sweeps of {' and '.join(s.name for s in plant.inputs)} within the recorded range"


def feasible(study: Study) -> dict[str, Protocol]:
    """Protocols within the recorded range, by their description."""
    protocols = [p.case.protocol for p in study.pieces]
    largest = study.plant.nominal_inputs(protocols)
    if study.plant.experiments is not None:
        return study.plant.experiments(largest)
    times = study.pieces[0].case.times
    step, span = usual_step(np.unique(times)), float(times.max() - times.min())
    least = {name: _least(np.concatenate([d.inputs[name] for d in protocols])) for name in largest}
    return sweeps(study.plant, largest, span, step, least)


def _least(values: np.ndarray) -> float:
    """The smallest value on the way to the largest: 0 where a record comes to it, as a stretch never does."""
    return 0.0 if values.min() <= 0 <= values.max() else float(values[np.argmin(np.abs(values))])


def sweeps(
    plant: Plant, largest: Mapping[str, float], span: float, step: float, least: Mapping[str, float] | None = None
) -> dict[str, Protocol]:
    """For every input in turn, steps of growing height and a sweep from its `least` value (default: 0), with the others
    half way to their largest values."""
    found = {}
    least = least or dict.fromkeys(largest, 0.0)
    for name, top in largest.items():
        q = plant.quantity(name)
        unit = q.display_unit or q.unit
        rise = WITHIN * (top - least[name])
        end = f"{(least[name] + rise) / factor(unit, q.unit):.3g} {unit}".removesuffix(" 1")
        others = {n: least[n] + OTHERS * (v - least[n]) for n, v in largest.items() if n != name}
        for words, wave in {
            f"steps of {name} up to {end}": _staircase(span),
            f"a sweep of {name} up to {end}": _chirp(span, step),
        }.items():
            grid, shape = wave
            inputs = {n: np.full(grid.size, v) for n, v in others.items()} | {name: least[name] + rise * shape}
            found[words] = Protocol(grid, inputs)
    return found


def _staircase(span: float) -> tuple[np.ndarray, np.ndarray]:
    """Steps to growing heights and back, each held for a tenth of the time."""
    levels = np.array(STAIRS)
    marks = np.linspace(0.0, span, levels.size + 1)
    return np.repeat(marks, 2)[1:-1], np.repeat(levels, 2)


def _chirp(span: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    """A wave between 0 and 1 whose period falls from a third of the time to ten samples."""
    time = np.arange(0.0, span, 2 * step)
    low, high = SLOWEST_TURNS / span, 1 / (FASTEST_TURN * step)
    phase = 2 * np.pi * low * span / np.log(high / low) * ((high / low) ** (time / span) - 1)
    return time, 0.5 - 0.5 * np.cos(phase)
