"""A laboratory drawn by seed: a tube with something hidden in it or nothing, experiments, and recordings of them.

`python -m blind.laboratory --seed 7 --kind none --out set` (from tests/) writes one set; what was drawn is kept
beside the folder in `set.truth.json`, not in it. The same seed has the same tube, experiments and conventions whatever
is hidden; `--conventions hum edges` keeps these alone and `--conventions plain` none, for finding out which one it is.

Nothing here imports the package. What may hide is in effects.py, its equations in tube.c, experiments in protocols.py,
conventions in conventions.py, files in recordings.py.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Collection
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from blind import protocols, recordings, tubes
from blind.conventions import MAX_SAMPLES, NAMES, Conventions, draw, stream
from blind.effects import DRAWN, EVERYTHING, EXTERNAL
from blind.tubes import TABLE_III, BurstError, Drive, Tube

SPREAD = 0.08  # of the nine parameters about Table III
LONG_AGO = 120.0  # s: under load before a record that begins at equilibrium
CURRENT_LAG = 0.5e-3  # s, of the current monitor


@dataclass(frozen=True)
class File:
    """One recording: its window on a drive's time."""

    name: str
    rate: float
    begin: float  # s, of its first sample on the drive's time
    stop: float
    clock: float  # s, where drifts begin, on the drive's time
    drive: int  # of the laboratory's
    switched: tuple[float, ...]  # s, instants at which the voltage switches
    start: str = "rested"  # what state it begins in: rested, equilibrium, or unknown

    @property
    def times(self) -> np.ndarray:
        """Of the samples, on the drive's time [s]."""
        return self.begin + np.arange(int(np.floor((self.stop - self.begin) * self.rate - 1e-6)) + 1) / self.rate


@dataclass(frozen=True)
class Laboratory:
    """Everything that was drawn."""

    seed: int
    kind: str
    tube: Tube
    conventions: Conventions
    drives: tuple[Drive, ...]
    files: tuple[File, ...]
    starts: tuple[float, ...]  # s, of the files on the clock on the wall, where they follow one another

    def readings(self, tube: Tube | None = None, tol: float = tubes.TIGHT) -> list[tuple[np.ndarray, np.ndarray]]:
        """Of every file, what noiseless sensors read: radius [m] and current [A]."""
        lag = CURRENT_LAG if self.conventions.current else 0.0
        found = {}
        for number, drive in enumerate(self.drives):
            here = [i for i, file in enumerate(self.files) if file.drive == number]
            times = np.concatenate([self.files[i].times for i in here])
            clock = self.files[here[0]].clock
            both = tubes.run(tube or self.tube, drive, times, clock=clock, monitor_lag=lag, tol=tol)
            ends = np.cumsum([self.files[i].times.size for i in here])[:-1]
            found |= dict(zip(here, zip(*(np.split(b, ends) for b in both), strict=True), strict=True))
        return [found[i] for i in range(len(self.files))]

    @cached_property
    def truth(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """The readings of the tube that was drawn."""
        return self.readings()


def laboratory(
    seed: int, kind: str = "none", only: Collection[str] | None = None, conventions: Conventions | None = None
) -> Laboratory:
    """Draw until the tube survives. `kind`: none, one, two, external, or names of EFFECTS and EXTERNAL joined by +.

    Without `conventions`, these are drawn too.
    """
    for attempt in range(60):
        made = _drawn(seed, kind, conventions or draw(seed, only), attempt)
        try:
            assert made.truth
        except BurstError:
            continue
        return made
    raise ValueError(f"no tube of kind {kind!r} and seed {seed} survives its experiments")


def _drawn(seed: int, kind: str, conventions: Conventions, attempt: int) -> Laboratory:
    random = stream(seed, "tube", attempt)
    identified = {n: v * (1 + SPREAD * random.uniform(-1, 1)) for n, v in TABLE_III.items()}
    tube = Tube(identified, dict(conventions.geometry), _hidden(seed, kind, attempt))
    drives, files, starts = _experiments(conventions, stream(seed, "experiments", attempt))
    return Laboratory(seed, kind, tube, conventions, drives, files, starts)


def _hidden(seed: int, kind: str, attempt: int) -> dict[str, tuple[float, ...]]:
    random = stream(seed, "hidden", kind, attempt)
    if kind == "none":
        return {}
    if kind in ("one", "two"):
        names = [str(n) for n in random.choice(DRAWN, size=1 + (kind == "two"), replace=False)]
    elif kind == "external":
        names = [sorted(EXTERNAL)[seed % len(EXTERNAL)]]
    else:
        names = kind.split("+")
    found = {}
    for name in names:
        numbers = [float(random.uniform(*ends)) for ends in EVERYTHING[name].ranges]
        sign = float(random.choice([-1.0, 1.0])) if EVERYTHING[name].either_sign else 1.0
        found[name] = (sign * numbers[0], *numbers[1:])
    return found


def _plans(c: Conventions, random: np.random.Generator) -> list[protocols.PlannedExperiment]:
    """The experiments, of which one at least is a heart's where beats are asked for."""
    if not c.own_protocols:
        plans = protocols.standard()
        if c.files < 8:
            plans = [plans[i] for i in sorted(random.choice(8, c.files, replace=False))]
        plans += [protocols.drawn("step", random) for _ in range(c.files - 8)]
    else:
        kinds = [*random.permutation(list(protocols.DRAWN)), *random.permutation(list(protocols.DRAWN))][: c.files]
        plans = [protocols.drawn(str(k), random) for k in kinds]
    if c.beats:
        plans = [p for p in plans if not p.name.startswith("heartbeat")][: max(c.files - 1, 0)]
        plans.append(protocols.drawn("heartbeat", random, c.beats))
    return plans


def _experiments(c: Conventions, random: np.random.Generator) -> tuple[tuple, tuple, tuple]:
    """Drives, files and starts on the wall's clock."""
    drives: list[Drive] = []
    files: list[File] = []
    left = MAX_SAMPLES
    for number, plan in enumerate(_plans(c, random)):
        drive, file = _experiment(c, plan, c.rates[number % len(c.rates)], left, random)
        if file.times.size <= left:
            files.append(replace(file, name=f"{len(files) + 1:02d}_{file.name}", drive=len(drives)))
            drives.append(drive)
            left -= file.times.size
    return _in_a_row(drives, files, random) if c.order else (tuple(drives), tuple(files), ())


def _experiment(
    c: Conventions, plan: protocols.PlannedExperiment, rate: float, left: int, random: np.random.Generator
) -> tuple[Drive, File]:
    """A drive and its recording; the first of a set is cut where it alone is more than a set may hold."""
    start = str(random.choice(["rested", "equilibrium", "cut"])) if c.start == "mixed" else c.start
    level, cut = random.uniform(0.6, 1.0), random.uniform(0.6, 3.5)
    phase = random.uniform(0, 1) / rate if c.edges else 0.0
    begin = phase + (round(cut * rate) / rate if start == "cut" else 0.0)
    if left == MAX_SAMPLES:
        plan = replace(plan, stop=min(plan.stop, begin + (MAX_SAMPLES - 1) / rate))
    if start == "equilibrium":
        plan = protocols.loaded(plan, level)

    def grid(t: float) -> float:
        return t if c.edges else round(t * rate) / rate

    drive = protocols.drive(
        plan,
        c.amplifier,
        rounded=c.rounded,
        grid=grid,
        scales=c.wall(),
        rest_before=LONG_AGO if start == "equilibrium" else 0.0,
    )
    switched = protocols.switching(plan) if plan.switched else ()
    instants = tuple(grid(float(t)) for t in switched)
    return drive, File(plan.name, rate, begin, plan.stop, 0.0, 0, instants, "unknown" if start == "cut" else start)


def _in_a_row(drives: list[Drive], files: list[File], random: np.random.Generator) -> tuple[tuple, tuple, tuple]:
    """The same experiments without rest: one drive with pauses, files along it, and when they started."""
    pauses = random.uniform(0.7, 12.0, len(files))
    ends = np.cumsum([f.stop + pause for f, pause in zip(files, pauses, strict=True)])
    starts = np.round([0.0, *ends[:-1]], 3).tolist()
    moved = [
        replace(f, begin=f.begin + s, stop=f.stop + s, drive=0, switched=tuple(t + s for t in f.switched))
        for f, s in zip(files, starts, strict=True)
    ]
    return (protocols.chained(drives, starts),), tuple(moved), tuple(f.begin - moved[0].begin for f in moved)


def write(lab: Laboratory, folder: Path) -> dict:
    """The set as files in `folder`, and its truth beside it, which is returned."""
    folder.mkdir(parents=True, exist_ok=True)
    told = [recordings.write(lab, number, folder) for number in range(len(lab.files))]
    recordings.write_bench_file(lab, folder)
    truth = {
        "seed": lab.seed,
        "kind": lab.kind,
        "hidden": lab.tube.hidden,
        "identified": lab.tube.identified,
        "conventions": {n: _plain(getattr(lab.conventions, n)) for n in lab.conventions.names()},
        "samples": int(sum(f.times.size for f in lab.files)),
        "files": told,
    }
    beside = folder.parent / f"{folder.name}.truth.json"
    beside.write_text(json.dumps(truth, indent=1), encoding="utf-8")
    return truth


def _plain(value: object) -> object:
    return asdict(value) if hasattr(value, "__dataclass_fields__") else value


def main() -> None:
    """Write one set."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", default="none", help=f"none, one, two, external, or among {', '.join(EVERYTHING)}")
    parser.add_argument("--conventions", nargs="+", default=None, metavar="NAME", help=f"plain, or {', '.join(NAMES)}")
    parser.add_argument("--out", type=Path, required=True, help="folder to write the files to")
    options = parser.parse_args()
    only = None if options.conventions is None else [c for c in options.conventions if c != "plain"]
    truth = write(laboratory(options.seed, options.kind, only), options.out)
    print(json.dumps({k: v for k, v in truth.items() if k != "files"}, indent=1))


if __name__ == "__main__":
    main()
