"""What both FMI versions refuse and accept alike: values, counts, times, names, log categories."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import pytest

from drivers import CS, ME, Host
from refusals import ERROR, OK, WARNING, doubles, refused, vrs

PRESSURE = 12665.59  # Pa, 95 mmHg
REAL = ("Real", "Float64")
ZERO_GUID = b"{00000000-0000-0000-0000-000000000000}"


def real(host: Host) -> str:
    """How this version names the type of real variables."""
    return "Real" if host.version == 2 else "Float64"


def raw(host: Host, verb: str, references: ctypes.Array | None, n: int, values: ctypes.Array | None) -> int:
    """fmi2GetReal, fmi3SetFloat64, ... with whatever arguments."""
    counts = (n,) if host.version == 2 else (n, n)
    return host.call(f"{verb}{real(host)}", references, counts[0], values, *counts[1:])


# Values --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [CS, ME])
def test_start_values_are_those_of_the_description(fmu: Path, kind: str) -> None:
    with Host(fmu, kind) as host:
        host.enter()
        given = [v for v in host.description.modelVariables if v.start is not None]
        assert len(given) == 20
        for v in given:
            if v.type in REAL:
                assert host.get(v.name) == [float(v.start)], v.name
        assert list(host.fmu.getBoolean([host.vr["start_at_equilibrium"]])) in ([False], [0])
        integers = host.fmu.getInteger if host.version == 2 else host.fmu.getInt32
        assert list(integers([host.vr["n_layers"]])) == [8]


@pytest.mark.parametrize("name", ["C_1", "C_2", "C_3", "eps_r", "eta_o", "k_1", "eta_1", "k_2", "eta_2"])
def test_tunable_parameters_act_from_the_next_step_on(fmu: Path, name: str) -> None:
    """Changing one moves no state at once, and the trajectory from the next step on."""
    with Host(fmu) as changed, Host(fmu) as plain:
        for host in (changed, plain):
            host.set(pressure=PRESSURE, voltage=4000.0)
            host.initialize()
            host.step(0.0, 0.1)
        changed.set(**{name: 1.2 * changed.get(name)[0]})
        states = ("lambda_2", "lambda_2_rate", "sigma_vis1", "sigma_vis2", "radius")
        assert changed.get(*states) == plain.get(*states)
        for host in (changed, plain):
            host.step(0.1, 0.1)
        assert changed.get("lambda_2") != plain.get("lambda_2")


@pytest.mark.parametrize("kind", [CS, ME])
def test_fixed_parameters_are_refused_once_running(fmu: Path, kind: str) -> None:
    with Host(fmu, kind) as host:
        fixed = [
            v.name
            for v in host.description.modelVariables
            if v.causality == "parameter" and v.variability == "fixed" and v.type in REAL
        ]
        assert set(fixed) == {"l_o", "r_o", "h_o", "h_ao", "rho", "phi", "lambda_2_start"}
        host.initialize()
        for name in fixed:
            with refused(host, name, "fixed parameter", "initialization mode"):
                host.set(**{name: 1.0})
        with refused(host, "n_layers", "fixed parameter"):
            (host.fmu.setInteger if host.version == 2 else host.fmu.setInt32)([host.vr["n_layers"]], [4])
        with refused(host, "start_at_equilibrium", "fixed parameter"):
            host.set_boolean("start_at_equilibrium", True)


@pytest.mark.parametrize("kind", [CS, ME])
def test_calculated_variables_are_refused(fmu: Path, kind: str) -> None:
    with Host(fmu, kind) as host:
        calculated = [
            v.name for v in host.description.modelVariables if v.causality in ("output", "local", "independent")
        ]
        assert len(calculated) == 22
        host.enter()
        for name in calculated:
            with refused(host, name, "calculated by the model"):
                host.set(**{name: 1.0})


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("pressure", np.nan, ["pressure", "finite number in Pa", "nan"]),
        ("voltage", np.inf, ["voltage", "finite number in V", "inf"]),
        ("C_1", -np.inf, ["C_1", "finite", "-inf"]),
        ("C_1", 0.0, ["C_1", "at least 1 Pa", "given 0"]),
        ("eta_1", -5.0, ["eta_1", "at least 1 Pa.s", "given -5"]),
        ("r_o", 0.0, ["r_o", "at least 0.0001 m", "given 0"]),
        ("h_ao", -1e-4, ["h_ao", "at least 1e-08 m", "given -0.0001"]),
        ("phi", 1.5, ["phi", "at most 1", "given 1.5"]),
        ("lambda_2_start", 0.1, ["lambda_2_start", "at least 0.7", "given 0.1"]),
    ],
)
def test_values_out_of_range_change_nothing(fmu: Path, name: str, value: float, words: list[str]) -> None:
    """The bad value comes last, behind two good ones of which nothing must be taken over."""
    with Host(fmu) as host:
        host.enter()
        with refused(host, *words):
            host.set(**{"C_2": -3e4, "C_3": 3e3} | {name: value})
        assert host.get("C_2") == [-32503.2]


def test_integers_out_of_range(fmu: Path) -> None:
    with Host(fmu) as host:
        put = host.fmu.setInteger if host.version == 2 else host.fmu.setInt32
        for value, words in ((0, "at least 1"), (1001, "at most 1000"), (-(2**31), "at least 1")):
            with refused(host, "n_layers", words, f"given {value}"):
                put([host.vr["n_layers"]], [value])


def test_wrong_types_name_the_right_one(fmu: Path) -> None:
    with Host(fmu) as host:
        host.enter()
        put, get = ("setInteger", "getInteger") if host.version == 2 else ("setInt32", "getInt32")
        for function, arguments, words in [
            (put, ([host.vr["pressure"]], [1]), ["pressure", "Real (Float64)", "not Integer (Int32)"]),
            (get, ([host.vr["start_at_equilibrium"]],), ["start_at_equilibrium", "Boolean"]),
            ("getBoolean", ([host.vr["radius"]],), ["radius", "Real (Float64)", "not Boolean"]),
        ]:
            with refused(host, *words):
                getattr(host.fmu, function)(*arguments)
        with refused(host, "n_layers", "of type Integer"):
            host.get("n_layers")


def test_unknown_references_and_null(fmu: Path) -> None:
    with Host(fmu) as host:
        host.initialize()
        before, last = host.saved(), len(host.vr)
        for verb in ("Get", "Set"):
            for reference in (0, last + 1, 4_000_000_000):
                pair = (ctypes.c_uint32 * 2)(host.vr["pressure"], reference)
                assert raw(host, verb, pair, 2, doubles(1.0, 1.0)) == ERROR
                words = f"{verb}{real(host)}: unknown value reference {reference}; expected 1 to {last}"
                assert words in host.messages[-1]
            assert raw(host, verb, None, 2, doubles(1.0, 1.0)) == ERROR
            assert "expected arrays of 2 values but was given NULL" in host.messages[-1]
            assert raw(host, verb, vrs(host, "pressure"), 1, None) == ERROR
            assert raw(host, verb, None, 0, None) == OK
        assert host.saved() == before


def test_null_instances(fmu: Path) -> None:
    """No instance, no crash."""
    with Host(fmu) as host:
        host.initialize()
        component, host.fmu.component = host.fmu.component, None
        assert raw(host, "Get", vrs(host, "pressure"), 1, doubles(0.0)) == ERROR
        assert host.call("Terminate") == ERROR
        host.call("FreeInstance")
        host.fmu.component = component


def test_huge_inputs_end_in_a_message_not_in_nan(fmu: Path) -> None:
    with Host(fmu) as host:
        host.initialize()
        host.set(voltage=1e200)
        with refused(host, "lambda_2 =", "as it was before the step"):
            host.step(0.0, 0.1)
        host.set(voltage=1e308)
        with refused(host, "electric_field is not a finite number", "check inputs and parameters"):
            host.get("electric_field")
        host.set(voltage=0.0)
        host.step(0.0, 0.1)
        assert host.get("lambda_2") == [1.0]


# Instantiation ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "guid", "words"),
    [
        (b"x", ZERO_GUID, ["expected the GUID", ZERO_GUID.decode()]),
        (b"x", None, ["expected the GUID", "NULL"]),
        (b"", b"right", ["instance name"]),
        (b" \t", b"right", ["instance name"]),
        (None, b"right", ["instance name"]),
    ],
)
def test_instantiate_refuses(fmu: Path, name: bytes | None, guid: bytes | None, words: list[str]) -> None:
    with Host(fmu) as host:
        token = host.fmu.guid.encode() if guid == b"right" else guid
        if host.version == 2:
            callbacks = ctypes.byref(host._callbacks)
            component = host.fmu._functions["fmi2Instantiate"](name, 1, token, None, callbacks, 0, 1)
        else:
            component = host.fmu._functions["fmi3InstantiateCoSimulation"](
                name,
                token,
                None,
                False,
                True,
                False,
                False,
                None,
                0,
                None,
                host.fmu.logMessage,
                host.fmu.intermediateUpdate,
            )
        assert not component
        assert all(word in host.messages[-1] for word in words), host.messages
        if token and token != host.fmu.guid.encode():
            assert host.fmu.guid in host.messages[-1], "what was expected"


# Times ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("time", "size", "words"),
    [
        (0.5, 0.0, ["step size", "positive", "given 0"]),
        (0.5, -0.1, ["step size", "positive", "given -0.1"]),
        (0.5, np.nan, ["step size", "finite", "nan"]),
        (0.5, np.inf, ["step size", "finite", "inf"]),
        (0.4, 0.1, ["present time 0.5 s", "given 0.4", "goes back"]),
        (0.6, 0.1, ["present time 0.5 s", "given 0.6", "skips"]),
        (0.5 + 1e-9, 1e-8, ["present time 0.5 s"]),
        (np.nan, 0.1, ["communication point", "nan"]),
        (0.5, 0.6, ["stop time 1 s", "given 1.1"]),
        (0.5, 1e-20, ["1e-20 s is lost in rounding", "time 0.5 s"]),
    ],
)
def test_steps_that_are_refused(fmu: Path, time: float, size: float, words: list[str]) -> None:
    with Host(fmu) as host:
        host.set(pressure=PRESSURE)
        host.initialize(stop=1.0)
        host.step(0.0, 0.5)
        with refused(host, *words):
            host.step(time, size)
        host.step(0.5, 0.5)
        assert host.get("time") == [1.0]


def test_hosts_may_count_time_in_their_own_way(fmu: Path) -> None:
    """Adding up steps drifts from counting them; so does a clock that started long ago."""
    counted = 1e9 + 1e-3 * np.arange(100)
    added = np.cumsum([1e9, *[1e-3] * 99])
    assert np.any(counted != added)
    for times in (counted, added):
        with Host(fmu) as host:
            host.initialize(start=1e9)
            for time in times:
                host.step(time, 1e-3)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"tolerance": -1e-6}, ["tolerance", "positive", "-1e-06"]),
        ({"tolerance": np.nan}, ["tolerance", "nan"]),
        ({"start": np.inf}, ["start time", "finite", "inf"]),
        ({"start": 2.0, "stop": 1.0}, ["stop time", "at least the start time 2", "given 1"]),
        ({"stop": np.nan}, ["stop time", "nan"]),
    ],
)
def test_experiments_that_are_refused(fmu: Path, arguments: dict[str, float], words: list[str]) -> None:
    with Host(fmu) as host, refused(host, *words):
        host.enter(**arguments)


def test_tolerance_out_of_reach_is_a_warning(fmu: Path) -> None:
    with Host(fmu) as host:
        name = "SetupExperiment" if host.version == 2 else "EnterInitializationMode"
        assert host.call(name, 1, 1e-30, 0.0, 0, 0.0) == WARNING
        assert "using 1e-12" in host.messages[-1]


def test_model_exchange_arrays(fmu: Path) -> None:
    with Host(fmu, ME) as host:
        derivatives = "GetDerivatives" if host.version == 2 else "GetContinuousStateDerivatives"
        host.initialize()
        before = host.saved()
        for function, array, n, words in [
            ("SetContinuousStates", doubles(1, 0, 0), 3, "expected 4 values but was given 3"),
            ("SetContinuousStates", None, 4, "NULL"),
            ("SetContinuousStates", doubles(1, 0, np.nan, 0), 4, "sigma_vis1: expected a finite number"),
            ("GetContinuousStates", doubles(0), 1, "expected 4 values but was given 1"),
            (derivatives, None, 4, "NULL"),
            ("GetNominalsOfContinuousStates", doubles(0), 1, "nominal values: expected 4"),
            ("GetEventIndicators", doubles(0), 1, "expected 0 values"),
        ]:
            assert host.call(function, array, n) == ERROR
            assert words in host.messages[-1]
            assert host.saved() == before
        for time in (-1.0, np.nan):
            with refused(host, "time: expected", f"{time:g}"):
                host.fmu.setTime(time)
        assert host.call("SetContinuousStates", doubles(1e200, 0, 0, 0), 4) == OK
        assert host.call(derivatives, doubles(0, 0, 0, 0), 4) == ERROR
        assert "der(lambda_2_rate) is not a finite number" in host.messages[-1]


# Messages ---------------------------------------------------------------------------------------------


def set_logging(host: Host, on: bool, *categories: str) -> int:
    names = (ctypes.c_char_p * len(categories))(*(c.encode() for c in categories))
    return host.call("SetDebugLogging", int(on), len(categories), names)


def test_log_categories(fmu: Path) -> None:
    def told(on: bool, *categories: str) -> str:
        with Host(fmu, logging=False) as host:
            set_logging(host, on, *categories)
            host.initialize()
            host.step(0.0, 0.1)
            return " ".join(host.messages)

    assert "initialized" in told(True)
    assert "internal steps" in told(True)
    assert told(False) == told(True, "logStatusError") == ""
    assert "internal steps" not in told(True, "logEvents")
    assert "initialized" not in told(True, "logSolver")
    assert told(True, "logEvents", "logSolver") == told(True, "logAll") == told(True)
    with Host(fmu) as host:
        assert set_logging(host, True, "logEverything") == ERROR
        assert "log category of modelDescription.xml but was given 'logEverything'" in host.messages[-1]


def test_percent_signs_do_no_harm(fmu: Path) -> None:
    """Loggers of FMI 2 are variadic: what looks like a format must not be taken for one."""
    with Host(fmu) as host:
        category = "%s%n%d"
        assert set_logging(host, True, category) == ERROR
        assert host.messages[-1].replace("%%", "%").endswith(f"'{category}'")


def test_a_step_beyond_the_largest_number_is_refused(fmu: Path) -> None:
    with Host(fmu) as host:
        host.initialize(start=1.5e308)
        with refused(host, "expected an end that is a number but 1.5e+308 s after 1.5e+308 s there is none"):
            host.step(1.5e308, 1.5e308)


# Life --------------------------------------------------------------------------------------------------


def test_reset_gives_a_new_instance(fmu: Path) -> None:
    with Host(fmu) as used, Host(fmu) as new:
        used.set(pressure=PRESSURE, C_1=3e5, l_o=0.03)
        used.initialize(tolerance=1e-4, start=3.0)
        used.step(3.0, 0.1)
        used.fmu.reset()
        assert used.saved() == new.saved()


def test_no_rest_state_is_an_error_that_can_be_mended(fmu: Path) -> None:
    with Host(fmu) as host:
        host.set_boolean("start_at_equilibrium", True)
        host.set(pressure=30000.0, voltage=7000.0)
        host.enter()
        with refused(host, "no rest state", "the load was 30000", "start at equilibrium"):
            host.get("radius")
        with refused(host, "no rest state"):
            host.fmu.exitInitializationMode()
        with refused(host, "no rest state"):
            host.derivative(["radius"], ["pressure"], [1.0])
        assert host.get("pressure") == [30000.0], "inputs can still be read"
        host.set(pressure=PRESSURE)
        host.fmu.exitInitializationMode()
        assert host.get("radius")[0] == pytest.approx(20.52e-3, abs=5e-6)
