"""What a batch is handed: what C could not use is refused by name, before anything is computed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tubular_dea.kernel import KernelError
from tubular_dea.kernel.batch import Batch, Breakpoints, Probe
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
    "negative": (
        lambda b: b.trajectories(1, {"C_1": -340e3}, {}, 1.0),
        "C_1: expected at least 1 Pa but was given -340000",
    ),
    "negative row": (
        lambda b: b.parameters(ROWS, {"C_1": np.array([3e5, 3e5, -340e3])}),
        "C_1: expected at least 1 Pa but was given -340000 in row 2",
    ),
    "large row": (
        lambda b: b.rest(ROWS, {"phi": np.array([0.5, 1.5, 2.0])}, {}),
        "phi: expected at most 1 but was given 1.5 in row 1",
    ),
    "half": (
        lambda b: b.parameters(ROWS, {"n_layers": [7, 7.5, 8]}),
        "n_layers: expected an integer but was given 7.5 in row 1",
    ),
    "maybe": (lambda b: b.parameters(1, {"start_at_equilibrium": 0.5}), "start_at_equilibrium: expected true or false"),
    "nan": (lambda b: b.parameters(1, {"k_1": np.nan}), "k_1: expected a finite number in Pa but was given nan"),
    "word": (lambda b: b.parameters(1, {"C_1": "x"}), "C_1: expected numbers but was given 'x'"),
    "no names": (lambda b: b.parameters(1, [3e5]), "parameters: expected values by name, as in a dict"),
    "no inputs": (lambda b: b.trajectories(1, {}, [1], 1.0), "inputs: expected values by name, as in a dict"),
    "no course": (lambda b: b.trajectories(1, {}, {"pressure": 1e4}, 1.0), "pressure: expected Breakpoints but was"),
    "no breakpoint": (
        lambda b: b.trajectories(1, {}, {"pressure": Breakpoints(np.zeros((1, 0)), np.zeros((1, 0)))}, 1.0),
        "pressure: time: expected at least one breakpoint but was given none",
    ),
    "course of words": (
        lambda b: b.trajectories(1, {}, {"pressure": Breakpoints([["now"]], [[1e4]])}, 1.0),
        "pressure: time: expected numbers but was given [['now']]",
    ),
    "rest input": (lambda b: b.rest(1, {}, {"volt": 5e3}), "no input 'volt'; did you mean voltage"),
    "rest rows": (
        lambda b: b.rest(ROWS, {}, {"voltage": np.zeros(2)}),
        "voltage: expected one number or 3, one a row, but was given 2",
    ),
    "rest word": (lambda b: b.rest(1, {}, {"voltage": "high"}), "voltage: expected numbers but was given 'high'"),
    "no rest inputs": (lambda b: b.rest(1, {}, 5e3), "inputs: expected values by name, as in a dict"),
    "count": (lambda b: b.rest(2.5, {}, {}), "rows: expected a whole number but was given 2.5"),
    "past": (
        lambda b: b.trajectories(ROWS, {}, {}, [1, -1, 2]),
        "stop: expected at least 0 s but was given -1 in row 1",
    ),
    "never": (lambda b: b.trajectories(1, {}, {}, np.inf), "stop: expected a finite number in s but was given inf"),
    "soon": (lambda b: b.trajectories(1, {}, {}, "soon"), "stop: expected numbers but was given 'soon'"),
    "tolerance of words": (
        lambda b: b.trajectories(1, {}, {}, 1.0, tolerance="x"),
        "tolerance: expected a positive number but was given 'x'",
    ),
    "kind": (
        lambda b: Probe("nope", "lambda_2"),
        "probe: expected one of the kinds final, min, max, mean, at, rise, fall but was given 'nope'",
    ),
    "threshold": (
        lambda b: Probe("rise", "lambda_2", None, "x"),
        "probe rise lambda_2: threshold: expected numbers but was given ['x']",
    ),
    "probe": (lambda b: Batch(b.model, ["lambda_2"]), "probes: expected each as Probe(kind, variable) but was given"),
    "other probe": (
        lambda b: b.trajectories(1, {}, {}, 1.0, probes=[Probe("min", "lambda_2")]),
        "probes: expected probe max lambda_2, as declared, but was given probe min lambda_2",
    ),
    "no probe": (lambda b: b.trajectories(1, {}, {}, 1.0, probes=[]), "as declared, but was given none"),
    "window": (
        lambda b: b.trajectories(ROWS, {}, {}, 1.0, probes=[Probe("max", "lambda_2", np.zeros(2))]),
        "probe max lambda_2: time: expected one number or 3, one a row, but was given 2",
    ),
    "tolerance": (lambda b: b.trajectories(ROWS, {}, {}, 1.0, tolerance=0.0), "tolerance: expected a positive number"),
}


@pytest.fixture(scope="module")
def batch() -> Batch:
    return Batch(tubular_dea(), [Probe("max", "lambda_2")])


@pytest.mark.parametrize("case", REFUSED)
def test_refused(batch: Batch, case: str) -> None:
    call, said = REFUSED[case]
    with pytest.raises(KernelError) as refusal:
        call(batch)
    assert said in str(refusal.value)
