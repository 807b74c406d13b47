"""Experiments in a row without rest: one trajectory answers them all, and none of them changes by it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.identify.fitting.cases import Case, Reading, shared_trajectories
from tubular_dea.identify.fitting.fit import search
from tubular_dea.identify.fitting.response import TOLERANCE, Response
from tubular_dea.kernel import Driven, Kernel, KernelError
from tubular_dea.protocol import Protocol

TIMES = np.linspace(0, 3, 301)


def in_a_row(count: int, pause: float = 0.7) -> list[Case]:
    """Cases of which each carries all before it, on its own clock; voltage jumps at samples."""
    found, before = [], None
    for i in range(count):
        steps = {"pressure": [0, 8e3 + 900 * i, 8e3 + 900 * i, 9e3, 9e3], "voltage": [0, 0, 2e3 + 500 * i, 2e3, 0]}
        own = Protocol.of([0, 1, 1, 2.3, 3], **steps)
        if before is not None:
            time = np.concatenate([before.time - (3 + pause), own.time])
            own = Protocol.of(time, **{n: np.concatenate([before.inputs[n], v]) for n, v in own.inputs.items()})
        found.append(Case(own, (Reading("measured_displacement", TIMES),)))
        before = own
    return found


def test_a_row_is_one_trajectory_and_each_file_reads_what_it_would_alone() -> None:
    cases, kernel = in_a_row(4), Kernel(td.tube())
    assert [len(shared.cases) for shared in shared_trajectories(cases)] == [4]
    shuffled = [cases[i] for i in (2, 0, 3, 1)]
    together = Response(kernel, shuffled)
    separate = [Response(kernel, [case]) for case in shuffled]
    for joint, single in zip(together.outputs({}, 1e-9), separate, strict=True):
        np.testing.assert_allclose(joint, single.outputs({}, 1e-9)[0], atol=1e-9)
    values, columns = together.sensitivities({}, ["C_1", "eta_2"])
    for value, column, single in zip(values, columns, separate, strict=True):
        alone_value, alone_column = single.sensitivities({}, ["C_1", "eta_2"])
        np.testing.assert_allclose(value, alone_value[0], atol=1e-8)
        np.testing.assert_allclose(column, alone_column[0], rtol=1e-3, atol=1e-3 * np.abs(alone_column[0]).max())


@pytest.mark.parametrize("what", ["inputs", "start", "outputs", "times"])
def test_what_began_otherwise_is_another_trajectory(what: str) -> None:
    first, second = in_a_row(2)
    other = {
        "inputs": replace(
            first, protocol=Protocol(first.protocol.time, {n: 1.01 * v for n, v in first.protocol.inputs.items()})
        ),
        "start": replace(first, own={"start_at_equilibrium": 1.0}),
        "outputs": replace(first, readings=(Reading("lambda_2", TIMES),)),
        "times": replace(first, protocol=Protocol(1.001 * first.protocol.time, first.protocol.inputs)),
    }[what]
    assert len(shared_trajectories([second, other])) == 2
    assert len(shared_trajectories([second, first])) == 1


def test_a_case_that_cannot_be_computed_takes_none_before_it_along(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = in_a_row(2)
    kernel = Kernel(td.tube())
    real = kernel.simulate

    def bursts(driven: Driven, *args: object, **options: object) -> object:
        if driven.points.size > first.protocol.time.size:
            raise KernelError("the load is beyond the fold")
        return real(driven, *args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(kernel, "simulate", bursts)
    found = Response(kernel, [first, second]).possible({})
    assert found[0] is not None and found[1] is None


def test_sensitivities_are_taken_over_finer_steps_where_a_step_has_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a step across a turn of friction, rounding decides whether there is an answer."""
    kernel, case = Kernel(td.tube()), in_a_row(1)[0]
    whole = kernel.simulate
    coarse = kernel.mesh(case.protocol, {}, TOLERANCE).size
    tried: list[int] = []

    def failing(*given: Any, mesh: np.ndarray | None = None, **named: Any) -> object:
        if mesh is not None:
            tried.append(mesh.size)
            if mesh.size <= coarse:
                raise KernelError("the trajectory ended")
        return whole(*given, mesh=mesh, **named)

    expected = Response(kernel, [case]).sensitivities({}, ["C_1"])
    monkeypatch.setattr(kernel, "simulate", failing)
    found = Response(kernel, [case]).sensitivities({}, ["C_1"])
    assert tried[0] == coarse < tried[1]
    assert np.allclose(found[1][0], expected[1][0], rtol=1e-3, atol=1e-12)


class Parabola:
    """(x - 3)^2, whose derivative has an answer `told` times."""

    def __init__(self, told: int) -> None:
        self.told = told

    def residuals(self, x: np.ndarray, most_steps: float = np.inf) -> np.ndarray:
        return x**2 - 9.0

    def most_steps(self) -> float:
        return np.inf

    def linearised(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self.told -= 1
        if self.told < 0:
            raise KernelError("the trajectory ended")
        return self.residuals(x), np.diag(2 * x)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return np.full(1, -np.inf), np.full(1, np.inf)


@pytest.mark.parametrize(("told", "ended"), [(99, 3.0), (2, 5.0), (1, 9.0)])
def test_a_search_ends_where_it_last_had_a_derivative(told: int, ended: float) -> None:
    """What it has reached counts; Newton's steps for x^2 = 9 from 9 lead to 5."""
    found = search(Parabola(told), np.array([9.0]), 50)
    assert found is not None and found.x[0] == pytest.approx(ended, rel=1e-6)
    assert found.fun[0] == pytest.approx(ended**2 - 9, abs=1e-4)


def test_a_search_without_any_derivative_finds_nothing() -> None:
    """An answer alone does not say where to go."""
    assert search(Parabola(0), np.array([9.0]), 50) is None
