"""From recordings to the effect the model lacks, the error before and after, and an FMU that carries the effect.

DATA is a folder of files, one experiment each, headed with quantity and unit:
  time [s],pressure [Pa],voltage [V],radius [m]
in any order and any usual unit (see below); `displacement` or `diameter` may stand in place of `radius`. With --plant
FILE.py they are the signals that the plant declares; --plant aorta is the aorta behind a flow and a pressure probe.
Written are result.json, report.html, lab.html (the found model over the recordings, live in any browser), model.json
(for `tubular-dea build --model`) and the FMU below fmi2/.
"""

from __future__ import annotations

import argparse
from contextlib import suppress
from importlib import import_module
from threading import Thread

import tubular_dea as td

from ..errors import UserError
from ..export.compile import PLATFORMS
from .reading import FORMATS, add_recordings, recordings_of
from .settings import add_plant

# What is imported while the compilers work, a second together: all that the search and what it writes will need.
LATER = ["..discover.engine", "..api.discover", "..api.build", "..report.close_loop", "..lab.opened", "..lab.page"]

EXAMPLE = f"""{FORMATS}
examples:
  tubular-dea close-loop cosim_examples/data/bench --dry-run
  tubular-dea close-loop cosim_examples/data/bench --out out
  tubular-dea close-loop tanks --plant cosim_examples/plants/cascaded_tanks.py --out out"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `tubular-dea close-loop`."""
    add_recordings(parser)
    add_plant(parser)
    parser.add_argument(
        "--hold-out",
        nargs="+",
        default=None,
        metavar="NAME",
        help="experiments that take part in no fit (default: chosen)",
    )
    choices = ["host", "all", *(p.name for p in PLATFORMS)]
    parser.add_argument(
        "--platforms",
        nargs="+",
        default=["host"],
        choices=choices,
        metavar="PLATFORM",
        help=f"of the FMU: {', '.join(choices)}",
    )
    parser.add_argument("--seed", type=int, default=None, help="of the search's starts and the bootstrap")


def _compile_base(plant: td.Plant) -> None:
    """Compile a plant's model while the files are read. Which of several outputs were recorded is not known yet."""
    if len(plant.outputs) == 1:
        with suppress(UserError):  # whoever asks for the kernel meets the same
            td.Kernel(plant.model, [plant.outputs[0].name])


def _begin(recordings: td.RecordingSet) -> None:
    """Compile for the search while the recordings are looked through and the base is fitted; as `study` will ask."""
    from ..identify.study.study import compiled_for

    if not recordings.plant.catalogue:
        return
    compiled_for(recordings, sum(e.time.size for e in recordings.experiments)).begin()
    for name in LATER:
        import_module(name, __package__)


def run(options: argparse.Namespace) -> None:
    """Discover, then write everything at the end, so that a failure leaves nothing half-written."""
    options.plant = td.load_plant(options.plant)
    if options.out is not None and not options.dry_run:  # else nothing is fitted
        Thread(target=_compile_base, args=[options.plant]).start()
    recordings = recordings_of(options, _begin)
    if recordings is None:
        return
    found = td.discover(recordings, hold_out=options.hold_out, seed=options.seed, progress=True)
    found.report(options.out, options.platforms)
    for line in found.lines():
        print(line)
    print(f"wrote {options.out}")
