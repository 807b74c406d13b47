"""Samples that stand out: a bit that flipped, a laser that lost its target. No plant moves there and back.

A sample is a spike if it is off the median of itself and the two on either side (Hampel, J. Am. Stat. Assoc. 69 (1974)
383) by far more than noise, and by far more than these four differ among each other: an edge makes them differ. One of
the four may be a spike itself; two side by side are spikes if they are off to either side.
Where an input was there and back just before, as rain may be for a day, it is the plant.

Several in a row are a lapse of the sensor if they are as far off what stands before and after them, come and go within
two samples, and no input moves abruptly meanwhile or shortly before: a pulse of an input would do the same. If they are
farther off than all others are apart, no input makes them, unless it moves at the very samples.
"""

from __future__ import annotations

from collections.abc import Iterable
from statistics import median

import numpy as np

from ..signals.monitors import changes_by_itself, noise_level, resolution

# Set by judgement: of a million samples of noise none is so far off. Check: `pytest tests/test_recordings.py -k spike`
OFF_NOISE = 12.0  # [standard deviations] of the noise by which a spike is off
FEWEST_SEEN = 12  # [samples] of a record from which on its noise can be told
OFF_STEPS = 4.0  # [1] times the resolution by which it is
OFF_OTHERS = 4.0  # [1] times what the samples beside it differ by
MEDIAN_OF = 5  # [samples] that each one is compared with: itself and two on either side,
EITHER_SIDE = [0, 1, 3, 4]  # [samples] which are those
ANSWER_LASTS = 3  # [samples] from which an input is there and back on, in which a plant answers that is there and back
SPIKY = 0.05  # [1] share of the samples: with more, a plant is sampled too slowly that moves there and back

# Set by judgement: of the sets of the bench and of five laboratories, the one with a lapse alone has one so.
# Check: `pytest tests/test_recordings.py -k lapse`
LONGEST = 64  # [samples] of a lapse, and before it, in which no input moves abruptly
BESIDE_LAPSE = 5  # [samples] on either side of a lapse that it is compared with
FEW_LAPSES = 5  # [1] lapses of a record: with more, it is the plant that moves so, by itself
RARELY = 0.01  # [1] share of a record's samples at either end of what it reads that are not counted
ABRUPT_PART = 0.01  # [1] share of its span by which the slope of an input changes at a sample, to be abrupt there


def spikes(values: np.ndarray, inputs: Iterable[np.ndarray] = ()) -> np.ndarray:
    """The places of single samples that stand out of a record (n,), which may have gaps, under inputs (n,) each."""
    there = np.flatnonzero(np.isfinite(values))
    if there.size < FEWEST_SEEN:
        return there[:0]
    middle = (np.arange(there.size) >= 2) & (np.arange(there.size) < there.size - 2)  # the others have one side only
    off, beside = _off_beside(values[there])
    out = middle & (np.abs(off) > _least(values[there]))
    found = out & (np.abs(off) > OFF_OTHERS * np.ptp(beside, axis=1))
    found |= _in_pairs(out, off, beside)
    if found.any():
        found &= ~_pulsed(inputs, values.size)[there]
    return there[found] if np.count_nonzero(found) <= SPIKY * there.size else there[:0]


def _off_beside(read: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far samples (n,) are off the median of themselves and the two on either side, and these four (n, 4) too."""
    near = np.lib.stride_tricks.sliding_window_view(np.pad(read, 2, mode="reflect"), MEDIAN_OF)
    off = near - np.median(near, axis=1)[:, None]
    return off[:, 2], off[:, EITHER_SIDE]


def _in_pairs(out: np.ndarray, off: np.ndarray, beside: np.ndarray) -> np.ndarray:
    """Which of the samples that are `out` (n,) stand out but for one beside them that does so as well; (n,) of bool."""
    worst = np.argmax(np.abs(beside), axis=1)
    rest = np.ptp(np.take_along_axis(beside, np.argsort(np.abs(beside), axis=1)[:, :-1], axis=1), axis=1)
    other = np.arange(off.size) + np.array(EITHER_SIDE)[worst] - 2
    likely = out & (np.abs(off) > OFF_OTHERS * rest)
    next_to_it = np.abs(other - np.arange(off.size)) == 1
    turned = off * np.take_along_axis(beside, worst[:, None], axis=1)[:, 0] < 0
    return likely & likely[np.clip(other, 0, off.size - 1)] & (turned | ~next_to_it)


def _pulsed(inputs: Iterable[np.ndarray], size: int) -> np.ndarray:
    """At which samples, and at the few after them, an input is there and back by a share of its span; (n,) of bool."""
    found = np.zeros(size, dtype=bool)
    for values in inputs:
        noise = 0.0 if changes_by_itself(values) else noise_level(values)
        found |= np.abs(_off_beside(values)[0]) > max(OFF_NOISE * noise, ABRUPT_PART * float(np.ptp(values)))
    return np.convolve(found, np.ones(ANSWER_LASTS), mode="full")[:size] > 0


def lapses(values: np.ndarray, inputs: Iterable[np.ndarray]) -> list[np.ndarray]:
    """The places of the samples of each lapse in a record (n,), which may have gaps, under inputs (n,) each."""
    there = np.flatnonzero(np.isfinite(values))
    read = values[there]
    if there.size < FEWEST_SEEN:
        return []
    least, found, after = _least(read), [], 0
    jumps = np.flatnonzero(np.abs(read[2:] - read[:-2]) > least)  # from a sample to the second one after it
    if not 0 < jumps.size <= SPIKY * there.size:
        return []
    abrupt, span = _abrupt(inputs, values.size), float(np.ptp(np.quantile(read, [RARELY, 1 - RARELY])))
    for first in jumps:
        if first < max(after, BESIDE_LAPSE - 1):
            continue
        for last in jumps[(jumps >= first + 2) & (jumps <= first + LONGEST)]:
            lapse = _between(read, int(first), int(last) + 2, least)
            if lapse is None:
                continue
            beyond = np.abs(read[lapse] - read[first]).min() > span
            since = there[first] - (ANSWER_LASTS if beyond else LONGEST)
            if not abrupt[max(since, 0) : there[last] + 3].any():
                found.append(there[lapse])
                after = int(last) + 2
                break
    return found if len(found) <= FEW_LAPSES else []


def _least(read: np.ndarray) -> float:
    """How far off a sample is that stands out of a record without gaps; at its limits a sensor shows no noise."""
    free = read[(read > read.min()) & (read < read.max())]
    noise = noise_level(free if free.size >= FEWEST_SEEN else read)
    return max(OFF_NOISE * noise, OFF_STEPS * resolution(read))


def _between(read: np.ndarray, first: int, last: int, least: float) -> np.ndarray | None:
    """The places after `first` and before `last` if what is read there is off what is read up to and from these on."""
    beside = np.concatenate([read[first - BESIDE_LAPSE + 1 : first + 1], read[last : last + BESIDE_LAPSE]])
    off, spread = np.abs(read[first + 1 : last] - median(beside.tolist())), float(np.ptp(beside))
    inside = off[1:-1]  # the ends may be on the way
    if beside.size < 2 * BESIDE_LAPSE or inside.min() <= max(least, OFF_OTHERS * spread):
        return None
    return first + 1 + np.flatnonzero(off > spread)


def _abrupt(inputs: Iterable[np.ndarray], size: int) -> np.ndarray:
    """At which samples an input jumps or turns by more than its noise and a share of its span; (n,) of bool."""
    found = np.zeros(size, dtype=bool)
    for values in inputs:
        turn = np.abs(np.diff(values, 2, prepend=values[:1], append=values[-1:]))
        found |= turn > max(OFF_NOISE * noise_level(values), ABRUPT_PART * float(np.ptp(values)))
    return found
