"""What `simulate` takes the inputs of a file to do between its rows, and the errors of a report from its model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.cli import main
from tubular_dea.plants import Plant

PLANT = '''"""A vessel that is filled by what a command says."""

from tubular_dea.plants import Build, Input, Output, Path, Plant

m = Build("Vessel", "A vessel", __doc__)
command = m.input("command", "V", nominal=5)
tau = m.parameter("tau", "s", 0.3, minimum=0.01)
level = m.state("level", "m", start="free", nominal=5)
m.derivative(level, (m.parameter("gain", "m/V", 1.0, tunable=False) * command - level) / tau)
m.output("reading", "m", level, nominal=5)
PLANT = Plant(m.model(), [Input("command", held=True)], [Output("reading")], places=[Path("command")])
'''
STEP = 0.1  # s


def declared(folder: Path) -> Plant:
    (folder / "vessel.py").write_text(PLANT)
    return td.load_plant(folder / "vessel.py")


def recorded(folder: Path, plant: Plant) -> Path:
    """Three files of a command that is another one at every sample, each with a start of its own."""
    random, data = np.random.default_rng(6), folder / "data"
    data.mkdir()
    for name in "abc":
        time, command = STEP * np.arange(300), random.uniform(-5, 5, 300)
        drive = td.Protocol.of(np.repeat(time, 2)[1:], command=np.repeat(command, 2)[:-1])
        start = {"tau": 0.25, "level_start": random.uniform(-3, 3)}
        read = td.Kernel(plant.model).simulate(drive, time, start)["reading"] + random.normal(0, 0.02, 300)
        table = np.column_stack([time, command, read])
        np.savetxt(data / f"{name}.csv", table, "%.9g", ",", header="time [s],command [V],reading [m]", comments="")
    (data / "bench.toml").write_text('[noise]\ncommand = "0 V"\n')
    return data


def test_the_model_gives_the_errors_of_the_report_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By the words of README: `records` in result.json and model.json, with the files as they were recorded."""
    plant = declared(tmp_path)
    found = td.discover(recorded(tmp_path, plant), plant=plant, hold_out=["b"])
    found.report(tmp_path / "out")
    for name, own in found.content["records"].items():
        file, out = tmp_path / "data" / f"{name}.csv", tmp_path / name
        words = ["simulate", "--model", str(tmp_path / "out" / "model.json"), "--plant", str(tmp_path / "vessel.py")]
        words += ["--inputs", str(file), "--interval", f"{STEP}", "--out", str(out)]
        assert main([*words, "--set", *(f"{n}={v}" for n, v in own["start"].items())]) == 0
        assert "between the rows of the file: command held until the next row" in capsys.readouterr().out
        read, answer = (np.genfromtxt(f, delimiter=",", names=True) for f in (file, out / "response.csv"))
        off = answer["reading_m"] + own["zeros"].get("reading", 0.0) - read["reading_m"]
        told = found.content["error"]["after"]["per_experiment"][name]["rmse"]
        assert np.sqrt(np.mean(off**2)) == pytest.approx(told, rel=0.01)


def test_a_file_says_what_was_assumed_between_its_rows(tmp_path: Path) -> None:
    file = tmp_path / "in.csv"
    file.write_text("time [s],pressure [mmHg],voltage [kV]\n0,0,0\n0.1,95,5\n0.2,95,5\n")
    run = td.simulate(inputs=file, times=[0.05, 0.1])
    assert run["voltage"].tolist() == [0, 5000]  # a recording of a switch, as every recording of the tube
    assert run["pressure"][0] == pytest.approx(0.5 * 95 * 133.322)
    assert "between the rows of the file: voltage held until the next row, pressure straight" in run.lines()
    file.write_text("time [s],pressure [mmHg],voltage [kV]\n0,0,0\n0.1,95,5\n0.1,95,5\n0.2,95,5\n")
    assert td.simulate(inputs=file, times=[0.05])["voltage"] == pytest.approx([2500])  # up to a time listed twice
    straight = td.Protocol.of([0, 0.1], pressure=[0, 1e3], voltage=[0, 5e3])
    run = td.simulate(inputs=straight, times=[0.05])
    assert run["voltage"] == pytest.approx([2500])
    assert not run.between


@pytest.mark.parametrize(("step", "rows"), [(0.004, 0.004), (0.04, 0.01)])
def test_the_response_has_the_rows_of_a_file_that_has_them_close(step: float, rows: float, tmp_path: Path) -> None:
    file, time = tmp_path / "in.csv", step * np.arange(11)
    table = np.column_stack([time, 50 * np.ones(11), time > 5 * step])
    np.savetxt(file, table, "%.6g", ",", header="time [s],pressure [mmHg],voltage [kV]", comments="")
    assert np.diff(td.simulate(inputs=file).time) == pytest.approx(rows)
    assert np.diff(td.simulate(inputs=file, interval="2 ms").time) == pytest.approx(0.002)
