"""Where a plant rings freely, less than its sensors could show.

A tube without load is undamped. After a release it rings by some um for as long as the record lasts, below the noise of
any laser, and at a phase that a fit could tell to 1e-5 of a stiffness: the cost is so rough then that a search stays
where it began, with standard errors of 0.02 % (rings of 3 um below 20 um of noise; C_1 was 1.4 % off). No plant is
undamped, and where the inputs' lines have their corners is chance. So of the model's readings in such stretches only
what is slow counts: smooth curves (`quiet.basis`) keep set and creep, and no ringing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..signals.noise import Noise
from ..signals.quiet import LEAST_STRETCH, basis, steady
from .study import Piece, Study

# Set by judgement. Check: `pytest tests/test_free_rings.py`
BELOW = 0.5  # [1] of a sensor's noise (rms) that a ringing is at most: a record would show more
FAINT = 1e-3  # [1] of it that it is at least, to matter
OSCILLATES = 4.0  # [1] times as often as a smooth curve may leave it that a ringing changes its sign, at least
LASTING = 0.7  # [1] of it in the first half of a stretch that is left in the second, of one that is not damped
OFF_A_CORNER = 4  # [samples] beside a corner of an input, which may move by a few
SET_OFF = (0.0, 0.125, 0.25, 0.5)  # [1] parts of a stretch after which what its begin has set off may be over


def with_slow_rings(work: Study) -> Study:
    """The study whose model is read without what it rings freely at the declared values."""
    answers = work.response((), work.pieces).possible(work.shared(work.plant.model.parameter_values()))
    pieces = [
        p if answer is None or not (rings := _rings(work, p, answer)) else replace(p, case=replace(p.case, rings=rings))
        for p, answer in zip(work.pieces, answers, strict=True)
    ]
    return replace(work, pieces=pieces)


def _rings(work: Study, piece: Piece, answer: np.ndarray) -> tuple[tuple[float, float], ...]:
    """The stretches (begin, end) [s] between corners of the inputs in which every output that is read rings freely, or
    does not move."""
    corners = np.unique(piece.case.protocol.time)
    outputs = [
        (r.times, answer[rows], work.noise[r.output])
        for r, rows in zip(piece.case.readings, piece.case.parts, strict=True)
    ]
    found = []
    for begin, end in zip(corners[:-1], corners[1:], strict=True):
        tried = (_ringing_from(begin + part * (end - begin), end, outputs) for part in SET_OFF)
        since = next((b for b in tried if b is not None), None)
        if since is not None:
            found.append((since, float(end)))
    return tuple(found)


def _ringing_from(begin: float, end: float, outputs: list[tuple[np.ndarray, np.ndarray, Noise]]) -> float | None:
    """From when on before `end` outputs (times, answer, noise) ring freely, if they do from `begin` [s] on."""
    told = False
    for times, answer, noise in outputs:
        first, last = int(np.searchsorted(times, begin)) + OFF_A_CORNER, int(np.searchsorted(times, end)) - OFF_A_CORNER
        if last - first < LEAST_STRETCH or not steady(times[first:last]).all():
            return None
        slow = basis(last - first, float(times[first + 1] - times[first]))
        left = answer[first:last] - slow @ (slow.T @ answer[first:last])
        sooner, later = (float(np.sqrt(np.mean(half**2))) for half in np.array_split(left, 2))
        if max(sooner, later) > BELOW * noise.rms:
            return None
        turns = np.count_nonzero(left[1:] * left[:-1] < 0)
        if later > FAINT * noise.rms:
            if later < LASTING * sooner or turns < OSCILLATES * slow.shape[1]:
                return None
            told, begin = True, float(times[first])
    return begin if told else None
