"""The score bank: Rao's score statistic of each candidate, from its sensitivity where it is off.

Every candidate is nested in the present model. Its columns (the response to its `off` parameters, at each point of its
shape grid) are made orthogonal to those of the present parameters; the statistic is the part of the residual's sum of
squares that they explain (Rao, Proc. Camb. Phil. Soc. 44 (1948) 50). One simulation a column, so a hundred candidates
cost a second.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...identify.fitting.compiled import DELAYED, Ids
from ...identify.fitting.fit import Fit
from ...identify.fitting.problem import Problem
from ...identify.fitting.response import FINER, Response
from ...identify.study.study import Study
from ...identify.threads import side_by_side
from ...kernel import Kernel, KernelError
from ...model.effect import Effect
from .levels import Passed, passed
from .parameters import all_off, size, switched_off

# Set by judgement: small against any curvature, large against the integrator's tolerance.
# Check: `pytest tests/test_discover.py::test_scores_point_to_the_refit`
SCORE_STEP = 0.02  # [1] of an amplitude's typical size: the step of its difference quotient

# Set by measurement: a stop at a stretch of 1.242, where the tube comes to 1.239, scored less than four other effects
# with levels 0.05 apart. Check: `pytest tests/test_discover.py -k levels`
NEAR_ENDS = (0.05, 0.1, 0.9, 0.95)  # [1] shares of what a state passes, at which levels are tried

# Set by judgement. Check: `pytest tests/test_acceptance.py::test_what_would_have_been_seen_is_as_large_as_it_takes`
HIDDEN = 1e-3  # [1] share of a column that must be left for it to be anything but the present parameters
NO_COLUMN = 1e-3  # [standard deviations] length of a column below which it is taken to be as long
DEPENDENT = 1e-6  # [1] of the largest singular value: amplitudes in directions below are left at nothing

Point = tuple[dict[str, float], dict[str, float]]  # shape and strength, by parameter (SI)


@dataclass(frozen=True)
class Candidate:
    """An effect at a point of its shape grid: whitened `columns` (N, k), one for each of `names`."""

    effect: Effect
    shape: dict[str, float]
    names: tuple[str, ...]
    columns: np.ndarray


@dataclass(frozen=True)
class Score:
    """The score statistic of a candidate added to the present model: its gain if the model were linear, and the
    amplitudes (SI, by name) at which that is reached."""

    candidate: Candidate
    statistic: float
    amplitudes: dict[str, float]

    @property
    def id(self) -> str:
        """The effect's id."""
        return self.candidate.effect.id


def candidates(
    study: Study, fitted: Fit, present: Ids = (), effects: Iterable[Effect] | None = None
) -> list[Candidate]:
    """All candidates with their columns at the present optimum, without those for which the model cannot be solved."""
    return candidates_at(study, fitted.values, fitted.residual.size, present, effects)


def candidates_at(
    study: Study,
    values: Mapping[str, float],
    rows: int,
    present: Ids = (),
    effects: Iterable[Effect] | None = None,
    points: Callable[[Effect], list[Point]] | None = None,
) -> list[Candidate]:
    """The same at any parameters; `rows` counts the rows of the residual, including those of the prior.

    `points` are those of an effect's shapes and strengths at which columns are taken (default: `every_point`, with
    levels where the present model passes them).
    """
    listed = [e for e in (study.catalogue.values() if effects is None else effects) if e.id not in present]
    problem = study.problem(present, [], values)
    rows -= sum(r.size for r in problem.records)  # of the prior
    known = {e.id: e for e in (*study.catalogue.values(), *listed)}
    kernels = study.compiled.scorers(present, None if effects is None else listed)
    distinct = {id(kernel): kernel for kernel in kernels.values()}
    baseline = dict(
        zip(distinct, side_by_side(lambda k: _baseline(k, problem, values, known), distinct.values()), strict=True)
    )
    points = points or partial(every_point, ranges=passed(study, present, values, listed), interval=_interval(study))
    asked = [(baseline[id(kernels[e.id])], e, *point) for e in listed for point in points(e)]
    found = side_by_side(lambda one: _candidate(problem, rows, *one), asked)
    return [c for c in found if c is not None]


@dataclass(frozen=True)
class _Baseline:
    """The outputs of a model with many effects at `values` (SI), where all but the present effects are off."""

    response: Response
    values: dict[str, float]
    outputs: list[np.ndarray]


def _baseline(
    kernel: Kernel, problem: Problem, values: Mapping[str, float], effects: Mapping[str, Effect]
) -> _Baseline:
    response = problem.response.by(kernel)
    off = all_off(kernel.model.effects, effects) | dict(values)
    return _Baseline(response, off, response.outputs_alone(off, FINER))


def scores(listed: Iterable[Candidate], residual: np.ndarray, jacobian: np.ndarray) -> list[Score]:
    """The score of every candidate, the largest first; `residual` (N,), `jacobian` (N, k) of the present model."""
    basis, _ = np.linalg.qr(jacobian)
    left = residual - basis @ (basis.T @ residual)
    found = [_score(c, c.columns - basis @ (basis.T @ c.columns), left) for c in listed]
    return sorted(found, key=lambda s: -s.statistic)


def best_of_each(listed: Iterable[Score]) -> list[Score]:
    """The best shape of each effect, the largest score first."""
    seen: dict[str, Score] = {}
    for score in listed:
        if score.id not in seen or score.statistic > seen[score.id].statistic:
            seen[score.id] = score
    return sorted(seen.values(), key=lambda s: -s.statistic)


def _candidate(
    problem: Problem,
    rows: int,
    baseline: _Baseline,
    effect: Effect,
    shape: dict[str, float],
    strength: Mapping[str, float],
) -> Candidate | None:
    """The columns of an effect: secants over `strength` where it names an amplitude, else derivatives."""
    off = baseline.values | switched_off(effect) | shape
    names = tuple(n for n in effect.off if n not in effect.refine)
    columns = []
    for name in names:
        step = strength.get(name) or SCORE_STEP * (effect.typical[name] - effect.off[name] or size(effect, name))
        try:
            moved = baseline.response.outputs_alone(off | {name: effect.off[name] + step}, FINER)
        except KernelError:
            return None
        columns.append(problem.whiten([(a - b) / step for a, b in zip(moved, baseline.outputs, strict=True)]))
    return Candidate(effect, shape, names, np.pad(np.column_stack(columns), ((0, rows), (0, 0))))


def is_late(study: Study, effect: Effect) -> bool:
    """Whether an effect is a delay beside an output that jumps with a held input: however short, it changes the sample
    behind an edge as one of a whole interval does."""
    jumps = any(s.held and s.direct for s in study.plant.inputs)
    return jumps and bool(effect.strengths) and study.compiled.kinds.get(effect.id) == DELAYED


def _interval(study: Study) -> Callable[[Effect], float | None]:
    """The longest sampling interval [s] for delays of what jumps; None for other effects."""
    longest = max(reading.clock.step for p in study.training for reading in p.case.readings)
    return lambda effect: longest if is_late(study, effect) else None


def every_point(
    effect: Effect, ranges: Passed, interval: Callable[[Effect], float | None] = lambda effect: None
) -> list[Point]:
    """The whole shape grid; at each point {} for the derivative, and every strength at which a secant is taken.

    A level is tried near the ends of what its state passes too, and not beyond `ranges`; a delay of what jumps, with
    one sampling `interval` too.
    """
    strengths = [{}, *({name: value} for name, values in effect.strengths.items() for value in values)]
    if step := interval(effect):
        strengths += [
            {n: side * step} for n, values in effect.strengths.items() for side in set(np.sign(values).tolist())
        ]
    grid = itertools.product(*(_values(effect, name, ranges) for name in effect.shapes))
    return [(dict(zip(effect.shapes, shape, strict=True)), strength) for shape in grid for strength in strengths]


def _values(effect: Effect, name: str, ranges: Passed) -> list[float]:
    """The grid of a shape."""
    listed = list(effect.shapes[name])
    if effect.levels.get(name) not in ranges:
        return listed
    low, high = ranges[effect.levels[name]]
    return [*(v for v in listed if low < v < high), *(low + share * (high - low) for share in NEAR_ENDS)]


def middle_point(effect: Effect) -> list[Point]:
    """The middle of the shape grid, for the derivative alone: where what an effect changes is seen."""
    return [({name: values[len(values) // 2] for name, values in effect.shapes.items()}, {})]


def _score(candidate: Candidate, columns: np.ndarray, left: np.ndarray) -> Score:
    norms, seen = np.linalg.norm(columns, axis=0), visible(candidate, columns)
    if not seen.any():
        return Score(candidate, 0.0, dict.fromkeys(candidate.names, 0.0))  # the present parameters do the same
    amplitude = np.zeros(norms.size)
    found, *_ = np.linalg.lstsq(columns[:, seen] / norms[seen], -left, rcond=DEPENDENT)
    amplitude[seen] = found / norms[seen]
    amplitude = _inside_bounds(candidate, amplitude)
    explained = columns @ amplitude
    statistic = float(-2 * (left @ explained) - explained @ explained)
    return Score(candidate, max(statistic, 0.0), dict(zip(candidate.names, map(float, amplitude), strict=True)))


def visible(candidate: Candidate, columns: np.ndarray) -> np.ndarray:
    """Which of a candidate's columns, of which `columns` (N, k) are left, the present parameters cannot stand for."""
    whole = np.linalg.norm(candidate.columns, axis=0)
    left: np.ndarray = np.linalg.norm(columns, axis=0) >= HIDDEN * np.maximum(whole, NO_COLUMN)
    return left


def _inside_bounds(candidate: Candidate, amplitude: np.ndarray) -> np.ndarray:
    """A single amplitude, clipped to the bounds of its parameter: no negative lag, no offset of the whole range."""
    if amplitude.size > 1:
        return amplitude
    name = candidate.names[0]
    quantity = next(q for q in candidate.effect.parameters if q.name == name)
    low = -np.inf if quantity.minimum is None else quantity.minimum - candidate.effect.off[name]
    high = np.inf if quantity.maximum is None else quantity.maximum - candidate.effect.off[name]
    return np.clip(amplitude, low, high)
