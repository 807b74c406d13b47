"""The sampling times of a file: clocks rounded to the nearest millisecond, repeated times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...recordings import ReadError, Table
from ...recordings.table import some

# Set by judgement. Check: `pytest tests/test_reading.py::test_a_coarse_clock_was_even`,
# `pytest tests/test_reading.py::test_gaps_are_no_coarse_clock`
UNEVEN = 0.02  # [1] of the steps: with fewer that differ from the usual one, they are gaps and no rounding
WHOLE = 1e-3  # [1] from a whole number: what rounding errors leave
SAME_STEP = 9  # [decimals] of seconds to which steps of a clock are the same
ROUND_RATES = (1, 2, 3, 4, 5, 12)  # [digits] of the rates that are tried for an even clock, the roundest first
LINES_TOLD = 5  # [1] lines with repeated times that are named
ROUNDED = 1.01  # [1] of the clock's resolution, by which times that it rounds lie apart at most from an even one


@dataclass(frozen=True)
class Sampling:
    """`time` (n,) [s], ascending, of the rows `kept` (numbers of them), and remarks on what was made of the clock."""

    time: np.ndarray
    kept: np.ndarray
    remarks: tuple[str, ...] = ()


def sampling(table: Table, time: np.ndarray, values: np.ndarray) -> Sampling:
    """The times of a file's rows, of which `values` (k, n) are all that is used of them.

    Rows that stand there twice count once. A clock that is coarser than the sampling gives equal or uneven times: where
    an even sampling explains them to the clock's resolution, they are the even ones, and otherwise equal times are
    spread up to the next. Times that go back are refused.
    """
    missing = np.flatnonzero(~np.isfinite(time))
    if missing.size:
        raise _refusal(table, int(missing[0]), "expected a number but found none")
    kept, remarks = _without_doubles(time, values), []
    if kept.size < time.size:
        remarks.append(f"{time.size - kept.size} duplicate rows left out")
    there = time[kept]
    back = np.flatnonzero(np.diff(there) < 0)
    if back.size:
        i = int(back[0])
        repeated = any("headings repeated" in remark for remark in table.remarks)
        split = (
            "split the file where its headings are repeated" if repeated else "give each experiment a file of its own"
        )
        said = f"expected ascending times but {there[i + 1]:g} s follows {there[i]:g} s; sort the lines, or {split}"
        raise _refusal(table, int(kept[i + 1]), said)
    if there.size > 1 and there[0] == there[-1]:
        raise _refusal(
            table,
            int(kept[-1]),
            f"expected ascending times but every row is at {there[0]:g} s: write the column with more digits",
        )
    even, equal = _even(there), np.flatnonzero(np.diff(there) == 0)
    if even is not None:
        remarks.append(f"rounded times, replaced by even ones: {1 / (even[1] - even[0]):.6g} Hz")
        there = even
    elif equal.size and there[-1] > there[0]:
        lines = [f"{table.row} {n}" for n in table.lines[kept[equal + 1]]]
        remarks.append(f"repeated times, spread evenly up to the next: {some(lines, LINES_TOLD)}")
        there = _spread(there)
    return Sampling(there, kept, tuple(remarks))


def usual_step(time: np.ndarray) -> float:
    """The time [s] that usually lies between two samples."""
    return float(np.median(np.diff(time)))


def _without_doubles(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The rows that are not the same as the one before them, in the time and everything else.

    Where most rows of the same time differ, a clock is coarse, and rows with equal readings are samples like others.
    """
    rows = np.vstack([time, values])
    before, after = rows[:, :-1], rows[:, 1:]
    same = np.all((before == after) | (np.isnan(before) & np.isnan(after)), axis=0)
    if 2 * same.sum() < np.sum(time[:-1] == time[1:]):
        return np.arange(time.size)
    return np.flatnonzero(~np.append(False, same))


def _even(time: np.ndarray) -> np.ndarray | None:
    """The even times that a coarse clock has rounded to `time`; None where it is even as it is, or has gaps."""
    steps = np.round(np.diff(time), SAME_STEP)
    kinds, counts = np.unique(steps, return_counts=True)
    if kinds.size < 2 or 1 - counts.max() / steps.size < UNEVEN:
        return None
    tick, index = _resolution(time), np.arange(time.size)
    slope = float(np.polyfit(index, time - time[0], 1)[0])
    for digits in ROUND_RATES:  # the roundest rate that explains the times
        step = 1 / float(f"{1 / slope:.{digits}g}") if slope > 0 else 0.0
        if step > 0 and float(np.ptp(time - step * index)) <= ROUNDED * tick:
            return time[0] + step * index
    return None


def _resolution(time: np.ndarray) -> float:
    """The decimal that the later half of the times is written to [s]; 0 where they have more than nine."""
    late = time[time.size // 2 :]
    for digits in range(SAME_STEP + 1):
        scaled = late * 10.0**digits
        if float(np.max(np.abs(scaled - np.round(scaled)))) < WHOLE:
            return 10.0**-digits
    return 0.0


def _spread(time: np.ndarray) -> np.ndarray:
    """Equal times, spread evenly up to the next one; the last ones in steps of those before."""
    distinct, first, counts = np.unique(time, return_index=True, return_counts=True)
    gaps = np.diff(distinct)
    gaps = np.append(gaps, gaps[-1] / counts[-2] * counts[-1])
    turn = np.arange(time.size) - np.repeat(first, counts)
    return time + np.repeat(gaps / counts, counts) * turn


def _refusal(table: Table, row: int, said: str) -> ReadError:
    return ReadError(f"{table.path}, {table.row} {table.lines[row]}, column 'time': {said}")
