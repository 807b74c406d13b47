"""Plans: what they may say, and one clear line for what they may not."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from scenarios import MMHG
from sweeps import steps
from tubular_dea.cli import main
from tubular_dea.emit.variables import guid
from tubular_dea.kernel import Kernel
from tubular_dea.plants.load import load_plant
from tubular_dea.protocol import Protocol
from tubular_dea.sweep.axes import Joint
from tubular_dea.sweep.expression import PlanError
from tubular_dea.sweep.inputs import template
from tubular_dea.sweep.models import resolve
from tubular_dea.sweep.plan import make_plan, read_plan
from tubular_dea.sweep.rows import PreparedPlan

REST: dict[str, Any] = {"study": "rest", "outputs": ["radius"]}


def rest(**vary: Any) -> dict[str, Any]:
    return REST | {"vary": vary}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (rest(C_9=[1.0]), "C_9.*no such parameter or input.*did you mean C_3, C_2, C_1"),
        (rest(pressure={"from": "90 mmHg", "to": "90 mmHg", "count": 3}), "pressure: the range is empty"),
        (rest(pressure={"from": "90 mmHg", "to": "10 mmHg", "count": 3}), "pressure: the range is reversed"),
        (rest(pressure={"from": "0 mmHg", "to": "9 mmHg"}), "a grid needs its points; give count"),
        (rest(pressure={"from": "0 mmHg", "to": "9 mmHg", "count": 1}), "expected a count of at least 2"),
        (rest(pressure={"from": "0 mmHg", "to": "9 mmHg", "step": "2 mmHg"}), "a step that divides"),
        (rest(pressure={"from": "0 mmHg", "to": "9 mmHg", "cuont": 2}), "no entry 'cuont'; did you mean count"),
        (rest(pressure={"from": "0 V", "to": "9 V", "count": 3}), "expected a unit like 'Pa' but was given 'V'"),
        (rest(pressure=[]), "the list is empty"),
        (rest(pressure=["1 mmHg", "1 mmHg"]), "a value is given twice"),
        (rest(pressure="95 mmHg"), "expected .* but was given '95 mmHg'"),
        (rest(h_o=["-1 mm"]), "h_o: expected 1e-06 to 1 m but was given -0.001"),
        (rest(n_layers=[7, 7.5]), "n_layers: expected a whole number but was given 7.5"),
        (REST | {"set": {"n_layers": 7.5}}, "n_layers: expected a whole number but was given 7.5"),
        (rest(eps_r={"mean": 2.8, "deviation": 0}), "expected a positive deviation"),
        (rest(patient={"patients": ["helthy"]}), "no patient 'helthy'; did you mean healthy"),
        (rest(patient={"file": "nobody.csv"}), "nobody.csv: cannot be read"),
        (REST | {"outputs": ["radios"]}, "no variable 'radios'; did you mean radius"),
        (REST | {"outputs": []}, "expected what is wanted"),
        (REST | {"outputs": ["final radius"]}, "expected the name of a variable for rest states"),
        (REST | {"stduy": "rest"}, "no entry 'stduy'; did you mean study"),
        (REST | {"study": "reste"}, "expected one of trajectory, rest"),
        (REST | {"model": "TubularDAE"}, "no 'TubularDAE'; did you mean TubularDEA"),
        (REST | {"model": "AssistedHeart", "outputs": ["tube_radius"]}, "no equilibrium curve"),
        (REST | {"inputs": {"voltage": "step 0 5 kV at 1"}}, "expected constant inputs for rest states"),
        (REST | {"inputs": {"volt": 0}}, "no input 'volt'; did you mean voltage"),
        (REST | {"inputs": {"voltage": "{amplitude}"}}, "no number 'amplitude'"),
        (REST | {"set": {"C_1": "1 kV"}}, "expected a unit like 'Pa'"),
        (rest(C_1=[3e5]) | {"set": {"C_1": 3e5}}, r"\[set\] C_1: it is in \[vary\] too"),
        (rest(eps_r={"from": 2, "to": 3}) | {"design": {"kind": "sobol", "points": 100}}, "power of two"),
        (rest(eps_r={"from": 2, "to": 3}) | {"design": {"kind": "random"}}, "a positive whole number"),
        (REST | {"design": {"kind": "random", "points": 9}}, r"nothing in \[vary\]"),
        ({"outputs": ["last radius"]}, 'cannot read.*"final NAME"'),
        ({"outputs": ["final radius"], "run": {"stop": "1 V"}}, r"\[run\] stop: expected a unit like 's'"),
        ({"outputs": ["final radius"], "run": {"stop": "-1 s"}}, r"\[run\] stop: expected a positive time"),
        ({"outputs": ["final radius"], "run": {"tolerance": 1}}, "1e-12 to 1e-2"),
        ({"outputs": ["final radius"], "name": ["a"]}, "name: expected text"),
        ({"outputs": ["final radius"], "model": "no.json"}, "there is no file .*no.json"),
        ({"outputs": ["final radius"], "inputs": {"voltage": "step 0 5 kV until 3"}}, "cannot read"),
        ({"outputs": ["final radius"], "inputs": {"voltage": "{a b}"}}, "expected a name or arithmetic"),
        ({"outputs": ["time radius rises above 16 kV"]}, "expected a unit like 'm'"),
        ({"outputs": ["radius every 0.1 ms"]}, "at most 1000 samples"),
        ({"outputs": "final radius"}, "outputs: expected a list or a table"),
        ({"outputs": {"row": "final radius"}}, "two columns 'row'"),
    ],
)
def test_mistakes_are_named(content: dict[str, Any], message: str) -> None:
    with pytest.raises(PlanError, match=message):
        make_plan(content)


def test_a_mistake_costs_one_line_and_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan, out = tmp_path / "plan.toml", tmp_path / "out"
    plan.write_text('outputs = ["final radius"]\n[vary]\nC_9 = [1]\n', encoding="utf-8")
    assert main(["sweep", str(plan), "--out", str(out)]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "plan.toml" in line and "did you mean C_3, C_2, C_1?" in line
    assert not out.exists()
    assert main(["sweep", str(tmp_path / "no.toml"), "--out", str(out)]) == 2
    plan.write_text('{"format": 1}\n', encoding="utf-8")
    assert main(["sweep", str(plan), "--out", str(out)]) == 2
    assert "plan.toml: cannot be read as TOML; expected a plan: " in capsys.readouterr().err


def test_inputs_follow_their_text() -> None:
    values = {"a": np.array([1.0, 2.0]), "f": np.array([2.0, 4.0])}
    stop = np.array([[1.0], [1.0]])

    def points(text: object) -> tuple[list[Any], list[Any]]:
        b = template("voltage", text, "V", Path()).breakpoints(values, stop)
        return b.time.tolist(), b.value.tolist()

    assert points(5) == ([[0]], [[5]])
    assert points("{2 * a - 1}") == ([[0]], [[1], [3]])
    assert points("step 0 6kV at 1s until 2") == ([[1, 1, 2, 2]], [[0, 6e3, 6e3, 0]])
    assert points("step 0 {a} at {1 / f}") == ([[0.5, 0.5], [0.25, 0.25]], [[0, 1], [0, 2]])
    assert points("ramp 1 {a} from 0 to 100 ms") == ([[0, 0.1]], [[1, 1], [1, 2]])
    time, value = points("pulses 0 {a} every {1 / f} from 0.1 for 0.2")
    for row, period in zip(time, (0.5, 0.25), strict=True):
        starts = 0.1 + period * np.arange(4)
        np.testing.assert_allclose(row, np.column_stack([starts, starts, starts + 0.2, starts + 0.2]).ravel())
    assert value[1] == [0, 2, 2, 0] * 4
    assert points("step 0 {a} at 1e-1") == ([[0.1, 0.1]], [[0, 1], [0, 2]])


def test_too_many_pulses_are_a_row_that_says_so() -> None:
    pulses = {"voltage": "pulses 0 {amplitude} every {period} from 0.1 for 0.01"}
    vary = {"amplitude": ["5 kV"], "period": [0.5, 0.0, 1e-9, -1]}
    table = PreparedPlan(steps(outputs=["max electric_field"], inputs=pulses, vary=vary, design={})).rows(0, 4)
    assert table["status"].tolist() == [0, -4, -4, -4]
    assert table["message"][1:].tolist() == ["voltage is not a finite number"] * 3


def test_a_record_from_a_file_is_scaled(tmp_path: Path) -> None:
    (tmp_path / "beat.csv").write_text("time [s],pressure [mmHg]\n0,80\n0.3,120\n1,80\n", encoding="utf-8")
    b = template("pressure", {"file": "beat.csv", "scale": "{k}"}, "Pa", tmp_path).breakpoints(
        {"k": np.array([1.0, 2.0])}, np.ones((1, 1))
    )
    np.testing.assert_allclose(b.value, np.outer([1, 2], [80 * MMHG, 120 * MMHG, 80 * MMHG]))


@pytest.mark.parametrize("kind", ["grid", "random", "latin_hypercube", "sobol", "sobol_indices", "one_at_a_time"])
def test_rows_do_not_depend_on_pieces(kind: str) -> None:
    vary = {"pressure": {"from": 0, "to": 1e4, "count": 40}, "eps_r": {"from": 2, "to": 3, "count": 50, "log": True}}
    design = make_plan(REST | {"vary": vary, "design": {"kind": kind, "points": 2048}}).design
    whole = design.columns(0, design.rows)
    assert len(whole["eps_r"]) == design.rows
    for cut in (1, 2, 3, design.rows // 2):
        for name, values in whole.items():
            joined = np.concatenate([design.columns(0, cut)[name], design.columns(cut, design.rows)[name]])
            np.testing.assert_array_equal(joined, values)


def test_samples_have_their_distribution() -> None:
    vary = {"eps_r": {"mean": 2.8, "deviation": 0.1}, "pressure": {"from": 1e3, "to": 2e3}}
    columns = make_plan(REST | {"vary": vary, "design": {"kind": "latin_hypercube", "points": 500}}).design.columns(
        0, 500
    )
    ordered = np.sort(norm.cdf(columns["eps_r"], 2.8, 0.1))
    assert np.max(np.abs(ordered - (np.arange(500) + 0.5) / 500)) < 1 / 500
    assert 1e3 <= columns["pressure"].min() < 1e3 + 2 and 2e3 - 2 < columns["pressure"].max() <= 2e3


def test_rows_out_of_bounds_or_order_are_rows() -> None:
    vary = {"on": {"from": "0.5 s", "to": "2 s", "count": 4}, "eps_r": [0.5, 2.8]}
    with pytest.raises(PlanError, match="eps_r"):
        steps(vary=vary | {"amplitude": ["5 kV"]}, design={})
    vary = {"on": {"from": "0.5 s", "to": "2 s", "count": 4}, "amplitude": ["5 kV"], "pressure": ["95 mmHg"]}
    table = PreparedPlan(steps(vary=vary, design={})).rows(0, 4)
    assert table["status"].tolist() == [0, 0, 0, -2], "an on-time of 2 s is behind the off-time of 1.5 s"
    assert table["message"][3] == "the times of voltage do not ascend"
    assert np.isnan(table["max_electric_field"][3])


@pytest.mark.parametrize("wanted", [{"study": "rest", "outputs": ["radius"]}, {"outputs": ["final radius"]}])
def test_half_a_layer_is_a_row_that_says_so(wanted: dict[str, Any]) -> None:
    plan = make_plan(wanted | {"vary": {"n_layers": {"from": 7, "to": 8, "count": 3}}})
    table = PreparedPlan(plan).rows(0, 3)
    assert table["status"].tolist() == [0, -5, 0]
    assert table["message"][1] == "n_layers is not one of the whole numbers that it takes"
    assert np.isnan(table[plan.outputs[0].column]).tolist() == [False, True, False]


@pytest.mark.parametrize("wanted", [{"study": "rest", "outputs": ["radius"]}, {"outputs": ["final radius"]}])
def test_samples_beyond_a_bound_are_rows_that_say_so(wanted: dict[str, Any]) -> None:
    varied = {"vary": {"eps_r": {"mean": 1.0, "deviation": 0.5}}, "design": {"kind": "random", "points": 16}}
    table = PreparedPlan(make_plan(wanted | varied)).rows(0, 16)
    beyond = table["eps_r"] < 1
    assert 0 < beyond.sum() < 16
    assert table["status"].tolist() == np.where(beyond, -3, 0).tolist()
    assert {table["message"][i] for i in np.flatnonzero(beyond)} == {"eps_r is outside its bounds"}


def test_samples_are_columns(kernel: Kernel) -> None:
    vary = {"amplitude": ["4 kV"], "on": [0.5]}
    plan = steps(outputs=["radius every 0.3 s", "final radius"], vary=vary, design={}, set={})
    table = PreparedPlan(plan).rows(0, 1)
    samples = [name for name in table if name.startswith("radius_at_")]
    assert samples == [f"radius_at_{t}_s" for t in ("0", "0.3", "0.6", "0.9", "1.2", "1.5", "1.8")]
    protocol = Protocol.of([0, 0.5, 0.5, 1.5, 1.5, 2], pressure=[0.0] * 6, voltage=[0, 0, 4e3, 4e3, 0, 0])
    alone = kernel.simulate(protocol, 0.3 * np.arange(7), tolerance=1e-8)["radius"]
    np.testing.assert_allclose([table[name][0] for name in samples], alone, atol=2e-8)


def test_a_change_is_from_the_start_of_its_window(kernel: Kernel) -> None:
    wanted = {"whole": "change lambda_2", "late": "change lambda_2 over the last 0.5 s", "swing": "swing lambda_2"}
    vary = {"pressure": ["95 mmHg"], "amplitude": ["5 kV"], "on": [0.5]}
    row = PreparedPlan(steps(outputs=wanted, vary=vary, design={})).rows(0, 1)
    mmhg = [95 * MMHG] * 6
    protocol = Protocol.of([0, 0.5, 0.5, 1.5, 1.5, 2], pressure=mmhg, voltage=[0, 0, 5e3, 5e3, 0, 0])
    start, at, end = kernel.simulate(protocol, np.array([0, 1.5, 2]), {"start_at_equilibrium": 1}, 1e-8)["lambda_2"]
    assert row["whole"][0] == pytest.approx(end - start, abs=1e-5)
    assert row["late"][0] == pytest.approx(end - at, abs=1e-5)
    assert abs(row["whole"][0]) < 0.3 * row["swing"][0] < 0.6 * abs(row["late"][0])


def test_patients_set_many_parameters(tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text("patient,C_1 [kPa],h_o [mm]\nAnna,300,1\nBert,350,1.2\n", encoding="utf-8")
    plan = make_plan(rest(patient={"file": "p.csv"}, pressure=["95 mmHg"]), tmp_path)
    table = PreparedPlan(plan).rows(0, 2)
    assert table["patient"].tolist() == ["Anna", "Bert"]
    assert table["C_1"].tolist() == [300e3, 350e3]
    assert table["radius"][0] > table["radius"][1]
    (tmp_path / "p.csv").write_text("patient,C_7 [kPa]\nAnna,300\n", encoding="utf-8")
    with pytest.raises(PlanError, match="no parameter 'C_7'; did you mean C_3"):
        make_plan(rest(patient={"file": "p.csv"}), tmp_path)


OVEN = """
from tubular_dea.plants import Build, Input, Output, Plant

m = Build("Oven")
power = m.input("power", "W")
capacity = m.parameter("capacity", "J/K", 500.0)
loss = m.parameter("loss", "W/K", 2.0)
warmth = m.state("warmth", "K", nominal=50.0)
m.derivative(warmth, (power - loss * warmth) / capacity)
m.output("reading", "K", warmth)
PLANT = Plant(m.model(), [Input("power")], [Output("reading")])
"""


@pytest.mark.parametrize("effects", [(), ("electrode_resistance",)])
def test_a_plan_calls_the_tube_as_all_else_does(effects: tuple[str, ...]) -> None:
    ours, full = resolve("tube", effects, Path()), resolve("TubularDEA", effects, Path())
    assert guid(ours) == guid(full)
    assert resolve("aorta", (), Path()).name == "AorticAfterload"
    with pytest.raises(PlanError, match="there is no 'tub'; did you mean tube"):
        resolve("tub", (), Path())


def test_a_calibrated_model_of_an_own_plant(tmp_path: Path) -> None:
    (tmp_path / "oven.py").write_text(OVEN, encoding="utf-8")
    content = {
        "format": 1,
        "model": "Oven",
        "plant": "oven.py:PLANT",
        "effects": [],
        "parameters": {"loss": {"value": 4.0}},
        "covariance": {"names": ["loss"], "matrix": [[0.01]]},
    }
    (tmp_path / "model.json").write_text(json.dumps(content), encoding="utf-8")
    tables = {
        "model": "model.json",
        "outputs": ["final reading"],
        "run": {"stop": "2000 s"},
        "inputs": {"power": "100 W"},
        "vary": {"calibration": {"model": "model.json"}},
        "design": {"kind": "sobol", "points": 8},
    }
    with pytest.raises(PlanError, match=r"--plant .*oven\.py"):
        make_plan(tables, tmp_path)
    plan = make_plan(tables | {"plant": "oven.py"}, tmp_path)
    rows = PreparedPlan(plan).rows(0, 8)
    np.testing.assert_allclose(
        rows[next(n for n in rows if "reading" in n)], 100 / plan.design.columns(0, 8)["loss"], rtol=1e-4
    )
    assert make_plan(tables, tmp_path, load_plant(str(tmp_path / "oven.py"))).model == plan.model
    with pytest.raises(PlanError, match="plant: expected FILE.py"):
        make_plan(tables | {"plant": 5}, tmp_path)


def test_a_calibrated_model_and_its_uncertainty(tmp_path: Path) -> None:
    names, deviation, correlation = ["C_1", "eps_r"], np.array([5e3, 0.05]), 0.8
    covariance = np.outer(deviation, deviation) * [[1, correlation], [correlation, 1]]
    content = {
        "format": 1,
        "model": "TubularDEA",
        "effects": ["prestretch"],
        "parameters": {"C_1": {"value": 340e3}, "eps_r": 2.9},
        "covariance": {"names": names, "matrix": covariance.tolist()},
    }
    (tmp_path / "model.json").write_text(json.dumps(content), encoding="utf-8")
    tables = {"model": "model.json", "vary": {"calibration": {"model": "model.json"}}}
    plan = make_plan(REST | tables | {"design": {"kind": "sobol", "points": 4096}}, tmp_path)
    assert isinstance(plan.design.axes[0], Joint)
    columns = plan.design.columns(0, 4096)
    np.testing.assert_allclose(np.cov(columns["C_1"], columns["eps_r"]), covariance, rtol=0.02)
    assert columns["C_1"].mean() == pytest.approx(340e3, rel=1e-4)
    assert PreparedPlan(plan).rows(0, 4)["status"].tolist() == [0] * 4
    with pytest.raises(PlanError, match="model.json"):
        make_plan(REST | {"model": "none/model.json"}, tmp_path)


def test_the_examples_are_plans() -> None:
    folder = Path(__file__).parents[1] / "cosim_examples"
    found = sorted(folder.glob("sweep_*.toml"))
    assert len(found) >= 2
    for path in found:
        plan = read_plan(path)
        assert plan.design.rows > 100
        assert (PreparedPlan(plan).rows(0, 4)["status"] == 0).all()


def test_a_plan_that_is_no_utf8_is_named_as_such(tmp_path: Path) -> None:
    plan = tmp_path / "plan.toml"
    plan.write_bytes('study = "für"'.encode("latin-1"))
    with pytest.raises(PlanError, match="plan.toml: expected a plan in TOML, which is UTF-8 text.*save it as UTF-8"):
        read_plan(plan)
