"""One module for each subcommand of `tubular-dea`."""

from __future__ import annotations

import argparse
import importlib

COMMANDS = {
    "build": "write the FMUs",
    "simulate": "drive the tube with pressure and voltage; CSV and a picture",
    "assist": "run a ventricle with the tube, with and without assist; loops, pressures, energies",
    "patient": "fit a patient to a recorded arterial pressure, with intervals",
    "sweep": "compute a plan of many points: tables, maps, sensitivities; a laptop or a cluster",
    "identify": "fit the model's parameters to recordings",
    "close-loop": "from recordings to the missing effect, and an FMU that includes it",
    "atlas": "a page with the signature of every effect in the residual, to compare with",
    "handbook": "a page with all models, effects, laws, the Python API and the commands",
    "lab": "a page for any browser: tube, assisted heart and recordings, live",
}


def declare(name: str, parser: argparse.ArgumentParser) -> None:
    """Give a command's parser its text and options, and what it runs; only then is the command imported."""
    module = importlib.import_module(f".{name.replace('-', '_')}", __name__)
    parser.description, parser.epilog = module.__doc__, module.EXAMPLE
    module.add_arguments(parser)
    parser.set_defaults(run=module.run)
