"""The fitting procedure: in the plant's own stages, then all parameters jointly.

Stages fix what an experiment says little about from others, as laboratories do. The joint fit takes every experiment
and every parameter at once, from where the stages end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...errors import UserError
from ...kernel import KernelError
from ...model.declare import Model
from ...plants.plant import Plant
from ..fitting.fit import AGREE, UNMOVED, Fit, FitError, apart, fit, may_be_better
from ..fitting.problem import Free, Problem
from .adjust import MOST_SETTLES, SETTLES, adjusted
from .arrivals import delays_of_arrivals
from .monitor_uncertainty import with_monitor_noise
from .noise_limit import with_noise_of
from .study import Study, log_determinant

# Set by judgement. Check: `pytest tests/test_identify.py::test_table_2_leads_to_the_answer`
ENOUGH_FIT = 4.0  # [1] times the samples: a misfit below needs no other start
STAGE_EVALUATIONS = 40  # [evaluations] of a stage
JOINT_STARTS = 3  # [1] starts of the joint fit
NEAR_START = 0.1  # [1] distance of the joint fit's further starts, in the solver's numbers
SAMPLES_EACH = 10  # [samples] that every parameter needs at least

Progress = Callable[[str], None]


def free_parameters(model: Model, start: Mapping[str, float], names: Sequence[str] | None = None) -> list[Free]:
    """The tunable parameters of a model (or those of `names`), sized by their starting values."""
    searched = [p.quantity for p in model.parameters if p.tunable or p.start == "shared"]
    listed = [q for q in searched if names is None or q.name in names]
    unknown = sorted(set(names or ()) - {q.name for q in listed})
    if unknown:
        raise UserError(
            f"{model.name} has no tunable parameter {unknown[0]!r}; expected some of "
            f"{', '.join(p.quantity.name for p in model.parameters if p.tunable)}"
        )
    return [
        Free(
            q.name,
            abs(start[q.name]) or abs(q.nominal) or 1.0,
            q.minimum,
            q.maximum,
            q.minimum is not None and q.minimum > 0,
            start[q.name],
        )
        for q in listed
    ]


def staged(work: Study, start: Mapping[str, float], tell: Progress = lambda what: None) -> dict[str, float]:
    """The plant's stages in turn, from `start`; returns all parameters (SI)."""
    plant, values = work.plant, dict(start)
    drives = [p.case.protocol for p in work.training]
    for stage in plant.stages:
        tell(stage.words)
        values = dict(stage.prepare(values))
        chosen = [work.training[i] for i in stage.select(drives)]
        free = free_parameters(plant.model, values, stage.names)
        values = _from_anywhere(work.problem((), free, values, chosen), values, plant)
    return plant.ordered(values)


def ordered_fit(plant: Plant, problem: Problem, best: Fit) -> Fit:
    """The fit with exchangeable parameters in order; as it is where some of them are held."""
    come = plant.exchanged(best.values)
    if all(come[n] in best.names for n in best.names) and any(come[n] != n for n in best.names):
        values = dict(best.values) | {n: best.values[come[n]] for n in best.names}
        order = [best.names.index(come[n]) for n in best.names]
        stderr = {n: best.stderr[come[n]] for n in best.names}
        return replace(
            best,
            values=values,
            scaled=problem.scaled(values),
            stderr=stderr,
            jacobian=best.jacobian[:, order],
            covariance=best.covariance[np.ix_(order, order)],
        )
    return best


def joint(
    work: Study,
    start: Mapping[str, float],
    starts: int = JOINT_STARTS,
    seed: int = 0,
    names: Sequence[str] | None = None,
    usual: Mapping[str, float] | None = None,
) -> tuple[Problem, Fit]:
    """All parameters (or `names`) from all experiments at once, from several starts around `start`.

    Exchangeable parameters are ordered (`ordered_fit`); their uncertainty includes the monitors' noise
    (`with_monitor_noise`). `usual` are values whose sizes the parameters have, by default `start`.
    """
    problem = work.problem((), free_parameters(work.plant.model, usual or start, names), start)
    samples = sum(r.size for r in problem.records)
    if samples < SAMPLES_EACH * len(problem.free):
        raise UserError(
            f"{samples} samples are too few for {len(problem.free)} parameters; expected at least "
            f"{SAMPLES_EACH * len(problem.free)}: record longer, or free fewer parameters"
        )
    begun = {**start, **delays_of_arrivals(work, (), work.shared(start), problem.names)}
    best = ordered_fit(work.plant, problem, fit(problem, begun, starts, NEAR_START, seed))
    return problem, with_monitor_noise(problem, best, work.training, work.monitor_noise)


def alternating_fit(
    work: Study,
    start: Mapping[str, float],
    starts: int = JOINT_STARTS,
    seed: int = 0,
    names: Sequence[str] | None = None,
) -> tuple[Study, Problem, Fit]:
    """The joint fit and the records' own numbers (switching instants, zeros, starts), each taken anew at the other.

    Until neither gains; then once more with the records' own numbers first, where `start` has them, and the parameters
    that a fit may lose (`Plant.restart`) at their declared values: a fit with edges half a sample off may end where
    no edge brings it back from.
    """
    first = _taken_in_turn(work, joint(work, start, starts, seed, names), start, seed, names)
    fitted = first[2]
    begin = dict(start) | {n: v for n, v in work.plant.restarts.items() if n in fitted.names}
    try:
        again = adjusted(replace(work, noise=first[0].noise), (), begin, fitted.free)
        found = _taken_in_turn(again, joint(again, begin, 1, seed, names, start), start, seed, names, fitted)
    except (FitError, KernelError):
        return first
    better = _deviance(*found[::2]) <= _deviance(*first[::2]) - AGREE
    return _taken_in_turn(found[0], found[1:], start, seed, names) if better else first


def _taken_in_turn(
    work: Study,
    found: tuple[Problem, Fit],
    start: Mapping[str, float],
    seed: int,
    names: Sequence[str] | None,
    known: Fit | None = None,
) -> tuple[Study, Problem, Fit]:
    """A joint fit and the records' own numbers, in turn until the parameters change no more, or nothing is gained.

    Where the model lacks something, instants and zeros make up for it and go to and fro: the best turn counts. With a
    `known` fit only as long as this one may be the better, which a first joint fit, with edges half a sample off, does
    not show; and the noise stays as it is, so that costs can be compared: each turn may find less of it.
    """
    problem, best = found
    kept, least = (work, problem, best), np.inf
    for number in range(MOST_SETTLES):
        work = adjusted(work if known is not None else with_noise_of(work, best), (), best.values, best.free)
        before = best
        problem, best = joint(work, best.values, 1, seed, names, start)
        now = _deviance(work, best)
        gains = now < least + AGREE
        if gains:
            kept, least = (work, problem, best), min(now, least)
        settles = abs(before.cost - best.cost) < AGREE or apart(best, before) < UNMOVED
        if number + 1 >= SETTLES and (settles or not gains):
            break
        if known is not None and not may_be_better(best, known):
            break
    return kept


def _deviance(work: Study, best: Fit) -> float:
    """Minus twice the log likelihood, but for constants: fits with other own numbers and other noise compare by it."""
    noise = sum(
        2 * reading.times.size * np.log(work.noise[reading.output].innovation)
        for piece in work.training
        for reading in piece.case.readings
    )
    return float(best.cost + noise + log_determinant(work.training))


def _from_anywhere(problem: Problem, start: Mapping[str, float], plant: Plant) -> dict[str, float]:
    """From the start, or from safer values where the model cannot be solved there."""
    best: Fit | None = None
    for move in (dict, *plant.safer):
        moved = {n: v if n in problem.names else start[n] for n, v in move(start).items()}
        try:
            found = fit(problem, moved, 1, evaluations=STAGE_EVALUATIONS)
        except FitError:
            continue
        if best is None or found.cost < best.cost:
            best = found
        if best.converged and best.cost < ENOUGH_FIT * best.residual.size:
            break
    if best is None:
        raise FitError(
            f"{plant.name} cannot be solved at the starting values; expected parameters under which it can "
            "follow the recorded inputs: try others, and declare a plant that runs away by itself with what holds it"
        )
    return dict(start) | best.values
