"""What a report says, sentence by sentence, on made-up results."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import plotly.graph_objects as go
import pytest

from tubular_dea.api import identify, simulate
from tubular_dea.cosim import course
from tubular_dea.model.units import in_words, three
from tubular_dea.plants.tube import PLANT
from tubular_dea.report import assist, close_loop, effects, in_short
from tubular_dea.report.page import Page

FOUND = SimpleNamespace(study=SimpleNamespace(catalogue=PLANT.catalogue))


def hidden(invisible: dict[str, dict[str, float | None]]) -> str:
    return " ".join(in_short._hidden(FOUND, {"invisible": invisible}))


def table(invisible: dict[str, dict[str, float | None]]) -> str:
    page = Page("a", "b")
    in_short.not_seen(page, FOUND, {"invisible": invisible})
    return page.document()


def test_limits_say_which_side_was_seen_and_what_they_limit() -> None:
    effect = PLANT.catalogue["pressure_gain"]
    said = hidden({"pressure_gain": {"pressure_gain": 0.05}})
    (meaning,) = (q.description for q in effect.parameters if q.name == "pressure_gain")
    assert f"pressure_gain ({meaning[0].lower()}{meaning[1:]}: within 0.05 of 1). Stronger ones" in said
    assert "Larger" not in said


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
    found = SimpleNamespace(study=SimpleNamespace(plant=PLANT, held_out=held), shifted=None)
    errors = {"rmse": 15e-6, "held_out_rmse": 16e-6, "unit": "m"}
    told = {"published": errors, "recalibrated": errors, "after": errors}
    first, second, third = close_loop.error_lines(found, told)
    assert "held out (ramp, second half) 16 um" in first
    assert second == "these recordings prove little: there is only one experiment"
    assert third == "load barely moves in any experiment: what it does is not tested"
    better = errors | {"held_out_rmse": 15.2e-6}
    _, declared, *_ = close_loop.error_lines(found, told | {"published": better})
    assert declared == "As declared, without any refit, the model predicts what was held out to 15.2 um."


def test_a_drift_of_the_sensor_is_no_residual_that_looks_like_noise() -> None:
    def said(verdict: str, wandering: tuple[str, float] | None) -> str:
        return in_short._confidence(SimpleNamespace(verdict=verdict, wandering=wandering))

    assert said("no_effect", None) == in_short.CONFIDENCE["no_effect"]
    assert "zero drifts slowly" in said("no_effect", ("ramp", 5e-6))
    assert said("effect_found", ("ramp", 5e-6)) == in_short.CONFIDENCE["effect_found"]


def test_a_parameter_that_is_not_determined_is_told_in_the_unit_of_its_uncertainty() -> None:
    def said(value: float, stderr: float) -> str:
        return identify._estimate("C_3", SimpleNamespace(value=value, stderr=stderr, unit="Pa"))

    assert said(0.129874, 4600.0) == "C_3      0.000129874 +- 4.6 kPa"
    assert said(3086.4, 130.0) == "C_3      3.0864 +- 0.13 kPa"
    assert said(3086.4, float("inf")) == "C_3      3.0864 +- inf kPa"


def test_a_legend_lies_between_the_toolbar_and_the_plot() -> None:
    page, loop = Page("a", "b"), (np.array([50.0, 90.0]), np.array([10.0, 80.0]))
    loops = assist.plotly_loops({"without assist": loop, "with assist": loop})
    page.figure(loops, "Two loops.")
    assert (loops.layout.legend.orientation, loops.layout.legend.yanchor, loops.layout.margin.t) == ("h", "bottom", 64)
    alone = go.Figure(go.Scatter(x=[1], y=[1]))
    page.figure(alone, "One.")
    assert alone.layout.margin.t == 30


def test_numbers_and_names_are_written_as_people_read_them() -> None:
    assert [three(v) for v in (967.0, 1024.0, 0.0012, 2.5e7)] == ["967", "1020", "0.0012", "2.5e+07"]
    assert in_words(999.9e-6, "m") == "1000 um"
    assert effects._label("p_C", "Pa") == "p_C [Pa]"
    figure = next(f for f in course.FIGURES if f.name == "end_diastolic_volume")
    a, b = (course.Spread(mean=v, deviation=0.0, worst=v, beats=3) for v in (242.10e-6, 242.09e-6))
    told = SimpleNamespace(without={figure.name: a}, assisted={figure.name: b}, change=lambda name: -1e-5)
    assert course._row(figure, told)[-1] == "+0.0 (+0.0 %)"


def test_a_tube_that_shrinks_says_so() -> None:
    outputs = {"electric_field": np.zeros(2), "snap_through_margin": np.ones(2)}
    shrunk = outputs | {"radial_displacement": np.array([0.0, -1.2e-3])}
    (said,) = simulate.SimulationResult._fold(shrunk)
    assert said.startswith("smallest displacement -1.200 mm (inward), largest displacement 0.000 mm")
