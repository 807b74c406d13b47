"""Unused columns that the residual follows."""

from __future__ import annotations

import numpy as np
import pytest

from tubular_dea.discover.answer.follows import FOLLOWS_IT, Course, _behind, _columns, best_lag, share
from tubular_dea.recordings.table import Column, Table

RANDOM = np.random.default_rng(7)
TIME = np.arange(0.0, 60.0, 0.01)


def course(warmer: float, loaded: float, wave: float = 27.3) -> Course:
    """A residual with noise that follows a box's temperature, as it is and in proportion to the output."""
    box = 37 + np.sign(np.sin(2 * np.pi * TIME / wave)) + 0.1 * RANDOM.standard_normal(TIME.size)
    output = 1 + np.sin(2 * np.pi * TIME / 3.1)
    left = warmer * (box - 37) + loaded * (box - 37) * (output - 1) + RANDOM.standard_normal(TIME.size)
    return left, box, output


@pytest.mark.parametrize(("warmer", "loaded"), [(1.0, 0.0), (0.0, 1.5)], ids=["itself", "with the output"])
def test_a_column_that_the_residual_follows_is_told(warmer: float, loaded: float) -> None:
    assert share([course(warmer, loaded), course(warmer, loaded)]) > FOLLOWS_IT


def test_a_column_that_says_nothing_is_not() -> None:
    assert share([course(0.0, 0.0), course(0.0, 0.0)]) < 0.2
    one, other = course(1.0, 0.0), course(-1.0, 0.0)  # it acts otherwise in the other file
    assert share([one, other]) < 0.2


@pytest.mark.parametrize("lag", [0.0, 1.0])
def test_a_column_may_be_followed_slowly(lag: float) -> None:
    """A wall that is behind its box by `lag` [s], in files with samples every 10 ms."""
    courses = []
    for _ in range(2):
        left, box, output = course(0.0, 0.0, wave=6.0)
        courses.append((left + 3 * (_behind(box, lag / 0.01) - box.mean()), box, output))
    found = best_lag(courses, 0.01)
    assert found.part > FOLLOWS_IT
    assert found.lag == pytest.approx(lag, rel=0.5)
    assert found.part > share(courses) + 0.2 or not lag


def test_no_lag_makes_noise_follow() -> None:
    assert best_lag([course(0.0, 0.0), course(0.0, 0.0)], 0.01).part < 0.2


def test_counters_and_remarks_are_no_columns_to_follow(tmp_path) -> None:
    def column(heading: str, values: np.ndarray, problem: str = "") -> Column:
        return Column(heading, "", heading, np.asarray(values, float), 1, problem=problem)

    rows = np.arange(100)
    table = Table(
        tmp_path / "a.csv",
        (
            column("sample", rows),
            column("box", np.sin(rows)),
            column("note", np.full(100, np.nan), problem="text"),
            column("still", np.ones(100)),
        ),
        rows + 2,
        "",
    )
    assert [*_columns(table, ("sample", "box", "note", "still"), rows[10:50] + 2)] == ["box"]
