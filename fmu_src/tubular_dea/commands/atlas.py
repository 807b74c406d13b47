"""Write one page with the signature of every effect of the catalogue: its equation, usual size and residual.

For each effect the plant is simulated in the standard experiments (those that it declares, else steps and sweeps of its
inputs) with the effect and without. The part of the difference that the model's own parameters would absorb in a refit
is removed. Compare the result with your own residual. The page is one file that opens from disk and needs no network.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import tubular_dea as td

from .settings import add_plant

EXAMPLE = """example:
  tubular-dea atlas --out atlas.html
  tubular-dea atlas --plant cosim_examples/plants/cascaded_tanks.py --out tanks.html"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `tubular-dea atlas`."""
    add_plant(parser)
    parser.add_argument("--out", type=Path, default=Path("atlas.html"), help="file to write (default: atlas.html)")


def run(options: argparse.Namespace) -> None:
    """Compute the atlas and write its page."""
    page = td.atlas_page(options.plant, progress=True)
    path = page.write(options.out)
    print(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB): {', '.join(page.lines())}; open it in a browser")
