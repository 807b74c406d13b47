"""A command that a computer sends on a clock of its own: when it was sent, from where its steps stand in the file.

::

    sent      |      |      |      |      |        every 7.1 ms
    sampled  |  |  |  |  |  |  |  |  |  |  |  |    every 2 ms: a step stands at the first sample after it

Each step was sent within the sampling interval before the sample at which it stands. Where all steps lie on one clock,
whose period is no whole number of samples, all these intervals together leave the period and the first instant little
room: of what they leave, the middle is taken. Where period and sampling are multiples of one time (10 and 4 ms), that
room is as long.
"""

from __future__ import annotations

import numpy as np

from ...stretches import true_stretches
from ..signals.quiet import steady
from ..signals.sampling import usual_step

# Set by judgement: by chance, twenty steps on whole samples do not lie on such a clock.
# Check: `pytest tests/test_edges.py -k clock_of_its_own`
ENOUGH_STEPS = 20  # [1] steps of the command
EACH_KIND = 5  # [1] times that the shorter and the longer of their intervals have to occur: by chance they are not even
OFF_CLOCK = 1.5  # [samples] from the straight line through all steps: on a clock they are within one
UNSURE = 0.25  # [periods] by which the number of periods in a pause may be uncertain


def sent_at(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, float] | None:
    """When each step of `values` (n,) at `time` (n,) [s] was sent (k,) [s], and how much earlier or later all of them
    may have been [s]; None where they are on no clock that is told from the sampling."""
    first = np.flatnonzero(np.diff(values)) + 1
    if first.size < ENOUGH_STEPS or not steady(time).all():
        return None
    numbers = _numbers(first)
    found = None if numbers is None else _clock(first, numbers)
    if found is None or numbers is None:
        return None
    begin, period, room = usual_step(time) * found
    return time[0] + begin + period * numbers, float(room)


def _numbers(first: np.ndarray) -> np.ndarray | None:
    """How many periods (k,) after another one each step was sent, at samples `first` (k,); not all periods have one.

    The longest row of steps that follow each other tells the period to one sample in its length, and how many periods
    the pauses beside it last; with them it is known better, and so on.
    """
    gaps = np.diff(first)
    begin, end = max(true_stretches(gaps <= gaps.min() + 1), key=lambda row: row[1] - row[0])
    shorter = int(np.count_nonzero(gaps[begin:end] == gaps.min()))
    if min(shorter, end - begin - shorter) < EACH_KIND:
        return None
    later = _counted(gaps[begin:], end - begin)
    earlier = None if later is None else _counted(gaps[end - 1 :: -1], end - begin)
    if later is None or earlier is None:
        return None
    return np.concatenate([(end - begin) - earlier[: end - begin : -1], later])


def _counted(gaps: np.ndarray, row: int) -> np.ndarray | None:
    """The number of periods from the first step to each (k + 1,), `gaps` (k,) samples apart, the first `row` of them
    one period each; None where a pause is too long to count them."""
    numbers, passed = np.arange(row + 1.0), int(gaps[:row].sum())
    counted = [*numbers]
    for gap in gaps[row:].tolist():
        period = passed / counted[-1]
        if gap > UNSURE * period**2 * counted[-1]:
            return None
        counted.append(counted[-1] + round(gap / period))
        passed += gap
    return np.array(counted)


def _clock(first: np.ndarray, numbers: np.ndarray) -> np.ndarray | None:
    """The instant from which periods count and the period, in the middle of what the steps leave to them, and the room
    to both sides (3,) [samples]; None if they leave nothing."""
    from scipy.optimize import linprog  # as in fit.py

    if np.ptp(first - np.polyval(np.polyfit(numbers, first, 1), numbers)) > OFF_CLOCK:
        return None  # thousands of steps of a noisy monitor need no linear program
    ones = np.ones(first.size)
    above = np.column_stack([ones, numbers, ones])  # instant, period, room to both sides
    below = np.column_stack([-ones, -numbers, ones])
    found = linprog(
        [0.0, 0.0, -1.0],
        A_ub=np.vstack([above, below]),
        b_ub=np.concatenate([first, 1.0 - first]),
        bounds=[(None, None), (0.0, None), (0.0, 0.5)],
    )
    return found.x if found.success else None
