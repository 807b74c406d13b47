"""The peers solve the right problem: a benchmark against a wrong one would prove nothing."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import peers
from peers import tube

on_linux = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="the CVODE peer uses FMPy's SUNDIALS for Linux"
)
STATES = [(1.0, 0.1, 0.0, 0.0), (1.3, 0.2, 5e3, -1e3), (0.95, -2.0, 10.0, 20.0), (2.5, 0.4, 7e5, 6e5)]


@pytest.mark.parametrize("x", STATES)
def test_python_tube(x: tuple) -> None:
    """Inputs as lines: 10 kPa and 1 kV at 1 s, rising by 1 kPa and 2 kV a second, taken at 3 s."""
    dx = peers.python_rhs()(3.0, np.array(x), 1.0, 10e3, 1e3, 1e3, 2e3)
    np.testing.assert_allclose(dx, tube.rhs(0.0, x, 12e3, 5e3), rtol=1e-12, atol=1e-9)


@on_linux
@pytest.mark.parametrize("x", STATES)
def test_c_tube(x: tuple) -> None:
    driver, state = peers.cvode_library(), np.array(x)
    dx, by_column = np.empty(4), np.empty((4, 4))
    driver.tube_rhs(state.ctypes.data, 12e3, 5e3, dx.ctypes.data)
    driver.tube_jacobian(state.ctypes.data, 12e3, 5e3, by_column.ctypes.data)
    np.testing.assert_allclose(dx, tube.rhs(0.0, x, 12e3, 5e3), rtol=1e-12, atol=1e-9)
    expected = tube.jacobian(x, 12e3, 5e3)
    np.testing.assert_allclose(by_column.T, expected, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("solve", [peers.solve_lsoda, pytest.param(peers.solve_cvode, marks=on_linux)])
@pytest.mark.parametrize("name", ["step_4kV", "ramp_7kV_snap_through"])
def test_peers_reproduce_the_trace(solve: peers.Solve, name: str) -> None:
    protocol, times = peers.experiment(name)
    trace = np.loadtxt(peers.REFERENCE / name / "reference.csv", delimiter=",", skiprows=1)
    lambda_2 = solve(protocol, times, 1e-9)
    np.testing.assert_allclose(lambda_2, trace[:, 4], rtol=0, atol=1e-7)


@pytest.mark.long
@pytest.mark.parametrize("solve", [peers.solve_lsoda, pytest.param(peers.solve_cvode, marks=on_linux)])
def test_peers_sample_anywhere(solve: peers.Solve) -> None:
    """Samples off the corners and not up to the end of the protocol."""
    protocol, _ = peers.experiment("step_4kV")
    times = np.array([0.37, 1.0, 2.5, 11.99])
    expected = tube.trajectory(protocol, times)["lambda_2"]
    np.testing.assert_allclose(solve(protocol, times, 1e-9), expected, rtol=0, atol=1e-7)


def test_seconds_at_error_lies_on_the_line_between_its_neighbours() -> None:
    points = [(1e-4, 1.0), (1e-6, 4.0), (1e-8, 16.0), (1e-5, 50.0)]  # the last is beaten by 1e-6
    assert peers.seconds_at_error(points, 1e-6) == pytest.approx(4.0)
    assert peers.seconds_at_error(points, 1e-5) == pytest.approx(2.0)
    with pytest.raises(ValueError, match=r"at least 1\.0e-08 but was given 1e-09"):
        peers.seconds_at_error(points, 1e-9)
