"""From recordings to the effect the model lacks: six experiments of a (simulated, independent) bench.

    python cosim_examples/close_the_loop.py [folder of CSV files]

Writes close_the_loop/: result.json, report.html, model.json and the FMU that carries the effect. The same as
`tubular-dea close-loop cosim_examples/data/bench --out close_the_loop`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import tubular_dea as td

RECORDINGS = Path(__file__).parent / "data" / "bench"


def main() -> None:
    """Read, discover, write, and say what was found."""
    try:
        found = td.discover(sys.argv[1] if len(sys.argv) > 1 else RECORDINGS, progress=True)
        found.report("close_the_loop")
    except td.UserError as problem:
        sys.exit(f"close_the_loop.py: {problem}")
    print("\n".join(found.lines()))
    for effect in found.effects:
        print(effect.id, {name: f"{p.value:.4g} {p.unit}".removesuffix(" 1") for name, p in effect.parameters.items()})
    print(found.next_experiment)


if __name__ == "__main__":
    main()
