"""Uncertainty of parameters beside effects whose law is not known to be the tube's."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from tubular_dea.discover import judgement
from tubular_dea.discover.options import acceptance
from tubular_dea.discover.options.acceptance import EARNS
from tubular_dea.discover.search.law_uncertainty import still_there, with_law, with_rivals
from tubular_dea.identify.fitting.fit import Fit, described
from tubular_dea.identify.fitting.problem import Free
from tubular_dea.kernel import KernelError
from tubular_dea.plants.effects import catalogue

TIMES = np.linspace(0, 10, 2000)
NOISE = 1.0
STUDY = SimpleNamespace(catalogue=catalogue())
FREE = [Free("stiffness", 1.0), Free("eps_field", 0.2)]  # a parameter of the tube, and an effect of the catalogue
VOLTAGE = np.interp(TIMES, [0, 5, 10], [0, 5e3, 0])


class Line:
    """readings = stiffness ramp + eps_field effect: a problem as `Problem` is one, whose truth is known."""

    ramp = TIMES / 10
    effect = 400 * (VOLTAGE / 5e3) ** 2
    free = FREE

    def __init__(self, record: np.ndarray) -> None:
        case = SimpleNamespace(times=TIMES, protocol=SimpleNamespace(at=lambda t: {"voltage": VOLTAGE}))
        self.record = record
        self.response = SimpleNamespace(cases=[case], outputs=self.outputs, sensitivities=self.sensitivities)

    def outputs(self, values: dict[str, float]) -> list[np.ndarray]:
        return [values["stiffness"] * self.ramp + values["eps_field"] * self.effect]

    def sensitivities(self, values: dict[str, float], names: list[str]) -> tuple[list[np.ndarray], list[np.ndarray]]:
        slopes = {"stiffness": self.ramp, "eps_field": self.effect}
        return self.outputs(values), [np.column_stack([slopes[n] for n in names])]

    def values(self, scaled: np.ndarray) -> dict[str, float]:
        return {f.name: f.to_si(float(s)) for f, s in zip(FREE, scaled, strict=True)} | {"eps_saturation": 1.0}

    def linearised(self, scaled: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        residual = (self.outputs(self.values(scaled))[0] - self.record) / NOISE
        return residual, np.column_stack([self.ramp, 0.2 * self.effect]) / NOISE

    def whiten(self, columns: list[np.ndarray]) -> np.ndarray:
        return np.concatenate(columns) / NOISE


def fitted(record: np.ndarray) -> tuple[Line, Fit]:
    problem = Line(record)
    residual, jacobian = problem.linearised(np.zeros(2))
    return problem, described(problem, -np.linalg.lstsq(jacobian, residual, rcond=None)[0])


@pytest.mark.parametrize("reach", [0.05, 0.005])
def test_a_law_without_which_the_tube_is_beyond_its_fold_is_uncertain_too(reach: float) -> None:
    """A tube that a tenth less of an effect sends beyond its fold has no answer there: with a tenth more it has, or
    with neither."""
    problem, best = fitted(Line.ramp + 0.3 * Line.effect + np.random.default_rng(2).normal(0, NOISE, TIMES.size))
    usual = with_law(STUDY, problem, ("field_dependent_permittivity",), best)
    whole, there = problem.outputs, best.values
    assert usual.stderr["eps_field"] > 1.05 * best.stderr["eps_field"]

    def beyond(values: dict[str, float]) -> list[np.ndarray]:
        if not -reach < values["eps_field"] / there["eps_field"] - 1 < (0.5 if reach > 0.01 else reach):
            raise KernelError("the pressure is beyond the fold")
        return whole(values)

    problem.response.outputs = beyond
    found = with_law(STUDY, problem, ("field_dependent_permittivity",), best)
    np.testing.assert_allclose(found.covariance, usual.covariance, rtol=1e-6)


def test_another_law_is_within_the_uncertainty() -> None:
    random = np.random.default_rng(1)
    outside, errors = 0, []
    for _ in range(40):
        law = 1 + 0.05 * np.sin(random.uniform(0, 2 * np.pi) + VOLTAGE / 5e3 * random.uniform(1, 3))
        record = 20 * Line.ramp + 0.2 * Line.effect * law + random.standard_normal(TIMES.size)
        problem, best = fitted(record)
        wider = with_law(STUDY, problem, ("field_dependent_permittivity",), best)
        outside += abs(best.values["stiffness"] - 20) > 2 * best.stderr["stiffness"]
        errors.append((best.values["stiffness"] - 20) / wider.stderr["stiffness"])
        assert wider.values == best.values
    assert outside > 20
    assert np.mean(np.abs(errors) < 2) >= 0.9
    assert 0.7 < np.std(errors) < 1.2  # nor are intervals wider than they have to be


def test_an_exact_effect_has_no_other_law() -> None:
    problem, best = fitted(20 * Line.ramp + 0.2 * Line.effect)
    assert with_law(STUDY, problem, ("pressure_offset",), best) is best


def test_the_law_itself_leaves_little_uncertainty() -> None:
    random = np.random.default_rng(2)
    problem, best = fitted(20 * Line.ramp + 0.2 * Line.effect + random.standard_normal(TIMES.size))
    wider = with_law(STUDY, problem, ("field_dependent_permittivity",), best)
    assert best.stderr["stiffness"] < wider.stderr["stiffness"] < 10 * best.stderr["stiffness"]


def test_equals_count_with_their_spread() -> None:
    _, best = fitted(20 * Line.ramp + 0.2 * Line.effect)
    _, other = fitted(23 * Line.ramp + 0.2 * Line.effect)
    assert with_rivals(best, []) is best
    both = with_rivals(best, [other])
    assert both.stderr["stiffness"] == pytest.approx(np.hypot(best.stderr["stiffness"], 3), rel=1e-6)
    assert both.stderr["eps_field"] == pytest.approx(best.stderr["eps_field"], rel=1e-3)


LAG = SimpleNamespace(hard=(), off={"lag": 0.0}, fit=("lag",), parameters=[SimpleNamespace(name="lag", minimum=None)])


def of_a_lag(covariance: np.ndarray) -> Fit:
    """A fit of a base and of a lag of -0.035."""
    values, free = np.array([1.0, -0.035]), [Free("base", 1.0), Free("lag", 1.0)]
    told = dict(zip(("base", "lag"), values.tolist(), strict=True))
    stderr = dict(zip(told, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    return Fit(told, values, 0.0, np.empty(0), np.empty((0, 2)), covariance, free, stderr, True)


@dataclass(frozen=True)
class Chosen:
    """An option with a lag."""

    fitted: Fit
    ids: tuple[str, ...] = ("lag",)


@pytest.mark.parametrize("gain", [80.0, 1e4])
def test_far_from_the_plant_a_size_that_gains_much_is_there(gain: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A drive that is never negative: the centre of its saturation and the range made up for each other, to +-1000 V,
    though the law explained nearly all. What it gains is weighed against the misfit."""
    problem = SimpleNamespace(records=[])
    study = SimpleNamespace(catalogue={"lag": LAG}, plant=None, training=[], problem=lambda *of: problem)
    wide = lambda fitted, sizes, least: fitted.with_covariance(fitted.covariance * least)  # noqa: E731
    monkeypatch.setattr(judgement, "with_coarse_residuals", wide)
    monkeypatch.setattr(judgement.acceptance, "far", lambda option: True)
    monkeypatch.setattr(judgement.residuals, "slow_variance", lambda fitted, pieces: 9.0)
    monkeypatch.setattr(judgement, "ordered_fit", lambda plant, problem, fitted: fitted)
    one = Chosen(of_a_lag(np.diag([1e-6, 7.0**2])))
    told = judgement._described(study, one, [], {"lag": gain}).fitted
    there = gain / 9 > EARNS
    assert told.stderr["lag"] == pytest.approx(0.035 / EARNS**0.5 if there else 21.0)
    assert acceptance.bounded_away(LAG, told) == there
    assert told.stderr["base"] == pytest.approx(3e-3)


def test_another_law_makes_no_effect_vanish() -> None:
    """A size of 44 standard errors stays off zero however much another form of its law would change it."""
    study, narrow = SimpleNamespace(catalogue={"lag": LAG}), of_a_lag(np.diag([1e-6, 0.0008**2]))
    wide = narrow.with_covariance(np.diag([4e-6, 0.0208**2]))
    kept = still_there(study, ("lag",), narrow, wide, {})
    assert kept.stderr["lag"] == pytest.approx(-kept.values["lag"] / EARNS**0.5)  # off is as unlikely as chance allows
    assert kept.stderr["base"] == wide.stderr["base"]
    faint = narrow.with_covariance(np.diag([1e-6, 0.0208**2]))
    assert still_there(study, ("lag",), faint, wide, {"lag": 10.0}).stderr["lag"] == wide.stderr["lag"]
    profile = still_there(study, ("lag",), faint, wide, {"lag": 100.0})  # ten standard deviations by the likelihood
    assert profile.stderr["lag"] == pytest.approx(kept.stderr["lag"])
