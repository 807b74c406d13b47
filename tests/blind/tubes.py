"""A tube on the bench and what it does: the door to tube.c."""

from __future__ import annotations

import ctypes
import hashlib
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.interpolate import PPoly

from blind.effects import EVERYTHING, TABLE_ROWS

SOURCE = Path(__file__).parent / "tube.c"
TIGHT, LOOSE = 1e-8, 1e-6  # tolerances of tube.c: for recordings, and for differences of them
LOOKS = 32  # of which a moving average is taken
MMHG = 133.322  # Pa
TABLE_I = {"r_o": 15e-3, "l_o": 24.5e-3, "h_o": 1e-3, "h_ao": 100e-6, "rho": 1e3, "n_layers": 8.0}
TABLE_III = {
    "C_1": 333.056e3,
    "C_2": -32.5032e3,
    "C_3": 2.86041e3,
    "eps_r": 2.8,
    "eta_o": 745.854e3,
    "k_1": 19.6758e6,
    "eta_1": 6495.68e3,
    "k_2": 2.414e6,
    "eta_2": 6508.21e3,
}


class BurstError(ValueError):
    """The tube does not survive what is done to it."""


@dataclass(frozen=True)
class Tube:
    """Nine identified parameters, the geometry (both SI), and what hides: a name and its numbers."""

    identified: dict[str, float] = field(default_factory=TABLE_III.copy)
    geometry: dict[str, float] = field(default_factory=TABLE_I.copy)
    hidden: dict[str, tuple[float, ...]] = field(default_factory=dict)

    def without(self, name: str) -> Tube:
        """The same tube with one thing less hidden in it."""
        return replace(self, hidden={n: v for n, v in self.hidden.items() if n != name})


@dataclass(frozen=True)
class Drive:
    """What is done to a tube: pressure [Pa] and voltage [V] in cubic pieces over time [s]; `hard` ends have corners."""

    pressure: PPoly
    voltage: PPoly
    hard: np.ndarray

    @property
    def start(self) -> float:
        """Where it begins, with the tube at rest [s]."""
        return float(self.pressure.x[0])

    def pieces(self, pressure_late: float = 0.0, voltage_late: float = 0.0) -> tuple[np.ndarray, ...]:
        """Starts of common pieces, and their coefficients in rising powers, each signal as late [s] as it comes."""
        stop = min(self.pressure.x[-1], self.voltage.x[-1])
        pressure, voltage = _late(self.pressure, pressure_late), _late(self.voltage, voltage_late)
        corners = np.concatenate([self.hard + late for late in (0.0, pressure_late, voltage_late)])
        inner = np.concatenate([pressure.x, voltage.x, corners])
        grid = np.unique(np.round(inner[(inner > self.start) & (inner < stop)], 12))
        grid = np.concatenate([[self.start], grid[np.diff(grid, prepend=self.start) > 1e-9], [stop]])
        return grid, rising(pressure, grid), rising(voltage, grid), _among(grid, np.sort(np.append(corners, stop)))


def _late(signal: PPoly, by: float) -> PPoly:
    """The signal `by` seconds later, and until then what it is at first."""
    if not by:
        return signal
    c = np.column_stack([np.append(np.zeros(signal.c.shape[0] - 1), signal(signal.x[0])), signal.c])
    return PPoly(c, np.concatenate([[signal.x[0]], signal.x + by]))


def _among(grid: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """1 where a time of the grid is one of the (sorted) corners, 0 elsewhere, for C."""
    after = np.minimum(np.searchsorted(corners, grid), corners.size - 1)
    gap = np.minimum(np.abs(corners[after] - grid), np.abs(corners[np.maximum(after - 1, 0)] - grid))
    return (gap < 2e-9).astype(np.int8)


def rising(signal: PPoly, grid: np.ndarray) -> np.ndarray:
    """Coefficients (pieces, 4) of the signal about the starts of a finer grid's pieces."""
    at = (grid[:-1] + grid[1:]) / 2  # within the piece, whichever side of a jump its start is on
    shift = at - grid[:-1]
    d = [signal(at, k) for k in range(4)]
    return np.column_stack(
        [
            d[0] - shift * d[1] + shift**2 / 2 * d[2] - shift**3 / 6 * d[3],
            d[1] - shift * d[2] + shift**2 / 2 * d[3],
            (d[2] - shift * d[3]) / 2,
            d[3] / 6,
        ]
    )


@cache
def _library() -> ctypes.CDLL:
    source = SOURCE.read_bytes() + SOURCE.with_name("radau.h").read_bytes()
    key = hashlib.sha256(source).hexdigest()[:16]
    built = Path(tempfile.gettempdir()) / f"blind-tube-{key}.so"
    if not built.exists():
        partial = built.with_suffix(f".{np.random.default_rng().integers(1 << 32)}")
        command = [
            sys.executable,
            "-m",
            "ziglang",
            "cc",
            "-O2",
            "-std=gnu99",
            "-shared",
            "-fPIC",
            "-o",
            str(partial),
            str(SOURCE),
            "-lm",
        ]
        subprocess.run(command, check=True)
        partial.replace(built)
    return ctypes.CDLL(str(built))


def run(
    tube: Tube, drive: Drive, times: np.ndarray, *, clock: float = 0.0, monitor_lag: float = 0.0, tol: float = TIGHT
) -> tuple[np.ndarray, np.ndarray]:
    """What noiseless sensors read at `times` [s]: radius [m] and current [A] (0 without a `monitor_lag` [s]).

    Drifts begin at `clock` [s] on the drive's own time. BurstError where the tube does not survive.
    """
    hidden = tube.hidden
    grid, p, v, hard = drive.pieces(*(hidden.get(name, (0.0,))[0] for name in ("pressure_delay", "voltage_delay")))
    on = np.zeros((TABLE_ROWS, 4))
    for name, numbers in hidden.items():
        on[EVERYTHING[name].number, : 1 + len(numbers)] = (1, *numbers)
    constants = np.array([*tube.geometry.values(), *tube.identified.values(), monitor_lag, -clock])
    back = np.array([0.0])  # s: how long before each sample the laser looks; a mean is taken of the later ones
    if "sensor_average" in hidden:
        back = np.r_[0.0, (np.arange(LOOKS) + 0.5) / LOOKS * hidden["sensor_average"][0]]
    looks = np.subtract.outer(times - hidden.get("sensor_delay", (0.0,))[0], back)
    asked, place = np.unique(looks, return_inverse=True)
    stretch, current = np.zeros(asked.size), np.zeros(asked.size)
    good = _library().trajectory(
        _ptr(constants),
        _ptr(on),
        ctypes.c_long(grid.size - 1),
        _ptr(grid),
        _ptr(p),
        _ptr(v),
        _ptr(hard),
        ctypes.c_double(tol),
        ctypes.c_long(asked.size),
        _ptr(asked),
        _ptr(stretch),
        _ptr(current),
    )
    if not good:
        raise BurstError(f"the tube bursts with {hidden or 'nothing'} hidden in it")
    seen = stretch[place].reshape(looks.shape)
    return tube.geometry["r_o"] * seen[:, min(1, back.size - 1) :].mean(1), current[place].reshape(looks.shape)[:, 0]


def _ptr(array: np.ndarray) -> ctypes.c_void_p:
    assert array.flags.c_contiguous
    return array.ctypes.data_as(ctypes.c_void_p)
