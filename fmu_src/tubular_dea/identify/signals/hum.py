"""Lines in noise: hum of the mains with its harmonics, aliased too, and other oscillations that last.

What is left of quiet stretches is cut into blocks; their periodograms are added up at common frequencies. A line stands
out of its neighbourhood there by more than chance allows anywhere. Lines at mains frequencies are hum. Others are
reported too: nothing random has them, so they are no noise either (a pump's ripple, a fan, an effect).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import median_filter
from scipy.special import gammainccinv, gammaincinv

from .sampling import usual_step

# Set by convention: mains are 50 or 60 Hz. Check: `pytest tests/test_noise.py::test_hum_is_told_apart`
MAINS = (50.0, 60.0)  # [Hz] at which hum is looked for
SLOWLY_SAMPLED = 1.01 * 0.5 / min(MAINS)  # [s] between samples up to which it lies where little else does
HARMONICS = 10  # [1] multiples of these that are
ALIASED_HARMONICS = 4  # [1] the same beyond half the sampling rate: of ten, one comes to lie near anything
HEARTS = 5.0  # [Hz] up to which an alias of the mains is not told from beats and what they drive

# Set by judgement. Check: `pytest tests/test_noise.py tests/test_monitors.py`,
# `python -m blind.score --nulls 12 --conventions hum --seed 1000`
LINE_BLOCK = 16.0  # [s] over which a line keeps its phase; longer where a plant goes slower than usual
FINER_GRID = 4  # [1] points in frequency for each that a block resolves
LINE_BESIDE = 65  # [1] of these points, whose median is the level of noise around a line

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions hum --seed 1000`
FALSE = 1e-4  # [1] chance of a line in a record that has none
OFF = 0.15  # [Hz] by which mains is off, at most, and as many times more at its harmonics
KEEPS = 4.0  # [s] over which the mains keeps its phase well enough
KNOTS = 24  # [1] knots of a record at most between which it may change
MOST_HUM = 4  # [1] lines that are looked for in a monitor
SLOWEST_TURN = 0.05  # [1/sample] below which everything is, in records sampled slowly
ONE_PHASE = 0.5  # [1] of its power, of a line at half the sampling rate: chance makes twice as much in one phase alone
MOSTLY_EMPTY = 4  # [1] times as long as the longest record a block is at most: the rest of it is empty
SLOWEST_LINE = 1.0  # [Hz] below which everything is creep or drift


def strongest(blocks: Sequence[tuple[np.ndarray, np.ndarray]], step: float, pace: float = 1.0) -> float | None:
    """The line [Hz] that stands out most in records of (time, whitened rest) sampled every `step` [s], if any does. The
    plant takes `pace` times as long as usual."""
    longest = max((float(np.ptp(time)) for time, _ in blocks if time.size), default=0.0)
    lasts = LINE_BLOCK * max(pace, 1.0)
    size = int(min(lasts, MOSTLY_EMPTY * (longest + step)) / step)
    if size <= 2:  # a block resolves no frequency that is sampled
        return None
    points = 2 ** int(np.ceil(np.log2(FINER_GRID * size)))
    power, count = np.zeros(points // 2 + 1), 0
    for values in _cut(blocks, step, size):
        samples = np.count_nonzero(values)
        if samples:
            power += np.abs(np.fft.rfft(values, points)) ** 2 / samples
            count += 1
    if not count:
        return None
    level = median_filter(power, size=LINE_BESIDE, mode="reflect") / gammaincinv(count, 0.5)
    ratio = power / np.maximum(level, 1e-300)
    limit = float(gammainccinv(count, FALSE / points * FINER_GRID))
    frequencies = np.arange(power.size) / points / step
    ratio[frequencies < min(SLOWEST_LINE, SLOWEST_TURN / step)] = 0.0
    ratio[frequencies > 0.5 / step - 1 / lasts] *= ONE_PHASE  # mains at half the sampling rate: 50 Hz at 100 Hz
    best = int(np.argmax(ratio))
    return float(frequencies[best]) if ratio[best] > limit else None


def _cut(blocks: Sequence[tuple[np.ndarray, np.ndarray]], step: float, size: int) -> list[np.ndarray]:
    """All values on grids of `size` samples, 0 where there is none."""
    grids: dict[tuple[int, int], np.ndarray] = {}
    for record, (time, values) in enumerate(blocks):
        place = np.round((time - time[0]) / step).astype(int)
        for number in np.unique(place // size):
            mine = place // size == number
            grid = grids.setdefault((record, int(number)), np.zeros(size))
            grid[place[mine] % size] = values[mine]
    return list(grids.values())


def is_hum(line: float, step: float) -> bool:
    """Whether a line is where the mains or one of its harmonics comes to lie when sampled every `step` [s].

    Harmonics beyond half the sampling rate are looked for up to ALIASED_HARMONICS, and none where hearts beat.
    """
    return line > HEARTS and any(
        abs(line - _aliased(multiple * mains, 1 / step)) < multiple * OFF + 1.0 / LINE_BLOCK
        for mains in MAINS
        for multiple in range(1, HARMONICS + 1)
        if multiple <= ALIASED_HARMONICS or multiple * mains < 0.5 / step
    )


def _aliased(frequency: float, rate: float) -> float:
    """Where a frequency comes to lie below half the sampling rate."""
    above = frequency % rate
    return min(above, rate - above)


def waves(lines: Sequence[float], time: np.ndarray) -> np.ndarray:
    """Waves (n, k) of lines in two phases, with heights that change from knot to knot: no mains keeps its pitch."""
    span = float(time[-1] - time[0])
    knots = np.linspace(time[0], time[-1], 1 + int(np.clip(np.ceil(span / KEEPS), 1, KNOTS)))
    hats = [np.interp(time, knots, np.eye(knots.size)[k]) for k in range(knots.size)]
    both = [wave(2 * np.pi * line * time) for line in lines for wave in (np.sin, np.cos)]
    return np.column_stack([hat * wave for wave in both for hat in hats]) if both else np.empty((time.size, 0))


def within(time: np.ndarray, left: np.ndarray) -> np.ndarray:
    """The hum (n,) in what is `left` (n,) of a record without its signal; 0 where none stands out."""
    return at(lines_of(time, left), time, left)


def lines_of(time: np.ndarray, left: np.ndarray) -> list[float]:
    """The lines [Hz] of hum that stand out of what is `left` (n,) of a record.

    Sampled more slowly than SLOWLY_SAMPLED, everything may be hum that comes to lie there, and nothing is said to be.
    """
    step = usual_step(time)
    lines: list[float] = []
    while step <= SLOWLY_SAMPLED and len(lines) < MOST_HUM:
        line = strongest([(time, left - at(lines, time, left))], step)
        if line is None or not is_hum(line, step):
            break
        lines.append(line)
    return lines


def at(lines: Sequence[float], time: np.ndarray, left: np.ndarray) -> np.ndarray:
    """The part (n,) at some `lines` [Hz] of what is `left` (n,) of a record."""
    if not lines:
        return np.zeros(left.size)
    shapes = waves(lines, time)
    return np.asarray(shapes @ np.linalg.lstsq(shapes, left, rcond=None)[0])


def columns(lines: Sequence[float], time: np.ndarray) -> np.ndarray:
    """Sine and cosine of every line at `time` (n,), shape (n, 2 k)."""
    turns = 2 * np.pi * np.outer(time, np.asarray(lines, dtype=float))
    return np.concatenate([np.sin(turns), np.cos(turns)], axis=1)
