"""What close-loop costs the first time, with an empty cache, and the second time, and what it answers.

Usage: python tests/benchmarks/first_run.py                     1 000 made-up samples of the silverbox, two states
       python tests/benchmarks/first_run.py DATA [--plant ...]   any arguments of close-loop but --out

`processor` counts all cores, and the compilers too. `wall` says something only on a machine with nothing else to do.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.signal import resample
from scipy.signal.windows import tukey

import tubular_dea as td
from told import parser

PLANT = Path(__file__).parents[2] / "cosim_examples" / "plants" / "silverbox.py"
SAMPLES, RATE, FINE = 1000, 610.35, 16


def made_up(folder: Path) -> list[str]:
    """Arguments of close-loop for a recording of noise through the silverbox's base, with noise on it.

    The force is band-limited between samples, as the plant says, and begins and ends with nothing.
    """
    random, time_s = np.random.default_rng(1), np.arange(SAMPLES) / RATE
    force = 0.05 * np.convolve(random.standard_normal(SAMPLES + 8), np.ones(9) / 3, "valid") * tukey(SAMPLES, 0.1)
    fine = np.arange(FINE * SAMPLES) / (FINE * RATE)
    protocol = td.Protocol.of(fine, force=resample(force, fine.size))
    run = td.simulate(td.load_plant(str(PLANT)).model, protocol, times=time_s)
    read = run["displacement"] + 3e-4 * random.standard_normal(SAMPLES)
    table = np.column_stack([time_s, force, read])
    np.savetxt(folder / "record.csv", table, delimiter=",", header="time [s],force [V],displacement [V]", comments="")
    return [str(folder), "--plant", str(PLANT)]


def seconds(arguments: list[str], cache: Path, out: Path) -> tuple[float, float]:
    """Wall and processor seconds of a close-loop with this cache."""
    command = [sys.executable, "-m", "tubular_dea", "close-loop", *arguments, "--out", str(out)]
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, env=os.environ | {"TUBULAR_DEA_CACHE": str(cache)}, check=True, capture_output=True)
    wall, after = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """One line each for the first run and the second, what the first takes more, and the verdict (of what is made up:
    no_effect)."""
    _, given = parser(__doc__).parse_known_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        (folder / "data").mkdir()
        arguments = given or made_up(folder / "data")
        first, second = (seconds(arguments, folder / "cache", folder / "out") for _ in range(2))
        verdict = json.loads((folder / "out" / "result.json").read_text())["verdict"]
    for name, (wall, processor) in {"first": first, "second": second}.items():
        print(f"{name}: wall {wall:.1f} s, processor {processor:.1f} s")
    print(f"compiling: wall {first[0] - second[0]:.1f} s more, processor {first[1] / second[1]:.1f} times")
    print(f"verdict: {verdict}")


if __name__ == "__main__":
    main()
