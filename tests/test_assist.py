"""`tubular-dea assist`: what it writes, what it refuses; and the whole loop as an SSP archive in other tools."""

from __future__ import annotations

import dataclasses
import functools
import json
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from coupled import last_beats, needs, reference, slaves, stretch
from shared_data import shared
from tubular_dea.api.given import settings_of
from tubular_dea.cli import main
from tubular_dea.commands.assist import EXAMPLE
from tubular_dea.cosim.beats import INDICES, BeatError, beats, measure, r_wave_rows
from tubular_dea.cosim.course import Spread, _row
from tubular_dea.cosim.heart_assist import archive, fmus, heart_assist
from tubular_dea.cosim.master import Options, Run, simulate
from tubular_dea.model.dea import tubular_dea
from tubular_dea.model.patient_files import read_patient
from tubular_dea.model.units import factor, signed
from tubular_dea.model.windkessel import aortic_windkessel, patient
from tubular_dea.plants.effects import catalogue, with_effects
from tubular_dea.plants.saved import as_json
from tubular_dea.protocol import Protocol
from tubular_dea.sweep.expression import PlanError
from tubular_dea.sweep.plan import make_plan

STOP = 4.0  # s
WATCHED = ("heart.aortic_pressure", "scheduler.voltage", "tube.radial_displacement")


@functools.cache
def ssp() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="ssp-"))
    return archive(slaves(), folder / "HeartAssist.ssp", patient("failing"))


@functools.cache
def explicit() -> Run:
    """What every plain fixed-step master does: inputs held over each step, no events, no iteration."""
    values = patient("failing")
    start = {"tube.start_at_equilibrium": 0.0, "tube.lambda_2_start": stretch(values["aortic_pressure_start"])}
    system = dataclasses.replace(heart_assist(slaves(), values, start), events=())
    return simulate(system, STOP, Options("jacobi", cubic=False, restart=1.0)).completed()


def assert_same(rows: np.ndarray, tolerance: float) -> None:
    """Rows `time, *WATCHED` against our master at the same communication points, relative to the amplitudes."""
    ours = explicit()
    places = np.rint(rows[:, 0] * 1e3).astype(int)
    assert places[-1] == ours.time.size - 1
    for column, name in enumerate(WATCHED, start=1):
        difference = np.abs(rows[:, column] - ours[name][places]).max()
        assert difference <= tolerance * np.ptp(ours[name]), name
    assert ours["scheduler.pulses"][-1] >= 2, "the loop assists"


def elsewhere(code: str) -> np.ndarray:
    """Run Python code that leaves an array `rows`, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "rows.npy"
        given = f"import numpy as np\nSSP = {str(ssp())!r}\nSTEPS = {round(STOP * 1000)}\n"
        script = f"{given}{code}\nnp.save({str(result)!r}, rows)\n"
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr[-2000:]
        return np.load(result)


def loads(package: str) -> None:
    """Skip where the package or its system library is missing."""
    needs(package) if package == "fmpy" else None
    done = subprocess.run([sys.executable, "-c", f"import {package}"], capture_output=True, text=True, timeout=60)
    if done.returncode:
        from test_importers import unavailable

        unavailable(f"{package} does not load: {done.stderr.strip().splitlines()[-1]}")


def test_ssp_in_ecos() -> None:
    loads("ecospy")
    rows = elsewhere("""
from ecospy import EcosSimulation
names = ("heart::aortic_pressure", "scheduler::voltage", "tube::radial_displacement")
with EcosSimulation(ssp_path=SSP, step_size=1e-3) as simulation:
    simulation.init(parameter_set="start")
    rows = [(0.0, *(simulation.get_real(n) for n in names))]
    for step in range(STEPS):
        simulation.step()
        rows.append((simulation.get_time(), *(simulation.get_real(n) for n in names)))
    simulation.terminate()
rows = np.array(rows)
""")
    assert_same(rows, 1e-6)


def test_ssp_in_libcosim() -> None:
    loads("libcosimpy.CosimExecution")
    rows = elsewhere("""
from libcosimpy.CosimEnums import CosimVariableType
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver
log_output_level(CosimLogLevel.FATAL)
execution = CosimExecution.from_ssp_file(SSP, 1_000_000)
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
watched = []
for part, name in (("heart", "aortic_pressure"), ("scheduler", "voltage"), ("tube", "radial_displacement")):
    slave = execution.slave_index_from_instance_name(part)
    watched.append((slave, next(v.reference for v in execution.slave_variables(slave)
                                if v.name.decode() == name and v.type == CosimVariableType.REAL.value)))
rows = []
for step in range(STEPS):
    assert execution.step()
    rows.append((execution.status().current_time * 1e-9, *(observer.last_real_values(s, [r])[0] for s, r in watched)))
rows = np.array(rows)
""")
    assert_same(rows, 1e-9)


def test_ssp_in_fmpy() -> None:
    """FMPy checks the archive against the schemas. It gives every input 0 for the first step, connected or not: the
    tube feels no pressure for a millisecond, which takes seconds to be forgotten."""
    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import read_ssd, read_ssv

    assert len(read_ssd(str(ssp())).system.connections) == 7
    values = read_ssv(str(ssp()), "resources/start.ssv")
    result = simulate_ssp(str(ssp()), stop_time=STOP, step_size=1e-3, parameter_set=values)
    rows = np.column_stack([result["time"] + 1e-3, *(result[name] for name in WATCHED)])[: round(STOP * 1e3)]
    assert_same(rows[2000:], 5e-3)


# The command ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def assisted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("assist")
    assert main(["assist", "--patient", "failing", "--beats", "8", "--out", str(out)]) == 0
    return out


def test_assist_writes_a_report(assisted: Path) -> None:
    page = (assisted / "report.html").read_text()
    for text in ("stroke work per stroke volume", "early-diastolic augmentation", "with all losses", "volume [mL]"):
        assert text in page
    assert "Means over 3 beats, from the third assisted on." in page
    assert 'src="http' not in page and "cdn." not in page.split("</script>")[-1], "the page is self-contained"
    for name in ("pressure_volume_loops.png", "beats.png"):
        assert (assisted / name).read_bytes().startswith(b"\x89PNG")
    header = (assisted / "with_assist.csv").read_text().splitlines()[0]
    assert "heart.aortic_pressure [Pa]" in header and "tube.electric_field [V/m]" in header


def test_assist_helps_the_failing_heart(assisted: Path) -> None:
    summary = json.loads((assisted / "summary.json").read_text())
    assert summary["verdict"]["word"] == "assisted"
    passive, helped = ({n: f[which]["mean"] for n, f in summary["figures"].items()} for which in ("without", "with"))
    assert helped["stroke_work_per_stroke_volume"] < 0.99 * passive["stroke_work_per_stroke_volume"]
    assert helped["early_diastolic_pressure"] > passive["early_diastolic_pressure"]
    assert helped["stroke_volume"] > passive["stroke_volume"]
    assert 0 < helped["mechanical_energy"] < helped["electrical_energy"], "the wall's losses are between them"
    assert passive["mechanical_energy"] < 0, "without voltage the tube only takes"
    assert helped["largest_field"] < 80e6
    assert helped["tension_time_index"] < passive["tension_time_index"]
    assert summary["compared"]["diastolic_augmentation"] > 0
    assert summary["compared"]["end_diastolic_pressure_drop"] > 0
    assert summary["scheduler"]["pulses"] == 5  # of nine R waves: three are for learning, the last one comes at the end
    assert summary["beats"] == {
        "vetoed": 0,
        "assisted": 5,
        "skipped": 0,
        "after a lost rhythm": 0,
        "learning": 3,
        "without a pulse": 0,
        "premature": 0,
        "judged": 3,
    }


def test_figures_of_a_beat() -> None:
    run = explicit()
    rows = last_beats(run)
    assert np.diff(run.time[r_wave_rows(run)]) == pytest.approx(0.8, abs=2e-3)
    figures = measure(beats(run)[-1])
    loop = np.trapezoid(run["heart.ventricular_pressure"][rows], run["heart.ventricular_volume"][rows])
    assert figures["stroke_work"] == pytest.approx(-loop, rel=2e-3)
    assert figures["cardiac_output"] * factor("m3/s", "L/min") == pytest.approx(
        figures["stroke_volume"] / 0.8 * 60e3, rel=3e-3
    )
    with pytest.raises(BeatError, match="at least 9 whole beats"):
        last_beats(run, 9)


def test_figures_are_those_of_the_monolithic_run() -> None:
    """The same voltage on tube and heart as one system of equations, solved to 1e-10: all figures of assisted beats."""
    values = patient("failing")
    start = {"tube.start_at_equilibrium": 0.0, "tube.lambda_2_start": stretch(values["aortic_pressure_start"])}
    settings = start | {"scheduler.voltage_on": 5500.0}
    run = simulate(heart_assist(slaves(), values, settings), 8 * 0.8 + 0.05, Options(step=1e-3, order=1)).completed()
    exact = reference(values, Protocol.of(run.time, voltage=run["scheduler.voltage"]), run.time)
    whole = {name.replace("_", ".", 1): v for name, v in exact.values.items() if name.startswith(("heart_", "tube_"))}
    whole["scheduler.voltage"] = run["scheduler.voltage"]
    monolithic = beats(dataclasses.replace(run, values=whole))
    for beat, same in list(zip(beats(run), monolithic, strict=True))[3:]:
        ours, theirs = measure(beat), measure(same)
        assert set(ours) - set(theirs) == {"smallest_margin"}, "the margin is not in the monolithic system"
        for name, value in theirs.items():
            assert ours[name] == pytest.approx(value, rel=1e-3), name


def test_a_beat_without_ejection_has_no_number_made_up() -> None:
    run = explicit()
    shut = dict(run.values) | {"heart.aortic_flow": np.zeros(run.time.size)}
    figures = measure(beats(dataclasses.replace(run, values=shut))[0])
    assert "stroke_work_per_stroke_volume" not in figures and "tension_time_index" not in figures
    assert all(np.isfinite(v) for v in figures.values())


def test_too_much_voltage_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """At 9 kV every pulse is refused: the verdict says so, and the extremes are the whole run's."""
    assert main(["assist", "--voltage", "9 kV", "--beats", "9", "--out", str(tmp_path)]) == 0
    text = (tmp_path / "summary.json").read_text()
    summary = json.loads(text)
    assert "NaN" not in text and summary["verdict"]["word"] == "not"
    assert "last because of the field" in summary["verdict"]["text"]
    assert summary["beats"]["vetoed"] == 6 and summary["beats"]["assisted"] == 0
    assert summary["whole_run"]["largest_field"] > 80e6
    printed = capsys.readouterr().out
    assert printed.startswith("Not assisted: none of 6 beats") and "vetoed beats" in printed


def test_arrhythmia_is_partly_assisted(tmp_path: Path) -> None:
    """Regular beats, then one so early that nothing is ejected, and a pause."""
    times = np.concatenate([0.8 * np.arange(8), [5.6 + 0.3, 7.6], 7.6 + 0.8 * np.arange(1, 6)])
    (tmp_path / "r.txt").write_text("\n".join(map(str, times)))
    out = tmp_path / "out"
    assert main(["assist", "--r-times", str(tmp_path / "r.txt"), "--beats", "13", "--out", str(out)]) == 0
    text = (out / "summary.json").read_text()
    summary = json.loads(text)
    assert summary["verdict"]["word"] == "partly" and "NaN" not in text and "nan" not in text
    assert summary["beats"]["premature"] == summary["beats"]["skipped"] == 1
    assert summary["beats"]["after a lost rhythm"] == 1
    figures = summary["figures"]["stroke_volume"]["with"]
    assert figures["worst"] <= figures["mean"] and figures["beats"] == summary["beats"]["judged"]
    assert "premature R wave" in (out / "report.html").read_text()


@pytest.mark.long
def test_a_tube_with_an_effect_beats_in_the_loop(tmp_path: Path) -> None:
    """Electrodes that charge with a lag of 30 ms: the largest field is lower, and the FMU says what it is."""
    import fmpy

    lag = with_effects(tubular_dea(), ["electrode_resistance"])
    lag = lag.with_values({**catalogue()["electrode_resistance"].typical, "tau_e": 0.03})
    (tmp_path / "model.json").write_text(as_json(lag))
    found = {}
    for name, more in (("paper", []), ("lag", ["--model", str(tmp_path / "model.json")])):
        assert main(["assist", "--beats", "7", "--out", str(tmp_path / name), *more]) == 0
        found[name] = json.loads((tmp_path / name / "summary.json").read_text())["whole_run"]["largest_field"]
    assert found["lag"] < 0.999 * found["paper"]
    plan = {"model": "AssistedHeart", "tube": "model.json", "outputs": ["max tube_electric_field"]}
    assert make_plan(plan, tmp_path).model.parameter_values()["tube_tau_e"] == 0.03
    with pytest.raises(PlanError, match="expected a model.json beside model"):
        make_plan(plan | {"model": "TubularDEA"}, tmp_path)
    drive = ["--pressure", "95 mmHg", "--voltage", "step 0 5 kV at 0.1", "--stop", "0.2", "--out", str(tmp_path)]
    largest = []
    for more in ([], ["--model", str(tmp_path / "model.json")]):
        assert main(["simulate", *drive, *more]) == 0
        table = np.genfromtxt(tmp_path / "response.csv", delimiter=",", names=True)
        largest.append(table["electric_field_Vm"][12])
    assert largest[1] < 0.8 * largest[0], "20 ms after the step the electrodes are still charging"
    description = fmpy.read_model_description(str(fmus(tmp_path, tube=lag)["tube"]))
    assert description.modelName == "TubularDEA with electrode_resistance"
    assert "effects added: electrode_resistance" in description.description


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--patient", "fialing"], "no patient 'fialing'; did you mean failing"),
        (["--voltage", "high"], "--voltage: expected a number"),
        (["--controller", "18mm", "--voltage", "5kV"], "--controller and --voltage exclude each other: a controller"),
        (["--voltage", "5kV", "--set", "scheduler.voltage_on=4kV"], "--voltage and --set scheduler.voltage_on exclude"),
        (["--compare", "voltage=5kV", "--controller", "18mm"], "--compare and --controller exclude each other: "),
        (["--largest-voltage", "3kV"], "--largest-voltage belongs to --optimise; give both, or leave it out"),
        (["--lead", "II"], "--lead belongs to --ecg; give both"),
        (["--voltage", "5 mmHg"], "expected a unit like 'V' but was given 'mmHg'"),
        (["--beats", "2"], "--beats: expected at least 5"),
        (["--set", "hart.C=1"], "--set hart.C=1: expected PART.PARAMETER=VALUE with one of the parts scheduler"),
        (["--set", "heart.c=1"], "AorticWindkessel has no parameter 'c'"),
        (["--set", "heart.C=1mmHg"], "expected a unit like 'm3/Pa'"),
        (["--set", "heart.C=-1"], "expected 1e-11 to 1e-06 m3/Pa but was given -1"),
        (["--set", "heart.C"], "expected a number with a unit like 'm3/Pa' but was given ''; for example heart.C="),
        (["--set", "heart.heart_rate=75 /mn"], "; for example heart.heart_rate=75/min"),
        (["--set", "heart.C=1e-9", "--set", "heart.C=1e-8"], "--set heart.C is given twice; give it once"),
        (["--ecg", "nothing.hea"], "nothing: cannot be read as a WFDB record: there is no file nothing.hea"),
        (["--step", "0"], "step: expected a positive number"),
        (["--ecg", "nothing.csv"], "assist: nothing.csv: cannot be read: No such file or directory"),
        (["--r-times", "nothing.txt"], "assist: nothing.txt: cannot be read: No such file or directory"),
        (["--patient", __file__], "expected a patient's .toml, as `tubular-dea patient` writes it, or one of healthy"),
        (["--patient", "nothing.toml"], "assist: nothing.toml: cannot be read: No such file or directory"),
        (["--ecg", "a.hea", "--r-times", "b.txt"], "--ecg and --r-times exclude each other: "),
        (["--r-times", "{folder}/fast.txt"], "fast.txt: 600 beats found in 72.0 s; expected 15 to 250 a minute"),
        (["--r-times", "{folder}/back.txt"], "back.txt, line 4: expected ascending times but 1.2 s follows 2 s; sort"),
        (["--r-times", "{folder}/words.txt"], "words.txt, line 2: expected a number but found 'abc'"),
        (["--ecg", "{folder}/empty.csv"], "empty.csv: expected the columns 'time [s]' and 'ecg [mV]' and at least two"),
        (["--ecg", "{folder}/back.csv"], "back.csv, line 4: expected ascending times but 0.1 s follows 0.2 s; sort"),
        (["--ecg", "{folder}/back.csv", "--lead", "II"], "back.csv, line 1: expected the columns 'time [s]' and 'II"),
        (["--compare", "voltag=5kV"], "--compare voltag=5kV: expected PART.PARAMETER=VALUE with one of the parts"),
        (["--compare", "voltag=5kV"], "; did you mean voltage?"),
        (["--compare", "hart.C=1"], "; did you mean heart.C?"),
        (["--compare", "voltage"], "--compare voltage: expected NAME=VALUE, as in voltage=5kV, but found 'voltage'"),
        (["--patient", "stiff", "--scheme", "jacobi"], "the jacobi scheme diverges"),
    ],
)
def test_assist_refuses_in_one_line(
    arguments: list[str], text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "fast.txt").write_text("\n".join(f"{0.12 * i:.2f}" for i in range(600)))
    (tmp_path / "back.txt").write_text("0.5\n\n2.0\n1.2\n")
    (tmp_path / "words.txt").write_text("0.5\nabc\n1.2\n")
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "back.csv").write_text("time [s],ecg [mV]\n0,1\n0.2,\n0.1,3\n")
    given = [a.replace("{folder}", str(tmp_path)) for a in arguments]
    assert main(["assist", *given, "--out", str(tmp_path)]) == 2
    message = capsys.readouterr().err.strip().splitlines()[-1]
    assert text in message
    assert message.startswith("tubular-dea assist: ")


def test_a_run_that_ends_early_leaves_nothing(tmp_path: Path) -> None:
    assert main(["assist", "--patient", "stiff", "--scheme", "jacobi", "--out", str(tmp_path / "out")]) == 2
    assert not (tmp_path / "out").exists()


def test_patient_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    values = {n: f"{v!r}" for n, v in patient("failing").items()}
    values["C"] = '"1.1 mL/mmHg"'
    file = tmp_path / "mine.toml"
    file.write_text("\n".join(f"{n} = {v}" for n, v in values.items()))
    assert main(["assist", "--patient", str(file), "--beats", "5", "--out", str(tmp_path / "out")]) == 0
    base = tmp_path / "based.toml"
    base.write_text('based_on = "failing"\nC = "1.1 mL/mmHg"\n')
    assert read_patient(str(base)) == read_patient(str(file))
    base.write_text('[patient]\nC = "1.1 mL/mmHg"\n')
    assert main(["assist", "--patient", str(base), "--out", str(tmp_path / "none")]) == 2
    assert "based.toml: [patient]: expected no tables; write the keys at the top" in capsys.readouterr().err
    base.write_text('based_on = "fialing"\n')
    assert main(["assist", "--patient", str(base), "--out", str(tmp_path / "none")]) == 2
    assert "based_on: there is no patient 'fialing'; did you mean failing" in capsys.readouterr().err
    base.write_text('based_on = "failing"\nRR = "2 mmHg.s/mL"\n')  # refused by its name: its unit is not known
    assert main(["assist", "--patient", str(base), "--out", str(tmp_path / "none")]) == 2
    assert "patient 'based.toml': there is no parameter 'RR'; did you mean R?" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()
    del values["R"]
    file.write_text("\n".join(f"{n} = {v}" for n, v in values.items()))
    assert main(["assist", "--patient", str(file), "--out", str(tmp_path / "out")]) == 2
    assert "patient 'mine.toml' lacks R; give R (Peripheral resistance)" in capsys.readouterr().err


def test_beats_of_a_recorded_ecg(tmp_path: Path) -> None:
    needs("wfdb")
    needs("sleepecg")
    record = shared("ecg/100.hea")
    assert main(["assist", "--ecg", str(record), "--beats", "12", "--out", str(tmp_path)]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["scheduler"]["beats"] == 13


def test_recorded_beats_are_hit(tmp_path: Path) -> None:
    times = np.cumsum([0.5, 0.8, 0.85, 0.7, 0.9, 0.8, 0.75, 0.8])
    file = tmp_path / "r.txt"
    file.write_text("\n".join(str(t) for t in times))
    assert main(["assist", "--r-times", str(file), "--beats", "6", "--out", str(tmp_path)]) == 0
    table = np.genfromtxt(tmp_path / "with_assist.csv", delimiter=",", names=True, deletechars="")
    phase = table[next(n for n in table.dtype.names if n.startswith("heart.phase"))]
    at = table[table.dtype.names[0]][np.flatnonzero(np.diff(np.floor(phase + 1e-5)) > 0) + 1]
    assert np.allclose(at, (times - times[0])[1:7], atol=1e-9)


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    ["windkessel_alone", "heartbeat_on_ecg", "assisted_failing_heart", "snap_through_veto", "hold_beyond_the_fold"],
)
def test_examples_run_as_they_are(name: str, tmp_path: Path) -> None:
    script = Path(__file__).resolve().parents[1] / "cosim_examples" / f"{name}.py"
    if name == "heartbeat_on_ecg":
        needs("wfdb")
        needs("sleepecg")
        shared("ecg/100.hea")
    done = subprocess.run([sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-2000:]
    assert list(tmp_path.glob("*.png")), "a picture is written where it is run"


def test_the_ecg_s_example_says_how_to_give_a_record_where_there_is_none(tmp_path: Path) -> None:
    script = Path(__file__).resolve().parents[1] / "cosim_examples" / "heartbeat_on_ecg.py"
    done = subprocess.run([sys.executable, str(script), "no.hea"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("heartbeat_on_ecg.py: there is no no.hea; give a recorded ECG, as in python")


def test_the_examples_of_the_help_assist(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (line,) = [line for line in EXAMPLE.splitlines() if "--patient stiff" in line]
    _, *arguments = shlex.split(line)
    assert main([*arguments[:-1], str(tmp_path / "out"), "--beats", "8"]) == 0
    said = capsys.readouterr().out
    assert "vetoed" not in said and re.search(r"beats assisted +5\n", said)


def test_a_rate_is_read_as_it_is_advised() -> None:
    assert settings_of({"heart": aortic_windkessel()}, {"heart.heart_rate": "100/min"}) == {
        "heart.heart_rate": 100 / 60
    }


@pytest.mark.parametrize(
    ("without", "assisted", "shown"),
    [
        (50.896, 50.884, ("50.90", "50.88 ± 0.00", "-0.02 (0.0 %)")),
        (3.8151, 3.8149, ("3.82", "3.81 ± 0.00", "-0.01 (0.0 %)")),
        (50.881, 50.879, ("50.88", "50.88 ± 0.00", "0.00 (0.0 %)")),
        (50.0, 51.0, ("50.00", "51.00 ± 0.00", "+1.00 (+2.0 %)")),
    ],
)
def test_a_change_is_that_of_the_numbers_beside_it(without: float, assisted: float, shown: tuple[str, ...]) -> None:
    (figure,) = [f for f in INDICES if f.name == "stroke_volume"]
    a, b = (Spread(v * 1e-6, 0.0, v * 1e-6, 3) for v in (without, assisted))
    course = SimpleNamespace(
        without={figure.name: a}, assisted={figure.name: b}, change=lambda name: b.mean / a.mean - 1
    )
    _, before, after, _, change = _row(figure, course)
    assert (before, after, change) == shown


def test_no_sign_stands_before_nothing() -> None:
    assert [signed(v, 1) for v in (-0.04, 0.04, -0.0, -0.06, 12.34)] == ["0.0", "0.0", "0.0", "-0.1", "+12.3"]


def test_more_beats_than_memory_holds_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A million were accepted: 380 GB, and two hours until that showed."""
    assert main(["assist", "--beats", "1000000", "--out", str(tmp_path / "out")]) == 2
    assert "--beats: expected at most 12500, or a larger step, but was given 1000000" in capsys.readouterr().err
