"""Compute a plan of many points: designs, patients, uncertain parameters; tables, maps and sensitivities.

The plan is a TOML file that says what varies and what is wanted (the README of the sweep is the docstring of
tubular_dea.sweep.plan). Results are written as they come; the same command goes on after an interruption. By default
the processors of this machine share the work; a Dask cluster takes the very same plan.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from ..errors import UserError

EXAMPLE = """example:
  tubular-dea sweep cosim_examples/sweep_snap_through.toml --out map
  tubular-dea sweep plan.toml --out map --local-cluster 4
  tubular-dea sweep plan.toml --out map --scheduler tcp://10.0.0.1:8786"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `tubular-dea sweep`."""
    parser.add_argument("plan", type=Path, metavar="PLAN", help="TOML file: what varies, over what, what is wanted")
    parser.add_argument("--out", type=Path, required=True, help="folder to write to, or to go on with")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", type=int, metavar="N", help="threads in this process (default: all processors)")
    where.add_argument("--local-cluster", type=int, metavar="N", help="N worker processes of Dask on this machine")
    where.add_argument("--scheduler", metavar="ADDRESS", help="a Dask scheduler, for example tcp://10.0.0.1:8786")
    parser.add_argument("--cube", action="store_true", help="write the results of a grid as a zarr cube, too")
    parser.add_argument("--no-report", action="store_true", help="write the table alone, no pictures and no report")


def run(options: argparse.Namespace) -> None:
    """Carry out the plan, and report."""
    from ..sweep.backends import backend
    from ..sweep.plan import read_plan
    from ..sweep.run import carry_out
    from ..sweep.store import Store, check_cube, write_cube

    for name, number in (("--workers", options.workers), ("--local-cluster", options.local_cluster)):
        if number is not None and number < 1:
            raise UserError(f"{name}: expected at least 1 but was given {number}")
    plan = read_plan(options.plan)
    if options.cube:
        check_cube(plan)
    Store.open(options.out, plan)  # refuses a folder of another plan before a cluster is started
    with backend(options.workers, options.local_cluster, options.scheduler) as workers:
        store = carry_out(plan, options.out, workers)
    written = [write_cube(store, plan)] if options.cube else []
    if not options.no_report:
        from ..report.sweep import write_report

        written += write_report(store, plan)
    failed = int((store.column("status") != 0).sum())
    note = f", {failed} of them without a result (see column message)" if failed else ""
    print(f"{store.manifest.rows} rows in {options.out / 'parts'}{note}")
    for path in written:
        print(f"wrote {path}")
