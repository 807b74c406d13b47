"""What only FMI 2.0 has: its state machine (2.0.4, sections 3.2.3 and 4.2.4), inputs as polynomials, status calls."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2CallbackFunctions, fmi2EventInfo

import independent
from drivers import CS, ME, Host
from refusals import DISCARD, ERROR, OK, Call, check_state_machine, doubles, refused, vrs

ANY = "INECST"
INT = ctypes.c_int


def one(host: Host) -> tuple:
    return vrs(host, "pressure"), 1


def state_call(name: str, *more: object) -> Call:
    """A call on a state that the host holds."""
    return Call(name, ANY, lambda host: (host.fmu.getFMUState(), *more))


CALLS = [
    Call("SetDebugLogging", ANY, lambda host: (0, 0, None)),
    Call("SetupExperiment", "I", lambda host: (0, 0.0, 0.0, 0, 0.0)),
    Call("EnterInitializationMode", "I"),
    Call("ExitInitializationMode", "N"),
    Call("Terminate", "ECS"),
    Call("Reset", ANY),
    Call("GetReal", "NECST", lambda host: (*one(host), doubles(0))),
    Call("SetReal", "INECS", lambda host: (*one(host), doubles(1e4))),
    Call("SetReal", "INES", lambda host: (vrs(host, "C_1"), 1, doubles(3e5))),
    Call("SetReal", "IN", lambda host: (vrs(host, "l_o"), 1, doubles(0.02))),
    Call("GetInteger", "NECST", lambda host: (vrs(host, "n_layers"), 1, (INT * 1)())),
    Call("SetInteger", "IN", lambda host: (vrs(host, "n_layers"), 1, (INT * 1)(4))),
    Call("GetBoolean", "NECST", lambda host: (vrs(host, "start_at_equilibrium"), 1, (INT * 1)())),
    Call("SetBoolean", "IN", lambda host: (vrs(host, "start_at_equilibrium"), 1, (INT * 1)(1))),
    Call("GetFMUstate", ANY, lambda host: (ctypes.byref(ctypes.c_void_p()),)),
    state_call("SetFMUstate"),
    Call("FreeFMUstate", ANY, lambda host: (ctypes.byref(ctypes.c_void_p(host.fmu.getFMUState().value)),)),
    state_call("SerializedFMUstateSize", ctypes.byref(ctypes.c_size_t())),
    Call(
        "GetDirectionalDerivative",
        "NECST",
        lambda host: (vrs(host, "charge"), 1, vrs(host, "voltage"), 1, doubles(1), doubles(0)),
    ),
    Call("SetRealInputDerivatives", "INS", lambda host: (*one(host), (INT * 1)(1), doubles(5.0)), CS),
    Call("GetRealOutputDerivatives", "ST", lambda host: (vrs(host, "radius"), 1, (INT * 1)(1), doubles(0)), CS),
    Call("DoStep", "S", lambda host: (0.0, 1e-3, 0), CS),
    Call("CancelStep", "", interface=CS),
    Call("GetStatus", "ST", lambda host: (0, ctypes.byref(INT())), CS, DISCARD),
    Call("GetRealStatus", "ST", lambda host: (2, ctypes.byref(ctypes.c_double())), CS),
    Call("GetIntegerStatus", "ST", lambda host: (0, ctypes.byref(INT())), CS, DISCARD),
    Call("GetBooleanStatus", "ST", lambda host: (3, ctypes.byref(INT())), CS),
    Call("GetStringStatus", "ST", lambda host: (1, ctypes.byref(ctypes.c_char_p())), CS, DISCARD),
    Call("EnterEventMode", "EC", interface=ME),
    Call("NewDiscreteStates", "E", lambda host: (ctypes.byref(fmi2EventInfo()),), ME),
    Call("EnterContinuousTimeMode", "E", interface=ME),
    Call("CompletedIntegratorStep", "C", lambda host: (1, ctypes.byref(INT()), ctypes.byref(INT())), ME),
    Call("SetTime", "EC", lambda host: (0.0,), ME),
    Call("SetContinuousStates", "C", lambda host: (doubles(1, 0, 0, 0), 4), ME),
    Call("GetDerivatives", "NECT", lambda host: (doubles(0, 0, 0, 0), 4), ME),
    Call("GetEventIndicators", "NECT", lambda host: (None, 0), ME),
    Call("GetContinuousStates", "NECT", lambda host: (doubles(0, 0, 0, 0), 4), ME),
    Call("GetNominalsOfContinuousStates", "INECT", lambda host: (doubles(0, 0, 0, 0), 4), ME),
]


@pytest.mark.parametrize("kind", [CS, ME])
def test_state_machine(fmi2_fmu: Path, kind: str) -> None:
    with Host(fmi2_fmu, kind) as host:
        assert check_state_machine(host, CALLS) > 100


def test_set_up_before_initialization(fmi2_fmu: Path) -> None:
    with Host(fmi2_fmu) as host, refused(host, "fmi2SetupExperiment", "start time"):
        host.fmu.enterInitializationMode()


def test_instantiate_without_callbacks_and_with_short_lived_ones(fmi2_fmu: Path) -> None:
    """Hosts exist that pass none, and others that free the structure after the call."""
    with Host(fmi2_fmu) as host:
        create = host.fmu._functions["fmi2Instantiate"]
        guid = host.description.guid.encode()
        silent = create(b"silent", 1, guid, None, None, 0, 1)
        callbacks = fmi2CallbackFunctions.from_buffer_copy(host._callbacks)
        loud = create(b"loud", 1, guid, None, ctypes.byref(callbacks), 0, 1)
        ctypes.memset(ctypes.byref(callbacks), 0xFF, ctypes.sizeof(callbacks))
        for component in (silent, loud):
            assert host.fmu._functions["fmi2DoStep"](component, 0.0, 1.0, 0) == ERROR
            host.fmu._functions["fmi2FreeInstance"](component)
        assert [m for m in host.messages if "fmi2DoStep cannot be called" in m] == [host.messages[-1]]


@pytest.mark.parametrize("step", [0.25, 0.05, 0.01])
@pytest.mark.parametrize("degree", [1, 2, 3])
def test_input_polynomials_are_followed(fmi2_fmu: Path, degree: int, step: float) -> None:
    """Pressure and voltage polynomials of each degree, against SciPy on the exact functions."""
    polynomials = {
        "pressure": np.polynomial.Polynomial([8000.0, 3000.0, -4000.0, 1500.0][: degree + 1]),
        "voltage": np.polynomial.Polynomial([3000.0, 2000.0, -3000.0, 2500.0][: degree + 1]),
    }
    with Host(fmi2_fmu) as host:
        host.set(**{name: f(0.0) for name, f in polynomials.items()})
        host.initialize(tolerance=1e-9)
        times = np.arange(round(0.5 / step)) * step
        for time in times:
            host.set(**{name: f(time) for name, f in polynomials.items()})
            _set_derivatives(host, polynomials, time, degree)
            host.step(time, step)
        found = host.get("lambda_2", "pressure", "voltage", "current")
    exact = _exact(polynomials, 0.5)
    assert found[0] == pytest.approx(exact[0], abs=2e-8)
    assert found[1:3] == pytest.approx([f(0.5) for f in polynomials.values()], rel=1e-12)
    assert found[3] == pytest.approx(exact[1], rel=1e-5), "the voltage was moving at the end of the step"


def _set_derivatives(host: Host, polynomials: dict, time: float, degree: int) -> None:
    """All derivatives of both inputs at `time` in one call."""
    listed = [(name, k, f.deriv(k)(time)) for name, f in polynomials.items() for k in range(1, degree + 1)]
    n = len(listed)
    host.fmu.fmi2SetRealInputDerivatives(
        host.fmu.component,
        vrs(host, *(name for name, _, _ in listed)),
        n,
        (INT * n)(*(k for _, k, _ in listed)),
        doubles(*(value for _, _, value in listed)),
    )


def _exact(polynomials: dict, end: float) -> tuple[float, float]:
    """(lambda_2, current) at `end` by SciPy, on the independent right-hand side."""
    from scipy.integrate import solve_ivp

    def f(t: float, x: np.ndarray) -> list[float]:
        return independent.rhs(t, x, polynomials["pressure"](t), polynomials["voltage"](t))

    x = solve_ivp(f, (0, end), independent.AT_REST, "Radau", rtol=1e-10, atol=independent.ATOL).y[:, -1]
    farad, eps = independent.capacitance(x[0]), 1e-7
    rate = (independent.capacitance(x[0] + eps) - independent.capacitance(x[0] - eps)) / (2 * eps) * x[1]
    voltage = polynomials["voltage"]
    return x[0], farad * voltage.deriv()(end) + rate * voltage(end)


def test_input_derivatives_hold_for_one_step(fmi2_fmu: Path) -> None:
    with Host(fmi2_fmu) as host:
        host.initialize()
        host.set(pressure=1000.0)
        host.set_input_derivatives([1e5, 0.0])
        host.step(0.0, 0.1)
        assert host.get("pressure") == pytest.approx([11000.0], rel=1e-14)
        host.step(0.1, 0.1)
        assert host.get("pressure") == pytest.approx([11000.0], rel=1e-14)


@pytest.mark.parametrize(
    ("name", "order", "value", "words"),
    [
        ("pressure", 0, 1.0, ["pressure", "order from 1 to 3", "given 0"]),
        ("voltage", 4, 1.0, ["voltage", "order from 1 to 3", "given 4"]),
        ("voltage", 1, np.nan, ["voltage", "finite", "nan"]),
        ("radius", 1, 1.0, ["radius is not an input"]),
    ],
)
def test_wrong_input_derivatives(fmi2_fmu: Path, name: str, order: int, value: float, words: list[str]) -> None:
    with Host(fmi2_fmu) as host:
        host.initialize()
        with refused(host, *words):
            host.fmu.fmi2SetRealInputDerivatives(
                host.fmu.component, vrs(host, "pressure", name), 2, (INT * 2)(1, order), doubles(1.0, value)
            )


def test_status_of_the_last_step(fmi2_fmu: Path) -> None:
    with Host(fmi2_fmu) as host:
        host.initialize(stop=1.0)
        host.step(0.0, 0.25)
        with pytest.raises(FMICallException):
            host.step(0.25, 10.0)
        time, ended = ctypes.c_double(), INT(7)
        assert host.call("GetRealStatus", 2, ctypes.byref(time)) == OK
        assert host.call("GetBooleanStatus", 3, ctypes.byref(ended)) == OK
        assert (time.value, ended.value) == (0.25, 0)
        assert host.call("GetRealStatus", 0, ctypes.byref(time)) == DISCARD
        assert host.call("GetRealStatus", 2, None) == ERROR
