"""Map rest and snap-through over pressure and voltage: thousands of equilibria in a second.

    python cosim_examples/sweep_snap_through.py

Writes snap_through/: the table (Parquet), maps with the boundary of snap-through, the equilibrium curves, report.html.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import tubular_dea as td
from tubular_dea.model.dea import MMHG

PLAN = Path(__file__).with_suffix(".toml")
OUT = Path("snap_through")


def main() -> None:
    """Carry out the plan beside this file, and say what it found."""
    rows = td.sweep(PLAN, OUT, progress=True)
    rows.report()
    kernel = td.Kernel(td.tube())
    print("voltage   largest pressure at rest   displacement there")
    for voltage in np.unique(rows["voltage"])[::10]:
        *_, (fold, pressure) = kernel.curve(np.linspace(1, 2, 101), {"voltage": voltage})  # exactly, between the rows
        there = (fold - 1) * kernel.defaults["r_o"]
        print(f"{voltage / 1e3:4.0f} kV {pressure / MMHG:18.1f} mmHg {1e3 * there:18.2f} mm")
    print(f"wrote {OUT / 'report.html'}")


if __name__ == "__main__":
    main()
