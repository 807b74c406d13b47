"""A failing heart with and without assist: three FMUs, strongly coupled.

    python cosim_examples/assisted_failing_heart.py

Writes assisted_failing_heart.png. `tubular-dea assist` does the same with a report.
"""

from __future__ import annotations

from pathlib import Path

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

    run = runs["with assist"]
    rows = last_beats(run, 3)
    panels = [
        ("pressure [mmHg]", {"aortic": run["heart.aortic_pressure"][rows] / MMHG,
                             "ventricular": run["heart.ventricular_pressure"][rows] / MMHG}),
        ("displacement [mm]", {"": run["tube.radial_displacement"][rows] * 1e3}),
        ("voltage [kV]", {"": run["scheduler.voltage"][rows] / 1e3}),
    ]  # fmt: skip
    write_atomically(Path("assisted_failing_heart.png"), time_panels(run.time[rows] - run.time[rows][0], panels))


if __name__ == "__main__":
    main()
