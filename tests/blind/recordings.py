"""From what a tube does to the files a laboratory keeps: sensors with zeros, noise, hum and bits; any format."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, cheby1, firwin, lfilter, lfilter_zi, oaconvolve

from blind.conventions import Conventions, Format, stream

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

    from blind.laboratory import Laboratory

LASER, PRESSURE, VOLTAGE, CURRENT = 15e-6, 25.0, 4.0, 1.5e-6  # rms of the bench sets' noise, SI
ZEROS = {"pressure": 40.0, "voltage": 8.0, "current": 2e-6, "radius": 20e-6}  # rms of zeros from file to file, SI
GAIN = 2e-3  # rms of the monitors' gains about 1
HUM = {"pressure": 15.0, "voltage": 5.0, "current": 1e-6, "radius": 6e-6}  # median amplitude at the mains' frequency
DRIFT = 5e-6  # m, rms of what the sensor drifts within a file
FULL_SCALE = {"pressure": 40e3, "voltage": 12e3, "current": 0.2, "radius": 20e-3}  # of the converter, SI
RESOLUTION = {"pressure": 0.1, "voltage": 0.1, "current": 1e-8, "radius": 2e-6, "trigger": 1.0}  # of plain files, SI
OVERSAMPLED = 32
LINEAR_PHASE = 8  # samples on either side that such a filter takes in


def write(lab: Laboratory, number: int, folder: Path) -> dict:
    """One recording as a file; what was drawn for it is returned."""
    c, file = lab.conventions, lab.files[number]
    columns, told = recorded(lab, number)
    random = stream(lab.seed, "file", number)
    names = [("displacement" if n == "radius" and c.displacement else n) for n in columns]
    content = text(names, np.column_stack(list(columns.values())), c.format, file.rate, random)
    (folder / f"{file.name}{c.format.suffix}").write_bytes(content.encode(c.format.encoding))
    return told


def recorded(lab: Laboratory, number: int) -> tuple[dict[str, np.ndarray], dict]:
    """A recording's columns [SI], and what was drawn for it."""
    c, file = lab.conventions, lab.files[number]
    random = stream(lab.seed, "recording", number)
    drive, times = lab.drives[file.drive], file.times
    radius, current = lab.truth[number]
    here = times - times[0]
    true = {
        "pressure": _monitored(drive.pressure, file.rate, times, c),
        "voltage": _monitored(drive.voltage, file.rate, times, c),
        "radius": radius,
    }
    if c.current:
        true["current"] = current
    columns, drawn = {"time": here}, {}
    for name, signal in true.items():
        columns[name], drawn[name] = _read(name, signal, here, c, file.rate, c.rates[0], random)
    error = columns["radius"] - radius
    noise = error - drawn["radius"]["zero"] - _line(here, error) * c.drift
    if c.trigger:
        columns["trigger"] = 5.0 * (np.searchsorted(np.array(file.switched), times + 1e-9, "right") % 2)
    if c.displacement:
        columns["radius"] = columns["radius"] - lab.tube.geometry["r_o"]
    keep = _kept(here.size, c, random)
    columns = {name: column[keep] for name, column in columns.items()}
    if c.not_a_number:
        columns["radius"] = np.where(random.random(keep.sum()) < 3e-3, np.nan, columns["radius"])
    return columns, {
        "name": file.name,
        "rate": file.rate,
        "begin": file.begin,
        "samples": int(keep.sum()),
        "drawn": drawn,
        "noise_rms": float(np.sqrt(np.mean(noise**2))),
        "switched": list(file.switched),
    }


def _line(t: np.ndarray, error: np.ndarray) -> np.ndarray:
    """The slow part of an error: its cubic trend, without the mean."""
    scaled = 2 * t / t[-1] - 1
    return np.polynomial.Polynomial.fit(scaled, error, 3)(scaled) - error.mean()


def _monitored(signal: PPoly, rate: float, times: np.ndarray, c: Conventions) -> np.ndarray:
    """What a monitor sees of an input at `times`: the input, or the input through its anti-aliasing filter.

    One of linear phase is a converter's own, which takes its delay off.
    """
    if not c.antialias:
        return signal(times + 1e-9)
    before = 64  # samples for the filter to settle
    fine = times[0] + (np.arange(-before * OVERSAMPLED, (times.size - 1) * OVERSAMPLED + 1)) / (rate * OVERSAMPLED)
    values = signal(np.clip(fine + 1e-9, signal.x[0], signal.x[-1]))
    if c.steep == "linear_phase":
        taps = firwin(2 * LINEAR_PHASE * OVERSAMPLED + 1, 0.9 / OVERSAMPLED, window=("kaiser", 6.0))
        found = oaconvolve(np.pad(values, LINEAR_PHASE * OVERSAMPLED, mode="edge"), taps, "valid")
    else:
        b, a = {
            "": butter(2, 0.4 * 2 / OVERSAMPLED),
            "butterworth": butter(4, 0.4 * 2 / OVERSAMPLED),
            "chebyshev": cheby1(4, 0.1, 0.4 * 2 / OVERSAMPLED),
        }[c.steep]
        found = lfilter(b, a, values, zi=lfilter_zi(b, a) * values[0])[0]  # as if it had always been so
    return found[before * OVERSAMPLED :: OVERSAMPLED]


def _read(
    name: str,
    signal: np.ndarray,
    t: np.ndarray,
    c: Conventions,
    rate: float,
    first_rate: float,
    random: np.random.Generator,
) -> tuple[np.ndarray, dict[str, float]]:
    """A sensor's reading of a signal, and what was drawn for it."""
    laser = name == "radius"
    rms = c.noise * {"radius": LASER, "pressure": PRESSURE, "voltage": VOLTAGE, "current": CURRENT}[name]
    zero = ZEROS[name] * random.standard_normal() * (c.laser_zero if laser else c.monitor_zeros)
    gain = 1 + GAIN * random.standard_normal() * (c.monitor_gains and not laser)
    noise = rms * _coloured(c.colour ** (first_rate / rate) if laser and c.colour else 0.0, t.size, random)
    found = signal * gain + zero + noise
    # drawn in any case, so that the next sensor's numbers stay what they are without this convention
    size, off = HUM[name] * np.exp(0.5 * random.standard_normal()), c.hum + 0.02 * random.standard_normal()
    parts, phases = (1.0, *random.uniform(0.05, 0.5, 2)), random.uniform(0, 2 * np.pi, 3)
    knots = DRIFT * random.standard_normal(5)
    if c.hum:
        for k, (part, phase) in enumerate(zip(parts, phases, strict=True), start=1):
            found = found + size * part * np.sin(2 * np.pi * k * off * t + phase)
    if c.drift and laser:
        found = found + CubicSpline(np.linspace(0, t[-1], 5), np.cumsum(knots) / np.sqrt(3))(t)
    fine = step(name, c)
    return fine * np.round(found / fine), {"zero": zero, "gain": gain, "noise": rms, "step": fine}


def step(name: str, c: Conventions) -> float:
    """From one number that a sensor can report to the next [SI]."""
    return FULL_SCALE[name] / 2**c.bits if c.bits else RESOLUTION[name]


def _coloured(keep: float, n: int, random: np.random.Generator) -> np.ndarray:
    """AR(1) noise of unit rms."""
    white = random.standard_normal(n)
    if not keep:
        return white
    return lfilter([np.sqrt(1 - keep**2)], [1, -keep], white, zi=[keep * random.standard_normal()])[0]


def _kept(n: int, c: Conventions, random: np.random.Generator) -> np.ndarray:
    """Which samples there are: all, or not some single ones and one stretch."""
    keep = np.ones(n, bool)
    if c.gaps:
        keep[random.random(n) < 2e-3] = False
        start = int(random.uniform(0.1, 0.9) * n)
        keep[start : start + int(random.integers(3, 40))] = False
        keep[0] = True
    return keep


def text(names: list[str], table: np.ndarray, f: Format, rate: float, random: np.random.Generator) -> str:
    """A table (SI) as the file's text."""
    units = {name: (unit, si) for name, unit, si in f.units}
    units["displacement"] = units["radius"]
    order = random.permutation(len(names)) if f.shuffled else np.arange(len(names))
    left, right = f.brackets
    head, formats, scaled = [], [], []
    for i in order:
        name = names[i]
        unit, si = units[name]
        head.append(f"{name.capitalize() if f.capital else name} {left}{unit}{right}")
        fine = {"time": 1e-3 / rate, "radius": 2e-7, "displacement": 2e-7}.get(name) or RESOLUTION[name] / 2
        formats.append(f"%.{max(0, int(np.ceil(-np.log10(fine / si))))}f")
        scaled.append(table[:, i] / si)
    row = f.delimiter.join(formats) + (f.delimiter if f.remarks else "")
    head += ["comment"] if f.remarks else []
    body = ((row + "\n") * len(table)) % tuple(np.column_stack(scaled).ravel().tolist())
    if f.decimal != ".":
        body = body.replace(".", f.decimal)
    return "\n".join([*f.comments, f.delimiter.join(head), body])


def write_bench_file(lab: Laboratory, folder: Path) -> None:
    """`bench.toml`, where there is something that the files cannot say: geometry, noise, starts, order."""
    c = lab.conventions
    lines = []
    if "geometry" in c.names():
        units = {"rho": "kg/m3", "n_layers": ""}
        lines.append("[geometry]")
        for name, value in c.geometry:
            quantity = f'"{value * 1e3:.6g} mm"' if name not in units else f"{value:g}"
            lines.append(f"{name} = {quantity}")
    if c.noise_told and not (c.hum or c.bits or c.drift):
        lines += ["[noise]", f'radius = "{c.noise * LASER * 1e6:.6g} um"']
    if c.start_told and not c.order:
        lines += ["[start]", *(f'"{f.name}" = "{f.start}"' for f in lab.files)]
    if c.order:
        lines.append("[order]")
        lines += [f'"{f.name}" = {start:.6f}' for f, start in zip(lab.files, lab.starts, strict=True)]
    if lines:
        (folder / "bench.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
