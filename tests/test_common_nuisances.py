"""What files have in common beside the model counts in detection limits and intervals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shared_data import shared
from tubular_dea.discover.engine import discover
from tubular_dea.identify.fitting.fit import Fit, inverse
from tubular_dea.identify.fitting.marginal import Marginal, marginal
from tubular_dea.identify.fitting.problem import Free
from tubular_dea.identify.records.data import read_folder
from tubular_dea.identify.study.common_nuisances import CommonNuisances
from tubular_dea.plants.tube import PLANT


def test_whitening_is_undone_exactly() -> None:
    random = np.random.default_rng(1)
    windows = [(slice(3, 9), random.standard_normal(6), 2.0, 1.0), (slice(20, 22), random.standard_normal(2), 0.3, 1.0)]
    made = marginal(windows, random.standard_normal((40, 3)), np.array([5.0, 0.0, 0.7]))
    columns = random.standard_normal((40, 4))
    assert not np.allclose(made.apply(columns), columns)
    np.testing.assert_allclose(made.undone(made.apply(columns)), columns, atol=1e-12)
    np.testing.assert_allclose(made.undone(made.apply(columns[:, 0])), columns[:, 0], atol=1e-12)


def fitted(jacobian: np.ndarray) -> Fit:
    covariance = inverse(jacobian.T @ jacobian)
    free = [Free(f"p{i}", 1.0) for i in range(jacobian.shape[1])]
    deviations = dict(zip([f.name for f in free], np.sqrt(np.diag(covariance)), strict=True))
    values = dict.fromkeys(deviations, 1.0)
    return Fit(values, np.ones(len(free)), 0.0, np.zeros(len(jacobian)), jacobian, covariance, free, deviations, True)


@pytest.mark.parametrize("alike", [0.0, 0.9, 1.0])
def test_a_parameter_is_known_no_better_than_what_does_the_same(alike: float) -> None:
    """A delay of the sensor beside filters that make monitors late: of 0.7 ms it was given as 1.88 +- 0.1 ms."""
    random = np.random.default_rng(2)
    own, other = np.linalg.qr(random.standard_normal((50, 2)))[0].T
    jacobian = np.concatenate([10 * own[:, None], np.zeros((1, 1))])  # the last row is the prior's
    common = CommonNuisances(
        (Marginal(),), (Marginal(),), (50,), (alike * own + np.sqrt(1 - alike**2) * other)[:, None]
    )
    best = fitted(jacobian)
    told = 1 + 0.5 * alike**2 / (1 - 0.5 * alike**2)  # a column with a prior of its own size takes half of what it can
    wider = common.widened(best, replace(best, covariance=2 * best.covariance))
    assert best.covariance[0, 0] == pytest.approx(0.01)
    assert wider.covariance[0, 0] == pytest.approx(0.01 * (1 + told))


def test_what_a_common_zero_would_move_a_parameter_by_is_uncertain() -> None:
    """Zeros of three files were 17 um alike: C_1 to C_3 made up for them, 3 to 6 standard deviations from the truth."""
    random = np.random.default_rng(3)
    own, other = np.linalg.qr(random.standard_normal((50, 2)))[0].T
    jacobian = np.concatenate([10 * own[:, None], np.zeros((1, 1))])
    zero = 5 * (0.8 * own + 0.6 * other)
    common = CommonNuisances((Marginal(),), (Marginal(),), (50,), zero[:, None])
    left = 20 * 0.6 * other  # what a zero of 4 usual ones leaves, once the parameter has taken what it can
    best = replace(fitted(jacobian), residual=np.append(left, 0.0))
    moved = -10 * 0.8 * 5 / 100 * 20 * 0.6 * 0.6 * 5 / (1 + 25 * 0.36)  # by normal equations of both, by hand
    wider, alone = (common.widened(b, b).covariance[0, 0] for b in (best, fitted(jacobian)))
    assert wider - alone == pytest.approx(moved**2)


@pytest.mark.long
def test_a_lag_shorter_than_the_rise_of_an_amplifier_is_not_seen() -> None:
    """lab-6: the amplifier rises in 1.5 ms and edges fall between samples. 0.1 ms of lag was said to be seen there."""
    found = discover(read_folder(shared("lab/lab-6"), PLANT))
    assert not found.chosen.ids
    (lag,) = found.limits["electrode_resistance"].values()
    (guess,) = (g.size for g in found.search.rounds[0].guessed if g.effect.id == "electrode_resistance")
    assert lag > 1.5 * guess
    assert 3e-4 < lag < 3e-3
