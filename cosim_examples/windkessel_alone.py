"""The ventricle and its windkessel without a tube: healthy, failing, and before stiff arteries.

    python cosim_examples/windkessel_alone.py

Runs the equations through the kernel (no FMU needed) and writes windkessel_alone.png.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tubular_dea.files import write_atomically
from tubular_dea.kernel import Kernel
from tubular_dea.model.patients import ML, MMHG, PATIENTS
from tubular_dea.model.windkessel import aortic_windkessel, patient
from tubular_dea.protocol import Protocol
from tubular_dea.report.figures import time_panels

BEATS, PERIOD = 20, 0.8


def main() -> None:
    """Twenty beats each; the last two are shown."""
    kernel = Kernel(aortic_windkessel())
    time = np.linspace((BEATS - 2) * PERIOD, BEATS * PERIOD, 2001)
    nothing = Protocol.of([0, BEATS * PERIOD], tube_flow=[0, 0])
    pressures, volumes = {}, {}
    for name in PATIENTS:
        run = kernel.simulate(nothing, time, patient(name))
        pressures[name], volumes[name] = run["aortic_pressure"] / MMHG, run["ventricular_volume"] / ML
        stroke = np.ptp(volumes[name])
        print(f"{name}: {pressures[name].max():.0f}/{pressures[name].min():.0f} mmHg, stroke volume {stroke:.0f} mL")
    panels = [("aortic pressure [mmHg]", pressures), ("ventricular volume [mL]", volumes)]
    write_atomically(Path("windkessel_alone.png"), time_panels(time - time[0], panels))


if __name__ == "__main__":
    main()
