"""Write the FMUs: native FMI 2.0 and 3.0 for this machine or for every platform, and the pythonfmu variant."""

from __future__ import annotations

import argparse
from pathlib import Path

from tqdm import tqdm

from ..cosim.heart_assist import archive
from ..cosim.heart_assist import models as models_by_part
from ..export.bom import bill_of_materials
from ..export.compile import PLATFORMS, Platform, host
from ..export.package import native_fmu
from ..export.python_fmu import python_fmu
from ..model.dea import tubular_dea
from ..model.declare import Model
from ..model.saved import load
from ..model.scheduler import heartbeat_scheduler
from ..model.windkessel import aortic_windkessel, patient

# Models that come as native FMUs only.
COMPANIONS = (aortic_windkessel(), heartbeat_scheduler())

EXAMPLE = """example:
  tubular-dea build --out build                      for this machine, a few seconds
  tubular-dea build --out build --platforms all      Linux, Windows and macOS, about a minute the first time
  tubular-dea build --model out/model.json           the tube with the effects that close-loop found"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `tubular-dea build`."""
    names = ", ".join(p.name for p in PLATFORMS)
    parser.add_argument("--out", type=Path, default=Path("build"), help="folder to write to (default: build)")
    parser.add_argument("--model", type=Path, help="a model.json of close-loop, instead of the paper's model")
    parser.add_argument(
        "--platforms",
        nargs="+",
        default=["host"],
        choices=["host", "all", *(p.name for p in PLATFORMS)],
        metavar="PLATFORM",
        help=f"host (default), all, or some of {names}",
    )


def run(options: argparse.Namespace) -> None:
    """Build every FMU into `options.out`."""
    targets = platforms(options.platforms)
    if options.model is not None:
        model = load(options.model)
        written = build([model], options.out, targets)
        if model.delays:
            print(f"no pythonfmu FMU: {model.name} has pure delays, which only the native ones carry")
    else:
        written = build([tubular_dea(), *COMPANIONS], options.out, targets)
        written.append(build_archive(options.out))
    for path in [*written, bill_of_materials(written, targets, options.out)]:
        print(f"wrote {path}")


def platforms(names: list[str]) -> list[Platform]:
    """The platforms behind the names "host", "all" or those of `PLATFORMS`."""
    if "all" in names:
        return list(PLATFORMS)
    return [p for p in PLATFORMS if p.name in names or ("host" in names and p == host())]


def build(models: list[Model], out: Path, targets: list[Platform]) -> list[Path]:
    """Write fmi2/, fmi3/ and python/ FMUs of `models` below `out`; returns their paths. Shows progress.

    The companions, and models with pure delays, come without python/.
    """
    written = []
    with tqdm(total=2 * len(models) * len(targets) + 1, unit="library", disable=None) as bar:

        def progress(what: str) -> None:
            bar.set_postfix_str(what)
            bar.update()

        for model in models:
            for version in (2, 3):
                path = out / f"fmi{version}" / f"{model.name}.fmu"
                written.append(native_fmu(model, version, path, targets, progress))
            if model not in COMPANIONS and not model.delays:
                written.append(python_fmu(model, out / "python" / f"{model.name}.fmu"))
                progress("python")
    return written


def build_archive(out: Path) -> Path:
    """HeartAssist.ssp: the failing heart's whole loop, from the FMI 2.0 FMUs below `out`."""
    slaves = {part: out / "fmi2" / f"{model.name}.fmu" for part, model in models_by_part().items()}
    return archive(slaves, out / "HeartAssist.ssp", patient("failing"))
