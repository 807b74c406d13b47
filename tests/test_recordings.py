"""Files of laboratories: read to exactly the numbers that were meant, or refused with the place and what to do."""

from __future__ import annotations

import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.constants
import scipy.io

from injuries import injured
from laboratory import drawn
from tubular_dea.api import unusual
from tubular_dea.api.recordings import read_recordings
from tubular_dea.identify.records.data import read_experiment, read_folder
from tubular_dea.identify.records.experiment import DataError
from tubular_dea.identify.records.lost import lost_samples
from tubular_dea.identify.records.spikes import spikes
from tubular_dea.identify.records.unused import not_used
from tubular_dea.identify.records.updates import repeated_readings
from tubular_dea.kernel import Kernel
from tubular_dea.model.units import converted, factor
from tubular_dea.plants import Build, Input, Output, Plant
from tubular_dea.plants.tube import PLANT
from tubular_dea.protocol import Protocol
from tubular_dea.recordings import NoTableError, ReadError, Table, read
from tubular_dea.recordings.cells import decimal_mark, numbers
from tubular_dea.recordings.heading import parts
from tubular_dea.recordings.text import read_text

SI = {"time": "s", "pressure": "Pa", "voltage": "V", "radius": "m", "current": "A"}
NAMES = ("time", "pressure", "voltage", "radius")


def saved(folder: Path, text: str | bytes, name: str = "a.csv") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def columns(table: Table) -> dict[str, np.ndarray]:
    return {c.name: c.values for c in table.columns}


@pytest.mark.parametrize("seed", range(120))
def test_files_of_any_laboratory(seed: int, tmp_path: Path) -> None:
    file = drawn(seed)
    table = read(saved(tmp_path, file.raw), NAMES)
    by_name = {c.name: c for c in table.columns}
    for name, values in file.values.items():
        column = by_name[name]
        assert not column.problem, file.habits
        np.testing.assert_allclose(column.values, values, rtol=1e-14, atol=1e-9 if column.clock else 0, err_msg=name)
        assert factor(column.unit, SI[name]) == pytest.approx(file.si[name], rel=1e-12), column.heading


@pytest.mark.parametrize("seed", range(66))
def test_injured_files_are_refused_with_the_place(seed: int, tmp_path: Path) -> None:
    injury = injured(seed)
    path = saved(tmp_path, injury.raw)
    with pytest.raises(ReadError) as refusal:
        read_experiment(path, PLANT)
    said = str(refusal.value)
    assert said.startswith(str(path)) and "\n" not in said and len(said) < 300 + len(str(path)), said
    for word in injury.words:
        assert word.lower() in said.lower(), (injury.kind, said)


@pytest.mark.parametrize(
    ("heading", "name", "unit"),
    [
        ("time [s]", "time", "s"),
        ("time (s)", "time", "s"),
        ("time_s", "time", "s"),
        ("Time/s", "time", "s"),
        ("TIME", "time", ""),
        ("U / kV", "u", "kV"),
        ("Radius, mm", "radius", "mm"),
        ("p in mbar", "p", "mbar"),
        ("laser_2", "laser_2", ""),
        ("laser_2 [\u00b5m]", "laser_2", "\u00b5m"),
        ("flow/(mL/s)", "flow", "mL/s"),
        ("Radial displacement (mm)", "radial_displacement", "mm"),
        ("V/Vmax", "v_vmax", ""),
        ("radius_1", "radius_1", ""),
        ("pressure [foo]", "pressure", "foo"),
        ('"time [s]"', "time", "s"),
        ("flow [L/min] (filtered)", "flow", "L/min"),
    ],
)
def test_headings_are_taken_apart(heading: str, name: str, unit: str) -> None:
    assert parts(heading) == (name, unit)


@pytest.mark.parametrize(
    ("unit", "expected", "value"),
    [
        ("\u00b5m", "m", 1e-6),
        ("\u03bcm", "m", 1e-6),
        ("MBAR", "Pa", 100),
        ("psig", "Pa", scipy.constants.psi),
        ("Torr", "Pa", scipy.constants.torr),
        ("cm H2O", "Pa", 98.0665),
        ("atm", "Pa", scipy.constants.atm),
        ("L\u00b7min^-1", "m3/s", 1e-3 / 60),
        ("m\u00b3/s", "m3/s", 1),
        ("bpm", "Hz", 1 / 60),
        ("/min", "Hz", 1 / 60),
        ("(/ s)", "1/s", 1),
        ("rpm", "rad/s", scipy.constants.pi / 30),
        ("rpm", "Hz", 1 / 60),
        ("mrad", "rad", 1e-3),
        ("Hz", "rad/s", 2 * scipy.constants.pi),
        ("deg/s", "Hz", 1 / 360),
        ("1/min", "rad/s", 2 * scipy.constants.pi / 60),  # revolutions: K was 6.28 times too large
        ("min^-1", "rad/s", 2 * scipy.constants.pi / 60),
        ("U/min", "rad/s", 2 * scipy.constants.pi / 60),
        ("rev/min", "rad/s", 2 * scipy.constants.pi / 60),
        ("rad/min", "rad/s", 1 / 60),
        ("deg/min", "deg/s", 1 / 60),
        ("1/s", "rad/s", 1),
        ("mH", "V.s/A", 1e-3),
        ("PA", "Pa", 1),
        ("KV", "V", 1e3),
        ("inch", "m", scipy.constants.inch),
        ("kg/(m.s)", "Pa.s", 1),
        ("m s-1", "m/s", 1),
        ("microns", "m", 1e-6),
        ("hours", "s", 3600),
        ("mm Hg", "Pa", 133.322),
        ("nA", "A", 1e-9),
        ("hPa", "Pa", 100),
        ("bar", "Pa", 1e5),
        ("L/min", "m3/s", 1e-3 / 60),
        ("mL/s", "m3/s", 1e-6),
        ("uA", "A", 1e-6),
        ("cm", "m", 1e-2),
    ],
)
def test_units_as_they_are_written(unit: str, expected: str, value: float) -> None:
    assert factor(unit, expected) == pytest.approx(value, rel=1e-12)


def test_temperatures_have_a_zero_of_their_own() -> None:
    assert converted(20.0, "\u00b0C", "K") == pytest.approx(293.15)
    assert converted(68.0, "degF", "degC") == pytest.approx(20)


@pytest.mark.parametrize(
    ("cells", "values"),
    [
        (["1.234,5", "0,5"], [1234.5, 0.5]),
        (["1,234.5", "0.5"], [1234.5, 0.5]),
        (["1 234,5", "0,5"], [1234.5, 0.5]),
        (["1'234.5", "2.5"], [1234.5, 2.5]),
        (["0,012", "12,345"], [0.012, 12.345]),
        (["999", "1,000"], [999, 1000]),
        (["1,234,567", "12"], [1234567, 12]),
        (["1000", "1,234"], [1000, 1.234]),
        (["\u22121.5", "+2"], [-1.5, 2]),
        (["1.5D+03", "2d-1"], [1500, 0.2]),
        (["on", "OFF"], [1, 0]),
        (["9.91E+37", "1"], [np.nan, 1]),
    ],
)
def test_numbers_as_they_are_written(cells: list[str], values: list[float]) -> None:
    np.testing.assert_array_equal(numbers(cells).values, values)


def test_thousands_that_look_like_decimals_are_told_by_the_other_columns() -> None:
    assert decimal_mark(["12,345", "13,456"]) == "?"
    assert numbers(["12,345", "13,456"], ",").values[0] == 12.345
    assert numbers(["12,345", "13,456"], ".").values[0] == 12345
    assert numbers(["1.234", "12"], ",").values[0] == 1234
    rows = [f"0,0{i};15,0{i};0,006" for i in range(10, 90)]  # all of one column look like thousands
    table = read_text(Path("a.csv"), "\n".join(["time [s];radius [mm];voltage [kV]", *rows]).encode())
    np.testing.assert_allclose(table.columns[1].values[:2], [15.010, 15.011])
    rows = [f"2,{400 + i};12,{600 + i};{17000 + i}" for i in range(80)]  # whoever groups thousands groups all of them
    table = read_text(Path("a.csv"), "\n".join(["time [s];pressure [kPa];radius [um]", *rows]).encode())
    assert [c.values[1] for c in table.columns] == [2.401, 12.601, 17001]
    for cell in ("1_000", "inf", "1.5.2", "0x1F", "12 mV", "1e"):
        assert numbers([cell, "1.5", "2.5"]).bad.tolist() == [0], cell


LVM = """LabVIEW Measurement\t
Writer_Version\t2
Separator\tTab
Decimal_Separator\t.
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t100\t100\t
Y_Unit_Label\tPascal\tVolts\t
X_Dimension\tTime\tTime\t
Delta_X\t0.004\t0.004\t
***End_of_Header***\t\t\t
X_Value\tpressure\tvoltage\tComment
0.000000\t1.5\t2.5
0.004000\t2.5\t3.5
0.008000\t3.5\t4.5
"""


def test_a_labview_measurement_file(tmp_path: Path) -> None:
    table = read(saved(tmp_path, LVM, "a.lvm"))
    found = [(c.name, c.unit) for c in table.columns[:3]]
    assert found == [("x_value", "s"), ("pressure", "Pascal"), ("voltage", "Volts")]
    np.testing.assert_array_equal(table.columns[1].values, [1.5, 2.5, 3.5])
    assert table.notes["delta_x"] == "0.004, 0.004"


def test_the_nearest_of_several_head_lines_is_not_always_the_heading(tmp_path: Path) -> None:
    text = "time;pressure;voltage;radius\ns;Pa;V;m\nclock;monitor;amplifier;laser\n0;1;2;3\n1;2;3;4\n2;3;4;5\n"
    table = read(saved(tmp_path, text), NAMES)
    assert [(c.name, c.unit) for c in table.columns] == list(zip(NAMES, ["s", "Pa", "V", "m"], strict=True))
    assert table.heading_line == 1


def test_a_file_of_one_input_among_files_of_another_is_not_unlike(tmp_path: Path) -> None:
    """An inflation beside steps of the voltage at a pressure that was held: "is its unit in this file right?"."""
    time, random, tables = np.arange(0, 4, 0.01), np.random.default_rng(2), {}
    for name in "abcd":
        pressure = 12e3 * np.minimum(time / 3, 1) if name == "a" else 12e3 + 100 * np.sin(3 * time)
        voltage = np.where((time > 1) & (time < 3) & (name != "a"), 5e3, 0.0)
        radius = 0.015 + 2.5e-7 * pressure + 1e-3 * (voltage > 0) + 1e-5 * random.standard_normal(time.size)
        read = pressure + 4 * random.standard_normal(time.size)
        tables[name] = {"time [s]": time, "pressure [Pa]": read, "voltage [V]": voltage, "radius [m]": radius}
    assert not [said for said in unusual.findings(read_recordings(tables)) if "spans" in said]


def test_a_file_whose_input_is_as_large_as_in_others_has_no_other_unit() -> None:
    """A pressure that was held in two files, and moved in two: "spans 28 times what it spans in the other files"."""
    time, random, tables = np.arange(0, 4, 0.01), np.random.default_rng(2), {}
    for name, moves in (("a", False), ("b", True), ("c", True), ("d", False)):
        pressure = 12e3 + moves * 6e3 * np.sin(2 * time) + 200 * np.sin(9 * time)
        voltage = np.where((time > 1) & (time < 3), 5e3, 0.0)
        radius = 0.015 + 2.5e-7 * pressure + 1e-3 * (voltage > 0) + 1e-5 * random.standard_normal(time.size)
        read = pressure + 4 * random.standard_normal(time.size)
        tables[name] = {"time [s]": time, "pressure [Pa]": read, "voltage [V]": voltage, "radius [m]": radius}
    assert not [said for said in unusual.findings(read_recordings(tables)) if "spans" in said]


def test_files_that_are_no_recordings_are_named(tmp_path: Path) -> None:
    """A protocol as a document and a picture lay beside the recordings, and nothing said that they were left out."""
    folder = tmp_path / "data"
    shutil.copytree(Path(__file__).resolve().parents[1] / "cosim_examples" / "data" / "bench", folder)
    for name in ("protocol.docx", "rig.jpg", ".~lock.a.csv#"):
        (folder / name).write_bytes(b"?")
    assert read_folder(folder, PLANT).left_out == ("protocol.docx", "rig.jpg")
    assert "not used: protocol.docx, rig.jpg, which hold no table" in read_recordings(folder).remarks()
    with pytest.raises(DataError, match=f"there is a file; give the folder that it lies in, {re.escape(str(folder))}"):
        read_folder(folder / "01_ramp_4kV.csv", PLANT)


def test_what_is_left_out_is_said(tmp_path: Path) -> None:
    text = "time [s],p [Pa]\n0,1\n1,2\ntime [s],p [Pa]\npump restarted\n\n2,3\n3"
    table = read(saved(tmp_path, text))
    np.testing.assert_array_equal(table.lines, [2, 3, 7])
    said = " ".join(table.remarks)
    for word in ("headings repeated: line 4", "line 5 'pump restarted'", "line 8, the last one, is incomplete"):
        assert word in said


def test_a_cell_may_run_over_lines(tmp_path: Path) -> None:
    table = read(saved(tmp_path, '"time\n[s]","p\n[mbar]"\n0,1\n1,"2"\n2,3\n'))
    assert [(c.name, c.unit) for c in table.columns] == [("time", "s"), ("p", "mbar")]
    np.testing.assert_array_equal(table.lines, [4, 5, 6])


def test_without_headings_columns_have_numbers_only(tmp_path: Path) -> None:
    table = read(saved(tmp_path, "0, 30.7\n0.005, 37.1\n0.01, 48.3\n"))
    assert [c.heading for c in table.columns] == ["", ""] and table.heading_line == 0
    np.testing.assert_array_equal(table.columns[1].values, [30.7, 37.1, 48.3])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"", ["empty"]),
        (b"\xef\xbb\xbf", ["empty"]),
        (b"  \n\n", ["empty"]),
        (b"\x00" * 100, ["byte 0", "text"]),
        (bytes(range(256)), ["text", "line 1"]),
        (b"PK\x03\x04xx", ["spreadsheet", "export it as CSV"]),
        (b"\x1f\x8b\x08", ["compressed"]),
        (b"\xff\xfe" + b"a", ["UTF-16", "byte"]),
        (b"notes on the bench\nnothing else\n", ["line 1", "no line holds numbers", "'notes on the bench'"]),
        (b"time [s],p [Pa]\n0,1\n1,2,3\n2,3\n", ["line 3", "3 cells below 2 headings", "decimal commas"]),
        (b"t p q\n0 1 2\n1 2\n2 3 4\n3 4 5\n", ["line 3", "2 cells below 3 headings", "spaces"]),
        (b'time [s],p [Pa]\n0,1\n1,"2\n' + b"2,3\n" * 40, ["line 3", "closing quote"]),
        (b"TDSm" + b"\0" * 50, ["TDMS"]),
        (b"PAR1" + b"\0" * 50, ["Parquet"]),
        (b"MATLAB 5.0 MAT-file" + b"\0" * 200, ["MATLAB 5"]),
        (b"\x89HDF\r\n\x1a\n" + b"\0" * 50, ["HDF5"]),
    ],
)
def test_what_is_no_table_is_refused_in_one_line(tmp_path: Path, text: bytes, words: list[str]) -> None:
    path = saved(tmp_path, text)
    with pytest.raises(ReadError) as refusal:
        read(path)
    said = str(refusal.value)
    assert said.startswith(str(path)) and "\n" not in said
    for word in words:
        assert word in said


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        ("12x", "line 103, column 'p': expected a number but found '12x'"),
        ("inf", "expected a finite number"),
        ("-1.#INF", "expected a finite number"),
        ("1_000", "found '1_000'"),
        ("3,14", "4 cells below 3 headings"),
    ],
)
def test_a_bad_cell_has_a_place(tmp_path: Path, cell: str, words: str) -> None:
    rows = [f"{0.004 * i:.3f},{100 + i}.5,{i}.25" for i in range(300)]
    rows[100] = f"0.400,{cell},100.25"
    path = saved(tmp_path, "\n".join(["# a tube", "t [s],p [Pa],q [V]", *rows]))
    if "cells" in words:
        with pytest.raises(ReadError, match=words):
            read(path)
        return
    table = read(path)
    assert words in table.columns[1].problem and not table.columns[0].problem


def test_a_bad_cell_in_the_first_row_is_no_heading(tmp_path: Path) -> None:
    rows = "\n".join(f"{0.004 * i:.3f},{100 + i}.5,{i}.25" for i in range(1, 300))
    table = read(saved(tmp_path, f"t [s],p [Pa],q [V]\n0.000,x,3\n{rows}\n"))
    assert [c.name for c in table.columns] == ["t", "p", "q"]
    assert "line 2, column 'p'" in table.columns[1].problem


def test_notes_with_some_numbers_are_no_table(tmp_path: Path) -> None:
    text = "Notes\nThe tube of 15 mm was changed on\n12 March 2024 and burst at 7 kV\nafter 300 beats, see page 4\n"
    with pytest.raises(NoTableError):
        read(saved(tmp_path, text, "README.txt"))


def _arrays() -> dict[str, np.ndarray]:
    t = np.arange(100) * 0.004
    return {"time_s": t, "pressure_kPa": 8 + t, "voltage_V": 4000 * t, "radius_mm": 15 + t}


def _check(table: Table) -> None:
    found = {c.name: c for c in table.columns}
    for heading, values in _arrays().items():
        name, unit = heading.split("_")
        np.testing.assert_allclose(found[name].values, values, rtol=1e-14)
        assert found[name].unit == unit
    assert table.row == "sample" and not any(c.problem for c in table.columns)


def test_matlab_5(tmp_path: Path) -> None:
    arrays = _arrays()
    scipy.io.savemat(tmp_path / "a.mat", arrays | {"fs": 250.0, "operator": "nobody"})
    _check(read(tmp_path / "a.mat"))
    scipy.io.savemat(tmp_path / "b.mat", {"data": {k: v[:, None] for k, v in arrays.items()}})
    _check(read(tmp_path / "b.mat"))
    names = np.array(list(arrays), dtype=object)
    scipy.io.savemat(tmp_path / "c.mat", {"data": np.column_stack([*arrays.values()]), "names": names})
    _check(read(tmp_path / "c.mat"))


def test_matlab_7(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py", reason="the extra `files` is not installed")
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        for name, values in _arrays().items():
            file.create_dataset(f"data/{name}", data=values[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
    with (tmp_path / "a.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + b"\0" * 8 + b"\x00\x02IM")
    table = read(tmp_path / "a.mat")
    _check(table)
    assert table.format == "MATLAB 7.3"


def test_hdf5_with_units_as_attributes(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py", reason="the extra `files` is not installed")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for heading, values in _arrays().items():
            name, unit = heading.split("_")
            file.create_dataset(name, data=values).attrs["unit"] = unit
    _check(read(tmp_path / "a.h5"))


def test_tdms(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms", reason="the extra `files` is not installed")
    made = [
        nptdms.ChannelObject("run", h.split("_")[0], v, {"unit_string": h.split("_")[1], "wf_increment": 0.004})
        for h, v in list(_arrays().items())[1:]
    ]
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment(made)
    _check(read(tmp_path / "a.tdms"))


def test_parquet(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow", reason="the extra `files` is not installed")
    parquet = pytest.importorskip("pyarrow.parquet")
    parquet.write_table(pyarrow.table(_arrays()), tmp_path / "a.parquet")
    _check(read(tmp_path / "a.parquet"))


@pytest.mark.parametrize(
    ("library", "start"), [("h5py", b"\x89HDF\r\n\x1a\n"), ("nptdms", b"TDSm"), ("pyarrow.parquet", b"PAR1")]
)
def test_a_missing_library_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, library: str, start: bytes
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ReadError, match=rf"needs {library.partition('.')[0]}.*pip install '\.\[files\]'"):
        read(saved(tmp_path, start + b"\0" * 64))


def charging(
    time: np.ndarray, voltage: np.ndarray, random: np.random.Generator, noise: float = 1e-9
) -> dict[str, np.ndarray]:
    """A recording of a tube of 10 nF, whose current has some noise [A]."""
    return {
        "time [s]": time,
        "pressure [Pa]": 12e3 + 25 * random.standard_normal(time.size),
        "voltage [V]": voltage,
        "radius [m]": 0.018 + 1e-7 * voltage + 15e-6 * random.standard_normal(time.size),
        "current [A]": 1e-8 * np.gradient(voltage, time) + noise * random.standard_normal(time.size),
    }


def test_a_current_that_follows_the_voltage_s_rate_is_not_odd() -> None:
    """A beating voltage draws hundreds of times what a ramp does; one that is 200 times too large is told still."""
    time, random = np.arange(0, 10, 0.004), np.random.default_rng(2)
    up_and_down = np.interp(time, [0, 5, 10], [0, 1, 0])
    ramps = {f"ramp {n}": charging(time, 5e3 * up_and_down * n / 3, random) for n in (1, 2, 3)}
    beats = np.interp(time % 0.5, [0, 0.01, 0.2, 0.21], [0, 5e3, 5e3, 0])
    found = unusual.findings(read_recordings(ramps | {"beats": charging(time, beats, random)}, PLANT))
    assert not [text for text in found if "is its unit in this file right" in text]
    ramps["ramp 2"]["current [A]"] *= 200
    found = unusual.findings(read_recordings(ramps | {"beats": charging(time, beats, random)}, PLANT))
    assert [text for text in found if text.startswith("ramp 2: current spans")]


def test_a_current_of_spikes_alone_is_not_odd() -> None:
    """Where a voltage switches a few times, hardly any sample shows the charging current; where it swings, most do."""
    time, random = np.arange(0, 10, 0.004), np.random.default_rng(2)
    steps = {f"steps {n}": np.interp(time, [0, n, n + 0.02, 10], [0, 0, 4e3, 4e3]) for n in (2, 4)}
    swings = {f"swing {hz}": 2e3 - 2e3 * np.cos(2 * np.pi * hz * time) for hz in (10, 12)}
    tables = {name: charging(time, voltage, random, 1e-7) for name, voltage in (steps | swings).items()}
    for table in tables.values():
        table["voltage [V]"] = table["voltage [V]"] + 5 * random.standard_normal(time.size)
    found = unusual.findings(read_recordings(tables, PLANT))
    assert not [text for text in found if "current spans" in text]


def test_what_is_odd_about_a_set_is_said() -> None:
    """A unit that is wrong by a thousand, gaps, a file that is a copy; nothing of a set as it should be."""
    m = Build("Tank")
    pump, k = m.input("pump", "V", nominal=5), m.parameter("k", "1/s", 0.5)
    level = m.state("level", "m", start="free", nominal=0.1)
    m.derivative(level, k * (m.parameter("gain", "m/V", 0.02) * pump - level))
    m.output("reading", "m", level)
    tank = Plant(m.model(), [Input("pump")], [Output("reading")])
    time, noise = np.linspace(0, 20, 401), 1e-5 * np.random.default_rng(1).standard_normal(401)

    def table(phase: float, unit: str = "m") -> dict[str, np.ndarray]:
        wave = 2.5 + 2.5 * np.sin(time + phase)
        return {"time [s]": time, "pump [V]": wave, f"reading [{unit}]": 0.02 * wave + noise}

    usual = {"a": table(0.0), "b": table(1.0)}
    assert unusual.findings(read_recordings(usual, tank)) == []
    (copied,) = unusual.findings(read_recordings(usual | {"c": table(0.0)}, tank))
    assert copied == "a and c hold the same numbers: held out, one tests nothing of the other; remove one"
    whole = read_recordings(usual, tank)
    (typed,) = unusual.findings(replace(whole, noise={"reading": 1e-2}))
    assert typed.startswith("bench.toml: [noise] reading is 10 mm, but from sample to sample these records tell ")
    assert unusual.findings(replace(whole, noise={"reading": 1e-4, "pump": 0.0})) == []
    (small,) = unusual.findings(read_recordings({"a": table(0.0, "mm"), "b": table(1.0, "mm")}, tank))
    assert small.startswith("reading reaches 0.0001 m in these records, 0.001 times its declared size (nominal: 0.1 m)")
    (large,) = unusual.findings(read_recordings({"a": table(0.0) | {"pump [V]": 1e3 * table(0.0)["pump [V]"]}}, tank))
    assert large.startswith("pump reaches 5e+03 V in these records, 1e+03 times its declared size (nominal: 5 V)")
    one, more = table(2.0), usual | {"c": table(3.0)}
    one["pump [V]"] = one["pump [V]"] / 60
    (unlike,) = unusual.findings(read_recordings(more | {"d": one}, tank))
    words = "d: pump spans 0.017 times what it spans in the other files, and reading no such multiple: is its unit in"
    assert unlike.startswith(words)
    scaled = table(2.0)  # as degF where degC are said
    scaled["pump [V]"] = 32 + 1.8 * scaled["pump [V]"]
    (elsewhere,) = unusual.findings(read_recordings(more | {"d": scaled}, tank))
    assert elsewhere.startswith("d: pump lies between 32 V and 41 V, far from what it is in the other files")
    scaled["reading [m]"] = scaled["reading [m]"] + 0.5  # at another level
    assert unusual.findings(read_recordings(more | {"d": scaled}, tank)) == []
    small = {name: values / (1 if name == "time [s]" else 60) for name, values in table(2.0).items()}
    still = {"time [s]": time, "pump [V]": 0 * time, "reading [m]": 0.1 * np.exp(-time / 2) + noise}
    assert unusual.findings(read_recordings(more | {"d": small, "e": still}, tank)) == []
    spiked = table(2.0)
    spiked["pump [V]"] = np.where(np.arange(401) == 100, 1e9, spiked["pump [V]"])
    (spike,) = unusual.findings(read_recordings(more | {"d": spiked}, tank))
    assert spike == (
        "d: pump is 1e+09 V in sample 101, far from the others (1 sample): is it a spike? If so, leave its cell empty"
    )
    commanded = replace(read_recordings(more | {"d": spiked}, tank), noise={"pump": 0.0})
    assert unusual.findings(commanded) == []
    twice = table(2.0)
    twice["reading [m]"] = np.where(np.isin(np.arange(401), [100, 101]), 1e9, twice["reading [m]"])
    assert unusual.findings(read_recordings(more | {"d": twice}, tank))[0].startswith(
        "d: reading is 1e+09 m in sample 101, far from the others (2 samples)"
    )
    stuck = table(2.0)
    stuck["reading [m]"] = np.where(abs(np.arange(401) - 120) < 20, stuck["reading [m]"][101], stuck["reading [m]"])
    (said,) = unusual.findings(read_recordings(more | {"d": stuck}, tank))
    assert said.startswith("d: reading is 0.") and said.endswith(
        " m in all 39 samples from sample 102 on, while pump moves: is the sensor stuck? If so, leave these cells empty"
    )
    ended = {**table(2.0), "reading [m]": np.minimum(table(2.0)["reading [m]"], 0.08)}  # the sensor's largest reading
    (said,) = unusual.findings(read_recordings(more | {"d": ended}, tank))
    assert said.startswith("d: reading is 0.08 m in 121 samples from sample 1 on, and never beyond: is the sensor at")
    counted = {**table(2.0), "reading [m]": np.round(table(2.0)["reading [m]"], 2)}  # an encoder without noise
    assert unusual.findings(read_recordings(more | {"d": counted}, tank)) == []
    half = table(0.0)
    half["reading [m]"] = np.where(np.arange(401) % 2, np.nan, half["reading [m]"])
    (gaps,) = unusual.findings(read_recordings({"a": half, "b": table(1.0)}, tank))
    assert gaps == "a: 200 of 401 samples of reading are left out: they hold no number, or repeat the one before"


def test_an_unused_column_in_the_unit_of_an_output_says_how_it_is_read(tmp_path: Path) -> None:
    rows = "\n".join(
        f"{t / 100},{60 * max(t - 50, 0) + t % 7},0,{15 + 1.5e-3 * max(t - 50, 0) + 1e-3 * (t % 5)},{t % 3},{t % 4}"
        for t in range(300)
    )
    (tmp_path / "a.csv").write_text(f"time [s],pressure [Pa],voltage [V],radius [mm],I_mA,T [degC]\n{rows}\n")
    said = not_used(read_recordings(tmp_path))
    assert "not used: column 'I_mA' in 1 of 1 files (if it is the current: --columns current='I_mA')" in said
    assert "not used: column 'T [degC]' in 1 of 1 files" in said


def test_clocks_temperatures_and_set_points_that_contradict_the_other_files_are_asked_about() -> None:
    m = Build("Cell")
    current = m.input("current", "A", nominal=30)
    m.input("temperature", "K", nominal=300)
    m.output("voltage", "V", m.parameter("R", "V/A", 0.1) * current, nominal=3.0)
    cell = Plant(m.model(), [Input("current", held=True), Input("temperature", held=True)], [Output("voltage")])
    time, random = np.arange(0, 100, 0.5), np.random.default_rng(1)

    def table(degrees: float, clock: float = 1.0, flicker: float = 0.0) -> dict[str, np.ndarray]:
        pulse = np.where((time > 20) & (time < 60), -30.0, 0.0)
        pulse[[5, 150]] += flicker
        read = 0.1 * pulse + 1e-3 * random.standard_normal(time.size)
        return {
            "time [s]": clock * time,
            "current [A]": pulse,
            "temperature [degC]": np.full(time.size, degrees),
            "voltage [V]": read,
        }

    usual = {"a": table(10.0), "b": table(25.0), "c": table(25.0)}

    def said(more: dict[str, np.ndarray]) -> list[str]:
        return unusual.findings(replace(read_recordings(usual | {"d": more}, cell), noise={"current": 0.0}))

    assert said(table(40.0)) == said(table(-20.0)) == []
    (kelvin,) = said(table(298.15))
    assert kelvin == (
        "d: temperature is 298.1 degC, as far from what it is in the other files as K from degC: "
        "is its unit in this file right?"
    )
    (clock,) = said(table(10.0, clock=1e3))
    assert clock == ("d: its samples are 500 s apart, those of the other files 0.5 s: is the unit of its times right?")
    assert said(table(10.0, clock=10.0)) == []
    (flickers,) = said(table(10.0, flicker=0.01))
    assert flickers.startswith(
        "d: current is said to have no noise, but leaves its value for a sample 2 times (by 0.01 A)"
    )
    fast, slow = (10 + 30 * np.sin(w * time) for w in (1.7, 0.11))
    for turning in (fast, slow):  # rounded, it passes its largest value for a sample and comes back
        assert not unusual._flickered(np.round(turning, 2)).size


def test_joined_records_and_records_without_their_means_are_asked_about() -> None:
    m = Build("Tank")
    pump, level = m.input("pump", "V", nominal=2.0), m.state("level", "m", start="free", nominal=0.1)
    m.derivative(level, m.parameter("gain", "m/V/s", 0.02) * pump - m.parameter("k", "1/s", 0.4) * level)
    m.output("reading", "m", level)
    tank = Plant(m.model(), [Input("pump", held=True)], [Output("reading")])
    time, random = np.arange(0, 40, 0.1), np.random.default_rng(1)

    def table(begins: float, joined: float = 0.0, centred: bool = False) -> dict[str, np.ndarray]:
        pump = np.where((time > 5) & (time < 15), 2.0, 0.5)
        run = Kernel(tank.model).simulate(Protocol.of(time, pump=pump), time, {"level_start": begins})
        read = run["reading"] + joined * (time > 30) + 1e-4 * random.standard_normal(time.size)
        mean = read.mean() if centred else 0.0
        return {"time [s]": time, "pump [V]": pump, "reading [m]": read - mean}

    starts = {"a": 0.1, "b": 0.05, "c": 0.2}
    assert unusual.findings(read_recordings({n: table(v) for n, v in starts.items()}, tank)) == []
    (joined,) = unusual.findings(read_recordings({n: table(v, 0.04 * (n == "c")) for n, v in starts.items()}, tank))
    assert joined.startswith("c: reading jumps by 0.0398 m") and "(sample 302), while no input does" in joined
    (centred,) = unusual.findings(read_recordings({n: table(v, centred=True) for n, v in starts.items()}, tank))
    assert centred.startswith("the mean of reading is 0 in every file: was it taken off?")


def test_single_samples_that_stand_out_are_left_out_and_said(tmp_path: Path) -> None:
    """One flipped bit turned a verdict over: 55 mm in one of 9400 samples of a radius of 15 mm."""
    random, time = np.random.default_rng(4), np.arange(2000) / 250
    radius = 0.015 + 1e-3 * np.clip(time - 2, 0, 1) + 15e-6 * random.standard_normal(time.size)
    voltage = np.where(time > 4, 5000.0, 0.0)
    radius[time > 4] += 5e-4  # no spike: it stays
    pressure = 1e4 * np.clip(time - 2, 0, 1)
    radius[[700, 1500]] = 0.0553, 0.0
    table = np.column_stack([time, pressure, voltage, radius])
    saved(tmp_path, "time [s],pressure [Pa],voltage [V],radius [m]\n" + "\n".join(",".join(map(str, r)) for r in table))
    found = read_recordings(tmp_path)
    assert np.flatnonzero(np.isnan(found["a"].outputs["measured_displacement"])).tolist() == [700, 1500]
    said = next(m for m in found.remarks() if "spike" in m)
    assert "radius is 0.0553 m in line 702" in said
    assert "1 more" in said


def test_a_spike_does_not_hide_another_one_beside_it() -> None:
    """Two of 22 000 readings, 1.56 and -0.97 mm off with a good one between them, decided a verdict."""
    time = np.arange(2000) / 250
    moved = np.zeros(time.size)
    moved[[700, 702]] = 1.56e-3, -0.97e-3
    moved[[1200, 1202]] = 1e-3, 1e-3
    moved[[1700, 1701]] = -1e-3, 0.8e-3
    found = read_recordings({"a": read_slowly(time, moved, np.where(time > 4, 5000.0, 0.0))})
    empty = np.isnan(found["a"].outputs["measured_displacement"])
    assert np.flatnonzero(empty).tolist() == [700, 702, 1200, 1202, 1700, 1701]


def read_slowly(time: np.ndarray, moved: np.ndarray, voltage: np.ndarray) -> dict[str, np.ndarray]:
    """A table of a radius on slow pressures, read `moved` (n,) [m] too large."""
    noise = np.random.default_rng(4).standard_normal((3, time.size))
    pressure = 1e4 * np.clip(time - 2, 0, 1)
    radius = 0.015 + 1e-3 * np.clip(time - 2, 0, 1) + moved
    monitors = {"pressure [Pa]": pressure + 25 * noise[0], "voltage [V]": voltage + 4 * noise[1]}
    return {"time [s]": time, **monitors, "radius [m]": radius + 15e-6 * noise[2]}


@pytest.mark.parametrize(("rate", "lasts"), [(500.0, 2), (400.0, 2), (200.0, 5), (1000.0, 1)])
def test_a_repeated_reading_of_a_slow_sensor_is_left_out_and_said(rate: float, lasts: int) -> None:
    """A laser of 400 Hz behind a logger of 1 kHz was a sensor's lag, and one of 500 Hz `unexplained`."""
    time = np.arange(4000) / 1000
    table = read_slowly(time, np.zeros(time.size), np.zeros(time.size))
    measured = np.round(table["radius [m]"], 6)[np.floor(time * rate + 1e-9).astype(int) * round(1000 / rate) % 4000]
    found = read_recordings({"a": {**table, "radius [m]": measured}})
    left = np.flatnonzero(np.isfinite(found["a"].outputs["measured_displacement"]))
    said = [m for m in found.remarks() if "repeated" in m]
    if lasts == 1:
        assert left.size == time.size and not said
        return
    assert f"radius is new in every {lasts} or {lasts + 1} samples only" in said[0]
    assert left.size == pytest.approx(time.size * rate / 1000, rel=0.07)


def test_readings_in_coarse_steps_are_not_repeated_readings() -> None:
    time = np.arange(4000) / 1000
    slow = 0.015 + 1e-3 * time
    for steps in (np.round(slow, 5), np.round(slow + 3e-6 * np.random.default_rng(2).standard_normal(time.size), 5)):
        again, lasts = repeated_readings(steps)
        assert lasts == 1 and not again.any()


def test_a_lapse_of_the_sensor_is_left_out_and_said() -> None:
    """A reflection of 36 ms on the laser turned a right answer into half of one (`partly_explained`)."""
    time = np.arange(2000) / 250
    moved = np.zeros(time.size)
    moved[1700:1709] = 1.3e-3 * np.array([0.3, 1, 1, 1, 1, 1, 1, 1, 0.4])
    moved[700:702] = -4e-4
    found = read_recordings({"a": read_slowly(time, moved, np.where(time > 4, 5000.0, 0.0))})
    empty = np.isnan(found["a"].outputs["measured_displacement"])
    assert np.flatnonzero(empty).tolist() == [700, 701, *range(1700, 1709)]
    (said,) = (m for m in found.remarks() if "lapse" in m)
    assert "from sample 701 to 702, by 0.00126 m" in said and "from sample 1701 to 1709" in said
    assert said.endswith("left out as 2 lapses of the sensor")


def test_a_lapse_by_more_than_the_plant_ever_moves_needs_no_rest_before_it() -> None:
    """A laser that lost its target 80 ms before an edge, soon after a gap in the pressure, moved errors to 106 um."""
    time = np.arange(2000) / 250
    moved = np.zeros(time.size)
    moved[1500:1503] = [-2.5e-3, -2.5e-3, 10e-3]
    found = read_recordings({"a": read_slowly(time, moved, np.where(time > 5.9, 5000.0, 0.0))})
    assert np.flatnonzero(np.isnan(found["a"].outputs["measured_displacement"])).tolist() == [1500, 1501, 1502]


def test_spikes_stand_out_where_a_voltage_monitor_shows_noise_alone() -> None:
    """Noise about 0 V is there and back at every sample: glitches of a laser stayed, and a tube was unexplained."""
    time, glitches = np.arange(2000) / 250, [300, 520, 760, 1000, 1200, 1400, 1800]
    moved = np.zeros(time.size)
    moved[glitches] = [0.8e-3, -0.5e-3, 1.1e-3, 0.6e-3, -0.9e-3, 0.4e-3, 0.7e-3]
    found = read_recordings({"a": read_slowly(time, moved, 0 * time)})
    assert np.flatnonzero(np.isnan(found["a"].outputs["measured_displacement"])).tolist() == glitches


def test_what_an_input_does_or_what_comes_often_is_no_lapse() -> None:
    time = np.arange(2000) / 250
    pulse = (time > 6) & (time < 6.03)
    driven = read_slowly(time, 1e-3 * pulse, np.where(pulse, 5000.0, 0.0))
    often = read_slowly(time, 1e-3 * ((np.arange(time.size) % 200 < 5) & (time > 1)), 0 * time)
    stays = read_slowly(time, 1e-3 * (time > 6), 0 * time)
    for table in (driven, often, stays):
        assert np.all(np.isfinite(read_recordings({"a": table})["a"].outputs["measured_displacement"]))


@pytest.mark.parametrize(
    ("column", "number"),
    [(1, -9999), (1, 99999), (1, -99990), (1, 1e30), (2, -9999), (2, 1e9), (3, -9999), (3, -32768), (3, 1e30)],
)
def test_numbers_that_stand_for_lost_samples_are_left_out_and_said(tmp_path: Path, column: int, number: float) -> None:
    """-99990 among pressures up to 10 000 Pa was driven through the model; among voltages up to 1e5 V it was refused as
    kV labelled V."""
    random, time = np.random.default_rng(4), np.arange(2000) / 250
    table = np.column_stack([time, 1e4 * np.clip(time - 2, 0, 1), np.where(time > 4, 5000.0, 0.0), 15 + 0 * time])
    table[:, 1:] += [25, 4, 0.015] * random.standard_normal((time.size, 3))
    table[:, 3] += np.clip(time - 2, 0, 1)
    table[[300, 700, 701, 702, 1500], column] = number
    rows = "\n".join(",".join(f"{x:.10g}" for x in r) for r in table)
    saved(tmp_path, "time [s],pressure [Pa],voltage [V],radius [mm]\n" + rows)
    found = read_recordings(tmp_path)
    name = ("", "pressure", "voltage", "radius")[column]
    assert f"a.csv: {name} is {number:.10g} in line 302 and in 4 more: lost samples, left out" in found.remarks()
    values = list((found["a"].inputs | found["a"].outputs).values())[column - 1]
    assert np.nanmax(np.abs(values)) < 1.1e4
    assert np.count_nonzero(np.isnan(values)) == (5 if column == 3 else 0)


def test_what_may_be_a_level_is_no_lost_sample() -> None:
    """A speed of 9999 rpm, a level below that another one is farther from: these are what was commanded."""
    time = np.arange(2000)
    possible = np.zeros(time.size, dtype=bool)
    for levels in ([0.0, 9999.0], [0.0, 3000.0, 6000.0, 9999.0, 0.0], [0.0, 5000.0, -999.0], [0.0, 0.01, 5.0]):
        assert lost_samples(np.array(levels)[time // 50 % len(levels)], possible, sensed=False) == {}
    noise = np.random.default_rng(4).standard_normal(time.size)
    assert lost_samples(noise, possible, sensed=True) == {}
    assert lost_samples(np.where(time == 700, 1e6, noise), possible, sensed=True) == {}  # a spike, told as one
    assert list(lost_samples(np.where(time % 500 == 7, -9999.0, 0.0), possible, sensed=False)) == [-9999.0]


def test_noise_is_no_spike_of_a_sensor_that_is_at_its_limit_most_of_the_time() -> None:
    """Its limit shows no noise: a laser at 38 mm for three quarters of a record made spikes of ordinary noise."""
    random = np.random.default_rng(3)
    read = np.round(35.0 + 6.0 * np.sin(np.arange(4000) / 400.0) + 0.04 * random.standard_normal(4000), 2)
    clipped = np.minimum(read, 31.0)
    assert np.mean(clipped == 31.0) > 0.7
    assert spikes(clipped).size == 0
    clipped[int(np.argmin(read)) + 60] += 2.0
    assert spikes(clipped).size == 1


def test_the_last_sample_of_a_record_is_no_spike() -> None:
    """Nothing tells whether what comes after it goes on from there."""
    room = 20 + 0.01 * np.random.default_rng(4).standard_normal(200)
    for last in (199, 198, 0, 1):
        assert not spikes(np.where(np.arange(200) == last, 21.0, room)).size
    assert spikes(np.where(np.arange(200) == 100, 21.0, room)).tolist() == [100]


def test_the_answer_to_a_day_of_rain_is_no_spike() -> None:
    random, days = np.random.default_rng(4), np.arange(400)
    rain = np.where(random.uniform(size=400) < 0.3, random.exponential(2.0, 400), 0.0)
    rain[[100, 300]] = 60.0
    stream = 1.0 + 0.01 * random.standard_normal(400)
    stream[[101, 301]] += 8.0
    assert spikes(stream).tolist() == [101, 301] and not spikes(stream, [rain]).size
    assert spikes(stream + 8.0 * (days == 200), [rain]).tolist() == [200]
    assert spikes(stream, [np.where(days > 99, 1.0, 0.0)]).tolist() == [101, 301]  # an edge is no pulse


def two_signals() -> Plant:
    """A force F and a frequency f; a position and a pressure, of which one may rest."""
    m = Build("Two")
    force, frequency = m.input("F", "N", nominal=1.0), m.input("f", "Hz", nominal=1.0)
    x = m.state("x", "m", nominal=1.0)
    m.derivative(x, m.parameter("gain", "m/s/N", 1.0) * force - m.parameter("decay", "1", 1.0) * frequency * x)
    m.output("X", "m", x, nominal=1.0)
    m.output("load", "Pa", m.parameter("k", "Pa/m", 1.0) * x, nominal=1.0)
    return Plant(m.model(), [Input("F", held=True), Input("f")], [Output("X"), Output("load")])


def test_signals_with_capital_letters_are_found_by_their_own_headings() -> None:
    random, time = np.random.default_rng(5), np.arange(400) * 0.01
    columns = {
        "time [s]": time,
        "f [Hz]": 1.0 + 0.1 * np.sin(time) + 1e-3 * random.standard_normal(400),
        "F [N]": np.where(time > 2, 1.0 + 1e-3 * random.standard_normal(400), 0.0),  # off, as no sensor reads
        "X [m]": np.sin(3 * time) + 1e-3 * random.standard_normal(400),
        "load [Pa]": 5.0 + 1e-3 * random.standard_normal(400),  # stands still, while the position moves
    }
    found = read_recordings({"one": columns}, two_signals())
    (experiment,) = found.experiments
    assert experiment.inputs["F"][-1] == pytest.approx(1.0, abs=0.01)
    assert experiment.inputs["f"][-1] == pytest.approx(0.92, abs=0.1)
    assert experiment.outputs["load"].mean() == pytest.approx(5.0, abs=0.01)
    assert experiment.source.remarks == ("load stands still here",)
    with pytest.raises(DataError, match="column 'X': a constant record"):
        read_recordings({"one": columns | {"X [m]": columns["load [Pa]"]}}, two_signals())


def test_noise_steps_and_a_fast_plant_have_no_spikes() -> None:
    random, time = np.random.default_rng(8), np.arange(100_000) / 250
    assert not spikes(random.standard_normal(time.size)).size
    assert not spikes(np.where(time % 1 > 0.5, 1.0, 0.0) + 1e-3 * random.standard_normal(time.size)).size
    assert not spikes(np.sin(2 * np.pi * 110 * time)).size  # beyond what the rate shows well, but no single samples
    assert not spikes(np.round(3 * random.standard_normal(time.size)) / 4).size


@pytest.mark.parametrize(("joined", "written"), [("Ns/m", "N.s/m"), ("Nm", "N.m"), ("mPas", "mPa.s"), ("ns", "1e-9")])
def test_products_written_without_a_point_are_no_nanometres(joined: str, written: str) -> None:
    if written == "1e-9":
        assert converted(1.0, joined, "s") == pytest.approx(1e-9)
    else:
        assert factor(joined, written) == 1.0
