"""A failing heart with and without assist: three FMUs, strongly coupled.

    python cosim_examples/assisted_failing_heart.py

Writes assisted_failing_heart.png. `tubular-dea assist` does the same with a report.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tubular_dea.cosim.beats import compare, last_beats, measure
from tubular_dea.cosim.heart_assist import fmus, heart_assist
from tubular_dea.cosim.master import simulate
from tubular_dea.files import write_atomically
from tubular_dea.model.patients import MMHG
from tubular_dea.model.windkessel import patient
from tubular_dea.report.figures import time_panels


def main() -> None:
    """Twelve beats of each."""
    slaves, failing = fmus(), patient("failing")
    runs = {
        name: simulate(heart_assist(slaves, failing, {"scheduler.voltage_on": volt}), stop=12 * 0.8 + 0.04).completed()
        for name, volt in (("without", 0.0), ("with assist", 5500.0))
    }
    for label, without, assisted, change in compare(*(measure(run) for run in runs.values())):
        print(f"{label:45} {without:>8} {assisted:>8}  {change}")

    assisted = runs["with assist"]
    time = assisted.time[last_beats(assisted, 3)]
    shown = {
        "aortic pressure [mmHg]": ("heart.aortic_pressure", 1 / MMHG),
        "ventricular [mmHg]": ("heart.ventricular_pressure", 1 / MMHG),
        "displacement [mm]": ("tube.radial_displacement", 1e3),
        "voltage [kV]": ("scheduler.voltage", 1e-3),
    }
    panels = [(label, {name: scale * np.interp(time, run.time, run[variable]) for name, run in runs.items()})
              for label, (variable, scale) in shown.items()]  # fmt: skip
    write_atomically(Path("assisted_failing_heart.png"), time_panels(time - time[0], panels))


if __name__ == "__main__":
    main()
