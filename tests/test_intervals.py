"""Intervals of parameters: from the covariance where that tells, from the profile where it does not."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from tubular_dea.identify.fitting.fit import NORMAL_95, described, fit
from tubular_dea.identify.fitting.intervals import (
    interval,
    intervals,
    profile_interval,
    vanishing,
    with_coarse_residuals,
)
from tubular_dea.identify.fitting.problem import Free, Problem

X = np.linspace(0.0, 1.0, 200)


@dataclass
class MadeUp(Problem):
    """Residuals of `model(values)`, an array (n,), against `record`, with noise of 1."""

    model: object = None
    record: np.ndarray = field(default_factory=lambda: np.empty(0))

    def most_steps(self):
        return np.inf

    def residuals(self, scaled, most_steps=np.inf):
        return self.model(self.values(scaled)) - self.record

    def linearised(self, scaled, more=()):
        step = 1e-6
        here = self.residuals(scaled)
        columns = [(self.residuals(scaled + step * e) - here) / step for e in np.eye(scaled.size)]
        return here, np.column_stack(columns) if columns else np.empty((here.size, 0))


def made_up(model, record, free):
    return MadeUp(None, [record], {}, free, {}, model=model, record=record)


def line(v):
    return v["level"] + v["slope"] * X


FREE = [Free("level", 1.0), Free("slope", 1.0)]


def recorded(noise, seed=0):
    return line({"level": 2.0, "slope": 3.0}) + noise * np.random.default_rng(seed).standard_normal(X.size)


def test_a_linear_model_has_intervals_from_its_covariance():
    problem = made_up(line, recorded(1.0), FREE)
    best = fit(problem, {"level": 1.0, "slope": 1.0})
    covariance = np.linalg.inv(np.column_stack([np.ones_like(X), X]).T @ np.column_stack([np.ones_like(X), X]))
    for i, (name, (low, high)) in enumerate(intervals(problem, best).items()):
        assert high - low == pytest.approx(2 * NORMAL_95 * np.sqrt(covariance[i, i]), rel=1e-4)
        assert (low, high) == pytest.approx(interval(best, name))


def test_a_profile_of_a_linear_model_agrees_with_its_covariance():
    problem = made_up(line, recorded(1.0), FREE)
    best = fit(problem, {"level": 1.0, "slope": 1.0})
    for name in best.names:
        assert profile_interval(problem, best, name) == pytest.approx(interval(best, name), rel=0.02)


def test_a_stiffness_that_hardly_matters_may_be_nothing():
    """Only its square shows, with a standard error of 1 about 1.5: from nothing to sqrt(1.5 + 1.96)."""
    share = np.full(400, 0.05)  # of 1 together

    def model(v):
        return v["k"] ** 2 * share

    problem = made_up(model, 1.5 * share, [Free("k", 1.0, 1e-9, None, logarithmic=True)])
    problem, best = vanishing(problem, fit(problem, {"k": 0.5}))
    assert best.values["k"] == pytest.approx(np.sqrt(1.5), rel=1e-3)
    low, high = intervals(problem, best)["k"]
    assert low == pytest.approx(1e-9, abs=1e-6)
    assert high == pytest.approx(np.sqrt(1.5 + NORMAL_95), rel=0.03)


def test_what_ended_at_nothing_leaves_the_others_their_errors():
    """The logarithm of a parameter near zero has no standard error; the level beside it has its usual one."""

    def model(v):
        return v["level"] + v["k"] * X

    record = 2.0 + np.random.default_rng(3).standard_normal(X.size) - 0.5 * X
    free = [Free("level", 1.0), Free("k", 1.0, 1e-6, None, logarithmic=True)]
    problem, best = vanishing(*(p := made_up(model, record, free), fit(p, {"level": 1.0, "k": 0.01})))
    both = np.linalg.inv(np.column_stack([np.ones_like(X), X]).T @ np.column_stack([np.ones_like(X), X]))
    assert best.stderr["level"] == pytest.approx(np.sqrt(both[0, 0]), rel=0.05)
    low, high = intervals(problem, best)["k"]
    assert low == pytest.approx(1e-6, abs=1e-6)
    assert 0.05 < high < 0.6


def test_an_open_interval_ends_at_infinity():
    """What saturates is bounded on one side only."""

    def model(v):
        return 40 * np.ones(100) * v["k"] / (1 + v["k"])

    problem = made_up(model, 39.99 * np.ones(100), [Free("k", 1.0, 1e-9, None, logarithmic=True)])
    low, high = intervals(*vanishing(problem, described(problem, np.array([np.log(4000.0)]))))["k"]
    assert high == np.inf
    assert 100 < low < 4000


def test_residuals_in_steps_widen_intervals_and_white_ones_do_not():
    white = made_up(line, recorded(1.0), FREE)
    best = fit(white, {"level": 1.0, "slope": 1.0})
    ratio = with_coarse_residuals(best, [X.size]).stderr["level"] / best.stderr["level"]
    assert 1.0 <= ratio < 1.5
    steps = np.repeat(np.random.default_rng(1).standard_normal(25), 8)  # each lasts 8 samples
    coarse = made_up(line, recorded(0.0) + steps, FREE)
    best = fit(coarse, {"level": 1.0, "slope": 1.0})
    ratio = with_coarse_residuals(best, [X.size]).stderr["slope"] / best.stderr["slope"]
    assert 1.6 < ratio < 6.0
