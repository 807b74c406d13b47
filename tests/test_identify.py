"""Identification: exact Jacobian, the truth recovered from Tables II and III, intervals, what is not determined."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import tubular_dea as td
from blind import bench, coverage
from tubular_dea.api import identify as estimates
from tubular_dea.cli import main
from tubular_dea.commands.identify import _to_find as to_find
from tubular_dea.discover.scores.parameters import base_parameters
from tubular_dea.identify.fitting.fit import Fit, begun_at_bounds, fit, goodness, inverse, search
from tubular_dea.identify.fitting.intervals import interval, profile_interval
from tubular_dea.identify.fitting.misfit import ResidualOverNoise, residual_over_noise
from tubular_dea.identify.fitting.problem import Free, Problem
from tubular_dea.identify.records.data import read_folder
from tubular_dea.identify.study import procedure
from tubular_dea.identify.study.adjust import adjusted
from tubular_dea.identify.study.study import Study, study
from tubular_dea.model.dea import IDENTIFIED, tubular_dea
from tubular_dea.plants import Build, Input, Output, Plant
from tubular_dea.plants.saved import ModelFileError, as_json, load
from tubular_dea.plants.tube import PLANT, TABLE_II
from tubular_dea.sweep.models import calibrated

EXAMPLE = Path(__file__).resolve().parents[1] / "cosim_examples" / "data" / "bench"
RAMPS_AND_STEPS = ["01_ramp_4kV", "02_step_4kV", "04_ramp_7kV", "05_pressure_steps"]


@pytest.fixture(scope="module")
def null(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, bench.Tube]:
    """Recordings of the independent bench in which nothing is missing, and the tube that made them."""
    folder = tmp_path_factory.mktemp("null") / "data"
    tube = bench.draw(3, "none")
    return bench.write(tube, folder, 3, RAMPS_AND_STEPS), tube


@pytest.fixture(scope="module")
def work(null: tuple[Path, bench.Tube]) -> Study:
    return study(read_folder(null[0], PLANT), held_out=(), effects=False)


def test_jacobian_is_that_of_the_residuals(work: Study) -> None:
    start = tubular_dea().parameter_values()
    problem = work.problem((), procedure.free_parameters(PLANT.model, start), start, work.training[1:2])
    at = problem.scaled(start)
    _, jacobian = problem.linearised(at)
    for i in range(len(problem.free)):
        step = np.zeros(at.size)
        step[i] = 3e-3
        slope = (problem.residuals(at + step) - problem.residuals(at - step)) / 6e-3
        assert np.linalg.norm(slope - jacobian[:, i]) < 0.02 * np.linalg.norm(jacobian[:, i])


def test_a_model_that_rings_faster_than_is_sampled_is_not_followed(work: Study) -> None:
    problem = work.problem((), base_parameters(work.plant), {})
    usual = work.plant.model.parameter_values()
    ringing = problem.scaled(usual | {"eta_o": 1e-4 * usual["eta_o"]})
    problem.residuals(problem.scaled(usual))
    assert problem.response.steps < 0.5 * problem.response.most_steps
    assert np.all(np.isfinite(problem.residuals(ringing)))
    assert problem.response.steps > problem.response.most_steps
    assert np.all(np.isinf(problem.residuals(ringing, problem.response.most_steps)))
    assert search(problem, ringing, 1, most_steps=problem.response.most_steps) is None


def test_joint_fit_finds_the_tube_and_its_intervals_hold(work: Study, null: tuple[Path, bench.Tube]) -> None:
    _, first = procedure.joint(work, PLANT.model.parameter_values(), starts=1)
    work = adjusted(work, (), first.values, first.free)  # as the command does
    problem, best = procedure.joint(work, first.values, starts=1)
    assert best.converged
    assert best.cost / best.residual.size == pytest.approx(1, abs=0.05)
    truth = dict(zip([q.name for q in IDENTIFIED], null[1].identified, strict=True))
    apart = [abs(best.values[n] - truth[n]) / best.stderr[n] for n in truth]
    assert max(apart) < 5
    assert sum(a < 1.96 for a in apart) >= 6
    outputs = problem.response.outputs(best.values)
    assert goodness(problem.records, outputs) > 98


def test_the_faster_branch_is_called_the_first(work: Study) -> None:
    values = tubular_dea().parameter_values()
    exchanged = {n: values[PLANT.exchanges[0].pairs.get(n, n)] for n in values}
    problem = work.problem((), procedure.free_parameters(PLANT.model, exchanged), exchanged, work.training[1:2])
    found = procedure.ordered_fit(PLANT, problem, fit(problem, exchanged, evaluations=1))
    assert found.values["k_1"] / found.values["eta_1"] > found.values["k_2"] / found.values["eta_2"]
    residual, jacobian = problem.linearised(found.scaled)
    np.testing.assert_allclose(residual, found.residual, atol=0.02)
    information = jacobian.T @ jacobian
    np.testing.assert_allclose(found.jacobian.T @ found.jacobian, information, atol=1e-3 * information.max())
    spread = np.sqrt(np.diag(inverse(information)))
    for free, width in zip(problem.free, spread, strict=True):
        assert found.stderr[free.name] == pytest.approx(free.slope(found.values[free.name]) * width, rel=0.05)


def test_table_2_leads_to_the_answer(work: Study, null: tuple[Path, bench.Tube]) -> None:
    start = procedure.staged(work, PLANT.model.parameter_values() | TABLE_II)
    _, best = procedure.joint(work, start, starts=1)
    assert best.cost / best.residual.size == pytest.approx(1, abs=0.05)
    truth = dict(zip([q.name for q in IDENTIFIED], null[1].identified, strict=True))
    for name, value in truth.items():
        if best.stderr[name] < 0.015 * abs(value):
            assert best.values[name] == pytest.approx(value, rel=0.05), name
    assert {"C_1", "eps_r", "k_1"} <= {n for n, v in truth.items() if best.stderr[n] < 0.015 * abs(v)}


def test_profile_agrees_with_the_covariance_where_the_data_determine(work: Study) -> None:
    start = tubular_dea().parameter_values()
    free = procedure.free_parameters(PLANT.model, start, ["C_1", "eps_r", "eta_o"])
    problem = work.problem((), free, start, work.training[1:2])
    best = fit(problem, start)
    for near, far in zip(interval(best, "C_1"), profile_interval(problem, best, "C_1"), strict=True):
        assert abs(near - best.values["C_1"]) == pytest.approx(abs(far - best.values["C_1"]), rel=0.15)


def test_what_is_not_determined_is_named(work: Study) -> None:
    start = tubular_dea().parameter_values()
    pressure_only = [p for p in work.training if p.name == "05_pressure_steps"]
    problem = work.problem((), procedure.free_parameters(PLANT.model, start, ["C_1", "eps_r"]), start, pressure_only)
    assert fit(problem, start, evaluations=5).undetermined() == ["eps_r"]


def test_a_value_near_zero_is_determined_where_its_usual_size_is() -> None:
    """An offset of 1 Pa +- 5 Pa where 200 Pa are usual; a logarithmic parameter never is zero."""
    free = [Free("offset", 200.0), Free("far", 2.0), Free("decay", 200.0, logarithmic=True)]
    stderr = {"offset": 5.0, "far": 5.0, "decay": 5.0}
    nothing = np.zeros(0)
    best = Fit(dict.fromkeys(stderr, 1.0), nothing, 0.0, nothing, nothing, np.eye(3), free, stderr, True)
    assert best.undetermined() == ["far", "decay"]


def test_a_parameter_that_ended_at_its_bound_is_named() -> None:
    """A vessel that empties within 2 s, declared to take 1 s at most."""
    m = Build("Vessel")
    inflow = m.input("inflow", "m3/s", nominal=1.0)
    lasts = m.parameter("lasts", "s", 0.5, minimum=0.01, maximum=1.0)
    level = m.state("level", "m3", nominal=1.0)
    m.derivative(level, inflow - level / lasts)
    m.output("reading", "m3", level, nominal=1.0)
    time = np.arange(0.0, 8.0, 0.02)
    true = np.where(time < 1.0, 0.0, 2.0 * (1 - np.exp(-(time - 1.0) / 2.0)))
    noise = 1e-3 * np.random.default_rng(0).standard_normal(time.size)
    table = {"time [s]": time, "inflow [m3/s]": 1.0 * (time >= 1.0), "reading [m3]": true + noise}
    plant = Plant(m.model(), [Input("inflow", held=True)], [Output("reading")])
    found = td.identify(td.read_recordings({"filled": table}, plant=plant), starts=1)
    assert found.content["at_bounds"] == {"lasts": "largest"}
    assert any("lasts ended at the largest value that the model allows, 1 s" in said for said in found.remarks())


def test_linearised_intervals_hold() -> None:
    """Three tubes, one experiment of all; `python -m blind.coverage` counts enough of them for a figure."""
    ends = np.array([coverage.linearised(seed, ["02_step_4kV"]) for seed in range(3)])
    truth, found, low, high = np.moveaxis(ends, 2, 0)
    held = (np.minimum(low, high) <= truth) & (truth <= np.maximum(low, high))
    assert held.mean() > 0.85
    half = np.abs(high - low) / 2
    determined = half < np.abs(truth)
    off = 1.96 * (found - truth)[determined] / half[determined]  # standard errors: neither too small nor too large
    assert determined.sum() >= 21
    assert 0.5 < np.sqrt(np.mean(off**2)) < 1.3


@pytest.mark.long
def test_a_misfit_is_said(carried_out: Callable[..., Path]) -> None:
    out = carried_out("identify", str(EXAMPLE))
    said = out.with_suffix(".said").read_text(encoding="utf-8")
    lines = ("(+- standard error", "\nfit ", "\nthe model lacks something", "\nto find what it is", "\nwrote ")
    places = [said.index(line) for line in lines]
    assert places == sorted(places), "advice comes after what was found"
    assert re.search(r"^eta_1 .* (k|M)Pa\.s(, \S+ to \S+ \(95 %\))?$", said, re.MULTILINE) and re.search(
        r"the sensor\'s noise: \S+ um\)", said
    )
    content = json.loads((out / "parameters.json").read_text())
    assert content["verdict"] == "misfit"
    assert content["residual_over_noise"] > 1.1


def test_no_misfit_is_said_where_there_is_none(work: Study) -> None:
    problem, best = procedure.joint(work, PLANT.model.parameter_values(), starts=1)
    assert not residual_over_noise(problem, best).significant


def test_slow_noise_of_a_monitor_widens_intervals(work: Study) -> None:
    """A line follows what moves its monitor slowly, and so does the model."""
    slow = replace(work, monitor_noise=work.monitor_noise | {"pressure": 400.0})
    (_, known), (_, wider) = (
        procedure.joint(w, PLANT.model.parameter_values(), starts=1, names=["C_1"]) for w in (work, slow)
    )
    assert wider.values["C_1"] == known.values["C_1"]
    assert wider.stderr["C_1"] > 1.5 * known.stderr["C_1"]


def test_slow_noise_that_no_stretch_tells_is_said_in_place_of_a_misfit() -> None:
    """A servo valve that never rests: close-loop says no_effect there, and identify must not say otherwise."""
    known, unknown = ResidualOverNoise(1.03, 7.4, 2.0), ResidualOverNoise(1.03, 7.4, 2.0, coloured=1.4)
    assert known.significant and not known.may_be_slow_noise
    assert unknown.may_be_slow_noise and not unknown.significant
    assert ResidualOverNoise(1.6, 30.0, 20.0, coloured=1.4).significant


def test_command_writes_parameters_and_a_model(null: tuple[Path, bench.Tube], tmp_path: Path) -> None:
    assert (
        main(["identify", str(null[0]), "--starts", "1", "--free", "C_1", "eps_r", "eta_o", "--out", str(tmp_path)])
        == 0
    )
    content = json.loads((tmp_path / "parameters.json").read_text())
    assert set(content["parameters"]) == {"C_1", "eps_r", "eta_o"}
    model = load(tmp_path / "model.json")
    assert model.parameter_values()["C_1"] == pytest.approx(content["parameters"]["C_1"]["value"])
    _, joint = calibrated(tmp_path / "model.json")  # as a sweep reads it
    assert joint is not None and [name for name, _ in joint.columns] == ["C_1", "eps_r", "eta_o"]
    for name, row in zip(content["parameters"], joint.factor, strict=True):
        assert np.linalg.norm(row) == pytest.approx(content["parameters"][name]["stderr"], rel=1e-6)


def test_a_model_file_that_means_nothing_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    content = json.loads(as_json(tubular_dea()))
    for spoil, words in (
        ({"effects": ["friktion"]}, "friktion"),
        ({"parameters": {"C_9": 1.0}}, "C_9"),
        ({"parameters": {}, "covariance": {"names": ["C_1"], "matrix": [[1.0]]}}, 'to have C_1, as "covariance"'),
        ({"parameters": {"C_1": {"value": 3.0, "unit": "V"}}}, "C_1"),
        ({"format": 7}, "format"),
    ):
        path.write_text(json.dumps(content | spoil))
        with pytest.raises(ModelFileError, match=words):
            load(path)


def test_command_refuses_what_it_cannot_use(
    null: tuple[Path, bench.Tube], tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert main(["identify", str(null[0]), "--free", "C_7", "--out", str(tmp_path / "o")]) == 2
    assert "C_7" in capsys.readouterr().err
    assert main(["identify", str(tmp_path / "nowhere"), "--out", str(tmp_path / "o")]) == 2
    assert not (tmp_path / "o").exists()


def test_what_begins_under_load_is_not_taken_to_begin_at_rest() -> None:
    """The declared start of the model stood in place of each record's own: C_1 came out at 2.5 times what it is."""
    tube = td.tube(C_1="350 kPa")
    table = {}
    for number, steps in enumerate(("step 0 5 kV at 3", "step 0 4 kV at 2.5")):
        run = td.simulate(tube, pressure="ramp 0 85 mmHg from 0 to 1", voltage=steps, stop=6)
        late = run.time > 1.5
        noise = 15e-6 * np.random.default_rng(number).standard_normal(int(late.sum()))
        table[f"cut {number}"] = {
            "time [s]": run.time[late] - 1.5,
            "pressure [Pa]": run["pressure"][late],
            "voltage [V]": run["voltage"][late],
            "radius [m]": run["radius"][late] + noise,
        }
    recordings = td.read_recordings(table)
    assert {e.start for e in recordings.experiments} == {"unknown"}
    found = td.identify(recordings, free=["C_1", "eps_r"], starts=1)
    assert found.parameters["C_1"].value == pytest.approx(350e3, rel=5e-3)
    assert found.parameters["eps_r"].value == pytest.approx(2.8, rel=2e-2)


def test_the_command_that_finds_what_is_missing_has_the_plant() -> None:
    given = SimpleNamespace(data=Path("my data"), plant="tanks.py:LINEAR", columns=["pump=AI3"], out=Path("fitted"))
    assert to_find(given).endswith(
        "run tubular-dea close-loop 'my data' --plant tanks.py:LINEAR --columns pump=AI3 --out fitted_effects"
    )
    given = SimpleNamespace(data=Path("data"), plant="tube", columns=[], out=Path("o"))
    assert to_find(given).endswith("run tubular-dea close-loop data --out o_effects")


def test_a_parameter_that_is_known_from_one_side_alone_has_no_standard_error() -> None:
    """eta_2 was 29.6 +- 97 GPa.s beside an interval from 17.4 on: nobody knew how these go together."""
    told = estimates.ParameterEstimate(2.96e10, 9.7e10, (1.74e10, np.inf), "Pa.s")
    assert estimates._estimate("eta_2", told) == "eta_2    above 17.4 GPa.s (95 %)"
    assert estimates._estimate("eta_2", replace(told, ci95=(-np.inf, 2e6))) == "eta_2    below 2 MPa.s (95 %)"
    even = replace(told, stderr=1e10, ci95=(1e10, 5e10))
    assert estimates._estimate("eta_2", even) == "eta_2    29.6 +- 10 GPa.s"
    uneven = replace(even, stderr=1e8)
    assert estimates._estimate("eta_2", uneven) == "eta_2    29.6 GPa.s, 10 to 50 (95 %)"


def test_what_is_nearly_at_a_bound_begins_at_it() -> None:
    """From 1.09998 of at most 1.1 no step led away (README's carriage: a loop that leaves 11 times what it may)."""
    free = [Free("skew", 1.0, -2.0, 1.1), Free("travel", 1e-3), Free("part", 1.0, 0.0, 1.0)]
    problem = Problem(SimpleNamespace(), [], {}, free, {})
    start = np.array([f.to_scaled(v) for f, v in zip(free, (1.0999835, 5.8e-4, 0.3), strict=True)])
    begun = problem.values(begun_at_bounds(problem, start))
    assert 1.1 - 1e-7 < begun["skew"] < 1.1
    assert begun["travel"] == pytest.approx(5.8e-4) and begun["part"] == pytest.approx(0.3)


def test_what_other_weights_leave_lacks_nothing() -> None:
    """A membrane, with 3 V of noise in the voltage that makes its current, "lacks something": its fit, in which samples
    weighed as if there were none, left 1.24 times what there is to be left."""
    m = Build("Circuit", "A capacitance behind a resistance")
    voltage, across = m.input("voltage", "V", nominal=1.0), m.state("across", "V", nominal=1.0)
    m.derivative(across, (voltage - across) / m.parameter("tau", "s", 0.5, minimum=0.01))
    m.output("charged", "V", across)
    plant = Plant(m.model(), [Input("voltage")], [Output("charged")])
    random, time = np.random.default_rng(4), np.arange(0, 10, 0.01)
    drive = np.where(time > 1, np.sin(2 * time - 2), 0.0)
    charged = td.simulate(plant, td.Protocol.of(time, voltage=drive), times=time)["charged"]
    read = {"charged [V]": charged + 2e-3 * random.standard_normal(time.size), "voltage [V]": drive}
    work = study(td.read_recordings({"one": {"time [s]": time, **read}}, plant), held_out=(), effects=False)
    problem = work.problem((), procedure.free_parameters(plant.model, {"tau": 0.5}), {"tau": 0.5})
    best = fit(problem, {"tau": 0.5})
    moved = replace(best, scaled=best.scaled + 0.02)
    assert residual_over_noise(problem, replace(moved, residual=problem.residuals(moved.scaled))).significant
    assert not estimates._misfit(work, problem, moved).significant
