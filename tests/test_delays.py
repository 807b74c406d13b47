"""Delay lines: the FMUs and the kernel tell the same past, states carry it, and what cannot work is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drivers import ME, Host
from tubular_dea.export.package import native_fmu
from tubular_dea.kernel import Kernel
from tubular_dea.model.dea import tubular_dea
from tubular_dea.model.declare import DeclarationError, Delay, Quantity
from tubular_dea.model.delays import undelayed
from tubular_dea.plants.effects import with_effects
from tubular_dea.protocol import Protocol

DELAYS = {"pressure_delay": 0.0123, "sensor_delay": 0.0371}
STEP = 0.004
TIGHT = 1e-9


@pytest.fixture(scope="module")
def late():
    return with_effects(tubular_dea(), ["pressure_delay", "sensor_delay"])


@pytest.fixture(scope="module")
def late_kernel(late) -> Kernel:
    return Kernel(late)


@pytest.fixture(scope="module", params=[2, 3], ids=["fmi2", "fmi3"])
def late_fmu(request, late, tmp_path_factory) -> Path:
    return native_fmu(late, request.param, tmp_path_factory.mktemp("late") / f"Late{request.param}.fmu")


def recorded(seed: int = 1, n: int = 251) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, pressures at them, and voltages from them on: a ramp with noise, and steps of the voltage."""
    rng = np.random.default_rng(seed)
    time = STEP * np.arange(n)
    pressure = 1.2e4 * np.minimum(1, time / 0.4) + 25 * rng.standard_normal(n)
    voltage = np.where((time > 0.5) & (time < 0.8), 5e3, 0.0) + 4 * rng.standard_normal(n)
    return time, pressure, voltage


def held(time: np.ndarray, *columns: np.ndarray) -> Protocol:
    """Every input held from its sample to the next."""
    names = ("pressure", "voltage")
    grid = np.repeat(time, 2)[1:]
    return Protocol.of(grid, **{n: np.repeat(c, 2)[:-1] for n, c in zip(names, columns, strict=True)})


def straight(time: np.ndarray, pressure: np.ndarray, voltage: np.ndarray) -> Protocol:
    """Pressure straight from sample to sample, voltage held."""
    return Protocol.of(np.repeat(time, 2)[1:], pressure=np.repeat(pressure, 2)[1:], voltage=np.repeat(voltage, 2)[:-1])


def run(
    host: Host, time: np.ndarray, pressure: np.ndarray, voltage: np.ndarray, slopes: bool = False, first: int = 0
) -> np.ndarray:
    """lambda_2 and the measured displacement at the samples from `first` on."""
    seen = [host.get("lambda_2", "measured_displacement")]
    for i in range(first, time.size - 1):
        host.set(pressure=pressure[i], voltage=voltage[i])
        if slopes:
            host.set_input_derivatives([(pressure[i + 1] - pressure[i]) / (time[i + 1] - time[i]), 0.0])
        host.step(time[i], time[i + 1] - time[i])
        seen.append(host.get("lambda_2", "measured_displacement"))
    return np.array(seen)


def started(path: Path, delays: dict[str, float], u: tuple[float, float]) -> Host:
    host = Host(path)
    host.set(pressure=u[0], voltage=u[1], **delays)
    host.initialize(tolerance=TIGHT)
    return host


@pytest.mark.parametrize("delays", [{}, DELAYS, {"pressure_delay": 0.012}, {"sensor_delay": 0.3}], ids=str)
def test_fmu_and_kernel_agree(delays, late_fmu, late_kernel) -> None:
    time, pressure, voltage = recorded()
    expected = late_kernel.simulate(held(time, pressure, voltage), time, delays, TIGHT)
    with started(late_fmu, delays, (pressure[0], voltage[0])) as host:
        seen = run(host, time, pressure, voltage)
    assert np.max(np.abs(seen[:, 0] - expected["lambda_2"])) < 1e-7
    assert np.max(np.abs(seen[:, 1] - expected["measured_displacement"])) < 1e-9


def test_interpolated_inputs_are_delayed_exactly(late, late_kernel, tmp_path) -> None:
    time, pressure, voltage = recorded()
    expected = late_kernel.simulate(straight(time, pressure, voltage), time, DELAYS, TIGHT)
    path = native_fmu(late, 2, tmp_path / "Late.fmu")
    with started(path, DELAYS, (pressure[0], voltage[0])) as host:
        seen = run(host, time, pressure, voltage, slopes=True)
    assert np.max(np.abs(seen[:, 0] - expected["lambda_2"])) < 1e-7
    assert np.max(np.abs(seen[:, 1] - expected["measured_displacement"])) < 1e-9


def test_saved_states_carry_the_past(late_fmu) -> None:
    time, pressure, voltage = recorded()
    with started(late_fmu, DELAYS, (pressure[0], voltage[0])) as host:
        run(host, time[:120], pressure, voltage)
        saved = host.saved()
        going_on = run(host, time, pressure, voltage, first=119)
        host.restore(saved)
        again = run(host, time, pressure, voltage, first=119)
    assert np.array_equal(going_on, again)


def test_short_communication_steps_do_not_outgrow_the_memory(late_fmu, late_kernel) -> None:
    """0.5 s of delay in steps of 0.1 ms: more steps than the line keeps, which is then kept at half the resolution."""
    delays = {"pressure_delay": 0.5, "sensor_delay": 0.5}
    time = 1e-4 * np.arange(9001)
    pressure, voltage = 1e4 * np.minimum(1, time / 0.1), np.full(time.size, 3e3)
    marks = np.arange(0, time.size, 100)
    expected = late_kernel.simulate(held(time, pressure, voltage), time[marks], delays, 1e-7)
    with started(late_fmu, delays, (pressure[0], voltage[0])) as host:
        size = len(host.saved())
        seen = run(host, time, pressure, voltage)[marks]
        assert len(host.saved()) == size
    assert np.max(np.abs(seen[:, 1] - expected["measured_displacement"])) < 1e-6
    assert np.max(np.abs(seen[:, 0] - expected["lambda_2"])) < 1e-4


def test_directional_derivatives_see_a_delay(late_fmu) -> None:
    time, pressure, voltage = recorded()
    with started(late_fmu, {}, (pressure[0], voltage[0])) as host:
        run(host, time[:100], pressure, voltage)
        assert host.derivative(["der(lambda_2_rate)"], ["pressure"], [1.0])[0] > 0
        assert host.derivative(["measured_displacement"], ["lambda_2"], [1.0])[0] == pytest.approx(15e-3)
    with started(late_fmu, DELAYS, (pressure[0], voltage[0])) as host:
        run(host, time[:100], pressure, voltage)
        assert host.derivative(["der(lambda_2_rate)"], ["pressure"], [1.0])[0] == 0
        assert host.derivative(["measured_displacement"], ["lambda_2"], [1.0])[0] == 0


def test_model_exchange_is_refused(late_fmu) -> None:
    host = Host(late_fmu)
    assert host.description.modelExchange is None
    with pytest.raises(Exception, match="instantiate"):
        Host(late_fmu, ME)


def test_a_delay_before_the_start_is_level(late_kernel) -> None:
    protocol = Protocol.of([0, 1], pressure=[1e4, 2e4], voltage=[0, 0])
    delayed = protocol.delayed({"late": ("pressure", 0.25)})
    assert np.allclose(delayed.at(np.array([0.0, 0.2, 0.25, 0.5, 1.0]))["late"], [1e4, 1e4, 1e4, 1.25e4, 1.75e4])
    jump = Protocol.of([0, 0.5, 0.5, 1], pressure=[0, 0, 1, 1]).delayed({"late": ("pressure", 0.25)})
    assert np.array_equal(jump.at(np.array([0.5, 0.74, 0.75, 0.8]))["late"], [0, 0, 1, 1])
    assert np.array_equal(jump.at(np.array([0.49, 0.5]))["pressure"], [0, 1])


def test_a_delay_leaves_breakpoints_where_an_input_bends_or_jumps_alone() -> None:
    rng = np.random.default_rng(3)
    curve, edges = np.sort(rng.uniform(0, 100, 400)), np.sort(rng.uniform(1, 99, 10))
    grid = np.sort(np.concatenate([[0.0, 100.0], curve, edges, edges]))
    behind = np.append(False, np.diff(grid) == 0)
    passed = np.where(behind, np.searchsorted(edges, grid, "right"), np.searchsorted(edges, grid))
    voltage = 5e3 * (passed % 2)
    late = 0.0137
    pressure = np.interp(grid, curve, 1e4 + 50 * rng.standard_normal(curve.size))
    protocol = Protocol.of(grid, pressure=pressure, voltage=voltage)
    moved = protocol.with_delay("voltage", late).with_delay("pressure", -2 * late).with_delay("pressure", late)
    assert moved.time.size < grid.size + 60
    times = rng.uniform(1, 98, 5000)
    assert np.allclose(moved.at(times)["pressure"], protocol.at(times + late)["pressure"], rtol=1e-12, atol=0)
    assert np.array_equal(moved.at(times)["voltage"], protocol.at(times - late)["voltage"])
    assert np.array_equal(moved.jumps, np.unique(protocol.jumps + late))


def test_a_slow_curve_keeps_its_breakpoints() -> None:
    time = np.linspace(0, 1000, 100_001)  # of a sine of 1000 s no three samples are on a line by more than 5e-10
    slow = Protocol.of(time, pressure=1e4 + 1e3 * np.sin(2 * np.pi * time / 1000))
    assert np.allclose(slow.simplified().at(time)["pressure"], slow.inputs["pressure"], rtol=1e-9, atol=0)
    straight = Protocol.of(time, pressure=7.0 * time, voltage=0 * time).simplified()
    assert straight.time.tolist() == [0.0, 1000.0]


def test_declarations_that_mean_nothing_are_refused() -> None:
    base = tubular_dea()
    quantity = Quantity("late", "Pa", "Late")
    with pytest.raises(DeclarationError, match="expected an input or a definition"):
        base.extend(delays=[Delay(quantity, of="presure", by="C_1")])
    with pytest.raises(DeclarationError, match="bounds of the delay"):
        base.extend(delays=[Delay(quantity, of="pressure", by="C_1")])
    late = with_effects(base, ["sensor_delay"])
    with pytest.raises(DeclarationError, match="drives a state"):
        late.replace("lambda_2_acceleration", late.expression("lambda_2_acceleration") + late["delayed_reading"])
    mixed = late.replace("measured_displacement", late["delayed_reading"] + late["radial_displacement"])
    with pytest.raises(DeclarationError, match="mixes"):
        undelayed(mixed)
