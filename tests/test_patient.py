"""`tubular-dea patient`: a known patient is found again, recorded ones are fitted, what is not told is said so."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import tubular_dea as td
from coupled import needs
from shared_data import shared
from tubular_dea.cli import main
from tubular_dea.kernel import Kernel
from tubular_dea.model.patient_files import read_patient
from tubular_dea.model.patients import ML, MMHG, RESISTANCE
from tubular_dea.model.windkessel import PARAMETERS, aortic_windkessel, patient
from tubular_dea.patients.patient import fit_patient
from tubular_dea.patients.recorded_beat import BEAT_POINTS, PatientRecordError, RecordedBeat, average, read_signals
from tubular_dea.protocol import Protocol

PERIOD = 0.8
BENCH = Path(__file__).parents[1] / "cosim_examples" / "data" / "bench"


def recorded(values: dict[str, float], beats: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time [s], pressure [Pa] and flow [m3/s] of the last `beats` beats of a patient's, every 4 ms."""
    time = np.arange(0, beats * PERIOD, 0.004)
    stop = (12 + beats) * PERIOD
    run = Kernel(aortic_windkessel()).simulate(Protocol.of([0, stop], tube_flow=[0, 0]), 12 * PERIOD + time, values)
    return time, run["aortic_pressure"], run["aortic_flow"]


def table(
    path: Path, time: np.ndarray, pressure: np.ndarray, flow: np.ndarray | None = None, ecg: np.ndarray | None = None
) -> Path:
    columns = {"time [s]": time, "pressure [mmHg]": pressure / MMHG}
    columns |= {"flow [mL/s]": flow / ML} if flow is not None else {}
    columns |= {"ecg [mV]": ecg} if ecg is not None else {}
    np.savetxt(path, np.column_stack(list(columns.values())), "%.7g", ",", header=",".join(columns), comments="")
    return path


def beat_of(values: dict[str, float], with_flow: bool) -> RecordedBeat:
    """A noiseless steady beat, turned by a third."""
    time = 12 * PERIOD + np.arange(BEAT_POINTS) * PERIOD / BEAT_POINTS
    run = Kernel(aortic_windkessel()).simulate(Protocol.of([0, 14 * PERIOD], tube_flow=[0, 0]), time, values)
    pressure, flow = (np.roll(run[n], BEAT_POINTS // 3) for n in ("aortic_pressure", "aortic_flow"))
    return RecordedBeat(PERIOD, 1, pressure, 0 * pressure, flow if with_flow else None, "")


@pytest.mark.parametrize("with_flow", [True, False])
def test_a_known_patient_is_found_again(with_flow: bool) -> None:
    truth = patient(
        "healthy",
        {
            "elements": 3.0,
            "R": 1.3 * RESISTANCE,
            "C": 0.9 * ML / MMHG,
            "Z_c": 0.05 * RESISTANCE,
            "E_max": 2.6 * MMHG / ML,
        },
    )
    beat = beat_of(truth, with_flow)
    _, _, flow = recorded(truth, 1)
    found = fit_patient(beat, patient("healthy"), None if with_flow else float(flow.mean()))
    assert found.misfit < 0.5 * MMHG
    for name, estimate in found.estimates.items():
        assert estimate.low <= truth.get(name, 0.2) <= estimate.high, name  # the default T_offset is 0.2 s
    known = {n for n, e in found.estimates.items() if e.identified}
    assert {"R", "C"} <= known
    assert ("E_max" in known) >= with_flow
    assert "V_0" not in known, "the volume without pressure does not show in the arteries"
    if with_flow:
        assert found.estimates["R"].value == pytest.approx(truth["R"], rel=0.05)


def test_the_average_beat(tmp_path: Path) -> None:
    time, pressure, flow = recorded(patient("healthy", {"elements": 3.0}), 12)
    random = np.random.default_rng(2)
    path = table(tmp_path / "p.csv", time, pressure + random.normal(0, 0.5 * MMHG, time.size), flow)
    beat = average(read_signals(path), "p.csv")
    assert beat.period == pytest.approx(PERIOD, abs=0.004)
    assert beat.beats >= 9
    assert beat.pressure.min() / MMHG == pytest.approx(pressure.min() / MMHG, abs=0.7)
    assert beat.flow is not None and beat.flow.mean() == pytest.approx(flow.mean(), rel=0.02)


def test_human_beat(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = shared("aorta/stergiopulos1999_data")
    out = tmp_path / "human.toml"
    given = [str(folder / "apressure.csv"), "--flow", str(folder / "aflow.csv"), "--out", str(out)]
    assert main(["patient", *given]) == 0
    printed = capsys.readouterr().out
    assert float(re.search(r"Misfit of the pressure ([\d.]+) mmHg", printed)[1]) < 2.5
    assert "Not identifiable from this recording" in printed and "V_0" in printed
    values = read_patient(str(out))
    # Mean pressure over mean flow of the recording is the whole resistance.
    pressure, flow = (np.loadtxt(folder / name, delimiter=",")[:, 1].mean() for name in ("apressure.csv", "aflow.csv"))
    assert (values["R"] + values["Z_c"]) / RESISTANCE == pytest.approx((pressure - 7.4) / flow, rel=0.12)
    assert values["heart_rate"] * 60 == pytest.approx(72.3, abs=0.1)
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    assert main(["assist", "--patient", str(out), "--beats", "6", "--out", str(tmp_path / "assisted")]) == 0


def test_every_fitted_parameter_is_told_with_its_meaning(tmp_path: Path) -> None:
    found = td.fit_patient(Path(__file__).parents[1] / "cosim_examples" / "data" / "pig" / "in_vivo.csv")
    meant = {p.quantity.name: p.quantity.description for p in PARAMETERS}
    toml = found.report(tmp_path / "pig.toml")[0].read_text()
    for name in found.found.estimates:
        (line,) = [line for line in found.lines() if line.startswith(f"{name} ")]
        assert meant[name] in line and meant[name] in toml
    labels = [text.get_text() for axis in found.plot().axes for text in axis.get_legend().get_texts()]
    assert "fitted" in labels and "patient" not in labels


def test_record_of_arterial_pressure_and_ecg(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    needs("wfdb")
    needs("sleepecg")
    record, out = shared("ecg/03700181.hea"), tmp_path / "p.toml"
    assert main(["patient", str(record), "--cardiac-output", "1 L/min", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "123.0 a minute" in printed and "1 L/min (+- 20 %) is assumed" in printed
    assert float(re.search(r"Misfit of the pressure ([\d.]+) mmHg", printed)[1]) < 1.5
    assert read_patient(str(out))["elements"] == 3


BEATING = (90 + 20 * np.sin(2 * np.pi * 1.25 * np.arange(0, 10, 0.01))) * MMHG


def headed(path: Path, columns: str) -> None:
    """A table over time with two columns of other headings."""
    table(path, np.arange(1000) * 0.01, BEATING, BEATING)
    path.write_text(path.read_text().replace("pressure [mmHg],flow [mL/s]", columns, 1))


@pytest.mark.parametrize(
    ("make", "arguments", "text"),
    [
        (lambda p: p.write_text("a,b\n1,2\n"), [], "x.csv"),
        (lambda p: table(p, np.arange(1000) * 0.01, np.full(1000, 90 * MMHG)), [], "beats by more than 1 mmHg"),
        (lambda p: table(p, np.arange(1000) * 0.01, BEATING / 100), [], "expected 10 to 300: check its unit"),
        (lambda p: table(p, np.arange(1000) * 0.01, BEATING), ["--cardiac-output", "5 mmHg"], "--cardiac-output: "),
        (
            lambda p: table(p, np.arange(1000) * 0.01, BEATING),
            ["--cardiac-output", "5"],
            "--cardiac-output: expected 0",
        ),
        (lambda p: table(p, np.arange(1000) * 0.01, BEATING), ["--cardiac-output", "500 L/min"], "given 500 L/min; a"),
        (lambda p: table(p, np.arange(1000) * 0.01, BEATING), ["--cardiac-output", "-5 L/min"], "given -5 L/min; a"),
        (lambda p: table(p, np.arange(1000) * 0.01, BEATING, -BEATING * ML), [], "a flow with a positive mean but it"),
        (
            lambda p: headed(p, "pressure [mmHg],pressure [mmHg]"),
            [],
            "line 1: column 'pressure' appears twice; expected",
        ),
        (
            lambda p: headed(p, "druck [mmHg],sog [Pa]"),
            [],
            "as in 'pressure [mmHg]', but found time [s], druck [mmHg], s",
        ),
        (lambda p: table(p, np.arange(1000) * 0.01, BEATING), ["--out", "{folder}/out.json"], "ends in .toml"),
        (lambda p: table(p, np.arange(1000) * 0.01, BEATING), ["--based-on", "helthy"], "did you mean healthy"),
        (lambda p: table(p, np.arange(1000) * 0.01, BEATING, BEATING), ["--cardiac-output", "5 L/min"], "has a flow"),
        (lambda p: table(p, np.arange(1000) * 0.01, BEATING, ecg=np.zeros(1000)), [], "does not move"),
    ],
)
def test_bad_recordings_are_refused(
    make: object, arguments: list[str], text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "x.csv"
    make(path)
    given = [a.replace("{folder}", str(tmp_path)) for a in arguments]
    out = [] if "--out" in given else ["--out", str(tmp_path / "out.toml")]
    assert main(["patient", str(path), *given, *out]) == 2
    message = capsys.readouterr().err.strip().splitlines()[-1]
    assert message.startswith("tubular-dea patient: ") and text in message
    assert {f.name for f in tmp_path.iterdir()} == {"x.csv"}, "nothing is written"


def courses_without_beats() -> dict[str, np.ndarray]:
    """Pressures [mmHg] every 5 ms for 20 s in which no heart beats."""
    time, random = np.arange(0, 20, 0.005), np.random.default_rng(3)
    white = random.normal(0, 1, time.size)
    walk = np.cumsum(white) - np.linspace(0, white.sum(), time.size)
    red = np.convolve(white, np.exp(-np.arange(400) * 0.005 / 0.2), "same")
    return {
        "white noise": 95 + 5 * white,
        "random walk": 95 + 15 * walk / np.abs(walk).max(),
        "red noise": 95 + 20 * red / np.abs(red).max(),
        "stairs": 40 + 10 * np.floor(time / 2) + 0.5 * white,
        "ramp": 40 + 5 * time + 0.05 * white,
        "ramp and hold": 40 + 60 * np.clip(time - 5, 0, 1) + 0.5 * white,
    }


@pytest.mark.parametrize("kind", courses_without_beats())
def test_what_does_not_beat_is_refused(kind: str, tmp_path: Path) -> None:
    course = courses_without_beats()[kind]
    path = table(tmp_path / "x.csv", np.arange(course.size) * 0.005, course * MMHG)
    with pytest.raises(PatientRecordError, match="x.csv: no heart beats found: .* recording of the arterial pressure"):
        average(read_signals(path), "x.csv")


@pytest.mark.parametrize("name", ["01_ramp_4kV", "03_step_6kV", "04_ramp_7kV", "05_pressure_steps"])
def test_ramps_of_a_bench_are_no_beats(name: str) -> None:
    path = BENCH / f"{name}.csv"
    with pytest.raises(PatientRecordError, match=r"no heart beats found: .* mmHg above the last|beats of like length"):
        average(read_signals(path), name)


@pytest.mark.parametrize("who", ["healthy", "failing", "stiff"])
@pytest.mark.parametrize("disturbance", ["noise", "breathing", "drift"])
def test_disturbed_beats_are_beats(who: str, disturbance: str, tmp_path: Path) -> None:
    time, pressure, _ = recorded(patient(who), 12)
    added = {
        "noise": np.random.default_rng(2).normal(0, 2, time.size),
        "breathing": 20 * np.sin(2 * np.pi * 0.25 * time),
        "drift": 30 * time / time[-1],
    }[disturbance]
    beat = average(read_signals(table(tmp_path / "x.csv", time, pressure + added * MMHG)), "x")
    assert beat.beats == 11 and beat.period == pytest.approx(PERIOD, rel=0.03)


def test_a_heartbeat_on_the_bench_is_one() -> None:
    assert average(read_signals(BENCH / "08_heartbeat_5kV.csv"), "bench").beats >= 3


def test_a_flow_counts_where_it_covers_whole_beats(tmp_path: Path) -> None:
    time, pressure, flow = recorded(patient("healthy", {"elements": 3.0}), 12)
    whole, short = tmp_path / "p.csv", tmp_path / "q.csv"
    whole.write_text(table(whole, time, pressure).read_text().replace("pressure", "Druck", 1))
    beats = []
    for part in (time.size, time.size // 2):
        np.savetxt(short, np.column_stack([time, flow / ML])[:part], "%.7g", ",", header="t [s],Q [mL/s]", comments="")
        beats.append(average(read_signals(whole, short), "p"))
    assert np.allclose(beats[0].flow, beats[1].flow, atol=ML)
    assert beats[0].remarks == ("The pressure is read from 'Druck', the only column in a unit of its kind.",)
    assert beats[1].remarks[1:] == ("The flow covers 5 of these beats.",)
    np.savetxt(short, np.column_stack([time, flow / ML])[:60], "%.7g", ",", header="t [s],Q [mL/s]", comments="")
    with pytest.raises(PatientRecordError, match="the flow covers 0 whole beats of the pressure's .* or leave it out"):
        average(read_signals(whole, short), "p")


def test_an_ecg_with_twice_as_many_beats(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Spikes at every half beat: an ECG whose T waves pass for R waves."""
    needs("sleepecg")
    time = np.arange(0, 30, 0.004)
    pressure = (90 + 20 * np.sin(2 * np.pi * 1.25 * time)) * MMHG
    ecg = np.exp(-(((time * 2.5) % 1 - 0.5) ** 2) / 2e-4) + 0.001 * np.sin(time)
    path = table(tmp_path / "x.csv", time, pressure, ecg=ecg)
    assert main(["patient", str(path), "--out", str(tmp_path / "out.toml")]) == 2
    assert re.search(r"7\d beats found in the ECG but 3\d in the pressure; check the lead", capsys.readouterr().err)


def test_the_valves_closure_begins_no_beat() -> None:
    """In a pig's aorta (shipped) the pressure rises as steeply after the notch as at the upstroke."""
    path = Path(__file__).parents[1] / "cosim_examples" / "data" / "pig" / "in_vivo.csv"
    beat = average(read_signals(path), "pig")
    assert beat.beats == 4 and 60 / beat.period == pytest.approx(71, abs=1)
