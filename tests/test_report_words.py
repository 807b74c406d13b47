"""What a report says, sentence by sentence, on made-up results."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import plotly.graph_objects as go
import pytest

import made_up
import tubular_dea as td
from tubular_dea import add_effects
from tubular_dea.api import identify, simulate
from tubular_dea.cosim import course
from tubular_dea.discover.alternatives.backwards import Backwards
from tubular_dea.discover.alternatives.zeros import Shift
from tubular_dea.discover.answer import between_files, outcome, remarks, reservations
from tubular_dea.discover.options import residuals
from tubular_dea.discover.options.options import Option
from tubular_dea.discover.scores import parameters
from tubular_dea.discover.scores.channels import Isolation
from tubular_dea.identify.fitting.cases import Case, Reading
from tubular_dea.identify.fitting.problem import Free
from tubular_dea.identify.signals.noise import Noise
from tubular_dea.model.units import in_words, three, with_ends
from tubular_dea.plants.effects import with_effects
from tubular_dea.plants.tube import PLANT
from tubular_dea.protocol import Protocol
from tubular_dea.recordings.table import either
from tubular_dea.report import assist, close_loop, effects, in_short
from tubular_dea.report import residuals as drawn_residuals
from tubular_dea.report.page import Page
from tubular_dea.report.parts import parameter_row

hidden_by_noise = reservations.hidden_by_noise


@pytest.fixture(autouse=True)
def signals_beyond_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    """What these tests make up has no records: they count as moving by far more than noise."""
    for room in (reservations, in_short):
        monkeypatch.setattr(room, "hidden_by_noise", lambda found: "")


NEAR = made_up.option()
FOUND = SimpleNamespace(study=SimpleNamespace(catalogue=PLANT.catalogue), verdict="no_effect", base=NEAR, named=NEAR)
WHITE = {"blocks": 100.0, "limit": 0.2, "whiteness": 0.3}
NO_FILES: dict[str, object] = {"unit": "m", "per_experiment": {}}


def hidden(invisible: dict[str, dict[str, float | None]]) -> str:
    return " ".join(in_short._hidden(FOUND, {"effects": [], "invisible": invisible}))


def table(invisible: dict[str, dict[str, float | None]]) -> str:
    page = Page("a", "b")
    in_short.not_seen(page, FOUND, {"effects": [], "invisible": invisible})
    return page.document()


@pytest.mark.parametrize("refitted", [True, False])
@pytest.mark.parametrize(("left", "told"), [(1200.0, True), (60.0, False)])
def test_what_another_form_may_explain_is_told_where_it_is_not_named(left: float, told: bool, refitted: bool) -> None:
    """Trapped charge beside Mullins explained all that was left, and nothing was said of it."""
    named = made_up.option("mullins_softening", excess=left)
    both = [made_up.option("mullins_softening", "charge_trapping")] if refitted else []
    scores = [SimpleNamespace(id="charge_trapping", statistic=left)]
    last = SimpleNamespace(accepted=False, options=both, scores=scores, threshold=35.0)
    search = SimpleNamespace(rounds=[last])
    said = remarks.not_named(SimpleNamespace(named=named, base=made_up.option(excess=9e4), search=search))
    assert len(said) == told
    assert not told or said[0].startswith(
        "Beside mullins_softening, charge_trapping would explain 100% of what is left"
    )


def test_the_first_remark_is_told_on_the_console() -> None:
    """Times at which something happened, and units to look at, stood in the report alone."""
    asked, times, law = f"{in_short.QUESTION}is it so?", "More than half is in c from 3.4 to 4.7 s.", "It is a law."
    assert in_short.first_remark([asked, times, law], ["unexplained"]) == [times, "1 more remark in the report"]
    assert in_short.first_remark([times, law], [f"as said: {times}"]) == [law]
    assert in_short.first_remark([asked, times], [times]) == []


def test_many_parameters_far_from_their_declared_values_ask_for_a_unit(monkeypatch: pytest.MonkeyPatch) -> None:
    """A speed in rpm labelled rad/s: seven remarks about seven parameters, and none about the speed."""
    declared = PLANT.model.parameter_values()
    fitted = SimpleNamespace(values={n: 9 * v for n, v in declared.items()})
    named = made_up.option()
    named = SimpleNamespace(ids=(), fitted=fitted, lack_of_fit=named.lack_of_fit)
    found = SimpleNamespace(study=SimpleNamespace(plant=PLANT), named=named, verdict="no_effect", restoring={})
    for names, told in ((["C_1", "k_1", "eta_1"], 1), (["C_1", "k_1"], 2)):
        monkeypatch.setattr(remarks, "implausible", lambda plant, fitted, names=names: names)
        said = remarks._implausible(found)
        assert len(said) == told
        assert ("is the unit of pressure or voltage or radius another one than the files say?" in said[0]) == (
            told == 1
        )


@pytest.mark.parametrize(
    ("before", "said"),
    [(9e4, "That is 1.4% of what is explained already"), (1300.0, "That is 12 times what is explained already")],
)
def test_a_share_of_more_than_all_is_told_as_a_factor(before: float, said: str) -> None:
    """ "That is 47068.5% of what is explained already"."""
    last = SimpleNamespace(
        accepted=False, options=[], scores=[SimpleNamespace(id="drift", statistic=1200.0)], threshold=35.0
    )
    found = SimpleNamespace(
        named=made_up.option("saturation", excess=1200.0),
        base=made_up.option(excess=before),
        search=SimpleNamespace(rounds=[last]),
    )
    assert said in remarks.not_named(found)[0]


@pytest.mark.parametrize("quiet", [True, False])
def test_what_is_missing_is_certain_only_beside_noise_that_was_seen(quiet: bool) -> None:
    found = SimpleNamespace(
        verdict="unexplained",
        named=SimpleNamespace(lack_of_fit=SimpleNamespace(ratio=7.2)),
        study=SimpleNamespace(
            noise={"level": SimpleNamespace(quiet=quiet)},
            plant=SimpleNamespace(outputs=[SimpleNamespace(name="level")]),
        ),
        strained=(),
        wandering=None,
        unlike=None,
    )
    said = in_short._confidence(found)
    assert said.startswith("It is certain that something is missing") == quiet
    assert ("7 times what was estimated" in said) != quiet


@pytest.mark.parametrize(("stderr", "told"), [(0.5, "only show that it is at least 5.0"), (40.0, "do not tell it")])
def test_a_parameter_at_its_bound_whose_interval_is_its_range_is_not_told(stderr: float, told: str) -> None:
    """ "At least -6", where -6 is the least that is allowed."""
    option = made_up.option("heat_stretch")
    free = [Free("base", 1.0), Free("heat_stretch", 1.0, -6.0, 6.0)]
    wide = np.diag([0.01, stderr**2])
    fitted = replace(option.fitted, values={"base": 1.0, "heat_stretch": 6.0}, scaled=np.array([1.0, 6.0]), free=free)
    fitted = replace(fitted, covariance=wide)
    named = SimpleNamespace(ids=("thermal_softening",), fitted=fitted)
    (said,) = remarks._ended(SimpleNamespace(named=named, study=SimpleNamespace(catalogue=PLANT.catalogue)))
    assert said.startswith("The fit of heat_stretch ended at its largest allowed value") and told in said


def test_limits_say_which_side_was_seen_and_what_they_limit() -> None:
    effect = PLANT.catalogue["pressure_gain"]
    said = hidden({"pressure_gain": {"pressure_gain": 0.05}})
    (meaning,) = (q.description for q in effect.parameters if q.name == "pressure_gain")
    assert f"pressure_gain ({meaning[0].lower()}{meaning[1:]}: within 0.05 of 1). Stronger ones" in said
    assert "Larger" not in said
    limits = {"effects": [], "invisible": {"pressure_gain": {"pressure_gain": 0.05}}}
    missed = made_up.option(excess=(23.0**2 - 1) * made_up.SAMPLES)
    beside = SimpleNamespace(
        study=FOUND.study, verdict="unexplained", base=missed, named=missed
    )  # what remains may hide more
    short = " ".join(in_short._hidden(beside, limits))
    assert "Stronger ones" not in short
    page = Page("a", "b")
    in_short.not_seen(page, beside, limits)
    for said in (short, page.document()):
        assert "beside the base model, whose residual is 23 times the noise" in said
    assert "beside the base model" not in hidden(limits["invisible"]) + table(limits["invisible"])


def test_a_limit_says_at_which_shape_it_holds() -> None:
    limits = {"effects": [], "invisible": {"third_maxwell_branch": {"k_3": 1e5}}}
    limits["invisible_at"] = {"third_maxwell_branch": {"tau_3": 0.05}}
    page = Page("a", "b")
    in_short.not_seen(page, FOUND, limits)
    assert "k_3, at tau_3 = 50 ms" in page.document()
    assert ", at tau_3 = 50 ms: below 100 kPa)" in " ".join(in_short._hidden(FOUND, limits))


def test_any_size_is_explained_only_where_it_stands_in_the_table() -> None:
    some, none = {"pressure_gain": {"pressure_gain": 0.05}}, {"pressure_gain": {"pressure_gain": None}}
    assert "any size" not in table(some)
    assert table(none).count("any size") == 2
    far = {"pressure_gain": {"pressure_gain": 1e3}}
    assert "10 times as strong as usual" in table(far) and "even 10 times as strong" in hidden(far)


def test_few_data_and_what_was_held_out_are_said_with_the_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(close_loop, "floor", lambda study, error: 15e-6)
    monkeypatch.setattr(close_loop, "thin", lambda found: "there is only one experiment")
    monkeypatch.setattr(close_loop, "still", lambda found: "load barely moves in any experiment")
    held = [SimpleNamespace(name="ramp, second half")]
    found = SimpleNamespace(
        verdict="effect_found",
        study=SimpleNamespace(plant=PLANT, held_out=held),
        shifted=None,
        missed=None,
        unlike=None,
        turned=None,
    )
    errors = {"rmse": 15e-6, "held_out_rmse": 16e-6, "unit": "m"}
    told = {"published": errors, "recalibrated": errors, "after": errors}
    first, second, third = close_loop.error_lines(found, told)
    assert "held out (ramp, second half) 16 um" in first
    assert second == "these recordings prove little: there is only one experiment"
    assert third == "load barely moves in any experiment: what it does is not tested"
    found.verdict = "no_effect"  # its headline says so
    assert close_loop.error_lines(found, told) == [first, third]
    better = errors | {"held_out_rmse": 15.2e-6}
    _, declared, *_ = close_loop.error_lines(found, told | {"published": better})
    assert declared.startswith(
        "On the held-out experiments the model without effects errs less as it was declared (15.2 um) "
        "than refitted (16 um): the refit"
    )
    found.named = SimpleNamespace(ids=("lag",), lack_of_fit=SimpleNamespace(ratio=1.0))
    worse = errors | {"held_out_rmse": 22e-6}
    _, larger, *_ = close_loop.error_lines(found, told | {"after": worse, "published": worse})
    assert larger.startswith("The error on the held-out experiments is larger with the named effects than without")
    found.turned = Backwards(("measured_displacement",), 0.06)
    _, sign, *_ = close_loop.error_lines(found, told)
    assert sign.startswith("radius seems to be counted the other way: with its sign changed") and "misses 6%" in sign


def test_an_error_beyond_the_sensors_noise_is_compared_with_what_the_inputs_allow(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(close_loop, "floor", lambda study, error: 15e-6)
    errors = {"rmse": 15e-6, "held_out_rmse": 60e-6, "unit": "m"}
    named = SimpleNamespace(lack_of_fit=SimpleNamespace(ratio=0.97))
    study = SimpleNamespace(plant=PLANT)
    found = SimpleNamespace(study=study, named=named, verdict="no_effect")
    assert "; weighted as in the fit, that is 0.97 times what all noise makes" in close_loop._moved_by_monitors(
        found, errors
    )
    assert close_loop._moved_by_monitors(SimpleNamespace(study=study, named=named, verdict="unexplained"), errors) == ""
    assert close_loop._moved_by_monitors(found, errors | {"held_out_rmse": 16e-6}) == ""


def test_a_noise_that_hardly_shows_how_large_it_is_proves_little() -> None:
    pieces = [SimpleNamespace(source=f"file {i}") for i in range(9)]
    for verdict, ratio, little in (("no_effect", 2.37, True), ("no_effect", 1.1, False), ("effect_found", 2.37, False)):
        named = SimpleNamespace(lack_of_fit=SimpleNamespace(ratio=ratio))
        said = reservations.thin(SimpleNamespace(study=SimpleNamespace(pieces=pieces), verdict=verdict, named=named))
        assert ("2.4 times the noise" in said) == little


@pytest.mark.parametrize("quiet", [True, False])
def test_a_residual_that_is_noise_only_if_nobody_knows_it_is_not_called_nothing(quiet: bool) -> None:
    """A heat exchanger that others measured: the noise was taken from the misfit, a delay was there, and the page said
    that nothing is missing and the residual no larger than noise."""
    state = SimpleNamespace(ratio=1.1, z_slow=11.8, z_total=2.3, coloured=6.25)
    pieces, noise = (
        [SimpleNamespace(source=f"file {i}") for i in range(9)],
        {"temperature": SimpleNamespace(quiet=quiet)},
    )
    found = SimpleNamespace(
        verdict="no_effect",
        named=SimpleNamespace(lack_of_fit=state),
        study=SimpleNamespace(pieces=pieces, noise=noise),
        strained=(),
        wandering=None,
    )
    said = reservations.loud(found)
    assert ("the slow part of the residual is 2.5 times that of the noise that could be estimated" in said) == (
        not quiet
    )
    assert in_short._confidence(found) == (in_short.CONFIDENCE["no_effect"] if quiet else in_short.LOUDER)
    nothing = in_short._nothing(found, {"error": {"after": NO_FILES}})
    assert (nothing == in_short.NOTHING) == quiet and said in nothing


@pytest.mark.parametrize(("weight", "said"), [(1.0, False), (0.1, True)])
def test_records_in_which_noise_may_be_all_that_moves_prove_little(
    monkeypatch: pytest.MonkeyPatch, weight: float, said: bool
) -> None:
    """A stream's discharge under daily rain, whose jitter was taken for noise: "nothing" at a fit of 26 %."""
    swings = np.sin(np.linspace(0, 20, 400))
    parts = (slice(0, 400),)
    case = SimpleNamespace(readings=[SimpleNamespace(output="discharge")], parts=parts)
    piece = SimpleNamespace(record=5.0 + swings, weight=np.full(400, weight), case=case)
    study = SimpleNamespace(pieces=[piece], noise={"discharge": SimpleNamespace(slow=0.1, rms=0.1)})
    found = SimpleNamespace(verdict="no_effect", strained=(), wandering=None, study=study)
    found.named = made_up.option(excess=-50.0, z_slow=-0.9)
    for room in (reservations, in_short):
        monkeypatch.setattr(room, "hidden_by_noise", hidden_by_noise)
    why = "what noise may make of discharge, the inputs' too, is 1.4 times as large as all that it does"
    assert reservations.loud(found) == (why if said else "")
    assert in_short._confidence(found) == (in_short.DROWNED if said else in_short.CONFIDENCE["no_effect"])
    case.readings, piece.weight = [SimpleNamespace(output="discharge")], np.ones(400)
    study.noise["discharge"] = SimpleNamespace(slow=2.0, rms=0.2)  # a sensor's slow noise is no larger than its rms
    assert hidden_by_noise(found) == ""


def test_files_with_far_larger_errors_than_the_others_are_named() -> None:
    """Nine samples of one file were "a significant residual"; nothing said that it was that file."""
    found = SimpleNamespace(study=SimpleNamespace(plant=PLANT))

    def said(*errors: float) -> list[str]:
        each = {f"rec{n}": {"rmse": rms} for n, rms in enumerate(errors)}
        return between_files.odd_files(found, {"unit": "m", "per_experiment": each})

    (one,) = said(16e-6, 15e-6, 16e-6, 65e-6)
    assert one.startswith("The error is 16 um in most files, and in rec3 it is 65 um: ")
    (two,) = said(16e-6, 15e-6, 24e-6, 16e-6, 27e-6, 15e-6)
    assert "in rec2 and rec4 it is up to 27 um" in two
    assert not said(16e-6, 15e-6, 22e-6) and not said(15e-6, 15e-6, 40e-6, 42e-6) and not said()


def test_a_drift_of_the_sensor_is_no_residual_that_looks_like_noise() -> None:
    def said(verdict: str, wandering: tuple[str, float] | None) -> str:
        return in_short._confidence(
            SimpleNamespace(verdict=verdict, wandering=wandering, strained=(), named=made_up.option())
        )

    assert (
        in_short._confidence(SimpleNamespace(verdict="no_effect", strained=("C_3",), chosen=made_up.option()))
        == in_short.HIDING
    )
    outcome = {"effects": [], "verdict": "no_effect", "noise": {"sensors": {}}, "error": {"after": NO_FILES}}
    (one,) = in_short._found(SimpleNamespace(strained=("C_3",)), outcome)
    assert "seen to be missing, but C_3 would be implausible" in one

    assert said("no_effect", None) == in_short.CONFIDENCE["no_effect"]
    assert "zero drifts slowly" in said("no_effect", ("ramp", 5e-6))
    assert said("effect_found", ("ramp", 5e-6)) == in_short.CONFIDENCE["effect_found"]


def test_a_parameter_that_is_not_determined_is_told_in_the_unit_of_its_uncertainty() -> None:
    def said(value: float, stderr: float) -> str:
        ends = value - 1.96 * stderr, value + 1.96 * stderr
        return identify._estimate("C_3", SimpleNamespace(value=value, stderr=stderr, unit="Pa", ci95=ends))

    assert said(0.129874, 4600.0) == "C_3      0.000129874 +- 4.6 kPa"
    assert said(3086.4, 130.0) == "C_3      3.0864 +- 0.13 kPa"
    assert said(3086.4, float("inf")) == "C_3      3.0864 +- inf kPa"


def left(base: Option, chosen: Option, name: str, rmse: float, whiteness: float = 0.3) -> str:
    """What the report says of the residual of the model `name` with this error [m], beside 5 um of noise."""
    tests = {"whiteness": whiteness}
    study = SimpleNamespace(plant=PLANT)
    found = SimpleNamespace(base=base, chosen=chosen, study=study, tests_before=tests, tests_after=tests)
    return close_loop._left(found, {"error": {name: {"rmse": rmse}}, "noise_floor": 5e-6}, name)


def of_size(one: Option, structure: float) -> Option:
    return replace(one, lack_of_fit=replace(one.lack_of_fit, structure=structure))


def test_a_model_that_makes_up_for_what_is_missing_says_so() -> None:
    """An electrode that loses contact: C_3 was 474 times as declared, and a margin to snap-through 202 050 mmHg."""
    declared = PLANT.model.parameter_values()
    values = {"C_1": 1.2 * declared["C_1"], "C_3": 474 * declared["C_3"], "k_2": 0.9 * declared["k_2"]}

    def said(verdict: str, values: dict[str, float]) -> list[str]:
        fitted = SimpleNamespace(values=values, names=[*values])
        found = SimpleNamespace(
            verdict=verdict, study=SimpleNamespace(plant=PLANT), named=SimpleNamespace(fitted=fitted)
        )
        return reservations.compensating(found)

    for verdict in ("unexplained", "partly_explained"):
        (only,) = said(verdict, values)
        assert "beyond these recordings" in only and "(C_3 474 times as declared)" in only
    assert said("no_effect", values) == said("unexplained", {"C_1": values["C_1"]}) == []


@pytest.mark.parametrize("structure", [0.0, 1e-6])
def test_a_residual_of_noise_is_told_as_that_only(structure: float) -> None:
    quiet = of_size(made_up.option(excess=-50.0, z_slow=-0.9), structure)
    for name in ("recalibrated", "after"):
        assert left(quiet, replace(quiet), name, 5.1e-6) == "it is no larger than the noise"


def test_slow_parts_are_told_as_an_excess_only_where_they_are_one() -> None:
    lag = made_up.option("lag", excess=-300.0, z_slow=-12.7)
    weak = of_size(made_up.option(excess=900.0, z_slow=1.2), 3e-6)
    assert left(weak, lag, "recalibrated", 13e-6) == "3 um rms of it is beyond the noise"
    strong = of_size(made_up.option(excess=9000.0, z_slow=60.2), 3e-6)
    said = left(strong, lag, "recalibrated", 13e-6)
    assert said.endswith("beyond the noise, and its slow part exceeds that of the noise by 60 standard deviations")
    assert left(made_up.option(z_slow=-0.4), lag, "recalibrated", 5e-6) == "by its size alone it may be noise"


def test_what_is_beyond_noise_is_less_than_the_whole_error() -> None:
    state = replace(made_up.lack_of_fit(900.0), structure=20e-6)
    assert outcome.beyond_noise(state, {"rmse": 13e-6}, 5e-6) == pytest.approx(12e-6)
    assert outcome.beyond_noise(state, {"rmse": 4e-6}, 5e-6) == pytest.approx(4e-6)
    assert outcome.beyond_noise(state, {"rmse": None}, 5e-6) == 20e-6


def isolated(disturbance: bool, shifted: bool = True) -> SimpleNamespace:
    """An unexplained residual whose isolation points to the voltage, while a zero of the sensor cannot be right."""
    residual = made_up.option(excess=5000.0)
    return SimpleNamespace(
        verdict="unexplained",
        chosen=residual,
        base=residual,
        study=SimpleNamespace(plant=PLANT),
        isolated=Isolation("electrical", {"electrical": 9.0, "sensor": 2.0}, {}, disturbance),
        shifted=Shift("measured_displacement", "trap1", 654e-6) if shifted else None,
        missed=None,
        unlike=None,
        strained=(),
        equivalent={},
        repeated=False,
        proposal=None,
    )


@pytest.mark.parametrize("disturbance", [True, False])
def test_summary_and_steps_say_the_same_of_an_uncertain_channel(disturbance: bool) -> None:
    found = isolated(disturbance)
    why = "in trap1 the zero of measured_displacement would have to be far too large"
    page, told = Page("a", "b"), outcome.channel(found)
    close_loop._channels(page, found, told)
    assert told == "sensor"
    assert (
        f"electrical. The channel is uncertain: the one reported is the sensor channel, because {why}."
        in page.document()
    )
    advice = outcome.advice(found)
    assert f"a second sensor, because {why}; the channel is uncertain, as the " in advice
    assert advice.endswith(
        f"the {'residual is largest where the ' * disturbance}electrical channel "
        f"{'acts' if disturbance else 'explains most of it'}."
    )


def test_a_channel_that_all_tell_is_not_uncertain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outcome, "implausible", lambda plant, fitted: [])
    found, page = isolated(True, shifted=False), Page("a", "b")
    close_loop._channels(page, found, outcome.channel(found))
    assert "uncertain" not in page.document() + outcome.advice(found)
    assert outcome.advice(found).endswith("because the residual is largest where the electrical channel acts.")


@pytest.mark.parametrize(("evidence", "nearly"), [(1907.0, True), (907.0, False)])
def test_channels_that_explain_nearly_as_much_are_told(evidence: float, nearly: bool) -> None:
    """A laser that heard the amplifier was to be sought in the pressure alone: 1990 beside 1907."""
    found = Isolation("pressure", {"pressure": 1990.0, "sensor": evidence}, {}, False)
    assert ("and the sensor channel nearly as much" in outcome.isolated_words(found)) == nearly
    acts = outcome.isolated_words(Isolation("pressure", {"pressure": 1990.0, "sensor": evidence}, {}, True))
    assert acts.endswith("where the sensor channel does") == nearly


@pytest.mark.parametrize(("equal", "told"), [("stiffness_drift", "sensor"), ("permittivity_drift", "electrical")])
def test_among_equals_the_channel_is_the_one_that_the_isolation_finds(equal: str, told: str) -> None:
    """A leak at a capacitor was to be sought with a second sensor of the source, where one of its equals acts."""
    found = isolated(False, shifted=False)
    found.verdict, found.chosen = "ambiguous", made_up.option("sensor_delay")
    found.study.catalogue, found.equivalent = PLANT.catalogue, {"sensor_delay": [equal]}
    assert outcome.channel(found) == told


@pytest.mark.parametrize(("far", "told"), [(["C_3"], "electrical"), (["C_2", "C_3"], "mechanical")])
def test_one_implausible_parameter_tells_no_channel(monkeypatch: pytest.MonkeyPatch, far: list[str], told: str) -> None:
    """C_3 hardly matters at moderate stretches, so that anything that is missing may move it."""
    monkeypatch.setattr(outcome, "implausible", lambda plant, fitted: far)
    assert outcome.channel(isolated(False, shifted=False)) == told


@pytest.mark.parametrize(("delay", "said"), [(-6e-3, 1), (6e-3, 0)])
def test_an_input_that_acts_before_it_is_recorded_is_said_to_do_so_in_no_fmu(delay: float, said: int) -> None:
    compiled = SimpleNamespace(model=lambda ids: with_effects(PLANT.model, ids))
    fitted = SimpleNamespace(values={"pressure_delay": delay})
    named = SimpleNamespace(ids=["pressure_delay"], fitted=fitted)
    told = remarks._early(SimpleNamespace(named=named, study=SimpleNamespace(compiled=compiled)))
    assert len(told) == said
    assert all("acts 6 ms before it is recorded" in t and "An FMU cannot look ahead" in t for t in told)


def test_a_parameter_that_is_not_determined_has_no_interval() -> None:
    parameter = {"value": 3.26e-9, "ci95": [6e-22, 1.7e22], "unit": "Pa.s"}
    assert "not determined" in parameter_row("eta_hoop", parameter, told=False)
    assert "not determined" not in parameter_row("eta_hoop", parameter)


def test_a_zero_that_cannot_be_one_is_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(between_files, "zero_spread", lambda study, name: 1e9)
    spread = {"measured_displacement": 1e-6, "pressure": 20.0}
    study = SimpleNamespace(plant=PLANT, firm=False, spread=spread, zero=lambda name: 30e-6 if name[0] == "m" else 20.0)
    found = {"study": study, "named": made_up.option(excess=0.0, z_slow=0.0)}
    said = between_files.spread(SimpleNamespace(**found, shifted=Shift("measured_displacement", "trap1", 654e-6)))
    assert len(said) == 1 and said[0].startswith("The zero of pressure")
    assert len(between_files.spread(SimpleNamespace(**found, shifted=None))) == 2


def test_a_zero_beside_what_the_model_lacks_is_not_said_to_be_the_monitors(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where more than noise is left, zeros make up for it."""
    monkeypatch.setattr(between_files, "zero_spread", lambda study, name: 1e9)
    study = SimpleNamespace(plant=PLANT, firm=False, spread={"pressure": 20.0}, zero=lambda name: 20.0)
    (said,) = between_files.spread(SimpleNamespace(study=study, named=made_up.option(excess=4e3), shifted=None))
    assert said.startswith("In the fits the zero of pressure") and "make up for what the model lacks" in said


@pytest.mark.parametrize(("name", "follows", "told"), [("a", "", True), ("a", "one", False), ("b", "", False)])
def test_files_of_one_specimen_belong_together_where_what_was_found_outlasts_them(
    name: str, follows: str, told: bool
) -> None:
    """The order of files is asked for, unless it is known or does not matter."""
    catalogue = {n: replace(PLANT.catalogue["mullins_softening"], lasting=n == "a") for n in "ab"}
    files = [SimpleNamespace(follows=""), SimpleNamespace(follows=follows)]
    found = SimpleNamespace(
        named=SimpleNamespace(ids=(name,)),
        study=SimpleNamespace(catalogue=catalogue),
        recordings=SimpleNamespace(experiments=files),
    )
    assert bool(between_files.in_a_row(found)) == told


def test_parameters_that_may_be_exchanged_are_plausible_in_each_others_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """A branch that is declared as the other one is not implausible; one that is like neither is."""
    known = PLANT.model.parameter_values()
    monkeypatch.setattr(parameters, "interval", lambda fitted, n: (0.98 * fitted.values[n], 1.02 * fitted.values[n]))

    def far(k_2: float) -> list[str]:
        fitted = SimpleNamespace(values={"k_2": k_2, "C_1": known["C_1"]}, names=("k_2", "C_1"))
        return parameters.implausible(PLANT, fitted)

    assert far(known["k_1"]) == []
    assert far(10 * known["k_1"]) == ["k_2"]


def test_an_error_beyond_the_sensors_noise_is_said_to_be_that_of_the_monitors() -> None:
    """Or of edges between samples, where what the monitors add is too little to be the reason."""

    def said(rmse: float, allowed: float, verdict: str = "no_effect", added: float = 10e-6) -> list[str]:
        study = SimpleNamespace(plant=PLANT)
        named = SimpleNamespace(ids=(), lack_of_fit=made_up.option(z_slow=0.0).lack_of_fit)
        sensors = {PLANT.outputs[0].name: {"rms": 12e-6, "allowed": allowed, "from_monitors": added}}
        monitors = {"pressure": {"rms": 125.0}, "voltage": {"rms": 0.0}}
        outcome = {"noise": {"sensors": sensors, "monitors": monitors}, "error": {"after": {"rmse": rmse}}}
        return in_short._driven(SimpleNamespace(verdict=verdict, study=study, named=named), outcome)

    (sentence,) = said(15.8e-6, 20e-6)
    assert "the noise of pressure drives" in sentence
    (sentence,) = said(15.8e-6, 20e-6, added=3e-6)
    assert "where inputs change" in sentence
    assert said(12.1e-6, 20e-6) == said(15.8e-6, 12e-6) == said(15.8e-6, 20e-6, "unexplained") == []


def test_a_zero_as_far_apart_as_it_may_be_is_no_estimate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(between_files, "zero_spread", lambda study, name: 390.0)
    study = SimpleNamespace(plant=PLANT, firm=False, spread={"pressure": 1e9}, zero=lambda name: 130.0)
    named = made_up.option(excess=0.0, z_slow=0.0)
    (said,) = between_files.spread(SimpleNamespace(study=study, named=named, shifted=None))
    assert "do not tell" in said and "2.93 mmHg" in said


def test_what_delay_the_errors_allow_for_is_said_once(monkeypatch: pytest.MonkeyPatch) -> None:
    delays = {"now": {"load": "3 ms (1 samples) late"}, "before": {"load": "1 ms (0.3 samples) late", "flow": "early"}}
    monkeypatch.setattr(remarks, "_delays", lambda study, option: delays[study])
    search, named = SimpleNamespace(base_study="before"), SimpleNamespace(ids=("lag",))
    found = SimpleNamespace(named_study="now", named=named, base=None, search=search, verdict="effect_found")
    now, before = remarks._late(found)
    assert now.startswith("The recorded load was found to be 3 ms (1 samples) late")
    assert before.startswith("The error before allows for a recorded flow that is early")
    found.verdict, named.ids = "unexplained", ()
    (now,) = remarks._late(found)
    assert now.startswith("In the fit the recorded load is 3 ms (1 samples) late") and "may make up" in now


def test_what_explains_less_well_is_said_to() -> None:
    """A lag of a tachometer: a delay, which leaves 1.17 times the noise, was said to explain as well."""
    excess = {"lag": 0, "slew": 9, "stop": 200, "creep": 5e3}
    lag, *rivals = (made_up.option(name, excess=more) for name, more in excess.items())
    search = SimpleNamespace(rivals=rivals)
    found = SimpleNamespace(chosen=lag, search=search, repeated=False)
    alike, nearly, worse = in_short._in_its_place(found, {"id": "lag", "equivalent": ["slew", "stop", "creep"]})
    said = "It may also be stop, which explains the recordings nearly as well: worse by more than chance"
    assert nearly.startswith(said)
    assert alike == "It may equally be slew, which explains the recordings as well."
    assert "it may also be creep (1." in worse and "what lag leaves" in worse
    assert in_short._in_its_place(found, {"id": "lag", "equivalent": []}) == []


def test_of_many_that_explain_as_well_a_few_are_listed() -> None:
    """A buck converter's second effect had twenty others in its place, and the headline named them all."""
    names = [f"law{n}" for n in range(9)]
    search = SimpleNamespace(rivals=[made_up.option(name, excess=0) for name in names])
    found = SimpleNamespace(chosen=made_up.option("lead", excess=0), search=search, repeated=False)
    alike, told = in_short._in_its_place(found, {"id": "lead", "equivalent": names})
    assert "law0, law1, law2, law3 and 5 more, which explain the recordings as well" in alike
    assert told == "So these recordings hardly tell what it is."
    assert either(names) == "law0 or law1 or law2 or law3 or one of 5 more" and either(names[:2]) == "law0 or law1"


def test_the_verdict_says_for_which_effect_another_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    def said(equivalent: dict[str, list[str]], *strained: str) -> str:
        one = made_up.option(*equivalent)
        study = SimpleNamespace(catalogue=PLANT.catalogue, plant=PLANT)
        word = "partly_explained" if equivalent else "no_effect"
        line = made_up.option("pneumatic_line", *[n for n in equivalent if n != "sensor_lag"], excess=200)
        return close_loop.headline(
            SimpleNamespace(
                verdict=word if strained else "ambiguous",
                chosen=one,
                named=one,
                base=one,
                study=study,
                search=SimpleNamespace(rivals=[line]),
                equivalent=equivalent,
                wandering=None,
                strained=strained,
            ),
            {"noise": {"sensors": {}}, "error": {"after": NO_FILES}},
        )

    two = said({"sensor_lag": ["sensor_delay", "pneumatic_line"], "sensor_drift": []})
    assert ", or sensor_delay or pneumatic_line in place of sensor_lag: these recordings cannot" in two
    assert two.endswith(
        "cannot distinguish them for certain: pneumatic_line fits less well, as even the right law may, because laws "
        "are seldom exact."
    )
    one = said({"sensor_lag": ["sensor_delay"]})
    assert ", or sensor_delay in place of it: these" in one and one.endswith("distinguish them.")
    strained = said({"rigid_stop": []}, "C_2", "C_3")
    assert "or something that is in no catalogue: C_2 and C_3 would be implausible" in strained
    monkeypatch.setattr(close_loop, "thin", lambda found: "")
    assert said({}, "C_3") == "nothing is seen to be missing, but C_3 would be implausible: something may hide in it."


@pytest.mark.parametrize(
    ("waves", "wandering", "little", "said"),
    [
        ([], None, "", "nothing is missing"),
        ([{"hz": 1.495}], None, "", "at 1.495 Hz"),
        ([], ("a", 1e-6), "", "slowly drifting zero"),
        ([], None, "there is only one experiment", "these recordings prove little: there is only one experiment"),
    ],
)
def test_nothing_is_missing_only_where_nothing_else_is_told(
    waves: list, wandering: object, little: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(close_loop, "thin", lambda found: little)
    study, one = SimpleNamespace(catalogue=PLANT.catalogue, plant=PLANT), made_up.option(excess=0.0)
    found = SimpleNamespace(
        verdict="no_effect",
        chosen=one,
        named=one,
        base=one,
        study=study,
        equivalent={},
        wandering=wandering,
        search=None,
        strained=(),
    )
    found.search = SimpleNamespace(withdrawn={}, rounds=[])
    told = close_loop.headline(
        found, {"noise": {"sensors": {"flow": {"oscillations": waves}}}, "error": {"after": NO_FILES}}
    )
    assert said in told and ("nothing is missing" in told) == (not waves and wandering is None and not little)


@pytest.mark.parametrize(
    ("pinned", "excess", "said"),
    [
        ((), 700.0, " (nearest: leakage; 7% of what is not noise stays)"),
        (("leakage",), 700.0, " (nearest: leakage, with an implausible strength; 7% of what is not noise stays)"),
        ((), 10_000.0, ""),  # no better than the base: it has a parameter more
    ],
)
def test_an_unexplained_residual_names_the_nearest_that_was_tried(
    pinned: tuple[str, ...], excess: float, said: str
) -> None:
    base, tried = made_up.option(excess=10_000.0), made_up.option("leakage", excess=excess, pinned=pinned)
    search = SimpleNamespace(withdrawn={}, rounds=[SimpleNamespace(options=[tried])])
    assert close_loop._nearest(SimpleNamespace(chosen=base, base=base, search=search)) == said
    search.withdrawn["lag"] = "beside the others it gains no more than chance can"
    assert "nearest: lag, but beside the others" in close_loop._nearest(
        SimpleNamespace(chosen=base, base=base, search=search)
    )


def test_samples_are_counted_once_whatever_is_read_in_them() -> None:
    def said(*outputs: str) -> str:
        case = Case(Protocol.of([0, 1]), tuple(Reading(o, np.linspace(0, 1, 50)) for o in outputs))
        return in_short._samples(SimpleNamespace(study=SimpleNamespace(pieces=[SimpleNamespace(case=case)] * 3)))

    assert said("speed") == "150 samples"
    assert said("speed", "angle") == "150 samples of 2 outputs"


def test_the_noise_is_told_as_an_estimate() -> None:
    noise = {PLANT.outputs[0].name: SimpleNamespace(quiet=True)}
    found = SimpleNamespace(study=SimpleNamespace(plant=PLANT, noise=noise), recordings=SimpleNamespace(noise={}))
    said = in_short.least(found)
    assert "about as small as" in said and "an estimate" in said
    found.recordings.noise["radius"] = 15e-6
    assert in_short.least(found) == "The sensor's noise is as bench.toml states it."


def test_what_noise_and_sampling_allow_is_explained_beside_its_size() -> None:
    page, one = Page("a", "b"), made_up.option()
    first = PLANT.outputs[0].name
    study = SimpleNamespace(plant=PLANT, noise={first: Noise(17.5e-6, 0.78)})
    found = SimpleNamespace(base=one, chosen=one, study=study, search=SimpleNamespace(rounds=[]), isolated=None)
    found.recordings = SimpleNamespace(noise={})
    told = found.__dict__ | {"numeric": 0.0, "held_ratio": 1.0, "tests_before": WHITE, "tests_after": WHITE}
    noise = {"rms": 17.5e-6, "correlation": 0.78, "from_monitors": 4e-6, "allowed": 71.4e-6}
    errors = {name: {"rmse": 17e-6} for name in ("recalibrated", "after")}
    content = {"noise": {"sensors": {first: noise}}, "error": errors, "noise_floor": 17.5e-6}
    close_loop._trace(page, SimpleNamespace(**told), content | {"residual": {"channel": None}})
    text = page.document()
    assert "sample by sample, with what noise and sampling allow, of three parts" in text
    assert f"residual is {one.lack_of_fit.ratio:.2f} times all that (rms), with what is named" in text
    assert "71.4 um" not in text  # a few samples near edges dominate it: it may be more than any error beside it
    assert "near its edges" in text


@pytest.mark.parametrize(("quiet", "excess", "certain"), [(True, 4e3, True), (False, 4e3, False), (False, 4e5, True)])
def test_what_may_be_noise_is_not_certain(quiet: bool, excess: float, certain: bool) -> None:
    """Where no part is quiet, twice the noise that could be estimated may be noise; many times is not."""
    study = SimpleNamespace(plant=PLANT, noise={PLANT.outputs[0].name: Noise(9e-6, 0.0, quiet=quiet)})
    found = SimpleNamespace(verdict="unexplained", study=study, named=made_up.option(excess=excess), wandering=None)
    found.strained, found.unlike = (), None
    assert ("certain" in in_short._confidence(found)) == certain


def what_is_left(verdict: str, one: Option, whiteness: float, widening: float = 1.0) -> list[str]:
    tests = {"whiteness": whiteness, "widening": widening}
    base = of_size(made_up.option(excess=1e6), 2.7e-3)
    found = SimpleNamespace(verdict=verdict, named=one, base=base, wandering=None, tests_after=tests)
    errors = {"after": {"rmse": 104e-6, "unit": "m"}, "recalibrated": {"rmse": 2.8e-3, "unit": "m"}}
    return in_short._left(found, {"error": errors, "noise_floor": 98.6e-6})


def test_a_small_remainder_is_told_with_its_size() -> None:
    small = of_size(made_up.option("lag", excess=1200.0, z_slow=13.2), 32.5e-6)
    (said,) = what_is_left("ambiguous", small, 18.6)
    assert said == "A small remainder is left: 32.5 um rms beyond the noise, where 2.7 mm was before."
    assert what_is_left("partly_explained", small, 18.6) == []  # the verdict tells it


def test_a_remainder_of_held_out_experiments_alone_is_said_to_be_theirs() -> None:
    left = {"output": "measured_displacement", "rms": 541e-6, "unit": "m", "share": 0.42}
    found = SimpleNamespace(study=SimpleNamespace(plant=PLANT))
    assert close_loop._left_words(found, left | {"held_out": False}) == "541 um rms, 42% of what was not noise"
    said = close_loop._left_words(found, left | {"held_out": True})
    assert said == "541 um rms on held-out experiments, 42% of what was not noise there"
    current = left | {"output": "current", "rms": 4.1e-6, "held_out": False}  # it stays there, though no radius tells
    assert close_loop._left_words(found, current) == "4.1 uA rms of current, 42% of what was not noise"


def test_a_residual_that_is_not_white_is_not_said_to_look_like_noise() -> None:
    quiet = made_up.option(z_slow=2.5)
    assert what_is_left("no_effect", quiet, 2.8) == []
    (said,) = what_is_left("no_effect", quiet, 175.0, 2.24)
    assert "not white" in said and "take them as about 2.2 times as wide." in said
    (said,) = what_is_left("effect_found", quiet, 3.5)
    assert said.endswith("so intervals may not be exact.") and "1/f" not in said
    assert "looks like noise" not in " ".join(in_short.CONFIDENCE.values())
    assert left(quiet, quiet, "after", 5e-6, 175.0) == "it is no larger than the noise, but not white"


def test_standard_errors_are_wider_by_what_neighbours_have_in_common() -> None:
    noise = np.random.default_rng(1).standard_normal(20_000)
    assert residuals.widening(noise) == pytest.approx(1.0, abs=0.1)
    smooth = np.convolve(noise, np.ones(4) / 4, mode="valid")  # four in a row tell as much as one
    assert residuals.widening(smooth) == pytest.approx(2.0, rel=0.1)


def test_the_summary_gives_no_number_that_is_not_determined() -> None:
    def said(**intervals: tuple[float | None, float | None]) -> str:
        estimates = {n: {"value": 1.0, "unit": "1", "ci95": ends} for n, ends in intervals.items()}
        effect = PLANT.catalogue["hoop_viscoelasticity"]
        return effects.size_words(effect, {"parameters": estimates}, PLANT.model)

    wide = said(eta_hoop=(4820.0, 7600.0), k_hoop=(-18.5e3, 11.7e3), tau_hoop=(8.21e-3, 9.58))
    assert wide.startswith("damping in hoop direction = 1 (95 % interval 4820 to 7600); not determined")
    assert wide.endswith("recordings: stiffness of the hoop direction's Maxwell branch, relaxation time of that branch")
    assert "not determined" not in said(k_hoop=(-18.5e3, -1e3), tau_hoop=(0.1, 9.58))
    assert "not determined" not in said(tau_hoop=(0.1, None))  # another sentence tells what an open end means


def test_a_share_that_is_all_of_it_is_no_bound() -> None:
    def said(name: str) -> list[str]:
        content = {"converged": True, "undetermined": [], "at_bounds": {name: "largest"}, "slow_noise_unknown": False}
        model = add_effects(PLANT, ["amplifier_slew"])
        return identify.IdentificationResult.remarks(SimpleNamespace(model=model, content=content, verdict="adequate"))

    assert said("slew_share") == []
    assert said("lambda_2_start")[0].startswith("lambda_2_start ended at the largest value that the model allows, 3:")


def test_a_legend_lies_between_the_toolbar_and_the_plot() -> None:
    page, loop = Page("a", "b"), (np.array([50.0, 90.0]), np.array([10.0, 80.0]))
    loops = assist.plotly_loops({"without assist": loop, "with assist": loop})
    page.figure(loops, "Two loops.")
    both = page.document()
    assert '"legend":{"orientation":"h","x":0,"y":1,"yanchor":"bottom"}' in both and '"t":64,' in both
    page.figure(go.Figure(go.Scatter(x=[1], y=[1])), "One.")
    one = page.document()[len(both) - len("</body></html>\n") :]
    assert '"legend"' not in one.split('"template"')[0] and '"t":30,' in one


def test_numbers_and_names_are_written_as_people_read_them() -> None:
    assert [three(v) for v in (967.0, 1024.0, 0.0012, 2.5e7)] == ["967", "1020", "0.0012", "2.5e+07"]
    assert in_words(999.9e-6, "m") == "1000 um"
    assert in_words(999.9e-6, "m", "mm") == "1000 um"
    assert in_words(266.6, "Pa", "mmHg") == "2 mmHg"
    assert in_words(2e-6, "m3/s", "mL/s") == "2 mL/s"
    assert in_words(0.5, "K", "degC") == "500 mK"
    assert with_ends(0.28, (0.2, 0.36)) == ["0.28", "0.2", "0.36"]
    assert with_ends(1.27770, (1.27750, 1.27790)) == ["1.2777", "1.2775", "1.2779"]  # three digits would be the same
    assert with_ends(5.04e-15, (0.0, 0.98)) == ["0", "0", "0.98"]
    assert with_ends(0.3, (0.1, None)) == ["0.3", "0.1", "open"]
    assert with_ends(2.0, (2.0, 2.0)) == ["2", "2", "2"]
    assert effects._label("p_C", "Pa") == "p_C [Pa]"
    figure = next(f for f in course.INDICES if f.name == "end_diastolic_volume")
    a, b = (course.Spread(mean=v, deviation=0.0, worst=v, beats=3) for v in (242.10e-6, 242.09e-6))
    told = SimpleNamespace(without={figure.name: a}, assisted={figure.name: b}, change=lambda name: -1e-5)
    assert course._row(figure, told)[-1] == "0.0 (0.0 %)"


def test_a_tube_that_shrinks_says_so() -> None:
    outputs = {"electric_field": np.zeros(2), "snap_through_margin": np.ones(2)}
    shrunk = outputs | {"radial_displacement": np.array([0.0, -1.2e-3])}
    (said,) = simulate.SimulationResult._fold(shrunk)
    assert said.startswith("smallest displacement -1.200 mm (inward), largest displacement 0.000 mm")


def test_where_nothing_explains_the_records_what_was_not_fitted_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mass declared a thousand times too large is no effect, and no fit may change it."""
    for is_far, verdict in ((True, "unexplained"), (False, "unexplained"), (True, "effect_found")):
        monkeypatch.setattr(remarks, "far", lambda option, is_far=is_far: is_far)
        recordings = SimpleNamespace(geometry={"h_o": 0.002})
        found = SimpleNamespace(verdict=verdict, named=None, study=SimpleNamespace(plant=PLANT), recordings=recordings)
        said = remarks._as_declared(found)
        assert bool(said) == (is_far and verdict == "unexplained")
        if said:
            assert "and not fitted: l_o = 24.5 mm, r_o = 15 mm, h_o = 2 mm" in said[0] and "C_1" not in said[0]


def test_a_report_is_written_where_the_base_has_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tube that softens: the base refitted without it had no equilibrium to start at, after a search of 7 minutes."""
    aorta = td.load_plant("aorta")
    probe = replace(aorta, places=aorta.places[:1], own={})
    late = td.add_effects(probe, ["flow_delay"], flow_delay="30 ms", p_C_start="75 mmHg")
    noise, tables = np.random.default_rng(3), {}
    for name, peak in {"low": 2e-4, "middle": 3e-4, "high": 4e-4}.items():
        flow = [0, peak, 0, 0, 1.5 * peak, 0, 0, peak, 0, 0]
        run = td.simulate(late, td.Protocol.of([0, 0.1, 0.3, 0.9, 1.0, 1.3, 1.7, 1.8, 2.0, 3.0], flow=flow))
        read = run["pressure"] + 30 * noise.standard_normal(run.time.size)
        tables[name] = {"time [s]": run.time, "flow [m3/s]": run["flow"], "pressure [Pa]": read}
    found = td.discover(td.read_recordings(tables, probe))
    assert [e.id for e in found.effects] == ["flow_delay"]
    whole = close_loop.report(found.discovery, found.to_dict()).document()
    answers = drawn_residuals._answers
    monkeypatch.setattr(
        drawn_residuals, "_answers", lambda study, ids, values: answers(study, ids, values) if ids else None
    )
    assert {name for one in drawn_residuals.answered(found.discovery) for name in one.models} == {"after"}
    without = close_loop.report(found.discovery, found.to_dict()).document()
    assert "flow_delay: the residual" in whole and "flow_delay: the residual" not in without


@pytest.mark.parametrize(
    ("slow", "errors", "said"),
    [(11.8, (8.1, 8.0, 7.9, 20.2), True), (1.0, (8.1, 8.0, 7.9, 20.2), False), (11.8, (8.1, 8.0, 7.9, 9.0), False)],
)
def test_slow_noise_that_one_file_has_alone_is_not_called_nothing(
    slow: float, errors: tuple[float, ...], said: bool
) -> None:
    """Electrodes that lose contact showed in the pulses of 5 kV alone, and the page said that nothing is missing."""
    each = {f"rec{n}": {"rmse": 1e-6 * rms} for n, rms in enumerate(errors)}
    state = SimpleNamespace(z_slow=slow, z_total=0.5)
    found = SimpleNamespace(verdict="no_effect", strained=(), named=SimpleNamespace(lack_of_fit=state))
    why = between_files.in_few_files(found, {"unit": "m", "per_experiment": each})
    assert why == ("rec3 has an error of 20.2 um, the others of 8.05 um" if said else "")


def test_what_cannot_be_is_no_explanation_that_can_be_told() -> None:
    """A preload beyond its bounds "can be told", with 0 in log evidence of which 5 is very strong."""
    rows = [
        {"effects": ["power"], "evidence": 100.0, "ratio": 0.66, "implausible": []},
        {"effects": ["preload"], "evidence": 100.0, "ratio": 0.66, "implausible": ["preload"]},
        {"effects": ["lag"], "evidence": 60.0, "ratio": 0.7, "implausible": []},
    ]
    outcome = {"effects": [{"id": "power", "equivalent": []}], "ranking": rows}
    (said,) = in_short._rivals(outcome)
    assert "preload" not in said and "lag" in said and "40 in log evidence" in said
    assert in_short._rivals(outcome | {"ranking": rows[:2]}) == []


@pytest.mark.parametrize(
    ("ends", "said"), [({"tau_e_stretch": 1, "electrode_line": -1}, 1), ({"tau_e_stretch": 1}, 0), ({}, 0)]
)
def test_a_law_that_fits_only_at_the_ends_of_its_form_is_uncertain(ends: dict[str, int], said: int) -> None:
    """A damping that acts only under voltage was electrodes whose lag grows with the tenth power of the stretch."""
    named = SimpleNamespace(ids=("electrode_resistance",), fitted=SimpleNamespace(at_bounds=lambda: ends))
    told = reservations.forced(SimpleNamespace(study=FOUND.study, named=named))
    assert len(told) == said
    assert all("at the ends of what tau_e_stretch and electrode_line may be" in words for words in told)


@pytest.mark.parametrize(("known", "loose", "told"), [(10.0, True, True), (600.0, True, False), (10.0, False, False)])
def test_what_is_slower_than_the_records_and_free_at_their_start_is_told(known: float, loose: bool, told: bool) -> None:
    """A voltage of 260 V that never changes was a trap of 980 s with 58 kV in it, "distinguished from every rival"."""
    model = {ids: add_effects(PLANT, ids) for ids in ((), ("charge_trapping",))}
    piece = SimpleNamespace(
        case=SimpleNamespace(times=np.array([0.0, 28.0])),
        nuisances=SimpleNamespace(names=("start trapped_voltage_off_at_start",) if loose else ("voltage",)),
    )
    study = SimpleNamespace(
        pieces=[piece], catalogue=PLANT.catalogue, compiled=SimpleNamespace(model=lambda ids: model[tuple(ids)])
    )
    option = made_up.option("trap_fraction", "tau_trap")
    values = option.fitted.values | {"trap_fraction": 0.005, "tau_trap": 984.0}
    scaled = np.array([1.0, 0.005, 984.0])
    spread = np.diag([0.01, 1e-8, known**2])
    fitted = replace(option.fitted, values=values, scaled=scaled, covariance=spread)
    named = SimpleNamespace(ids=("charge_trapping",), fitted=fitted)
    found = SimpleNamespace(named_study=study, named=named)
    said = reservations.from_the_start(found)
    assert len(said) == told
    if told:
        assert "charge_trapping is slower (tau_trap) than the longest recording (28 s)" in said[0]


def test_errors_are_drawn_of_every_output_that_takes_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """A current that stands still in every file has an error, and no noise of its own: the report was a traceback."""
    monkeypatch.setattr(in_short, "least", lambda found: "")
    monkeypatch.setattr(in_short, "about_held_out", lambda found, errors: [])
    one = {"rmse": 2e-6, "held_out_rmse": None, "unit": "m", "display_unit": "um"}
    errors = one | {"outputs": {"radius": one, "current": one, "flow": one}}
    sensors = {"radius": {"rms": 1e-6}, "flow": {"rms": 1e-6}}
    outcome = {
        "effects": [],
        "held_out": [],
        "error": {"recalibrated": errors, "after": errors},
        "noise": {"sensors": sensors},
        "noise_floor": 1e-6,
    }
    plant = SimpleNamespace(outputs=[SimpleNamespace(name="radius", headings=("radius",))])
    drawn = in_short._errors(SimpleNamespace(study=SimpleNamespace(plant=plant)), outcome)
    assert [caption.rstrip(". ").split()[-1] for _, caption in drawn] == ["refitted", "flow"]
