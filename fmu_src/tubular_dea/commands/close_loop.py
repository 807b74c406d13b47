"""From bench recordings to the effect the model lacks, the error before and after, and an FMU that carries the effect.

DATA is a folder of CSV files, one experiment each, starting from a rested tube:
  time [s],pressure [Pa],voltage [V],radius [m]
mmHg, kPa, kV, mm, um, ms and `displacement` in place of `radius` are understood. Written are result.json,
report.html, model.json (for `tubular-dea build --model`) and fmi2/TubularDEA.fmu.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from tqdm import tqdm

from ..errors import UserError
from ..export.compile import PLATFORMS, Platform, write_atomically
from ..model.declare import Model

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
    if options.out.exists() and not options.out.is_dir():
        raise UserError(f"--out: expected a folder but {options.out} is a file")
    if options.model == "aortic-windkessel":
        from ..discover.aorta import close_loop

        close_loop(options.data, options.out)
        return
    _tube(options)


def _tube(options: argparse.Namespace) -> None:
    from ..discover import engine, outcome
    from ..identify.data import read_folder
    from ..identify.fit import uncertainty
    from ..model.saved import as_json
    from ..report import close_loop as report
    from .build import platforms

    targets = platforms(options.platforms)
    recordings = read_folder(options.data)
    with tqdm(total=STEPS, unit="step", disable=None) as bar:

        def tell(what: str) -> None:
            bar.set_postfix_str(what)
            bar.update()

        found = engine.discover(recordings, tell, seed=engine.SEED if options.seed is None else options.seed)
        tell("model and report")
        result = outcome.result(found)
        model = outcome.final_model(found)
        text = json.dumps(result, indent=2, allow_nan=False) + "\n"
        page = report.report(found, result)
        fmu = _fmu(model, targets)
    write_atomically(options.out / "fmi2" / f"{model.name}.fmu", fmu)
    covariance = uncertainty(found.chosen.fitted, model)
    saved = as_json(model, f"identified from {recordings.source}", covariance)
    write_atomically(options.out / "model.json", saved.encode())
    page.write(options.out / "report.html")
    write_atomically(options.out / "result.json", text.encode())
    print(f"{result['verdict']}: {report.headline(found)}")
    e = result["error"]
    print(
        f"error {_um(e['recalibrated']['rmse_m'])} -> {_um(e['after']['rmse_m'])} um, held out "
        f"{_um(e['recalibrated']['held_out_rmse_m'])} -> {_um(e['after']['held_out_rmse_m'])} um, noise "
        f"{result['noise_floor_m'] * 1e6:.1f} um; wrote {options.out}"
    )


def _fmu(model: Model, targets: list[Platform]) -> bytes:
    import tempfile

    from ..export.package import native_fmu

    with tempfile.TemporaryDirectory() as folder:
        return native_fmu(model, 2, Path(folder) / f"{model.name}.fmu", targets).read_bytes()


def _um(value: float | None) -> str:
    return "-" if value is None else f"{value * 1e6:.1f}"
