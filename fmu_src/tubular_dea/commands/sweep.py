"""Compute a plan of many points: designs, patients, uncertain parameters; tables, maps and sensitivities.

The plan is a TOML file that says what varies and what is wanted (all that it may hold stands below). Results are
written as they are computed; after an interruption the same command continues. By default the processors of this
machine share the work; a Dask cluster takes the same plan.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import tubular_dea as td

from ..sweep import plan

EXAMPLE = f"""example:
  tubular-dea sweep cosim_examples/sweep_snap_through.toml --out map
  tubular-dea sweep plan.toml --out map --local-cluster 4
  tubular-dea sweep plan.toml --out map --scheduler tcp://10.0.0.1:8786

plan.toml:

{(plan.__doc__ or "").partition("::")[2].strip(chr(10))}"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `tubular-dea sweep`."""
    parser.add_argument("plan", type=Path, metavar="PLAN", help="TOML file: what varies, over what, what is wanted")
    parser.add_argument("--out", type=Path, required=True, help="folder to write to, or to continue")
    parser.add_argument("--plant", metavar="FILE.py[:NAME]", help="the plant of a model.json, if it is one of your own")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", type=int, metavar="N", help="threads in this process (default: all processors)")
    where.add_argument("--local-cluster", type=int, metavar="N", help="N worker processes of Dask on this machine")
    where.add_argument("--scheduler", metavar="ADDRESS", help="a Dask scheduler, for example tcp://10.0.0.1:8786")
    parser.add_argument("--cube", action="store_true", help="write the results of a grid as a zarr cube, too")
    parser.add_argument("--no-report", action="store_true", help="write the table alone, no pictures and no report")


def run(options: argparse.Namespace) -> None:
    """Carry out the plan, and report."""
    swept = td.sweep(
        options.plan,
        options.out,
        workers=options.workers,
        local_cluster=options.local_cluster,
        scheduler=options.scheduler,
        cube=options.cube,
        plant=options.plant,
        progress=True,
    )
    written = [swept.write_cube()] if options.cube else []
    written += [] if options.no_report else swept.report()
    for line in [*swept.lines(), *(f"wrote {path}" for path in written)]:
        print(line)
