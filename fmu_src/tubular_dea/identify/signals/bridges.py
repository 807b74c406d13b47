"""Single readings that a logger lost, where a record's noise is told: each repeats the reading nearest to it.

Lost at random, a few in a hundred leave no stretch long enough to tell noise from. As a repeated reading is one of the
sensor's, the noise keeps its size, and its correlation rises by the share that was lost; steps stay steps.
"""

from __future__ import annotations

import numpy as np

from .sampling import usual_step

# Set by judgement. Check: `pytest tests/test_noise.py -k lost`
MOST_IN_A_ROW = 3  # [samples] that are bridged at once: across more, a plant may have moved
MOST_BRIDGED = 0.1  # [1] share of the samples: with more, repeated readings would tell the noise
ON_THE_CLOCK = 0.1  # [1] of a step, by which a reading after a gap may be off the clock's own times


def bridged(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and values (n,) of a record, with single lost readings put back.

    A logger that samples more slowly for a while has lost none: the steps beside a gap are usual ones.
    """
    if time.size < 2:
        return time, values
    steps = np.diff(time) / usual_step(time)
    lost = np.rint(steps).astype(int) - 1
    usual = np.concatenate([[True], lost == 0, [True]])
    alone = (lost > 0) & (lost <= MOST_IN_A_ROW) & (np.abs(steps - lost - 1) < ON_THE_CLOCK) & usual[:-2] & usual[2:]
    lost = np.where(alone, lost, 0)
    if not 0 < lost.sum() <= MOST_BRIDGED * time.size:
        return time, values
    before = np.repeat(np.arange(time.size - 1), lost)
    part = (np.arange(before.size) - np.repeat(np.cumsum(lost) - lost, lost) + 1) / (lost[before] + 1)
    put = time[before] + part * (time[before + 1] - time[before])
    nearest = values[np.where(part <= 0.5, before, before + 1)]
    return np.insert(time, before + 1, put), np.insert(values, before + 1, nearest)
