"""What differs from file to file: errors, zeros, gains, starts."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...identify.records.experiment import UNKNOWN
from ...identify.records.start import anywhere
from ...identify.study.nuisances import GAIN, zero_spread
from ...identify.study.spreads import most_spread
from ...model.units import in_units_of
from ..engine import Discovery
from ..options.acceptance import clean, noise_alone

# Set by judgement. Check: `python -m blind.score --external 12 --seed 1000`
AT_MOST = 0.99  # [1] of the largest spread that zeros may have: from there on it is a bound, no estimate
ODD = 1.4  # [1] times the usual error of a file from which on one is odd: nine samples that a laser lost made 4
FEW_ODD = 1 / 3  # [1] share of the files that are odd at most; with more, they differ in what was done


def odd_files(found: Discovery, after: Mapping[str, Any]) -> list[str]:
    """A few files with a far larger error than the others: something may have happened in these alone; `after` are the
    errors of the first output as `outcome.errors` gives them."""
    usual, odd = _odd(after)
    if not odd:
        return []
    most = max(odd, key=lambda name: odd[name])
    rest = f"in {' and '.join(odd)} it is up to" if len(odd) > 1 else f"in {most} it is"
    return [
        f"The error is {in_units_of(usual, after)} in most files, and {rest} "
        f"{in_units_of(odd[most], after)}: look there for something that happened in no other file."
    ]


def in_few_files(found: Discovery, after: Mapping[str, Any]) -> str:
    """Why no effect may be seen though one is there: the residual is clean with slow noise alone, and a few files have
    most of it, as noise would not. "" where it is not so, and where implausible parameters say it; `after` as in
    `odd_files`."""
    if found.strained or found.verdict != "no_effect" or clean(found.named.lack_of_fit):
        return ""
    usual, odd = _odd(after)
    if not odd:
        return ""
    has = "has" if len(odd) == 1 else "have"
    most = in_units_of(max(odd.values()), after)
    return f"{' and '.join(odd)} {has} an error of {most}, the others of {in_units_of(usual, after)}"


def _odd(after: Mapping[str, Any]) -> tuple[float, dict[str, float]]:
    """The usual error of a file, and the errors of the few that are odd, by name (SI)."""
    each = {name: e["rmse"] for name, e in after["per_experiment"].items() if e["rmse"] is not None}
    usual = float(np.median([*each.values()])) if each else 0.0
    odd = {name: rms for name, rms in each.items() if rms > ODD * usual}
    return usual, odd if usual and len(odd) <= FEW_ODD * len(each) else {}


def unlike(found: Discovery) -> list[str]:
    """Gains that no monitor has, file by file."""
    if found.unlike is None:
        return []
    changes = found.unlike.changes
    inputs = dict.fromkeys(name for own in changes.values() for name in own)
    large = [n for n in inputs if max(abs(own.get(n, 0.0)) for own in changes.values()) > GAIN]
    each = {n: [f"{own[n]:+.1%} in {piece}" for piece, own in changes.items() if n in own] for n in large}
    told = [f"{n} {', '.join(files)}" for n, files in each.items()]
    moved = found.study.plant.quantity(found.unlike.output).in_words(found.unlike.value)
    together = "The files are explained together only as if gains of monitors changed between them"
    if not noise_alone(found.named):
        together = "In the fits gains of monitors changed between the files, which may make up for what the model lacks"
    return [
        f"{together} ({'; '.join(told)}). In "
        f"{found.unlike.piece} that of {found.unlike.input} moves {found.unlike.output} by {moved} (rms). Monitors "
        f"hardly change by more than {GAIN:.1%}: was another specimen recorded in some files, a part "
        "of it lost, or a scale set anew? All errors here allow for these gains (`records` in result.json); parameters "
        "are those of a mean of the files."
    ]


def disagree(found: Discovery) -> bool:
    """Whether all that is missing is that files differ: with gains that no monitor has, the base explains them."""
    return found.verdict == "unexplained" and found.unlike is not None and noise_alone(found.named)


def implausible_zero(found: Discovery) -> list[str]:
    """A zero that no sensor has."""
    if found.shifted is None:
        return []
    shift = found.shifted
    q = found.study.plant.quantity(shift.output)
    off, usual = (q.in_words(v) for v in (shift.value, found.study.zero(shift.output)))
    return [
        f"In {shift.piece}, {shift.output} would have to read {off} too much; its zero is usually {usual}. The plant "
        "differs between the files, or the model lacks what shifts it. Errors are computed without this shift."
    ]


def assumed(found: Discovery) -> list[str]:
    """Zeros that the plant does not declare, and that explain what effects would have had to."""
    study, plant = found.study, found.study.plant
    if not study.assumed:
        return []
    inputs = {s.name for s in plant.inputs}
    sizes = {n: zero_spread(study, n) for n in study.assumed}
    told = ", ".join(f"of {n} {plant.quantity(n).in_words(size)}" for n, size in sizes.items())
    kinds = {n: "Input" if n in inputs else "Output" for n in study.assumed}
    declared = " and ".join(f'{kind}("{n}", zero=...)' for n, kind in kinds.items())
    return [
        f"The files agree only if each has zeros of its own ({told}; rms): without these, effects would be named for "
        f"them, or something would seem to be missing. The plant declares none: if its sensors have such zeros, give "
        f"their usual size, as {declared}; if they have none, say zero=0."
    ]


def spread(found: Discovery) -> list[str]:
    """Zeros that differ from file to file by more than what is usual on the bench, but for one told by `shifted`."""
    said, lacks = [], not noise_alone(found.named)
    for name in found.study.spread:
        told_before = found.shifted is not None and found.shifted.output == name
        if not told_before and 0 < found.study.zero(name) < (spread := zero_spread(found.study, name)):
            told = found.study.plant.quantity(name).in_words(spread)
            if lacks:
                said.append(
                    f"In the fits the zero of {name} differs by {told} from file to file: it may make up for what the "
                    "model lacks."
                )
            elif found.study.spread[name] >= AT_MOST * most_spread(found.study, name):
                said.append(
                    f"By how much the zero of {name} differs from file to file, these recordings do not tell: up to "
                    f"{told} was allowed for. Record each file from rest, or its zero before."
                )
            elif anywhere(found.study.plant) and name in found.study.noise:  # alike in all files, or not
                said.append(f"The zeros of {name} are about {told}.")
            else:
                said.append(f"The zero of {name} differs by {told} from file to file.")
    return said


def starts(found: Discovery) -> list[str]:
    """Files that do not begin at rest, and files that follow others."""
    own, starts = {p.source for p in found.study.pieces if p.loose}, found.recordings.starts
    after = [e for e in found.recordings.experiments if e.follows]
    loaded = [e.name for e in found.recordings.experiments if starts[e.name] == UNKNOWN and not e.follows]
    cut = {e.name for e in found.recordings.experiments if e.part_of not in ("", e.name)}
    free, settled = ([n for n in loaded if (n in own) == is_free] for is_free in (True, False))
    said = []
    if after:
        pairs = ", ".join(f"{e.name} follows {e.follows}" for e in after)
        said.append(
            f"As bench.toml says ([order]), {pairs}: each is computed from where the one before it ends; in between, "
            "the plant is under the inputs with which the next one begins."
        )
    if free:
        settled_there = (
            " If a file began at rest under its first load, say so in bench.toml ([start], and below it, for each such "
            f'file, {json.dumps(free[0], ensure_ascii=False)} = "equilibrium"): smaller effects can then be seen in it.'
            if found.study.plant.model.curve and not cut.issuperset(free)
            else ""
        )
        said.append(
            f"{', '.join(free)} begin{'s' if len(free) == 1 else ''} under load: the states at the start are "
            f"estimated from the record, and a slow effect may hide in them.{settled_there}"
        )
    if settled:
        effects = " and ".join(found.search.chosen.ids) or "an effect"
        said.append(
            f"{', '.join(settled)} begin{'s' if len(settled) == 1 else ''} under load, and at equilibrium with it: "
            f"together with {effects}, this explains more than unknown states at every start. If it was not so, say so "
            'in bench.toml: [start] and NAME = "unknown".'
        )
    return said


def in_a_row(found: Discovery) -> list[str]:
    """That files of one specimen belong together, where what was found outlasts a record."""
    lasting = [n for n in found.named.ids if found.study.catalogue[n].lasting]
    files = found.recordings.experiments
    if not lasting or len(files) < 2 or any(e.follows for e in files):
        return []
    return [
        f"What {' and '.join(lasting)} change{'s' * (len(lasting) == 1)} outlasts a record, but each was computed as "
        "if nothing had been done to the plant before. If files were recorded one after the other, say when each began "
        "([order] in bench.toml)."
    ]
