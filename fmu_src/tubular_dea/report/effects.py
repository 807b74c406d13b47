"""The section on a found effect: what it is, how large, its own characteristic, and the residual over its variables.

Nothing here depends on a particular effect. Its own curve is made from its declaration (`own_curve`). The
residual is drawn over whichever quantity of its equation, or of its own states, explains most of it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..discover.answer.determined import SPANS, determined
from ..discover.answer.own_curve import Excitation, IsolatedEffect, OwnCurve, own_curve
from ..discover.engine import Discovery
from ..kernel import KernelError
from ..model.declare import Model, Quantity
from ..model.effect import Effect, equations
from ..model.units import factor, readable, with_ends
from .page import Page
from .parts import AFTER, BEFORE, percent, shown_unit, usual_scale
from .residuals import Answered, answered
from .svg import QUIET, Plot, span

SMALL = 0.05  # of the range of what an effect changes: a change that is smaller is drawn by itself
BINS, LEAST, PART = 16, 25, 1e-3  # places along an axis at which the residual is averaged; samples at each, and share
A_LINE = 4  # places that a line goes through at least
TURNS = 1.3  # times as much that is explained if rising and falling are kept apart, where they are
LITTLE = 0.3  # of the usual weight: samples that fits gave less are left out
BETTER = 1.5  # times as much that another axis has to explain than one before it
TURNING = {0: "", 1: ", rising", -1: ", falling"}
KINDS = {
    "curve": "{shown} over {over}, with the effect{band} and without (dashed). Everything else is held where the "
    "effect is largest.",
    "loop": "{shown} over {over}, with the effect{band} and without (dashed). The first cycle covers a part of the "
    "range, the second all of it. The loop is the same at any speed.",
    "step": "{shown} after a step of {moved}, with the effect{band} and without (dashed).",
    "time": "{shown} over the time since the start, with the effect{band} and without (dashed), with all else at rest.",
}
BAND = " (line; the band is its 95 % interval)"


def effects(page: Page, found: Discovery, outcome: dict[str, Any]) -> None:
    """A section for every effect that is named."""
    if not outcome["effects"]:
        return
    excitations = list(_excitations(found))
    first = {a.piece.name: a for a in reversed(list(answered(found)))}  # of every piece its first output
    records = [first[p.name] for p in found.study.pieces]
    held = {s.name for s in found.study.plant.inputs if s.held}
    for entry in outcome["effects"]:
        effect = found.study.catalogue[entry["id"]]
        isolated = IsolatedEffect(found.study.plant.model, effect, found.named.fitted, held)
        page.heading(f"What was found: {effect.id}")
        page.text(f"{effect.summary}. {_share(entry['explained'], len(outcome['effects']))}")
        page.table(["how large", "", "95 % interval", "name"], _sizes(effect, entry, found.study.plant.model))
        if effect.drawing:
            page.lines(effect.drawing, drawing=True)
        page.lines(re.sub(r"`(.+?)`", r"“\1”", equations(found.study.plant.model, effect)))
        try:
            _pictures(page, effect, isolated, excitations, records)
        except KernelError as error:  # alone, or as far as all of its range, it may have no answer
            page.text(f"It cannot be drawn by itself: {error}.")


def _pictures(
    page: Page, effect: Effect, isolated: IsolatedEffect, excitations: Sequence[Excitation], records: Sequence[Answered]
) -> None:
    """An effect's own curve, and the residual over what it depends on."""
    curve = own_curve(isolated, excitations)
    drawn = [] if curve is None else [_own(effect, curve)]
    if all({"before", "after"} <= r.models.keys() for r in records):
        drawn.append(_over(isolated, excitations, records))
    page.drawings(drawn)
    if curve is None:
        page.text(_constant(isolated, excitations))


def _share(explained: float, effects: int) -> str:
    """What an effect explains; of several each explains the less the more the others make up for it."""
    if effects == 1:
        return f"It explains {percent(explained)} of the residual beyond noise."
    return f"Without it, the others would leave {percent(explained)} of the residual beyond noise."


def size_words(effect: Effect, entry: dict[str, Any], model: Model) -> str:
    """The sizes of an effect in a sentence; of those that the recordings do not determine only which these are."""
    known, unknown = [], []
    for words, value, interval, name in _sizes(effect, entry, model):
        meaning = f"{words[0].lower()}{words[1:]}"
        if determined(effect, name, entry["parameters"][name]["ci95"]):
            what, _, explained = meaning.partition(": ")
            known.append(f"{what} = {value} ({explained and explained + '; '}95 % interval {interval})")
        else:
            unknown.append(meaning.split(":", maxsplit=1)[0])
    rest = [f"not determined by these recordings: {', '.join(unknown)}"] if unknown else []
    return "; ".join([", ".join(known)] * bool(known) + rest)


def _sizes(effect: Effect, entry: dict[str, Any], model: Model) -> list[list[str]]:
    """Of every parameter that was identified: what it is, its value, its interval, its name."""
    meaning, rows = {q.name: q.description for q in effect.parameters}, []
    for name, p in entry["parameters"].items():
        scale, unit = usual_scale(p["value"], p["unit"], model)
        value, low, high = with_ends(p["value"] / scale, [None if e is None else e / scale for e in p["ci95"]])
        shown = f"{value} {unit}".removesuffix(" 1")
        told = determined(effect, name, p["ci95"])
        interval = f"above {low}" if _open_above(p["ci95"]) else f"{low} to {high}"
        rows.append([meaning[name], shown, interval if told else "not determined", name])
    return rows


def _open_above(ends: Sequence[float | None]) -> bool:
    """Whether an interval goes on to where nothing tells any more: a level that may lie anywhere above."""
    low, high = ends
    return low is not None and high is not None and 0 < SPANS * low < high


def _excitations(found: Discovery) -> Iterator[Excitation]:
    """Inputs and states of the plant along every piece, as the model with the named effects has them."""
    study, named = found.study, found.named
    runs = study.response(named.ids, study.pieces).trajectories(named.fitted.values)
    states = [s.quantity.name for s in study.plant.model.states]
    for piece, run in zip(study.pieces, runs, strict=True):
        times = piece.case.readings[0].times
        at = np.searchsorted(run.time, times)
        yield Excitation(times, {n: run[n][at] for n in states} | piece.case.protocol.at(times))


def _own(effect: Effect, curve: OwnCurve) -> tuple[str, str]:
    """The effect's own curve; its change alone, where that is small beside what it changes."""
    small = np.abs(curve.on - curve.off).max() < SMALL * np.ptp(curve.off)
    less = curve.off if small else np.zeros_like(curve.off)
    on, low, high, off = (v - less for v in (curve.on, curve.low, curve.high, curve.off))
    scale, unit = _unit(curve.shown, np.concatenate([on, off]))
    x_scale, x_unit = _unit(curve.over, curve.x) if curve.over else readable(float(np.ptp(curve.x)), "s")
    x_name = curve.over.name if curve.over else "time"
    labels = _label(x_name, x_unit), _label(f"change of {curve.shown.name}" if small else curve.shown.name, unit)
    banded = bool(np.all(np.isfinite(low + high)))
    ends = span(on / scale, off / scale, *((low / scale, high / scale) if banded else ()))
    plot = Plot(f"{effect.id} alone", span(curve.x / x_scale), ends, labels)
    if banded:
        plot.band(curve.x / x_scale, low / scale, high / scale, AFTER, "95 % band")
    plot.line(curve.x / x_scale, off / scale, QUIET, "without", dashed=True)
    plot.line(curve.x / x_scale, on / scale, AFTER, "with the effect")
    shown = f"The effect alone: {_meaning(curve.shown)}" + (" (its change)" if small else "")
    words = KINDS[curve.kind].format(
        shown=shown,
        over=_meaning(curve.over) if curve.over else "",
        moved=_step(curve) if curve.moved else "",
        band=BAND if banded else "",
    )
    return plot.svg(), words if banded else f"{words} There is no band: the model cannot be solved at its ends."


def _step(curve: OwnCurve) -> str:
    """What the step moves, and from where to where."""
    assert curve.moved is not None
    return f"{'it' if curve.moved == curve.shown else _meaning(curve.moved)} {_between(curve)}"


def _between(curve: OwnCurve) -> str:
    """The ends of a step in words, to a hundredth of the larger, or a tenth of what is between them."""
    assert curve.moved is not None
    scale, unit = _unit(curve.moved, np.array(curve.ends))
    ends = np.array(curve.ends) / scale
    largest, apart = float(np.abs(ends).max()), float(np.ptp(ends)) or np.inf
    digits = max(2 - math.ceil(math.log10(largest)), 1 - math.ceil(math.log10(min(apart, largest))))
    low, high = np.round(ends, digits) + 0.0
    return f"from {low:.8g} to {high:.8g} {unit}".removesuffix(" 1")


def _constant(isolated: IsolatedEffect, excitations: Sequence[Excitation]) -> str:
    """An effect that is constant, whatever moves, in a sentence."""
    excitation = excitations[0]
    on, off = (isolated.run(excitation, v)[isolated.cut.output][-1] for v in (isolated.on, isolated.off))
    scale, unit = _unit(isolated.shown, np.array([on, off]))
    values = f"{on / scale:.4g} instead of {off / scale:.4g} {unit}".removesuffix(" 1")
    if unit != "1" and np.ptp(isolated.run(excitation, isolated.off)[isolated.cut.output]) > 0:
        change, unit = readable(float(on - off), isolated.shown.unit)
        values = f"{(on - off) / change:+.4g} {unit}"
    return f"The effect alone is constant: {_meaning(isolated.shown)}, {values}."


@dataclass(frozen=True)
class _Axis:
    """A quantity along all records: x (N,), and which way it goes there, (N,) of 1, -1 and 0."""

    quantity: Quantity
    x: np.ndarray
    turn: np.ndarray

    @classmethod
    def of(cls, quantity: Quantity, excitations: Sequence[Excitation], values: Sequence[np.ndarray]) -> _Axis:
        rates = np.concatenate([np.gradient(v, c.time) for v, c in zip(values, excitations, strict=True)])
        turn = np.sign(rates) * (np.abs(rates) > 1e-3 * np.abs(rates).max())
        return cls(quantity, np.concatenate(list(values)), turn)

    @property
    def least(self) -> float:
        """Samples at a place, from which on their average is shown."""
        return max(LEAST, PART * self.x.size)

    @property
    def place(self) -> np.ndarray:
        """The bin of every sample: half of them equally wide, half with equally many samples."""
        wide = np.linspace(self.x.min(), self.x.max(), BINS + 1)
        edges = np.unique(np.concatenate([wide, np.quantile(self.x, np.linspace(0, 1, BINS + 1))]))
        return np.clip(np.searchsorted(edges, self.x, side="right") - 1, 0, max(edges.size - 2, 0))

    @property
    def both_ways(self) -> bool:
        """Whether rising and falling samples are at enough places each for a line."""
        counts = [np.bincount(self.place[self.turn == turn], minlength=1) for turn in (1, -1)]
        return all(np.count_nonzero(count >= self.least) >= A_LINE for count in counts)

    def explained(self, residual: np.ndarray, apart: bool) -> float:
        """The share of the residual's squares that its averages along the axis have; rising and falling `apart`."""
        key = self.place * 3 + (self.turn + 1 if apart else 0)
        _, groups = np.unique(key, return_inverse=True)
        sums, counts = np.bincount(groups, residual), np.bincount(groups)
        kept = counts >= self.least
        return float(np.sum(sums[kept] ** 2 / counts[kept])) / max(float(residual @ residual), 1e-300)


def _over(isolated: IsolatedEffect, excitations: Sequence[Excitation], records: Sequence[Answered]) -> tuple[str, str]:
    """The residual before and after over what the effect depends on."""
    to_si = factor(records[0].unit, records[0].quantity.unit)
    left = {n: to_si * np.concatenate([r.record - r.models[n] for r in records]) for n in ("before", "after")}
    weight = np.concatenate([r.weight for r in records])
    weight = np.minimum(weight / np.median(weight), 1.0)  # at rest a few samples may have by far the largest
    axis, apart = _chosen(list(_axes(isolated, excitations)), left["before"] * weight)
    averages = {
        (name, turn): _averages(axis, residual, turn, weight > LITTLE)
        for name, residual in left.items()
        for turn in ((1, -1) if apart else (0,))
    }
    x_scale, x_unit = _unit(axis.quantity, axis.x)
    reached = np.concatenate([x for x, *_ in averages.values()])
    sizes = np.concatenate([v for _, *rest in averages.values() for v in (rest[1:2] if apart else rest)])
    y_scale, y_unit = readable(float(np.abs(sizes).max(initial=0.0)), records[0].quantity.unit)
    labels = _label(axis.quantity.name, x_unit), _label("residual", y_unit)
    plot = Plot(f"{isolated.effect.id}: the residual", span(reached / x_scale), span(sizes / y_scale), labels)
    plot.level(0.0)
    for (name, turn), (x, low, mean, high) in averages.items():
        colour = BEFORE if name == "before" else AFTER
        if not apart:
            plot.band(x / x_scale, low / y_scale, high / y_scale, colour)
        plot.line(x / x_scale, mean / y_scale, colour, f"{name}{TURNING[turn]}", dashed=turn < 0)
    bands = " while that rises and while it falls" if apart else " and the middle half of the samples (bands)"
    return plot.svg(), (
        f"The residual (record less model) over {_meaning(axis.quantity)}: its mean (lines){bands}. A line that is "
        "flat at 0 means that nothing is left to explain."
    )


def _axes(isolated: IsolatedEffect, excitations: Sequence[Excitation]) -> Iterator[_Axis]:
    """What the residual may be drawn over: what the effect acts on, what it changes, and its own states."""
    cut = isolated.cut
    for name in dict.fromkeys([*cut.drivers, *cut.acts_on]):
        yield _Axis.of(isolated.base.quantity(name), excitations, [c.given[name] for c in excitations])
    shown = isolated.shown
    change = replace(shown, name=f"change of {shown.name}", description=f"what the effect adds to {_meaning(shown)}")
    yield _Axis.of(change, excitations, [isolated.change(c) for c in excitations])
    runs = [isolated.run(c, isolated.on) for c in excitations]
    for state in cut.model.states:
        yield _Axis.of(state.quantity, excitations, [r[state.quantity.name] for r in runs])


def _chosen(axes: Sequence[_Axis], residual: np.ndarray) -> tuple[_Axis, bool]:
    """The axis along which the residual is explained best (a later one has to do so clearly better), and whether with
    rising and falling apart."""
    best, most, turns = axes[0], -1.0, False
    for axis in axes:
        together = axis.explained(residual, False)
        apart = axis.explained(residual, True) if axis.both_ways else 0.0
        if max(together, apart) > BETTER * most:
            best, most, turns = axis, max(together, apart), apart > TURNS * together
    return best, turns


def _averages(axis: _Axis, residual: np.ndarray, turn: int, kept: np.ndarray) -> tuple[np.ndarray, ...]:
    """Of every place along an axis: x, and the lower quartile, mean and upper quartile of the residual there."""
    kept = kept & (axis.turn == turn) if turn else kept
    rows = []
    for place in np.unique(axis.place[kept]):
        here = kept & (axis.place == place)
        if here.sum() >= axis.least:
            low, high = np.quantile(residual[here], [0.25, 0.75])
            rows.append((axis.x[here].mean(), low, residual[here].mean(), high))
    return tuple(np.array(rows).reshape(-1, 4).T)


def _unit(q: Quantity, values: np.ndarray) -> tuple[float, str]:
    """Factor and name of the unit in which some values are shown: the customary one, else one that makes them short."""
    return shown_unit(q) if q.display_unit else readable(float(np.abs(values).max()), q.unit)


def _label(name: str, unit: str) -> str:
    return name if unit == "1" else f"{name} [{unit}]"


def _meaning(q: Quantity) -> str:
    """The description of a quantity for a sentence; its name if it has none."""
    return f"{q.description[0].lower()}{q.description[1:]}" if q.description else q.name.replace("_", " ")
