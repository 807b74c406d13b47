"""Bounded least squares from several starts, and the covariance of the parameters at the optimum."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.linalg
from scipy.optimize import OptimizeResult, least_squares

from ...errors import UserError
from ...kernel import KernelError
from ...model.declare import Model
from ..threads import one_blas_thread
from .problem import Free, Problem

# Set by theory: 95 %. Check: `pytest tests/test_intervals.py`
NORMAL_95 = 1.96  # [standard deviations] to both sides of a normal number that hold it

# Set by judgement. Check: `pytest tests/test_identify.py::test_joint_fit_finds_the_tube_and_its_intervals_hold`
PRECISION = 1e-5  # [1] relative change of cost or parameters at which a search ends, less than chance changes them
LEVEL_GROUND = 1e-8  # [1] scaled gradient at which it ends too
EVALUATIONS = 60  # [evaluations] after which it ends
AGREE = 2.0  # [squared standard deviations] by which the costs of converged searches may differ
LOST = 0.1  # [1] of an optimum's cost by which another one may cost more and yet turn out to be the better
ELSEWHERE = 1.0  # [standard deviations] of a parameter between optima that are two
UNMOVED = 0.1  # [standard deviations] of every parameter between fits that are one
AROUND = 0.15  # [1] distance of further starts, in the solver's numbers

# Set by judgement: far less than any interval, far more than the searches' precision. Check:
# `pytest tests/test_acceptance.py tests/test_identify.py -k bound`
AT_BOUND = 1e-3  # [1] of the solver's numbers: nearer to a bound a search has ended there,
CLEAR_OF_IT = 10.0  # [1] times its standard error that a value is off a bound at least, to be at none however near

# Set by theory: a little above what rounding leaves of 1. Check:
# `pytest tests/test_identify.py::test_what_is_not_determined_is_named`
LEAST_EIGENVALUE = 1e-13  # [1] of a scaled information: directions with less have no information
LEAST_DIAGONAL = 1e-200  # [1] information that a parameter's scale is taken from at least

# Set by convention. Check: `pytest tests/test_identify.py::test_what_is_not_determined_is_named`
UNDETERMINED = 0.5  # [1] standard error, of a value or its usual size, above which the data do not determine it


class FitError(UserError, RuntimeError):
    """No start led to parameters at which the model answers; the text says what to change."""


@dataclass(frozen=True)
class Fit:
    """An optimum: parameters in SI units, minus twice the log likelihood `cost` (but for constants), covariance.

    `jacobian` (N, k) and `residual` (N,) are whitened and at the optimum; `covariance` (k, k) is in scaled numbers.
    """

    values: dict[str, float]
    scaled: np.ndarray
    cost: float
    residual: np.ndarray
    jacobian: np.ndarray
    covariance: np.ndarray
    free: list[Free]
    stderr: dict[str, float]
    converged: bool

    @property
    def names(self) -> list[str]:
        """The fitted parameters, in the order of the Jacobian's columns."""
        return [f.name for f in self.free]

    def with_covariance(self, covariance: np.ndarray) -> Fit:
        """The fit with another covariance (k, k) and the standard errors that go with it."""
        scale = np.sqrt(np.diag(covariance) / np.diag(self.covariance))
        stderr = {n: self.stderr[n] * float(s) for n, s in zip(self.names, scale, strict=True)}
        return replace(self, covariance=covariance, stderr=stderr)

    def undetermined(self) -> list[str]:
        """The parameters that the recordings do not determine; of one that may be 0, its usual size counts, too."""
        sizes = {f.name: max(abs(self.values[f.name]), 0.0 if f.logarithmic else f.size) for f in self.free}
        return [n for n in self.names if self.stderr[n] > UNDETERMINED * sizes[n]]

    def at_bounds(self) -> dict[str, int]:
        """The parameters that ended at a bound: -1 at the least value, 1 at the largest."""
        return {
            free.name: side
            for free, scaled in zip(self.free, self.scaled, strict=True)
            for side, bound, end in zip((-1, 1), free.bounds(), (free.lower, free.upper), strict=True)
            if abs(scaled - bound) < AT_BOUND and not self._clear_of(free.name, end)
        }

    def _clear_of(self, name: str, end: float | None) -> bool:
        """Whether a parameter is known to be off an end of its range."""
        return end is not None and abs(self.values[name] - end) > CLEAR_OF_IT * self.stderr[name]


@one_blas_thread
def uncertainty(best: Fit, model: Model) -> dict[str, list[Any]]:
    """`names` and covariance `matrix` (SI units) of the model's parameters that the record determines."""
    names, vague = list(model.parameter_values()), best.undetermined()
    kept = [i for i, f in enumerate(best.free) if f.name in names and f.name not in vague]
    slopes = np.array([best.free[i].slope(best.values[best.free[i].name]) for i in kept])
    matrix = best.covariance[np.ix_(kept, kept)] * np.outer(slopes, slopes)
    return {"names": [best.free[i].name for i in kept], "matrix": matrix.tolist()}


def fit(
    problem: Problem,
    start: Mapping[str, float],
    starts: int = 1,
    spread: float = AROUND,
    seed: int = 0,
    evaluations: int = EVALUATIONS,
    move: float = 0.0,
    precision: float = PRECISION,
    most_steps: float = np.inf,
) -> Fit:
    """The best of `starts` searches: from `start` (moved by `move`) and from points around it (about `spread`), where
    the integrator takes no more than `most_steps`."""
    random = np.random.default_rng(seed)
    first = problem.scaled(start)
    found = []
    for number in range(starts):
        moved = begun_at_bounds(problem, first + (spread if number else move) * random.standard_normal(first.size))
        solution = search(problem, moved, evaluations, precision, most_steps)
        if solution is not None:
            found.append(solution)
    if not found:
        raise FitError(
            "the model cannot be solved at the starting values: expected parameters under which it can follow the "
            f"recorded inputs{_why(problem, start)}; choose others, and declare a plant that runs away by itself with "
            "what holds it, and roots and logarithms of what may be negative with what keeps them real (root)"
        )
    best = min(found, key=lambda s: s.cost)
    return described(problem, best.x, bool(best.status > 0), (best.fun, best.jac))


def _why(problem: Problem, start: Mapping[str, float]) -> str:
    """Why a model has no answer at some values, in brackets; "" where it has."""
    try:
        problem.response.outputs(problem.values(problem.scaled(start)))
    except KernelError as problem_there:
        return f" ({problem_there})"
    return ""


def search(
    problem: Problem, start: np.ndarray, evaluations: int, precision: float = PRECISION, most_steps: float = np.inf
) -> OptimizeResult | None:
    """scipy's bounded least squares; None where the model cannot be solved at the start in `most_steps`.

    Where there is an answer but no sensitivities, it ends at the best point that has them.
    """
    first = problem.residuals(start, most_steps)
    if not np.all(np.isfinite(first)):
        return None
    most = problem.most_steps()
    last: OptimizeResult | None = None

    def jacobian(x: np.ndarray) -> np.ndarray:
        nonlocal last
        residual, slopes = problem.linearised(x)
        last = OptimizeResult(x=x.copy(), fun=residual, jac=slopes, cost=0.5 * float(residual @ residual), status=0)
        return slopes

    try:
        with np.errstate(over="ignore"):  # an infinite cost is that of a step to be refused
            return least_squares(
                lambda x: first if np.array_equal(x, start) else problem.residuals(x, most),
                start,
                jac=jacobian,
                bounds=problem.bounds(),
                method="trf",
                x_scale="jac",
                ftol=precision,
                xtol=PRECISION,
                gtol=LEVEL_GROUND,
                max_nfev=evaluations,
            )
    except KernelError:
        return last


def begun_at_bounds(problem: Problem, start: np.ndarray) -> np.ndarray:
    """The start (k,) of a search: off the bounds, and at one where it is nearly there. Else the first step would end at
    the bound, and be so short that the search ends too."""
    low, high = problem.bounds()
    start = np.where(start - low < AT_BOUND, low, np.where(high - start < AT_BOUND, high, start))
    return problem.inside(start)


def may_be_better(other: Fit, fitted: Fit) -> bool:
    """Whether another optimum of the same problem is the better one or may turn out to be.

    It may cost more as long as the records' own numbers are those that belong to the first.
    """
    if other.cost < fitted.cost - AGREE:
        return True
    return AGREE < other.cost - fitted.cost < LOST * fitted.cost and apart(other, fitted) > ELSEWHERE


def apart(one: Fit, other: Fit) -> float:
    """The largest distance of a parameter in two fits of the same problem, in standard deviations of the second."""
    return float(np.max(np.abs(one.scaled - other.scaled) / np.sqrt(np.diag(other.covariance)), initial=0.0))


def described(
    problem: Problem, scaled: np.ndarray, converged: bool = True, known: tuple[np.ndarray, np.ndarray] | None = None
) -> Fit:
    """The fit that ends at `scaled` (k,), with its covariance; `known` are residual and Jacobian there."""
    residual, jacobian = problem.linearised(scaled) if known is None else known
    covariance = inverse(jacobian.T @ jacobian)
    values = problem.values(scaled)
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0))
    stderr = {f.name: float(f.slope(values[f.name]) * d) for f, d in zip(problem.free, deviation, strict=True)}
    return Fit(
        values,
        scaled,
        float(residual @ residual),
        residual,
        jacobian,
        covariance,
        list(problem.free),
        stderr,
        converged,
    )


def inverse(information: np.ndarray) -> np.ndarray:
    """The inverse of a symmetric matrix by its own scales; directions without information get a huge variance."""
    scale = np.sqrt(np.maximum(np.diag(information), LEAST_DIAGONAL))
    value, vector = scipy.linalg.eigh(information / np.outer(scale, scale))
    inverted = (vector / np.maximum(value, LEAST_EIGENVALUE)) @ vector.T
    return inverted / np.outer(scale, scale)


def goodness(record: Sequence[np.ndarray], output: Sequence[np.ndarray]) -> float:
    """The paper's goodness of fit [%], over all samples: 100 (1 - |y - yhat| / |y - mean(y)|); NaN at standstill."""
    y, yhat = np.concatenate(list(record)), np.concatenate(list(output))
    if np.ptp(y) == 0:
        return float("nan")
    return float(100 * (1 - np.linalg.norm(y - yhat) / np.linalg.norm(y - y.mean())))


def rmse(record: Sequence[np.ndarray], output: Sequence[np.ndarray]) -> float:
    """Root mean square error over all samples, in the output's unit."""
    return float(np.sqrt(np.mean((np.concatenate(list(record)) - np.concatenate(list(output))) ** 2)))
