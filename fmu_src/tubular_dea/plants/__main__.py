"""The index of laws, or the catalogue of a plant: `python -m tubular_dea.plants [PLANT]`."""

from __future__ import annotations

import argparse
import os
import sys

from ..docstrings import summary
from ..errors import UserError
from ..laws import kinds, laws
from ..model.effect import Effect
from .load import load_plant
from .plant import Plant


def index() -> str:
    """A table of all laws: where each may act, what it is, what it needs there."""
    rows = ["| law | at | what | needs |", "|---|---|---|---|"]
    for name, module in laws().items():
        rows.append(f"| {name} | {kinds(module)} | {summary(module.__doc__ or '')} | {module.NEEDS} |")
    return "\n".join(rows)


def catalogue(plant: str) -> str:
    """Everything that a plant may lack: id, channel, and the parameters with their units and usual values; then which
    laws do not act at places of their kind, and what they need there."""
    loaded = load_plant(plant)
    if not loaded.catalogue:
        return (
            f"nothing to look for: {loaded.name} declares no places; give Plant(..., places=[Path(...), Balance(...)])"
        )
    table = ["| id | channel | parameters |", "|---|---|---|", *map(_row, loaded.catalogue.values())]
    return "\n".join([*table, *_absent(loaded)])


def _absent(plant: Plant) -> list[str]:
    rows = []
    for name, module in laws().items():
        places = dict.fromkeys(p.name for p in plant.places if isinstance(p, module.KINDS) and p.asks(name))
        without = [place for place in places if f"{name}({place})" not in plant.catalogue]
        if without:
            rows.append(f"| {name} | {', '.join(without)} | {module.NEEDS} |")
    return ["", "| no law | at | it needs |", "|---|---|---|", *rows] if rows else []


def _row(effect: Effect) -> str:
    names = [f"{q.name} {effect.typical[q.name]:.3g} {q.unit}".removesuffix(" 1") for q in effect.parameters]
    return f"| {effect.id} | {effect.channel} | {', '.join(names)} |"


def main(arguments: list[str] | None = None) -> int:
    """Print one of the tables."""
    parser = argparse.ArgumentParser(prog="python -m tubular_dea.plants", description=__doc__)
    parser.add_argument("plant", nargs="?", help="tube, aorta or FILE.py[:NAME]: its catalogue instead of the index")
    options = parser.parse_args(arguments)
    try:
        print(catalogue(options.plant) if options.plant else index(), flush=True)
    except UserError as problem:
        print(f"error: {problem}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:  # whoever read it has read enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0


if __name__ == "__main__":
    sys.exit(main())
