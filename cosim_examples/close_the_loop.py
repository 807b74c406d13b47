"""From recordings to the effect the model lacks: six experiments of a (simulated, independent) bench.

    python cosim_examples/close_the_loop.py [folder of CSV files]

Writes close_the_loop/: result.json, report.html, model.json and the FMU that carries the effect. The same as
`tubular-dea close-loop cosim_examples/data/bench --out close_the_loop`.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from tubular_dea.cli import main as tubular_dea

RECORDINGS = Path(__file__).parent / "data" / "bench"


def main() -> int:
    """Run the command and read its result."""
    folder = sys.argv[1] if len(sys.argv) > 1 else str(RECORDINGS)
    code = tubular_dea(["close-loop", folder, "--out", "close_the_loop"])
    if code == 0:
        result = json.loads(Path("close_the_loop/result.json").read_text(encoding="utf-8"))
        for effect in result["effects"]:
            print(effect["id"], {n: f"{p['value']:.4g} {p['unit']}" for n, p in effect["parameters"].items()})
        print(result["next_experiment"])
    return code


if __name__ == "__main__":
    sys.exit(main())
