"""lambda_2 stays above zero, where the equations end: steps that would cross it halve, and then say so.

A thin-walled tube is thrown inwards by 10 MV in three microseconds: without the minimum a step lands on the other side
of the singularity, within its tolerance, and goes on from there.
"""

from __future__ import annotations

import ctypes
import dataclasses
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from drivers import ME, Host
from refusals import DISCARD, doubles, refused
from tubular_dea.export.package import native_fmu
from tubular_dea.export.python_fmu import python_fmu as package
from tubular_dea.kernel import Kernel, KernelError
from tubular_dea.kernel.batch import Batch, Breakpoints, Probe
from tubular_dea.model.dea import tubular_dea
from tubular_dea.model.declare import DeclarationError, Model
from tubular_dea.protocol import Protocol

COLLAPSING = {"lambda_2_start": 0.8, "C_2": 0.0, "C_3": 1e-3}
VOLTAGE = 1e7
SECOND = Protocol.of([0, 1], pressure=[0, 0], voltage=[VOLTAGE, VOLTAGE])
END = "lambda_2 would come to 0, where the equations end"


def with_minimum(minimum: float) -> Model:
    """The tube, with another minimum of lambda_2."""
    model = tubular_dea()
    first, *others = model.states
    changed = dataclasses.replace(first, quantity=dataclasses.replace(first.quantity, minimum=minimum))
    return dataclasses.replace(model, states=(changed, *others))


@pytest.mark.parametrize("sensitivities", [(), ("C_1",)])
def test_the_kernel_says_where_it_ended(kernel: Kernel, sensitivities: tuple[str, ...]) -> None:
    with pytest.raises(KernelError, match=rf"ended at 3\.1[0-9]*e-06 s: {END}"):
        kernel.simulate(SECOND, np.array([0.5]), COLLAPSING, sensitivities=sensitivities)
    with pytest.raises(KernelError, match="ended at 0 s: lambda_2 would come to 1"):
        above_one = Kernel(with_minimum(1.0))
        above_one.simulate(SECOND, np.array([0.5]), {"lambda_2_start": 0.9}, sensitivities=sensitivities)


def test_a_kept_mesh_does_not_step_across(kernel: Kernel) -> None:
    with pytest.raises(KernelError, match=END):
        kernel.simulate(SECOND, np.array([0.5]), COLLAPSING, mesh=np.linspace(1e-6, 1, 1000))


def test_a_row_of_a_batch_ends_alone() -> None:
    batch = Batch(with_minimum(0.75), [Probe("final", "lambda_2")])
    voltage = np.array([[0.0], [VOLTAGE], [0.0]])
    parameters = {name: np.full(3, value) for name, value in COLLAPSING.items()}
    parameters["lambda_2_start"] = np.array([0.8, 0.8, 0.7])
    inputs = {"voltage": Breakpoints(np.zeros((1, 1)), voltage)}
    found = batch.trajectories(3, parameters, inputs, np.full((3, 1), 1e-3))
    assert found.status.tolist() == [0, 4, 4]
    assert "a state would come to its minimum" in found.message(1)
    assert np.isnan(found.values[1:]).all() and found.values[0] > 0


def test_a_step_of_the_fmu_is_refused(fmu: Path) -> None:
    with Host(fmu) as host:
        host.set(**COLLAPSING)
        host.initialize()
        host.step(0.0, 1e-3)
        host.set(voltage=VOLTAGE)
        with refused(host, END, "check inputs and parameters", "as it was before the step"):
            host.step(1e-3, 1e-3)
        host.set(voltage=0.0)
        host.step(1e-3, 1e-3)


def test_a_step_of_the_pythonfmu_fmu_is_refused(python_fmu: Path, caplog: pytest.LogCaptureFixture) -> None:
    with Host(python_fmu) as host:
        host.set(voltage=VOLTAGE, **COLLAPSING)
        host.initialize()
        before = host.saved()
        with pytest.raises(FMICallException, match="discard"):
            host.step(0.0, 1e-3)
        assert END in caplog.text
        assert host.saved() == before
        host.set(voltage=0.0)
        host.step(0.0, 1e-3)


@pytest.mark.parametrize("lambda_2", [0.0, -0.1, -1e300])
def test_states_from_outside_are_discarded(fmu: Path, lambda_2: float) -> None:
    """Discarded, not an error: so a solver that has tried too large a step is told to try a smaller one."""
    with Host(fmu, ME) as host:
        host.initialize()
        before = host.saved()
        assert host.call("SetContinuousStates", doubles(lambda_2, 0, 0, 0), ctypes.c_size_t(4)) == DISCARD
        expected = f"lambda_2: expected more than 0, where the equations end, but was given {lambda_2:g}"
        assert host.messages[-1] == f"continuous state {expected}"
        assert host.saved() == before


@pytest.mark.parametrize("kind", ["native", "python"])
def test_a_start_below_the_minimum_is_refused(kind: str, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    build = native_fmu if kind == "native" else lambda model, _, path: package(model, path)
    path = build(with_minimum(1.2), 2, tmp_path / "TubularDEA.fmu")
    with Host(path) as host:
        host.enter()
        with pytest.raises(FMICallException):
            host.fmu.exitInitializationMode()
        assert "start value of lambda_2: expected more than 1.2" in caplog.text + "".join(host.messages)
    with Host(path) as host:
        host.set(lambda_2_start=1.3)
        host.initialize()
        host.step(0.0, 1e-5)
        with pytest.raises(FMICallException):
            host.step(1e-5, 1.0)
        assert "lambda_2 would come to 1.2, where the equations end" in caplog.text + "".join(host.messages)


def test_the_minimum_is_declared_once(fmu: Path) -> None:
    with Host(fmu) as host:
        declared = {v.name: v.min for v in host.description.modelVariables}
    assert float(declared["lambda_2"]) == 0
    assert declared["lambda_2_rate"] is None


def test_a_maximum_of_a_state_is_refused(model: Model) -> None:
    bounded = dataclasses.replace(model.states[1].quantity, maximum=1.0)
    states = (model.states[0], dataclasses.replace(model.states[1], quantity=bounded), *model.states[2:])
    with pytest.raises(DeclarationError, match="lambda_2_rate is a state; expected no maximum"):
        dataclasses.replace(model, states=states)
