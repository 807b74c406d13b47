"""Single samples that stand out: a bit that flipped, a laser that lost its target. No plant moves there and back.

A sample is a spike if it is off the median of itself and the two on either side (Hampel, J. Am. Stat. Assoc. 69 (1974)
383) by far more than noise, and by far more than these four differ among each other: an edge makes them differ.
"""

from __future__ import annotations

import numpy as np

from ..signals.monitors import noise_level, resolution

# Set by judgement: of a million samples of noise none is so far off. Check: `pytest tests/test_recordings.py -k spike`
OFF_NOISE = 12.0  # [standard deviations] of the noise by which a spike is off
FEWEST_SEEN = 12  # [samples] of a record from which on its noise can be told
OFF_STEPS = 4.0  # [1] times the resolution by which it is
OFF_OTHERS = 4.0  # [1] times what the samples beside it differ by
SPIKY = 0.05  # [1] share of the samples: with more, a plant is sampled too slowly that moves there and back


def spikes(values: np.ndarray) -> np.ndarray:
    """The places of single samples that stand out of a record (n,), which may have gaps."""
    there = np.flatnonzero(np.isfinite(values))
    if there.size < FEWEST_SEEN:
        return there[:0]
    middle = (np.arange(there.size) >= 2) & (np.arange(there.size) < there.size - 2)  # the others have one side only
    near = np.lib.stride_tricks.sliding_window_view(np.pad(values[there], 2, mode="reflect"), 5)
    beside = near[:, [0, 1, 3, 4]]
    off = np.abs(near[:, 2] - np.median(near, axis=1))
    least = max(OFF_NOISE * noise_level(values[there]), OFF_STEPS * resolution(values[there]))
    found = middle & (off > least) & (off > OFF_OTHERS * np.ptp(beside, axis=1))
    return there[found] if np.count_nonzero(found) <= SPIKY * there.size else there[:0]
