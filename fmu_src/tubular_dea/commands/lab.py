"""Write one page that opens in any browser: the tube, the assisted heart and your recordings, live, without a network.

The page holds the model as WebAssembly, compiled from the same C as the FMUs. It opens with the given model and data
and reads recordings that are dropped on it. Everything it shows can be exported: link, command, Python, CSV, PNG.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import tubular_dea as td

from .settings import add_plant

EXAMPLE = """example:
  tubular-dea lab --out lab.html
  tubular-dea lab --model closed/model.json --data cosim_examples/data/bench --out lab.html"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `tubular-dea lab`."""
    parser.add_argument("--model", type=Path, help="a model.json of close-loop, instead of the plant's own model")
    add_plant(parser)
    parser.add_argument("--data", type=Path, help="folder of recordings to open with")
    parser.add_argument("--out", type=Path, default=Path("lab.html"), help="file to write (default: lab.html)")


def run(options: argparse.Namespace) -> None:
    """Make the page and write it."""
    page = td.lab_page(options.model, options.data, plant=options.plant)
    path = page.write(options.out)
    for line in page.lines():
        print(line)
    print(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB): open it in a browser")
