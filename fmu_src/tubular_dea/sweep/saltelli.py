"""Saltelli's design, from which Sobol indices are estimated; by SALib."""

from __future__ import annotations

import numpy as np

from ..extra import load


def problem(dimensions: int) -> dict[str, object]:
    """The unit cube, as SALib wants it described."""
    return {"num_vars": dimensions, "names": [f"x{i}" for i in range(dimensions)], "bounds": [[0.0, 1.0]] * dimensions}


def saltelli(dimensions: int, points: int, seed: int) -> np.ndarray:
    """The design in the unit cube, shape (points * (dimensions + 2), dimensions)."""
    sample = load("SALib.sample.sobol", "a design for Sobol indices", "sweep")
    drawn = sample.sample(problem(dimensions), points, calc_second_order=False, seed=seed)
    return np.asarray(drawn, float)
