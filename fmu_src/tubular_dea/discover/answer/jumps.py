"""Where what the model leaves jumps though nothing drives it: a clamp slips, a part lets go, a sensor is touched."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...identify.signals.monitors import GAUSSIAN_MAD
from ...protocol import Protocol
from ...stretches import true_stretches
from .left_over import Left

# Set by judgement. Check: `pytest tests/test_jumps.py`
JUMP_WITHIN = 3  # [samples] in which a jump happens,
JUMP_BESIDE = 10  # [samples] on either side whose means are apart by
JUMP_STAYS = 0.5  # [1] share of it at least: what comes back is a spike, or noise
JUMP_BEYOND = 8.0  # [standard deviations] of how much the rest usually changes meanwhile, that a jump is at least
HELD_STILL = 0.3  # [1] share of a jump that the model's answer moves at most: else it is how that follows an input
DRIVEN = 0.1  # [1] share of its span by which an input that moves meanwhile drives what jumps
MOST_JUMPS = 20  # [1] in a file, with more of which it is how a record looks


@dataclass(frozen=True)
class Jumps:
    """When what is left of the file `name` jumps [s], and the largest such jump of the output `of` (SI)."""

    name: str
    of: str
    times: tuple[float, ...]
    largest: float


def jumps(rest: Sequence[Left]) -> list[Jumps]:
    """The files in which the `rest` that the named model leaves jumps while its answer and all inputs stand still."""
    found = []
    for piece, answer, left in rest:
        for reading, part in zip(piece.case.readings, piece.case.parts, strict=True):
            places, by = jumped(answer[part], left[part])
            still = ~driven(piece.driven.protocol, reading.times)[places]
            places, by = places[still], by[still]
            if 0 < places.size <= MOST_JUMPS:
                at = tuple(np.take(reading.times, places).tolist())
                found.append(Jumps(piece.name, reading.output, at, float(np.abs(by).max())))
    return found


def driven(protocol: Protocol, times: np.ndarray) -> np.ndarray:
    """Whether an input moves by much about each of some ascending `times` (n,) [s]."""
    moving = np.zeros(times.size, dtype=bool)
    for values in protocol.at(times).values():
        far = np.abs(values[JUMP_WITHIN:] - values[:-JUMP_WITHIN]) > DRIVEN * np.ptp(values)
        for later in range(JUMP_WITHIN + 1):
            moving[later : later + far.size] |= far
    return moving


def jumped(answer: np.ndarray, left: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The samples about which a rest (n,) jumps for good while the model's `answer` (n,) hardly moves, and by how
    much."""
    if left.size < 2 * JUMP_BESIDE + JUMP_WITHIN:
        return np.empty(0, dtype=int), np.empty(0)
    change, moved = (values[JUMP_WITHIN:] - values[:-JUMP_WITHIN] for values in (left, answer))
    usual = GAUSSIAN_MAD * float(np.median(np.abs(change)))
    large = (np.abs(change) > JUMP_BEYOND * usual) & (np.abs(moved) < HELD_STILL * np.abs(change))
    places, by = [], []
    for a, b in true_stretches(large):
        k = a + int(np.argmax(np.abs(change[a:b])))
        before, after = left[max(k + 1 - JUMP_BESIDE, 0) : k + 1], left[k + JUMP_WITHIN : k + JUMP_WITHIN + JUMP_BESIDE]
        stays = float(after.mean() - before.mean()) if after.size else 0.0
        if stays * change[k] > JUMP_STAYS * change[k] ** 2:
            places.append(k + JUMP_WITHIN // 2 + 1)
            by.append(float(change[k]))
    return np.array(places, dtype=int), np.array(by)
