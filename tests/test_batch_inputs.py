"""What a batch is handed: what C could not use is refused by name, before anything is computed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tubular_dea.kernel.batch import Batch, BatchError, Breakpoints, Probe
from tubular_dea.model.dea import tubular_dea

ROWS = 3


def level(value: float, rows: int = 1) -> Breakpoints:
    return Breakpoints(np.zeros((rows, 1)), np.full((rows, 1), value))


REFUSED: dict[str, tuple[Callable[[Batch], object], str]] = {
    "name": (lambda b: b.trajectories(ROWS, {}, {"pressur": level(1e4)}, 1.0), "no input 'pressur'; did you mean"),
    "rows": (
        lambda b: b.trajectories(ROWS, {}, {"pressure": level(1e4, 2)}, 1.0),
        "pressure: time: expected the shape",
    ),
    "flat": (
        lambda b: b.trajectories(ROWS, {}, {"pressure": Breakpoints(np.zeros(1), np.zeros(1))}, 1.0),
        "pressure: time: expected the shape (1, n) or (3, n) but was given (1,)",
    ),
    "parameter": (lambda b: b.trajectories(ROWS, {"C_1": np.ones(2)}, {}, 1.0), "C_1: expected one number or 3"),
    "unknown": (lambda b: b.trajectories(ROWS, {"C_7": 1.0}, {}, 1.0), "no parameter 'C_7'"),
    "stop": (lambda b: b.trajectories(ROWS, {}, {}, np.ones(2)), "stop: expected one number or 3, one a row"),
    "tolerance": (lambda b: b.trajectories(ROWS, {}, {}, 1.0, tolerance=0.0), "tolerance: expected a positive number"),
}


@pytest.fixture(scope="module")
def batch() -> Batch:
    return Batch(tubular_dea(), [Probe("max", "lambda_2")])


@pytest.mark.parametrize("case", REFUSED)
def test_refused(batch: Batch, case: str) -> None:
    call, said = REFUSED[case]
    with pytest.raises(BatchError) as refusal:
        call(batch)
    assert said in str(refusal.value)
