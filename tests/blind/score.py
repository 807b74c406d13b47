"""Blind trials, scored: `python -m blind.score` from `tests/` prints one table.

Each trial is a folder of CSV files written by `bench`, which imports nothing of the package; the package sees the
folder alone, and only then the verdict is compared with what was drawn. `--shared` adds the bench sets beside the
repository. `--nulls N` runs N full nulls; on each of them, 10 linearised ones are drawn besides.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from blind import bench
from tubular_dea.discover import bank, engine, outcome
from tubular_dea.discover.parameters import base_parameters
from tubular_dea.discover.study import study
from tubular_dea.identify.data import read_folder

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data" / "bench"
DECLARED = {
    "set-1": ["electrode_resistance"],
    "set-2": ["friction_hysteresis"],
    "set-3": [],
    "set-4": ["mullins_softening"],
}
REDRAWN = 10  # linearised nulls on each full one
FORM = 0.02  # of the strongest effect's score: no law of a catalogue is exactly the tube's
CLEAR = 5.0  # times the false-alarm threshold: an effect that is there to be found


@dataclass
class Trial:
    """What was hidden, what was found, and how well the found model does."""

    name: str
    hidden: list[str]
    verdict: str
    found: list[str]
    equivalent: list[list[str]]
    channel: str | None
    held_out_over_noise: float
    base_over_noise: float
    largest_score: float
    threshold: float
    seconds: float
    cpu: float
    left: float = 0.0  # of the sum of squares beyond noise, with what was found
    explained: float = 0.0  # the share of it that is explained
    signature: float = np.inf
    errors: list[float] = field(default_factory=list)
    covered: list[bool] = field(default_factory=list)
    linearised: list[float] = field(default_factory=list)


def trial(name: str, folder: Path, hidden: list[str]) -> Trial:
    """Run the discovery on a folder and note what it says."""
    return _noted(name, hidden, folder)[0]


def _noted(name: str, hidden: list[str], folder: Path) -> tuple[Trial, engine.Discovery, dict]:
    started, cpu = time.time(), time.process_time()
    found = engine.discover(read_folder(folder))
    result = outcome.result(found)
    error, floor = result["error"], result["noise_floor_m"]
    tests = result["residual"]["tests"]
    effects = result["effects"]
    before, after = (o.adequacy.excess for o in (found.base, found.search.chosen))
    return Trial(
        name, hidden, result["verdict"], [e["id"] for e in effects], [e["equivalent"] for e in effects],
        result["residual"]["channel"], error["after"]["held_out_rmse_m"] / floor,
        error["recalibrated"]["rmse_m"] / floor,
        tests["largest_score"], tests["threshold"], time.time() - started, time.process_time() - cpu,
        after, 1 - max(after, 0.0) / max(before, 1.0),
    ), found, result  # fmt: skip


def blind_trial(kind: str, seed: int, redrawn: int = 0) -> Trial:
    """Draw, write, run; where nothing is hidden, score `redrawn` further records of the same tube besides."""
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "data"
        tube = bench.make(seed, data, kind)
        done, found, result = _noted(f"{kind}-{seed}", list(tube.effects), data)
        _identified(done, tube, result["base_parameters"])
        if redrawn:
            done.linearised = linearised(found, tube, Path(folder), redrawn)
    if tube.effects and not right(done):  # what was found was there to be found
        done.signature = min(bench.signature(tube, name) for name in tube.effects)
        if set(done.found) < set(done.hidden):  # what was missed leaves no more than this
            done.signature = min(done.signature, done.left)
    return done


def _identified(done: Trial, tube: bench.Tube, parameters: dict) -> None:
    """Note the relative errors of the identified parameters, and which of the intervals have the truth."""
    for name, truth in zip(bench.NAMES, tube.identified, strict=True):
        value, ends = parameters[name]["value"], parameters[name]["ci95"]
        done.errors.append(float(abs(value / truth - 1)))
        done.covered.append(bool(min(ends) <= truth <= max(ends)))


def linearised(found: engine.Discovery, tube: bench.Tube, folder: Path, count: int) -> list[float]:
    """The catalogue's largest score on each of `count` records with new noise of laser and monitors.

    The base model follows every record linearly, and the candidates' columns are those of the first.
    """
    work, fitted = found.study, found.base.fitted
    listed, true = bank.candidates(work, fitted), bench.truths(tube)
    held = [p.name for p in work.held_out]
    largest = []
    for number in range(count):
        again = read_folder(bench.write(tube, folder / f"again-{number}", [number, 1000], true=true))
        fresh = study(again, work.compiled.base, held).weighted([p.weight for p in work.pieces])
        problem = fresh.problem((), base_parameters(work.compiled.base), {})
        residual, jacobian = problem.linearised(problem.scaled(fitted.values))
        largest.append(bank.scores(listed, residual, jacobian)[0].gain)
    return largest


def right(t: Trial) -> bool:
    """All hidden effects found or among the equivalents, nothing else named; unexplained where it is in no library."""
    foreign = [h for h in t.hidden if h in bench.FOREIGN]
    if foreign:
        return t.verdict == "unexplained"
    if not t.hidden:
        return t.verdict == "no_effect"
    if t.verdict not in ("effect_found", "ambiguous") or len(t.found) != len(t.hidden):
        return False
    return all(any(h == f or h in e for f, e in zip(t.found, t.equivalent, strict=True)) for h in t.hidden)


def detectable(t: Trial) -> bool:
    """Every hidden effect does what nothing else in the tube can imitate, well beyond the largest scores of nulls.

    And beyond what a slightly different law of a stronger effect beside it would leave.
    """
    return t.signature > max(CLEAR * t.threshold, FORM * t.largest_score)


def table(trials: list[Trial]) -> str:
    """One line a trial, then the shares by kind."""
    lines = [
        f"{'trial':34s} {'hidden':44s} {'verdict':13s} {'found (equivalent)':70s} {'chan':10s} base  held  sec  cpu"
    ]
    for t in trials:
        found = ", ".join(f + (f" ({'/'.join(e)})" if e else "") for f, e in zip(t.found, t.equivalent, strict=True))
        mark = " " if right(t) else ("x" if detectable(t) or not t.hidden else "-")
        hidden = ", ".join(t.hidden) or "(nothing)"
        lines.append(
            f"{mark}{t.name:33s} {hidden:44s} {t.verdict:13s} {found:70s} {t.channel!s:10s} "
            f"{t.base_over_noise:5.2f} {t.held_out_over_noise:5.3f} {t.seconds:4.0f} {t.cpu:4.0f}"
        )
    return "\n".join([*lines, "", *shares(trials)])


def shares(trials: list[Trial]) -> list[str]:
    """The figures of the issue."""
    nulls = [t for t in trials if not t.hidden]
    singles = [t for t in trials if len(t.hidden) == 1 and t.hidden[0] in bench.EFFECTS and detectable(t)]
    doubles = [t for t in trials if len(t.hidden) == 2 and detectable(t)]
    foreign = [t for t in trials if t.hidden and t.hidden[0] in bench.FOREIGN and detectable(t)]
    linearised = [s > t.threshold for t in nulls for s in t.linearised]
    first = [bool(t.found) and t.found[0] == t.hidden[0] for t in singles]
    classes = [bool(t.found) and bench.channel(t.found[0]) == bench.channel(t.hidden[0]) for t in singles]
    held = [t.held_out_over_noise for t in [*singles, *doubles] if right(t)]
    good = [t for t in singles if right(t)]
    channel = [t.channel == bench.channel(t.hidden[0]) for t in foreign]
    return [
        _share("false alarms, full runs of nulls", [t.verdict != "no_effect" for t in nulls]),
        _share("false alarms, linearised nulls", linearised),
        _share("single effect right or among the equivalents", [right(t) for t in singles]),
        _share("single effect first by id", first),
        _share("single effect first by class", classes),
        _share("two effects both found", [right(t) for t in doubles]),
        _share("in no library: unexplained", [right(t) for t in foreign]),
        _share("in no library: channel right", channel),
        f"held-out error over noise, found effects: median {np.median(held):.3f}, worst {max(held):.3f}"
        if held
        else "",
        _share("95 % intervals of the identified parameters that hold, nulls", [c for t in nulls for c in t.covered]),
        _share("the same, effect found", [c for t in good for c in t.covered]),
        f"error of the identified parameters, median by name, nulls: {_errors(nulls)}",
        f"the same, effect found: {_errors(good)}",
        f"verdicts: {dict(Counter(t.verdict for t in trials))}",
        "too faint for anybody and left out: "
        + ", ".join(f"{t.name} ({t.signature:.0f})" for t in trials if t.hidden and not detectable(t)),
    ]


def _errors(trials: list[Trial]) -> str:
    known = [t.errors for t in trials if t.errors]
    medians = np.median(known, axis=0) if known else []
    return ", ".join(f"{n} {100 * e:.2f} %" for n, e in zip(bench.NAMES, medians, strict=False))


def _share(what: str, hits: list[bool]) -> str:
    return f"{what}: {sum(hits)} of {len(hits)}" + (f" ({100 * sum(hits) / len(hits):.1f} %)" if hits else "")


def main() -> None:
    """Run trials and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--shared", action="store_true", help="the sets beside the repository")
    parser.add_argument("--singles", type=int, default=0, help="trials of each effect")
    parser.add_argument("--only", nargs="+", default=None, help="ids to try with --singles")
    parser.add_argument("--doubles", type=int, default=0)
    parser.add_argument("--foreign", type=int, default=0)
    parser.add_argument("--nulls", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, default=None, help="trials as JSON lines")
    parser.add_argument("--read", type=Path, nargs="+", default=[], help="trials of earlier runs, to be counted too")
    options = parser.parse_args()
    work: list[tuple] = []
    for i in range(options.seed, options.seed + options.singles):
        work += [(blind_trial, k, i) for k in (options.only or bench.EFFECTS)]
    work += [(blind_trial, "two", i) for i in range(options.seed, options.seed + options.doubles)]
    work += [(blind_trial, "foreign", i) for i in range(options.seed, options.seed + options.foreign)]
    work += [(blind_trial, "none", i, REDRAWN) for i in range(options.seed, options.seed + options.nulls)]
    if options.shared:
        work = [(trial, s.name, s, DECLARED.get(s.name, ["?"])) for s in sorted(SHARED.glob("set-*"))] + work
    trials = [Trial(**json.loads(line)) for path in options.read for line in path.read_text("utf-8").splitlines()]
    with ProcessPoolExecutor(options.workers) as pool:
        for job in [pool.submit(*w) for w in work]:
            try:
                trials.append(job.result())
            except Exception as problem:
                print(f"failed: {type(problem).__name__}: {problem}", file=sys.stderr)
                continue
            if options.out:
                with options.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(trials[-1])) + "\n")
            print(table(trials[-1:]).splitlines()[1], file=sys.stderr, flush=True)
    print(table(trials))


if __name__ == "__main__":
    main()
