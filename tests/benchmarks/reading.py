"""How long it takes to read 250 000 lines of four columns, against pandas that finds the delimiter, or is told all.

    python tests/benchmarks/reading.py

Processor time, the best of three, in one run.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from told import parser
from tubular_dea.recordings import read

LINES = 250_000
HEAD = "time [s],pressure [Pa],voltage [V],radius [m]"


def files(folder: Path) -> dict[str, tuple[Path, dict[str, str]]]:
    """The same recording, written in several ways, each with what pandas has to be told."""
    random = np.random.default_rng(0)
    columns = [
        np.arange(LINES) * 0.004,
        8000 + 25 * random.standard_normal(LINES),
        4000 + 4 * random.standard_normal(LINES),
        0.018 + 15e-6 * random.standard_normal(LINES),
    ]
    rows = [f"{t:.5f},{p:.1f},{v:.1f},{r:.6f}" for t, p, v, r in zip(*columns, strict=True)]
    gaps = [row if i % 7 else row.rpartition(",")[0] + "," for i, row in enumerate(rows)]
    texts = {
        "commas": ([HEAD, *rows], {"sep": ","}),
        "semicolons, decimal commas": (
            [line.replace(",", ";").replace(".", ",") for line in [HEAD, *rows]],
            {"sep": ";", "decimal": ","},
        ),
        "every seventh radius missing": ([HEAD, *gaps], {"sep": ","}),
    }
    found = {}
    for number, (name, (lines, told)) in enumerate(texts.items()):
        path = folder / f"{number}.csv"
        path.write_text("\n".join(lines), encoding="utf-8")
        found[name] = (path, told)
    return found


def best(work: Callable[[], object]) -> float:
    """Processor time of the fastest of three runs [s]."""
    times = []
    for _ in range(3):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return min(times)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        for name, (path, told) in files(Path(folder)).items():
            own, pandas = best(lambda path=path: read(path)), best(lambda p=path, t=told: pd.read_csv(p, **t))
            found = best(lambda p=path: pd.read_csv(p, sep=None, engine="python"))
            print(
                f"{name}: {own:.2f} s; pandas that finds the delimiter {found / own:.1f} times as long, "
                f"pandas that is told all {pandas / own:.1f} times"
            )


if __name__ == "__main__":
    parser(__doc__).parse_args()
    main()
