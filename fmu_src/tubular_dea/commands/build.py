"""Write the FMUs: native FMI 2.0 and 3.0 for this machine or for every platform, and the pythonfmu variant."""

from __future__ import annotations

import argparse
from pathlib import Path

import tubular_dea as td

from ..api.given import model_of, plant_of
from ..export.compile import PLATFORMS
from ..model.units import in_words
from .settings import add_plant

EXAMPLE = """example:
  tubular-dea build --out build                      for this machine, a few seconds
  tubular-dea build --out build --platforms all      Linux, Windows and macOS, about a minute the first time
  tubular-dea build --model out/model.json           the tube with the effects that close-loop found
  tubular-dea build --plant tanks.py --out tanks     a plant of your own, or by --model what close-loop made of it"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `tubular-dea build`."""
    names = ", ".join(p.name for p in PLATFORMS)
    parser.add_argument("--out", type=Path, default=Path("build"), help="folder to write to (default: build)")
    parser.add_argument("--model", type=Path, help="a model.json of close-loop, instead of the plant's own model")
    add_plant(parser)
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
    plant = plant_of(options.plant)
    model = None if options.model is None else model_of(options.model, plant)
    written = td.build_fmus(options.out, model, platforms=options.platforms, plant=plant, progress=True)
    if not any(path.parent.name == "python" for path in written):
        print("no pythonfmu FMU: the model has pure delays, which only the native ones carry")
    for q in [p.quantity for p in (model or plant.model).parameters if p.start]:
        begins = in_words(float(q.value or 0.0), q.unit)
        print(f"note: {q.name} is free in the plant, the FMUs start at {begins}: set it there")
    for path in written:
        print(f"wrote {path}")
