"""The pythonfmu FMU: the native one's interface and numbers, refusals that tell why, only Python inside."""

from __future__ import annotations

import ast
import dataclasses
import gc
import hashlib
import importlib
import json
import logging
import math
import os
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

import independent
from drivers import Host, co_simulate
from scenarios import MMHG, POINTS, Case, case
from tubular_dea.emit import model_description
from tubular_dea.emit.python import compile_python
from tubular_dea.export.python_fmu import python_fmu as package
from tubular_dea.export.python_fmu import slave_source
from tubular_dea.export.slave import instance, integrator
from tubular_dea.kernel import Kernel
from tubular_dea.model.dea import printed_sine
from tubular_dea.model.declare import Delay, Model, Parameter, Quantity
from tubular_dea.plants.effects import catalogue
from tubular_dea.protocol import Protocol

STEP = 1e-3  # s
DISCARD, FATAL = "discard", "fatal"


def beat(time: float) -> tuple[float, float]:
    """A pulse of pressure [Pa] every 0.8 s, and the voltage [V] on during its rise."""
    phase = time % 0.8 / 0.8
    pressure = 95 * MMHG + 15 * MMHG * math.sin(2 * math.pi * phase)
    return pressure, 5000.0 * min(1.0, max(0.0, (phase - 0.1) / 0.03)) * min(1.0, max(0.0, (0.45 - phase) / 0.03))


def stepped(host: Host, first: int, count: int, inputs: Callable[[float], tuple[float, float]] = beat) -> list[float]:
    """lambda_2 and the charging current [A] after each of `count` steps from the step number `first` on."""
    values = []
    for i in range(first, first + count):
        pressure, voltage = inputs(i * STEP)
        host.set(pressure=pressure, voltage=voltage)
        host.step(i * STEP, STEP)
        values += host.get("lambda_2", "current")
    return values


@pytest.fixture
def tube(python_fmu: Path) -> Iterator[Host]:
    """An initialized instance whose host listens."""
    with Host(python_fmu, logging=True) as host:
        host.initialize()
        yield host


@pytest.fixture(scope="module")
def slave(model: Model, tmp_path_factory: pytest.TempPathFactory) -> Iterator[ModuleType]:
    """The FMU's code, imported by itself."""
    name, code = slave_source(model)
    folder = tmp_path_factory.mktemp("slave")
    (folder / f"{name}.py").write_text(code, encoding="utf-8")
    sys.path.insert(0, str(folder))
    try:
        yield importlib.import_module(name)
    finally:
        sys.path.remove(str(folder))


def in_another_process(code: str, *arguments: str | Path, seed: str = "random") -> str:
    """What a program that may import the tests' helpers prints."""
    path = [str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join(path)}
    command = [sys.executable, "-W", "error::RuntimeWarning", "-c", code, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


# The interface ---------------------------------------------------------------------------------------------


def test_fmpy_finds_nothing_to_complain_about(python_fmu: Path) -> None:
    assert validate_fmu(str(python_fmu)) == []


def test_the_variables_are_those_of_the_native_fmu(python_fmu: Path, model: Model, tmp_path: Path) -> None:
    (tmp_path / "modelDescription.xml").write_text(model_description.fmi2(model), encoding="utf-8")
    native = fmpy.read_model_description(str(tmp_path), validate=False)
    ours = fmpy.read_model_description(str(python_fmu))

    def interface(description: fmpy.model_description.ModelDescription) -> list[tuple[object, ...]]:
        return [
            (v.name, v.valueReference, v.type, v.causality, v.variability, v.start, v.unit, v.min, v.max)
            for v in description.modelVariables
        ]

    assert interface(ours) == interface(native)
    assert ours.guid != native.guid


def test_the_description_promises_what_the_slave_does(python_fmu: Path) -> None:
    description = fmpy.read_model_description(str(python_fmu))
    kind = description.coSimulation
    assert description.modelExchange is None
    assert kind.canGetAndSetFMUstate and kind.canSerializeFMUstate and kind.canHandleVariableCommunicationStepSize
    assert not kind.needsExecutionTool and not kind.canInterpolateInputs and not kind.providesDirectionalDerivative
    assert not kind.maxOutputDerivativeOrder and not kind.canBeInstantiatedOnlyOncePerProcess


def test_builds_are_identical_to_the_byte(python_fmu: Path, tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path\n"
        "from tubular_dea.export.python_fmu import python_fmu\n"
        "from tubular_dea.model.dea import tubular_dea\n"
        "python_fmu(tubular_dea(), Path(sys.argv[1]))"
    )
    built = [tmp_path / "one" / "A.fmu", tmp_path / "two" / "B.fmu"]
    for seed, path in enumerate(built):
        path.parent.mkdir()
        in_another_process(code, path, seed=str(seed))
    assert len({hashlib.sha256(path.read_bytes()).digest() for path in [python_fmu, *built]}) == 1
    with zipfile.ZipFile(python_fmu) as archive:
        names = archive.namelist()
        assert names == sorted(names)
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert {n.split("/")[1] for n in names if n.startswith("binaries/")} == {"linux64", "win64"}


def test_nothing_but_python_inside(python_fmu: Path, tmp_path: Path) -> None:
    """The slave steps and reads its outputs in an isolated interpreter that finds no other packages."""
    with zipfile.ZipFile(python_fmu) as archive:
        archive.extractall(tmp_path)
    code = """
import sys
before = set(sys.modules)
sys.path = [p for p in sys.path if "site-packages" not in p] + [sys.argv[1]]
module = __import__(open(sys.argv[1] + "/slavemodule.txt").read())
slave = module.PythonSlave(instance_name="tube")
slave.setup_experiment(0.0, None, None)
slave.enter_initialization_mode()
slave.set_real([2, 3], [12665.59, 4000.0])
slave.exit_initialization_mode()
assert slave.do_step(0.0, 0.01)
assert all(value == value for value in slave.get_real(list(range(1, 25))))
roots = {name.partition(".")[0] for name in set(sys.modules) - before}
print(*sorted(roots - set(sys.stdlib_module_names) - {"pythonfmu", module.__name__}))
"""
    command = [sys.executable, "-I", "-S", "-c", code, str(tmp_path / "resources")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split() == []


def test_the_code_is_python_3_9(model: Model) -> None:
    name, code = slave_source(model)
    ast.parse(code, feature_version=(3, 9))
    assert name.startswith("tubular_dea_") and f"import {name} as model" in code
    assert max(map(len, code.splitlines())) <= 120


def test_a_model_with_a_pure_delay_is_refused(model: Model, tmp_path: Path) -> None:
    delay = Quantity("lag", "s", "Delay", 0.0, "test", 0.0, 0.1)
    late = Delay(Quantity("late_pressure", "Pa", "Pressure of before", source="test"), "pressure", "lag")
    delayed = model.extend(parameters=[Parameter(delay)], delays=[late])
    with pytest.raises(ValueError, match=r"expected a model without pure delays .* but was given late_pressure"):
        package(delayed, tmp_path / "never.fmu")
    assert not (tmp_path / "never.fmu").exists()


# The numbers -----------------------------------------------------------------------------------------------


def shortened(name: str, stop: float) -> Case:
    """The beginning of a reference case; its inputs must be constant where it is cut."""
    whole = case(name)
    n = int(np.searchsorted(whole.time, stop + 1e-9))
    kept = [i for i, time in enumerate(whole.inputs["time"]) if time < stop]
    inputs = {key: [values[i] for i in [*kept, kept[-1]]] for key, values in whole.inputs.items()}
    inputs["time"][-1] = stop
    samples = {key: getattr(whole, key)[:n] for key in ("time", "lambda_2", "electric_field")}
    return dataclasses.replace(whole, inputs=inputs, stop=stop, **samples)


def test_the_reference_step_of_4_kV(python_fmu: Path) -> None:
    reference = shortened("step_4kV", 3.0)
    computed = co_simulate(python_fmu, reference, interpolated=False)
    assert computed.shape == reference.lambda_2.shape
    assert np.abs(computed - reference.lambda_2).max() <= 1e-6
    assert np.ptp(reference.lambda_2) > 0.2


def test_all_outputs_are_those_of_the_native_fmu(python_fmu: Path, fmi2_fmu: Path) -> None:
    names = [
        v.name
        for v in fmpy.read_model_description(str(fmi2_fmu)).modelVariables
        if v.causality == "output" or v.name.startswith("der(")
    ]
    values = []
    for path in (python_fmu, fmi2_fmu):
        with Host(path) as host:
            host.set(pressure=12665.59, voltage=4000.0)
            host.set_boolean("start_at_equilibrium", True)
            host.initialize(tolerance=1e-9)
            stepped(host, 0, 60)
            values.append(host.get(*names))
    assert values[0] == pytest.approx(values[1], rel=1e-6, abs=1e-12)


def test_equations_are_those_written_by_hand(model: Model) -> None:
    tube = compile_python(model)
    p = tuple(tube.PARAMETERS.values())
    for x, u in POINTS:
        assert tube.derivatives(0.0, x, u, (0.0, 0.0), p, (0.0,)) == pytest.approx(
            independent.rhs(0.0, x, *u), rel=1e-9, abs=1e-6
        )
        rows, along_time = tube.jacobian(0.0, x, u, (0.0, 0.0), p, (0.0,))
        expected = independent.jacobian(x, *u)
        assert np.abs(np.array(rows) - expected).max() <= 1e-9 * np.abs(expected).max()
        assert along_time == (0.0, 0.0, 0.0, 0.0)


def test_sensitivities_are_exact(model: Model) -> None:
    """The tangent along one parameter, by central differences of the right-hand side and the outputs."""
    tube = compile_python(model)
    p = np.array(list(tube.PARAMETERS.values()))
    x, u = POINTS[2]
    for i, name in enumerate(tube.PARAMETERS):
        v_p = np.zeros(p.size)
        v_p[i] = p[i] or 1.0
        dx, y = tube.tangent(0.0, x, u, (0, 0), p, (2e4,), 0.0, (0,) * 4, (0,) * 2, (0,) * 2, v_p, (0,))
        above, below = p + 1e-6 * v_p, p - 1e-6 * v_p
        for function, exact in ((tube.derivatives, dx), (tube.outputs, y)):
            high, low = (np.array(function(0.0, x, u, (0, 0), q, (2e4,))) for q in (above, below))
            scale = np.abs(high).max() + np.abs(exact).max()
            assert np.abs((high - low) / 2e-6 - exact).max() <= 1e-7 * scale, name


def test_written_out_stages_are_those_of_the_loops(slave: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("derivatives", "linearise", "solve", "NX", "HELD"):
        monkeypatch.setattr(integrator, name, getattr(slave, name))
    p = slave.FRESH.p
    for x, u in POINTS:
        begin = slave.linearised(0.0, x, u, p, 1e-6)
        factors, _ = slave.factorise(1 / (1e-4 * slave.GAMMA), begin.J)
        arguments = (0.0, x, begin.dx, (0.0, 1.0, 2.0, 3.0), 1e-4, factors, u, p)
        for written, looped in zip(slave.stages(*arguments), integrator.stages(*arguments), strict=True):
            assert written == pytest.approx(looped, rel=1e-12, abs=1e-12)


def test_linear_systems_are_solved(slave: ModuleType) -> None:
    for x, u in POINTS:
        begin = slave.linearised(0.0, x, u, slave.FRESH.p, 1e-6)
        J = np.zeros((4, 4))
        J[tuple(zip(*slave.PLACES, strict=True))] = begin.J
        factors, pivots = slave.factorise(2e4, begin.J)
        b = np.array([1.0, -2.0, 3e3, 4e4])
        assert np.linalg.solve(2e4 * np.eye(4) - J, b) == pytest.approx(slave.solve(factors, b), rel=1e-9)
        assert math.prod(pivots) == pytest.approx(np.linalg.det(2e4 * np.eye(4) - J), rel=1e-9)
        assert slave.multiply(begin.J, b) == pytest.approx(J @ b)


@pytest.mark.parametrize(("voltage", "radius"), [(0.0, 17.82e-3), (4e3, 18.40e-3), (5e3, 18.80e-3), (7e3, 20.52e-3)])
def test_start_at_equilibrium(python_fmu: Path, voltage: float, radius: float) -> None:
    with Host(python_fmu) as host:
        host.set(pressure=95 * MMHG, voltage=voltage)
        host.set_boolean("start_at_equilibrium", True)
        host.initialize()
        assert host.get("radius")[0] == pytest.approx(radius, abs=0.6e-5)
        before = host.get("lambda_2")[0]
        host.step(0.0, 1.0)
        assert host.get("lambda_2")[0] == pytest.approx(before, abs=1e-7)


def test_fold_and_margin_follow_the_inputs(tube: Host) -> None:
    for voltage, fold in ((4e3, 147.0), (7e3, 104.6), (0.0, 170.0), (4e3, 147.0)):
        tube.set(voltage=voltage, pressure=90 * MMHG)
        pressure, margin = tube.get("snap_through_pressure", "snap_through_margin")
        assert pressure / MMHG == pytest.approx(fold, abs=0.6)
        assert margin == pytest.approx(pressure - 90 * MMHG, rel=1e-12)
    tube.fmu.setReal([tube.vr["C_1"]], [200e3])
    assert tube.get("snap_through_pressure")[0] / MMHG < 120


@pytest.mark.parametrize("effect", ["pneumatic_line", "stretch_dependent_permittivity"])
def test_a_model_with_an_effect(effect: str, model: Model, tmp_path: Path) -> None:
    """More states (six here), other equations: the same numbers as the compiled model."""
    change = catalogue()[effect]
    changed = change(model).with_values(change.typical)
    with Host(package(changed, tmp_path / "TubularDEA.fmu")) as host:
        host.set(pressure=12665.59, voltage=4000.0)
        host.initialize()
        for i in range(20):
            host.step(0.01 * i, 0.01)
        computed = host.get("lambda_2")[0]
    held = Protocol.of(time=[0.0, 0.2], pressure=[12665.59] * 2, voltage=[4000.0] * 2)
    expected = Kernel(changed).simulate(held, np.array([0.0, 0.2]))["lambda_2"][-1]
    assert computed == pytest.approx(expected, abs=1e-7)


def test_one_long_step_is_as_good_as_many(python_fmu: Path) -> None:
    ends = []
    for sizes in ([2.0], [0.25] * 8):
        with Host(python_fmu) as host:
            host.set(pressure=12665.59, voltage=4000.0)
            host.initialize()
            time = 0.0
            for size in sizes:
                host.step(time, size)
                time += size
            ends.append(host.get("lambda_2")[0])
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)


# Parameters ------------------------------------------------------------------------------------------------


def test_tunable_parameters_hold_from_the_next_step_on(python_fmu: Path) -> None:
    ends = []
    for early in (True, False, None):
        with Host(python_fmu) as host:
            if early:
                host.set(C_1=250e3)
            host.initialize()
            if early is False:
                host.set(C_1=250e3)
            ends.append(stepped(host, 0, 20))
    assert ends[0] == ends[1] != ends[2]


def test_integer_and_boolean_parameters(python_fmu: Path) -> None:
    with Host(python_fmu) as host:
        layers, switch = [host.vr["n_layers"]], [host.vr["start_at_equilibrium"]]
        host.fmu.setInteger(layers, [4])
        host.fmu.setBoolean(switch, [True])
        host.enter()
        assert host.fmu.getInteger(layers) == [4]
        assert host.fmu.getBoolean(switch) == [True]
        assert host.get("capacitance")[0] == pytest.approx(4 / 8 * 9.16e-9, rel=2e-3)
        assert host.get("lambda_2")[0] == pytest.approx(1.0, abs=1e-9)  # at rest without any load


def test_the_tolerance_of_the_experiment_counts(python_fmu: Path) -> None:
    ends = []
    for tolerance in (1e-4, 1e-6, 1e-10):
        with Host(python_fmu) as host:
            host.initialize(tolerance=tolerance)
            ends.append(stepped(host, 0, 30)[-2])
    errors = [abs(end - ends[-1]) for end in ends[:-1]]
    assert errors[0] > 10 * errors[1] > 0
    assert errors[1] < 1e-7


def test_reset_gives_the_defaults_back(tube: Host) -> None:
    first = stepped(tube, 0, 5)
    tube.set(C_1=250e3)
    tube.fmu.reset()
    tube.initialize()
    assert tube.get("C_1") == [333.056e3]
    assert stepped(tube, 0, 5) == first


# Saved states ----------------------------------------------------------------------------------------------


def test_rollback_is_exact(tube: Host) -> None:
    stepped(tube, 0, 120)
    saved = tube.fmu.getFMUState()
    before = tube.get("time", "C_1")
    tube.set(C_1=300e3)
    ahead = stepped(tube, 120, 100)
    assert ahead != stepped(tube, 220, 100)
    tube.fmu.setFMUState(saved)
    assert tube.get("time", "C_1") == before
    tube.set(C_1=300e3)
    assert stepped(tube, 120, 100) == ahead
    tube.fmu.freeFMUState(saved)


def test_a_state_taken_in_initialization_mode_comes_back(python_fmu: Path) -> None:
    with Host(python_fmu) as host:
        host.enter()
        host.set(lambda_2_start=1.1)
        saved = host.fmu.getFMUState()
        host.set(lambda_2_start=1.2)
        assert host.get("lambda_2") == [1.2]
        host.fmu.setFMUState(saved)
        assert host.get("lambda_2") == [1.1]
        host.fmu.exitInitializationMode()
        assert host.get("lambda_2") == [1.1]


def test_a_serialized_state_goes_on_in_another_process(tube: Host, python_fmu: Path, tmp_path: Path) -> None:
    stepped(tube, 0, 77)
    saved = tube.fmu.getFMUState()
    (tmp_path / "state").write_bytes(tube.fmu.serializeFMUState(saved))
    ahead = stepped(tube, 77, 50)
    code = """
import json, sys
from pathlib import Path
from test_python_fmu import Host, stepped
with Host(Path(sys.argv[1])) as host:
    host.fmu.setFMUState(host.fmu.deSerializeFMUstate(Path(sys.argv[2]).read_bytes()))
    print(json.dumps([value.hex() for value in stepped(host, 77, 50)]))
"""
    printed = in_another_process(code, python_fmu, tmp_path / "state")
    assert [float.fromhex(value) for value in json.loads(printed.splitlines()[-1])] == ahead


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (lambda data: data[:-1], "expected [0-9]+ bytes but was given"),
        (lambda data: data + b"!", "expected [0-9]+ bytes but was given"),
        (lambda data: b"", "expected [0-9]+ bytes but was given 0"),
        (lambda data: data[:100] + bytes([data[100] ^ 1]) + data[101:], "checksum is wrong"),
        (lambda data: data[:20] + b"\0" + data[21:], "expected a state of TubularDEA .* but was given another"),
    ],
)
def test_spoilt_bytes_are_refused(tube: Host, spoil: Callable[[bytes], bytes], why: str) -> None:
    saved = tube.fmu.getFMUState()
    data = tube.fmu.serializeFMUState(saved)
    with pytest.raises(FMICallException, match=FATAL):
        tube.fmu.deSerializeFMUstate(spoil(data))
    assert_logged(tube, why)
    tube.fmu.setFMUState(tube.fmu.deSerializeFMUstate(data))
    tube.step(0.0, STEP)


def test_a_state_of_another_fmu_is_refused(tube: Host, model: Model, tmp_path: Path) -> None:
    with Host(package(printed_sine(model), tmp_path / "TubularDEA.fmu")) as other:
        other.initialize()
        state = other.fmu.getFMUState()
        data = other.fmu.serializeFMUState(state)
        for attempt in (lambda: tube.fmu.deSerializeFMUstate(data), lambda: tube.fmu.setFMUState(state)):
            with pytest.raises(FMICallException, match=FATAL):
                attempt()
            assert_logged(tube, r"expected a state of TubularDEA \{.*\} but was given another")
    tube.step(0.0, STEP)


# Refusals --------------------------------------------------------------------------------------------------


def assert_logged(host: Host, pattern: str) -> None:
    """The last message to the host matches."""
    assert host.messages and re.search(pattern, host.messages[-1], re.DOTALL), host.messages[-1:]


REFUSED_VALUES = [
    ("pressure", math.nan, "fmi2SetReal: pressure: expected a finite number in Pa but was given nan"),
    ("voltage", math.inf, "fmi2SetReal: voltage: expected a finite number in V but was given inf"),
    ("C_1", -3.0, "fmi2SetReal: C_1: expected at least 1 Pa but was given -3"),
    ("eps_r", 0.5, "fmi2SetReal: eps_r: expected at least 1 but was given 0.5"),
    ("l_o", 0.03, "fmi2SetReal: l_o is a fixed parameter; set it before the end of initialization mode"),
    ("radius", 0.02, "fmi2SetReal: radius is calculated by the model and cannot be set"),
    ("lambda_2", 1.1, "fmi2SetReal: lambda_2 is calculated by the model and cannot be set"),
    ("sigma_vis1", 1.1, "fmi2SetReal: sigma_vis1 is calculated by the model and cannot be set"),
    ("time", 1.0, "fmi2SetReal: time is calculated by the model and cannot be set"),
    ("n_layers", 4.0, "fmi2SetReal: n_layers is of type Integer, not Real; use the function of its type"),
]


@pytest.mark.parametrize(("name", "value", "message"), REFUSED_VALUES)
def test_values_that_are_refused(tube: Host, name: str, value: float, message: str) -> None:
    stepped(tube, 0, 3)
    before = tube.fmu.serializeFMUState(tube.fmu.getFMUState())
    with pytest.raises(FMICallException, match=FATAL):  # the valid value must not be taken either
        tube.fmu.setReal([tube.vr["voltage"], tube.vr[name]], [1234.0, value])
    assert message in tube.messages[-1]
    assert tube.fmu.serializeFMUState(tube.fmu.getFMUState()) == before
    stepped(tube, 3, 3)


def test_out_of_range_before_the_start(python_fmu: Path) -> None:
    with Host(python_fmu, logging=True) as host:
        refused = [
            (lambda: host.set(phi=1.5), "phi: expected at most 1 but was given 1.5"),
            (lambda: host.set(h_ao=1e-9), "h_ao: expected at least 1e-08 m but was given 1e-09"),
            (lambda: host.fmu.setInteger([40], [0]), "n_layers: expected at least 1 but was given 0"),
            (lambda: host.fmu.setReal([4711], [0.0]), "unknown value reference 4711; expected 1 to 42"),
            (lambda: host.fmu.setString([1], ["x"]), "time is of type Real, not String"),
            (lambda: host.get("radius"), "fmi2GetReal cannot be called before initialization mode"),
        ]
        for call, message in refused:
            with pytest.raises(FMICallException, match=FATAL):
                call()
            assert message in host.messages[-1]
        host.initialize()
        host.step(0.0, STEP)


STEPS = [
    (0.0, -STEP, "communication step size: expected a positive finite number in s but was given -0.001"),
    (0.0, 0.0, "communication step size: expected a positive finite number in s but was given 0"),
    (0.0, math.nan, "communication step size: expected a positive finite number in s but was given nan"),
    (-0.5, STEP, "communication point: expected the present time 0 s but was given -0.5; the instance neither"),
    (0.5, STEP, "communication point: expected the present time 0 s but was given 0.5"),
    (0.0, 1.5, "communication step: expected an end at or before the stop time 1 s but was given 1.5"),
]


@pytest.mark.parametrize(("time", "size", "message"), STEPS)
def test_steps_that_are_discarded(python_fmu: Path, time: float, size: float, message: str) -> None:
    with Host(python_fmu, logging=True) as host:
        host.initialize(stop=1.0)
        with pytest.raises(FMICallException, match=DISCARD):
            host.step(time, size)
        assert message in host.messages[-1]
        stepped(host, 0, 3)
        with pytest.raises(FMICallException, match=DISCARD):
            host.step(0.0, STEP)  # back in time


def test_the_stop_time_can_be_reached(python_fmu: Path) -> None:
    with Host(python_fmu) as host:
        host.initialize(start=0.5, stop=0.6)
        for i in range(100):
            host.step(0.5 + i * 1e-3, 1e-3)
        assert host.get("time")[0] == pytest.approx(0.6, abs=1e-12)
        with pytest.raises(FMICallException, match=DISCARD):
            host.step(0.6, 1e-3)


def test_an_integrator_failure_changes_nothing(tube: Host) -> None:
    stepped(tube, 0, 10)
    tube.set(voltage=1e200)
    before = tube.fmu.serializeFMUState(tube.fmu.getFMUState())
    with pytest.raises(FMICallException, match=DISCARD):
        tube.step(10 * STEP, STEP)
    assert_logged(tube, r"no step size, however small, solves the equations at time 0.01 with lambda_2 = 1\.[0-9]+, ")
    assert_logged(tube, r"lambda_2_rate.*; the instance is as it was before the step; check inputs and parameters")
    assert tube.fmu.serializeFMUState(tube.fmu.getFMUState()) == before
    stepped(tube, 10, 10)


def test_the_number_of_internal_steps_is_bounded(slave: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(slave, "MAX_STEPS", 3)
    instance = slave.PythonSlave(instance_name="tube")
    instance.enter_initialization_mode()
    instance.set_real([2, 3], [12665.59, 4000.0])
    instance.exit_initialization_mode()
    assert instance.do_step(0.0, 1.0) is False
    message = instance.log_queue[-1].msg
    assert message.startswith("more than 3 internal steps were needed: stopped at time")
    assert instance.get_real([1, 5]) == [0.0, 1.0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"start": math.nan}, "start time: expected a finite number but was given nan"),
        ({"start": 1.0, "stop": 0.5}, "stop time: expected at least the start time 1 but was given 0.5"),
        ({"tolerance": -1e-6}, "tolerance: expected a positive number but was given -1e-06"),
    ],
)
def test_experiments_that_are_refused(python_fmu: Path, arguments: dict[str, float], message: str) -> None:
    with Host(python_fmu, logging=True) as host:
        with pytest.raises(FMICallException, match=FATAL):
            host.enter(**arguments)
        assert message in host.messages[-1]
        host.initialize()


def test_a_tolerance_out_of_bounds_is_brought_into_them(python_fmu: Path) -> None:
    with Host(python_fmu, logging=True) as host:
        host.initialize(tolerance=0.5)
        assert "tolerance: expected 1e-12 to 0.01 but was given 0.5; using 0.01" in host.messages


def test_no_rest_state_to_start_at(python_fmu: Path) -> None:
    with Host(python_fmu, logging=True) as host:
        host.set(pressure=200 * MMHG)
        host.set_boolean("start_at_equilibrium", True)
        host.enter()
        with pytest.raises(FMICallException, match=FATAL):
            host.fmu.exitInitializationMode()
        assert_logged(host, "no rest state to start at: .* fold at 2272.*but the load was 26664.4; lower the load")
        host.set(pressure=95 * MMHG)
        host.fmu.exitInitializationMode()
        host.step(0.0, STEP)


def test_calls_out_of_order(python_fmu: Path) -> None:
    with Host(python_fmu, logging=True) as host:
        with pytest.raises(FMICallException, match=DISCARD):
            host.step(0.0, STEP)
        assert_logged(host, "fmi2DoStep cannot be called before initialization mode; the call was ignored")
        host.initialize()
        with pytest.raises(FMICallException, match=FATAL):
            host.enter()
        host.fmu.terminate()
        with pytest.raises(FMICallException, match=DISCARD):
            host.step(0.0, STEP)
        assert_logged(host, "fmi2DoStep cannot be called after terminate")
        assert host.get("lambda_2") == [1.0]


def test_refusals_leave_the_instance_usable(tube: Host) -> None:
    """pythonfmu's library gives up its references at every exception; see `_survive` in export/slave/guard.py."""
    expected = stepped(tube, 0, 5)
    tube.fmu.reset()
    tube.initialize()
    logging.disable(logging.CRITICAL)
    try:
        for _ in range(300):
            for call in (
                lambda: tube.set(pressure=math.nan),
                lambda: tube.fmu.getReal([99]),
                lambda: tube.fmu.deSerializeFMUstate(b"?"),
                lambda: tube.step(0.0, -1.0),
            ):
                with pytest.raises(FMICallException):
                    call()
        gc.collect()
    finally:
        logging.disable(logging.NOTSET)
    assert stepped(tube, 0, 5) == expected


def test_a_mistake_in_the_code_is_told_with_its_place(
    slave: ModuleType, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Who edits the file and slips finds the line in Python's log, not just a fatal status."""
    instance = slave.PythonSlave(instance_name="tube")
    instance.enter_initialization_mode()
    instance.exit_initialization_mode()
    monkeypatch.setattr(slave, "growth", lambda error: undefined_name)  # noqa: F821
    with pytest.raises(NameError):
        instance.do_step(0.0, STEP)
    assert "undefined_name" in caplog.text and "in advance" in caplog.text


def test_python_s_log_hears_of_refusals_too(python_fmu: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Hosts that do not ask for logging get no messages from pythonfmu's library."""
    with Host(python_fmu) as host:
        host.initialize()
        with pytest.raises(FMICallException, match=FATAL):
            host.set(pressure=math.nan)
        with pytest.raises(FMICallException, match=DISCARD):
            host.step(0.0, -1.0)
        assert host.messages == []
    heard = [record.getMessage() for record in caplog.records if record.name == "TubularDEA"]
    assert heard == [
        "tube: fmi2SetReal: pressure: expected a finite number in Pa but was given nan",
        "tube: communication step size: expected a positive finite number in s but was given -1",
    ]


# Many of them ----------------------------------------------------------------------------------------------


@pytest.mark.long
def test_different_fmus_in_one_process_run_their_own_code(model: Model, tmp_path: Path) -> None:
    variants = {"paper": model, "soft": model.with_values({"C_1": 250e3}), "printed": printed_sine(model)}
    paths = {name: package(variant, tmp_path / f"{name}.fmu") for name, variant in variants.items()}
    code = """
import json, sys
from pathlib import Path
from test_python_fmu import Host, stepped
hosts = [Host(Path(path)) for path in sys.argv[1:]]
for host in hosts:
    host.initialize()
print(json.dumps([stepped(host, 0, 40) for host in hosts]))
"""
    together = json.loads(in_another_process(code, *paths.values()).splitlines()[-1])
    alone = [json.loads(in_another_process(code, path).splitlines()[-1])[0] for path in paths.values()]
    assert together == alone
    assert len({tuple(values) for values in together}) == len(variants)


def test_sixty_four_instances(python_fmu: Path) -> None:
    def inputs(number: int) -> Callable[[float], tuple[float, float]]:
        return lambda time: (beat(time)[0], 60.0 * number)

    search_path = list(sys.path)
    hosts = [Host(python_fmu) for _ in range(64)]
    try:
        assert sys.path == search_path
        for host in hosts:
            host.initialize()
        together = [[] for _ in hosts]
        for i in range(5):
            for number, host in enumerate(hosts):
                together[number] += stepped(host, i, 1, inputs(number))
        with Host(python_fmu) as one:
            one.initialize()
            assert stepped(one, 0, 5, inputs(40)) == together[40]
        assert len({tuple(values) for values in together}) == len(hosts)
    finally:
        for host in hosts:
            host.__exit__(None, None, None)


def test_the_template_runs_as_it_stands() -> None:
    """Its stand-in, a softening spring, creeps to the root of x - x^3 / 3 = 0.4."""
    spring = instance.PythonSlave(instance_name="spring")
    spring.setup_experiment(0.0, None, None)
    spring.enter_initialization_mode()
    spring.set_real([2], [0.4])
    spring.exit_initialization_mode()
    assert all(spring.do_step(0.1 * i, 0.1) for i in range(50))
    assert spring.get_real([3])[0] == pytest.approx(0.4257185, abs=1e-6)
    assert spring.get_real([4])[0] == pytest.approx(2 / 3 - 0.4)
    state = instance.PythonSlave._fmu_state_from_bytes(spring._fmu_state_to_bytes(spring._get_fmu_state()))
    assert state == spring._get_fmu_state()
