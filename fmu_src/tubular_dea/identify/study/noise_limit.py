"""What a model's residual says of the noise: an upper bound (`noise_bound`), and hum of the mains.

Where quiet stretches are shorter than some turns of the mains, no hum is found in them, but it is in the residual:
nothing that drives a plant has lines there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..fitting.compiled import Ids
from ..fitting.fit import Fit
from ..signals import hum as hums
from ..signals.colour_estimate import freedom
from ..signals.noise import ENOUGH_FREEDOM, Noise, estimate, of_residual, rounded, usual_resolution
from ..signals.noise_bound import TOO_MUCH, limited
from ..signals.quiet import LEAST_STRETCH, Records, Stretches, calm, stretches
from ..signals.repeats import Repeated, unrepeated
from ..signals.sampling import SAME_STEP, usual_step
from .nuisances import with_nuisances
from .study import Study, happenings

# Set by judgement: far below any noise, far above the integrator's error.
# Check: `pytest tests/test_unquiet.py -k stands_still`
STANDS_STILL = 1e-4  # [1] of its span that a model's answer moves at most within the shortest stretch


def with_noise_of(study: Study, fitted: Fit, ids: Ids = ()) -> Study:
    """The study with the noise of every output limited to what the residual of a fit allows, and with its hum.

    `ids` are the effects that the model has.
    """
    outputs = study.response(ids, study.training).outputs(fitted.values)
    answers = [with_nuisances(study, p, y) for p, y in zip(study.training, outputs, strict=True)]
    noise = dict(study.noise)
    for name in study.noise:
        read = [
            (reading, piece.record[part], answer[part], happenings(piece.driven))
            for piece, answer in zip(study.training, answers, strict=True)
            for reading, part in zip(piece.case.readings, piece.case.parts, strict=True)
            if reading.output == name
        ]
        rests = [(r.times, r.evened(values - there), events) for r, values, there, events in read]
        known = replace(study.noise[name], hum=_hum(study.noise[name], [(t, rest) for t, rest, _ in rests]))
        more = len(known.hum) > len(study.noise[name].hum)  # hum that was taken for noise
        if more:
            rests = [(t, _without(list(known.hum), t, rest), events) for t, rest, events in rests]
            step = usual_resolution([(r.times, values, events) for r, values, _, events in read])
            known = _without_hum(known, rests, study.plant.bandwidth, step)
        left = [rest for _, rest, _ in rests]
        if not known.quiet or known.by_residual:
            known = of_residual(known, _telling(study, name, rests, [there for _, _, there, _ in read], known.pace))
        noise[name] = limited(known, left, more)
    return replace(study, noise=noise)


def _without_hum(known: Noise, rests: Records, bandwidth: float, step: float) -> Noise:
    """Noise whose quiet stretches held hum, as they tell it of residuals from which this was taken, of a sensor that
    reads in steps; a level that was stated stays."""
    told = rounded(estimate(rests, bandwidth, known.pace), step)
    return replace(told, hum=known.hum) if told.quiet and not known.stated else known


def _telling(study: Study, output: str, rests: Records, answers: Sequence[np.ndarray], pace: float) -> list[Stretches]:
    """What is noise alone of the residuals of an output: what repetitions do not share, and where these are too few,
    what is left while the model's `answers` (each (n,)) stand still, though an input that does not move it then may.

    The pressure of a valve's supply jumps while its spool is at rest: no stretch of the records was quiet.
    """
    again = unrepeated(_repeated(study, output, [rest for _, rest, _ in rests]), pace)
    if freedom(again) >= ENOUGH_FREEDOM:
        return again
    moves = [np.abs(np.diff(there)) > STANDS_STILL * np.ptp(there) / LEAST_STRETCH for there in answers]
    still = [(t, rest, t[1:][moved]) for (t, rest, _), moved in zip(rests, moves, strict=True)]
    return calm(stretches(still, 0.0, pace=pace), usual_resolution(still))


def _repeated(study: Study, output: str, left: Sequence[np.ndarray]) -> list[Repeated]:
    """The residuals `left` (each (n,)) of an output, and when what repeats begins: when an input is switched on."""
    found = []
    read = [(p, r) for p in study.training for r in p.case.readings if r.output == output]
    for (piece, reading), values in zip(read, left, strict=True):
        edges = piece.driven.edges
        on = [e for e in edges if abs(e.high) > abs(e.low)]
        each = [np.array([e.time for e in on if e.input == name]) for name in dict.fromkeys(e.input for e in on)]
        begins = max(each, key=len, default=np.empty(0))
        found.append(Repeated(reading.times, values, begins, np.array([e.time for e in edges])))
    return found


def quieter(before: Study, after: Study) -> bool:
    """Whether the noise of an output is clearly less in `after`."""
    return any(n.innovation > TOO_MUCH * after.noise[name].innovation for name, n in before.noise.items())


def _hum(known: Noise, records: list[tuple[np.ndarray, np.ndarray]]) -> tuple[float, ...]:
    """The frequencies [Hz] of hum: those known, and those that stand out of records of (time, rest), each (n,).

    Where samples are too far apart to tell hum from what comes to lie there, nothing is added.
    """
    lines = list(known.hum)
    steps = {round(usual_step(t), SAME_STEP) for t, _ in records}
    for step in sorted(s for s in steps if s <= hums.SLOWLY_SAMPLED):
        group = [(t, rest) for t, rest in records if round(usual_step(t), SAME_STEP) == step]
        for _ in range(hums.MOST_HUM):
            line = hums.strongest(
                [(t, known.colour(step).whiten(_without(lines, t, rest))) for t, rest in group], step, known.pace
            )
            if line is None or not hums.is_hum(line, step):
                break
            lines.append(line)
    return tuple(sorted(lines))


def _without(lines: list[float], time: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """The rest (n,) less its waves at some frequencies [Hz] and its mean."""
    shapes = np.column_stack([np.ones(time.size), hums.waves(lines, time)])
    return rest - shapes @ np.linalg.lstsq(shapes, rest, rcond=None)[0]
