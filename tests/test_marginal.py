"""What a record has of its own, integrated out: what is left is white, whatever the nuisances were."""

from __future__ import annotations

import numpy as np
import pytest

from tubular_dea.identify.fitting.marginal import Marginal, marginal

N = 60
RANDOM = np.random.default_rng(4)
COLUMNS = [RANDOM.standard_normal(9), RANDOM.standard_normal(8), np.linspace(0, 1, 18)]
WINDOWS = [
    (where, column, sd, float(np.linalg.norm(column)))
    for where, column, sd in zip((slice(3, 12), slice(12, 20), slice(40, 58)), COLUMNS, (2.5, 0.3, 7.0), strict=True)
]
DENSE = np.column_stack([np.ones(N), np.sin(0.4 * np.arange(N)), np.arange(N) / N])
SPREADS = np.array([1.7, 0.2, 30.0])
NONE = np.empty((N, 0)), np.empty(0)


def covariance(windows: list, columns: np.ndarray, sd: np.ndarray) -> np.ndarray:
    """That of white noise and the nuisances, written down term by term."""
    found = np.eye(N)
    for where, column, deviation, _ in windows:
        placed = np.zeros(N)
        placed[where] = column
        found += deviation**2 * np.outer(placed, placed)
    for column, deviation in zip(columns.T, sd, strict=True):
        found += deviation**2 * np.outer(column, column)
    return found


@pytest.mark.parametrize(
    ("windows", "dense"),
    [(WINDOWS, NONE), ([], (DENSE, SPREADS)), (WINDOWS, (DENSE, SPREADS))],
    ids=["windows", "dense", "both"],
)
def test_what_is_left_is_white(windows: list, dense: tuple) -> None:
    made = marginal(windows, *dense)
    whitener = made.apply(np.eye(N))
    known = covariance(windows, *dense)
    assert np.abs(known - np.eye(N)).max() > 1  # there is something to whiten
    np.testing.assert_allclose(whitener @ known @ whitener.T, np.eye(N), atol=1e-9)


@pytest.mark.parametrize(("windows", "dense"), [(WINDOWS, NONE), ([], (DENSE, SPREADS)), (WINDOWS, (DENSE, SPREADS))])
def test_the_determinant_is_that_of_the_covariance(windows: list, dense: tuple) -> None:
    made = marginal(windows, *dense)
    assert made.log_determinant == pytest.approx(np.linalg.slogdet(covariance(windows, *dense))[1])


def test_the_determinant_does_not_depend_on_where_an_instant_was_found() -> None:
    steeper = [(where, 1.5 * column, sd, usual) for where, column, sd, usual in WINDOWS]
    assert marginal(steeper, *NONE).log_determinant == marginal(WINDOWS, *NONE).log_determinant


def test_a_vector_is_treated_as_a_column() -> None:
    made = marginal(WINDOWS, DENSE, SPREADS)
    values = RANDOM.standard_normal((N, 2))
    before = values.copy()
    together = made.apply(values)
    for i in range(2):
        np.testing.assert_allclose(made.apply(values[:, i]), together[:, i], atol=1e-12)
    np.testing.assert_array_equal(values, before)  # a new array


def test_nothing_to_integrate_changes_nothing() -> None:
    values = RANDOM.standard_normal(N)
    np.testing.assert_array_equal(Marginal().apply(values), values)
    np.testing.assert_array_equal(
        marginal([(slice(2, 9), np.ones(7), 0.0, 1.0)], DENSE, np.zeros(3)).apply(values), values
    )
    np.testing.assert_array_equal(marginal([(slice(5, 5), np.empty(0), 1.0, 1.0)], *NONE).apply(values), values)


def test_columns_that_repeat_each_other_add_up() -> None:
    """Two numbers that do the same are one with both variances; nothing is divided by zero."""
    twice = marginal([], np.column_stack([np.ones(N), np.ones(N)]), np.array([3.0, 4.0]))
    once = marginal([], np.ones((N, 1)), np.array([5.0]))
    values = RANDOM.standard_normal(N)
    np.testing.assert_allclose(twice.apply(values), once.apply(values), atol=1e-9)


def test_of_a_direction_without_variance_nothing_is_left() -> None:
    """A record along which only a nuisance moves loses its say there and keeps it across."""
    made = marginal([], np.ones((N, 1)), np.array([1e6]))
    across = RANDOM.standard_normal(N)
    across -= across.mean()
    np.testing.assert_allclose(made.apply(across + 5.0), across, atol=1e-5)


@pytest.mark.parametrize("size", [0.1, 0.5, 1.0, 2.0, 5.0])
def test_what_following_takes_away(size: float) -> None:
    """Against as many records with noise and an instant somewhere in its bounds, followed and whitened one by one."""
    count, where = 40_000, slice(3, 12)
    column = RANDOM.standard_normal(9)
    reach = size / np.linalg.norm(column)
    records = RANDOM.standard_normal((N, count))
    records[where] += np.outer(column, RANDOM.uniform(-reach, reach, count))
    best = np.clip(column @ records[where] / (column @ column), -reach, reach)
    records[where] -= np.outer(column, best)
    made = marginal([(where, column, reach, 1.0)], *NONE)
    taken = made.variance_removed(N)
    assert np.all(taken[:3] == 0) and np.all(taken[12:] == 0)
    left = np.mean(made.apply(records) ** 2, axis=1)
    np.testing.assert_allclose(left, 1 - taken, atol=5 * np.sqrt(2 / count))
    np.testing.assert_allclose(taken[where] / taken.sum(), column**2 / (column @ column))


def test_without_windows_nothing_is_followed() -> None:
    assert not Marginal().variance_removed(N).any()
    assert not marginal([], DENSE, SPREADS).variance_removed(N).any()


def test_columns_that_are_all_but_alike_and_of_any_size_are_integrated_out() -> None:
    """What a zero and a gain of the same monitor change may differ by a millionth, and one may be known far better."""
    slope = np.linspace(0, 1, N)
    columns = np.column_stack([slope, slope + 1e-6 * np.cos(np.arange(N)), np.ones(N)])
    sd = np.array([1e4, 1e4, 1e-5])
    whitener = marginal([], columns, sd).apply(np.eye(N))
    np.testing.assert_allclose(whitener @ covariance([], columns, sd) @ whitener.T, np.eye(N), atol=1e-6)
