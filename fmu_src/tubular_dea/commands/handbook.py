"""Write the handbook: one page for any browser with all models, effects, laws, the Python API and the commands.

Everything on it is generated from the code: equations and parameters, what a plant may lack, with
usual sizes, docstrings, options. With --plant FILE.py it is about that plant, in the place of this package's.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import tubular_dea as td

from . import COMMANDS, declare
from .settings import add_plant

EXAMPLE = """example:
  tubular-dea handbook --out handbook.html
  tubular-dea handbook --plant tanks.py --out tanks.html       with a plant of your own"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `tubular-dea handbook`."""
    add_plant(parser)
    parser.add_argument(
        "--out", type=Path, default=Path("handbook.html"), help="file to write (default: handbook.html)"
    )


def run(options: argparse.Namespace) -> None:
    """Make the page and write it."""
    page = td.handbook_page(options.plant, commands={name: _help(name) for name in COMMANDS})
    path = page.write(options.out)
    print(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB): open it in a browser")


def _help(name: str) -> str:
    """What `tubular-dea NAME --help` prints."""
    parser = argparse.ArgumentParser(f"tubular-dea {name}", formatter_class=_Wide)
    declare(name, parser)
    return parser.format_help()


class _Wide(argparse.RawDescriptionHelpFormatter):
    """As wide as the page, whatever the terminal."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=110)
