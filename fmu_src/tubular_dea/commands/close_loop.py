"""From bench recordings to the effect the model lacks, the error before and after, and an FMU that carries the effect.

DATA is a folder of CSV files, one experiment each, starting from a rested tube:
  time [s],pressure [Pa],voltage [V],radius [m]
mmHg, kPa, kV, mm, um, ms and `displacement` in place of `radius` are understood. With --model aortic-windkessel:
  time [s],flow [L/min],pressure [mmHg]
Written are result.json, report.html, model.json (for `tubular-dea build --model`) and the FMU below fmi2/.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from ..errors import UserError
from ..export.compile import PLATFORMS
from ..files import write_atomically
from ..model.declare import Model

if TYPE_CHECKING:
    from ..report.page import Page

EXAMPLE = """example:
  tubular-dea close-loop cosim_examples/data/bench --out out
  tubular-dea close-loop aorta --model aortic-windkessel --out out"""
STEPS = 24  # of the bar, about: how many refits there are depends on the data
MODELS = ("tubular-dea", "aortic-windkessel")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `tubular-dea close-loop`."""
    parser.add_argument("data", type=Path, metavar="DATA", help="folder of CSV files, one experiment each")
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    parser.add_argument("--model", choices=MODELS, default=MODELS[0], help="what was recorded (default: tubular-dea)")
    choices = ["host", "all", *(p.name for p in PLATFORMS)]
    parser.add_argument("--platforms", nargs="+", default=["host"], choices=choices, metavar="PLATFORM",
                        help=f"of the FMU: {', '.join(choices)}")  # fmt: skip
    parser.add_argument("--seed", type=int, default=None, help="of the search's starts and the bootstrap")


def run(options: argparse.Namespace) -> None:
    """Discover, then write everything at the end, so that a failure leaves nothing half-written."""
    if options.seed is not None and options.seed < 0:
        raise UserError(f"--seed: expected at least 0 but was given {options.seed}")
    (_aorta if options.model == "aortic-windkessel" else _tube)(options)


def _tube(options: argparse.Namespace) -> None:
    from ..discover import engine, outcome
    from ..identify.data import read_folder
    from ..identify.fit import uncertainty
    from ..report import close_loop as report

    recordings = read_folder(options.data)
    with _bar(STEPS) as tell:
        found = engine.discover(recordings, tell, seed=engine.SEED if options.seed is None else options.seed)
        tell("model and report")
        result = outcome.result(found)
        model = outcome.final_model(found)
        covariance = uncertainty(found.chosen.fitted, model)
        _write(options, model, recordings.source, report.report(found, result), result, covariance)
    print(f"{result['verdict']}: {report.headline(found)}")
    e = result["error"]
    print(
        f"error {_um(e['recalibrated']['rmse_m'])} -> {_um(e['after']['rmse_m'])} um, held out "
        f"{_um(e['recalibrated']['held_out_rmse_m'])} -> {_um(e['after']['held_out_rmse_m'])} um, noise "
        f"{result['noise_floor_m'] * 1e6:.1f} um; wrote {options.out}"
    )


def _aorta(options: argparse.Namespace) -> None:
    from ..discover.aorta import outcome
    from ..discover.aorta.candidates import CANDIDATES
    from ..discover.aorta.records import records
    from ..discover.aorta.search import search
    from ..identify.bench import AORTA
    from ..identify.data import read_folder
    from ..report import aorta as report

    recordings = read_folder(options.data, AORTA)
    with _bar(2 * len(CANDIDATES) + 2) as tell:
        loop = search(records(recordings), tell)
        tell("model and report")
        result = outcome.result(loop)
        page = report.report(loop, result, recordings.source)
        _write(options, outcome.final_model(loop), recordings.source, page, result)
    before, after = result["error"]["recalibrated"], result["error"]["after"]
    print(f"{result['verdict']}: {report.headline(result)}")
    print(
        f"fit {before['fit_percent']:.1f} -> {after['fit_percent']:.1f} %, held out "
        f"{before['held_out_fit_percent']:.1f} -> {after['held_out_fit_percent']:.1f} %. {report.left_over(result)}"
    )
    print(f"wrote {options.out}")


@contextmanager
def _bar(steps: int) -> Iterator[Callable[[str], None]]:
    """A progress bar of about so many steps, and what tells it the next one."""
    with tqdm(total=steps, unit="step", disable=None) as bar:

        def tell(what: str) -> None:
            bar.set_postfix_str(what)
            bar.update()

        yield tell


def _write(options: argparse.Namespace, model: Model, source: str, page: Page, result: dict[str, Any],
           covariance: dict[str, Any] | None = None) -> None:  # fmt: skip
    """All four files, once each of them is made."""
    from ..export.package import native_fmu
    from ..model.saved import as_json
    from .build import platforms

    text = json.dumps(result, indent=2, allow_nan=False) + "\n"
    with tempfile.TemporaryDirectory() as folder:
        made = native_fmu(model, 2, Path(folder) / f"{model.name}.fmu", platforms(options.platforms))
        fmu = made.read_bytes()
    write_atomically(options.out / "fmi2" / f"{model.name}.fmu", fmu)
    write_atomically(options.out / "model.json", as_json(model, f"identified from {source}", covariance).encode())
    page.write(options.out / "report.html")
    write_atomically(options.out / "result.json", text.encode())


def _um(value: float | None) -> str:
    return "-" if value is None else f"{value * 1e6:.1f}"
