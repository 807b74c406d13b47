"""A tube held where it would not stay: 26 mm at 100 mmHg, beyond its snap-through, under a pressure that beats.

    python cosim_examples/hold_beyond_the_fold.py

The tube's FMU with TubeController.fmu (which starts from no voltage), with a tuned PI and with a constant voltage
(which start from the one that holds it); the radius is measured with 15 um of noise, 2 ms late. Writes
hold_beyond_the_fold.png.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tubular_dea.control.peers import PI, Constant
from tubular_dea.control.rig import Bench, TubeController, experiment, rest_voltage
from tubular_dea.files import write_atomically
from tubular_dea.model.patients import MMHG
from tubular_dea.report.figures import time_panels

RADIUS, MEAN, SWING, FIELD, STOP = 26e-3, 100.0, 10.0, 140e6, 3.0


def pressure(time: float) -> float:
    """A beat of 1.25 Hz, from 0.5 s on [Pa]."""
    return (MEAN + (SWING * np.sin(2.5 * np.pi * (time - 0.5)) if time > 0.5 else 0.0)) * MMHG


def within(values: np.ndarray, most: float) -> np.ndarray:
    """Values up to a size, and gaps where they are larger."""
    return np.where(np.abs(values) <= most, values, np.nan)


def main() -> None:
    """Three runs from 0.3 mm inside the reference, and their errors."""
    rest = rest_voltage(RADIUS, MEAN * MMHG)
    bench = Bench(pressure, lambda time: RADIUS, RADIUS - 0.3e-3, noise=15e-6, delay=2, seed=1, voltage=rest)
    ours = TubeController({"field_limit": FIELD})
    controllers = {"constant voltage": Constant(rest), "tuned PI": PI(rest, FIELD), "tube controller": ours}
    runs = {name: experiment(bench, controller, STOP) for name, controller in controllers.items()}
    ours.close()
    for name, run in runs.items():
        late, settled = run.time >= 1.0, run.settled(100e-6)
        print(
            f"{name:17} error from 1 s on {1e6 * np.sqrt(np.mean(run.error[late] ** 2)):7.1f} um rms, "
            + (f"within 100 um after {settled:.3f} s" if np.isfinite(settled) else "not within 100 um in the run")
        )
    time = next(iter(runs.values())).time
    panels = [
        ("pressure [mmHg]", {"": runs["tube controller"].pressure / MMHG}),
        ("radius [mm]", {name: run.radius * 1e3 for name, run in runs.items()}),
        ("error within 50 um [um]", {name: within(run.error * 1e6, 50) for name, run in runs.items()}),
        ("voltage [kV]", {name: run.voltage / 1e3 for name, run in runs.items()}),
    ]
    write_atomically(Path("hold_beyond_the_fold.png"), time_panels(time, panels))


if __name__ == "__main__":
    main()
