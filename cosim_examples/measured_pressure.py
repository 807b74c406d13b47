"""Drive the FMU with a measured aortic pressure and a voltage that follows its beats.

    python cosim_examples/measured_pressure.py                          measured in a pig's aorta (data/README.md)
    python cosim_examples/measured_pressure.py my_pressure.csv          header: time [s],pressure [mmHg]

The voltage expands the tube in systole: on with the upstroke of the pressure, off 35 % of a beat later.
Everything runs through FMPy, as it would in any tool that imports FMUs; writes measured_pressure.png.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from zipfile import BadZipFile

import fmpy
import numpy as np
from scipy.signal import butter, find_peaks, sosfiltfilt

from tubular_dea.export.package import native_fmu
from tubular_dea.files import write_atomically
from tubular_dea.model.dea import MMHG, tubular_dea
from tubular_dea.protocol import ProtocolError, read_csv
from tubular_dea.report.figures import time_panels

PIG = Path(__file__).resolve().parent / "data" / "pig" / "in_vivo.csv"
STEP = 1e-3  # s, communication step


def main() -> None:
    """Read, drive, plot."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("csv", nargs="?", type=Path, default=PIG)
    parser.add_argument("--kilovolt", type=float, default=5.0, help="voltage in systole [kV]")
    parser.add_argument("--out", type=Path, default=Path("measured_pressure.png"))
    options = parser.parse_args()
    try:
        time, pressure = read_pressure(options.csv)
        voltage, beats = systolic_voltage(time, pressure, 1e3 * options.kilovolt)
    except ProtocolError as problem:
        raise SystemExit(f"measured_pressure.py: {problem}") from None
    fmu = Path("build/fmi2/TubularDEA.fmu")
    if not fmu.exists():
        native_fmu(tubular_dea(), 2, fmu)
    try:
        response = drive(fmu, time, pressure, voltage)
    except BadZipFile:
        raise SystemExit(f"measured_pressure.py: {fmu} is damaged; build it anew with python build_fmu.py") from None
    draw(options.out, response, f"{options.csv.name}: {beats} beats")
    stroke = 1e3 * np.ptp(response["radial_displacement"])
    field = 1e-6 * response["electric_field"].max()
    print(f"{beats} beats; the wall moves over {stroke:.2f} mm; largest field {field:.1f} V/um; wrote {options.out}")


def read_pressure(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Time [s] from 0 and pressure [Pa], from a file with units in its header."""
    protocol = read_csv(path, {"pressure": "Pa"})
    return protocol.time - protocol.time[0], protocol.inputs["pressure"]


def systolic_voltage(time: np.ndarray, pressure: np.ndarray, voltage: float) -> tuple[np.ndarray, int]:
    """The voltage on a grid of STEP: on at each upstroke of the pressure for 35 % of the mean beat."""
    grid = np.arange(0, time[-1], STEP)
    raw = np.interp(grid, time, pressure)
    # One peak a beat is left below 4 Hz; the dicrotic notch's rebound, as steep as the upstroke, comes after it.
    smooth = sosfiltfilt(butter(2, 4.0, fs=1 / STEP, output="sos"), raw)
    swing = np.ptp(np.percentile(smooth[grid.size // 4 :], [5, 95]))
    peaks, _ = find_peaks(smooth, prominence=max(0.4 * swing, 5 * MMHG), distance=round(0.25 / STEP))
    if peaks.size < 2:
        raise ProtocolError(f"expected a pressure with at least two beats of over 5 mmHg but found {peaks.size}")
    slope = np.gradient(raw, STEP)
    before = round(0.3 / STEP)
    upstrokes = [max(0, peak - before) + np.argmax(slope[max(0, peak - before) : peak]) for peak in peaks]
    systole = 0.35 * np.diff(grid[peaks]).mean()
    on = np.zeros(grid.size, bool)
    for start in grid[upstrokes]:
        on |= (grid >= start) & (grid < start + systole)
    return np.where(on, voltage, 0.0), peaks.size


def drive(fmu: Path, time: np.ndarray, pressure: np.ndarray, voltage: np.ndarray) -> np.ndarray:
    """The FMU's response, from rest under the first pressure."""
    grid = STEP * np.arange(voltage.size)
    inputs = np.zeros(grid.size, dtype=[("time", float), ("pressure", float), ("voltage", float)])
    inputs["time"], inputs["pressure"], inputs["voltage"] = grid, np.interp(grid, time, pressure), voltage
    return fmpy.simulate_fmu(
        str(fmu),
        fmi_type="CoSimulation",
        stop_time=grid[-1],
        output_interval=STEP,
        input=inputs,
        start_values={"start_at_equilibrium": True, "pressure": pressure[0]},
        output=["pressure", "voltage", "radial_displacement", "electric_field"],
    )


def draw(path: Path, response: np.ndarray, title: str) -> None:
    """Pressure, voltage, displacement and field over time."""
    panels = [
        ("pressure [mmHg]", {"": response["pressure"] / MMHG}),
        ("voltage [kV]", {"": 1e-3 * response["voltage"]}),
        ("displacement [mm]", {"": 1e3 * response["radial_displacement"]}),
        ("field [V/um]", {"": 1e-6 * response["electric_field"]}),
    ]
    write_atomically(path, time_panels(response["time"], panels, title))


if __name__ == "__main__":
    main()
