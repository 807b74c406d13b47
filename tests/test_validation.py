"""What fits predict of data that took no part in them, against Gaussian densities written down."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from made_up import BASE, option
from tubular_dea.discover.options.validation import predictive_deviance
from tubular_dea.identify.fitting.fit import Fit
from tubular_dea.identify.fitting.problem import Free

WIDTH = 3.0  # standard deviation of the prior of every parameter


def fitted(columns: np.ndarray, record: np.ndarray) -> Fit:
    """A linear model of a record with noise of 1, at the most likely parameters; the last rows are their prior."""
    count = columns.shape[1]
    jacobian = np.vstack([columns, np.eye(count) / WIDTH])
    target = np.append(record, np.zeros(count))
    theta = np.linalg.lstsq(jacobian, target, rcond=None)[0]
    residual = jacobian @ theta - target
    names = [f"p{i}" for i in range(count)]
    values = dict(zip(names, theta, strict=True))
    free, cost = [Free(n, 1.0) for n in names], float(residual @ residual)
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    return Fit(values, theta, cost, residual, jacobian, covariance, free, dict.fromkeys(names, 1.0), True)


@pytest.fixture
def experiments() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns (N, 2), record (N,) and experiment of each of 60 samples. The second column acts in the last alone."""
    random = np.random.default_rng(8)
    number = np.repeat([0, 1, 2], 20)
    columns = random.standard_normal((60, 2))
    columns[number < 2, 1] = 0.0
    return columns, columns @ [0.7, 2.0] + random.standard_normal(60), number


def densities(columns: np.ndarray, record: np.ndarray, number: np.ndarray) -> float:
    """Minus twice the logarithm of the density of every experiment given the others, a constant apart."""
    prior = WIDTH**2 * np.eye(columns.shape[1])

    def density(rows: np.ndarray) -> float:
        own = columns[rows]
        return float(multivariate_normal(cov=own @ prior @ own.T + np.eye(rows.sum())).logpdf(record[rows]))

    everything = density(number >= 0)
    return sum(
        -2 * (everything - density(number != k)) - (number == k).sum() * np.log(2 * np.pi) for k in np.unique(number)
    )


def test_what_is_predicted_are_the_densities_of_a_linear_model(
    experiments: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    columns, record, number = experiments
    fold = np.append(number, [-1] * columns.shape[1])
    assert predictive_deviance(fitted(columns, record), fold) == pytest.approx(densities(columns, record, number))


def test_an_effect_that_one_experiment_alone_shows_is_not_held_against_a_model(
    experiments: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    columns, record, number = experiments
    gained = [
        predictive_deviance(fitted(c, record), np.append(number, [-1] * c.shape[1])) for c in (columns[:, :1], columns)
    ]
    assert gained[1] < gained[0] - 10


def test_wider_priors_are_no_better_for_leaving_less() -> None:
    loose = option(excess=-50.0, held_out=1990.0, widths=(60.0, 20.0))
    tight = option()
    assert loose.squares < tight.squares
    assert loose.cost > tight.cost
    assert loose.held_out > tight.held_out
    assert loose.misfit > tight.misfit
    assert loose.evidence < tight.evidence
    assert BASE.misfit == BASE.squares
