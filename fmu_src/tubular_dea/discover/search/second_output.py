"""A second output that depends on rates, such as a current: it can distinguish otherwise equivalent effects.

It takes no part in fits: where an input moves fast, a current of some mA decays within a sample, and its monitor has
its own zero, gain and delay. But it shows which of two equally good explanations predicts it better. Their squared
residuals are compared stretch by stretch (a paired test), so its noise need not be known. And where nearly nothing
flows as the model has it, the record shows whether something else does: a leakage.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...identify.fitting.compiled import Ids
from ...identify.signals.monitors import noise_level, resolution
from ...identify.study.study import Piece, Study
from ...kernel import KernelError
from ...stretches import true_stretches
from ..options.options import Option
from .revision import Search

# Set by judgement. Check: `python -m blind.current --seed 4000`
STRETCHES = 40  # [1] parts of a record whose squares are compared
BEYOND_CHANCE = 4.0  # [standard errors] by which an explanation has to leave more squares than another to be given up

# Set by judgement. Check: `pytest tests/test_second_output.py`, `python -m blind.current --seed 4000`
NEXT_TO_NOTHING = 3.0  # [standard deviations] of the monitor's noise: the model's answer is next to nothing below it
AFTER_FLOW = 10  # [samples] from where the answer is more, as instants are not known to better than some samples
STRETCH = 20  # [samples] of which a median is taken there
FEWEST_MEDIANS = 4  # [1] such medians that tell
LEAST_MISSED = 5.0  # [standard deviations] of the monitor's noise by which medians differ that are not explained


@dataclass(frozen=True)
class Predicted:
    """The record of an output that takes no part in fits, and a model's prediction of it, each (n,)."""

    piece: Piece
    output: str
    record: np.ndarray
    answer: np.ndarray


def predicted(study: Study, ids: Ids, values: Mapping[str, float]) -> list[Predicted]:
    """The outputs that take no part in fits, predicted by the model with effects `ids` (`KernelError` where it cannot
    be solved).

    The zero, the gain and the delay of each file's monitor are at their most likely values.
    """
    return [replace(one, answer=_as_read(one.record, one.answer)) for one in _answered(study, ids, values)]


def _answered(study: Study, ids: Ids, values: Mapping[str, float]) -> list[Predicted]:
    """The same with the model's own answers."""
    asked = [(p, *one) for p in study.pieces for one in p.beside]
    answers = study.asked(ids, [replace(p.case, readings=(r,)) for p, r, _ in asked]).outputs(values)
    return [Predicted(p, r.output, record, answer) for (p, r, record), answer in zip(asked, answers, strict=True)]


@dataclass(frozen=True)
class Missed:
    """By what an `output` that takes no part in fits differs in a piece where the model's answer is next to nothing:
    `value` [SI], the standard deviation of its medians."""

    output: str
    piece: str
    value: float


def missed(study: Study, option: Option) -> Missed | None:
    """The largest such difference, in any piece, of those beyond noise; None where there is none."""
    found: dict[float, Missed] = {}
    try:
        rows = _answered(study, option.ids, option.fitted.values)
    except KernelError:
        return None
    for row in rows:
        noise = max(noise_level(row.record), resolution(row.record))
        medians = _at_nothing(row.record, row.answer, noise)
        if medians.size >= FEWEST_MEDIANS and (value := float(np.std(medians))) > LEAST_MISSED * noise > 0:
            found[value / noise] = Missed(row.output, row.piece.name, value)
    return found[max(found)] if found else None


def _at_nothing(record: np.ndarray, answer: np.ndarray, noise: float) -> np.ndarray:
    """Medians of a record (n,) over stretches in which the model's answer (n,) is next to nothing.

    A current that flows within a sample, where an input switches, stands in one sample of the record and in none of the
    answer, or the other way round.
    """
    flows = np.abs(answer) > NEXT_TO_NOTHING * noise
    near = np.convolve(flows, np.ones(2 * AFTER_FLOW + 1), mode="same") > 0
    stretches = [np.arange(a, b) for a, b in true_stretches(~near)]
    parts = [part for s in stretches for part in np.array_split(s, max(1, s.size // STRETCH)) if s.size >= STRETCH]
    return np.array([float(np.median(record[part])) for part in parts])


def _as_read(record: np.ndarray, answer: np.ndarray) -> np.ndarray:
    """The prediction with the zero, gain and (first-order) delay that fit the record best."""
    columns = np.column_stack([np.ones(answer.size), answer, np.gradient(answer)])
    return columns @ np.linalg.lstsq(columns, record, rcond=None)[0]


def distinguished(study: Study, found: Search, equivalent: Mapping[str, list[str]]) -> dict[str, list[str]]:
    """The sets of equivalent effects without those that predict the second outputs worse than another.

    The best of a set takes the first one's place in the choice.
    """
    kept = {name: list(others) for name, others in equivalent.items()}
    if not any(p.beside for p in study.pieces):
        return kept
    for name, others in equivalent.items():
        squares = {n: _squares(study, _with(found, name, n)) for n in (name, *others)}
        known = {n: s for n, s in squares.items() if s is not None}
        if len(known) < 2:
            continue
        best = min(known, key=lambda n: float(known[n].sum()))
        left = [n for n in (name, *others) if n not in known or _as_good(known[n] - known[best])]
        if name not in left:
            _exchange(found, name, best)
            kept = {best if n == name else n: o for n, o in kept.items()}
        first = name if name in left else best
        kept[first] = [n for n in left if n != first]
    return kept


def _as_good(more: np.ndarray) -> bool:
    """Whether the excess of squares over the best's, by stretch (k,), may be chance."""
    error = float(np.std(more, ddof=1)) / np.sqrt(more.size)
    return float(more.mean()) <= BEYOND_CHANCE * error


def _squares(study: Study, option: Option | None) -> np.ndarray | None:
    """The squared residuals of an option on the second outputs, by stretch (k,); None where it cannot be solved."""
    if option is None:
        return None
    try:
        rows = predicted(study, option.ids, option.fitted.values)
    except KernelError:
        return None
    each = [np.array_split((r.record - r.answer) ** 2 / float(np.mean(r.record**2)), STRETCHES) for r in rows]
    return np.array([float(part.sum()) for parts in each for part in parts])


def _with(found: Search, name: str, other: str) -> Option | None:
    """The fitted option that has another effect in place of one of the choice."""
    ids = {other if i == name else i for i in found.chosen.ids}
    return next((o for o in (found.chosen, *found.rivals) if set(o.ids) == ids), None)


def _exchange(found: Search, name: str, best: str) -> None:
    """Replace an effect of the choice by the better one; the previous choice becomes a rival."""
    option, before = _with(found, name, best), found.chosen
    if option is None:
        return
    found.chosen = option
    found.rivals = [before, *(o for o in found.rivals if o is not option)]
    found.gains = {best if n == name else n: gain for n, gain in found.gains.items()}
