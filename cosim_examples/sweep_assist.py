"""When should the tube be expanded, and what does it do for the heart? Three patients, 25 onsets, nine voltages.

    python cosim_examples/sweep_assist.py

The tube and the heart are one system of equations here, 16 beats a row; all 10 800 beats take seconds. Writes
assist/: the table (Parquet), maps of each patient, report.html.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import tubular_dea as td

PLAN = Path(__file__).with_suffix(".toml")
OUT = Path("assist")
ML = 1e-6  # m3


def main() -> None:
    """Carry out the plan beside this file, and print the best onset of every patient."""
    rows = td.sweep(PLAN, OUT, progress=True)
    rows.report()
    print("patient      stroke volume      with assist  onset [beats]  voltage")
    for patient in dict.fromkeys(rows["patient"]):
        mine = np.flatnonzero(rows["patient"] == patient)
        without = rows["stroke_volume"][mine][rows["voltage"][mine] == 0].mean()
        best = mine[np.argmax(rows["stroke_volume"][mine])]
        print(
            f"{patient:10} {without / ML:12.1f} mL {rows['stroke_volume'][best] / ML:13.1f} mL "
            f"{rows['onset_in_beats'][best]:15.2f} {rows['voltage'][best] / 1e3:7.1f} kV"
        )
    print(f"wrote {OUT / 'report.html'}")


if __name__ == "__main__":
    main()
