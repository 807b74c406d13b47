"""The batch kernel: the scalar kernel's numbers, the same bits in any company, failures as rows."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from scenarios import CASES, MMHG, case
from tubular_dea.kernel import Kernel, KernelError
from tubular_dea.kernel.batch import Batch, Breakpoints, Probe
from tubular_dea.model.dea import tubular_dea
from tubular_dea.plants.effects import with_effects
from tubular_dea.protocol import Protocol
from tubular_dea.sweep.models import assisted_heart

THRESHOLD = 16.5e-3  # m
PROBES = (
    Probe("final", "lambda_2"),
    Probe("max", "lambda_2"),
    Probe("max", "radial_displacement"),
    Probe("mean", "radius"),
    Probe("min", "snap_through_margin"),
    Probe("at", "lambda_2", 2.5),
    Probe("rise", "radius", None, THRESHOLD),
    Probe("rise", "beyond_fold"),
    Probe("mean", "lambda_2", 2.0),
)


@pytest.fixture(scope="module")
def batch() -> Batch:
    return Batch(tubular_dea(), PROBES)


def breakpoints(inputs: dict[str, list[float]]) -> dict[str, Breakpoints]:
    time = np.array([inputs["time"]])
    return {name: Breakpoints(time, np.array([inputs[name]])) for name in ("pressure", "voltage")}


def steps(rows: int) -> dict[str, Breakpoints]:
    """Another step for every row: pressure, voltage and on-time vary."""
    part = np.linspace(0, 1, rows)[:, None]
    on, voltage = 0.2 + 0.3 * part, 6e3 * part[::-1]
    pressure = Breakpoints(np.zeros((1, 1)), 100 * MMHG * part)
    return {"pressure": pressure, "voltage": Breakpoints(np.hstack([on, on]), np.hstack([0 * voltage, voltage]))}


@pytest.mark.parametrize("name", CASES)
def test_reduced_in_c_as_from_a_dense_trajectory(name: str, batch: Batch, kernel: Kernel) -> None:
    reference = case(name)
    found = batch.trajectories(1, {}, breakpoints(reference.inputs), reference.stop, 1e-8)
    assert found.status[0] == 0
    times = np.union1d(np.linspace(0, reference.stop, 40001), [2.0, 2.5])
    dense = kernel.simulate(Protocol.of(**reference.inputs), times, tolerance=1e-9, with_fold=True)
    lambda_2, radius = dense["lambda_2"], dense["radius"]
    late = times >= 2.0
    beyond = Batch(tubular_dea(), [Probe("final", "fold_place")]).rest(
        1, {}, {"voltage": reference.inputs["voltage"][-1]}
    )
    snapped = lambda_2[-1] > beyond.values[0, 0]
    expected = [
        lambda_2[-1],
        lambda_2.max(),
        dense["radial_displacement"].max(),
        np.trapezoid(radius, times) / reference.stop,
        dense["snap_through_margin"].min(),
        lambda_2[times == 2.5][0],
        times[np.argmax(radius >= THRESHOLD)],
    ]
    scale = [1, 1, 0.015, 0.015, 100, 1, 100]
    np.testing.assert_array_less(np.abs(found.values[0, :7] - expected) / scale, 4e-6)
    assert np.isfinite(found.values[0, 7]) == snapped
    assert found.values[0, 8] == pytest.approx(
        np.trapezoid(lambda_2[late], times[late]) / (reference.stop - 2.0), abs=2e-6
    )


def test_the_same_bits_in_any_company(batch: Batch) -> None:
    rows, values = 37, steps(37)
    whole = batch.trajectories(rows, {}, values, 1.0)

    def some(chosen: np.ndarray) -> np.ndarray:
        v = values["voltage"]
        inputs = {
            "pressure": Breakpoints(values["pressure"].time, values["pressure"].value[chosen]),
            "voltage": Breakpoints(v.time[chosen], v.value[chosen]),
        }
        return batch.trajectories(chosen.size, {}, inputs, 1.0).values

    for chosen in (np.array([5]), np.arange(36, -1, -1), np.arange(8, 24), np.array([3, 3, 3])):
        np.testing.assert_array_equal(some(chosen), whole.values[chosen])
    with ThreadPoolExecutor(4) as pool:
        pieces = list(pool.map(some, np.array_split(np.arange(rows), 9)))
    np.testing.assert_array_equal(np.concatenate(pieces), whole.values)


def test_failures_are_rows_among_others(batch: Batch) -> None:
    pressure = np.array([[95.0], [250.0], [95.0], [np.nan]]) * MMHG
    inputs = {"pressure": Breakpoints(np.zeros((1, 1)), pressure)}
    found = batch.trajectories(
        4, {"start_at_equilibrium": np.array([1.0, 1.0, 0.0, 0.0])}, inputs, np.full((4, 1), 1.0)
    )
    assert found.status.tolist() == [0, -1, 0, 3]
    assert np.isnan(found.values[[1, 3]]).all()
    assert "no rest state" in found.message(1)
    assert "no step size" in found.message(3)
    assert found.message(0) == ""


def test_rest_states_are_on_the_curve(kernel: Kernel) -> None:
    probes = [Probe("final", "lambda_2"), Probe("final", "snap_through_pressure"), Probe("final", "fold_place")]
    batch = Batch(tubular_dea(), probes)
    voltage = np.array([0.0, 4e3, 5e3, 5.5e3, 6e3, 7e3])
    found = batch.rest(6, {}, {"pressure": 95 * MMHG, "voltage": voltage})
    np.testing.assert_allclose(15 * found.values[:, 0], [17.82, 18.40, 18.80, 19.07, 19.41, 20.52], atol=0.006)
    np.testing.assert_allclose(found.values[:, 1] / MMHG, [170.4, 147, 135, 128, 121, 104.6], atol=0.6)
    np.testing.assert_allclose(15 * found.values[:, 2], [25.6, 24.5, 24.0, 23.8, 23.5, 23.0], atol=0.06)


def test_delayed_inputs_are_shifted(kernel: Kernel) -> None:
    model = with_effects(tubular_dea(), ["pressure_delay"])
    reference = case("step_4kV")
    late = np.array([0.0, 0.04])
    found = Batch(model, [Probe("at", "lambda_2", 0.53)]).trajectories(
        2, {"pressure_delay": late}, breakpoints(reference.inputs), 1.0, 1e-8
    )
    for delay, value in zip(late, found.values[:, 0], strict=True):
        alone = Kernel(model).simulate(
            Protocol.of(**reference.inputs), np.array([0.53]), {"pressure_delay": delay}, 1e-8
        )
        assert value == pytest.approx(alone["lambda_2"][0], abs=1e-6)


def test_a_composed_model_is_a_model() -> None:
    model = assisted_heart()
    probes = [
        Probe("final", "tube_lambda_2"),
        Probe("mean", "heart_aortic_pressure", 0.8),
        Probe("max", "heart_aortic_flow"),
    ]
    time, volts = np.array([[0.1, 0.1, 0.4, 0.4]]), np.array([[0.0, 4e3, 4e3, 0.0]])
    found = Batch(model, probes).trajectories(3, {}, {"tube_voltage": Breakpoints(time, volts)}, 1.6, 1e-8)
    assert found.status.tolist() == [0, 0, 0]
    protocol = Protocol.of([0, 0.1, 0.1, 0.4, 0.4, 1.6], tube_voltage=[0, 0, 4e3, 4e3, 0, 0])
    dense = Kernel(model).simulate(protocol, np.linspace(0, 1.6, 16001), tolerance=1e-9)
    late = dense.time >= 0.8
    assert found.values[0, 0] == pytest.approx(dense["tube_lambda_2"][-1], abs=1e-6)
    assert found.values[0, 1] == pytest.approx(
        np.trapezoid(dense["heart_aortic_pressure"][late], dense.time[late]) / 0.8, rel=1e-5
    )
    assert found.values[0, 2] == pytest.approx(1.1080188e-3, rel=1e-6), "a peak between samples"


def test_unknown_variables_have_near_names() -> None:
    with pytest.raises(KernelError, match="no variable 'radios'; did you mean radius"):
        Batch(tubular_dea(), [Probe("final", "radios")])
    with pytest.raises(KernelError, match="is delayed"):
        Batch(with_effects(tubular_dea(), ["sensor_delay"]), [Probe("final", "measured_displacement")])
