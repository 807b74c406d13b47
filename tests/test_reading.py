"""Recordings with a laboratory's names and clocks: --columns, bench.toml, --dry-run, triggers, coarse times."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

import tubular_dea
from laboratory import drawn, numbers
from tubular_dea.cli import main
from tubular_dea.discover.answer import between_files
from tubular_dea.errors import UserError
from tubular_dea.identify.fitting import mistakes, scales, signs
from tubular_dea.identify.records.data import read_experiment, read_folder
from tubular_dea.identify.records.experiment import RESTED, UNKNOWN, DataError
from tubular_dea.identify.records.start import detected
from tubular_dea.identify.study.study import study
from tubular_dea.kernel import Kernel, KernelError
from tubular_dea.plants import Build, Input, Output, Plant
from tubular_dea.plants import Path as Place
from tubular_dea.plants.tube import PLANT
from tubular_dea.protocol import Protocol

EXAMPLE = Path(__file__).parents[1] / "cosim_examples" / "data" / "bench"
OUTPUT = PLANT.outputs[0].name


def table(n: int = 400) -> dict[str, np.ndarray]:
    return numbers(np.random.default_rng(1), n)


def written(folder: Path, columns: dict[str, np.ndarray], name: str = "a.csv") -> Path:
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    rows = [",".join(f"{v:.9g}" for v in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join([",".join(columns), *rows]) + "\n", encoding="utf-8")
    return path


def strange(folder: Path, name: str = "a.csv") -> dict[str, np.ndarray]:
    """A file whose headings only its laboratory understands; returns what it means."""
    data = table()
    written(
        folder,
        {
            "t [s]": data["time"],
            "AI1": data["pressure"] / 1e3,
            "AI3 [kV]": data["voltage"] / 1e3,
            "laser_1 [mm]": data["radius"] * 0,
            "laser_2 [mm]": data["radius"] * 1e6,
        },
        name,
    )
    return data


@pytest.mark.parametrize(
    ("heading", "cell", "wanted"),
    [
        ("Druck [mmHg]", "abc", "line 102, column 'Druck': expected a number but found 'abc'"),
        ("Druck [mmHg]", "inf", "line 102, column 'Druck': expected a finite number but found 'inf'"),
        ("Laser Radius [mm]", "inf", "line 102, column 'Laser Radius': expected a finite number but found 'inf'"),
    ],
)
def test_a_bad_cell_is_told_under_a_laboratory_s_headings_too(
    tmp_path: Path, heading: str, cell: str, wanted: str
) -> None:
    data = table()
    meant = {
        "time": "Zeit [s]",
        "pressure": "Druck [mmHg]",
        "voltage": "Hochspannung [V]",
        "radius": "Laser Radius [mm]",
    }
    units = {"pressure": 133.322, "radius": 1e-3}
    path = written(tmp_path, {meant[name]: data[name] / units.get(name, 1.0) for name in meant})
    read_experiment(path, PLANT)
    rows = path.read_text().splitlines()
    cells = rows[101].split(",")
    cells[list(meant.values()).index(heading)] = cell
    path.write_text("\n".join([*rows[:101], ",".join(cells), *rows[102:]]) + "\n")
    with pytest.raises(DataError, match=re.escape(f"{path}, {wanted}")):
        read_experiment(path, PLANT)


@pytest.mark.parametrize(
    "columns",
    [
        ["pressure=AI1[kPa]", "voltage=AI3", "radius=laser_2[um]"],
        ["pressure=2[kPa]", "voltage=3[kV]", "radius=5 [um]"],
        ["time=t", "Pressure=ai1 [kPa]", "voltage=AI3 [kV]", "radius=LASER_2[um]"],
        ["pressure=AI1[1000 Pa]", "voltage=AI3[1e3 V]", "radius=laser_2[0.001 mm]"],
    ],
)
def test_columns_are_named_by_the_user(tmp_path: Path, columns: list[str]) -> None:
    data = strange(tmp_path)
    experiment = read_folder(tmp_path, PLANT, columns).experiments[0]
    np.testing.assert_allclose(experiment.inputs["pressure"], data["pressure"], rtol=1e-8)
    np.testing.assert_allclose(experiment.inputs["voltage"], data["voltage"], rtol=1e-8)
    np.testing.assert_allclose(experiment.outputs[OUTPUT], data["radius"] - 0.015, atol=1e-10)
    assert experiment.source and experiment.source.unused == ("laser_1 [mm]",)


def test_bench_file_names_columns_too_and_the_command_line_goes_before(tmp_path: Path) -> None:
    data = strange(tmp_path)
    (tmp_path / "bench.toml").write_text(
        '[columns]\npressure = "AI1 [kPa]"\nvoltage = 3\nradius = "laser_1 [um]"\n[geometry]\nn_layers = 6\n'
    )
    recordings = read_folder(tmp_path, PLANT, ["radius=laser_2[um]"])
    np.testing.assert_allclose(recordings.experiments[0].outputs[OUTPUT], data["radius"] - 0.015, atol=1e-10)
    assert recordings.geometry == {"n_layers": 6}


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (["radius"], ["--columns radius: expected SIGNAL=COLUMN"]),
        (["radius="], ["expected SIGNAL=COLUMN"]),
        (["radios=AI1"], ["there is no signal 'radios'; did you mean radius"]),
        (["radius=AI1", "radius=AI2"], ["twice"]),
        (["radius=AI1[furlong]"], ["unit like 'm' but found 'furlong'"]),
        (["radius=AI4"], ["a.csv, line 1: column 'AI4' for radius is not there", "did you mean"]),
        (["radius=9"], ["column '9' for radius is not there; found t [s], AI1"]),
        (["pressure=AI1"], ["a.csv, line 1: column 'AI1' names no unit", "--columns 'pressure=2[Pa]'"]),
        (["pressure=AI1[mm]"], ["column 'AI1': expected a unit like 'Pa' but was given 'mm'"]),
        (["radius=laser_1", "displacement=laser_2"], ["expected one column 'radius [m]' or 'displacement [m]'"]),
        ([], ["column 'pressure [Pa]' is missing; found t [s], AI1", "--columns pressure=ITS_NAME_OR_NUMBER"]),
    ],
)
def test_choices_that_cannot_be_meant_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], columns: list[str], words: list[str]
) -> None:
    strange(tmp_path / "data")
    complete = {"pressure=": "pressure=AI1[kPa]", "voltage=": "voltage=AI3", "radius=": "radius=laser_2[um]"}
    if columns and columns[0] not in ("radius", "radius="):
        columns = columns + [v for k, v in complete.items() if not any(c.startswith(k) for c in columns)]
    options = ["--columns", *columns] if columns else []
    assert main(["identify", str(tmp_path / "data"), "--out", str(tmp_path / "out"), *options]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and not (tmp_path / "out").exists()
    for word in words:
        assert word in said


def test_advice_on_columns_can_be_followed_where_it_is_given(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    strange(tmp_path / "data")
    data, missing = str(tmp_path / "data"), "column 'pressure [Pa]' is missing"
    said = {}
    for command in ("lab", "identify"):
        given = ["--data", data] if command == "lab" else [data]
        assert main([command, *given, "--out", str(tmp_path / "x.html")]) == 2
        said[command] = capsys.readouterr().err
    assert missing in said["lab"] and 'pressure = "ITS_NAME_OR_NUMBER" and radius = "COLUMN" below' in said["lab"]
    assert 'radius = "COLUMN" below [columns] in the folder\'s bench.toml' in said["lab"]
    assert "--columns pressure=ITS_NAME_OR_NUMBER" in said["identify"] and "--columns" not in said["lab"]
    with pytest.raises(UserError) as problem:
        tubular_dea.read_recordings(data)
    columns = '{"pressure": "ITS_NAME_OR_NUMBER", "radius": "COLUMN"}'
    assert f"say columns={columns} in read_recordings" in str(problem.value)
    tubular_dea.read_recordings(data, columns={"pressure": "AI1[kPa]", "voltage": 3, "radius": "laser_2[um]"})
    strange(tmp_path / "data", "b.csv")
    assert main(["identify", data, "--dry-run"]) == 2
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2 and all("--columns pressure=ITS_NAME_OR_NUMBER" in line for line in told)
    (tmp_path / "data" / "b.csv").unlink()
    (tmp_path / "data" / "bench.toml").write_text(
        '[columns]\npressure = "AI1 [kPa]"\nvoltage = 3\nradius = "laser_2 [um]"\n'
    )
    assert main(["lab", "--data", data, "--out", str(tmp_path / "lab.html")]) == 0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[geometri]\nr_o = 1\n", "found 'geometri'; did you mean geometry"),
        ("[geometry]\nr_0 = 1\n", "'r_0' is not known; did you mean r_o"),
        ("[geometry]\nn_layers = 7.5\n", "n_layers: expected a whole number but found 7.5"),
        ("[noise]\nradus = 1\n", "'radus' is not known; did you mean radius"),
        ("[noise]\nradius = '3 kV'\n", "radius: expected a unit like 'm' but was given 'kV'"),
        ("[columns]\nradus = 'x'\n", "there is no signal 'radus'; did you mean radius"),
        ("[start]\nb = 'rested'\n", "there is no experiment 'b'"),
        ("[start]\na = 'restless'\n", "expected rested"),
        ("[order]\na = '3 mm'\n", "expected a unit like 's'"),
        ("[order]\na = '95 s'\n", "[order] a: expected the starts of two files at least"),
    ],
)
def test_what_bench_file_cannot_mean_is_refused(tmp_path: Path, text: str, words: str) -> None:
    strange(tmp_path)
    (tmp_path / "bench.toml").write_text(text)
    with pytest.raises(Exception, match="bench.toml") as refusal:
        read_folder(tmp_path, PLANT)
    assert words in str(refusal.value)


def headed(**changed: np.ndarray) -> dict[str, np.ndarray]:
    data = table() | changed
    units = {"time": "time [s]", "pressure": "pressure [Pa]", "voltage": "voltage [V]", "radius": "radius [m]"}
    return {units.get(name, name): values for name, values in data.items() if name != "current" or name in changed}


def in_a_row(folder: Path, second: str) -> Path:
    """Three files of 1.6 s: `b` begins when it is said and follows `a`, and `c` is on its own."""
    for name in "abc":
        written(folder, headed(pressure=table()["pressure"] + 12e3 * (name == "b")), f"{name}.csv")
    (folder / "bench.toml").write_text(f'[order]\na = "0 s"\nb = "{second}"\n')
    return folder


def test_files_that_follow_one_another_say_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recordings = read_folder(in_a_row(tmp_path, "2 s"), PLANT)
    assert [e.follows for e in recordings.experiments] == ["", "a", ""]
    loaded = [dataclasses.replace(e, start=UNKNOWN if e.name == "b" else RESTED) for e in recordings.experiments]
    loaded_run = dataclasses.replace(recordings, experiments=loaded)
    assert set(loaded_run.starts.values()) == {RESTED}  # what follows begins with what it follows
    pieces = {p.name: p for p in study(loaded_run).pieces}
    assert pieces["b"].before is not None and not pieces["b"].loose and pieces["b"].case.own == {}
    found = SimpleNamespace(study=SimpleNamespace(pieces=pieces.values()), recordings=loaded_run)
    (said,) = between_files.starts(found)
    assert "b follows a" in said and "under load" not in said
    assert main(["identify", str(tmp_path), "--dry-run"]) == 0
    (row,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("b "))
    assert " after a " in row


@pytest.mark.parametrize("dry", [["--dry-run"], ["--out", "out"]])
def test_files_that_overlap_are_refused_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], dry: list[str]
) -> None:
    assert main(["identify", str(in_a_row(tmp_path, "1 s")), *dry]) != 0
    said = capsys.readouterr().err
    assert "[order] a begins at 0 s and lasts 1.596 s, but b begins at 1 s" in said


def test_a_coarse_clock_was_even(tmp_path: Path) -> None:
    experiment = read_experiment(written(tmp_path, headed(time=np.floor(table()["time"] * 100) / 100)), PLANT)
    np.testing.assert_allclose(experiment.time, table()["time"], rtol=1e-9)
    assert experiment.source and "250 Hz" in experiment.source.remarks[0]


def test_rows_that_stand_there_twice_count_once(tmp_path: Path) -> None:
    columns = {k: np.repeat(v, np.where(np.arange(400) % 50 == 7, 2, 1)) for k, v in headed().items()}
    experiment = read_experiment(written(tmp_path, columns), PLANT)
    assert experiment.time.size == 400 and np.all(np.diff(experiment.time) > 0)
    assert experiment.source and "8 duplicate rows" in experiment.source.remarks[0]


def test_a_time_that_stands_there_twice_is_spread(tmp_path: Path) -> None:
    time = table()["time"].copy()
    time[100] = time[99]
    experiment = read_experiment(written(tmp_path, headed(time=time)), PLANT)
    assert np.all(np.diff(experiment.time) > 0) and experiment.time[100] == pytest.approx(time[99] + 0.004)
    assert experiment.source and "line 102" in experiment.source.remarks[0]


def test_equal_readings_of_a_coarse_clock_are_no_doubles(tmp_path: Path) -> None:
    """Every sample counts where a clock ticks less often than samples are taken, also two that are equal."""
    columns = headed(time=np.floor(table()["time"] * 100) / 100)
    for values in columns.values():
        values[41] = values[40]
    experiment = read_experiment(written(tmp_path, columns), PLANT)
    assert experiment.time.size == 400
    np.testing.assert_allclose(experiment.time, table()["time"], rtol=1e-9)


def test_a_time_that_stands_still_is_refused(tmp_path: Path) -> None:
    """A column of equal times is no time."""
    with pytest.raises(UserError, match="expected ascending times but every row is at 1 s"):
        read_experiment(written(tmp_path, headed(time=np.ones(400))), PLANT)


def test_gaps_are_no_coarse_clock(tmp_path: Path) -> None:
    columns = {k: np.delete(v, np.arange(200, 230)) for k, v in headed().items()}
    experiment = read_experiment(written(tmp_path, columns), PLANT)
    np.testing.assert_allclose(experiment.time, columns["time [s]"], rtol=1e-9)


def test_two_recordings_in_one_file_are_told(tmp_path: Path) -> None:
    path = written(tmp_path, headed())
    path.write_text(path.read_text() * 2)
    with pytest.raises(DataError, match=r"line 403, column 'time': .* or split the file where its headings are rep"):
        read_experiment(path, PLANT)


def test_a_clock_past_midnight(tmp_path: Path) -> None:
    file = next(f for f in map(drawn, range(200)) if f.habits.time == "clock")
    (tmp_path / "a.csv").write_bytes(file.raw)
    experiment = read_experiment(tmp_path / "a.csv", PLANT)
    np.testing.assert_allclose(experiment.time, np.arange(400) * 0.004, atol=1e-9)


def test_times_of_the_calendar_count_from_the_first_sample(tmp_path: Path) -> None:
    data = headed()
    first = next(iter(data))
    data[first] = data[first] + 1_772_000_000.0
    rows = [",".join(f"{v:.15g}" for v in row) for row in zip(*data.values(), strict=True)]
    (tmp_path / "a.csv").write_text("\n".join([",".join(data), *rows]) + "\n")
    np.testing.assert_allclose(read_experiment(tmp_path / "a.csv", PLANT).time, table()["time"], atol=1e-6)


def test_a_trigger_is_a_switch(tmp_path: Path) -> None:
    data = table()
    trigger = np.where(data["time"] >= 1.0, 4.9, 0.1)
    experiment = read_experiment(written(tmp_path, headed() | {"Trigger [V]": trigger}), PLANT)
    np.testing.assert_array_equal(experiment.trigger, data["time"] >= 1.0)
    still = read_experiment(written(tmp_path, headed() | {"trigger": trigger * 0}), PLANT)
    assert still.trigger is None


def test_notes_beside_the_files_are_left_aside_and_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written(tmp_path / "data", headed() | {"comment": np.zeros(400)})
    (tmp_path / "data" / "README.txt").write_text("The tube was changed on\nMonday. Nothing else.\n")
    (tmp_path / "data" / ".a.csv.swp").write_bytes(b"\0")
    main(["identify", str(tmp_path / "data"), "--dry-run"])
    said = capsys.readouterr().out
    assert "no table   README.txt" in said and "not used   'comment'" in said


def test_a_file_in_which_nothing_moves_is_left_aside_and_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A long hold seen by a coarse sensor; where an input moves and the radius does not, the sensor is dead."""
    data = table()
    toggling = 9000.0 + 156.25 * (np.arange(data["time"].size) % 7 == 0)
    rest = {"radius": np.full_like(toggling, 17.5e-3), "pressure": toggling, "voltage": np.zeros_like(toggling)}
    written(tmp_path / "data", headed())
    written(tmp_path / "data", headed(**rest), "hold.csv")
    assert main(["identify", str(tmp_path / "data"), "--dry-run"]) == 0
    assert "at rest    hold.csv: nothing moves there, left out" in capsys.readouterr().out
    written(tmp_path / "data", headed(radius=rest["radius"]), "hold.csv")
    with pytest.raises(DataError, match=r"hold\.csv.*column 'radius': a constant record"):
        read_folder(tmp_path / "data", PLANT)


def test_two_files_of_one_name_are_refused(tmp_path: Path) -> None:
    written(tmp_path, headed())
    written(tmp_path, headed(), "a.txt")
    with pytest.raises(DataError, match=r"one file an experiment but found a\.csv and a\.txt"):
        read_folder(tmp_path, PLANT)


@pytest.mark.parametrize("command", ["identify", "close-loop"])
def test_dry_run_says_what_is_understood_and_fits_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    strange(tmp_path / "data")
    columns = ["pressure=AI1[kPa]", "voltage=AI3", "radius=laser_2[um]"]
    assert main([command, str(tmp_path / "data"), "--dry-run", "--columns", *columns]) == 0
    said = capsys.readouterr().out
    words = [
        "1 experiment of TubularDEA, 400 samples",
        "text (ASCII), commas",
        "radius = 'laser_2 [mm] in um'",
        "not used   'laser_1 [mm]'",
        "250 Hz",
        "rested",
        "n_layers 8",
        "measured_displacement [mm] (column radius)",
        "1.596 s",
    ]
    for word in words:
        assert word in said, said
    assert not list(tmp_path.rglob("*.png"))
    out = tmp_path / "out"
    assert main([command, str(tmp_path / "data"), "--dry-run", "--columns", *columns, "--out", str(out)]) == 0
    assert [p.name for p in out.iterdir()] == ["recordings.png"]
    assert (out / "recordings.png").stat().st_size > 10_000


def test_a_name_that_is_held_out_has_to_be_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written(tmp_path / "data", headed())
    assert main(["close-loop", str(tmp_path / "data"), "--dry-run", "--hold-out", "a"]) == 0
    assert main(["close-loop", str(tmp_path / "data"), "--dry-run", "--hold-out", "a1"]) == 2
    assert "--hold-out a1: there is no experiment 'a1'; did you mean a?" in capsys.readouterr().err


STORE = """
from tubular_dea.plants import Balance, Build, Input, Output, Plant
m = Build("Store", "A store", __doc__)
inflow = m.input("inflow", "m/s", "Inflow", nominal=1e-7)
k = m.parameter("k", "1/s", 2e-6, "Rate at which it drains", minimum=1e-9)
S = m.state("S", "m", "Water stored", start="free", nominal=0.1)
m.derivative(S, inflow - k * S)
m.output("level", "m", S, "Gauge")
PLANT = Plant(m.model(), inputs=[Input("inflow", held=True)], outputs=[Output("level")], places=[Balance("S")])
"""


def test_slow_records_are_shown_in_the_units_of_their_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    random = np.random.default_rng(0)
    level = 300 + np.cumsum(random.normal(0, 3, 200))  # never quiet
    inflow = 5.0 * (np.arange(200) % 50 > 25) + random.normal(0, 0.02, 200)
    data = {"time [d]": np.arange(200.0), "inflow [mm/d]": inflow, "level [mm]": level}
    written(tmp_path / "data", data)
    (tmp_path / "store.py").write_text(STORE)
    assert main(["close-loop", str(tmp_path / "data"), "--plant", str(tmp_path / "store.py"), "--dry-run"]) == 0
    said = capsys.readouterr().out
    for word in ("199 d", "every 1 d", "inflow [mm/d]", "level [mm]", "estimated"):
        assert word in said, said
    assert re.search(r"inflow [\d.]+ mm/d,", said) and "nm/s" not in said
    first = f"{np.median(level[:5]):.4g}"
    assert any(line.endswith(first) for line in said.splitlines()), said
    (tmp_path / "data" / "bench.toml").write_text('[noise]\ninflow = "0 mm/d"\n')  # it is new at every sample
    assert main(["close-loop", str(tmp_path / "data"), "--plant", str(tmp_path / "store.py"), "--dry-run"]) == 0
    assert "level not known yet (no part of the recordings is quiet)" in capsys.readouterr().out


def test_mixed_rates_are_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written(tmp_path / "data", headed())
    written(tmp_path / "data", {h: v[::2] for h, v in headed().items()}, "b.csv")
    assert main(["identify", str(tmp_path / "data"), "--dry-run"]) == 0
    said = capsys.readouterr().out
    assert "250 Hz" in said and "125 Hz" in said


@pytest.mark.parametrize(
    ("signal", "factor", "words"),
    [
        ("pressure", 0.1, "pressure 10 times too small (kPa labelled mbar)"),
        ("pressure", 7.50062, "pressure 7.5 times too large (mmHg labelled kPa)"),
        ("voltage", 0.5, "voltage 2 times too small"),
        ("radius", 2.0, "radius 2 times too large (a diameter for a radius)"),
        ("radius", 0.1, "radius 10 times too small (cm labelled mm)"),
        ("displacement", -1.0, "of the wrong sign (counted the other way)"),
        ("time", 1e-3, "time 1000 times too small (s labelled ms)"),
        ("", 1.0, ""),
    ],
)
def test_a_scale_that_is_wrong_by_a_factor_is_said(signal: str, factor: float, words: str) -> None:
    recordings = read_folder(EXAMPLE, PLANT)
    experiments = []
    for e in recordings.experiments:
        inputs = {n: v * factor if n == signal else v for n, v in e.inputs.items()}
        outputs = {n: (v + 0.015) * (factor if signal == "radius" else 1) - 0.015 for n, v in e.outputs.items()}
        outputs = {n: -v if signal == "displacement" else v for n, v in outputs.items()}
        time = e.time * (factor if signal == "time" else 1)
        experiments.append(dataclasses.replace(e, time=time, inputs=inputs, outputs=outputs))
    said = scales.findings(dataclasses.replace(recordings, experiments=experiments))
    example = "as in time=COLUMN[s])" if signal == "time" else "=COLUMN[0.5 mm]"
    assert words in said[0] and example in said[0] if words else not said, said


def test_no_unit_is_asked_about_where_a_step_to_a_start_leads_too_far() -> None:
    """An armature that a start of ten usual sizes pulls in for good had no answer, and its pressure was "100 times too
    small"; from a part of that step there is one."""

    def at(start: Mapping[str, float]) -> np.ndarray:
        if start["x"] > 2.0:
            raise KernelError("pulled in")
        return np.array([1.0, 2.0, 3.0]) * np.arctan(start["x"])

    plant = SimpleNamespace(
        each_start={"x": 1.0},
        model=SimpleNamespace(
            parameter_values=lambda: {"x": 0.0}, quantity=lambda name: SimpleNamespace(inside=lambda value: value)
        ),
    )
    seen = np.array([1.0, 2.0, 3.0]) * 1.3
    found = scales.from_best_start(cast(Plant, plant), at, seen)
    assert np.abs(found - seen).max() < 0.25 * seen.max()
    np.testing.assert_array_equal(scales.from_best_start(cast(Plant, plant), at, np.zeros(3)), np.zeros(3))


@pytest.mark.parametrize("heading", ["Diameter (mm)", "Durchmesser [mm]", "tube_diameter_mm", "Diamètre [mm]"])
def test_half_of_a_diameter_is_a_radius(tmp_path: Path, heading: str) -> None:
    table = headed()
    table[heading] = 2e3 * table.pop("radius [m]")
    experiment = read_experiment(written(tmp_path, table), PLANT)
    np.testing.assert_allclose(experiment.outputs[OUTPUT], headed()["radius [m]"] - 0.015, atol=1e-10)
    assert experiment.source and any("radius is 0.5 times " in said for said in experiment.source.remarks)


def test_a_radius_goes_before_a_diameter(tmp_path: Path) -> None:
    table = headed() | {"Diameter (mm)": 2.1e3 * headed()["radius [m]"]}
    experiment = read_experiment(written(tmp_path, table), PLANT)
    np.testing.assert_allclose(experiment.outputs[OUTPUT], headed()["radius [m]"] - 0.015, atol=1e-10)
    assert experiment.source and experiment.source.unused == ("Diameter (mm)",)


@pytest.mark.parametrize(("heading", "told"), [("rayon (mm)", "radius"), ("Laser [um]", "displacement")])
def test_what_has_another_name_is_told_by_its_size(tmp_path: Path, heading: str, told: str) -> None:
    """The only length is a radius where it is about that at rest, and its change where it is far less."""
    table = headed()
    own = table.pop("radius [m]")
    table[heading] = 1e3 * own if told == "radius" else 1e6 * (own - 0.015)
    experiment = read_experiment(written(tmp_path, table), PLANT)
    np.testing.assert_allclose(experiment.outputs[OUTPUT], own - 0.015, atol=1e-10)
    assert experiment.source and any(said.startswith(f"{told} is read from ") for said in experiment.source.remarks)


def test_a_size_that_may_be_anything_is_asked_about(tmp_path: Path) -> None:
    """A gauge's "Weg [mm]" of twice a radius is none: the message says which column it is about."""
    table = headed()
    table["Weg [mm]"] = 2e3 * table.pop("radius [m]")
    path = written(tmp_path / "data", table)
    with pytest.raises(DataError, match=r"but found .*Weg \[mm\]; .*columns=\{\"radius\": 4\}") as refusal:
        read_experiment(path, PLANT)
    assert "(15 mm) nor of its change, but may be a diameter: [0.5 mm] halves it" in str(refusal.value)
    halved = read_folder(tmp_path / "data", PLANT, ["radius=4[0.5 mm]"]).experiments[0]
    np.testing.assert_allclose(halved.outputs[OUTPUT], headed()["radius [m]"] - 0.015, atol=1e-10)


def knee() -> Plant:
    """A shank that a torque turns."""
    m = Build("Knee", "A shank", "J dw/dt = u - c w - G a")
    u = m.input("torque", "N.m", nominal=5.0)
    angle, w = m.state("theta", "rad", nominal=0.6), m.state("omega", "rad/s", nominal=3.0)
    inertia = m.parameter("J", "kg.m2", 0.35)
    m.derivative(angle, w)
    m.derivative(w, (u - m.parameter("c", "N.m.s/rad", 2.0) * w - m.parameter("G", "N.m/rad", 9.8) * angle) / inertia)
    m.output("angle", "rad", angle)
    return Plant(m.model(), [Input("torque", held=True)], [Output("angle")], [Place("angle")])


def test_degrees_that_are_labelled_rad_and_seconds_that_are_labelled_ms_are_said_of_any_plant() -> None:
    plant = knee()
    time = np.arange(0, 8, 0.01)
    torque = np.where((time >= 1) & (time < 5), 4.0, 0.0)
    seen = Kernel(plant.model).simulate(Protocol(time, {"torque": torque}), time)["angle"]
    for clock, factor, words in ((1e-3, 1.0, "s labelled ms"), (1.0, 57.2958, "degrees labelled rad")):
        table = {
            "time [s]": clock * time,
            "torque [N.m]": torque,
            "angle [rad]": factor * seen + 1e-4 * np.cos(9 * time),
        }
        (said,) = tubular_dea.read_recordings({n: table for n in "abc"}, plant=plant).findings()[:1]
        assert words in said


@pytest.mark.parametrize("signal", ["torque", "angle", ""])
@pytest.mark.parametrize("stiffer", [1.0, 3.0])  # declared values may be rough
def test_a_signal_that_counts_the_other_way_in_one_file_is_asked_about(signal: str, stiffer: float) -> None:
    plant, time, tables = knee(), np.arange(0, 8, 0.01), {}
    for name, height in (("up", 4.0), ("down", -2.0), ("twice", 3.0), ("turned", 2.5)):
        torque = np.where((time >= 1) & (time < 5), height, 0.0) - np.where(time >= 6, 0.5 * height, 0.0)
        protocol = Protocol(time, {"torque": torque})
        seen = Kernel(plant.model).simulate(protocol, time, {"G": 9.8 * stiffer})["angle"]
        turned = {key: -1.0 if name == "turned" and key == signal else 1.0 for key in ("torque", "angle")}
        read = turned["angle"] * seen + 1e-4 * np.cos(9 * time)
        tables[name] = {"time [s]": time, "torque [N.m]": turned["torque"] * torque, "angle [rad]": read}
    said = tubular_dea.read_recordings(tables, plant=plant).findings()
    asked = [line for line in said if "wrong sign there" in line]
    expected = "turned: is torque or angle of the wrong sign there?"
    assert [line[: len(expected)] for line in asked] == ([expected] if signal else [])


def test_columns_of_inputs_that_are_exchanged_in_one_file_are_asked_about() -> None:
    """The numbers of the columns, in kPa and kV as they are headed there, not their SI values."""
    bench = read_folder(EXAMPLE, PLANT)
    one = next(e for e in bench.experiments if e.name == "08_heartbeat_5kV")
    swapped = {"pressure": one.inputs["voltage"] * 133.322e-3, "voltage": one.inputs["pressure"] * 1e3 / 133.322}
    units = {"pressure": "mmHg", "voltage": "kV"}
    source = SimpleNamespace(units=units, columns=("pressure", "voltage", "radius"))
    wrong = dataclasses.replace(one, inputs=swapped, source=source)
    others = [wrong if e is one else e for e in bench.experiments]
    (said,) = scales.findings(dataclasses.replace(bench, experiments=others))
    assert said.startswith(f"{one.name}: are the columns of pressure and voltage exchanged there? As it is, the declar")
    weaker = [dataclasses.replace(e, outputs={n: 0.7 * v for n, v in e.outputs.items()}) for e in [one]]
    bent = [weaker[0] if e is one else e for e in bench.experiments]
    assert not scales.findings(dataclasses.replace(bench, experiments=bent))


@pytest.mark.parametrize(
    ("signal", "factor", "words"),
    [
        ("pressure", 10.0, "is pressure 10 times too large (mbar labelled kPa) there?"),
        ("pressure", 0.1, "is pressure 10 times too small"),
        ("voltage", 1e-3, "is voltage 1000 times too small"),
        ("radius", 2.0, "is radius 2 times too large (a diameter for a radius) there?"),
        ("", 1.0, ""),
    ],
)
def test_a_unit_that_is_wrong_in_one_file_is_asked_about(signal: str, factor: float, words: str) -> None:
    """A pressure in mbar under [kPa] in one file of six was not asked about."""
    bench = read_folder(EXAMPLE, PLANT)
    one = next(e for e in bench.experiments if e.name == "03_step_6kV")
    inputs = {n: v * factor if n == signal else v for n, v in one.inputs.items()}
    outputs = {n: (v + 0.015) * (factor if signal == "radius" else 1) - 0.015 for n, v in one.outputs.items()}
    source = dataclasses.replace(one.source, units=dict(one.source.units) | {"pressure": "kPa"}) if one.source else None
    wrong = dataclasses.replace(one, inputs=inputs, outputs=outputs, source=source)
    said = scales.findings(
        dataclasses.replace(bench, experiments=[wrong if e is one else e for e in bench.experiments])
    )
    if words:
        assert len(said) == 1 and said[0].startswith(f"{one.name}: ") and words in said[0], said
    else:
        assert not said


def test_a_distance_that_falls_is_asked_about(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A laser's 42 mm less the displacement, given as the radius, was taken for 27 mm of displacement."""
    table = headed()
    table["Laser distance [um]"] = 1e6 * (0.042 - (table.pop("radius [m]") - 0.015))
    folder = written(tmp_path / "data", table).parent
    with pytest.raises(
        DataError, match=r"the middle reading of 'Laser distance', .* um, is neither that of r_o \(15000"
    ):
        read_folder(folder, PLANT)
    assert main(["identify", str(folder), "--dry-run", "--columns", "radius=4"]) == 0
    said = capsys.readouterr().out
    assert "is radius a distance from elsewhere, which falls as the displacement grows" in said
    advice = re.search(r"say --columns '(displacement=COLUMN\[-1 um from (\d+)\])'", said)
    assert advice and abs(float(advice[2]) - 42000) < 200
    counted = read_folder(folder, PLANT, ["displacement=4[-1 um from 42000]"])
    np.testing.assert_allclose(counted.experiments[0].outputs[OUTPUT], headed()["radius [m]"] - 0.015, atol=1e-9)
    with pytest.raises(
        DataError, match=r'displacement = "COLUMN \[-1 um from READING_AT_REST\]" below \[columns\] there'
    ):
        read_folder(folder, PLANT, ["displacement=4[-1 um]"])


@pytest.mark.parametrize(("unit", "more"), [("1 degC", 1.0), ("1 degF", 5 / 9), ("1 K", 1.0)])
def test_what_counts_from_a_reading_is_a_difference(tmp_path: Path, unit: str, more: float) -> None:
    """A warming from 20 degC was 273.15 K too large: a column of degC is in K as a temperature is."""
    m = Build("Block")
    power, warming = m.input("power", "W", nominal=5), m.state("warming", "K", nominal=20)
    m.derivative(warming, (4.0 * m.parameter("R", "K/W", 1.0) * power / 4.0 - warming) / m.parameter("tau", "s", 8.0))
    m.output("reading", "K", 1.0 * warming)
    plant, time = Plant(m.model(), [Input("power")], [Output("reading")]), np.arange(200) / 10
    table = {"time [s]": time, "power [W]": np.sin(time), "T1 [degC]": 20 + time}
    folder = written(tmp_path / "data", table).parent
    read = read_folder(folder, plant, [f"reading=T1[{unit} from 20]"]).experiments[0].outputs["reading"]
    np.testing.assert_allclose(read, more * time, atol=1e-9)


def test_two_columns_that_may_be_a_signal_are_told(tmp_path: Path) -> None:
    table = headed()
    table["Druck Soll [mbar]"] = table["Druck Ist [mbar]"] = table.pop("pressure [Pa]") / 100
    with pytest.raises(
        DataError, match=r"it may be Druck Soll \[mbar\] \(column 4\) or Druck Ist \[mbar\] \(column 5\)"
    ):
        read_experiment(written(tmp_path, table), PLANT)
    without = {h: v for h, v in headed().items() if "pressure" not in h}
    with pytest.raises(DataError, match=r"if there was none, add a column 'pressure \[Pa\]' of zeros"):
        read_experiment(written(tmp_path, without, "b.csv"), PLANT)


@pytest.mark.parametrize(
    ("label", "times", "words"),
    [
        ("mbar", 1e2, "the largest value is 8077.5 mbar; expected at most 1000 mbar: Pa labelled mbar?"),
        ("psi", 1.0, "80.775 psi; expected at most 14.5038 psi: mmHg or mbar or kPa labelled psi?"),
    ],
)
def test_a_label_is_doubted_in_the_unit_of_the_file(tmp_path: Path, label: str, times: float, words: str) -> None:
    """Every wrong pressure was "Pa labelled mmHg or kPa?", whatever the heading said."""
    table = headed()
    table[f"pressure [{label}]"] = times * table.pop("pressure [Pa]") / 100
    with pytest.raises(DataError) as refusal:
        read_experiment(written(tmp_path, table), PLANT)
    assert words in str(refusal.value)


def test_columns_of_inputs_that_are_exchanged_in_all_files_are_asked_about() -> None:
    """The numbers of the columns, in mmHg and kV as they are headed there, not their SI values."""
    bench = read_folder(EXAMPLE, PLANT)
    units = {"pressure": "mmHg", "voltage": "kV"}
    swapped = [
        dataclasses.replace(
            e,
            inputs={"pressure": e.inputs["voltage"] * 133.322e-3, "voltage": e.inputs["pressure"] * 1e3 / 133.322},
            source=SimpleNamespace(units=units, columns=("pressure", "voltage", "radius")),
        )
        for e in bench.experiments
    ]
    (said,) = scales.findings(dataclasses.replace(bench, experiments=swapped))
    assert said.startswith("are the columns of pressure and voltage exchanged? With the numbers as they are")


def test_no_sign_is_asked_about_where_too_few_files_tell_what_is_right() -> None:
    recordings = read_folder(EXAMPLE, PLANT)
    first = recordings.experiments[:2]
    turned = [dataclasses.replace(e, inputs=e.inputs | {"pressure": -e.inputs["pressure"]}) for e in first]
    assert not signs.wrong_signs(dataclasses.replace(recordings, experiments=turned))
    assert not signs.wrong_signs(recordings)


def test_without_out_there_is_only_a_dry_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written(tmp_path / "data", headed())
    assert main(["identify", str(tmp_path / "data")]) == 2
    assert "--out is missing" in capsys.readouterr().err
    assert main(["identify", str(tmp_path / "data"), "--out", str(tmp_path / "data" / ".")]) == 2
    assert "that is the folder of the recordings" in capsys.readouterr().err


def test_a_file_that_starts_under_a_small_load_is_told(tmp_path: Path) -> None:
    """A ramp whose first second was cut off: 11 mmHg of 95, 0.3 mm of 3."""
    data = table()
    whole = read_experiment(written(tmp_path, headed(), "whole.csv"), PLANT)
    assert detected(whole, PLANT) == RESTED
    cut = read_experiment(written(tmp_path, {h: v[60:] for h, v in headed().items()}, "cut.csv"), PLANT)
    assert detected(cut, PLANT) == UNKNOWN
    stepped = read_experiment(written(tmp_path, headed(pressure=data["pressure"] + 2000), "step.csv"), PLANT)
    assert detected(stepped, PLANT) == RESTED  # loaded at once, and the tube has not moved yet


def test_only_mistakes_that_may_be_made_are_tried() -> None:
    """A room whose start is free was asked whether its times are 60 times too small, a tank about its diameter."""
    m = Build("Tank", "A tank that drains", "A tank.")
    pump, rate = m.input("pump", "m/s", nominal=5e-3), m.parameter("rate", "1/s", 0.01, minimum=1e-4)
    level = m.state("level_of_water", "m", start="free", nominal=0.2)
    m.derivative(level, pump - rate * level)
    m.output("level", "m", level, "Level of the water")
    tank = Plant(m.model(), [Input("pump")], [Output("level")])
    tried = list(mistakes.mislabellings(tank, ["level"]))
    assert {"mm labelled cm", "cm labelled mm"} <= {w.words for w in tried}
    assert "a diameter for a radius" not in {w.words for w in tried}
    assert {w.words for w in tried if w.signal == "time"} == {"s labelled min", "ms labelled s"}  # none too small
    tube = {(w.signal, w.words) for w in mistakes.mislabellings(PLANT, ["measured_displacement"])}
    assert ("measured_displacement", "a radius for a diameter") in tube and ("time", "ms labelled s") in tube


def test_runs_that_were_appended_to_one_file_are_recordings_of_their_own(tmp_path: Path) -> None:
    """As where a recorder writes on in the same file, and its clock begins anew: it was refused."""
    once = headed()
    heading = ",".join(once)
    rows = [",".join(f"{v:.9g}" for v in row) for row in zip(*once.values(), strict=True)]
    (tmp_path / "a.csv").write_text("\n".join([heading, *rows, heading, *rows, *rows[:350]]) + "\n")
    found = read_folder(tmp_path, PLANT)
    assert [e.name for e in found.experiments] == ["a", "a_run2", "a_run3"]
    assert [e.time.size for e in found.experiments] == [400, 400, 350]
    first, second, _ = found.experiments
    np.testing.assert_array_equal(first.inputs["pressure"], second.inputs["pressure"])
    assert second.lines[0] == 403 and second.start == first.start
    said = [m for e in found.experiments if e.source for m in e.source.remarks if "its time starts anew" in m]
    assert "line 403" in said[0] and said[0].endswith("a_run2") and said[1].endswith("a_run3")
    (tmp_path / "a_run2.csv").write_text("\n".join([heading, *rows]) + "\n")
    with pytest.raises(DataError, match="two experiments are called a_run2: a file, and a part of another one"):
        read_folder(tmp_path, PLANT)
    (tmp_path / "a.csv").write_text("\n".join([heading, *rows, *rows[100:]]) + "\n")
    with pytest.raises(DataError, match="expected ascending times"):
        read_folder(tmp_path, PLANT)


def test_a_column_that_was_given_as_another_signal_is_said_to_be(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time [s],pressure [Pa],voltage [V],radius [m]\n0,1,2,0.01\n1,2,3,0.01\n")
    with pytest.raises(UserError, match="'voltage .V.' is missing; .*column 'voltage' was given as the radius"):
        tubular_dea.read_recordings(tmp_path, columns=["radius=voltage"])


@pytest.mark.parametrize("heading", ["t/ms", "elapsed (ms)"])
def test_a_temperature_is_no_time(tmp_path: Path, heading: str) -> None:
    """A logger's t/ms stands beside T/degC: small letters make both t, and units tell which is the time."""
    data = table()
    columns = {
        heading: 1e3 * data["time"],
        "P/kPa": data["pressure"] / 1e3,
        "HV/kV": data["voltage"] / 1e3,
        "r/mm": data["radius"] * 1e3,
        "T/degC": np.full(data["time"].size, 23.1),
    }
    recording = read_experiment(written(tmp_path / "set", columns, "a.csv"), PLANT)
    assert recording.time[-1] == pytest.approx(data["time"][-1])


@pytest.mark.parametrize(
    ("clock", "factor", "words"), [(1e3, 1.0, "time=COLUMN[ms]"), (1.0, 60.0, "L/min labelled L/s")]
)
def test_a_second_output_tells_what_the_first_does_not(clock: float, factor: float, words: str) -> None:
    """A lung's pressure follows the ventilator's at any pace, with times in ms too; its flow does not."""
    m = Build("Lung", "A lung behind a hose")
    given = m.input("ventilator_pressure", "Pa", "Of the ventilator", nominal=2000)
    hose = m.parameter("R", "Pa.s/m3", 1e5, "Resistance of the hose", minimum=1)
    compliance = m.parameter("C", "m3/Pa", 5e-7, "Compliance", minimum=1e-9)
    p = m.state("p", "Pa", "Pressure in the lung", start="free", nominal=2000)
    flow = m.define("flow_in", "m3/s", (given - p) / hose, "Flow through the hose", nominal=1e-3)
    m.derivative(p, flow / compliance)
    m.output("airway_pressure", "Pa", 0.98 * given + 0.02 * p, "Before the lung")
    m.output("flow", "m3/s", flow, "Through the hose", display_unit="L/s")
    plant = Plant(m.model(), inputs=[Input("ventilator_pressure")], outputs=[Output("airway_pressure"), Output("flow")])
    time = np.arange(0, 20, 0.01)
    pressure = 1000 + 800 * np.sin(2 * np.pi * 0.3 * time) + 200 * np.sin(2 * np.pi * 1.1 * time)
    seen = Kernel(plant.model).simulate(Protocol(time, {"ventilator_pressure": pressure}), time, {"p_start": 1000.0})
    noise = np.random.default_rng(5).standard_normal((2, time.size))
    table = {
        "time [s]": clock * time,
        "ventilator_pressure [Pa]": pressure,
        "airway_pressure [Pa]": seen["airway_pressure"] + noise[0],
        "flow [L/s]": factor * 1e3 * seen["flow"] + 1e-3 * noise[1],
    }
    (said,) = tubular_dea.read_recordings({n: table for n in "abc"}, plant=plant).findings()[:1]
    assert words in said


def test_a_radius_in_another_unit_that_was_taken_for_a_displacement_is_asked_about(tmp_path: Path) -> None:
    """15.0 to 20 um at rest and under load are no displacement: a search of 5 minutes had no answer."""
    table = headed()
    table["r [um]"] = 1e3 * table.pop("radius [m]")
    said = scales.findings(read_folder(written(tmp_path / "data", table).parent, PLANT))
    assert said and said[0].startswith("is displacement no change but a radius, mm labelled um?")
    assert "--columns 'radius=COLUMN[mm]'" in said[0]
    counted = read_folder(tmp_path / "data", PLANT, ["radius=4[mm]"])
    assert scales.findings(counted) == []


def test_inputs_that_are_exchanged_in_one_file_are_asked_about_there(tmp_path: Path) -> None:
    """All files together said that their times were in another unit."""
    for name in ("one", "two", "three"):
        written(tmp_path / "data", headed(), f"{name}.csv")
    table = headed()
    table["pressure [Pa]"], table["voltage [V]"] = table["voltage [V]"], table["pressure [Pa]"]
    written(tmp_path / "data", table, "other.csv")
    said = scales.findings(read_folder(tmp_path / "data", PLANT))
    assert len(said) == 1 and said[0].startswith("other: are the columns of pressure and voltage exchanged there?")
