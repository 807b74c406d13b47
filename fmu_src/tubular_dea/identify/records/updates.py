"""Readings that a logger repeats because the sensor behind it measures less often: a laser of 400 Hz read at 1 kHz.

A sensor in coarse steps repeats readings as well, at any length; one that is slow has a new reading every second or
third sample, and hardly ever sooner. Only the first of each is a reading: the others look like a delay.
"""

from __future__ import annotations

import numpy as np

# Set by measurement: of lasers of 400 and 500 Hz read at 1 kHz, 97 and 99 % of the readings last as long, and 0.2 % are
# shorter; of sensors in steps 10 to 60 %. Check: `pytest tests/test_recordings.py -k repeated_reading`
FEWEST_READINGS = 30  # [1] readings that tell how long one usually lasts
SOONER = 0.01  # [1] share of them that is shorter than the usual ones
AS_LONG = 0.9  # [1] share of them that lasts as long, or one sample longer, at least


def repeated_readings(values: np.ndarray) -> tuple[np.ndarray, int]:
    """Which samples (n,) repeat the reading before, and how many samples a reading lasts at least; none and 1 where the
    sensor is as fast as the logger."""
    there = np.flatnonzero(np.isfinite(values))
    again = np.zeros(values.size, dtype=bool)
    if there.size < FEWEST_READINGS:
        return again, 1
    new = np.concatenate([[True], np.diff(values[there]) != 0])
    lasts = np.diff(np.flatnonzero(new))
    if lasts.size < FEWEST_READINGS:
        return again, 1
    usual = int(np.quantile(lasts, SOONER, method="higher"))
    if usual < 2 or np.mean((lasts == usual) | (lasts == usual + 1)) < AS_LONG:
        return again, 1
    again[there[~new]] = True
    return again, usual
