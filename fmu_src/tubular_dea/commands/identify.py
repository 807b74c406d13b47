"""Find a model's parameters from recordings: for the tube the paper's staged procedure, then all of them jointly.

DATA is a folder of files, one experiment each, headed with quantity and unit:
  time [s],pressure [Pa],voltage [V],radius [m]
in any order and any usual unit; see below.
Written are parameters.json (verdict: adequate, or misfit where more than noise is left; values, standard errors, 95 %
intervals, goodness of fit), model.json (for `tubular-dea build --model`) and fit.png.
"""

from __future__ import annotations

import argparse
import shlex

import tubular_dea as td

from .reading import FORMATS, add_recordings, recordings_of
from .settings import add_plant

EXAMPLE = f"""{FORMATS}
examples:
  tubular-dea identify cosim_examples/data/bench --out identified
  tubular-dea identify cosim_examples/data/bench --dry-run
  tubular-dea identify rig --columns radius=laser_2[um] voltage=AI3 --out identified
  tubular-dea identify bench --start table-2 --profile --out identified"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `tubular-dea identify`."""
    add_recordings(parser)
    add_plant(parser)
    parser.add_argument(
        "--start",
        default=None,
        metavar="NAME",
        help="the plant's other starting values, such as table-2 (default: as declared)",
    )
    parser.add_argument(
        "--staged", action="store_true", help="start with the paper's stages (always done from table-2)"
    )
    parser.add_argument(
        "--free", nargs="+", default=None, metavar="NAME", help="identify these only (default: all tunable ones)"
    )
    parser.add_argument(
        "--starts", type=int, default=3, help="starts of the joint fit, near the starting values (default: 3)"
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the starts")
    parser.add_argument("--profile", action="store_true", help="intervals from the profile of the likelihood (minutes)")


def run(options: argparse.Namespace) -> None:
    """Identify, then write all files at the end."""
    recordings = recordings_of(options)
    if recordings is None:
        return
    found = td.identify(
        recordings,
        start=options.start,
        staged=options.staged,
        free=options.free,
        starts=options.starts,
        seed=options.seed,
        profile=options.profile,
        progress=True,
    )
    found.report(options.out)
    for line in found.lines():
        print(line)
    if found.verdict == "misfit":
        print("free all parameters (leave out --free)" if options.free else _to_find(options))
    print(f"wrote {options.out}")


def _to_find(options: argparse.Namespace) -> str:
    plant = [] if options.plant == "tube" else ["--plant", options.plant]
    columns = ["--columns", *options.columns] if options.columns else []
    command = ["tubular-dea", "close-loop", str(options.data), *plant, *columns, "--out", f"{options.out}_effects"]
    return f"to find what it is, run {shlex.join(command)}"
