"""Whether all records repeat one course at one operating point.

Then all repetitions, held-out ones too, contain the same information as one of them: no data are really unseen. If no
law leaves only noise, the law with the smallest misfit is barely better supported than one with a slightly larger one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...identify.study.study import Piece

# Set by judgement: beats of the mock loop at one level differ by 0.05, of a pig by 0.2, levels by 0.5 and more, and
# stretches of a random signal by 0.6. Check: `pytest tests/test_operating_point.py`
ALIKE = 0.25  # [standard deviations of a signal] rms difference up to which one stretch repeats another
IN_A_RECORD = 8  # [1] stretches of a record that are looked for in the first record
COMPARED = 2_000  # [1] points of the longest record that are compared


def repeats(pieces: Sequence[Piece]) -> bool:
    """Whether every stretch of all pieces, inputs and outputs, is found in the first half of the first piece."""
    longest = max(float(np.ptp(p.case.times)) for p in pieces)
    tables = [_table(p, longest / COMPARED) for p in pieces]
    scale = np.concatenate(tables).std(axis=0)
    moving = scale > 0
    tables = [t[:, moving] / scale[moving] for t in tables]
    first = tables[0][: len(tables[0]) // 2]
    return bool(moving.any()) and all(_found(rest, first) for rest in (tables[0][len(first) :], *tables[1:]))


def _table(piece: Piece, step: float) -> np.ndarray:
    """Inputs and readings of a piece (n, signals) at steps of one size."""
    times = piece.case.times
    grid = np.arange(times.min(), times.max(), step)
    columns = list(piece.case.protocol.at(grid).values())
    for reading, part in zip(piece.case.readings, piece.case.parts, strict=True):
        columns.append(np.interp(grid, reading.times, piece.record[part]))
    return np.column_stack(columns)


def _found(table: np.ndarray, among: np.ndarray) -> bool:
    """Whether all stretches of a table (n, signals) are somewhere in another."""
    size = max(2, min(len(among) // 2, 2 * len(among) // IN_A_RECORD))
    if min(len(table), len(among)) < size:
        return False
    windows = np.lib.stride_tricks.sliding_window_view(among, size, axis=0)  # (places, signals, size)
    begins = range(0, len(table) - size + 1, size)
    return all(_nearest(table[b : b + size].T, windows) <= ALIKE for b in begins)


def _nearest(stretch: np.ndarray, windows: np.ndarray) -> float:
    """The root mean square difference of a stretch (signals, size) to the nearest of the windows, worst signal."""
    squares = np.mean((windows - stretch) ** 2, axis=2)
    return float(np.sqrt(squares.max(axis=1).min()))
