"""Map rest and snap-through over pressure and voltage: thousands of equilibria in a second.

    python cosim_examples/sweep_snap_through.py

Writes snap_through/: the table (Parquet), maps with the boundary of snap-through, the equilibrium curves, report.html.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tubular_dea.model.dea import MMHG
from tubular_dea.report.sweep import write_report
from tubular_dea.sweep.plan import read_plan
from tubular_dea.sweep.run import carry_out

PLAN = Path(__file__).with_suffix(".toml")
OUT = Path("snap_through")


def main() -> None:
    """Carry out the plan beside this file, and say what it found."""
    plan = read_plan(PLAN)
    store = carry_out(plan, OUT)
    write_report(store, plan)
    rows = store.table()
    print("voltage   largest pressure at rest   displacement there")
    for voltage in np.unique(rows["voltage"])[::10]:
        rest = (rows["voltage"] == voltage) & (rows["status"] == 0)
        last = np.flatnonzero(rest)[np.argmax(rows["pressure"][rest])]
        fold = rows["snap_through_pressure"][last] / MMHG
        print(f"{voltage / 1e3:4.0f} kV {fold:18.1f} mmHg {1e3 * rows['radial_displacement'][last]:18.2f} mm")
    print(f"wrote {OUT / 'report.html'}")


if __name__ == "__main__":
    main()
