"""Write one page with what every effect of the catalogue leaves behind: its equation, usual size and residual.

For each effect the plant is simulated on the standard experiments (those that it declares, else steps and sweeps of its
inputs) with the effect and without, and what the model's own parameters would take up in a refit is taken out. Look
your own residual up. The page is one file that opens from disk and asks no network for anything.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import tubular_dea as td

from ..errors import UserError
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
    if options.out.suffix != ".html":
        raise UserError(f"--out {options.out}: expected the name of a page, as in atlas.html")
    page = td.atlas_page(options.plant, progress=True)
    path = page.write(options.out)
    print(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB): {', '.join(page.lines())}; open it in a browser")
