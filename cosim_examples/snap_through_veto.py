"""Too much voltage for a stiff artery: the scheduler refuses before the tube snaps through.

    python cosim_examples/snap_through_veto.py

At 6.5 kV the fold comes within 10 mmHg of the systolic pressure. With the veto the voltage goes off in time; without it
(its limits out of the way) the tube is driven on. Writes snap_through_veto.png.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tubular_dea.cosim.heart_assist import fmus, heart_assist
from tubular_dea.cosim.master import Run, simulate
from tubular_dea.files import write_atomically
from tubular_dea.model.patients import MMHG
from tubular_dea.model.windkessel import patient
from tubular_dea.report.figures import time_panels

GUARDED = {"scheduler.field_limit": 100e6}  # V/m: above what is reached here, so that the fold alone decides
UNGUARDED = {"scheduler.field_limit": 1e9, "scheduler.margin_limit": -1e5}


def run(guarded: bool) -> Run:
    """Eight beats at 6.5 kV."""
    settings = {"scheduler.voltage_on": 6500.0, **(GUARDED if guarded else UNGUARDED)}
    return simulate(heart_assist(fmus(), patient("stiff"), settings), stop=8 * 0.8)


def main() -> None:
    """Both, side by side."""
    runs = {"with veto": run(True), "without": run(False)}
    for name, r in runs.items():
        print(
            f"{name}: {r['scheduler.pulses'][-1]:.0f} pulses, {r['scheduler.vetoes'][-1]:.0f} vetoes, least margin "
            f"{r['tube.snap_through_margin'].min() / MMHG:.1f} mmHg, largest displacement "
            f"{r['tube.radial_displacement'].max() * 1e3:.1f} mm {r.reason}"
        )
    time = np.linspace(2.4, min(r.time[-1] for r in runs.values()), 4001)

    def shown(variable: str, scale: float) -> dict[str, np.ndarray]:
        return {name: np.interp(time, r.time, r[variable]) * scale for name, r in runs.items()}

    panels = [
        ("margin [mmHg]", shown("tube.snap_through_margin", 1 / MMHG)),
        ("field [V/um]", shown("tube.electric_field", 1e-6)),
        ("displacement [mm]", shown("tube.radial_displacement", 1e3)),
        ("voltage [kV]", shown("scheduler.voltage", 1e-3)),
    ]
    write_atomically(Path("snap_through_veto.png"), time_panels(time, panels))


if __name__ == "__main__":
    main()
