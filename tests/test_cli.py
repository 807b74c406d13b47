"""The command line: what it writes, and one clear line with a non-zero exit for a user's mistake."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from tubular_dea.cli import COMMANDS, main

TANKS = str(Path(__file__).parents[1] / "cosim_examples" / "plants" / "cascaded_tanks.py")


def run(*arguments: str) -> int:
    return main(list(arguments))


def test_simulate_writes_a_table_and_a_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "run"
    code = run(
        "simulate",
        "--pressure",
        "95 mmHg",
        "--voltage",
        "step 0 5 kV at 1000 ms",
        "--stop",
        "2s",
        "--interval",
        "10ms",
        "--out",
        str(out),
        "--set",
        "start_at_equilibrium=true",
    )
    assert code == 0
    rows = list(csv.reader((out / "response.csv").read_text().splitlines()))
    assert rows[0][:3] == ["time [s]", "pressure [Pa]", "voltage [V]"]
    assert len(rows) == 202
    radius = rows[0].index("radius [m]")
    assert float(rows[1][radius]) == pytest.approx(17.82e-3, abs=1e-5)
    assert float(rows[-1][radius]) > 18.5e-3
    assert (out / "response.png").read_bytes().startswith(b"\x89PNG")
    assert "largest displacement" in capsys.readouterr().out


def test_simulate_warns_of_a_wrong_unit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "in.csv"
    file.write_text("time [s],pressure [Pa],voltage [kV]\n0,0,0\n1,95,5\n", encoding="utf-8")
    assert run("simulate", "--inputs", str(file), "--out", str(tmp_path / "out")) == 0
    assert "column 'pressure': the largest value is 95 Pa" in capsys.readouterr().err
    file.write_text(file.read_text().replace("[Pa]", "[mmHg]"), encoding="utf-8")
    assert run("simulate", "--inputs", str(file), "--out", str(tmp_path / "out")) == 0
    assert "warning" not in capsys.readouterr().err


def test_simulate_warns_of_a_tube_that_runs_away(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("simulate", "--pressure", "95 mmHg", "--voltage", "12 kV", "--stop", "1", "--out", str(tmp_path)) == 0
    said = capsys.readouterr()
    assert said.err == "warning: the pressure passes the snap-through fold at 0 s: the tube runs away there\n"
    assert "runs away" not in said.out


def test_simulate_warns_of_a_field_that_no_elastomer_stands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("simulate", "--pressure", "95 mmHg", "--voltage", "7 kV", "--stop", "1", "--out", str(tmp_path)) == 0
    assert "reaches 95.61 V/um: expected at most 80 V/um" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["simulate", "build", "atlas", "handbook", "lab", "identify", "close-loop"])
def test_help_calls_the_plant_what_it_is(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        run(command, "--help")
    assert "the plant: its file, or tube (default) or aorta" in " ".join(capsys.readouterr().out.split())


def test_help_says_which_files_of_inputs_are_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        run("simulate", "--help")
    said = " ".join(capsys.readouterr().out.split())
    assert "or a file of any kind that close-loop reads, whose header names quantity and unit" in said
    file = tmp_path / "in.csv"
    file.write_text("time [ms],remark,pressure [kPa],voltage [kV]\n0,a,0,0\n500,b,9.5,5\n", encoding="utf-8")
    assert run("simulate", "--inputs", str(file), "--out", str(tmp_path / "out")) == 0
    file.write_text("t (s);p (mmHg);U (kV);AI3\n0;0;0;0\n0,5;9,5;5;4\n", encoding="utf-8")
    assert run("simulate", "--inputs", str(file), "--out", str(tmp_path / "out")) == 0
    assert "voltage 0 to 5 kV" in capsys.readouterr().out
    words = ["simulate", "--inputs", str(file), "--columns", "voltage=AI3[kV]", "--out", str(tmp_path / "out")]
    assert run(*words) == 0 and "voltage 0 to 4 kV" in capsys.readouterr().out
    file.write_text("t (s);p (mmHg)\n0;0\n0,5;9,5\n", encoding="utf-8")
    assert run("simulate", "--inputs", str(file), "--out", str(tmp_path / "out")) == 2
    assert "column 'voltage [V]' is missing" in capsys.readouterr().err


def test_a_unit_that_was_left_out_is_asked_about(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """5.5 V and 95 Pa were computed in silence."""
    assert run("simulate", "--pressure", "95", "--voltage", "5.5", "--stop", "1", "--out", str(tmp_path / "run")) == 0
    said = capsys.readouterr().err
    assert "pressure: the largest value is 95 Pa; expected at least 400 Pa: was its unit left out?" in said
    assert "voltage: the largest value is 5.5 V; expected at least 25 V" in said
    assert run("assist", "--voltage", "5.5", "--out", str(tmp_path / "assisted")) == 2
    assert "--voltage: expected 0, or at least 25 V, but was given 5.5 V; was 5.5 kV meant?" in capsys.readouterr().err


def test_simulate_does_not_write_over_its_inputs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`--inputs run/response.csv` without --out was lost, as the usual folder is `run`."""
    file = tmp_path / "response.csv"
    file.write_text("time [s],pressure [mmHg],voltage [kV]\n0,0,0\n1,95,5\n", encoding="utf-8")
    before = file.read_bytes()
    assert run("simulate", "--inputs", str(file), "--out", str(tmp_path)) == 2
    assert "response.csv is the file of inputs; expected another folder" in capsys.readouterr().err
    assert file.read_bytes() == before and list(tmp_path.iterdir()) == [file]


def test_simulate_reads_what_it_wrote(tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    assert (
        run(
            "simulate",
            "--pressure",
            "ramp 0 95 mmHg from 0 to 1",
            "--voltage",
            "0 V",
            "--stop",
            "1",
            "--out",
            str(first),
        )
        == 0
    )
    assert run("simulate", "--inputs", str(first / "response.csv"), "--out", str(second)) == 0
    last = [(path / "response.csv").read_text().splitlines()[-1].split(",")[3] for path in (first, second)]
    assert float(last[0]) == pytest.approx(float(last[1]), abs=1e-7)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "--pressure is missing: expected a file of inputs, or each of pressure, voltage"),
        (
            ["--pressure", "95 mmHg"],
            "--voltage is missing: expected a file of inputs, or each of pressure, voltage, as in",
        ),
        (["--pressure", "95 mmHg"], 'as in --voltage "step 0 5 kV at 1"'),
        (
            ["--plant", TANKS],
            'simulate: pump is missing: expected a file of inputs, or each of pump, as in --input "pump=',
        ),
        (["--plant", TANKS], 'as in --input "pump=step 0 5 V at 1"'),
        (["--pressure", "95 mmHgg"], "pressure: cannot read the unit 'mmHgg'"),  # before what was not given at all
        (["--pressure", "95 mmHg", "--stop", "soon"], "--stop: expected a number with a unit like 's'"),
        (["--pressure", "95 mmHg", "--interval", "soon"], "--interval: expected a number with a unit like 's'"),
        (["--pressure", "95 mmHg", "--tolerance", "1"], "--tolerance: expected 1e-12 to 1e-2 but was given 1"),
        (["--set", "C_9=1"], "no parameter 'C_9'; did you mean"),
        (["--pressure", "1", "--voltage", "0", "--input", "voltage=5kV"], "voltage=5kV and --voltage give the same"),
        (["--pressure", "1", "--input", "voltage=0", "voltage=1"], "voltage=1 and another --input voltage=... give"),
        (["--pressure", "95 barn", "--voltage", "0"], "cannot read the unit 'barn'"),
        (["--inputs", "no.csv"], "no.csv: cannot be read"),
        (["--voltage", "0", "--columns", "voltage=3"], "--columns: these are of a file of inputs, but none was given"),
        (
            ["--inputs", "no.csv", "--voltage", "0"],
            "--inputs and --voltage exclude each other: the file has all inputs",
        ),
        (["--inputs", "no.csv", "--input", "voltage=0"], "--inputs and --input exclude each other: the file has all"),
        (["--inputs", "no.csv", "--stop", "3"], "--inputs and --stop exclude each other: the file has all inputs, and"),
        (["--pressure", "1", "--voltage", "0", "--stop", "-1"], "expected a positive number of seconds"),
        (["--pressure", "1", "--voltage", "0", "--stop", "soon"], "--stop: expected a number with a unit like 's'"),
        (["--pressure", "1", "--voltage", "0", "--interval", "5kV"], "--interval: expected a unit like 's'"),
        (["--pressure", "1", "--voltage", "0", "--interval", "0"], "--interval: expected more than 0"),
        (["--pressure", "1", "--voltage", "0", "--interval", "1e-9"], "expected at most 1e7"),
        (["--pressure", "1", "--voltage", "0", "--tolerance", "0"], "--tolerance: expected"),
        (["--pressure", "1", "--voltage", "0", "--set", "C_9=1"], "no parameter 'C_9'; did you mean"),
        (["--pressure", "1", "--voltage", "0", "--set", "r_o=-1 mm"], "expected 0.0001 to 10 m but was given -0.001 m"),
        (["--pressure", "1", "--voltage", "0", "--set", "C_1=-3kPa"], "expected at least 1 Pa but was given -3000 Pa"),
        (["--pressure", "95 mmGh", "--voltage", "0"], "pressure: cannot read the unit 'mmGh'"),
        (["--pressure", "95 mmGh", "--voltage", "0"], "did you mean mmHg"),
        (
            ["--pressure", "0", "--voltage", "step 0 5 kV at 20", "--stop", "3"],
            "voltage: 20 s is not before the end of the run (3 s)",
        ),
        (
            ["--pressure", "0", "--voltage", "step 0 5 kV at 2 until 1", "--stop", "3"],
            "expected times that rise but was given 2 and 1 s",
        ),
        (
            ["--pressure", "0", "--voltage", "wiggle 0 5 kV"],
            'voltage: cannot read \'wiggle 0 5 kV\'; expected "5 kV", "step 0',
        ),
        (["--pressure", "nofile.csv", "--voltage", "0"], "a file holds all inputs and is given as inputs"),
        (["--pressure", "1", "--voltage", "0", "--model", "README.md"], "--model README.md: expected a model.json"),
        (["--pressure", "1", "--voltage", "0", "--model", "no.json"], "tubular-dea simulate: there is no file no.json"),
        (["--pressure", "1", "--voltage", "0", "--set", "C_1=1 kV"], "expected a unit like 'Pa' but was given 'kV'"),
        (["--pressure", "1", "--voltage", "0", "--set", "C_1"], "expected a number with a unit like 'Pa'"),
        (["--pressure", "300mmHg", "--voltage", "7kV", "--set", "start_at_equilibrium=true"], "no rest state"),
    ],
)
def test_mistakes_cost_one_line(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert run("simulate", *arguments, "--out", str(out)) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert message in lines[0]
    assert not out.exists(), "bad input leaves nothing behind"


def test_the_bare_command_shows_its_help(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([])
    assert ended.value.code == 0 and "COMMAND" in capsys.readouterr().out


MISTAKES = [
    (["simulte"], "tubular-dea: argument COMMAND: invalid choice: 'simulte'"),
    (
        ["simulate", "--tolerance", "so"],
        "tubular-dea simulate: argument --tolerance: expected a number but was given 'so'",
    ),
    (["assist", "--beats", "2.5"], "tubular-dea assist: argument --beats: expected a whole number but was given '2.5'"),
    (
        ["identify", "x", "--seed", "one"],
        "tubular-dea identify: argument --seed: expected a whole number but was given",
    ),
    (["build", "--platforms", "amiga"], "tubular-dea build: argument --platforms: invalid choice: 'amiga'"),
    (["sweep", "a.toml", "--out", "b", "--workers", "1", "--scheduler", "c"], "tubular-dea sweep: argument --sch"),
    *(
        (
            [c, *["x"] * (c in ("identify", "sweep", "close-loop", "patient")), "--out", "y", "--nope\0"],
            f"tubular-dea {c}: unrecognized arguments: --nope\\x00; see tubular-dea {c} --help",
        )
        for c in COMMANDS
    ),
]


@pytest.mark.parametrize(("arguments", "message"), MISTAKES)
def test_mistaken_options_cost_one_line(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit_:
        run(*arguments)
    assert exit_.value.code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line.startswith(message)
    assert line.endswith("--help")


def test_build_writes_all_three_fmus(tmp_path: Path) -> None:
    assert run("build", "--out", str(tmp_path)) == 0
    names = {str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*.fmu")}
    assert {"fmi2/TubularDEA.fmu", "fmi3/TubularDEA.fmu", "python/TubularDEA.fmu"} <= names


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit_:
        run(command, "--help")
    assert exit_.value.code == 0
    assert f"tubular-dea {command}" in capsys.readouterr().out.split("example", 1)[1]


def test_a_negative_amount_is_a_value_and_no_option(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["assist", "--voltage", "-5kV"]) == 2
    assert "expected one argument" not in (said := capsys.readouterr().err) and "voltage" in said


def test_interrupted_while_a_command_is_imported(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(name: str, parser: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("tubular_dea.cli.declare", interrupted)
    assert run("simulate", "--pressure", "95 mmHg") == 130
    assert capsys.readouterr().err == "tubular-dea simulate: interrupted\n"
