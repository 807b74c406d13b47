"""Discovery end to end on small data, and its parts; the long study is `python -m blind.score` in tests/."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fmpy import simulate_fmu

from blind import bench
from shared_data import shared
from tubular_dea.cli import main
from tubular_dea.discover import engine
from tubular_dea.discover.alternatives import input_noise
from tubular_dea.discover.answer import outcome
from tubular_dea.discover.answer.oscillations import oscillations
from tubular_dea.discover.engine import Discovery
from tubular_dea.discover.options import acceptance, base
from tubular_dea.discover.scores import bank
from tubular_dea.discover.scores.bootstrap import null_scores
from tubular_dea.discover.scores.parameters import base_parameters
from tubular_dea.identify.inputs.drive import drive
from tubular_dea.identify.records.data import read_folder
from tubular_dea.identify.study.adjust import adjusted
from tubular_dea.identify.study.study import PRIOR, choose_held_out, study
from tubular_dea.plants.saved import load
from tubular_dea.plants.tube import PLANT

EXAMPLE = Path(__file__).resolve().parents[1] / "cosim_examples" / "data" / "bench"
OUTPUT = PLANT.outputs[0].name
FEW = ["02_step_4kV", "03_step_6kV", "04_ramp_7kV", "05_pressure_steps", "08_heartbeat_5kV"]


@pytest.fixture(scope="module")
def closed(carried_out: Callable[..., Path]) -> Path:
    """OUT of `tubular-dea close-loop` on the example's recordings."""
    return carried_out("close-loop", str(EXAMPLE))


@pytest.fixture(scope="module")
def nothing(tmp_path_factory: pytest.TempPathFactory) -> Discovery:
    """The discovery on recordings in which nothing is missing."""
    folder = tmp_path_factory.mktemp("null") / "data"
    bench.write(bench.draw(11, "none"), folder, 11, FEW)
    return engine.discover(read_folder(folder, PLANT))


def test_the_hidden_effect_is_found_and_the_error_falls_to_the_noise(closed: Path) -> None:
    result = json.loads((closed / "result.json").read_text())
    assert result["verdict"] == "effect_found"
    assert [e["id"] for e in result["effects"]] == ["electrode_resistance"]
    assert result["residual"]["channel"] == "electrical"
    error = result["error"]
    assert error["after"]["held_out_rmse"] <= 1.1 * result["noise_floor"]
    assert error["after"]["rmse"] < error["recalibrated"]["rmse"] < error["published"]["rmse"]
    assert result["noise_floor"] == pytest.approx(15e-6, rel=0.05)
    tau = result["effects"][0]["parameters"]["tau_e"]
    assert tau["ci95"][0] < tau["value"] < tau["ci95"][1]
    assert tau["unit"] == "s"
    assert isinstance(result["next_experiment"], str)
    assert len(error["after"]["per_experiment"]) == 6


def test_the_fmu_reproduces_the_records(closed: Path) -> None:
    recordings = read_folder(EXAMPLE, PLANT)
    experiment = next(e for e in recordings.experiments if e.name == "07_voltage_steps")
    protocol = drive(experiment, PLANT.inputs, recordings.noise).protocol
    names = ["time", "pressure", "voltage"]
    table = np.array(
        list(zip(protocol.time, protocol.inputs["pressure"], protocol.inputs["voltage"], strict=True)),
        dtype=[(n, float) for n in names],
    )
    run = simulate_fmu(
        str(closed / "fmi2" / "TubularDEA.fmu"),
        input=table,
        output=["measured_displacement"],
        stop_time=float(protocol.time[-1]),
        output_interval=0.004,
        step_size=0.004,
        fmi_type="CoSimulation",
    )
    modelled = np.interp(experiment.time, run["time"], run["measured_displacement"])
    assert np.sqrt(np.mean((modelled - experiment.outputs[OUTPUT]) ** 2)) < 1.1 * 15e-6


def test_the_model_file_reloads_and_builds(closed: Path, tmp_path: Path) -> None:
    model = load(closed / "model.json")
    assert model.effects == ("electrode_resistance",)
    tunable = [p.quantity.name for p in model.parameters if p.tunable]
    assert "tau_e" in tunable
    assert main(["build", "--model", str(closed / "model.json"), "--out", str(tmp_path)]) == 0
    assert (tmp_path / "fmi2" / "TubularDEA.fmu").read_bytes() == (closed / "fmi2" / "TubularDEA.fmu").read_bytes()


def test_the_report_is_self_contained(closed: Path) -> None:
    page = (closed / "report.html").read_text(encoding="utf-8")
    assert "From the residual to its cause" in page
    assert 'src="http' not in page
    assert (
        page.index("Summary") < page.index("What was found: electrode_resistance") < page.index("Statistical details")
    )


def test_the_report_shows_what_the_effect_does_and_what_it_leaves(closed: Path) -> None:
    """The lag's step and the residual over what it depends on; before it is far from 0, after it is not."""
    page = (closed / "report.html").read_text(encoding="utf-8")
    assert "after a step of voltage" in page
    assert 'aria-label="electrode_resistance alone"' in page
    drawn = page.split('aria-label="electrode_resistance: the residual"')[1].split("</svg>")[0]
    heights = {
        colour: [float(p.split(",")[1]) for p in points.split()]
        for points, colour in re.findall(r'<polyline points="([^"]*)" fill="none" stroke="([^"]*)"', drawn)
    }
    assert np.ptp(heights["#2a6f97"]) < 0.5 * np.ptp(heights["#c8402f"])


@pytest.mark.long
def test_the_same_recordings_and_seed_give_the_same_result(closed: Path, tmp_path: Path) -> None:
    assert main(["close-loop", str(EXAMPLE), "--out", str(tmp_path / "again")]) == 0
    for name in ("result.json", "model.json", "report.html", "fmi2/TubularDEA.fmu"):
        assert (tmp_path / "again" / name).read_bytes() == (closed / name).read_bytes(), name


def test_nothing_is_named_where_nothing_is_missing(nothing: Discovery) -> None:
    result = outcome.result(nothing)
    assert result["verdict"] == "no_effect"
    assert result["effects"] == []
    assert result["residual"]["channel"] is None
    assert result["error"]["after"]["held_out_rmse"] <= 1.1 * result["noise_floor"]


def test_a_noise_floor_is_no_higher_than_the_error(nothing: Discovery) -> None:
    work = nothing.study
    slow = replace(work.noise["measured_displacement"], rms=1e-3)
    wandering = replace(work, noise=work.noise | {"measured_displacement": slow})
    assert outcome.floor(work, 14e-6) == work.noise["measured_displacement"].rms
    assert outcome.floor(wandering, 14e-6) == 14e-6
    stated = replace(work, noise={"measured_displacement": replace(slow, freedom=np.inf)})
    assert outcome.floor(stated, 14e-6) == 1e-3


def test_what_monitors_noise_moves_is_what_noise_in_the_record_does(nothing: Discovery) -> None:
    """Four times the noise moves the model four times as much, and never more than a constant of its size."""
    work, values = nothing.study, nothing.base.fitted.values
    louder = replace(work, monitor_noise={n: 4 * v for n, v in work.monitor_noise.items()})
    one, four = (input_noise.caused_rms(w, values)["measured_displacement"] for w in (work, louder))
    assert four == pytest.approx(4 * one, rel=0.1)
    constant = max(np.abs(g).max() for gains in input_noise.input_sensitivities(work, values).values() for g in gains)
    assert 0 < one < constant * max(work.monitor_noise.values())


@pytest.mark.long
def test_records_with_other_noise_score_as_the_nulls_say(nothing: Discovery, tmp_path: Path) -> None:
    """Largest scores of the same tube with new noise of laser and monitors, against those drawn by the bootstrap.

    Where noise, weights, records' own numbers or the bootstrap are wrong, the two distributions part.
    """
    work, fitted, first = nothing.study, nothing.base.fitted, nothing.search.rounds[0]
    tube, listed = bench.draw(11, "none"), bank.candidates(work, fitted)
    true, free = bench.truths(tube, FEW), base_parameters(PLANT)
    largest: list[float] = []
    for number in range(24):
        if len(largest) == 8:
            break
        again = read_folder(bench.write(tube, tmp_path / str(number), [number, 7], FEW, true), PLANT)
        fresh = study(again, [p.name for p in work.held_out], work.prior)
        if [p.record.size for p in fresh.pieces] != [p.record.size for p in work.pieces]:
            continue  # with other noise, other samples do not tell how an input moved
        fresh = fresh.weighted([p.weight for p in work.pieces])
        problem = adjusted(fresh, (), fitted.values, free).problem((), free, {})
        residual, jacobian = problem.linearised(problem.scaled(fitted.values))
        largest.append(bank.scores(listed, residual, jacobian)[0].statistic)
    assert len(largest) == 8
    assert max(largest) < first.threshold
    low, high = np.quantile(first.null.largest, [0.001, 0.9])  # the bootstrap knows no bounds: its scores are larger
    assert low < np.median(largest) < high


def test_an_oscillation_that_no_input_drives_is_told(tmp_path: Path) -> None:
    """A wave in the sensor: its frequency, and how high it is in each file."""
    folder, height, frequency = tmp_path / "data", 12e-6, 3.7
    bench.write(bench.draw(11, "none"), folder, 11, FEW)
    for file in folder.glob("*.csv"):
        head, *lines = file.read_text().splitlines()
        rows = [[float(cell) for cell in line.split(",")] for line in lines]
        place = [cell.split()[0] for cell in head.split(",")].index("radius")
        for row in rows:
            row[place] += height * np.sin(2 * np.pi * frequency * row[0])
        file.write_text("\n".join([head, *(",".join(f"{v:.9g}" for v in row) for row in rows)]))
    recordings = read_folder(folder, PLANT)
    work = study(recordings, [], PRIOR)
    fitted = base.recalibrate(work, 1)
    work = adjusted(work, (), fitted.values)
    found = SimpleNamespace(study=work, named=SimpleNamespace(ids=(), fitted=fitted), recordings=recordings)
    (wave,) = oscillations(found)
    assert not wave.recorded
    assert wave.output == OUTPUT
    assert wave.frequency == pytest.approx(frequency, abs=0.01)
    assert set(wave.amplitudes) == set(FEW)
    assert np.median(list(wave.amplitudes.values())) == pytest.approx(height, rel=0.2)


def test_scores_point_to_the_refit(closed: Path) -> None:
    work = study(read_folder(EXAMPLE, PLANT), prior=PRIOR)
    fitted = base.recalibrate(work, 1)
    listed = bank.candidates(work, fitted)
    scored = bank.best_of_each(bank.scores(listed, fitted.residual, fitted.jacobian))
    assert scored[0].id in ("electrode_resistance", "amplifier_slew")
    assert {s.candidate.effect.channel for s in scored} == {"electrical", "mechanical", "pressure", "sensor"}
    null = null_scores(listed, fitted.jacobian, draws=500)
    assert scored[0].statistic > 100 * null.threshold(0.01)


@pytest.mark.long
def test_a_second_effect_is_found_where_what_the_first_leaves_does_not_stand_out_of_the_noise(tmp_path: Path) -> None:
    tube = bench.make(60, tmp_path / "data", "two")
    found = engine.discover(read_folder(tmp_path / "data", PLANT))
    alone = found.search.rounds[0].options[0].lack_of_fit
    assert acceptance.clean(alone)
    assert set(found.chosen.ids) == set(tube.effects) == {"stretch_dependent_viscosity", "third_maxwell_branch"}
    assert found.held_ratio <= 1.1


def test_held_out_experiments_stay_inside_what_the_others_reach() -> None:
    recordings = read_folder(EXAMPLE, PLANT)
    held = choose_held_out(recordings)
    assert len(held) == 1
    rest = [e for e in recordings.experiments if e.name not in held]
    for experiment in recordings.experiments:
        if experiment.name in held:
            assert np.nanmax(experiment.outputs[OUTPUT]) < max(np.nanmax(e.outputs[OUTPUT]) for e in rest)


def test_bad_recordings_leave_nothing_behind(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    data = tmp_path / "data"
    shutil.copytree(EXAMPLE, data)
    spoilt = data / "04_ramp_7kV.csv"
    lines = spoilt.read_text().splitlines()
    lines[500], lines[501] = lines[501], lines[500]
    spoilt.write_text("\n".join(lines))
    assert main(["close-loop", str(data), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "04_ramp_7kV.csv, line 502, column 'time'" in said
    assert not (tmp_path / "out").exists()


@pytest.mark.long
@pytest.mark.parametrize(("name", "ids"), [("set-2", ["friction_hysteresis"]), ("set-3", [])])
def test_declared_sets_of_the_bench(tmp_path: Path, name: str, ids: list[str]) -> None:
    data = shared(f"bench/{name}")
    assert main(["close-loop", str(data), "--out", str(tmp_path)]) == 0
    result = json.loads((tmp_path / "result.json").read_text())
    assert [e["id"] for e in result["effects"]] == ids
    assert result["verdict"] == ("effect_found" if ids else "no_effect")
    assert result["error"]["after"]["held_out_rmse"] <= 1.1 * result["noise_floor"]
    for experiment in result["held_out"]:
        left = _left_by_the_fmu(tmp_path / "fmi2" / "TubularDEA.fmu", data / f"{experiment}.csv")
        assert left <= 1.1 * result["noise_floor"], experiment


def _left_by_the_fmu(fmu: Path, file: Path) -> float:
    """The error [m] of the FMU under the recorded inputs as they stand in the file: voltage held, pressure continuous.

    Steps of 1 ms: FMPy holds inputs over a step, and a pressure held over the 4 ms of a sample is 2 ms late.
    """
    recorded = np.genfromtxt(file, delimiter=",", names=True, deletechars="")
    time, twice = recorded["time_[s]"], np.repeat(recorded, 2)
    table = np.empty(twice.size - 1, dtype=[(n, float) for n in ("time", "pressure", "voltage")])
    table["time"], table["pressure"] = twice["time_[s]"][1:], twice["pressure_[Pa]"][1:]
    table["voltage"] = twice["voltage_[V]"][:-1]
    run = simulate_fmu(
        str(fmu),
        input=table,
        output=["measured_displacement"],
        stop_time=float(time[-1]),
        output_interval=1e-3,
        fmi_type="CoSimulation",
    )
    modelled = np.interp(time, run["time"], run["measured_displacement"])
    return float(np.sqrt(np.mean((0.015 + modelled - recorded["radius_[m]"]) ** 2)))


def test_levels_are_tried_near_the_ends_of_what_their_state_passes() -> None:
    stop = PLANT.catalogue["rigid_stop"]
    tried = [shape["lambda_2_stop"] for shape, _ in bank.every_point(stop, {"lambda_2": (1.0, 1.24)})]
    assert max(tried) == pytest.approx(1.228) and min(tried) == pytest.approx(1.012)
    assert all(v in tried for v in stop.shapes["lambda_2_stop"] if v < 1.24)
    assert [shape["lambda_2_stop"] for shape, _ in bank.every_point(stop, {})] == list(stop.shapes["lambda_2_stop"])
