"""Numbers that stand for a sample that was lost: -9999, 99999 or 1e30, as loggers write where a sensor gave no value.

Such a number is exactly the same each time, and a signal jumps there and back by more than it moves anywhere else. A
number that is no usual mark of this has to be more than the signal can be, or has to stand there several times, far
beyond all that a sensor read. What is no number at all is told in `recordings.cells`.
"""

from __future__ import annotations

import re

import numpy as np

# Set by convention: nines, as many and as often tenfold as somebody liked (-999, 99999, -99990, -999.25 of well logs),
# powers of ten that no sensor reads, the fill value of netCDF, and the ends of a computer's numbers.
# Check: `pytest tests/test_recordings.py -k lost`
NINES = re.compile(r"-?(9{4,}0*(\.9+)?|999\.9+|999\.25)|-999")  # [1] as they are written
FULL = (1e20, *(10.0**power for power in range(30, 38)), 9.969209968386869e36)  # [1] what is not written with nines
LARGEST_NUMBERS = (2.0**31, 2.0**31 - 1, 3.4028234663852886e38, 1.7976931348623157e308)  # [1] of computers

# Set by judgement. Check: `pytest tests/test_recordings.py -k lost`
MOST = 0.5  # [1] share of the samples above which a number is a level, and no mark of what was lost
FEW = 0.02  # [1] the same of a signal that rests otherwise, which may be switched to 9999
REPEATED = 3  # [samples] that read the same, as a sensor's extreme never does
FAR_OFF = 100.0  # [1] times what all others span, by which such a number is off them


def lost_samples(written: np.ndarray, impossible: np.ndarray, sensed: bool) -> dict[float, np.ndarray]:
    """The places of samples that were lost, by the number `written` there; (n,), in the file's unit, may have gaps.

    `impossible` (n,) says which are more than the signal can be, `sensed` whether a sensor's noise is on all of them.
    """
    known, counts = np.unique(written[np.isfinite(written)], return_counts=True)
    marks = np.array([is_mark(v) for v in known.tolist()], dtype=bool)
    found = [float(v) for v in known[marks] if _jumps(written, known[marks], v)]
    usual, times = known[~marks], counts[~marks]
    for end in (0, -1) if usual.size > REPEATED else ():
        others = np.delete(usual, end)
        far = sensed and times[end] >= REPEATED and np.abs(others - usual[end]).min() > FAR_OFF * np.ptp(others)
        beyond = impossible[written == usual[end]].all() and np.count_nonzero(impossible) < MOST * written.size
        if (far or beyond) and _jumps(written, np.append(known[marks], usual[end]), usual[end]):
            found.append(float(usual[end]))
    return {value: np.flatnonzero(written == value) for value in sorted(found)}


def is_mark(value: float) -> bool:
    """Whether a number is one that is usual for a sample that was lost."""
    return abs(value) in FULL or abs(value) in LARGEST_NUMBERS or NINES.fullmatch(f"{value:.10g}") is not None


def _jumps(written: np.ndarray, marks: np.ndarray, value: float) -> bool:
    """Whether a number is farther from all samples than any of these is from the next one, and no level itself."""
    rest = written[np.isfinite(written) & ~np.isin(written, marks)]
    moves = float(np.abs(np.diff(rest)).max(initial=0.0))
    share = np.count_nonzero(written == value) / written.size
    return bool(rest.size and np.abs(rest - value).min() > moves and share < (MOST if moves > 0 else FEW))
