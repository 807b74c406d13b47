"""The scheduler on a recorded ECG: which beats are assisted, and which are refused.

    python cosim_examples/heartbeat_on_ecg.py record.hea         a WFDB record, or CSV: time [s],ecg [mV]

Only the scheduler runs, as an FMU; writes heartbeat_on_ecg.png with the first premature beat. Without a record it takes
MIT-BIH record 100 from ../shared/data, if that is there. Needs the extra `ecg`: pip install '.[ecg]'.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from tubular_dea.cosim.heart_assist import fmus
from tubular_dea.cosim.heartbeats import detect, r_waves, read_ecg
from tubular_dea.cosim.master import Options, simulate
from tubular_dea.cosim.system import Connection, System
from tubular_dea.errors import UserError
from tubular_dea.files import write_atomically
from tubular_dea.report.figures import time_panels

RECORD = Path(__file__).resolve().parents[2] / "shared" / "data" / "ecg" / "100.hea"
SAFE = {"scheduler.aortic_pressure": 0.0, "scheduler.electric_field": 0.0, "scheduler.snap_through_margin": 1e5}


def main() -> None:
    """Detect, schedule, count, plot."""
    record = Path(sys.argv[1]) if len(sys.argv) > 1 else RECORD
    if not record.exists():
        raise SystemExit(
            f"heartbeat_on_ecg.py: there is no {record}; give a recorded ECG, as in python heartbeat_on_ecg.py "
            "record.hea (WFDB) or ecg.csv (headed time [s],ecg [mV])"
        )
    try:
        ecg = read_ecg(record)
    except UserError as problem:
        raise SystemExit(f"heartbeat_on_ecg.py: {problem}") from None
    trigger = r_waves(detect(ecg), ecg.duration)
    system = System(
        {"scheduler": fmus()["scheduler"]},
        [Connection("ecg.r_wave", "scheduler.r_wave", sampled=True)],
        {"ecg": trigger},
        SAFE,
        ["scheduler.next_event"],
    )
    run = simulate(system, ecg.duration, Options("jacobi", step=0.01)).completed()
    for name in ("beats", "pulses", "premature_beats", "skipped_pulses", "dropouts"):
        print(f"{name.replace('_', ' ')}: {run[f'scheduler.{name}'][-1]:.0f}")

    early = run.time[np.argmax(run["scheduler.premature_beats"] > 0)]
    window = (run.time > early - 4) & (run.time < early + 4)
    time = run.time[window]
    shown = np.interp(time, np.arange(ecg.signal.size) / ecg.rate, ecg.signal)
    panels = [
        ("ECG [mV]", {"": shown}),
        ("voltage [kV]", {"": run["scheduler.voltage"][window] / 1e3}),
        ("premature beats", {"": run["scheduler.premature_beats"][window]}),
    ]
    write_atomically(Path("heartbeat_on_ecg.png"), time_panels(time, panels))


if __name__ == "__main__":
    main()
