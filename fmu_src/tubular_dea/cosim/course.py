"""The assessment of a run: the fate of each beat, the indices over the assisted beats, and a verdict in words.

Usage::

    course = follow(runs["without assist"], runs["with assist"])
    course.verdict.text, course.beats["assisted"], course.rows()
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..model import scheduler
from ..model.units import factor, signed
from .beats import INDICES, BeatError, ShownIndex, beats, measure, r_wave_rows, shown
from .master import Run

# The possible fates of a beat, in the order in which they are checked.
FATES = ("vetoed", "assisted", "skipped", "after a lost rhythm", "learning", "without a pulse")
# Assisted beats after the first R whose pulse came, until tube and arteries have followed: the slow branch of the wall
# takes 2.7 s, but the heart and its arteries are in step after two beats to 1 % of the change (failing heart, 5.5 kV:
# `tubular-dea assist --beats 30`, with_assist.csv).
SETTLING, SETTLED = 2, "third"  # the first beat after them
COUNTS = tuple(name for name in scheduler.COUNTS if name != "notches")


@dataclass(frozen=True)
class Spread:
    """One figure over several beats, in SI units."""

    mean: float
    deviation: float
    worst: float
    beats: int


@dataclass(frozen=True)
class Verdict:
    """ "assisted", "partly" or "not", and a sentence with the reason."""

    word: str
    text: str


@dataclass(frozen=True)
class Course:
    """A run with assist beside the one without: `fates` of its beats, indices by name over the `judged` ones."""

    fates: tuple[str, ...]
    premature: int
    judged: tuple[int, ...]
    without: dict[str, Spread]
    assisted: dict[str, Spread]
    largest_field: float
    smallest_margin: float
    counted: dict[str, int]
    verdict: Verdict

    @property
    def judged_words(self) -> str:
        """Over which beats the indices are: "10 beats, from the third assisted on"."""
        settled = self.fates.count("assisted") - len(self.judged) == SETTLING
        return f"{len(self.judged)} beats" + (f", from the {SETTLED} assisted on" if settled else "")

    def change(self, name: str) -> float | None:
        """Relative change of a figure's mean, where both have the same sign; None where it is not meaningful."""
        if name not in self.without or name not in self.assisted:
            return None
        a, b = self.without[name].mean, self.assisted[name].mean
        return b / a - 1 if a * b > 0 and 0.1 < abs(b / a) < 10 else None

    def rows(self) -> list[tuple[str, str, str, str, str]]:
        """Rows (figure with unit, without, with and its spread, worst, change) in customary units."""
        rows = [_row(f, self) for f in INDICES if f.name in self.assisted or f.name in self.without]
        gained = [(label, function(self)) for label, function in COMPARED.items()]
        return rows + [(f"{label} [mmHg]", "", signed(v * PA, 2), "", "") for label, v in gained if v is not None]

    def counts(self) -> list[tuple[str, str]]:
        """Rows (quantity, value) about the whole run: beats by fate, pulses, extremes."""
        fates = [(f"beats {fate}" if fate != "vetoed" else "vetoed beats", self.fates.count(fate)) for fate in FATES]
        counted = [
            ("premature beats", self.premature),
            ("pulses", self.counted["pulses"]),
            ("pulses withdrawn because no R wave came", self.counted["withdrawn_pulses"]),
            ("R waves rejected as noise", self.counted["ignored_edges"]),
        ]
        rows = [("whole beats", str(len(self.fates)))]
        rows += [(what, str(n)) for what, n in (*fates, *counted) if n]
        rows.append(("largest field of the whole run [V/um]", f"{self.largest_field * 1e-6:.2f}"))
        return [*rows, ("smallest margin of the whole run [mmHg]", f"{self.smallest_margin * PA:.2f}")]

    def summary(self) -> dict[str, object]:
        """All of it as plain values, in SI units."""
        fate = {f: self.fates.count(f) for f in FATES}
        spread = {
            name: {
                "without": _plain(self.without.get(name)),
                "with": _plain(self.assisted.get(name)),
                "change": self.change(name),
                "unit": figure.si,
            }
            for figure in INDICES
            if (name := figure.name) in self.assisted
        }
        return {
            "verdict": {"word": self.verdict.word, "text": self.verdict.text},
            "beats": fate | {"premature": self.premature, "judged": len(self.judged)},
            "figures": spread,
            "compared": {f.__name__: f(self) for f in COMPARED.values()},
            "whole_run": {"largest_field": self.largest_field, "smallest_margin": self.smallest_margin},
            "scheduler": self.counted,
        }


def systolic_augmentation(course: Course) -> float | None:
    """Peak systolic aortic pressure with assist minus without: negative where the ventricle is unloaded."""
    return _difference(course, "peak_aortic_pressure")


def diastolic_augmentation(course: Course) -> float | None:
    """Peak diastolic aortic pressure with assist minus without, as for balloon pumps.

    S. Scheidt et al., N. Engl. J. Med. 288 (1973) 979-984.
    """
    return _difference(course, "peak_diastolic_pressure")


def early_diastolic_augmentation(course: Course) -> float | None:
    """Mean aortic pressure in early diastole with assist minus without."""
    return _difference(course, "early_diastolic_pressure")


def end_diastolic_pressure_drop(course: Course) -> float | None:
    """End-diastolic aortic pressure without assist minus with: what the ventricle need no longer overcome."""
    difference = _difference(course, "end_diastolic_pressure")
    return None if difference is None else -difference


COMPARED = {
    "systolic augmentation": systolic_augmentation,
    "diastolic augmentation": diastolic_augmentation,
    "early-diastolic augmentation": early_diastolic_augmentation,
    "end-diastolic pressure drop": end_diastolic_pressure_drop,
}
PA = factor("Pa", "mmHg")


def follow(without: Run, assisted: Run) -> Course:
    """The assessment of the assisted run, figure by figure, compared with the same beats of the run without."""
    fates, early = _fates(assisted)
    judged = _judged(fates)
    figures = {}
    for name, run in (("without", without), ("with", assisted)):
        whole = beats(run)
        figures[name] = _spreads([measure(whole[i]) for i in judged if i < len(whole)])
    counted = {n: int(assisted[f"scheduler.{n}"][-1]) for n in COUNTS}
    return Course(
        tuple(fates),
        early,
        tuple(judged),
        figures["without"],
        figures["with"],
        float(assisted["tube.electric_field"].max()),
        float(assisted["tube.snap_through_margin"].min()),
        counted,
        _verdict(fates, counted, assisted, figures),
    )


def _fates(run: Run) -> tuple[list[str], int]:
    """The fate of each whole beat, and the number of premature beats."""
    rows = r_wave_rows(run)
    if rows.size < 2:
        raise BeatError(f"expected a run of at least 1 whole beat but it has {max(0, rows.size - 1)}; run it longer")

    def risen(name: str, a: int, b: int) -> bool:
        # What is decided at an R wave shows from the next row on.
        return bool(run[f"scheduler.{name}"][b] > run[f"scheduler.{name}"][a])

    def during(name: str, a: int, b: int) -> bool:
        return bool((run[f"scheduler.{name}"][a + 1 : b + 1] > 0.5).any())

    fates = []
    for a, b in zip(rows[:-1], rows[1:], strict=True):
        happened = {
            "vetoed": during("veto", a, b),
            "assisted": risen("assisted_beats", a, b),
            "skipped": risen("skipped_pulses", a, b),
            "after a lost rhythm": during("lost", a, b),
            "learning": run["scheduler.state"][a + 1] == 0,
        }
        fates.append(next((f for f in FATES[:-1] if happened[f]), FATES[-1]))
    early = sum(risen("premature_beats", a, b) for a, b in zip(rows[:-1], rows[1:], strict=True))
    return fates, early


def _judged(fates: Sequence[str]) -> list[int]:
    """The assisted beats after the start; where there is none, all after learning, or else all."""
    assisted = [i for i, f in enumerate(fates) if f == "assisted"]
    if assisted:
        return assisted[SETTLING:] or assisted
    return [i for i, f in enumerate(fates) if f != "learning"] or list(range(len(fates)))


def _spreads(measured: Sequence[Mapping[str, float]]) -> dict[str, Spread]:
    spreads = {}
    for figure in INDICES:
        values = np.array([m[figure.name] for m in measured if figure.name in m])
        if values.size:
            mean = float(values.mean())
            far = values[np.argmax(np.abs(values - mean))]
            worst = {1: values.max(), -1: values.min(), 0: far}[figure.worse]
            spreads[figure.name] = Spread(mean, float(values.std()), float(worst), values.size)
    return spreads


def _verdict(
    fates: Sequence[str], counted: Mapping[str, int], run: Run, figures: Mapping[str, Mapping[str, Spread]]
) -> Verdict:
    asked = [f for f in fates if f != "learning"]
    helped = asked.count("assisted")
    others = {f: asked.count(f) for f in FATES if f != "assisted" and asked.count(f)}
    why = ", ".join(f"{n} {f}" for f, n in others.items())
    causes = {1: "the field", 2: "the margin to snap-through", 3: "field and margin"}
    if counted["vetoes"]:
        cause = causes.get(int(run["scheduler.veto_cause"][-1]), "a limit")
        why += f" (the scheduler refused the voltage {counted['vetoes']} times, last because of {cause})"
    if not asked:
        return Verdict("not", "Not assisted: the run ended before the rhythm was learned; run more beats.")
    if not helped:
        less = " Ask for less voltage, or let --optimise find what helps." if counted["vetoes"] else ""
        return Verdict(
            "not", f"Not assisted: none of {len(asked)} beats after learning had a whole pulse: {why}.{less}"
        )
    effect = _effect(figures["without"], figures["with"])
    if helped == len(asked):
        return Verdict("assisted", f"Assisted: all {helped} beats after learning. {effect}")
    return Verdict("partly", f"Partly assisted: {helped} of {len(asked)} beats after learning; {why}. {effect}")


def _effect(without: Mapping[str, Spread], assisted: Mapping[str, Spread]) -> str:
    """The benefit in the assisted beats."""
    name = "stroke_work_per_stroke_volume"
    if name not in without or name not in assisted:
        return "None of them ejected blood."
    change = 100 * (assisted[name].mean / without[name].mean - 1)
    if abs(change) < 0.05:
        return "The heart did not benefit: stroke work per stroke volume did not change by 0.1 %."
    if change >= 0:
        return f"The heart did not benefit: stroke work per stroke volume rose by {change:.1f} %."
    return f"Stroke work per stroke volume was {-change:.1f} % lower than without."


def _difference(course: Course, name: str) -> float | None:
    if name not in course.without or name not in course.assisted:
        return None
    return course.assisted[name].mean - course.without[name].mean


def _row(figure: ShownIndex, course: Course) -> tuple[str, str, str, str, str]:
    scale, label = shown(figure), f"{figure.label} [{figure.unit}]"
    a, b = course.without.get(figure.name), course.assisted.get(figure.name)
    digits = _digits(max(abs(s.mean) for s in (a, b) if s) * scale)
    without = f"{a.mean * scale:.{digits}f}" if a else "-"
    if b is None:
        return label, without, "-", "-", "-"
    change = ""
    if a is not None:
        relative = course.change(figure.name)
        change = signed(round(b.mean * scale, digits) - round(a.mean * scale, digits), digits)  # of what is shown
        change += f" ({signed(100 * relative, 1)} %)" if relative is not None else ""
    spread = f"{b.mean * scale:.{digits}f} ± {b.deviation * scale:.{digits}f}"
    return label, without, spread, f"{b.worst * scale:.{digits}f}", change


def _digits(size: float) -> int:
    """Decimals that leave three to four figures."""
    return 1 if size >= 100 else 2 if size >= 1 else 3


def _plain(spread: Spread | None) -> dict[str, float | int] | None:
    if spread is None:
        return None
    return {"mean": spread.mean, "sd": spread.deviation, "worst": spread.worst, "beats": spread.beats}
