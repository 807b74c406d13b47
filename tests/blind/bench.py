"""The bench sets: tubes drawn by seed and recorded by one set of conventions, those of the data beside the repository.

Nothing here imports the package; equations are in tube.c. What was drawn is kept beside the folder (`truth.json` one
level up), not in it. Other conventions are in laboratory.py.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import PPoly

from blind import effects, tubes

RATE = 250.0  # Hz
TABLE_III = tuple(tubes.TABLE_III.values())
NAMES = tuple(tubes.TABLE_III)
R_O = tubes.TABLE_I["r_o"]
SINCE = (
    "permittivity_drift",
    "prestretch",
    "added_mass",
    "stiffness_drift",
    "pressure_gain",
    "sensor_drift",
    "voltage_delay",
    "slow_discharge",
)
EFFECTS = {name: hidden for name, hidden in effects.EFFECTS.items() if name not in SINCE}  # as the sets were drawn
EXTERNAL = {name: hidden for name, hidden in effects.EXTERNAL.items() if name.startswith("odd_")}


@dataclass(frozen=True)
class Tube:
    """What is on the bench: nine identified parameters (SI), effects with a, b, c, and the sensor's noise."""

    identified: tuple[float, ...]
    effects: dict[str, tuple[float, ...]]
    laser_rms: float = 15e-6
    correlation: float = 0.0


def draw(seed: int, kind: str = "any") -> Tube:
    """A tube by seed. `kind`: none, one, two, external, an effect's id, or any (20, 50, 15, 15 % of the former)."""
    random = np.random.default_rng([seed, int.from_bytes(hashlib.sha256(kind.encode()).digest()[:4], "big")])
    identified = tuple(np.array(TABLE_III) * (1 + 0.06 * random.uniform(-1, 1, 9)))
    correlation = float(random.choice([0.0, random.uniform(0.3, 0.7)]))
    if kind == "any":
        kind = str(random.choice(["none", "one", "two", "external"], p=[0.2, 0.5, 0.15, 0.15]))
    names: list[str] = []
    if kind in ("one", "two"):
        names = list(random.choice(sorted(EFFECTS), size=1 if kind == "one" else 2, replace=False))
    elif kind == "external":
        names = [str(random.choice(sorted(EXTERNAL)))]
    elif kind != "none":
        names = [kind]
    everything = EFFECTS | EXTERNAL
    hidden = {n: tuple(float(random.uniform(low, high)) for low, high in everything[n].ranges) for n in names}
    return Tube(identified, hidden, 15e-6, correlation)


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
        points += [
            (0.8 + i / 1.2 + t, p)
            for t, p in ((0, 75), (0.08, 100.8), (0.2, 118), (0.33, 101.6), (0.36, 104.3), (0.6, 87.2))
        ]
    return [(t, p) for t, p in points if t < 10.8] + [(10.8, 75.2)]


def _assists(count: int) -> list[tuple[float, float, float]]:
    """On at a thirtieth of a second before the beat, for a third; switching falls on samples."""
    return [
        (round((0.766 + i / 1.2) * RATE + 0.4) / RATE, round((1.1 + i / 1.2) * RATE + 0.4) / RATE, 5.0)
        for i in range(count)
        if 1.1 + i / 1.2 < 10.8
    ]


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
    return grid, np.interp(grid, tp, p) * tubes.MMHG, np.where(doubled, before, first) * 1e3


def radius(tube: Tube, protocol: tuple[np.ndarray, np.ndarray, np.ndarray, float]) -> np.ndarray:
    """The true reading of a noiseless sensor [m] at 250 Hz; BurstError where the tube bursts."""
    time, pressure, voltage, stop = protocol
    held = np.diff(time) > 0
    lines = [
        PPoly(np.array([np.diff(y)[held] / np.diff(time)[held], y[:-1][held]]), np.unique(time))
        for y in (pressure, voltage)
    ]
    real = tubes.Tube(dict(zip(NAMES, tube.identified, strict=True)), tubes.TABLE_I, tube.effects)
    return tubes.run(real, tubes.Drive(*lines, np.unique(time)), np.arange(round(stop * RATE)) / RATE)[0]


def _between(time: np.ndarray, values: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Values at times `t`, the later ones where a time is listed twice."""
    right = np.clip(np.searchsorted(time, t, "right"), 1, time.size - 1)
    span = np.maximum(time[right] - time[right - 1], 1e-12)
    return values[right - 1] + (t - time[right - 1]) / span * (values[right] - values[right - 1])


def truths(tube: Tube, only: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """The noiseless reading of every protocol [m] (or of some), by its name."""
    return {name: radius(tube, protocol) for name, protocol in protocols().items() if only is None or name in only}


def write(
    tube: Tube,
    folder: Path,
    seed: int | list[int],
    only: Sequence[str] | None = None,
    true: dict[str, np.ndarray] | None = None,
) -> Path:
    """The recordings of a tube as CSV files, with the noise of sensor and monitors; `true` are its `truths`."""
    random = np.random.default_rng([*np.atleast_1d(seed), 77])
    folder.mkdir(parents=True, exist_ok=True)
    for name, readings in (truths(tube, only) if true is None else true).items():
        time, pressure, voltage, _ = protocols()[name]
        t = np.arange(readings.size) / RATE
        columns = np.column_stack(
            [
                t,
                np.interp(t, time, pressure) + 25 * random.standard_normal(t.size),
                _between(time, voltage, t + 1e-9) + 4 * random.standard_normal(t.size),
                2e-6 * np.round((readings + _laser(tube, t.size, random)) / 2e-6),
            ]
        )
        np.savetxt(
            folder / f"{name}.csv",
            columns,
            delimiter=",",
            fmt=["%.4f", "%.1f", "%.1f", "%.6f"],
            header="time [s],pressure [Pa],voltage [V],radius [m]",
            comments="",
        )
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
