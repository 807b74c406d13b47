"""The gains of the tube controller (`model/tube_controller.py`), from the model's own Jacobian at the design point.

Run it to see them::

    python -m tubular_dea.control.design

Design point: 25 mm at 140 mmHg, where the open loop is unstable (+0.1 1/s). Without the wall's mass, the Jacobian of
the equations of motion has the rate of the stretch from a pressure, 1 / damping, and from the stretch itself; the
voltage cancels the latter (exact linearisation), so that the plant is an integrator with a bias:

    stretch' = stretch + h (rate + bias / damping),   bias' = bias + noise.

Tracking: LQR of the integrator, in which an error of ERROR costs as much as a rate of RATE: the gain is RATE / ERROR.
It is the highest gain with a phase margin of 70 degrees at 2 ms of delay, a sample and the amplifier (`phase_margin`).
Observer: the stationary Kalman filter for the sensor's NOISE and a bias with a random walk of WANDER per second, which
is the effect of parameters that are wrong by 6 % at 140 mmHg.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are

from ..kernel import Kernel
from ..model.dea import tubular_dea
from .rig import rest_voltage

MMHG = 133.322
RADIUS, PRESSURE = 25e-3, 140 * MMHG  # m, Pa: the design point
SAMPLE = 1e-3  # s
ERROR, RATE = 50e-6, 3e-3  # m, m/s
NOISE = 15e-6  # m
WANDER = 8 * MMHG  # Pa in a second
DELAY, AMPLIFIER = 2e-3, 0.5e-3  # s


@dataclass(frozen=True)
class Gains:
    """As the controller's parameters call them."""

    tracking_gain: float
    stretch_gain: float
    bias_gain: float


def gains() -> Gains:
    """LQR and Kalman gains at the design point."""
    damping = open_loop()[0]
    r_o = tubular_dea().parameter_values()["r_o"]
    A, C = np.array([[1.0, SAMPLE / damping], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    Q, R = np.diag([0.0, WANDER**2 * SAMPLE]), np.array([[(NOISE / r_o) ** 2]])
    # Scaled, so that the Riccati equation is well conditioned.
    scale = np.diag([1.0, damping])
    A, Q = np.linalg.inv(scale) @ A @ scale, np.linalg.inv(scale) @ Q @ np.linalg.inv(scale)
    P = solve_discrete_are(A.T, C.T, Q, R)
    L = scale @ (P @ C.T / (C @ P @ C.T + R))
    return Gains(RATE / ERROR, float(L[0, 0]), float(L[1, 0]))


def open_loop() -> tuple[float, float]:
    """Damping [Pa s] and the rate of the open loop [1/s] at the design point, from the Jacobian: the mass left out."""
    kernel = Kernel(tubular_dea())
    stretch = RADIUS / kernel.defaults["r_o"]
    x, u = np.array([stretch, 0.0, 0.0, 0.0]), np.array([PRESSURE, rest_voltage(RADIUS, PRESSURE)])
    J = kernel.jacobian(x, u)
    step = 1.0  # Pa
    push = kernel.derivatives(x, u + np.array([step, 0.0]))[1] - kernel.derivatives(x, u)[1]
    return float(-J[1, 1] / (push / step)), float(-J[1, 0] / J[1, 1])


def phase_margin(gain: float) -> float:
    """Of the tracking loop [degrees]: an integrator, sensor delay, half a sample of hold, a sample, the amplifier."""
    late = DELAY + 1.5 * SAMPLE + AMPLIFIER
    return float(90 - np.degrees(gain * late))


if __name__ == "__main__":
    found, (damping, rate) = gains(), open_loop()
    print(f"design point: {RADIUS * 1e3:g} mm at {PRESSURE / MMHG:g} mmHg, {rest_voltage(RADIUS, PRESSURE):.0f} V")
    print(f"damping {damping:.0f} Pa s, open loop without branches {rate:+.3f} 1/s")
    print(f"tracking_gain {found.tracking_gain:.3g} 1/s, phase margin {phase_margin(found.tracking_gain):.0f} degrees")
    print(f"stretch_gain {found.stretch_gain:.3g}, bias_gain {found.bias_gain:.3g} Pa")
