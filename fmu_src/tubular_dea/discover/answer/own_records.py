"""What each record has of its own at the named model: where it starts, and what its sensors and monitors read too much.

With these beside model.json a simulation gives the errors of result.json, but for what instants and delays do.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...identify.study.nuisances import GAIN_OF, START_OF, own_numbers
from ...identify.study.study import Piece, Study
from ...kernel import KernelError
from ..engine import Discovery


def own_records(found: Discovery) -> dict[str, dict[str, Any]]:
    """By experiment the likeliest `start` (parameters of the model), `zeros` (of outputs and inputs, to be taken off
    the record; SI units) and `gains` (of inputs, by which what the record then says is to be multiplied); without
    experiments at which the model has no answer.

    One that goes on from another has no start: it says which it `follows`.
    """
    study, option = found.named_study, found.named
    try:
        known = own_numbers(study, option.ids, option.fitted.values)
    except KernelError:
        return {}
    return {
        p.name: _start(study, found, p, own) | {"zeros": _zeros(study, p, own), "gains": _gains(own)}
        for p, own in known
    }


def _start(study: Study, found: Discovery, piece: Piece, own: Mapping[str, float]) -> dict[str, Any]:
    """What the record starts with: as it was settled, and what is left of it beside all other numbers of its own; or
    what it goes on from."""
    if piece.follows:
        return {"follows": piece.follows}
    sizes = study.unknown(found.named.ids, piece)
    return {"start": {n: v + sizes.get(n, 0.0) * own.get(f"{START_OF}{n}", 0.0) for n, v in piece.case.own.items()}}


def _gains(own: Mapping[str, float]) -> dict[str, float]:
    """By input, what multiplies its record."""
    return {n.removeprefix(GAIN_OF): 1.0 + v for n, v in own.items() if n.startswith(GAIN_OF)}


def _zeros(study: Study, piece: Piece, own: Mapping[str, float]) -> dict[str, float]:
    """The zeros of outputs, and those of inputs with what was taken off them at rest."""
    taken, plant = piece.driven.zeros, study.plant
    outputs = {o.name: own[o.name] for o in plant.outputs if o.name in own}
    inputs = {i.name: taken.get(i.name, 0.0) - own.get(i.name, 0.0) for i in plant.inputs if i.name in {*taken, *own}}
    return outputs | inputs
