"""Is the static margin safe when the voltage steps? Where a step snaps the tube though it would rest: run as a script.

    python tests/benchmarks/step_margin.py

For each pressure, damping and mass: the largest step of the voltage, of the critical voltage (at which the fold comes
down to the pressure), after which the tube is still before the fold. 0.999 is as near as is tried. `damping` scales
eta_o, k_1, eta_1, k_2 and eta_2; `mass` the density of the wall. "overdamped" is c^2 / 4 k of the Jacobian at rest
before the step: c the rate at which speed decays, k the stiffness over the mass.
"""

from __future__ import annotations

import sys

import numpy as np
from scipy.optimize import brentq

from told import parser
from tubular_dea.kernel import Kernel, KernelError
from tubular_dea.model.dea import tubular_dea
from tubular_dea.protocol import Protocol

MMHG = 133.322
DAMPERS = ("eta_o", "k_1", "eta_1", "k_2", "eta_2")
NEAREST, STOP = 0.999, 30.0  # s: the slow branch decays in 2.7 s
KERNEL = Kernel(tubular_dea())


def critical_voltage(pressure: float) -> float:
    """The voltage [V] whose fold is at `pressure` [Pa]."""
    return float(brentq(lambda v: KERNEL.curve(np.array([1.2]), {"voltage": v})[2][1] - pressure, 0.0, 2e4))


def snaps(pressure: float, voltage: float, values: dict[str, float]) -> bool:
    """Whether a step from rest under no voltage takes the tube beyond the fold for good."""
    drive = Protocol.of([0, 0.1, 0.1, STOP], pressure=[pressure] * 4, voltage=[0, 0, voltage, voltage])
    fold = KERNEL.curve(np.array([1.2]), {"voltage": voltage})[2][0]
    try:
        run = KERNEL.simulate(drive, np.array([STOP]), {**values, "start_at_equilibrium": 1.0}, 1e-7)
    except KernelError:
        return True  # it ran away beyond what the equations hold for
    return bool(run["lambda_2"][0] > fold)


def largest_step(pressure: float, values: dict[str, float]) -> float:
    """Of the critical voltage."""
    critical = critical_voltage(pressure)
    if not snaps(pressure, NEAREST * critical, values):
        return NEAREST
    low, high = 0.3, NEAREST
    while high - low > 2e-3:
        middle = (low + high) / 2
        low, high = (low, middle) if snaps(pressure, middle * critical, values) else (middle, high)
    return low


def overdamped(pressure: float, values: dict[str, float]) -> float:
    """c^2 / 4 k at rest without voltage: above 1 nothing swings."""
    stretches = np.linspace(0.95, 1.7, 4001)
    load = KERNEL.curve(stretches, {"voltage": 0.0})[0]
    rest = float(stretches[np.argmax(load >= pressure)])
    J = KERNEL.jacobian(np.array([rest, 0, 0, 0]), np.array([pressure, 0.0]), values)
    return float(J[1, 1] ** 2 / (-4 * J[1, 0]))


def scaled(damping: float, mass: float) -> dict[str, float]:
    """Table III with its dampers and its mass scaled."""
    v = KERNEL.defaults
    return {n: v[n] * damping for n in DAMPERS} | {"rho": v["rho"] * mass}


def main() -> None:
    """Damping and mass at 100 mmHg, then low pressures, where lambda_2 is near 1."""
    cases = [(100.0, d, 1) for d in (1, 0.1, 0.03, 0.01, 0.001)]
    cases += [(100.0, 1, m) for m in (10, 100)] + [(100.0, d, 100) for d in (0.3, 0.1, 0.03)]
    cases += [(p, 1, 1) for p in (50.0, 20.0, 10.0, 5.0, 1.0)] + [(p, 0.1, 1) for p in (50.0, 20.0, 5.0)]
    print("pressure  damping  mass   critical   overdamped  largest step without snap-through")
    for pressure, damping, mass in cases:
        values = scaled(damping, mass)
        step = largest_step(pressure * MMHG, values)
        print(
            f"{pressure:4.0f} mmHg  {damping:7g}  {mass:4g}  {critical_voltage(pressure * MMHG) / 1e3:5.2f} kV  "
            f"{overdamped(pressure * MMHG, values):9.3g}   {step:.3f}",
            flush=True,
        )


if __name__ == "__main__":
    parser(__doc__).parse_args()
    sys.exit(main())
