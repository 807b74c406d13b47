"""Files in the layouts of known instruments and programs, written here by hand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from laboratory import numbers
from tubular_dea.identify.records.columns import choices
from tubular_dea.identify.records.data import read_experiment, read_folder
from tubular_dea.identify.records.experiment import DataError
from tubular_dea.plants.tube import PLANT

OUTPUT = PLANT.outputs[0].name
DATA = numbers(np.random.default_rng(7))
ROWS = list(zip(*(DATA[n] for n in ("time", "pressure", "voltage", "radius")), strict=True))


def table(row: Callable[[float, float, float, float], str], comma: bool = False) -> str:
    text = "\n".join(row(*r) for r in ROWS)
    return text.replace(".", ",") if comma else text


# name: the file's text, its encoding, and what a user has to say of it
FILES: dict[str, tuple[str, str, list[str]]] = {
    "PicoScope": (
        "Time,Channel A,Channel B,Channel C\n(ms),(kPa),(kV),(mm)\n\n"
        + table(lambda t, p, v, r: f"{t * 1e3:.4f},{p / 1e3:.5f},{v / 1e3:.5f},{r * 1e3:.5f}"),
        "utf-8",
        ["pressure=Channel A", "voltage=Channel B", "radius=Channel C"],
    ),
    "LabChart": (
        "Interval=\t0.004 s\nExcelDateTime=\t4.5e+04\t01/03/2024 12:00:01.2\nTimeFormat=\tStartOfBlock\n"
        "ChannelTitle=\tPressure\tVoltage\tRadius\nRange=\t200.0 mmHg\t10.00 kV\t20.0 mm\nUnitName=\tmmHg\tkV\tmm\n"
        "TopValue=\t200\t10\t20\n"
        + table(lambda t, p, v, r: f"{t:.3f}\t{p / 133.322:.5f}\t{v / 1e3:.5f}\t{r * 1e3:.5f}"),
        "latin-1",
        ["time=1[s]"],
    ),
    "DASYLab": (
        "DASYLab - V 9.00.02\nRecording date: 01.03.2024, 12:00:01\nBlock length: 10\nDelta: 0.004 sec.\n"
        "Number of channels: 3\nMeasurement time in hh:mm:ss;Radius [mm];Pressure [bar];Voltage [kV]\n"
        + table(lambda t, p, v, r: f"12:00:{1 + t:06.3f};{r * 1e3:.5f};{p / 1e5:.7f};{v / 1e3:.5f}", True),
        "cp1252",
        [],
    ),
    "a data logger": (
        '"Keysight 34970A",,,,\n"Scan interval:","4 ms",,,\n'
        "Scan,Time,101 <p> (VDC),102 <U> (VDC),103 <r> (VDC)\n"
        + table(lambda t, p, v, r: f"1,03/01/2024 12:00:{1 + t:06.3f},{p / 2500:.6f},{v / 1e3:.5f},{r * 1e3:.5f}"),
        "utf-8",
        ["pressure=3[2500 Pa]", "voltage=4[1000 V]", "radius=103 <r> (VDC) [mm]"],
    ),
    "LabVIEW, German": (
        "waveform\t[0]\t[1]\t[2]\t\nt0\t01.03.2024 12:00:01,234\t\t\t\n"
        "delta t\t0,004\t0,004\t0,004\t\n\ntime [s]\tpressure [mbar]\tvoltage [kV]\tradius [mm]\t\n"
        + table(lambda t, p, v, r: f"{t:.3f}\t{p / 100:.5f}\t{v / 1e3:.5f}\t{r * 1e3:.5f}\t", True),
        "utf-16",
        [],
    ),
    "a row of units with the form of times": (
        "Messprotokoll\tDEA\n\nZeit\tDruck p\tHV Monitor\tRadius (Laser)\nhh:mm:ss,000\tkPa\tkV\tmm\n"
        + table(lambda t, p, v, r: f"12:00:{1 + t:06.3f}\t{p / 1e3:.5f}\t{v / 1e3:.5f}\t{r * 1e3:.5f}", True),
        "utf-16",
        ["pressure=Druck p", "voltage=HV Monitor", "radius=Radius (Laser)"],
    ),
    "pandas": (
        ",time [s],pressure [Pa],voltage [V],radius [m]\n"
        + table(
            lambda t, p, v, r: f"{round(t / 0.004)},{t!r},{p!r},{v!r},{r!r}".replace("np.float64(", "").replace(")", "")
        ),
        "utf-8",
        [],
    ),
    "numpy": (
        "# time [s] pressure [Pa] voltage [V] radius [m]\n"
        + table(lambda t, p, v, r: f"{t:.18e} {p:.18e} {v:.18e} {r:.18e}"),
        "utf-8",
        [],
    ),
    "R": (
        '"time" "pressure" "voltage" "radius"\n'
        + table(lambda t, p, v, r: f'"{round(t / 0.004) + 1}" {t:.5f} {p:.4f} {v:.4f} {r:.8f}'),
        "utf-8",
        ["time=time[s]", "pressure=pressure[Pa]", "voltage=voltage[V]", "radius=radius[m]"],
    ),
    "a spreadsheet": (
        "sep=;\ntime [s];pressure [Pa];voltage [V];radius [m]\n"
        + table(lambda t, p, v, r: f"{t:.3f};{p:.4f};{v:.4f};{r:.8f}")
        + "\n\x1a",
        "utf-8-sig",
        [],
    ),
    "a printed table": (
        "\n\n  Test no. 17\n\n   Time        Pressure     Voltage     Radius\n"
        "   (s)         (kPa)        (kV)        (mm)\n "
        + "-" * 50
        + "\n"
        + table(lambda t, p, v, r: f"   {t:<10.3f}  {p / 1e3:<10.6f}   {v / 1e3:<9.5f}   {r * 1e3:<9.5f}"),
        "utf-8",
        [],
    ),
    "Markdown": (
        "| time [s] | pressure [Pa] | voltage [V] | radius [m] |\n|---|---|---|---|\n"
        + table(lambda t, p, v, r: f"| {t:.3f} | {p:.4f} | {v:.4f} | {r:.8f} |"),
        "utf-8",
        [],
    ),
    "LabVIEW with a time for every channel": (
        "LabVIEW Measurement\t\nX_Columns\tOne\t\n***End_of_Header***\t\n\t\nChannels\t3\t\t\t\n"
        "Samples\t400\t400\t400\t\nY_Unit_Label\tVolts\tVolts\tVolts\t\nX_Dimension\tTime\tTime\tTime\t\n"
        "Delta_X\t0.004\t0.004\t0.004\t\n***End_of_Header***\t\t\t\t\nX_Value\tPressure\tHV_mon\tLaser\tComment\n"
        + table(lambda t, p, v, r: f"{t:.3f}\t{p / 2500:.8f}\t{v / 1e3:.7f}\t{r * 1e3:.7f}\t"),
        "utf-8",
        ["pressure=Pressure[2500 Pa]", "voltage=HV_mon[1000 V]", "radius=Laser[mm]"],
    ),
    "an oscilloscope": (
        "Model,MSO54\n\nWaveform Type,ANALOG,,\nHorizontal Units,s,,\nSample Interval,0.004,,\n"
        "Vertical Units,V,V,V\nLabel,PRESS,HV/1000,LASER\nTIME,CH1,CH2,CH3\n"
        + table(lambda t, p, v, r: f"{t:.7e},{p / 2500:.8f},{v / 1e3:.7f},{r * 1e3:.7f}"),
        "utf-8",
        ["pressure=CH1[2500 Pa]", "voltage=CH2[1000 V]", "radius=CH3[1 mm]"],
    ),
    "a meter": (
        "Time;Pressure;Voltage;Radius\n"
        + table(lambda t, p, v, r: f"{t:.3f} s;{p / 1e3:.6f} kPa;{v / 1e3:.5f} kV;{r * 1e3:.5f} mm", True),
        "cp1252",
        [],
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_instruments(name: str, tmp_path: Path) -> None:
    text, encoding, columns = FILES[name]
    (tmp_path / "a.txt").write_bytes(text.encode(encoding))
    experiment = read_experiment(tmp_path / "a.txt", PLANT, chosen=choices(columns, PLANT))
    np.testing.assert_allclose(experiment.time, DATA["time"], atol=2e-9)
    np.testing.assert_allclose(experiment.inputs["pressure"], DATA["pressure"], atol=6e-3)
    np.testing.assert_allclose(experiment.inputs["voltage"], DATA["voltage"], atol=6e-3)
    np.testing.assert_allclose(experiment.outputs[OUTPUT], DATA["radius"] - 0.015, atol=6e-9)


def test_a_file_without_a_time_has_a_rate(tmp_path: Path) -> None:
    rows = table(lambda t, p, v, r: f"{p:.4f};{v:.4f};{r:.8f}")
    (tmp_path / "a.csv").write_text("pressure [Pa];voltage [V];radius [m]\n" + rows)
    told = r"column 'time \[s\]' is missing.*; if there are no times, give \[sampling\] rate in bench\.toml"
    with pytest.raises(DataError, match=told):
        read_folder(tmp_path, PLANT)
    (tmp_path / "bench.toml").write_text('[sampling]\nrate = "250 Hz"\n')
    np.testing.assert_allclose(read_folder(tmp_path, PLANT).experiments[0].time, DATA["time"], atol=1e-12)


def test_columns_and_rows_exchanged_are_refused(tmp_path: Path) -> None:
    rows = [f"{n}," + ",".join(f"{v:.6g}" for v in DATA[n]) for n in ("time", "pressure", "voltage", "radius")]
    (tmp_path / "a.csv").write_text("\n".join(rows))
    with pytest.raises(DataError, match=r"column 'time \[s\]' is missing; found .* and 38\d more"):
        read_experiment(tmp_path / "a.csv", PLANT)
