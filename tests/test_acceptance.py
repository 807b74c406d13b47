"""When an effect is accepted, equal to another, and which verdict follows: on made-up numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import make_lsq_spline

from made_up import BASE, LARGE, SAMPLES, found, option
from tubular_dea.discover import engine, judgement
from tubular_dea.discover.options import acceptance, residuals
from tubular_dea.discover.options.options import Option
from tubular_dea.discover.scores import held_out, parameters, power
from tubular_dea.discover.scores.bank import Candidate, scores
from tubular_dea.discover.scores.bootstrap import null_scores
from tubular_dea.discover.search import equivalence
from tubular_dea.identify.fitting import misfit
from tubular_dea.identify.fitting.fit import Fit
from tubular_dea.identify.fitting.intervals import interval
from tubular_dea.identify.fitting.problem import Free
from tubular_dea.identify.signals import noise_bound
from tubular_dea.identify.signals.colour import Colour
from tubular_dea.identify.signals.noise import Noise
from tubular_dea.plants.tube import PLANT


@pytest.mark.parametrize(
    ("excess", "z_slow", "verdict"),
    [
        (0.0, 0.0, "no_effect"),
        (300.0, 4.9, "no_effect"),
        (300.0, 5.1, "unexplained"),  # slow parts stand out
        (500.0, 0.0, "no_effect"),  # 3.5 standard deviations over all samples
        (600.0, 0.0, "unexplained"),  # 4.2
    ],
)
def test_verdict_without_any_effect(excess: float, z_slow: float, verdict: str) -> None:
    base = option(excess=excess, z_slow=z_slow)
    assert judgement.decide(found(base, base), 1.0, {}) == verdict


def test_what_weights_hide_is_a_remainder() -> None:
    """A supply that falls slowly was thermal softening and charge trapping, 18 um of error beside noise of 10 um."""
    lag = option("lag", excess=100.0, held_out=4000.0)
    assert judgement.decide(found(BASE, lag), 1.0, {"lag": []}) == "effect_found"
    assert judgement.decide(found(BASE, lag), 1.0, {"lag": []}, hidden=True) == "partly_explained"


@pytest.mark.parametrize(
    ("excess", "held_ratio", "verdict"),
    [
        (100.0, 1.0, "effect_found"),  # noise
        (100.0, 1.45, "effect_found"),  # noise in training; the held-out experiments were asked before
        (100.0, 1.55, "partly_explained"),  # but are not predicted
        (1800.0, 1.0, "effect_found"),  # 95.5 % explained, 1.086 times the noise
        (1800.0, 1.12, "partly_explained"),  # the same, but more on held-out data
        (2200.0, 1.0, "partly_explained"),  # 1.105 times the noise
        (19_000.0, 1.0, "partly_explained"),  # 52.5 %
        (21_000.0, 1.0, "partly_explained"),  # 47.5 %, but most of the held-out experiments
    ],
)
def test_verdict_by_what_an_effect_leaves(excess: float, held_ratio: float, verdict: str) -> None:
    chosen = option("lag", excess=excess, held_out=4000.0)
    assert judgement.decide(found(BASE, chosen), held_ratio, {"lag": []}) == verdict


def test_verdict_where_another_output_shows_what_the_model_does_not_have() -> None:
    clean, lag = option(), option("lag", excess=100.0)
    assert judgement.decide(found(clean, clean), 1.0, {}) == "no_effect"
    assert judgement.decide(found(clean, clean), 1.0, {}, missed=True) == "unexplained"
    drifts = option(excess=1000.0)  # to a zero that drifts within files, not to one that predicts others wrongly
    assert judgement.decide(found(drifts, drifts), 1.1, {}, wanders=True) == "no_effect"
    assert judgement.decide(found(drifts, drifts), 1.45, {}, wanders=True) == "unexplained"
    assert judgement.decide(found(BASE, lag), 1.0, {"lag": []}, missed=True) == "effect_found"


@pytest.mark.parametrize(("share", "verdict"), [(0.51, "partly_explained"), (0.49, "unexplained")])
def test_verdict_where_disturbances_of_the_fitted_experiments_are_larger(share: float, verdict: str) -> None:
    """A robot's shoulder: friction is 9 % of what its ripple leaves of fast motions, and most of a slow one."""
    missed = BASE.unseen_squares - BASE.unseen.size
    chosen = option("preload", excess=0.9 * LARGE, held_out=BASE.held_out - share * missed)
    assert judgement.decide(found(BASE, chosen), 9.0, {"preload": []}) == verdict


def test_verdict_where_nearly_all_of_a_very_large_effect_is_explained() -> None:
    base = option(excess=20 * LARGE, held_out=1e5)
    for excess, verdict in ((4300.0, "effect_found"), (4500.0, "partly_explained")):  # 1.196 and 1.204 times the noise
        assert judgement.decide(found(base, option("lag", excess=excess)), 1.0, {"lag": []}) == verdict


def test_verdict_where_little_is_left_but_of_little() -> None:
    chosen = option("lag", excess=1800.0, held_out=4000.0)  # 1.086 times the noise
    for excess, verdict in ((36_500.0, "effect_found"), (35_500.0, "partly_explained")):  # 95.1 and 94.9 % explained
        assert judgement.decide(found(option(excess=excess, held_out=12_000.0), chosen), 1.0, {"lag": []}) == verdict


@pytest.mark.parametrize(("base", "chosen", "strained"), [(1.0, 40.0, ("C_3",)), (40.0, 40.0, ()), (40.0, 1.0, ())])
def test_parameters_that_only_an_effect_makes_implausible_speak_against_it(
    base: float, chosen: float, strained: tuple[str, ...]
) -> None:
    """A kinked wall looked like a stop beside a C_3 of 40 times its value; a first guess is far off in both. Declared
    values that explain as much as refitted ones are no first guesses: a shape along the axis looked like stiffening."""
    assert judgement._strained(_declared(base, 2.5), _fitted(chosen)) == strained
    well = ("C_3",) if chosen == 40 else ()  # beside a base that the declared values explain as well
    assert judgement._strained(_declared(base, 1.1), _fitted(chosen)) == well


def _declared(times: float, leaves: float) -> SimpleNamespace:
    """A search from a base with C_3 at so many times its declared value, with which it `leaves` so many times more."""
    one = SimpleNamespace(residuals=lambda scaled: np.array([leaves]))
    study = SimpleNamespace(plant=PLANT, problem=lambda *_: one)
    return SimpleNamespace(study=study, base_study=study, base=_fitted(times))


def _fitted(times: float) -> SimpleNamespace:
    """An option with C_3 at so many times its declared value, known to 2 %."""
    free, value = Free("C_3", 2.86e3), times * PLANT.model.parameter_values()["C_3"]
    scaled, none = np.array([free.to_scaled(value)]), np.zeros((1, 1))
    one = Fit({"C_3": value}, scaled, 1.0, none[0], none, none + 4e-4, [free], {"C_3": 0.02 * value}, True)
    return SimpleNamespace(fitted=one)


def test_a_value_far_from_a_bound_in_its_own_uncertainty_is_at_none() -> None:
    """A compliance declared a thousand times too large was found at 260 times its least value, to 0.05 %, and "ended at
    the least value": the bound was a thousandth of the declared size away."""
    free = Free("C", 3e-11, 1e-16)
    at = {}
    for value, error in ((2.6e-14, 1.3e-17), (1.1e-16, 1.3e-17)):
        scaled, none = np.array([free.to_scaled(value)]), np.zeros((1, 1))
        at[value] = Fit({"C": value}, scaled, 1.0, none[0], none, none, [free], {"C": error}, True).at_bounds()
    assert at == {2.6e-14: {}, 1.1e-16: {"C": -1}}


def test_verdict_where_effects_cannot_be_told_apart() -> None:
    clean, partly = option("lag", excess=100.0), option("lag", excess=0.3 * LARGE)
    assert judgement.decide(found(BASE, clean), 1.0, {"lag": ["slew"]}) == "ambiguous"
    remains = judgement.decide(found(BASE, partly), 1.0, {"lag": ["slew"]})
    assert remains == "partly_explained"  # the remainder comes first


@pytest.mark.parametrize(
    ("unseen", "excess", "named"),
    [
        (0.749 * BASE.held_out, 0.49 * LARGE, True),
        (0.751 * BASE.held_out, 0.49 * LARGE, False),  # explains less than a quarter of what held-out data show
        (BASE.held_out + 50.0, 0.1 * LARGE, False),  # explains much, predicts nothing
        (BASE.held_out - 5000.0, 0.51 * LARGE, False),  # predicts, but leaves more than half
    ],
)
def test_a_name_is_earned_on_data_that_no_fit_has_seen(unseen: float, excess: float, named: bool) -> None:
    chosen = option("lag", excess=excess, held_out=unseen)
    assert acceptance.earned(BASE, chosen) is named
    assert judgement.decide(found(BASE, chosen), 9.0, {"lag": []}) == ("partly_explained" if named else "unexplained")


def test_effects_from_an_equilibrium_take_the_place_of_nothing_where_held_out_data_support_them() -> None:
    """A null with heartbeats whose start is unknown ended as "unexplained": mullins_softening, that nothing supported.

    Where no effect was found there has to be more than a fit; where one was, the numbers of the starts count too.
    """
    nothing, lag, worse = option(excess=100.0), option("lag", excess=60.0), option("set", excess=75.0)
    supported, denied = option("set"), option("set", held_out=12_000.0)
    assert engine._explains_more(found(nothing, nothing), found(BASE, supported), 20.0)
    assert not engine._explains_more(found(nothing, nothing), found(option(excess=LARGE), denied), 20.0)
    assert not engine._explains_more(found(nothing, nothing), found(BASE, BASE), 20.0)
    assert engine._explains_more(found(nothing, lag), found(BASE, worse), 20.0)
    assert not engine._explains_more(found(nothing, lag), found(BASE, worse), 10.0)


def test_a_name_is_not_earned_by_chance_on_held_out_data_that_show_little() -> None:
    base = option(excess=LARGE, held_out=12.0)
    assert acceptance.earned(base, option("lag", excess=0.1 * LARGE, held_out=5.9))
    assert not acceptance.earned(base, option("lag", excess=0.1 * LARGE, held_out=6.1))


def test_a_first_effect_is_accepted_for_its_gain_its_blocks_and_held_out_data() -> None:
    base = option(excess=500.0, held_out=2500.0)

    def told(excess: float, **more: float) -> tuple[bool, str]:
        return acceptance.accept(base, base, option("lag", excess=excess, turned=0.1, **more), 30.0)

    assert told(471.0, held_out=2500.0) == (False, "refitted, lag gains 29.0, less than chance can (30.0)")
    assert told(471.0, held_out=2493.0)[0]  # with what it predicts, 36 and as much as uncertainty asks for more
    assert not told(471.0, held_out=2494.0)[0]
    assert not told(483.0, held_out=2300.0)[0]  # which counts as much as the gain itself at most
    blocks = told(450.0, cross=base.cross_validated, held_out=2400.0)
    assert blocks == (False, "lag does not improve the prediction of blocks left out")
    one_block = {"cross": base.cross_validated + 1000.0}
    assert told(400.0, held_out=2490.0, **one_block)[0]  # strong, and predicted
    assert not told(400.0, held_out=2495.0, **one_block)[0]
    assert told(450.0, held_out=2501.0) == (False, "lag does not improve the prediction of the held-out experiments")
    assert told(450.0, held_out=2499.0)[0]
    assert told(411.0, held_out=2507.0)[0] is False
    assert told(410.0, held_out=2507.0)[0]  # strong: asked at the end
    accepted, why = told(100.0, held_out=2100.0)
    assert accepted and why == "lag gains 400.0, on blocks 400.0, held out 400.0"


@pytest.mark.parametrize(
    ("gain", "unseen", "turned", "across", "yes"),
    [
        (100.0, 2490.0, 0.1, 99e3, True),  # squared distance 25: held-out data can tell, and do
        (100.0, 2510.0, 0.1, 0.0, False),
        (100.0, 2410.0, 0.4, 99e3, True),  # 400: 0.61 of the fitted size, and
        (100.0, 2430.0, 0.4, 0.0, False),  # 0.59 of it, which is not what was fitted
        (100.0, 2510.0, 0.066, 0.0, False),  # squared distance 11: they still can
        (100.0, 2490.0, 0.06, 99e3, True),  # 9: they hardly can, but by odds of more than 20 to 1 they do
        (100.0, 2496.0, 0.06, 99e3, False),  # odds are less; experiments left out in turn are asked
        (100.0, 2496.0, 0.06, 0.0, True),
        (100.0, 2505.0, 0.06, 0.0, True),
        (100.0, 2507.0, 0.06, 0.0, False),  # odds of more than 20 to 1 against it
        (99.0, 2510.0, 0.06, 0.0, False),  # what gains little needs both
        (99.0, 2500.1, 0.01, 0.0, True),  # 0.25: held-out data cannot tell
        (100.0, float("nan"), 0.0, 0.0, False),  # no answer there
    ],
)
def test_unseen_data_are_those_that_can_tell(
    gain: float, unseen: float, turned: float, across: float, yes: bool
) -> None:
    before = option(excess=500.0, held_out=2500.0)
    after = option("lag", excess=500.0 - gain, held_out=unseen, turned=turned, across=across)
    assert acceptance.confirmed(before, after) is yes


@pytest.mark.parametrize(("value", "away"), [(1.21, True), (1.19, False), (0.81, False), (0.79, True)])
def test_an_interval_with_the_off_value_names_nothing(
    value: float, away: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The standard error is 0.1, and the effect is off at 1."""
    left = {(): 8.6, ("lag",): 1.0}  # over noise, where samples weigh alike
    monkeypatch.setattr(judgement, "_squares_left", lambda study, one: left[one.ids])
    lag = SimpleNamespace(
        hard=(), off={"lag": 1.0}, fit=("lag",), parameters=[SimpleNamespace(name="lag", minimum=None)]
    )
    fitted = replace(
        option("lag").fitted,
        values={"base": 1.0, "lag": value},
        scaled=np.array([1.0, value]),
        covariance=0.01 * np.eye(2),
    )
    assert acceptance.bounded_away(lag, fitted) is away
    study = SimpleNamespace(catalogue={"lag": lag}, plant=SimpleNamespace(places=[]), zero=lambda name: 0.0)
    described = replace(option("lag", excess=100.0, held_out=2000.0), fitted=fitted)
    assert judgement.supported(study, found(BASE, described), described) is away
    left["lag",] = 8.5
    assert judgement.supported(study, found(BASE, described), described) is away
    left["lag",] = 149.0  # a muscle's absorber was a resonance of the set point: 72 um without it, 297 um with it
    assert not judgement.supported(study, found(BASE, described), described)
    left["lag",] = 1.0
    denied = replace(described, unseen=1.1 * BASE.unseen)
    assert not judgement.supported(study, found(BASE, denied), denied)
    assert judgement.supported(study, found(BASE, BASE), BASE)  # nothing is named


def test_a_strength_at_its_bound_names_nothing() -> None:
    base = option(excess=500.0, held_out=2500.0)
    best = option("lag", excess=100.0, held_out=2100.0, turned=0.1)
    assert acceptance.accept(base, base, best, 30.0)[0]
    refused = acceptance.accept(base, base, replace(best, pinned=("lag",)), 30.0)
    assert refused == (False, "lag would need an implausible strength")
    refused = acceptance.accept(base, base, replace(best, unreached=("lag",)), 30.0)
    assert refused == (False, "lag would have a level that no record passes")
    other = option("creep", excess=100.0)
    assert equivalence.stands_in(other, best, {"lag": 400.0}) == ("lag", "creep")
    assert equivalence.stands_in(replace(other, pinned=("creep",)), best, {"lag": 400.0}) is None


@pytest.mark.parametrize(
    ("quantity", "value", "side", "ends"),
    [
        ({"minimum": 0.0, "maximum": 3.0}, 3.0, 1, (2.804, np.inf)),
        ({"minimum": 0.0, "maximum": 3.0}, 2.99, 0, (2.794, 3.0)),
        ({"minimum": 2.0, "maximum": 9.0}, 2.0, -1, (-np.inf, 2.196)),
        ({"minimum": 0.0, "maximum": 9.0}, 0.0, 0, (0.0, 0.196)),  # there is no less than nothing
        ({"minimum": 0.0, "maximum": 1.0, "unit": "1"}, 1.0, 0, (0.804, 1.0)),  # nor more than the whole
        ({"minimum": 0.0, "maximum": 1.0, "unit": "s"}, 1.0, 1, (0.804, np.inf)),
    ],
)
def test_an_interval_is_open_where_a_search_ended_at_a_bound(
    quantity: dict, value: float, side: int, ends: tuple[float, float]
) -> None:
    """The standard error is 0.1; the effect is off where its strength is 0."""
    given = SimpleNamespace(**{"name": "lag", "unit": "s"} | quantity)
    lag = SimpleNamespace(hard=(), off={}, fit=("lag",), parameters=[given])
    fitted = replace(
        option("lag").fitted,
        free=[Free("base", 1.0), Free("lag", 1.0, given.minimum, given.maximum)],
        values={"base": 1.0, "lag": value},
        scaled=np.array([1.0, value]),
        covariance=0.01 * np.eye(2),
    )
    assert parameters.at_bounds(lag, fitted) == ({"lag": side} if side else {})
    assert acceptance.size_interval(lag, fitted, "lag") == pytest.approx(ends)
    if side == 0 and value == 1.0:  # the same of a part by which the effect is told from nothing
        sized = SimpleNamespace(hard=(), off={"lag": 0.0}, fit=("lag",), parameters=[given])
        assert acceptance.size_interval(sized, fitted, "lag") == pytest.approx((np.exp(-0.196), 1.0))
    strength = SimpleNamespace(**vars(lag) | {"off": {"lag": value}})  # where it is off is where it may end
    assert parameters.at_bounds(strength, fitted) == {}
    wall = SimpleNamespace(**vars(lag) | {"hard": ("lag",)})  # as large as it likes
    assert parameters.at_bounds(wall, fitted) == ({"lag": side} if side < 0 else {})


@pytest.mark.parametrize(
    ("gain", "before", "after", "vague"),
    [(60.0, 11.0, 11.0, ["lag"]), (300.0, 11.0, 11.0, []), (60.0, 30.0, 11.0, []), (60.0, 4.0, 4.0, [])],
)
def test_a_weak_effect_that_leaves_a_residual_as_little_white_as_before_is_vague(
    monkeypatch: pytest.MonkeyPatch, gain: float, before: float, after: float, vague: list[str]
) -> None:
    """A pulsation of a pump, 29 Pa beside 60 Pa of noise, made one of six effects explain a little, by chance."""
    white = {(): before, ("lag",): after}
    monkeypatch.setattr(judgement.residuals, "tests", lambda study, ids, fitted: {"whiteness": white[ids]})
    monkeypatch.setattr(judgement, "_no_more_than_a_zero", lambda work, found, described, name: False)
    lag = SimpleNamespace(
        hard=(), off={"lag": 0.0}, fit=("lag",), parameters=[SimpleNamespace(name="lag", minimum=None)]
    )
    chosen = option("lag", excess=0.0, z_slow=0.0)
    chosen = replace(chosen, fitted=replace(chosen.fitted, scaled=np.ones(2), covariance=0.01 * np.eye(2)))
    study = SimpleNamespace(catalogue={"lag": lag})
    search = found(BASE, chosen, gains={"lag": gain}, rounds=[SimpleNamespace(threshold=35.0)])
    assert [*judgement._vague(study, search, chosen)] == vague


def test_an_effect_that_gains_little_is_vague() -> None:
    lag = SimpleNamespace(
        hard=(), off={"lag": 0.0}, fit=("lag",), parameters=[SimpleNamespace(name="lag", minimum=None)]
    )
    chosen = option("lag", excess=50.0)
    chosen = replace(chosen, fitted=replace(chosen.fitted, scaled=np.ones(2), covariance=0.01 * np.eye(2)))
    study = SimpleNamespace(catalogue={"lag": lag}, plant=SimpleNamespace(places=[]), zero=lambda name: 0.0)
    for gain, vague in ((10.7, ["lag"]), (10.9, [])):  # a normal number is 3.3 from its mean once in a thousand
        assert [*judgement._vague(study, found(BASE, chosen, gains={"lag": gain}), chosen)] == vague


def test_what_is_held_out_sees_what_may_be_missing_and_leaves_what_is_needed() -> None:
    def best(shares: list[list[float]], information: list[float]) -> int:
        information_ = held_out._Information(np.array(shares), np.array([[[i]] for i in information]))
        return max(range(3), key=lambda i: information_.worth([i]))

    assert best([[0.1, 0.3, 0.6], [0.0, 0.4, 0.6]], [100.0] * 3) == 1  # 0 sees too little, 2 leaves too little
    assert best([[1.0, 0.0, 0.0], [0.0, 0.3, 0.7], [0.0, 0.3, 0.7]], [100.0] * 3) == 1
    assert best([[0.3, 0.3, 0.4]] * 2, [1.0, 1000.0, 1000.0]) == 0  # the others determine the parameters
    assert best([[0.0, 0.3, 0.7]] * 2, [1.0, 1e6, 1.0]) != 1  # it alone determines them
    assert best([[0.2, 0.15, 0.25]] * 2, [100.0] * 3) == 0  # a fifth is enough, and more is missed
    for lost, chosen in ((0.45, 0), (0.55, 1)):  # a candidate is worth half a unit of a logarithm of a standard error
        gone = 1 - np.exp(-2 * lost)
        assert best([[0.2, 0.0, 0.8]], [1e6 * gone, 0.0, 1e6 * (1 - gone)]) == chosen


def test_a_further_effect_must_be_more_than_another_form_of_the_first() -> None:
    before = option("lag", excess=4000.0, held_out=3000.0)  # gained 36 000

    def refused(gain: float, after: Option | None = None, first: Option = before) -> str:
        return acceptance.no_further_effect(BASE, first, gain, "creep", after)

    assert "which another form of lag could explain" in refused(143.0)  # 0.4 % of what the first gained
    assert refused(145.0) == "creep removes less than half of the remaining residual"
    assert refused(1999.0) == "creep removes less than half of the remaining residual"
    assert refused(2000.0) == ""
    assert refused(1999.0, option("lag", "creep", excess=2001.0, z_slow=4.9)) == ""  # what is left are no slow parts
    assert refused(1999.0, option("lag", "creep", excess=2001.0, z_slow=5.1)) != ""
    nearly = option("lag", excess=1500.0)  # gained 38 500, and is nearly all there is: 3 % are asked for
    assert "another form of lag could" in refused(1154.0, first=nearly)
    vast, mended = option(excess=1e8), option("lag", "creep", excess=4000.0, z_slow=0.0)  # 0.4 % of it are 400 000
    assert "another form" in acceptance.no_further_effect(
        vast, option("lag", excess=40_000.0), 31_900.0, "creep", mended
    )
    assert acceptance.no_further_effect(vast, option("lag", excess=40_000.0), 32_100.0, "creep", mended) == ""
    assert refused(1156.0, first=nearly) == ""
    nearly = option("lag", excess=1000.0)  # 1170 are asked for, but if four fifths are removed
    assert "another form of lag could" in refused(799.0, first=nearly)
    assert refused(801.0, first=nearly) == ""  # no form of the first looks so much like it
    clean = option("lag", excess=300.0, z_slow=4.0)  # gained 39 700 and leaves noise: 2 % are asked for
    assert "another form of lag could" in refused(793.0, first=clean)
    assert refused(795.0, first=clean) == ""
    nearly = option("lag", excess=700.0)  # gained 39 300: what removes all that is left has to bring 2 % too
    assert "another form of lag could" in refused(785.0, first=nearly)
    assert refused(787.0, first=nearly) == ""


def test_a_further_effect_that_hides_in_the_noise_gains_more_than_nulls_do() -> None:
    base, before = option(excess=600.0), option("lag", excess=100.0, z_slow=1.0)
    assert "another form of lag could" in acceptance.no_further_effect(base, before, 69.0, "creep")
    assert acceptance.no_further_effect(base, before, 71.0, "creep") == ""


def test_where_models_are_far_from_the_plant_their_own_error_decides() -> None:
    """Residuals of over three times the noise: a gain of any number of standard deviations may be chance of form."""
    base = option(excess=40 * LARGE, held_out=4e5)
    before = option("lag", excess=20 * LARGE, held_out=2e5, turned=0.1)
    assert acceptance.far(before) and acceptance.far(option(excess=80_100.0)) and not acceptance.far(BASE)
    assert not acceptance.far(option(excess=79_900.0))  # 2.998 times the noise

    def refused(gain: float) -> str:
        return acceptance.no_further_effect(base, before, gain, "creep")

    assert refused(5.0 * LARGE - 1) == "creep explains less than 25% of the remaining residual"
    assert refused(5.0 * LARGE + 1) == ""
    much = option(excess=4000 * LARGE)  # of which the first effect explains nearly all: its law is not so exact
    assert "another form of lag could" in acceptance.no_further_effect(much, before, 15.9 * LARGE, "creep")
    assert acceptance.no_further_effect(much, before, 16.0 * LARGE, "creep") == ""
    vast = option(excess=40_000 * LARGE)  # whatever the first explains: what clears four fifths of the rest is no form
    assert "another form of lag could" in acceptance.no_further_effect(vast, before, 15.9 * LARGE, "creep")
    assert acceptance.no_further_effect(vast, before, 16.1 * LARGE, "creep") == ""
    worse = option("lag", "creep", excess=15 * LARGE, held_out=2.1e5, turned=0.2)
    assert acceptance.accept(base, before, worse, 30.0) == (
        False,
        "creep does not improve the prediction of the held-out experiments",
    )
    assert acceptance.accept(base, before, replace(worse, unseen=0.86 * before.unseen), 30.0)[0]
    rival = option("slew", excess=20 * LARGE + 0.19 * before.misfit, held_out=2e5)
    assert equivalence.stands_in(rival, before, {"lag": 20 * LARGE}) == ("lag", "slew")  # a fifth of what is left
    rival = option("slew", excess=20 * LARGE + 0.21 * before.misfit, held_out=2e5)
    assert equivalence.stands_in(rival, before, {"lag": 20 * LARGE}) is None


def test_nothing_is_missing_only_if_the_held_out_experiments_are_predicted() -> None:
    nothing = found(option(excess=0.0), option(excess=0.0))
    assert judgement.decide(nothing, 1.5, {}) == "no_effect"
    assert judgement.decide(nothing, 1.6, {}) == "unexplained"


@pytest.mark.parametrize(
    ("excess", "ratio", "samples", "exchanged"),
    [(0.0, 1.6, 5000, True), (0.0, 1.4, 5000, False), (5000.0, 1.6, 5000, False), (0.0, 1.6, 200, False)],
)
def test_what_only_the_held_out_experiments_see_is_sought_there(
    monkeypatch: pytest.MonkeyPatch, excess: float, ratio: float, samples: int, exchanged: bool
) -> None:
    base = option(excess=excess)
    monkeypatch.setattr(engine, "option", lambda work, ids, fitted: base)
    monkeypatch.setattr(engine, "held_ratio", lambda work, chosen: ratio)
    work = SimpleNamespace(held_out=[SimpleNamespace(record=np.zeros(samples))])
    assert engine._seen_elsewhere(work, base.fitted) == exchanged


def test_an_interval_ends_at_the_bounds_of_its_parameter() -> None:
    fitted = option("lag").fitted
    for lower, upper in ((None, None), (0.0, 2.0)):
        free = [replace(fitted.free[0], lower=lower, upper=upper), fitted.free[1]]
        one = replace(fitted, free=free, covariance=np.diag([9.0, 1.0]), scaled=np.array([0.7, 0.0]))
        ends = interval(one, "base")
        assert ends == ((0.0, 2.0) if upper else pytest.approx((0.7 - 1.96 * 3, 0.7 + 1.96 * 3), abs=0.01))


def test_noise_is_no_more_than_a_residual_hides_from_its_past() -> None:
    random, time = np.random.default_rng(6), np.arange(4000) / 250
    slow = 3.0 * np.sin(2 * np.pi * 0.7 * time) + np.exp(-time)
    noise = 0.2 * random.standard_normal((2, time.size))
    bound = noise_bound.prediction_error([slow + n for n in noise])
    assert 0.99 * noise.std() < bound < noise_bound.TOO_MUCH * noise.std()
    assert noise_bound.prediction_error([np.zeros(100)]) == 0.0


def test_what_a_monitor_drives_is_no_part_of_the_noise_that_a_residual_limits() -> None:
    """A line follows its monitor's noise in some files, and in others it does not: their residual shows none of it."""
    known = Noise(12e-6, 0.97, 5000.0, step=0.002, driven=6e-6)
    left = [Noise(12e-6, 0.97, step=0.002).sample(np.arange(6000) * 0.002, np.random.default_rng(3))]
    assert known.innovation > noise_bound.TOO_MUCH * noise_bound.prediction_error(left)
    assert noise_bound.limited(known, left).rms == pytest.approx(12e-6, rel=0.1)


def test_a_detection_limit_is_that_of_the_usual_shape() -> None:
    """A stiffening that ends the stretch far earlier than usual was to be seen below 167 mPa; usual are 50 kPa."""
    random = np.random.default_rng(9)
    jacobian, seen = random.standard_normal((400, 2)), random.standard_normal((400, 1))
    size, end = (SimpleNamespace(name=n, minimum=0.0, maximum=None) for n in ("mu", "J"))
    effect = SimpleNamespace(
        id="stiffening", on={}, off={"mu": 0.0}, typical={"mu": 5e4, "J": 2.0}, parameters=[size, end], shapes={"J": ()}
    )
    listed = [Candidate(effect, {"J": at}, ("mu",), seen * by) for at, by in ((0.4, 1e3), (1.8, 1.0), (6.0, 0.1))]
    (guess,) = power.guesses(listed, jacobian, 10.0)
    assert guess.shape == {"J": 1.8} and guess.size == pytest.approx(np.sqrt(10.0 / 400), rel=0.2)
    hidden = [replace(c, columns=0 * c.columns) if c.shape["J"] == 1.8 else c for c in listed]
    assert power.guesses(hidden, jacobian, 10.0)[0].shape == {"J": 0.4}  # where the usual shape shows nothing


def test_what_the_base_stands_for_counts_neither_in_scores_nor_in_nulls() -> None:
    """One of two columns that the base can do leaves the other to be scored, with its chance of false alarms."""
    random = np.random.default_rng(0)
    jacobian, seen, other = (random.standard_normal((400, k)) for k in (2, 1, 1))
    one = Candidate(
        SimpleNamespace(id="one", off={}), {}, ("a", "b"), seen * [1.0, 0.0] + 3 * jacobian[:, [0, 0]] * [0, 1]
    )
    alone = Candidate(SimpleNamespace(id="alone", off={}), {}, ("a", "b"), np.column_stack([seen, other]))
    residual = random.standard_normal(400)
    (score,) = scores([one], residual, jacobian)
    left = seen[:, 0] - jacobian @ np.linalg.lstsq(jacobian, seen[:, 0], rcond=None)[0]
    assert score.statistic == pytest.approx((left @ residual) ** 2 / (left @ left), rel=1e-6)
    assert score.amplitudes["b"] == 0.0
    single, double = (null_scores([c], jacobian, draws=20_000).threshold(0.05) for c in (one, alone))
    assert single == pytest.approx(3.84, rel=0.05) and double == pytest.approx(5.99, rel=0.05)  # chi-squared
    nothing = replace(one, columns=jacobian @ random.standard_normal((2, 2)))
    assert null_scores([nothing], jacobian).threshold(0.001) == 0.0


def test_what_would_have_been_seen_is_as_large_as_it_takes() -> None:
    """Drawn at the size that is told, an effect passes what a round asks in about POWER of the records."""
    random = np.random.default_rng(9)
    jacobian, columns = random.standard_normal((800, 3)), random.standard_normal((800, 4))
    columns[:, 1] = jacobian @ [1.0, 2.0, 3.0]  # what the base's own parameters do
    listed = []
    for i, name in enumerate(("lag", "hidden", "creep", "set")):
        quantity = SimpleNamespace(name=name, minimum=None, maximum=None)
        effect = SimpleNamespace(id=name, on={}, off={name: 0.0}, parameters=[quantity], shapes={})
        listed.append(Candidate(effect, {}, (name,), columns[:, i : i + 1]))
    null = null_scores(listed, jacobian, draws=20_000)
    threshold = 2 * null.threshold(0.001)  # as a round asks
    sizes = {g.effect.id: g.size for g in power.guesses(listed, jacobian, power.needed(threshold))}
    assert sizes["hidden"] is None
    passed = []
    for _ in range(400):
        residual = sizes["lag"] * columns[:, 0] + random.standard_normal(800)
        passed.append(next(s.statistic for s in scores(listed, residual, jacobian) if s.id == "lag") > threshold)
    assert np.mean(passed) == pytest.approx(0.8, abs=0.06)


@pytest.mark.parametrize(
    ("score", "growth", "true"),
    [
        (lambda size: (40 * size) ** 2, 1.0, 0.168),  # grows with its square
        (lambda size: (20 * size) ** 4, 1.0, 0.1296),
        (lambda level: max(0.0, 12.0 - level) ** 2 * 1e5, -1.0, 11.99),  # an end of a range of 12
        (lambda size: 1e6 * size if size > 6.6 else 1e-6 * size, 1.0, 6.6),  # nothing is seen of it up to a length
        (lambda rate: 1e3 + 50 / rate, -1.0, np.inf),  # a little more than off at any rate
    ],
)
@pytest.mark.parametrize("first", [0.9, 0.5])
def test_sizes_are_sought_where_what_is_needed_is_scored(
    score: Callable[[float], float], growth: float, true: float, first: float
) -> None:
    needed = 45.2
    search = power._SizeSearch(power.Guess(SimpleNamespace(id="one"), {}, "size", first, growth), [12 * first])
    while len(search.scores) < power.SIMULATED and not search.settled(needed):
        search.scored(score(search.sizes[-1]), needed, taken=False)
    limit = search.limit(needed)
    assert limit == pytest.approx(true, rel=0.3) if np.isfinite(true) else limit > 12 * first
    if not np.isfinite(true):
        assert len(search.scores) < power.SIMULATED


def test_held_out_experiments_settle_which_of_the_accepted_stays() -> None:
    one, two = option("lag", excess=2000.0, held_out=9000.0), option("lag", "creep", excess=0.0, held_out=9090.0)
    assert acceptance.last_undenied(BASE, [one, two]) is two  # worse by 90, less than a twentieth of its gain of 2000
    worse = option("lag", "creep", excess=0.0, held_out=9101.0)
    assert acceptance.last_undenied(BASE, [one, worse]) is one
    denied = option("lag", excess=LARGE - 100.0, held_out=BASE.held_out + 6.5)
    assert acceptance.last_undenied(BASE, [denied]) is BASE
    together = option("lag", "creep", excess=0.0, held_out=2000.0)
    # one of two alone may predict worse than none
    assert acceptance.last_undenied(BASE, [denied, together]) is together


def test_evidence_pays_for_parameters() -> None:
    plain, richer = option("lag", excess=100.0), option("creep", excess=91.0, parameters=3)
    assert plain.evidence > richer.evidence  # 9 gained for 9.2
    assert plain.evidence < option("creep", excess=90.0, parameters=3).evidence


@pytest.mark.parametrize(
    ("gain", "behind", "equal"),
    [
        (30_000.0, 590.0, True),
        (30_000.0, 610.0, False),  # 2 % of a large gain
        (1000.0, 119.0, True),
        (1000.0, 121.0, False),  # weak evidence: 120 at most
        (100.0, 59.0, True),
        (100.0, 61.0, False),  # of little, 60 %
        (10.0, 11.0, True),
        (10.0, 13.0, False),  # chance
    ],
)
def test_effects_are_equal_within_chance_and_form(gain: float, behind: float, equal: bool) -> None:
    chosen, rival = option("lag", excess=0.0), option("slew", excess=behind)
    assert equivalence.stands_in(rival, chosen, {"lag": gain}) == (("lag", "slew") if equal else None)


def test_equals_differ_in_one_effect_and_are_listed_best_first() -> None:
    chosen, gains = option("lag", "creep"), {"lag": 5000.0, "creep": 5000.0}
    rivals = [
        option("lag", "set", excess=5.0),
        option("slew", "creep", excess=20.0),
        option("slew", "set", excess=1.0),
        option("lag", "set", excess=9.0),
        option("lag", "mullins", excess=50.0),
        option("lag", excess=4.0),
        option("lag", "gain", excess=4000.0),
    ]
    assert equivalence.equivalents(chosen, rivals, gains) == {"lag": ["slew"], "creep": ["set", "mullins"]}


@pytest.mark.parametrize(("correlation", "kept"), [(0.6, True), (0.95, False)])
def test_noise_that_no_quiet_stretch_shows_keeps_a_colour_that_no_signal_has(correlation: float, kept: bool) -> None:
    known = Noise(1.0, correlation, 1e4, step=0.004, quiet=False)
    colour = Colour(correlation, 0.0)
    left = [colour.sample(4000, np.random.default_rng(seed)) for seed in range(3)]
    found = noise_bound.limited(known, left)
    assert found.correlation == pytest.approx(correlation if kept else 0.0, rel=0.02)
    assert found.innovation == pytest.approx(known.innovation, rel=0.03)


def test_noise_is_no_larger_than_the_residual_that_it_is_part_of() -> None:
    """Short quiet stretches tell what is new in a sample, and not a memory of seconds."""
    left = [Colour(0.9, 0.0).sample(4000, np.random.default_rng(seed)) for seed in range(3)]
    known = Noise(3.0, np.sqrt(1 - (Noise(1.0, 0.9, step=0.004).innovation / 3.0) ** 2), 1e4, step=0.004)
    found = noise_bound.limited(known, left)
    assert found.rms == pytest.approx(1.0, rel=0.1) and found.correlation == pytest.approx(0.9, rel=0.03)
    assert found.innovation == pytest.approx(known.innovation, rel=0.03)


@pytest.mark.parametrize("quiet", [True, False])
def test_noise_that_a_residual_limits_is_rounded_to_the_same_steps(quiet: bool) -> None:
    left = [Colour(0.0, 0.0).sample(4000, np.random.default_rng(seed)) for seed in range(3)]
    found = noise_bound.limited(Noise(30.0, 0.0, 1e4, quiet=quiet, grain=2.0), left)
    assert found.rms < 10.0 and found.grain == 2.0


def test_slow_noise_asks_for_larger_gains_where_its_colour_is_unknown() -> None:
    before, best = option(excess=900.0, z_slow=9.0), option("lag", excess=0.0, held_out=1500.0)
    assert acceptance.accept(BASE, before, best, 40.0)[0]
    slow = replace(best, lack_of_fit=replace(best.lack_of_fit, coloured=30.0))
    assert "less than chance can (1200.0)" in acceptance.accept(BASE, before, slow, 40.0)[1]

    def alone(one: Option, total: float = 3.0, coloured: float = 1.0) -> bool:
        state = replace(before.lack_of_fit, z_total=total, coloured=coloured)
        return acceptance.noise_alone(replace(one, lack_of_fit=state))

    assert not alone(BASE) and alone(BASE, coloured=9.0)
    assert not alone(BASE, coloured=1.1 * misfit.MOST_COLOURED) and not alone(BASE, total=5.0, coloured=9.0)
    assert alone(best, coloured=0.9 * acceptance.SLOW_BESIDE_EFFECTS)
    assert not alone(best, coloured=9.0)  # a store that goes no lower than a level, in records that go lower


def test_one_that_leaves_noise_alone_has_shown_its_form() -> None:
    """An offset that leaves noise is told from a drift that leaves 26 times its rms, however much both explain."""
    chosen = option("lag", z_slow=0.0, held_out=2000.0)
    assert equivalence.stands_in(option("slew", excess=3 * SAMPLES), chosen, {"lag": 1e9}) is None
    assert equivalence.stands_in(option("slew", excess=0.5 * SAMPLES), chosen, {"lag": 1e9}) == ("lag", "slew")


def test_what_monitors_add_to_a_slow_sensor_asks_for_a_larger_gain() -> None:
    """Where their noise makes block means vary five times as much, an effect gains five times as much by chance."""
    base = option(excess=500.0, held_out=2500.0)
    best = option("lag", excess=350.0, held_out=2400.0, turned=0.1)
    assert acceptance.accept(base, base, best, 40.0)[0]
    driven = replace(best, lack_of_fit=replace(best.lack_of_fit, driven=5.0))
    assert acceptance.accept(base, base, driven, 40.0) == (
        False,
        "refitted, lag gains 150.0, less than chance can (200.0)",
    )
    assert acceptance.accept(base, base, driven, 29.0)[0]


@pytest.mark.parametrize("noise", [Noise(15e-6, 0.0, step=2e-3), Noise(18e-6, 0.3, step=2e-3, white=0.69)])
def test_a_monitor_s_noise_beside_that_of_the_sensor(noise: Noise) -> None:
    """Lines through white noise move the output: the block means that these leave, and those that are expected."""
    samples, gap, gain, level = 100_000, 30, 3e-7, 90.0
    time = np.arange(samples) * noise.step
    knots = np.concatenate([[time[0]] * 2, time[gap:-gap:gap], [time[-1]] * 2])
    line = make_lsq_spline(time, level * np.random.default_rng(3).standard_normal(samples), knots, k=1)
    weight = np.full(samples, 1 / np.sqrt(1 + (level * gain / noise.slow) ** 2))
    clock = SimpleNamespace(step=noise.step, parts=[slice(None)], steps=[noise.step])
    case = SimpleNamespace(
        protocol=SimpleNamespace(time=np.unique(knots)),
        readings=[SimpleNamespace(output="radius", clock=clock)],
        parts=[slice(None)],
    )
    none_fitted = SimpleNamespace(variance_removed=np.zeros)
    none = SimpleNamespace(names=())
    piece = SimpleNamespace(record=time, weight=weight, case=case, marginal=none_fitted, nuisances=none)
    study = SimpleNamespace(noise={"radius": noise}, plant=SimpleNamespace(bandwidth=1e3))
    left = noise.whiten(clock, gain * line(time)) * weight
    varies = float(np.mean(residuals.block_means(left, [piece]) ** 2))
    expected = float(np.mean(residuals._block_variance(study, [piece]) - weight[0] ** 2))
    assert expected == pytest.approx(varies, rel=0.35)


def test_where_the_base_has_no_answer_a_gain_is_that_in_training() -> None:
    """A laser's filter: without one of two effects a held-out file had no answer, every rival was "an equivalent" of an
    effect that gained infinitely, and a search of two minutes ended in an OverflowError."""
    with_it, without = option("lag", excess=0.0), option(excess=900.0)
    assert with_it.gain_over(without) == pytest.approx(without.misfit - with_it.misfit)
    nowhere = replace(without, unseen=np.array([np.inf]))
    assert with_it.gain_over(nowhere) == pytest.approx(without.cost - with_it.cost)
    assert nowhere.gain_over(with_it) == pytest.approx(with_it.cost - without.cost)
