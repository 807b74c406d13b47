"""How many effects of the tube's catalogue should share a library for scores: compiling against running.

Usage: python tests/benchmarks/scoring.py [SIZE ...]        (default: 1 6 15 30; compiles anew, one minute or two)
"""

from __future__ import annotations

import os
import tempfile
import time

import numpy as np

from told import parser
from tubular_dea.discover.scores.parameters import switched_off
from tubular_dea.identify.fitting.compiled import Compiled
from tubular_dea.kernel import Kernel
from tubular_dea.plants.tube import PLANT
from tubular_dea.protocol import Protocol

DRIVE = Protocol.of([0.0, 1.0, 1.0, 8.0, 8.0, 15.0], pressure=[12666.0] * 6, voltage=[0.0, 0.0, 5e3, 5e3, 0.0, 0.0])
RUNS = 20


def measured(compiled: Compiled, ids: tuple[str, ...]) -> tuple[float, float]:
    """Seconds to compile the tube with some effects, and microseconds a step of a run with all of them off."""
    begun = time.perf_counter()
    kernel = Kernel(compiled.model(ids), ["measured_displacement"])
    compiling = time.perf_counter() - begun
    off = {n: v for name in ids for n, v in switched_off(compiled.catalogue[name]).items()}
    times = np.linspace(0, 15, 3750)
    begun = time.perf_counter()
    steps = sum(kernel.simulate(DRIVE, times, off, 1e-7).steps for _ in range(RUNS))
    return compiling, 1e6 * (time.perf_counter() - begun) / steps


def main() -> None:
    """One line for every size of a group."""
    told = parser(__doc__)
    told.add_argument("sizes", nargs="*", type=int, default=[1, 6, 15, 30], metavar="SIZE")
    sizes = told.parse_args().sizes
    with tempfile.TemporaryDirectory() as cache:
        os.environ["TUBULAR_DEA_CACHE"] = cache
        compiled = Compiled(PLANT, ["measured_displacement"])
        names = list(compiled.catalogue)
        for size in sizes:
            groups = [tuple(names[i : i + size]) for i in range(0, len(names), size)]
            found = np.array([measured(compiled, group) for group in groups])
            print(f"{size} in a library: {found[:, 0].sum():.1f} s to compile all, {found[:, 1].mean():.2f} us a step")


if __name__ == "__main__":
    main()
