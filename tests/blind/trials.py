"""One blind trial: a set drawn and written, the package's commands run on it as a user would, and its answer judged.

The answer is what `result.json` and `parameters.json` say (design.md, section 3), nothing else. Only these functions
import the package, through its command line.
"""

from __future__ import annotations

import contextlib
import io
import json
import shutil
import signal
import tempfile
import time
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from blind import detect
from blind.conventions import Conventions
from blind.effects import EXTERNAL, channel
from blind.laboratory import Laboratory, laboratory, write

LIMIT = 300  # s of cpu, for one command: ten times what the slowest may take
NAMED = ("effect_found", "ambiguous", "partly_explained")
VERDICTS = (*NAMED, "no_effect", "unexplained")


class TooLarge(Exception):
    """A set of more samples than asked for."""


@dataclass
class Trial:
    """What was hidden under which conventions, and what the package said."""

    seed: int
    kind: str
    hidden: list[str]
    labels: list[str]  # conventions that could matter, by name
    samples: int
    verdict: str = "failed"  # or one of VERDICTS, or refused
    found: list[str] = field(default_factory=list)
    equivalent: list[list[str]] = field(default_factory=list)
    channel: str | None = None
    floor: float = np.nan  # noise floor over the laser's noise
    held_out: float = np.nan  # held-out error over it
    seconds: float = np.nan
    cpu: float = np.nan  # s, of all threads
    wrong: list[str] = field(default_factory=list)  # what result.json says against itself or design.md
    words: str = ""  # the last line of a command that refused or failed
    findable: bool = True
    identify: str = ""  # its verdict, or refused, failed
    covered: dict[str, bool] = field(default_factory=dict)
    identify_seconds: float = np.nan
    folder: str = ""

    @property
    def name(self) -> str:
        """How it is found again."""
        return f"{self.kind}-{self.seed}"

    @property
    def external(self) -> bool:
        """Whether something in no library hides."""
        return any(h in EXTERNAL for h in self.hidden)

    @property
    def named(self) -> set[str]:
        """Every effect that is named or said to be equivalent."""
        return {*self.found, *(e for es in self.equivalent for e in es)}

    @property
    def false_names(self) -> list[str]:
        """Effects named that are not there, nor said to be equivalent to one that is."""
        return [f for f, e in zip(self.found, self.equivalent, strict=True) if not {f, *e} & self.present]

    @property
    def present(self) -> set[str]:
        """What is there: a sensor that drifts a little by convention does drift."""
        return {*self.hidden, *(["sensor_drift"] if "drift" in self.labels else [])}

    @property
    def right(self) -> bool:
        """Nothing false, everything hidden named or, where it is in no library, flagged."""
        if self.external:
            return self.verdict in ("unexplained", "partly_explained")
        if not self.hidden:
            return self.verdict == "no_effect" or (self.verdict in NAMED and not self.false_names)
        return self.verdict in NAMED and set(self.hidden) <= self.named and not self.false_names


def trial(
    seed: int, kind: str, only: Collection[str] | None, identify: bool, keep: Path | None, largest: int | None = None
) -> Trial:
    """Draw, write, run, judge. The set stays in `keep` where one is given. TooLarge above `largest` samples."""
    lab = laboratory(seed, kind, only)
    with contextlib.ExitStack() as stack:
        if keep:
            place = keep / f"{kind}-{seed}"
            shutil.rmtree(place, ignore_errors=True)
        else:
            place = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "set"
        truth = write(lab, place / "data")
        if largest is not None and truth["samples"] > largest:
            raise TooLarge(f"{kind}-{seed}: {truth['samples']} samples")
        done = Trial(
            seed,
            kind,
            list(lab.tube.hidden),
            labels(lab.conventions),
            truth["samples"],
            folder=str(place) if keep else "",
        )
        _close_loop(done, place, truth)
        if identify:
            _identify(done, place, truth)
    if done.hidden and not done.right:
        done.findable = detect.there(lab) and not _imitated(done, lab)
    return done


def labels(c: Conventions) -> list[str]:
    """The conventions' names, and the extreme ones among their values."""
    found = c.names()
    extremes = {
        "rates >= 1 kHz": max(c.rates) >= 1000,
        "rates <= 100 Hz": min(c.rates) <= 100,
        "rates mixed": len(c.rates) > 1,
        "colour >= 0.9": c.colour >= 0.9,
        "bits <= 10": 0 < c.bits <= 10,
        "files <= 2": c.files <= 2,
        "beats 240": c.beats == 240,
        "(plain)": not found,
    }
    return found + [name for name, holds in extremes.items() if holds]


def _imitated(done: Trial, lab: Laboratory) -> bool:
    """Whether the effects named in place of something external do the same as it."""
    return done.external and bool(done.found) and detect.imitated(lab, done.found)


def _close_loop(done: Trial, place: Path, truth: dict) -> None:
    started, before = time.perf_counter(), time.process_time()
    code, done.words = command("close-loop", str(place / "data"), "--out", str(place / "out"))
    done.seconds, done.cpu = time.perf_counter() - started, time.process_time() - before
    if code:
        done.verdict = "refused" if code > 0 else "failed"
        return
    done.words = ""
    result = json.loads((place / "out" / "result.json").read_text("utf-8"))
    done.wrong = contradictions(result)
    done.verdict = result["verdict"]
    done.found = [e["id"] for e in result["effects"]]
    done.equivalent = [list(e["equivalent"]) for e in result["effects"]]
    done.channel = result["residual"]["channel"]
    noise = np.sqrt(np.mean([f["noise_rms"] ** 2 for f in truth["files"]]))
    outputs = result["error"]["after"].get("outputs", {})
    after = outputs.get("radius") or outputs.get("displacement") or result["error"]["after"]
    floor = result["noise_floor"]
    floor = next(iter(floor.values())) if isinstance(floor, dict) else floor
    done.floor = _ratio(floor, noise)
    done.held_out = _ratio(after.get("held_out_rmse"), noise)


def _ratio(value: float | None, noise: float) -> float:
    return np.nan if value is None else float(value / noise)


def contradictions(result: dict) -> list[str]:
    """Where a result.json is not as design.md has it, or says two things that cannot both be."""
    wrong = [
        f"no {key}"
        for key in ("verdict", "effects", "error", "noise_floor", "residual", "invisible", "next_experiment")
        if key not in result
    ]
    verdict, effects = result.get("verdict"), result.get("effects", [])
    if verdict not in VERDICTS:
        wrong.append(f"verdict {verdict!r}")
    if bool(effects) != (verdict in NAMED):
        wrong.append(f"{verdict} with {len(effects)} effects")
    for effect in effects:
        wrong += [
            f"{effect.get('id')}: no {key}"
            for key in ("channel", "equivalent", "evidence", "explained", "parameters")
            if key not in effect
        ]
        if effect.get("explained", 0) < 0:
            wrong.append(f"{effect['id']} explains {effect['explained']}")
        for name, p in effect.get("parameters", {}).items():
            low, high = p["ci95"]  # null where it is open, at a bound
            if (low is not None and p["value"] < low) or (high is not None and p["value"] > high):
                wrong.append(f"{name} outside its interval")
    errors = result.get("error", {})
    before, after = (errors.get(k, {}).get("held_out_rmse") for k in ("recalibrated", "after"))
    if effects and before is not None and after is not None and not after < before:
        wrong.append("named without held-out gain")
    if verdict == "ambiguous" and not any(e.get("equivalent") for e in effects):
        wrong.append("ambiguous between nothing")
    return wrong


def _identify(done: Trial, place: Path, truth: dict) -> None:
    started = time.perf_counter()
    code, words = command("identify", str(place / "data"), "--out", str(place / "identified"))
    done.identify_seconds = time.perf_counter() - started
    if code:
        done.identify = "refused" if code > 0 else "failed"
        done.words = done.words or words
        return
    found = json.loads((place / "identified" / "parameters.json").read_text("utf-8"))
    done.identify = found["verdict"]
    for name, value in truth["identified"].items():
        low, high = found["parameters"][name]["ci95"]  # null where it is open, at a bound
        done.covered[name] = (low is None or low <= value) and (high is None or value <= high)


def command(*words: str) -> tuple[int, str]:
    """Exit code of a command and the last line it wrote to stderr; -1 where it broke or took more than LIMIT."""
    from tubular_dea.cli import main

    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), _limited(LIMIT):
            code = main(list(words))
    except SystemExit as stopped:
        code = stopped.code
    except Exception as problem:
        return -1, f"{type(problem).__name__}: {problem}"
    lines = [line for line in said.getvalue().splitlines() if line.strip()]
    last = lines[-1] if lines else ""
    return (code if isinstance(code, int) else int(code is not None)), str(code) if isinstance(code, str) else last


@contextlib.contextmanager
def _limited(seconds: int) -> Iterator[None]:
    def stop(*_: object) -> None:
        raise TimeoutError(f"more than {seconds} s of cpu")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def first_channel(done: Trial) -> str | None:
    """Where the first named effect acts."""
    return channel(done.found[0]) if done.found and done.found[0] in detect.EVERYTHING else None
