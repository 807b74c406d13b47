"""Every way to run the model gives the independent reference traces, within 1e-6 in lambda_2, snap included."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from drivers import co_simulate, integrate
from scenarios import CASES, Case, case
from tubular_dea.kernel import Kernel, KernelError
from tubular_dea.protocol import Protocol


def run_kernel(case: Case, kernel: Kernel) -> np.ndarray:
    protocol = Protocol.of(**case.inputs)
    return kernel.simulate(protocol, np.minimum(case.time, case.stop))["lambda_2"]


PATHS: dict[str, Callable[[Case, pytest.FixtureRequest], np.ndarray]] = {
    "kernel": lambda c, fixtures: run_kernel(c, fixtures.getfixturevalue("kernel")),
    "fmi2-cs": lambda c, fixtures: co_simulate(fixtures.getfixturevalue("fmi2_fmu"), c, interpolated=True),
    "fmi3-cs": lambda c, fixtures: co_simulate(fixtures.getfixturevalue("fmi3_fmu"), c, interpolated=False),
    "fmi2-me": lambda c, fixtures: integrate(fixtures.getfixturevalue("fmi2_fmu"), c),
    "fmi3-me": lambda c, fixtures: integrate(fixtures.getfixturevalue("fmi3_fmu"), c),
    "pythonfmu": lambda c, fixtures: co_simulate(fixtures.getfixturevalue("python_fmu"), c, interpolated=False),
}


@pytest.mark.long
@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("name", CASES)
def test_reference_trace(name: str, path: str, request: pytest.FixtureRequest) -> None:
    reference = case(name)
    computed = PATHS[path](reference, request)
    assert computed.shape == reference.lambda_2.shape, "a sample is missing"
    error = np.abs(computed - reference.lambda_2)
    worst = int(np.argmax(error))
    assert error[worst] <= reference.tolerance["lambda_2"], (
        f"{path} is off by {error[worst]:.2e} at {reference.time[worst]} s in {name}; "
        f"`python -m pytest tests/test_paths.py -k '{name} and {path}'` repeats this"
    )


def test_simulate_fmu_as_a_user_would(fmi2_fmu: Path, fmi3_fmu: Path) -> None:
    """FMPy's own loop, co-simulation and model exchange, on held inputs: 4 kV at 95 mmHg from rest."""
    from fmpy import simulate_fmu

    inputs = np.array(
        [(0.0, 12665.59, 0.0), (0.5, 12665.59, 0.0), (0.5, 12665.59, 4000.0), (2.0, 12665.59, 4000.0)],
        dtype=[("time", float), ("pressure", float), ("voltage", float)],
    )
    results = [
        simulate_fmu(
            str(fmu),
            fmi_type=kind,
            stop_time=2.0,
            output_interval=0.01,
            input=inputs,
            relative_tolerance=1e-6,
            start_values={"start_at_equilibrium": True, "pressure": 12665.59},
            output=["radius"],
        )["radius"][-1]
        for fmu in (fmi2_fmu, fmi3_fmu)
        for kind in ("CoSimulation", "ModelExchange")
    ]
    assert np.ptp(results) < 1e-7
    assert 17.9e-3 < results[0] < 18.40e-3  # creeping from 17.82 mm towards 18.40 mm


def test_the_last_sample_is_the_solution_whatever_the_grid(kernel: Kernel) -> None:
    """A step that ends at the last sample may end a rounding error before it; the sample is written all the same."""
    random = np.random.default_rng(5)
    for stop in np.round(random.uniform(0.5, 3.0, 300), 3):
        on = round(float(random.uniform(0.1, 0.4)), 4)
        protocol = Protocol(
            np.array([0, on, on, stop]),
            {"pressure": np.array([0.0, 9e3, 9e3, 9e3]), "voltage": np.array([0.0, 0.0, 4e3, 4e3])},
        )
        times = np.append(np.arange(0, stop, 4e-3), stop)
        rough, fine = (kernel.simulate(protocol, times, {}, tolerance)["lambda_2"] for tolerance in (1e-6, 1e-8))
        assert np.abs(rough - fine).max() < 1e-5, stop


def test_a_trajectory_is_given_up_when_asked(kernel: Kernel) -> None:
    protocol = Protocol.of([0, 5], pressure=[1e4, 1e4], voltage=[4e3, 4e3])
    steps = kernel.simulate(protocol, np.array([5.0])).steps
    assert kernel.simulate(protocol, np.array([5.0]), max_steps=2 * steps).steps == steps
    with pytest.raises(KernelError, match="too many internal steps"):
        kernel.simulate(protocol, np.array([5.0]), max_steps=steps // 2)
    pieces = Protocol.of(np.linspace(0, 5, 11), pressure=np.full(11, 1e4), voltage=np.full(11, 4e3))
    in_all = kernel.simulate(pieces, np.array([5.0])).steps
    assert kernel.simulate(pieces, np.array([5.0]), total_steps=2 * in_all).steps == in_all
    with pytest.raises(KernelError, match="too many internal steps"):
        kernel.simulate(pieces, np.array([5.0]), total_steps=in_all - 1)
