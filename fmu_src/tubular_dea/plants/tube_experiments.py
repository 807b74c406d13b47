"""Experiments on a tube: the standard ones, and feasible ones within the recorded range."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from ..model.dea import MMHG
from ..protocol import Protocol

WITHIN = 0.85  # of the largest pressure and voltage recorded
BEATS, PERIOD = 12, 1 / 1.2  # of the heartbeat experiment, and s
BEAT = ((0.0, 75.0), (0.096, 100.8), (0.24, 118.0), (0.4, 101.6), (0.43, 104.3), (0.72, 87.2))  # share of a beat, mmHg
ASSISTS = (0.766, 1.1)  # s: the first pulse of the voltage in it, one a beat

Knots = Sequence[tuple[float, float]]


def standard() -> dict[str, Protocol]:
    """The experiments of the bench sets: ramps and steps of the paper's kinds, pressure alone, a heart's beats."""
    switched = [(1.2 + 2.4 * i, 2.4 + 2.4 * i, (3.0, 5.0, 4.0, 5.5)[i % 4]) for i in range(12)]
    pulses = [(ASSISTS[0] + i * PERIOD, ASSISTS[1] + i * PERIOD, 5.0) for i in range(BEATS)]
    peaks = [knot for i, top in enumerate((60, 90, 120, 120, 90)) for knot in ((3 * i + 1.5, top), (3 * i + 3.0, 5))]
    plateaus = [(0, 0), (0.5, 50), (9.6, 50), (10.1, 80), (19.2, 80), (19.7, 100), (28.8, 100)]
    return {
        "ramp to 4 kV": _bench([(0, 0), (9, 85.5), (14, 95)], [(0, 0), (4, 0), (9.56, 4), (14, 4)]),
        "step to 4 kV": _bench([(0, 0), (1, 95), (16, 95)], _pulsed([(2, 12, 4.0)], 16)),
        "step to 6 kV": _bench([(0, 0), (1, 92), (16, 92)], _pulsed([(2, 12, 6.0)], 16)),
        "ramp to 7 kV": _bench([(0, 0), (9, 98.1), (13.2, 109)], [(0, 0), (4, 0), (9.56, 7), (13.2, 7)]),
        "pressure steps": _bench(_levels((60, 90, 70, 110, 80), 2.5), [(0, 0), (12.5, 0)]),
        "pressure triangles": _bench([(0, 0), *peaks], [(0, 0), (15, 0)]),
        "voltage steps": _bench(plateaus, _pulsed(switched, 28.8)),
        "heartbeats at 5 kV": _bench(_beats(), _pulsed(pulses, 0.8 + BEATS * PERIOD)),
    }


def _bench(pressure: Knots, voltage: Knots) -> Protocol:
    """Knots of pressure [mmHg] and voltage [kV] over the same span [s]; the voltage jumps where a time stands twice."""
    (at, kv), knots = np.array(voltage, float).T.round(6), np.array(pressure, float).T.round(6)
    time = np.sort(np.concatenate([np.setdiff1d(knots[0], at), at]))
    volts = 1e3 * np.interp(_apart(time), _apart(at), kv)
    return Protocol(time, {"pressure": MMHG * np.interp(time, *knots), "voltage": volts})


def _apart(time: np.ndarray) -> np.ndarray:
    """Times of which the first of two that are equal comes a little earlier."""
    return time - 1e-9 * np.append(np.diff(time) == 0, False)


def _pulsed(pulses: Sequence[tuple[float, float, float]], stop: float) -> Knots:
    """A voltage that is on from, until, at so many kV."""
    knots = [(0.0, 0.0)]
    for on, off, kv in pulses:
        knots += [(on, 0.0), (on, kv), (off, kv), (off, 0.0)]
    inside = [knot for knot in knots if knot[0] < stop - 1e-6]
    return [*inside, (stop, inside[-1][1])]


def _levels(levels: Sequence[float], hold: float) -> Knots:
    """Pressures held one after the other."""
    knots: list[tuple[float, float]] = [(0.0, 0.0), (0.3, levels[0])]
    for i, (low, high) in enumerate(pairwise(levels), start=1):
        knots += [(i * hold, low), (i * hold + 0.02, high)]
    return [*knots, (len(levels) * hold, levels[-1])]


def _beats() -> Knots:
    """A heart's pressure, smooth through the points of its beat."""
    from scipy.interpolate import PchipInterpolator  # half a second, for the atlas alone

    shares, heights = np.array([*BEAT, (1.0, BEAT[0][1])]).T
    fine = np.linspace(0, 1, 60, endpoint=False)
    wave = PchipInterpolator(shares, heights)(fine)
    beats = [(0.8 + PERIOD * (i + t), float(p)) for i in range(BEATS) for t, p in zip(fine, wave, strict=True)]
    return [(0.0, 0.0), (0.6, BEAT[0][1]), *beats, (0.8 + BEATS * PERIOD, BEAT[0][1])]


def feasible(largest: Mapping[str, float]) -> dict[str, Protocol]:
    """Protocols in words; `largest` holds the largest recorded input of each kind, with its polarity (SI)."""
    p, v = WITHIN * largest["pressure"], WITHIN * largest["voltage"]
    mmhg, kv = p / MMHG, v / 1e3
    sweep = f"a sweep of the pressure from 0.1 to 10 Hz between {0.4 * mmhg:.0f} and {mmhg:.0f} mmHg"
    return {
        f"voltage steps of 10 ms to 1 s up to {kv:.1f} kV at {0.6 * mmhg:.0f} mmHg": _pulses(0.6 * p, v),
        f"{sweep} without voltage": _sweep(p, 0.0),
        f"{sweep} at {0.6 * kv:.1f} kV": _sweep(p, 0.6 * v),
        f"slow pressure triangles of growing height up to {mmhg:.0f} mmHg without voltage": _triangles(p, 0.0),
        f"slow pressure triangles of growing height up to {mmhg:.0f} mmHg at {0.6 * kv:.1f} kV": _triangles(p, 0.6 * v),
        f"{kv:.1f} kV held for 15 s at {0.6 * mmhg:.0f} mmHg and then taken off for 10 s": _hold(0.6 * p, v),
        f"voltage triangles up to {kv:.1f} kV of 1 s and of 6 s at {0.6 * mmhg:.0f} mmHg": _voltage_triangles(
            0.6 * p, v
        ),
    }


def _pulses(pressure: float, voltage: float) -> Protocol:
    time, volts = [0.0, 2.0], [0.0, 0.0]
    for length in (0.01, 0.03, 0.1, 0.3, 1.0) * 3:
        start = time[-1]
        time += [start, start + length, start + length, start + 2 * length + 0.1]
        volts += [voltage, voltage, 0.0, 0.0]
    grid = np.array(time)
    return Protocol(grid, {"pressure": pressure * np.minimum(grid / 1.0, 1.0), "voltage": np.array(volts)})


def _sweep(pressure: float, voltage: float) -> Protocol:
    duration, lowest, span = 20.0, 0.1, np.log(100)  # s, Hz, log of the largest over the lowest
    time = np.arange(0, duration, 0.01)
    phase = 2 * np.pi * lowest * duration / span * (np.exp(span * time / duration) - 1)
    wave = pressure * np.minimum(time, 1.0) * (0.7 + 0.3 * np.sin(phase))
    return Protocol(time, {"pressure": wave, "voltage": np.full(time.size, voltage) * (time > 1.5)})


def _triangles(pressure: float, voltage: float) -> Protocol:
    time = np.arange(0, 27, 3.0)
    heights = pressure * np.array([0.0, 0.4, 0.05, 0.7, 0.05, 1.0, 0.05, 1.0, 0.3])
    return Protocol(time, {"pressure": heights, "voltage": np.full(time.size, voltage)})


def _hold(pressure: float, voltage: float) -> Protocol:
    time = np.array([0.0, 1.0, 2.0, 2.0, 17.0, 17.0, 27.0])
    return Protocol(
        time, {"pressure": pressure * np.minimum(time, 1.0), "voltage": voltage * np.array([0, 0, 0, 1.0, 1.0, 0, 0])}
    )


def _voltage_triangles(pressure: float, voltage: float) -> Protocol:
    time = np.array([0.0, 1.0, 2.0, 2.5, 3.0, 3.5, 4.0, 7.0, 10.0, 13.0, 16.0])
    return Protocol(
        time,
        {
            "pressure": pressure * np.minimum(time, 1.0),
            "voltage": voltage * np.array([0, 0, 0, 1.0, 0, 1.0, 0, 1.0, 0, 1.0, 0]),
        },
    )
