"""What the noise of the monitors adds to the doubt about parameters.

The lines that `drive` draws through a continuous monitor (`monitors.polyline`) are off by what its noise moved their
corners. That drives the model as well, slowly, and so it passes for a change of parameters. The corners are a linear
fit to the monitor's samples, so their covariance is known; through the model's static gain and the normal equations
of the fit it becomes one of the parameters: 3 to 20 % more uncertain ones on a bench. Not counted are the levels of
held inputs and the choice of the corners' places.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.linalg import solveh_banded

from ..protocol import Protocol
from .drive import Drive
from .fit import Fit
from .problem import Problem
from .response import Case, Response

STEP = 4e-3  # of an input's largest value: shift at which its gain is taken
CHUNK = 200  # corners at a time, so that a monitor with one at every sample fits into memory


def with_monitors(problem: Problem, best: Fit, drives: Sequence[Drive]) -> Fit:
    """The fit with the covariance and standard errors that it has beside noisy monitors; `drives` are its cases'."""
    weights = [np.ones(r.size) for r in problem.records] if problem.weights is None else problem.weights
    solver = best.covariance @ best.jacobian.T  # makes parameters of whitened, weighted residuals
    ends = np.cumsum([r.size for r in problem.records])
    solved = np.split(solver, ends, axis=1)
    covariance = solved.pop() @ best.jacobian[ends[-1] :] @ best.covariance  # the prior's
    solved = [part * weight for part, weight in zip(solved, weights, strict=True)]
    covariance += sum(part @ part.T for part in solved)  # the sensor's, whose variance is less than what weights allow
    for name in sorted({n for d in drives for n in d.corners if d.noise[n] > 0}):
        gains = _gains(problem, best.values, name)
        for i, driven in enumerate(drives):
            covariance += _added(problem, i, solved[i], gains[i], driven, name)
    return best.with_covariance(covariance)


def _gains(problem: Problem, values: Mapping[str, float], name: str) -> list[np.ndarray]:
    """How the answer of every case moves with a constant added to an input, each (n,), in SI units."""
    response = problem.response
    step = STEP * max(float(np.abs(c.protocol.inputs[name]).max()) for c in response.cases)
    moved = [
        Case(Protocol(c.protocol.time, c.protocol.inputs | {name: c.protocol.inputs[name] + step}), c.times)
        for c in response.cases
    ]
    shifted = Response(response.kernel, moved, response.measured, response.fixed).outputs(values)
    return [(a - b) / step for a, b in zip(shifted, response.outputs(values), strict=True)]


def _added(problem: Problem, number: int, solved: np.ndarray, gain: np.ndarray, driven: Drive, name: str) -> np.ndarray:
    """The covariance (k, k) that a monitor of one case adds; `solved` (k, n) makes parameters of white residuals."""
    corners, times = driven.corners[name], problem.response.cases[number].times
    place = np.clip(np.searchsorted(corners, times, side="right") - 1, 0, corners.size - 2)
    part = (times - corners[place]) / np.diff(corners)[place]
    moved = np.empty((solved.shape[0], corners.size))
    for begin in range(0, corners.size, CHUNK):
        wanted = np.arange(begin, min(begin + CHUNK, corners.size))
        columns = (place[:, None] == wanted) * (1 - part)[:, None] + (place[:, None] + 1 == wanted) * part[:, None]
        moved[:, wanted] = solved @ problem.noise.whiten(times, columns * gain[:, None])
    diagonal = np.bincount(place, (1 - part) ** 2, corners.size) + np.bincount(place + 1, part**2, corners.size)
    beside = np.append(0.0, np.bincount(place, part * (1 - part), corners.size)[:-1])
    known = solveh_banded(np.stack([beside, diagonal + 1e-9 * diagonal.max()]), moved.T)
    return driven.noise[name] ** 2 * moved @ known
