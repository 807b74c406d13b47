"""The numbers behind the interface: steps, tolerances, derivatives, rest states, fold, energy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import independent
from drivers import CS, ME, Host
from independent import PARAMETERS, trajectory
from refusals import doubles, refused

PRESSURE = 12665.59  # Pa, 95 mmHg
KNOWN_AT_START = [
    "pressure",
    "voltage",
    "C_1",
    "C_2",
    "C_3",
    "eps_r",
    "eta_o",
    "k_1",
    "eta_1",
    "k_2",
    "eta_2",
    "l_o",
    "r_o",
    "h_o",
    "h_ao",
    "rho",
    "phi",
    "lambda_2_start",
]
KNOWN_WHILE_RUNNING = KNOWN_AT_START[:11]
TERMS = {"der(lambda_2_rate)": 1e4}  # 1/s2, the size of what cancels in it at rest
STATES = ["lambda_2", "lambda_2_rate", "sigma_vis1", "sigma_vis2"]


# Steps and tolerances -------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("step", [1e-5, 1e-4, 1e-3, 1e-2, 0.1])
def test_communication_step_does_not_matter(fmu: Path, step: float) -> None:
    """Pressure from the start, voltage at 0.1 s: the same at 0.2 s for steps of 10 us to 0.1 s."""
    with Host(fmu) as host:
        host.set(pressure=PRESSURE)
        host.initialize()
        n = round(0.1 / step)
        for i in range(2 * n):
            if i == n:
                host.set(voltage=4000.0)
            host.step(i * step, step)
        found = host.get("lambda_2", "lambda_2_rate")
    protocol = {"time": [0, 0.1, 0.1, 0.2], "pressure": [PRESSURE] * 4, "voltage": [0, 0, 4000, 4000]}
    exact = trajectory(protocol, [0.0, 0.2])
    assert found[0] == pytest.approx(exact["lambda_2"][-1], abs=1e-6)
    assert found[1] == pytest.approx(exact["lambda_2_rate"][-1], abs=1e-4)


@pytest.mark.parametrize("start", [1e6, 1.7e9], ids=["days", "since 1970"])
def test_a_clock_that_started_long_ago(fmu: Path, start: float) -> None:
    """Inputs that jump every millisecond, while the clock resolves 0.1 ns, or a quarter of a microsecond."""
    found = []
    for begin in (0.0, start):
        with Host(fmu) as host:
            host.initialize(start=begin)
            for i in range(1000):
                host.set(pressure=PRESSURE + 3e3 * np.sin(i / 100), voltage=4e3 + 1e3 * np.cos(i / 50))
                host.step(begin + i * 1e-3, 1e-3)
            found.append(host.get("lambda_2")[0])
    assert found[0] == pytest.approx(found[1], abs=1e-8 if start < 1e7 else 1e-4)


def test_error_follows_the_tolerance(fmu: Path) -> None:
    exact = trajectory({"time": [0, 1], "pressure": [PRESSURE] * 2, "voltage": [5000] * 2}, [0, 1])["lambda_2"][-1]
    errors = []
    for tolerance in (1e-2, 1e-4, 1e-6, 1e-8, 1e-10):
        with Host(fmu) as host:
            host.set(pressure=PRESSURE, voltage=5000.0)
            host.initialize(tolerance=tolerance)
            host.step(0.0, 1.0)
            errors.append(abs(host.get("lambda_2")[0] - exact))
            assert errors[-1] < 10 * tolerance
    assert errors[0] > 10 * errors[2] > 0
    assert errors[2] > 10 * errors[4]


# Rest states and the fold -----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [CS, ME])
@pytest.mark.parametrize(("pressure", "voltage"), [(0, 0), (PRESSURE, 0), (PRESSURE, 7000), (-2000, 0), (19000, -4000)])
def test_start_at_equilibrium(fmu: Path, kind: str, pressure: float, voltage: float) -> None:
    with Host(fmu, kind) as host:
        host.set_boolean("start_at_equilibrium", True)
        host.set(pressure=pressure, voltage=voltage)
        host.initialize()
        expected = independent.equilibrium_radius(pressure, abs(voltage))
        assert host.get("radius") == [pytest.approx(expected, rel=1e-12)]
        assert host.get("lambda_2_rate", "sigma_vis1", "sigma_vis2", "tube_flow", "current") == [0.0] * 5
        assert host.get("der(lambda_2_rate)") == [pytest.approx(0.0, abs=1e-6)]
        if kind == CS:
            host.step(0.0, 1.0)
            assert host.get("radius") == [pytest.approx(expected, rel=1e-9)]


def test_snap_through_pressure(fmu: Path) -> None:
    """At every voltage, after parameters change, and whatever was asked before it."""
    with Host(fmu) as host:
        host.set(pressure=1000.0)
        host.initialize()
        for voltage in (0.0, 2500.0, 4000.0, 5500.0, 7000.0, -7000.0):
            host.set(voltage=voltage)
            expected = independent.fold(abs(voltage))[1]
            assert host.get("radius") == [0.015]
            host.derivative(["snap_through_margin"], ["voltage"], [1.0])
            assert host.get("snap_through_margin") == [pytest.approx(expected - 1000.0, rel=1e-10)]
            assert host.get("snap_through_pressure") == [pytest.approx(expected, rel=1e-10)]
        host.set(C_1=4e5, voltage=4000.0)
        softer = independent.fold(4000.0, dict(PARAMETERS, C_1=4e5))[1]
        assert host.get("snap_through_pressure") == [pytest.approx(softer, rel=1e-10)]


def test_fold_is_computed_on_demand_only(fmu: Path) -> None:
    """At an absurd voltage there is none, and only those who ask for it hear so."""
    with Host(fmu) as host:
        host.initialize()
        host.set(voltage=1e200)
        assert host.get("radius", "pressure") == [0.015, 0.0]
        with pytest.raises(Exception, match="GetReal|GetFloat64"):
            host.get("snap_through_pressure")
        assert "snap_through_pressure is not a finite number" in host.messages[-1]


# Directional derivatives ----------------------------------------------------------------------------


def check_derivatives(host: Host, known: list[str], shifted) -> None:
    """All unknowns along each known against central differences; `shifted(name, value)` gives the unknowns there."""
    unknown = [
        v.name
        for v in host.description.modelVariables
        if v.causality == "output" or v.derivative is not None or v.name in STATES
    ]
    assert len(unknown) == 21
    values = dict(zip(unknown, host.get(*unknown), strict=True))
    given = dict(zip(known, host.get(*known), strict=True))
    for name in known:
        exact = host.derivative(unknown, [name], [1.0])
        h = 1e-5 * max(abs(given[name]), 1e-3)
        high, low = shifted(unknown, name, given[name] + h), shifted(unknown, name, given[name] - h)
        estimate = (np.array(high) - np.array(low)) / (2 * h)
        for i, output in enumerate(unknown):
            size = max(abs(values[output]), TERMS.get(output, 0.0))
            allowed = 1e-6 * abs(exact[i]) + 2e-13 * size / h + 1e-9 * size / max(abs(given[name]), 1e-3)
            assert abs(exact[i] - estimate[i]) <= allowed, f"d {output} / d {name}: {exact[i]} but {estimate[i]}"


@pytest.mark.parametrize("kind", [CS, ME])
@pytest.mark.parametrize("rest", [False, True], ids=["given start", "rest"])
def test_derivatives_at_initialization(fmu: Path, kind: str, rest: bool) -> None:
    """With a start at rest, states follow inputs and parameters: the implicit function theorem."""
    with Host(fmu, kind) as host:
        host.set_boolean("start_at_equilibrium", rest)
        host.set(pressure=PRESSURE, voltage=5000.0, lambda_2_start=1.1, phi=0.8)
        host.enter()

        def shifted(unknown: list[str], name: str, value: float) -> list[float]:
            old = host.get(name)[0]
            host.set(**{name: value})
            values = host.get(*unknown)
            host.set(**{name: old})
            return values

        check_derivatives(host, KNOWN_AT_START, shifted)


@pytest.mark.parametrize("kind", [CS, ME])
def test_derivatives_while_running(fmu: Path, kind: str) -> None:
    with Host(fmu, kind) as host:
        host.set(pressure=PRESSURE, voltage=5000.0)
        host.enter()
        host.fmu.exitInitializationMode()
        if kind == CS:
            host.step(0.0, 0.02)
        else:
            host.fmu.enterContinuousTimeMode()
            move(host, [1.3, 2.0, 4e4, 1e4])
            host.fmu.enterEventMode()
        before = host.saved()

        def shifted(unknown: list[str], name: str, value: float) -> list[float]:
            if name in STATES:
                x = [value if s == name else old for s, old in zip(STATES, host.get(*STATES), strict=True)]
                host.fmu.enterContinuousTimeMode()
                move(host, x)
            else:
                host.set(**{name: value})
            values = host.get(*unknown)
            host.restore(before)
            return values

        check_derivatives(host, KNOWN_WHILE_RUNNING + (STATES if kind == ME else []), shifted)


def move(host: Host, x: list[float]) -> None:
    """Set the continuous states."""
    host.fmu.setContinuousStates(doubles(*x), 4)


def test_derivatives_are_linear_in_the_seed(fmu: Path) -> None:
    with Host(fmu) as host:
        host.set(pressure=PRESSURE, voltage=5000.0)
        host.initialize()
        host.step(0.0, 0.1)
        unknown, known = ["current", "snap_through_margin", "der(lambda_2_rate)"], ["voltage", "eps_r", "sigma_vis1"]
        parts = [s * host.derivative(unknown, [k], [1.0]) for k, s in zip(known, (3.0, -0.5, 7.0), strict=True)]
        np.testing.assert_allclose(host.derivative(unknown, known, [3.0, -0.5, 7.0]), sum(parts), rtol=1e-12)


@pytest.mark.parametrize(
    ("unknown", "known", "words"),
    [
        ("pressure", "voltage", "unknown 0 but was given"),
        ("C_1", "voltage", "(C_1)"),
        ("radius", "charge", "known 0 but"),
        ("radius", "n_layers", "(n_layers)"),
        ("radius", "der(lambda_2)", "(der(lambda_2))"),
    ],
)
def test_derivatives_that_do_not_exist(fmu: Path, unknown: str, known: str, words: str) -> None:
    with Host(fmu) as host:
        host.initialize()
        with refused(host, "partial derivatives", words):
            host.derivative([unknown], [known], [1.0])
        with refused(host, "not a finite number"):
            host.derivative(["radius"], ["lambda_2"], [np.nan])


def test_output_derivatives(fmu: Path) -> None:
    """Against differences along the trajectory, with inputs held as they are."""
    with Host(fmu) as host:
        host.set(pressure=PRESSURE, voltage=5000.0)
        host.initialize(tolerance=1e-11)
        host.step(0.0, 0.5)
        outputs = [v.name for v in host.description.modelVariables if v.causality == "output"]
        exact, h, values = host.output_derivatives(*outputs), 1e-5, [host.get(*outputs)]
        for i in range(2):
            host.step(0.5 + i * h, h)
            values.append(host.get(*outputs))
        y = np.array(values)
        estimate = (-3 * y[0] + 4 * y[1] - y[2]) / (2 * h)
        assert np.all(np.abs(exact - estimate) <= 1e-4 * np.abs(exact) + 1e-15 * np.abs(y[0]) / h)
        assert exact[outputs.index("snap_through_pressure")] == 0


def test_output_derivatives_of_moving_inputs(fmi2_fmu: Path) -> None:
    with Host(fmi2_fmu) as host:
        host.set(pressure=PRESSURE, voltage=5000.0)
        host.initialize()
        host.set_input_derivatives([1e4, 2e5])
        field, margin, fold = host.output_derivatives("electric_field", "snap_through_margin", "snap_through_pressure")
        assert field == pytest.approx(2e5 / 100e-6)
        slope = (independent.fold(5000.5)[1] - independent.fold(4999.5)[1]) * 2e5
        assert fold == pytest.approx(slope, rel=1e-6)
        assert margin == pytest.approx(slope - 1e4, rel=1e-6)


# Energy, volume, charge ---------------------------------------------------------------------------------


def recorded(fmu: Path, names: list[str], steps: int, size: float) -> np.ndarray:
    """`names` during a jump to 95 mmHg at a constant 4 kV, from lambda_2 = 1."""
    with Host(fmu) as host:
        host.set(pressure=PRESSURE, voltage=4000.0)
        host.initialize(tolerance=1e-9)
        rows = [host.get(*names)]
        for i in range(steps):
            host.step(i * size, size)
            rows.append(host.get(*names))
    return np.array(rows).T


def test_energy_and_volume_balance(fmu: Path) -> None:
    """Work of the pressure = kinetic energy + stored in the wall + taken by the Maxwell branches and the damper.

    What the wall stores at constant voltage is the integral of the static pressure over volume. Everything but the
    recorded flow, stretch and stresses comes from the independent model.
    """
    from scipy.integrate import quad, simpson

    size = 5e-5
    names = ["tube_flow", "tube_volume", "lambda_2", "lambda_2_rate", "sigma_vis1", "sigma_vis2"]
    flow, volume, stretch, rate, branch_1, branch_2 = recorded(fmu, names, 6000, size)
    par, radius = PARAMETERS, PARAMETERS["r_o"] * stretch
    np.testing.assert_allclose(volume, independent.tube_volume(radius), rtol=1e-12)
    assert simpson(flow, dx=size) == pytest.approx(volume[-1] - volume[0], rel=1e-6)

    def elastic(x: float) -> float:
        area = independent.inner_surface(np.array([par["r_o"] * x]))[0]
        return independent.static_pressure(x, 4000.0) * area * par["r_o"]

    u = independent.slope(stretch, par)
    lambda_1 = np.hypot(1, u)
    rate_1 = par["r_o"] / par["l_o"] * u / lambda_1 * rate
    viscous = (branch_1 + branch_2 + par["eta_o"] * rate_1) * 4 * np.pi * par["r_o"] * par["h_o"] * par["l_o"]
    taken = simpson(viscous * rate_1 / lambda_1, dx=size)
    kinetic = independent.mass() * (par["r_o"] * rate[-1]) ** 2 / 2
    stored = quad(elastic, 1.0, stretch[-1], epsabs=1e-14)[0]
    work = PRESSURE * simpson(flow, dx=size)
    assert taken > 0.01 * work, "the damping is no rounding error"
    assert work == pytest.approx(kinetic + stored + taken, rel=1e-6)


def test_current_integrates_to_charge(fmi2_fmu: Path) -> None:
    """Along ramps of both inputs; the current is right at both ends of every step."""
    with Host(fmi2_fmu) as host:
        host.set_boolean("start_at_equilibrium", True)
        host.set(pressure=PRESSURE, voltage=1000.0)
        host.initialize(tolerance=1e-9)
        size, total, first = 1e-4, 0.0, host.get("charge")[0]
        for i in range(2000):
            slope = 2e4 if i < 1000 else -5e3
            host.set_input_derivatives([-1e4, slope])
            start = host.get("current")[0]
            host.step(i * size, size)
            total += (start + host.get("current")[0]) / 2 * size
        assert host.get("voltage") == [pytest.approx(1000 + 2000 - 500)]
        assert total == pytest.approx(host.get("charge")[0] - first, rel=1e-4)
