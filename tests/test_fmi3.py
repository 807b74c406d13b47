"""What only FMI 3.0 has: its state machine, intermediate updates, early return, adjoint derivatives."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import independent
from drivers import CS, ME, Host
from refusals import ERROR, OK, Call, check_state_machine, doubles, refused, vrs

ANY = "INECST"
PRESSURE = 12665.59  # Pa, 95 mmHg


def flags(n: int) -> tuple:
    return tuple(ctypes.byref(ctypes.c_bool()) for _ in range(n))


def number() -> ctypes.c_double:
    return ctypes.byref(ctypes.c_double())


CALLS = [
    Call("SetDebugLogging", ANY, lambda host: (False, 0, None)),
    Call("EnterInitializationMode", "I", lambda host: (False, 0.0, 0.0, False, 0.0)),
    Call("ExitInitializationMode", "N"),
    Call("EnterEventMode", "C", interface=ME),
    Call("Terminate", "ECS"),
    Call("Reset", ANY),
    Call("GetFloat64", "NECST", lambda host: (vrs(host, "pressure"), 1, doubles(0), 1)),
    Call("SetFloat64", "INECS", lambda host: (vrs(host, "pressure"), 1, doubles(1e4), 1)),
    Call("SetFloat64", "INES", lambda host: (vrs(host, "C_1"), 1, doubles(3e5), 1)),
    Call("SetFloat64", "IN", lambda host: (vrs(host, "l_o"), 1, doubles(0.02), 1)),
    Call("GetInt32", "NECST", lambda host: (vrs(host, "n_layers"), 1, (ctypes.c_int32 * 1)(), 1)),
    Call("SetInt32", "IN", lambda host: (vrs(host, "n_layers"), 1, (ctypes.c_int32 * 1)(4), 1)),
    Call("GetBoolean", "NECST", lambda host: (vrs(host, "start_at_equilibrium"), 1, (ctypes.c_bool * 1)(), 1)),
    Call("SetBoolean", "IN", lambda host: (vrs(host, "start_at_equilibrium"), 1, (ctypes.c_bool * 1)(True), 1)),
    Call("GetUInt8", "", lambda host: (vrs(host, "pressure"), 1, (ctypes.c_uint8 * 1)(), 1)),
    Call("SetFloat32", "", lambda host: (vrs(host, "pressure"), 1, (ctypes.c_float * 1)(), 1)),
    Call("GetString", "", lambda host: (vrs(host, "pressure"), 1, (ctypes.c_char_p * 1)(), 1)),
    Call("GetNumberOfVariableDependencies", "", lambda host: (0, ctypes.byref(ctypes.c_size_t()))),
    Call("GetFMUState", ANY, lambda host: (ctypes.byref(ctypes.c_void_p()),)),
    Call("SetFMUState", ANY, lambda host: (host.fmu.getFMUState(),)),
    Call("FreeFMUState", ANY, lambda host: (ctypes.byref(ctypes.c_void_p(host.fmu.getFMUState().value)),)),
    Call(
        "GetDirectionalDerivative",
        "NECST",
        lambda host: (vrs(host, "charge"), 1, vrs(host, "voltage"), 1, doubles(1), 1, doubles(0), 1),
    ),
    Call(
        "GetAdjointDerivative",
        "NECST",
        lambda host: (vrs(host, "charge"), 1, vrs(host, "voltage"), 1, doubles(1), 1, doubles(0), 1),
    ),
    Call("EnterConfigurationMode", ""),
    Call("ExitConfigurationMode", ""),
    Call("EnterStepMode", "", interface=CS),
    Call("DoStep", "S", lambda host: (0.0, 1e-3, False, *flags(3), number()), CS),
    Call(
        "GetOutputDerivatives", "ST", lambda host: (vrs(host, "radius"), 1, (ctypes.c_int32 * 1)(1), doubles(0), 1), CS
    ),
    Call("ActivateModelPartition", "", lambda host: (0, 0.0)),
    Call("UpdateDiscreteStates", "E", lambda host: (*flags(5), number()), ME),
    Call("EvaluateDiscreteStates", "NE", interface=ME),
    Call("EnterContinuousTimeMode", "E", interface=ME),
    Call("CompletedIntegratorStep", "C", lambda host: (True, *flags(2)), ME),
    Call("SetTime", "EC", lambda host: (0.0,), ME),
    Call("SetContinuousStates", "C", lambda host: (doubles(1, 0, 0, 0), 4), ME),
    Call("GetContinuousStateDerivatives", "NECT", lambda host: (doubles(0, 0, 0, 0), 4), ME),
    Call("GetEventIndicators", "NECT", lambda host: (None, 0), ME),
    Call("GetContinuousStates", "NECT", lambda host: (doubles(0, 0, 0, 0), 4), ME),
    Call("GetNominalsOfContinuousStates", "NECT", lambda host: (doubles(0, 0, 0, 0), 4), ME),
    Call("GetNumberOfEventIndicators", ANY, lambda host: (ctypes.byref(ctypes.c_size_t()),), ME),
    Call("GetNumberOfContinuousStates", ANY, lambda host: (ctypes.byref(ctypes.c_size_t()),), ME),
]

# Allowed during an intermediate update, beside getting values and setting inputs.
INTERMEDIATE = {
    "SetDebugLogging",
    "FreeFMUState",
    "GetOutputDerivatives",
    "GetDirectionalDerivative",
    "GetAdjointDerivative",
}


@pytest.mark.parametrize("kind", [CS, ME])
def test_state_machine(fmi3_fmu: Path, kind: str) -> None:
    with Host(fmi3_fmu, kind) as host:
        assert check_state_machine(host, CALLS) > 100


def test_counts_that_do_not_match(fmi3_fmu: Path) -> None:
    with Host(fmi3_fmu) as host:
        host.initialize()
        with refused(host, "fmi3SetFloat64", "expected 2 values", "1"):
            host.fmu.fmi3SetFloat64(host.fmu.component, vrs(host, "pressure", "voltage"), 2, doubles(1.0), 1)
        with refused(host, "fmi3GetDirectionalDerivative", "expected 1 values", "3"):
            host.fmu.fmi3GetDirectionalDerivative(
                host.fmu.component, vrs(host, "charge"), 1, vrs(host, "voltage"), 1, doubles(1, 1, 1), 3, doubles(0), 1
            )


def test_what_the_fmu_does_not_offer_is_not_instantiated(fmi3_fmu: Path) -> None:
    with Host(fmi3_fmu) as host:
        token, functions = host.fmu.guid.encode(), host.fmu._functions
        with_events = (b"x", token, None, False, True, True, False, None, 0, None, host.fmu.logMessage, None)
        for function, arguments, words in [
            ("fmi3InstantiateCoSimulation", with_events, "eventModeUsed = false"),
            (
                "fmi3InstantiateScheduledExecution",
                (b"x", token, None, False, True, None, host.fmu.logMessage, None, None, None),
                "not scheduled execution",
            ),
        ]:
            kinds = functions[function].argtypes[-3:]
            filled = [
                kind() if a is None and kind in kinds else a
                for a, kind in zip(arguments, functions[function].argtypes, strict=True)
            ]
            assert not functions[function](*filled)
            assert words in host.messages[-1]


# Intermediate update -----------------------------------------------------------------------------


def stepped(
    fmu: Path, update: Callable[[Host, float], tuple[bool, float] | None] | None, early: bool = False, size: float = 0.5
) -> tuple[Host, tuple, list[tuple]]:
    """A host after one step at 95 mmHg and 4 kV, what doStep answered, and the arguments of every update."""
    seen: list[tuple] = []

    def callback(_environment, time, set_requested, get_allowed, finished, may_return, stop, stop_time) -> None:
        seen.append((time, set_requested, get_allowed, finished, may_return))
        wish = update(host, time) if update else None
        if wish:
            stop[0], stop_time[0] = wish

    host = Host(fmu, intermediate=callback if update else None, early=early)
    host.set(pressure=PRESSURE, voltage=4000.0)
    host.initialize()
    return host, host.fmu.doStep(0.0, size), seen


def test_a_host_that_only_looks_changes_nothing(fmi3_fmu: Path) -> None:
    looked: list[list[float]] = []
    blind, _, _ = stepped(fmi3_fmu, None)
    looking, _, seen = stepped(fmi3_fmu, lambda host, t: looked.append([t, *host.get("time", "lambda_2", "current")]))
    with blind, looking:
        assert looking.saved() == blind.saved(), "bit for bit"
        assert looked[-1][2:] == blind.get("lambda_2", "current")
    times = [time for time, *_ in seen]
    assert len(times) > 10
    assert times[-1] == 0.5
    assert np.all(np.diff(times) > 0)
    assert [row[0] for row in looked] == [row[1] for row in looked] == times
    assert all(row[1:4] == (True, True, True) for row in seen)
    assert not any(may_return for *_, may_return in seen), "early return was not allowed"


def test_inputs_set_between_internal_steps(fmi3_fmu: Path) -> None:
    """The host raises the pressure as a staircase of 10 kPa/s over internal steps: close to the ramp itself."""
    host, _, seen = stepped(fmi3_fmu, lambda host, t: host.set(pressure=PRESSURE + 1e4 * t))
    ramp = {"time": [0.0, 0.5], "pressure": [PRESSURE, PRESSURE + 5e3], "voltage": [4000.0, 4000.0]}
    exact = independent.trajectory(ramp, [0.0, 0.5])["lambda_2"][-1]
    held = independent.trajectory(ramp | {"pressure": [PRESSURE] * 2}, [0.0, 0.5])["lambda_2"][-1]
    with host:
        assert host.get("pressure") == [PRESSURE + 5e3]
        assert abs(host.get("lambda_2")[0] - exact) < 0.05 * abs(exact - held)
        assert seen[-1][0] == 0.5


@pytest.mark.parametrize("wish", [0.0, 0.123], ids=["at once", "in the future"])
def test_early_return_and_going_on(fmi3_fmu: Path, wish: float) -> None:
    """The host asks once, at the first update; the step ends there or at the later time it names."""
    asked: list[float] = []

    def update(host: Host, time: float) -> tuple[bool, float] | None:
        asked.append(time)
        return (True, max(wish, time)) if len(asked) == 1 else None

    host, (events, ended, early, reached), seen = stepped(fmi3_fmu, update, early=True)
    full, _, _ = stepped(fmi3_fmu, None)
    with host, full:
        assert (events, ended, early) == (False, False, True)
        assert reached == pytest.approx(wish or asked[0], abs=1e-15)
        assert host.get("time") == [reached]
        assert seen[0][4], "early return was offered"
        assert host.fmu.doStep(reached, 0.5 - reached) == (False, False, False, 0.5)
        assert host.get("lambda_2") == pytest.approx(full.get("lambda_2"), abs=1e-6)


def test_calls_that_are_forbidden_during_an_update(fmi3_fmu: Path) -> None:
    answers: dict[str, int] = {}

    def update(host: Host, _time: float) -> None:
        for call in CALLS:
            if call.function in INTERMEDIATE or answers.get(call.function):
                continue
            if call.function in ("SetFMUState", "GetFloat64", "GetInt32", "GetBoolean"):
                continue  # the first needs a state, the others are allowed
            if call.function == "SetFloat64":
                answers["SetFloat64 C_1"] = host.call("SetFloat64", vrs(host, "C_1"), 1, doubles(3e5), 1)
            else:
                answers[call.function] = host.call(call.function, *call.arguments(host))
        host.fmu._functions["fmi3FreeInstance"](host.fmu.component)

    host, answer, _ = stepped(fmi3_fmu, update)
    blind, _, _ = stepped(fmi3_fmu, None)
    with host, blind:
        allowed = [name for name, status in answers.items() if status != ERROR]
        assert not allowed
        assert len(answers) > 25
        assert answer[2:] == (False, 0.5)
        assert host.saved() == blind.saved()
        assert any("C_1 cannot change during an intermediate update" in m for m in host.messages)
        assert any("fmi3FreeInstance cannot be called during an intermediate update" in m for m in host.messages)


def test_a_failed_step_says_how_far_time_is(fmi3_fmu: Path) -> None:
    with Host(fmi3_fmu) as host:
        host.initialize(stop=1.0)
        host.step(0.0, 0.5)
        early, reached = ctypes.c_bool(True), ctypes.c_double(-1)
        status = host.call("DoStep", 0.5, 5.0, False, *flags(2), ctypes.byref(early), ctypes.byref(reached))
        assert (status, early.value, reached.value) == (ERROR, False, 0.5)
        assert host.call("DoStep", 0.5, 0.5, False, *flags(2), ctypes.byref(early), ctypes.byref(reached)) == OK


# Adjoint derivatives -----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [CS, ME])
def test_adjoint_is_the_transpose(fmi3_fmu: Path, kind: str) -> None:
    with Host(fmi3_fmu, kind) as host:
        host.set(pressure=PRESSURE, voltage=5000.0)
        host.enter()
        unknown = [v.name for v in host.description.modelVariables if v.causality == "output"]
        known = ["pressure", "voltage", "C_1", "eps_r", "r_o"]
        forward = np.array([host.derivative(unknown, [name], [1.0]) for name in known]).T
        for row, name in zip(forward, unknown, strict=True):
            adjoint = doubles(*[np.nan] * len(known))
            host.fmu.fmi3GetAdjointDerivative(
                host.fmu.component,
                vrs(host, name),
                1,
                vrs(host, *known),
                len(known),
                doubles(1.0),
                1,
                adjoint,
                len(known),
            )
            np.testing.assert_allclose(adjoint, row, rtol=1e-12)
