"""Write the handbook: one page for any browser with all models, effects, laws, the Python API and the commands.

Everything on it is generated from the code: equations and parameters, what a plant may lack, with
usual sizes, docstrings, options. With --plant also for a plant of your own.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from ..errors import UserError
from ..plants.load import SHIPPED, load_plant, shipped
from ..plants.plant import Plant
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
    import tubular_dea

    from ..cosim.heart_assist import models as heart_models
    from ..files import write_atomically
    from ..report.handbook import handbook
    from . import COMMANDS, declare

    if options.out.is_dir():
        raise UserError(f"--out {options.out}: expected the name of a file, as in handbook.html, but it is a folder")
    plants = plants_to_print(load_plant(options.plant))
    shown = [*(plant.model for plant in plants), *heart_models(controlled=True).values()]
    models = {model.name: model for model in shown}
    public = {name: getattr(tubular_dea, name) for name in tubular_dea.__all__}
    parsers = {name: argparse.ArgumentParser(f"tubular-dea {name}", formatter_class=_Wide) for name in COMMANDS}
    for name, parser in parsers.items():
        declare(name, parser)
    path = write_atomically(options.out, handbook(models.values(), plants, public, parsers).encode())
    print(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB): open it in a browser")


def plants_to_print(chosen: Plant) -> list[Plant]:
    """The plant that was asked for, and those that are shipped."""
    others = [plant for plant in map(shipped, SHIPPED) if plant.name != chosen.name]
    return [chosen, *others]


class _Wide(argparse.RawDescriptionHelpFormatter):
    """As wide as the page, whatever the terminal."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=110)
