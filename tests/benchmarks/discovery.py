"""How long a discovery takes: seconds by the clock and of the processor, and memory, on recordings of three sizes.

Usage: python tests/benchmarks/discovery.py [SET ...]        (default: all of SETS; minutes, with compiled models kept)

30k: eight files as the bench sets have them; 250k: the same at 2 kHz; beats: one file of 720 heart beats at 250 Hz with
a voltage that switches between samples. In each, nothing is hidden or one effect is.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from blind.conventions import Conventions
from blind.laboratory import laboratory, write
from told import parser

SIZES = {
    "30k": Conventions(),
    "250k": replace(Conventions(), rates=(2000.0,)),
    "beats": replace(Conventions(), rates=(250.0,), files=1, beats=720, rounded=True, edges=True),
}
SETS = {f"{size}-{kind}": (size, kind) for size in SIZES for kind in ("none", "sensor_lag")}
MEASURED = """
import json, resource, sys, time
from tubular_dea import discover, read_recordings
recordings = read_recordings(sys.argv[1])
begun = time.perf_counter(), time.process_time()
found = discover(recordings)
taken = time.perf_counter() - begun[0], time.process_time() - begun[1]
memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps([found.verdict, [e.id for e in found.effects], *taken, memory]))
"""


def measured(folder: Path) -> tuple[str, list[str], float, float, float]:
    """Verdict, effects, seconds by the clock and of the processor, MB, of a process that has compiled before."""
    for _ in range(2):
        said = subprocess.run([sys.executable, "-c", MEASURED, str(folder)], capture_output=True, text=True, check=True)
    return tuple(json.loads(said.stdout.splitlines()[-1]))


def main() -> None:
    """One line for every set."""
    told = parser(__doc__)
    told.add_argument("sets", nargs="*", metavar="SET", help=", ".join(SETS))
    sets = told.parse_args().sets or list(SETS)
    if unknown := [name for name in sets if name not in SETS]:
        told.error(f"there is no set {unknown[0]!r}; expected some of {', '.join(SETS)}")
    for name in sets:
        size, kind = SETS[name]
        with tempfile.TemporaryDirectory() as folder:
            samples = write(laboratory(5, kind, conventions=SIZES[size]), Path(folder) / "set")["samples"]
            verdict, effects, clock, processor, memory = measured(Path(folder) / "set")
            times = f"{clock:5.1f} s ({processor:5.1f} of the processor)"
            said = " ".join([verdict, *effects])
            print(f"{name:16s} {samples:7d} samples: {times}, {memory:4.0f} MB; {said}", flush=True)


if __name__ == "__main__":
    main()
