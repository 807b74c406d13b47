"""The options --set NAME=VALUE[UNIT] and --plant of every command that has them."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from ..errors import ArgumentError


def add_plant(parser: argparse.ArgumentParser) -> None:
    """Declare --plant, what a command is about."""
    parser.add_argument(
        "--plant", default="tube", metavar="FILE.py[:NAME]", help="the plant: its file, or tube (default) or aorta"
    )


def settings(given: Sequence[str], argument: str = "settings") -> dict[str, str]:
    """Values by name from "NAME=VALUE[UNIT]"; `ArgumentError` for a name given twice."""
    values: dict[str, str] = {}
    for setting in given:
        name, _, text = setting.partition("=")
        if name.strip() in values:
            raise ArgumentError(argument, f" {name.strip()} is given twice; give it once")
        values[name.strip()] = text.strip()
    return values
