"""Recordings: units from headers, gaps, and checks that name file, line and column."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from test_edges import slewing
from tubular_dea import read_recordings
from tubular_dea.cli import main
from tubular_dea.identify.inputs.drive import drive, drives
from tubular_dea.identify.records.data import read_experiment as read_of
from tubular_dea.identify.records.data import read_folder as folder_of
from tubular_dea.identify.records.experiment import DataError, Experiment, Recordings
from tubular_dea.identify.signals.monitors import noise_level, polyline
from tubular_dea.identify.signals.noise import Noise, estimate
from tubular_dea.model.declare import Quantity
from tubular_dea.plants.tube import PLANT
from tubular_dea.report.understood import Understanding, _first

HEADER = "time [s],pressure [Pa],voltage [V],radius [m]"
OUTPUT = PLANT.outputs[0].name


def read_experiment(path: Path) -> Experiment:
    """A recording of the tube."""
    return read_of(path, PLANT)


def read_folder(folder: Path, **options: object) -> Recordings:
    """A folder of recordings of the tube."""
    return folder_of(folder, PLANT, **options)


def rows(n: int = 400, seed: int = 0) -> np.ndarray:
    """A plausible recording: a pressure ramp, a voltage step, a radius that follows; time, Pa, V, m."""
    random = np.random.default_rng(seed)
    t = np.arange(n) * 0.004
    pressure = 8000 * np.minimum(t / 0.8, 1) + 25 * random.standard_normal(n)
    voltage = 4000.0 * (t >= 1.0) + 4 * random.standard_normal(n)
    radius = 0.015 + 2e-7 * pressure + 4e-4 * (t >= 1.0) + 15e-6 * random.standard_normal(n)
    return np.column_stack([t, pressure, voltage, radius])


def written(
    folder: Path, table: np.ndarray, header: str = HEADER, name: str = "a.csv", scale: tuple = (1, 1, 1, 1)
) -> Path:
    path = folder / name
    lines = [",".join(f"{v:.9g}" for v in row) for row in table / np.array(scale, float)]
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    return path


def test_an_absolute_pressure_is_told_as_one(tmp_path: Path) -> None:
    """101 325 Pa too much were "Pa labelled mmHg or kPa?"."""
    table = rows()
    table[:, 1] += 101_325.0
    with pytest.raises(
        DataError, match=r"'pressure'.* expected at most 100000 Pa: an absolute pressure, with the air's\?"
    ):
        read_experiment(written(tmp_path, table))


@pytest.mark.parametrize("beside", [(), ("b.csv",)])
def test_a_spreadsheet_is_refused_until_it_is_saved_as_csv(tmp_path: Path, beside: tuple[str, ...]) -> None:
    for name in beside:
        written(tmp_path, rows(), name=name)
    for name in ("a.xlsx", "~$a.xlsx"):  # what Excel leaves while a file is open is none
        (tmp_path / name).write_bytes(b"PK\x03\x04")
    with pytest.raises(DataError, match=r": a\.xlsx: expected recordings .* found spreadsheets, .* save each as CSV"):
        read_folder(tmp_path)
    written(tmp_path, rows(), name="a.csv")
    assert [e.name for e in read_folder(tmp_path).experiments] == ["a", *(name[0] for name in beside)]


@pytest.mark.parametrize(
    ("header", "scale"),
    [
        ("time [ms],pressure [mmHg],voltage [kV],radius [mm]", (1e-3, 133.322, 1e3, 1e-3)),
        ("time [s],pressure [kPa],voltage [V],radius [um]", (1, 1e3, 1, 1e-6)),
    ],
)
def test_units_come_from_the_header(tmp_path: Path, header: str, scale: tuple) -> None:
    plain = read_experiment(written(tmp_path, rows()))
    other = read_experiment(written(tmp_path, rows(), header, "b.csv", scale))
    np.testing.assert_allclose(other.time, plain.time, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(other.outputs[OUTPUT], plain.outputs[OUTPUT], atol=1e-10)
    for name in ("pressure", "voltage"):
        np.testing.assert_allclose(other.inputs[name], plain.inputs[name], rtol=1e-7, atol=1e-5)


def test_displacement_may_stand_for_radius(tmp_path: Path) -> None:
    table = rows()
    shifted = table - [0, 0, 0, 0.015]
    a = read_experiment(written(tmp_path, table))
    b = read_experiment(written(tmp_path, shifted, HEADER.replace("radius", "displacement"), "b.csv"))
    np.testing.assert_allclose(a.outputs[OUTPUT], b.outputs[OUTPUT], atol=1e-9)


def test_gaps_and_irregular_times_are_understood(tmp_path: Path) -> None:
    path = written(tmp_path, np.delete(rows(), [50, 51, 90], axis=0))
    lines = path.read_text().splitlines()
    for i in (100, 101):
        lines[i] = lines[i].rsplit(",", 1)[0] + ","
    cells = lines[120].split(",")
    lines[120] = ",".join([cells[0], "", *cells[2:]])
    path.write_text("\n".join(lines) + "\n")
    experiment = read_experiment(path)
    assert experiment.time.size == 397
    assert (~experiment.seen(OUTPUT)).sum() == 2
    assert np.all(np.isfinite(experiment.inputs["pressure"]))


def _spoil(kind: str, table: np.ndarray) -> np.ndarray:
    table = table.copy()
    if kind == "time":
        table[[200, 201]] = table[[201, 200]]
    elif kind == "mmHg":
        table[:, 1] /= 133.322
    elif kind == "kV":
        table[:, 2] /= 1e3
    elif kind == "frozen":
        table[150:230, 3] = table[150, 3]
    elif kind == "saturated":
        table[:, 3] = np.minimum(table[:, 3], np.quantile(table[:, 3], 0.7))
    elif kind == "saturated with noise":
        stop = np.quantile(table[:, 3], 0.7)
        noise = 2e-6 * np.random.default_rng(2).standard_normal(table.shape[0])
        table[:, 3] = np.where(table[:, 3] > stop, stop + noise, table[:, 3])
    elif kind == "below":
        table[:, 3] -= 0.004
    elif kind == "constant":
        table[:, 3] = 0.0162 + 15e-6 * np.random.default_rng(1).standard_normal(table.shape[0])
    elif kind == "mm":
        table[:, 3] *= 1e3
    elif kind == "ms":
        table[:, 0] /= 1e3
    elif kind == "frozen pressure":
        table[230:330, 1] = table[230, 1]
    elif kind == "saturated pressure":
        table[:, 1] = np.minimum(table[:, 1], 7000.0)
    elif kind == "infinite":
        table[100, 2] = np.inf
    elif kind in ("no radius", "no pressure"):
        table[:, 3 if kind == "no radius" else 1] = np.nan
    return table


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("time", ["line 203", "'time'", "sort the lines"]),
        ("mmHg", ["line ", "'pressure'", "mmHg"]),
        ("kV", ["line ", "'voltage'", "kV labelled V"]),
        ("frozen", ["lines 152 to 231", "'radius'", "frozen"]),
        ("saturated", ["'radius'", "saturated"]),
        ("saturated with noise", ["'radius'", "saturated", "with noise of 2"]),
        ("below", ["line ", "'radius'", "below the radius at rest, 0.015 m", "a 'displacement' that starts at 0"]),
        ("constant", ["'radius'", "constant record"]),
        ("mm", ["'radius'", "labelled m"]),
        ("ms", ["lines 2 to 401", "'time'", "s labelled ms"]),
        ("frozen pressure", ["lines 232 to 331", "'pressure'", "frozen"]),
        ("saturated pressure", ["line ", "'pressure'", "saturated", "read 7000"]),
        ("infinite", ["line 102", "'voltage'", "finite"]),
        ("no radius", ["'radius'", "too few samples: 0 numbers"]),
        ("no pressure", ["'pressure'", "more than half of the lines have none"]),
    ],
)
def test_bad_recordings_are_refused_with_their_place(tmp_path: Path, kind: str, words: list[str]) -> None:
    path = written(tmp_path, _spoil(kind, rows()))
    with pytest.raises(DataError) as refusal:
        read_experiment(path)
    for word in [str(path), *words]:
        assert word in str(refusal.value)


@pytest.mark.parametrize("command", ["identify", "close-loop"])
@pytest.mark.parametrize("kind", ["time", "kV", "frozen", "constant", "below"])
def test_the_commands_say_it_in_one_line_and_write_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture, command: str, kind: str
) -> None:
    data = tmp_path / "data"
    data.mkdir()
    written(data, rows())
    written(data, _spoil(kind, rows()), name="b.csv")
    assert main([command, str(data), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "b.csv, line" in said
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_all_files_with_faults_are_named_at_once(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """Whoever mended one met the next only in the next run."""
    data = tmp_path / "data"
    data.mkdir()
    written(data, rows())
    for name, kind in (("b.csv", "saturated"), ("c.csv", "frozen")):
        written(data, _spoil(kind, rows()), name=name)
    assert main(["close-loop", str(data), "--out", str(tmp_path / "out")]) == 2
    first, second = capsys.readouterr().err.splitlines()
    assert "b.csv, line" in first and "saturated" in first
    assert "c.csv, lines 152 to 231" in second


@pytest.mark.parametrize(
    ("command", "step", "words"),
    [("identify", 6, "67 samples are too few for 9 parameters"), ("close-loop", 2, "200 samples are too few")],
)
def test_too_few_samples_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture, command: str, step: int, words: str
) -> None:
    data = tmp_path / "data"
    data.mkdir()
    written(data, rows()[::step])
    assert main([command, str(data), "--out", str(tmp_path / "out")]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_what_a_computer_wrote_may_stand_still(tmp_path: Path) -> None:
    """A noiseless record is no frozen sensor: a smooth rise, then rest."""
    table = rows()
    t = table[:, 0]
    table[:, 1] = 8000 * np.sin(np.pi * np.minimum(t, 0.5)) ** 2
    table[:, 2] = 4000.0 * (t >= 1.0)
    table[:, 3] = 0.015 + 2e-7 * table[:, 1]
    assert read_experiment(written(tmp_path, table)).time.size == 400


def test_the_message_quotes_what_stands_in_the_file(tmp_path: Path) -> None:
    table = _spoil("frozen", rows()) - [0, 0, 0, 0.015]
    words = rf"column 'displacement': the sensor is frozen: 80 equal values {table[150, 3]:g}"
    with pytest.raises(DataError, match=words):
        read_experiment(written(tmp_path, table, HEADER.replace("radius", "displacement")))


def test_decimal_commas_between_commas_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path, rows())
    header, *lines = path.read_text().splitlines()
    path.write_text("\n".join([header, *(line.replace(".", ",") for line in lines)]))
    with pytest.raises(DataError, match="line 2: [78] cells below 4 headings.* decimal commas"):
        read_experiment(path)


def test_an_input_is_read_from_the_only_column_in_a_unit_of_its_kind(tmp_path: Path) -> None:
    path = written(tmp_path, rows(), HEADER.replace("pressure [Pa]", "P_lumen (Pa)"))
    found = read_experiment(path)
    assert any("pressure is read from" in remark and "only column" in remark for remark in found.source.remarks)
    np.testing.assert_array_equal(
        found.inputs["pressure"], read_experiment(written(tmp_path, rows())).inputs["pressure"]
    )


def test_missing_columns_and_too_few_samples_are_refused(tmp_path: Path) -> None:
    for column in ("pressure", "voltage"):
        path = written(tmp_path, rows(), re.sub(rf"{column} \[\w+\]", "something [s]", HEADER))
        with pytest.raises(DataError, match=rf"line 1: column '{column} .* is missing"):
            read_experiment(path)
    with pytest.raises(DataError, match="too few samples: 20 lines"):
        read_experiment(written(tmp_path, rows()[:20]))
    with pytest.raises(DataError, match="no experiment usable"):
        empty = tmp_path / "empty"
        empty.mkdir()
        read_folder(empty)
    bad = written(tmp_path, rows())
    bad.write_text(bad.read_text().replace("0.4,", "0.4,x", 1))
    with pytest.raises(DataError, match="line 102, column 'pressure': expected a number"):
        read_experiment(bad)


def test_bench_file_gives_geometry_and_noise(tmp_path: Path) -> None:
    written(tmp_path, rows())
    (tmp_path / "bench.toml").write_text('[geometry]\nr_o = "14.8 mm"\n[noise]\nradius = "20 um"\n')
    recordings = read_folder(tmp_path)
    assert recordings.geometry == {"r_o": pytest.approx(0.0148)}
    assert recordings.noise == {"radius": pytest.approx(20e-6)}
    (tmp_path / "bench.toml").write_text("[noise]\nradius = -1\n")
    with pytest.raises(DataError, match="radius: expected more than 0"):
        read_folder(tmp_path)
    (tmp_path / "bench.toml").write_text('[noise]\nradius = "0 um"\n')
    with pytest.raises(DataError, match="radius: expected more than 0 but found '0 um': no sensor is without noise"):
        read_folder(tmp_path)
    (tmp_path / "bench.toml").write_text('[noise]\nvoltage = "0 V"\npressure = 0\n')
    commanded = read_folder(tmp_path)
    assert commanded.noise == {"voltage": 0.0, "pressure": 0.0}
    driven = drives(commanded.experiments, commanded.plant.inputs, commanded.noise)[0]
    record = commanded.experiments[0]
    assert driven.noise == {"voltage": 0.0, "pressure": 0.0}
    assert driven.protocol.at(record.time)["pressure"] == pytest.approx(record.inputs["pressure"], abs=1e-6)
    (tmp_path / "bench.toml").write_text("[geometry]\nradius_of_the_tube = 3\n")
    with pytest.raises(DataError, match="radius_of_the_tube"):
        read_folder(tmp_path)
    (tmp_path / "bench.toml").write_text("[geometry]\nh_ao = 100\n")
    with pytest.raises(DataError, match="h_ao: expected 1e-08 to 1 m but found 100; a number without a unit is in SI"):
        read_folder(tmp_path)
    (tmp_path / "bench.toml").write_text("geometry = 3\n")
    with pytest.raises(DataError, match=r"expected a table \[geometry\] but found geometry = '3'"):
        read_folder(tmp_path)


def test_a_monitors_noise_is_told_from_its_signal() -> None:
    random = np.random.default_rng(3)
    t = np.arange(4000) * 0.004
    truth = np.interp(t, [0, 1, 6, 6.02, 10, 16], [0, 8000, 8000, 12000, 12000, 5000])
    noisy = truth + 25 * random.standard_normal(t.size)
    line = polyline(t, noisy, noise_level(noisy))
    error = np.interp(t, t[line.corners], line.values) - truth
    assert line.corners.size < 15
    assert np.sqrt(np.mean(error**2)) < 4


def test_a_moving_signal_is_kept_as_it_is() -> None:
    t = np.arange(2000) * 0.004
    truth = 9000 + 2000 * np.sin(2 * np.pi * 1.3 * t) + 500 * np.sin(2 * np.pi * 9 * t)
    noisy = truth + 25 * np.random.default_rng(0).standard_normal(t.size)
    line = polyline(t, noisy, noise_level(noisy))
    assert (
        np.sqrt(np.mean((np.interp(t, t[line.corners], line.values) - truth) ** 2)) < 30
    )  # as little as the noise itself


@pytest.mark.parametrize("correlation", [0.0, 0.5])
def test_noise_is_estimated_from_the_record_alone(correlation: float) -> None:
    random = np.random.default_rng(5)
    t = np.arange(8000) * 0.004
    truth = 3e-3 * (1 - np.exp(-t / 3))
    record = truth + Noise(15e-6, correlation).sample(t, random)
    found = estimate([(t, record, np.array([0.0, 10.0, 32.0]))])
    assert found.rms == pytest.approx(15e-6, rel=0.04)
    assert found.correlation == pytest.approx(correlation, abs=0.05)


def test_drive_keeps_switching_between_the_samples_where_it_was(tmp_path: Path) -> None:
    driven = drive(read_experiment(written(tmp_path, rows())), PLANT.inputs)
    (edge,) = driven.edges
    assert (edge.earliest, edge.latest) == (pytest.approx(0.996), pytest.approx(1.0))
    protocol = driven.moved(np.array([edge.latest - edge.time]))  # the amplifier switched at the sample
    for one, at in ((driven.protocol, edge.time), (protocol, 1.0)):
        doubled = one.time[1:][np.diff(one.time) == 0]
        assert round(at, 9) in np.round(doubled, 9)
        assert one.at(np.array([at]))["voltage"][0] == pytest.approx(4000, abs=5)
        assert one.at(np.array([at - 0.001]))["voltage"][0] == pytest.approx(0, abs=5)


@pytest.mark.parametrize("empty", ["nan", ""])
def test_a_second_output_without_a_number_is_not_used(tmp_path: Path, empty: str) -> None:
    path = written(tmp_path, rows())
    first, *lines = path.read_text().splitlines()
    path.write_text("\n".join([f"{first},current [A]", *(f"{line},{empty}" for line in lines)]) + "\n")
    read = read_experiment(path)
    assert list(read.outputs) == [OUTPUT]
    assert "current has no number here, and is not used" in read.source.remarks


def test_a_dry_run_tells_the_slope_of_an_amplifier() -> None:
    """Of 1.5 kV a millisecond: how long its edges last depends on how high they are."""
    random = np.random.default_rng(3)
    corners, heights = slewing(random, 1.5e6, 30)
    time = np.arange(0, corners[-2] + 0.4, 1 / 500)
    voltage = np.interp(time, corners, heights)
    table = {
        "time [s]": time,
        "pressure [Pa]": 12e3 * np.clip(time - 0.1, 0, 0.3) + 25 * random.standard_normal(time.size),
        "voltage [V]": voltage + 4 * random.standard_normal(time.size),
        "radius [m]": 0.015 + 1e-7 * voltage + 15e-6 * random.standard_normal(time.size),
    }
    lines = Understanding(read_recordings({"steps": table})).lines()
    (said,) = (line for line in lines if line.startswith("slopes"))
    found = re.fullmatch(r"slopes     voltage (\S+) kV a millisecond, at most", said)
    assert found is not None and float(found[1]) == pytest.approx(1.5, rel=0.1)


def test_what_a_slow_camera_reads_first_is_its_first_reading() -> None:
    """Of a radius in every eighth row all of the first samples may hold no number."""
    values = np.where(np.arange(200) % 100 == 99, 2e-3, np.nan)
    one = Experiment("one", np.arange(200.0), {}, {"radius": values}, np.arange(200))
    length = Quantity("radius", "m", "Radius", display_unit="mm")
    assert _first(one, length, "mm", "radius") == "2"
    empty = Experiment("one", np.arange(200.0), {}, {"radius": np.full(200, np.nan)}, np.arange(200))
    assert _first(empty, length, "mm", "radius") == ""
