"""What the named model leaves of every record."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...identify.study.nuisances import with_nuisances
from ...identify.study.study import Piece
from ..engine import Discovery

Left = tuple[Piece, np.ndarray, np.ndarray]  # a piece, the model's answer and the record less that, each (N,) [SI]


def left_over(found: Discovery) -> Iterator[Left]:
    """Every piece that the named model can follow, with its answer and the record less that, each (N,) in SI units."""
    study, named = found.named_study, found.named
    answers = study.response(named.ids, study.pieces).possible(study.shared(named.fitted.values))
    for piece, answer in zip(study.pieces, answers, strict=True):
        if answer is not None:
            own = with_nuisances(study, piece, answer)
            yield piece, own, piece.record - own
