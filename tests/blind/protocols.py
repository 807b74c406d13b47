"""What a laboratory does to its tube: experiments as pressure and voltage over time, standard ones and drawn ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator, PPoly

from blind.tubes import MMHG, Drive

KV = 1e3
Knots = list[tuple[float, float]]  # time [s], and mmHg or kV
BEAT = ((0.0, 75.0), (0.096, 100.8), (0.24, 118.0), (0.4, 101.6), (0.43, 104.3), (0.72, 87.2))  # share of a beat, mmHg


@dataclass(frozen=True)
class PlannedExperiment:
    """An experiment on the reference tube: pressure in mmHg, voltage in kV; `switched` voltage is held in between."""

    name: str
    stop: float
    pressure: Knots
    voltage: Knots = field(default_factory=lambda: [(0.0, 0.0)])
    switched: bool = True
    wave: bool = False  # pressure is a smooth curve through its points, and voltage is one from `curved` on
    curved: float = np.inf


@dataclass(frozen=True)
class Edge:
    """How the amplifier rises: over how long [s], and in what shape."""

    rise: float = 0.0
    shape: str = "linear"


def standard() -> list[PlannedExperiment]:
    """The eight experiments of the bench sets."""
    assists = [(round(0.766 + i / 1.2, 6), round(1.1 + i / 1.2, 6)) for i in range(12)]
    switching = [(1.2 + 2.4 * i, min(2.4 + 2.4 * i, 28.8), (3, 5, 4, 5.5)[i % 4]) for i in range(12)]
    return [
        PlannedExperiment(
            "ramp_4kV", 14, [(0, 0), (9, 85.5), (14, 95)], [(0, 0), (4, 0), (9.56, 4), (14, 4)], switched=False
        ),
        PlannedExperiment("step_4kV", 16, [(0, 0), (1, 95), (16, 95)], [(0, 0), (2, 4), (12, 0)]),
        PlannedExperiment("step_6kV", 16, [(0, 0), (1, 92), (16, 92)], [(0, 0), (2, 6), (12, 0)]),
        PlannedExperiment(
            "ramp_7kV", 13.2, [(0, 0), (9, 98.1), (13.2, 109)], [(0, 0), (4, 0), (9.56, 7), (13.2, 7)], switched=False
        ),
        PlannedExperiment("pressure_steps", 12.5, _levels([60, 90, 70, 110, 80], 2.5)),
        PlannedExperiment("pressure_triangles", 15, _triangles([60, 90, 120, 120, 90])),
        PlannedExperiment(
            "voltage_steps",
            28.8,
            [(0, 0), (0.5, 50), (9.6, 50), (10.1, 80), (19.2, 80), (19.7, 100), (28.8, 100)],
            [(0, 0)] + [at for on, off, kv in switching for at in ((on, kv), (off, 0))],
        ),
        PlannedExperiment(
            "heartbeat_5kV",
            10.8,
            _beats(np.full(12, 1 / 1.2), np.ones(12)),
            [(0, 0)] + [at for on, off in assists if off < 10.8 for at in ((on, 5), (off, 0))],
        ),
    ]


def _levels(levels: list[float], hold: float) -> Knots:
    knots: Knots = [(0, 0), (0.3, levels[0])]
    for i, (low, high) in enumerate(pairwise(levels), start=1):
        knots += [(i * hold, low), (i * hold + 0.02, high)]
    return [*knots, (len(levels) * hold, levels[-1])]


def _triangles(peaks: list[float]) -> Knots:
    return [(0, 0), *(at for i, peak in enumerate(peaks) for at in ((3 * i + 1.5, peak), (3 * i + 3, 5)))]


def _beats(periods: np.ndarray, heights: np.ndarray) -> Knots:
    starts = 0.8 + np.cumsum(periods) - periods[0]
    knots: Knots = [(0, 0), (0.6, 75)]
    for start, period, height in zip(starts, periods, heights, strict=True):
        knots += [(start + share * period, 75 + height * (p - 75)) for share, p in BEAT]
    return [*knots, (starts[-1] + periods[-1], 75.0)]


def drawn(kind: str, random: np.random.Generator, beats: int = 0) -> PlannedExperiment:
    """An experiment of a kind with numbers of its own; `beats` in a file where it is a heart's."""
    return DRAWN[kind](random, beats)


def _ramp(random: np.random.Generator, _: int) -> PlannedExperiment:
    kv, top, stop = random.uniform(3, 6.2), random.uniform(85, 98), random.uniform(11, 15)
    begin, end = random.uniform(3, 5), random.uniform(8, 10)
    return PlannedExperiment(
        f"ramp_{kv:.1f}kV",
        stop,
        [(0, 0), (0.65 * stop, 0.9 * top), (stop, top)],
        [(0, 0), (begin, 0), (end, kv), (stop, kv)],
        switched=False,
    )


def _step(random: np.random.Generator, _: int) -> PlannedExperiment:
    kv, top, on = random.uniform(3, 6), random.uniform(80, 95), random.uniform(1.5, 3)
    off = on + random.uniform(5, 10)
    stop = off + random.uniform(2, 4)
    return PlannedExperiment(f"step_{kv:.1f}kV", stop, [(0, 0), (1, top), (stop, top)], [(0, 0), (on, kv), (off, 0)])


def _pressure_steps(random: np.random.Generator, _: int) -> PlannedExperiment:
    levels = [float(p) for p in random.uniform(50, 112, random.integers(4, 8))]
    return PlannedExperiment(
        "pressure_steps",
        2.5 * len(levels),
        _levels(levels, 2.5),
        [(0, 0), (0.6, random.uniform(2, 3.5))] if random.random() < 0.4 else [(0, 0)],
    )


def _pressure_triangles(random: np.random.Generator, _: int) -> PlannedExperiment:
    peaks = [float(p) for p in random.uniform(60, 125, random.integers(3, 6))]
    return PlannedExperiment("pressure_triangles", 3.0 * len(peaks), _triangles(peaks))


def _voltage_steps(random: np.random.Generator, _: int) -> PlannedExperiment:
    times = 1.2 + np.cumsum(random.uniform(0.5, 2.0, random.integers(8, 20)))
    levels = (random.uniform(2.5, 5.5, times.size) * (np.arange(times.size) % 2 == 0)).tolist()  # off in between
    stop, low, high = float(times[-1] + 1), random.uniform(50, 70), random.uniform(75, 95)
    return PlannedExperiment(
        "voltage_steps",
        stop,
        [(0, 0), (0.5, low), (stop / 2, low), (stop / 2 + 0.5, high), (stop, high)],
        [(0, 0), *zip(times.tolist(), levels, strict=True)],
    )


def _heartbeat(random: np.random.Generator, beats: int) -> PlannedExperiment:
    rate = random.uniform(40, 180)  # 1/min
    count = beats or int(random.integers(8, 20))
    periods = 60 / rate * (1 + 0.03 * random.standard_normal(count))
    heights = random.uniform(0.6, 1.0) * (1 + 0.05 * random.standard_normal(count))
    starts = 0.8 + np.cumsum(periods) - periods[0]
    kv, lead, hold = random.uniform(4, 5.3), random.uniform(-0.05, 0.05), random.uniform(0.3, 0.45)
    assists = [
        at for s, t in zip(starts, periods, strict=True) for at in ((s + lead * t, kv), (s + (lead + hold) * t, 0.0))
    ]
    knots = _beats(periods, heights)
    return PlannedExperiment(f"heartbeat_{rate:.0f}", knots[-1][0], knots, [(0, 0), *assists], wave=True)


def _chirp_pressure(random: np.random.Generator, _: int) -> PlannedExperiment:
    stop, mean, swing = random.uniform(10, 18), random.uniform(65, 85), random.uniform(6, 15)
    kv = random.uniform(2, 4) if random.random() < 0.4 else 0.0
    return PlannedExperiment(
        "chirp_pressure",
        stop,
        [(0, 0), (1, mean), *_chirp(random, 1.2, stop, mean, swing)],
        [(0, 0), (0.5, kv)] if kv else [(0, 0)],
        wave=True,
    )


def _chirp_voltage(random: np.random.Generator, _: int) -> PlannedExperiment:
    stop, top, mean = random.uniform(10, 18), random.uniform(80, 92), random.uniform(2.5, 3.3)
    knots = [(0.0, 0.0), (1.5, 0.0), (2.0, mean), *_chirp(random, 2.2, stop, mean, random.uniform(1, 1.6))]
    return PlannedExperiment("chirp_voltage", stop, [(0, 0), (1, top), (stop, top)], knots, switched=False, curved=2.0)


def _chirp(random: np.random.Generator, start: float, stop: float, mean: float, swing: float) -> Knots:
    """A sine whose frequency rises in geometric steps; 24 points to the shortest period."""
    slow, fast = random.uniform(0.2, 0.5), random.uniform(4, 9)  # Hz
    t = np.arange(start, stop, 1 / (24 * fast))
    growth = np.log(fast / slow) / (stop - start)
    phase = 2 * np.pi * slow * np.expm1(growth * (t - start)) / growth
    return list(zip(t.tolist(), (mean + swing * np.sin(phase)).tolist(), strict=True))


def _hold(random: np.random.Generator, _: int) -> PlannedExperiment:
    stop, top, kv = random.uniform(20, 40), random.uniform(75, 95), random.choice([0.0, random.uniform(3, 5)])
    return PlannedExperiment(
        "hold", stop, [(0, 0), (1, top), (stop, top)], [(0, 0), (random.uniform(2, 4), kv)] if kv else [(0, 0)]
    )


DRAWN: dict[str, Callable[[np.random.Generator, int], PlannedExperiment]] = {
    "ramp": _ramp,
    "step": _step,
    "pressure_steps": _pressure_steps,
    "pressure_triangles": _pressure_triangles,
    "voltage_steps": _voltage_steps,
    "heartbeat": _heartbeat,
    "chirp_pressure": _chirp_pressure,
    "chirp_voltage": _chirp_voltage,
    "hold": _hold,
}


def loaded(plan: PlannedExperiment, level: float) -> PlannedExperiment:
    """The experiment begun at a share of its first pressure instead of at none."""
    first = next(p for _, p in plan.pressure if p > 0)
    pressure = [(t, max(p, level * first)) if t < 1.6 else (t, p) for t, p in plan.pressure]
    return replace(plan, pressure=pressure)


def chained(drives: list[Drive], starts: list[float]) -> Drive:
    """Drives one after the other at their start times [s]; in between the voltage is off and the pressure moves on."""
    pressures, voltages, hard = [], [], [np.array(starts)]
    for one, start in zip(drives, starts, strict=True):
        if pressures:
            end, begins = pressures[-1].x[-1], float(one.pressure(one.start))
            pressures.append(_straight(np.array([(end, float(pressures[-1](end))), (start, begins)])))
            voltages.append(PPoly(np.zeros((1, 1)), np.array([end, start])))
            hard.append(np.array([end]))
        pressures.append(_moved(one.pressure, start))
        voltages.append(_moved(one.voltage, start))
        hard.append(one.hard + start)
    return Drive(_joined(pressures), _joined(voltages), np.unique(np.concatenate(hard)))


def _moved(signal: PPoly, by: float) -> PPoly:
    return PPoly(signal.c, signal.x + by)


def _joined(parts: list[PPoly]) -> PPoly:
    """Pieces that follow one another, as cubics."""
    filled = [np.vstack([np.zeros((4 - part.c.shape[0], part.c.shape[1])), part.c]) for part in parts]
    return PPoly(np.hstack(filled), np.concatenate([parts[0].x, *(part.x[1:] for part in parts[1:])]))


def switching(plan: PlannedExperiment) -> np.ndarray:
    """The instants at which the voltage switches [s]."""
    return np.array([t for (_, before), (t, after) in pairwise(plan.voltage) if after != before])


def drive(
    plan: PlannedExperiment,
    edge: Edge,
    *,
    rounded: bool,
    grid: Callable[[float], float] = float,
    scales: tuple[float, float] = (1.0, 1.0),
    rest_before: float = 0.0,
) -> Drive:
    """The experiment as the tube meets it [Pa, V], `rest_before` [s] loaded as at its start.

    `rounded`: pressure without corners; `grid` moves switching to samples; `scales` fit another geometry's wall.
    """
    pressure, voltage = (np.array(k, float) for k in (plan.pressure, plan.voltage))
    pressure[:, 1] *= MMHG * scales[0]
    voltage[:, 1] *= KV * scales[1]
    if plan.switched:
        voltage[1:, 0] = [grid(t) for t in voltage[1:, 0]]
    if rest_before:
        early = [(-rest_before, 0.0), (2 - rest_before, pressure[0, 1])]
        pressure = np.vstack([early, pressure])
        voltage = np.vstack([[(-rest_before, 0.0), (4 - rest_before, voltage[0, 1])], voltage])
    pressure, voltage = _within(pressure, plan.stop), _within(voltage, plan.stop, held=plan.switched)
    if rounded or plan.wave:
        p, corners = PPoly(PchipInterpolator(*pressure.T).c, pressure[:, 0]), pressure[:0, 0]
    else:
        p, corners = _straight(pressure), pressure[:, 0]
    if plan.switched:
        v, edges = _switched(voltage, edge, plan.stop)
    else:
        curve = voltage[voltage[:, 0] >= plan.curved - 1e-9]
        line = voltage[: len(voltage) - max(len(curve) - 1, 0)]
        v, edges = _straight(line), line[:, 0]
        if len(curve):
            v = _joined([v, PPoly(CubicSpline(*curve.T).c, curve[:, 0])])
    return Drive(p, v, np.unique(np.concatenate([corners, edges])))


def _within(knots: np.ndarray, stop: float, held: bool = False) -> np.ndarray:
    """The knots up to `stop`, with one there."""
    inside = knots[knots[:, 0] < stop - 1e-9]
    last = inside[-1, 1] if held else np.interp(stop, *knots.T)
    return np.vstack([inside, (stop, last)])


def _straight(knots: np.ndarray) -> PPoly:
    t, y = knots.T
    zero = np.zeros(t.size - 1)
    return PPoly(np.array([zero, zero, np.diff(y) / np.diff(t), y[:-1]]), t)


def _switched(levels: np.ndarray, edge: Edge, stop: float) -> tuple[PPoly, np.ndarray]:
    """A voltage that goes from level to level in the amplifier's way, and where its pieces have ends."""
    starts, pieces, now = [levels[0, 0]], [[0.0, 0.0, 0.0, levels[0, 1]]], levels[0, 1]
    ends = [*levels[1:, 0].tolist(), stop]
    for (t, level), following in zip(levels[1:], ends[1:], strict=True):
        if level == now or t >= stop:
            continue
        span = min(edge.rise, 0.9 * (following - t))
        shape = _shape(edge.shape, span) if span > 0 else []
        starts += [t + s for s, _ in shape] + [t + span]
        pieces += [[now * (k == 3) + (level - now) * c for k, c in enumerate(cubic)] for _, cubic in shape]
        pieces.append([0.0, 0.0, 0.0, level])
        now = level
    return PPoly(np.array(pieces).T, np.array([*starts, stop])), np.array(starts)


def _shape(shape: str, span: float) -> list[tuple[float, list[float]]]:
    """From 0 to 1 within `span` [s], in cubic pieces: their starts, and coefficients in falling powers."""
    if shape == "linear":
        return [(0.0, [0.0, 0.0, 1 / span, 0.0])]
    if shape == "smooth":
        return [(0.0, [-2 / span**3, 3 / span**2, 0.0, 0.0])]
    t = span * np.array([0, 0.06, 0.13, 0.22, 0.34, 0.5, 0.7, 1])  # exponential
    curve = CubicSpline(t, (1 - np.exp(-5 * t / span)) / (1 - np.exp(-5)))
    return [(float(a), c.tolist()) for a, c in zip(t, curve.c.T, strict=False)]
