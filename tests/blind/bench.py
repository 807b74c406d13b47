"""The bench of the blind trials: draws a tube and what hides in it by seed, and writes CSV folders only.

Nothing here imports the package. The equations are in tube.c; `EFFECTS` maps the catalogue's ids to the numbers and
magnitudes they have there. What was drawn is kept beside the folder (`truth.json` one level up), not in it.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

HERE = Path(__file__).parent
RATE = 250.0  # Hz
PARTS = 8  # of a sample, where the sensor is late
STEP, COARSE = 0.25e-3, 2e-3  # s, of the integrator for records, and for differences
FOLLOWS, NUDGE = 16, 5e-4  # steps by which the other numbers follow, and the relative move of their differences
MMHG = 133.322
TABLE_III = (333.056e3, -32.5032e3, 2.86041e3, 2.8, 745.854e3, 19.6758e6, 6495.68e3, 2.414e6, 6508.21e3)
NAMES = ("C_1", "C_2", "C_3", "eps_r", "eta_o", "k_1", "eta_1", "k_2", "eta_2")  # as they follow in TABLE_III
TABLE_I = (15e-3, 24.5e-3, 1e-3, 100e-6, 1e3)
N_EFFECTS = 30

# id: (number in tube.c, lower and upper ends of a, b, c); a negative range of a may take either sign as it stands
EFFECTS: dict[str, tuple[int, list[tuple[float, float]]]] = {
    "electrode_resistance": (1, [(6e-3, 30e-3)]),
    "amplifier_slew": (2, [(8e4, 4e5)]),
    "charge_trapping": (3, [(0.02, 0.06), (0.5, 4.0)]),
    "stretch_dependent_permittivity": (4, [(0.15, 0.4)]),
    "field_dependent_permittivity": (5, [(-0.3, -0.12), (5e7, 9e7)]),
    "rate_dependent_viscosity": (6, [(-0.6, -0.25), (0.03, 0.2)]),
    "stretch_dependent_viscosity": (7, [(1.5, 4.0)]),
    "hoop_viscoelasticity": (8, [(8e3, 3e4), (0.1, 1.0), (0.0, 3e2)]),
    "third_maxwell_branch": (9, [(4e6, 1e7), (0.02, 0.08)]),
    "mullins_softening": (10, [(0.05, 0.2), (0.02, 0.1)]),
    "friction_hysteresis": (11, [(1e3, 5e3), (3e-3, 2e-2)]),
    "permanent_set": (12, [(0.03, 0.1), (0.02, 0.5)]),
    "passive_layer_stiffness": (14, [(1e4, 4e4)]),
    "strain_stiffening": (15, [(2e4, 6e4), (1.0, 3.0)]),
    "clamp_compliance": (16, [(0.1, 0.3)]),
    "rigid_stop": (17, [(1e5, 1e6), (2e-3, 5e-3), (1.22, 1.32)]),
    "thermal_softening": (18, [(0.02, 0.06), (3.0, 12.0)]),
    "pressure_offset": (19, [(80.0, 400.0)]),
    "pressure_delay": (21, [(6e-3, 20e-3)]),
    "pneumatic_line": (22, [(5e-3, 2e-2), (3e-3, 1e-2)]),
    "radius_offset": (23, [(2e-5, 1e-4)]),
    "radius_gain": (24, [(1.015, 1.05)]),
    "sensor_lag": (25, [(4e-3, 2e-2)]),
    "sensor_delay": (26, [(6e-3, 2e-2)]),
}
FOREIGN: dict[str, tuple[int, list[tuple[float, float]]]] = {  # in no library
    "odd_mechanical": (27, [(1.5e3, 4e3), (0.015, 0.03)]),
    "odd_electrical": (28, [(8e3, 2.5e4), (8e6, 1.5e7)]),
    "odd_pressure": (29, [(80.0, 250.0), (300.0, 700.0)]),
}
CHANNELS = {
    "electrical": ("electrode_resistance", "amplifier_slew", "charge_trapping", "stretch_dependent_permittivity",
                   "field_dependent_permittivity", "odd_electrical"),
    "pressure": ("pressure_offset", "pressure_gain", "pressure_delay", "pneumatic_line", "odd_pressure"),
    "sensor": ("radius_offset", "radius_gain", "sensor_lag", "sensor_delay"),
}  # fmt: skip


@dataclass(frozen=True)
class Tube:
    """What is on the bench: nine identified parameters (SI), effects with a, b, c, and the sensor's noise."""

    identified: tuple[float, ...]
    effects: dict[str, tuple[float, ...]]
    laser_rms: float = 15e-6
    correlation: float = 0.0


def channel(effect: str) -> str:
    """The channel an effect belongs to."""
    return next((c for c, names in CHANNELS.items() if effect in names), "mechanical")


def draw(seed: int, kind: str = "any") -> Tube:
    """A tube by seed. `kind`: none, one, two, foreign, an effect's id, or any (20, 50, 15, 15 % of the former)."""
    random = np.random.default_rng([seed, int.from_bytes(hashlib.sha256(kind.encode()).digest()[:4], "big")])
    identified = tuple(np.array(TABLE_III) * (1 + 0.06 * random.uniform(-1, 1, 9)))
    correlation = float(random.choice([0.0, random.uniform(0.3, 0.7)]))
    if kind == "any":
        kind = str(random.choice(["none", "one", "two", "foreign"], p=[0.2, 0.5, 0.15, 0.15]))
    names: list[str] = []
    if kind in ("one", "two"):
        names = list(random.choice(sorted(EFFECTS), size=1 if kind == "one" else 2, replace=False))
    elif kind == "foreign":
        names = [str(random.choice(sorted(FOREIGN)))]
    elif kind != "none":
        names = [kind]
    everything = EFFECTS | FOREIGN
    effects = {n: tuple(float(random.uniform(low, high)) for low, high in everything[n][1]) for n in names}
    return Tube(identified, effects, 15e-6, correlation)


def protocols() -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray, float]]:
    """Name -> breakpoints of time [s], pressure [Pa], voltage [V] (a time twice is a jump), and the duration [s]."""
    made = {
        "01_ramp_4kV": _merge([(0, 0), (9, 85.5), (14, 95)], [(0, 0), (4, 0), (9.56, 4), (14, 4)]),
        "02_step_4kV": _merge([(0, 0), (1, 95), (16, 95)], _switched([(2, 12, 4)], 16)),
        "03_step_6kV": _merge([(0, 0), (1, 92), (16, 92)], _switched([(2, 12, 6)], 16)),
        "04_ramp_7kV": _merge([(0, 0), (9, 98.1), (13.2, 109)], [(0, 0), (4, 0), (9.56, 7), (13.2, 7)]),
        "05_pressure_steps": _merge(_levels([60, 90, 70, 110, 80], 2.5), [(0, 0), (12.5, 0)]),
        "06_pressure_triangles": _merge(_triangles([60, 90, 120, 120, 90]), [(0, 0), (15, 0)]),
        "07_voltage_steps": _merge(
            [(0, 0), (0.5, 50), (9.6, 50), (10.1, 80), (19.2, 80), (19.7, 100), (28.8, 100)],
            _switched([(1.2 + 2.4 * i, min(2.4 + 2.4 * i, 28.8), (3, 5, 4, 5.5)[i % 4]) for i in range(12)], 28.8),
        ),
        "08_heartbeat_5kV": _merge(_beats(12), _switched(_assists(12), 10.8)),
    }
    return {name: (*_sampled(*arrays), float(arrays[0][-1])) for name, arrays in made.items()}


def _sampled(time: np.ndarray, pressure: np.ndarray, voltage: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The protocol with a voltage that holds from sample to sample, as the amplifier's does; stairs where it ramps."""
    ramps = np.any((np.diff(time) > 0) & (np.diff(voltage) != 0))
    if not ramps:
        return time, pressure, voltage
    samples = np.arange(1, round(time[-1] * RATE)) / RATE
    inner = np.setdiff1d(np.round(time, 9), np.round(np.append(samples, 0), 9))
    grid = np.sort(np.concatenate([[0.0], samples, samples, inner]))
    first = np.append(np.diff(grid) == 0, False)
    latest = np.floor(grid * RATE + 1e-6 - first) / RATE
    return grid, np.interp(grid, time, pressure), np.interp(latest, time, voltage)


def _levels(levels: list[float], hold: float) -> list[tuple[float, float]]:
    points: list[tuple[float, float]] = [(0, 0), (0.3, levels[0])]
    for i, (low, high) in enumerate(zip(levels, levels[1:], strict=False), start=1):
        points += [(i * hold, low), (i * hold + 0.02, high)]
    return [*points, (len(levels) * hold, levels[-1])]


def _triangles(peaks: list[float]) -> list[tuple[float, float]]:
    points: list[tuple[float, float]] = [(0, 0)]
    for i, peak in enumerate(peaks):
        points += [(3 * i + 1.5, peak), (3 * i + 3, 5)]
    return points


def _beats(count: int) -> list[tuple[float, float]]:
    points: list[tuple[float, float]] = [(0, 0), (0.6, 75)]
    for i in range(count):
        points += [(0.8 + i / 1.2 + t, p) for t, p in
                   ((0, 75), (0.08, 100.8), (0.2, 118), (0.33, 101.6), (0.36, 104.3), (0.6, 87.2))]  # fmt: skip
    return [(t, p) for t, p in points if t < 10.8] + [(10.8, 75.2)]


def _assists(count: int) -> list[tuple[float, float, float]]:
    """On at a thirtieth of a second before the beat, for a third; switching falls on samples."""
    return [(round((0.766 + i / 1.2) * RATE + 0.4) / RATE, round((1.1 + i / 1.2) * RATE + 0.4) / RATE, 5.0)
            for i in range(count) if 1.1 + i / 1.2 < 10.8]  # fmt: skip


def _switched(pieces: list[tuple[float, float, float]], stop: float) -> list[tuple[float, float]]:
    points: list[tuple[float, float]] = [(0, 0)]
    for on, off, level in pieces:
        points += [(on, 0), (on, level), (off, level)] + ([(off, 0)] if off < stop else [])
    return points if points[-1][0] >= stop else [*points, (stop, 0)]


def _merge(pressure: list, voltage: list) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Both inputs on one grid; pressure in mmHg and voltage in kV become SI."""
    tp, p = np.round(np.array(pressure, float), 9).T
    tv, v = np.round(np.array(voltage, float), 9).T
    inner = np.setdiff1d(tp, tv)
    grid = np.sort(np.concatenate([tv, inner]))
    doubled = np.append(False, np.diff(grid) == 0)
    before = [v[tv <= t][-1] if t in tv else np.interp(t, tv, v) for t in grid]
    first = [v[np.flatnonzero(tv == t)[0]] if t in tv else before[i] for i, t in enumerate(grid)]
    return grid, np.interp(grid, tp, p) * MMHG, np.where(doubled, before, first) * 1e3


@cache
def _library() -> ctypes.CDLL:
    source = (HERE / "tube.c").read_text(encoding="utf-8")
    key = hashlib.sha256(source.encode()).hexdigest()[:16]
    built = Path(tempfile.gettempdir()) / f"blind-tube-{key}.so"
    if not built.exists():
        partial = built.with_suffix(f".{np.random.default_rng().integers(1 << 32)}")
        command = [sys.executable, "-m", "ziglang", "cc", "-O2", "-std=c99", "-shared", "-fPIC", "-o", str(partial),
                   str(HERE / "tube.c"), "-lm"]  # fmt: skip
        subprocess.run(command, check=True)
        partial.replace(built)
    return ctypes.CDLL(str(built))


def radius(tube: Tube, protocol: tuple[np.ndarray, np.ndarray, np.ndarray, float], h: float = STEP) -> np.ndarray:
    """The true reading of a noiseless sensor [m] at 250 Hz, by steps `h` [s]; ValueError where the tube bursts."""
    time, pressure, voltage, stop = (np.ascontiguousarray(a, float) if np.ndim(a) else a for a in protocol)
    if "pressure_delay" in tube.effects:
        late = tube.effects["pressure_delay"][0]
        grid = np.unique(np.concatenate([time, np.minimum(time + late, stop)]))
        grid = np.sort(np.concatenate([grid, time[1:][np.diff(time) == 0]]))
        doubled = np.append(False, np.diff(grid) == 0)
        place = np.where(doubled, np.searchsorted(time, grid, "right") - 1, np.searchsorted(time, grid, "left"))
        left = np.where(np.isin(grid, time), voltage[np.minimum(place, time.size - 1)], _between(time, voltage, grid))
        pressure = np.interp(grid - late, time, pressure)
        time, voltage = grid, left
    parts = PARTS if {"sensor_lag", "sensor_delay"} & set(tube.effects) else 1
    lambda_2 = np.empty(round(stop * RATE) * parts)
    on = np.zeros((N_EFFECTS, 4))
    for name, values in tube.effects.items():
        number = (EFFECTS | FOREIGN)[name][0]
        on[number, 0] = 1
        on[number, 1 : 1 + len(values)] = values
    constants = np.array([*TABLE_I, *tube.identified])
    arrays = [np.ascontiguousarray(a, float) for a in (time, pressure, voltage)]
    good = _library().trajectory(
        _ptr(constants),
        _ptr(on),
        ctypes.c_long(len(arrays[0])),
        *map(_ptr, arrays),
        ctypes.c_double(1 / RATE / parts),
        ctypes.c_long(lambda_2.size),
        ctypes.c_long(max(1, round(1 / RATE / parts / h))),
        _ptr(lambda_2),
    )
    if not good:
        raise ValueError(f"the tube bursts under {tube}")
    return _sensed(tube, TABLE_I[0] * lambda_2, 1 / RATE / parts)[::parts]


def signature(tube: Tube, name: str) -> float:
    """How far an effect moves the readings where nothing else can follow, squared, in units of the laser's noise.

    The identified parameters and the other effects' numbers follow as well as they can. What is small here cannot be
    found by anybody, however good. Infinite where the coarse steps of this comparison make the tube burst.
    """
    rest = replace(tube, effects={n: v for n, v in tube.effects.items() if n != name})
    try:
        target = _readings(tube)
    except ValueError:
        return np.inf

    def left(shares: np.ndarray) -> np.ndarray:
        try:
            return _whitened(tube, _readings(_scaled(rest, shares)) - target)
        except ValueError:
            return np.full(target.size - 1, 1e3)  # it bursts

    start = np.ones(len(_numbers(rest)))
    return 2 * float(least_squares(left, start, x_scale="jac", diff_step=NUDGE, max_nfev=FOLLOWS).cost)


def _numbers(tube: Tube) -> list[float]:
    return [*tube.identified, *(v for values in tube.effects.values() for v in values)]


def _scaled(tube: Tube, shares: np.ndarray) -> Tube:
    """The tube with each of its numbers multiplied by its share."""
    numbers = iter(np.array(_numbers(tube)) * shares)
    identified = tuple(next(numbers) for _ in tube.identified)
    return replace(tube, identified=identified, effects={n: tuple(next(numbers) for _ in v)
                                                         for n, v in tube.effects.items()})  # fmt: skip


def _readings(tube: Tube) -> np.ndarray:
    """All protocols' noiseless readings [m], one after the other."""
    return np.concatenate([radius(tube, p, COARSE) for p in protocols().values()])


def _whitened(tube: Tube, readings: np.ndarray) -> np.ndarray:
    white = (readings[1:] - tube.correlation * readings[:-1]) / np.sqrt(1 - tube.correlation**2)
    return white / tube.laser_rms


def _between(time: np.ndarray, values: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Values at times `t`, the later ones where a time is listed twice."""
    right = np.clip(np.searchsorted(time, t, "right"), 1, time.size - 1)
    span = np.maximum(time[right] - time[right - 1], 1e-12)
    return values[right - 1] + (t - time[right - 1]) / span * (values[right] - values[right - 1])


def _sensed(tube: Tube, true: np.ndarray, every: float) -> np.ndarray:
    """What the sensor makes of the `true` radius at times `every` apart."""
    rest, t = TABLE_I[0], np.arange(true.size) * every
    if "radius_gain" in tube.effects:
        true = rest + tube.effects["radius_gain"][0] * (true - rest)
    if "radius_offset" in tube.effects:
        true = true + tube.effects["radius_offset"][0]
    if "sensor_delay" in tube.effects:
        true = np.interp(t - tube.effects["sensor_delay"][0], t, true)
    if "sensor_lag" in tube.effects:  # exact for a reading that is straight between the times
        keep = np.exp(-every / tube.effects["sensor_lag"][0])
        mean = 1 - (1 - keep) * tube.effects["sensor_lag"][0] / every  # weight of the later end
        true, _ = lfilter([mean, 1 - keep - mean], [1, -keep], true, zi=[(1 - mean) * true[0]])
    return true


def _ptr(array: np.ndarray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)


def truths(tube: Tube, only: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """The noiseless reading of every protocol [m] (or of some), by its name."""
    return {name: radius(tube, protocol) for name, protocol in protocols().items() if only is None or name in only}


def write(tube: Tube, folder: Path, seed: int | list[int], only: Sequence[str] | None = None,
          true: dict[str, np.ndarray] | None = None) -> Path:  # fmt: skip
    """The recordings of a tube as CSV files, with the noise of sensor and monitors; `true` are its `truths`."""
    random = np.random.default_rng([*np.atleast_1d(seed), 77])
    folder.mkdir(parents=True, exist_ok=True)
    for name, readings in (truths(tube, only) if true is None else true).items():
        time, pressure, voltage, _ = protocols()[name]
        t = np.arange(readings.size) / RATE
        columns = np.column_stack([
            t,
            np.interp(t, time, pressure) + 25 * random.standard_normal(t.size),
            _between(time, voltage, t + 1e-9) + 4 * random.standard_normal(t.size),
            2e-6 * np.round((readings + _laser(tube, t.size, random)) / 2e-6),
        ])  # fmt: skip
        np.savetxt(folder / f"{name}.csv", columns, delimiter=",", fmt=["%.4f", "%.1f", "%.1f", "%.6f"],
                   header="time [s],pressure [Pa],voltage [V],radius [m]", comments="")  # fmt: skip
    return folder


def _laser(tube: Tube, n: int, random: np.random.Generator) -> np.ndarray:
    noise = random.standard_normal(n)
    for i in range(1, n):
        noise[i] = tube.correlation * noise[i - 1] + np.sqrt(1 - tube.correlation**2) * noise[i]
    return tube.laser_rms * noise


def make(seed: int, folder: Path, kind: str = "any") -> Tube:
    """Draw until the tube survives all protocols, write its recordings, and note what was drawn beside the folder."""
    for attempt in range(50):
        tube = draw(seed * 1000 + attempt, kind)
        try:
            write(tube, folder, seed)
        except ValueError:
            continue
        note = {"effects": tube.effects, "identified": tube.identified, "correlation": tube.correlation}
        (folder.parent / f"{folder.name}.truth.json").write_text(json.dumps(note, indent=1), encoding="utf-8")
        return tube
    raise ValueError(f"no tube of kind {kind!r} survives all protocols")
