"""Stretches of neighbours for which something is true."""

from __future__ import annotations

import numpy as np


def true_stretches(true: np.ndarray) -> list[tuple[int, int]]:
    """The first of every stretch of true values among (n,), and one behind its last."""
    ends = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(int)))
    return [(a, b) for a, b in ends.reshape(-1, 2).tolist()]
