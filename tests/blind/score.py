"""Blind trials, scored: `python -m blind.score --nulls 60 --singles 2 --pairs 20 --external 12 --seed 1000` in tests/.

Every trial is a set of recordings drawn by `blind.laboratory` with conventions of its own; the package's `close-loop`
(and `identify`, where nothing is hidden) sees the folder alone. Printed are a line a trial, the shares of right and
wrong answers, and the same by convention. What is hidden and cannot be found by anybody (detect.py) is left out and
named.
`--conventions plain` is the bench sets' way of recording, `--conventions hum edges` these alone.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from tqdm import tqdm

from blind.conventions import NAMES
from blind.effects import EFFECTS, channel
from blind.trials import TooLarge, Trial, first_channel, trial

Share = tuple[str, list[bool]]


def line(t: Trial) -> str:
    """A trial in a line."""
    found = ", ".join(f + (f" ({'/'.join(e)})" if e else "") for f, e in zip(t.found, t.equivalent, strict=True))
    mark = "ok " if t.right else ("BAD" if t.findable else "-  ")
    covered = f" identify {t.identify} {sum(t.covered.values())}/{len(t.covered)}" if t.identify else ""
    wrong = f" ! {'; '.join(t.wrong)}" if t.wrong else ""
    return (
        f"{mark} {t.name:28s} {'+'.join(t.hidden) or '(nothing)':30s} {t.verdict:16s} {found or '-':40s} "
        f"{t.channel!s:10s} floor {t.floor:5.2f} held {t.held_out:5.2f} {t.seconds:4.0f} s ({t.cpu:.0f} of cpu) "
        f"{t.samples:6d}{covered}{wrong} [{', '.join(t.labels)}] {t.words}"
    )


def groups(trials: Iterable[Trial]) -> dict[str, list[Trial]]:
    """Nulls, singles, pairs and external ones that are there to be found."""
    counted = [t for t in trials if t.findable]
    return {
        "nulls": [t for t in counted if not t.hidden],
        "singles": [t for t in counted if len(t.hidden) == 1 and not t.external],
        "pairs": [t for t in counted if len(t.hidden) > 1],
        "external": [t for t in counted if t.external],
    }


def shares(trials: list[Trial]) -> list[Share]:
    """The figures that are asked for."""
    g = groups(trials)
    answered = [t for t in g["nulls"] if t.verdict not in ("refused", "failed")]
    return [
        ("nulls: an effect falsely named", [bool(t.false_names) for t in answered]),
        ("nulls: unexplained", [t.verdict == "unexplained" for t in answered]),
        ("nulls: refused or failed", [t.verdict in ("refused", "failed") for t in g["nulls"]]),
        ("single effect in the set", [t.hidden[0] in t.named for t in g["singles"]]),
        ("single effect first by id", [t.found[:1] == t.hidden for t in g["singles"]]),
        ("single effect first by channel", [first_channel(t) == channel(t.hidden[0]) for t in g["singles"]]),
        ("single effect: another falsely named beside", [bool(t.false_names) for t in g["singles"]]),
        ("pairs: both", [set(t.hidden) <= t.named for t in g["pairs"]]),
        ("pairs: another falsely named beside", [bool(t.false_names) for t in g["pairs"]]),
        ("in no library: flagged", [t.right for t in g["external"]]),
        ("in no library: channel", [t.channel == channel(t.hidden[0]) for t in g["external"]]),
        ("in no library: an effect named", [bool(t.found) for t in g["external"]]),
        ("identify: 95 % intervals that hold, nulls", [c for t in g["nulls"] for c in t.covered.values()]),
        ("result.json contradicts itself or design.md", [bool(t.wrong) for t in trials]),
    ]


def figures(trials: list[Trial]) -> list[str]:
    """Medians and extremes: errors, floors, seconds."""
    g = groups(trials)
    held = [t.held_out for t in [*g["singles"], *g["pairs"]] if t.right]
    floors = [t.floor for t in g["nulls"] if not {"hum", "drift"} & set(t.labels)]
    clocks = {name: f"{spread([t.seconds for t in g[name]])} (cpu {spread([t.cpu for t in g[name]])})" for name in g}
    names = list(dict.fromkeys(n for t in g["nulls"] for n in t.covered))
    by_name = {n: [t.covered[n] for t in g["nulls"] if t.covered] for n in names}
    return [
        f"held-out error over noise where right: {spread(held)}",
        f"noise floor over noise, nulls without hum and drift: {spread(floors)}; within 5 %: "
        f"{sum(abs(f - 1) < 0.05 for f in floors)} of {len(floors)}",
        "seconds: " + "; ".join(f"{name} {s}" for name, s in clocks.items()),
        f"seconds of identify: {spread([t.identify_seconds for t in g['nulls'] if t.identify])}",
        "intervals by parameter: " + ", ".join(f"{n} {sum(v)}/{len(v)}" for n, v in by_name.items()),
        f"verdicts: {dict(Counter(t.verdict for t in trials))}",
        "not there to be found, left out: " + ", ".join(t.name for t in trials if not t.findable),
    ]


def spread(values: list[float]) -> str:
    """Median and largest."""
    known = [v for v in values if np.isfinite(v)]
    return f"median {np.median(known):.3g}, largest {max(known):.3g}" if known else "-"


def by_convention(trials: list[Trial]) -> list[str]:
    """One line a convention: what went wrong of how many, by kind, and where."""
    columns: list[tuple[str, str, Callable[[Trial], bool]]] = [
        ("nulls", "nulls wrong", lambda t: not t.right),
        ("singles", "singles missed", lambda t: t.hidden[0] not in t.named),
        ("pairs", "pairs missed", lambda t: not set(t.hidden) <= t.named),
        ("external", "external not flagged", lambda t: not t.right),
    ]
    lines = [f"{'convention':16s}" + "".join(f"{head:>21s}" for _, head, _ in columns) + "   intervals   where"]
    for label in sorted({label for t in trials for label in t.labels}):
        g = groups(t for t in trials if label in t.labels)
        cells = [[bad(t) for t in g[name]] for name, _, bad in columns]
        held = [c for t in g["nulls"] for c in t.covered.values()]
        where = [t.name for name, _, bad in columns for t in g[name] if bad(t)]
        lines.append(
            f"{label:16s}"
            + "".join(f"{f'{sum(c)} of {len(c)}':>21s}" for c in cells)
            + f"   {f'{100 * np.mean(held):.0f} %' if held else '-':>9s}   {' '.join(where[:8])}"
        )
    return lines


def table(trials: list[Trial]) -> str:
    """All of it."""
    lines = [line(t) for t in sorted(trials, key=lambda t: (t.right, t.kind, t.seed))]
    lines += ["", *(f"{what}: {counted(hits)}" for what, hits in shares(trials)), *figures(trials), ""]
    return "\n".join([*lines, *by_convention(trials)])


def counted(hits: list[bool]) -> str:
    """How many of how many."""
    return f"{sum(hits)} of {len(hits)}" + (f" ({100 * np.mean(hits):.1f} %)" if hits else "")


def planned(options: argparse.Namespace) -> list[tuple[int, str]]:
    """Seeds and kinds of the trials."""

    def seeds(count: int) -> range:
        return range(options.seed, options.seed + count)

    work = [(s, "none") for s in seeds(options.nulls)]
    # singles take seeds of their own for every effect, so that conventions differ from one to the next
    chosen = options.only or list(EFFECTS)
    work += [(options.seed + list(EFFECTS).index(k) * 10_000 + i, k) for i in range(options.singles) for k in chosen]
    return work + [(s, "two") for s in seeds(options.pairs)] + [(s, "external") for s in seeds(options.external)]


def conventions_of(options: argparse.Namespace) -> list[str] | None:
    """The conventions that are asked for, or None for those that every seed draws."""
    return None if options.conventions is None else [c for c in options.conventions if c != "plain"]


def identifies(kind: str, options: argparse.Namespace) -> bool:
    """Whether `identify` is run, too."""
    return kind == "none" and not options.no_identify


def parsed(arguments: list[str] | None = None, description: str | None = __doc__) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nulls", type=int, default=0)
    parser.add_argument("--singles", type=int, default=0, help="trials of each effect")
    parser.add_argument("--only", nargs="+", choices=list(EFFECTS), metavar="ID", help="effects to try with --singles")
    parser.add_argument("--pairs", type=int, default=0)
    parser.add_argument("--external", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--conventions", nargs="+", metavar="NAME", help=f"plain, or these alone: {', '.join(NAMES)}")
    parser.add_argument("--no-identify", action="store_true", help="run no `identify` where nothing is hidden")
    parser.add_argument("--largest", type=int, metavar="N", help="leave out, and name, sets of more than N samples")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="folder where the sets and the answers stay")
    parser.add_argument("--out", type=Path, help="trials as JSON lines, added to")
    parser.add_argument("--read", type=Path, nargs="+", default=[], help="trials of earlier runs, to be counted too")
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> None:
    """Run trials and print the table."""
    options = parsed(arguments)
    only = conventions_of(options)
    trials = [Trial(**json.loads(row)) for path in options.read for row in path.read_text("utf-8").splitlines()]
    left_out = []
    with ProcessPoolExecutor(options.workers, get_context("spawn")) as pool:
        jobs = {
            pool.submit(trial, seed, kind, only, identifies(kind, options), options.keep, options.largest): (seed, kind)
            for seed, kind in planned(options)
        }
        for job in tqdm(as_completed(jobs), total=len(jobs), unit="set"):
            try:
                done = job.result()
            except TooLarge as known:
                left_out.append(str(known))
                continue
            except Exception as problem:
                print(f"the bench failed on {jobs[job]}: {type(problem).__name__}: {problem}", file=sys.stderr)
                continue
            trials.append(done)
            tqdm.write(line(done), file=sys.stderr)
            if options.out:
                with options.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(done)) + "\n")
    print(table(trials))
    if left_out:
        print("left out, too large: " + ", ".join(sorted(left_out)))


if __name__ == "__main__":
    main()
