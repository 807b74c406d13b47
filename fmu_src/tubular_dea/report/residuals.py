"""The residuals of every experiment, before and after the effects were found."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..discover.engine import Discovery
from ..identify.fitting.compiled import Ids
from ..identify.study.nuisances import with_nuisances
from ..identify.study.study import Piece, Study
from ..kernel import KernelError
from ..model.declare import Quantity
from .colours import COLOURS
from .parts import shown_unit, thinned

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Answered:
    """One output of a piece: the record (n,) at `time` (n,) [s], and the answers (n,) of the models by name.

    `label` and `unit` are those in which all of them are shown; `quantity` is the output. Samples
    had the `weight` (n,) in fits.
    """

    piece: Piece
    time: np.ndarray
    record: np.ndarray
    models: dict[str, np.ndarray]
    label: str
    unit: str
    quantity: Quantity
    weight: np.ndarray


def answered(found: Discovery) -> Iterator[Answered]:
    """Every output of every piece beside the base model ("before") and the one with the named effects ("after"), where
    these have an answer."""
    study, base = found.study, found.search.base_study  # a record's own numbers are those that suit each model
    answers = {"before": _answers(base, (), found.base.fitted.values)}
    if found.named.ids:
        answers["after"] = _answers(study, found.named.ids, found.named.fitted.values)
    for k, piece in enumerate(study.pieces):
        own = {name: answer[k] for name, answer in answers.items() if answer is not None}
        for reading, part in zip(piece.case.readings, piece.case.parts, strict=True):
            q = study.plant.quantity(reading.output)
            scale, unit = shown_unit(q)
            models = {name: answer[part] / scale for name, answer in own.items()}
            label = reading.output.replace("_", " ")  # the heading in the files may be that of another quantity
            yield Answered(piece, reading.times, piece.record[part] / scale, models, label, unit, q, piece.weight[part])


def _answers(study: Study, ids: Ids, values: Mapping[str, float]) -> list[np.ndarray] | None:
    """The answers of a model to every piece, with the records' own numbers that suit it; None where it has none."""
    try:
        answers = study.response(ids, study.pieces).outputs(values)
    except KernelError:
        return None
    return [with_nuisances(study, piece, y) for piece, y in zip(study.pieces, answers, strict=True)]


def residuals(found: Discovery, figure: Figure | None = None) -> Figure:
    """The residuals of all experiments, one panel each, in `figure` if it is given."""
    from .figures import legend_above, sized  # matplotlib takes half a second to load, and the report needs none

    shown = list(answered(found))
    figure = sized(figure, 9, 0.8 + 1.5 * len(shown))
    axes = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
    for number, (axis, one) in enumerate(zip(axes, shown, strict=True)):
        for colour, (name, answer) in zip(COLOURS, one.models.items(), strict=False):
            axis.plot(thinned(one.time), thinned(one.record - answer), color=colour, linewidth=1, label=name)
        axis.set_ylabel(f"{one.label} [{one.unit}]")
        held = " (held out)" if one.piece.held_out else ""
        axis.set_title(f"{one.piece.name}{held}", fontsize=9, loc="left")
        axis.grid(alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
        if number == 0:
            legend_above(axis)
    axes[-1].set_xlabel("time [s]")
    figure.suptitle("Residuals: record less model")
    return figure
