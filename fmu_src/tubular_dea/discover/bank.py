"""The score bank: what each candidate would gain, from its sensitivity where it is off.

Every candidate is nested in the present model. Its columns (the response to its `off` parameters, at each point of its
shape grid) are made orthogonal to those of the present parameters; the gain is the part of the residual's sum of
squares that they explain. One simulation a column, so a hundred candidates cost a second.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from ..identify.fit import Fit
from ..identify.problem import Problem
from ..identify.response import FINE, Response
from ..identify.threads import side_by_side
from ..kernel import KernelError
from ..model.effects import Effect, catalogue
from .compiled import Ids
from .parameters import size, switched_off
from .study import Study

STEP = 0.02  # of the typical size: small against any curvature, large against the integrator's tolerance


@dataclass(frozen=True)
class Candidate:
    """An effect at a point of its shape grid: whitened `columns` (N, k), one for each of `names`."""

    effect: Effect
    shape: dict[str, float]
    names: tuple[str, ...]
    columns: np.ndarray


@dataclass(frozen=True)
class Score:
    """The gain of a candidate over the present model, and the amplitudes (SI, by name) at which it is reached."""

    candidate: Candidate
    gain: float
    amplitudes: dict[str, float]

    @property
    def id(self) -> str:
        """The effect's id."""
        return self.candidate.effect.id


def candidates(
    study: Study, fitted: Fit, present: Ids = (), effects: Iterable[Effect] | None = None
) -> list[Candidate]:
    """All candidates with their columns at the present optimum; those the model has no answer for are left out."""
    listed = [e for e in (catalogue().values() if effects is None else effects) if e.id not in present]
    everything = study.compiled.everything() if effects is None else None
    if everything is None:
        study.compiled.prepare(present, listed)
    problem = study.problem(present, [], fitted.values)
    rows = fitted.residual.size - sum(r.size for r in problem.records)  # of the prior
    at = _all_off() | dict(fitted.values) if everything else dict(fitted.values)
    cases = problem.response.cases

    def respond(effect: Effect) -> Response:
        kernel = everything or study.compiled.kernel(present, effect)
        return Response(kernel, cases, study.measured, study.geometry)

    base = respond(listed[0]).outputs(at | switched_off(listed[0]), FINE)
    points = [(e, dict(zip(e.shapes, p, strict=True))) for e in listed for p in itertools.product(*e.shapes.values())]
    found = side_by_side(lambda q: _candidate(respond(q[0]), problem, base, rows, at, *q), points)
    return [c for c in found if c is not None]


def _all_off() -> dict[str, float]:
    """Values at which every effect of the catalogue is off."""
    return {name: value for effect in catalogue().values() for name, value in switched_off(effect).items()}


def scores(listed: Iterable[Candidate], residual: np.ndarray, jacobian: np.ndarray) -> list[Score]:
    """The gain of every candidate, the largest first; `residual` (N,), `jacobian` (N, k) of the present model."""
    basis, _ = np.linalg.qr(jacobian)
    left = residual - basis @ (basis.T @ residual)
    found = [_score(c, c.columns - basis @ (basis.T @ c.columns), left) for c in listed]
    return sorted(found, key=lambda s: -s.gain)


def best_of_each(listed: Iterable[Score]) -> list[Score]:
    """The best shape of each effect, the largest gain first."""
    seen: dict[str, Score] = {}
    for score in listed:
        if score.id not in seen or score.gain > seen[score.id].gain:
            seen[score.id] = score
    return sorted(seen.values(), key=lambda s: -s.gain)


def _candidate(
    response: Response, problem: Problem, base: list[np.ndarray], rows: int, values: Mapping[str, float],
    effect: Effect, shape: dict[str, float],
) -> Candidate | None:  # fmt: skip
    off = dict(values) | switched_off(effect) | shape
    names = tuple(n for n in effect.off if n not in effect.refine)
    columns = []
    for name in names:
        step = STEP * (effect.typical[name] - effect.off[name] or size(effect, name))
        try:
            moved = response.outputs_alone(off | {name: effect.off[name] + step}, FINE)
        except KernelError:
            return None
        columns.append(problem.whiten([(a - b) / step for a, b in zip(moved, base, strict=True)]))
    return Candidate(effect, shape, names, np.pad(np.column_stack(columns), ((0, rows), (0, 0))))


def _score(candidate: Candidate, columns: np.ndarray, left: np.ndarray) -> Score:
    norms = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    if np.all(norms < 1e-3 * np.maximum(np.linalg.norm(candidate.columns, axis=0), 1e-3)):
        return Score(candidate, 0.0, dict.fromkeys(candidate.names, 0.0))  # the present parameters do the same
    amplitude, *_ = np.linalg.lstsq(columns / norms, -left, rcond=1e-6)
    if _beyond_bounds(candidate, amplitude):
        return Score(candidate, 0.0, dict(zip(candidate.names, amplitude / norms, strict=True)))
    explained = columns / norms @ amplitude
    return Score(candidate, float(explained @ explained), dict(zip(candidate.names, amplitude / norms, strict=True)))


def _beyond_bounds(candidate: Candidate, amplitude: np.ndarray) -> bool:
    """A single amplitude that would have to leave the bounds at which the effect is off (a negative lag, say)."""
    if amplitude.size > 1:
        return False
    name = candidate.names[0]
    quantity = next(q for q in candidate.effect.parameters if q.name == name)
    off = candidate.effect.off[name]
    return (quantity.minimum == off and amplitude[0] < 0) or (quantity.maximum == off and amplitude[0] > 0)
