"""A check of further effects: could another functional form of the effects already found explain one?

No law of a catalogue is exactly that of the plant. What a law of another form would change is close to a curve over the
contribution of the one that was fitted (the answer with it, less the answer without it): its powers, where it acts
otherwise in size, and its rate, where it acts sooner or later. A further effect must gain beside these.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...identify.fitting.problem import whitened
from ...identify.study.study import Piece, Study
from ...kernel import KernelError
from ..options.options import Option
from ..scores.parameters import switched_off

# Set by measurement: a drift that levels off as exp(-t / T), fitted as t / (1 + t / T), left 93 for a permanent set,
# and 12 beside the powers. Check: `pytest tests/test_forms.py tests/test_wander.py`
POWERS = (1, 2, 3)  # [1] of a contribution over its largest value

# Set by judgement: far from what rounding leaves. Check: `pytest tests/test_forms.py`
SINGULAR = 1e-9  # [1] of the largest singular value, from which on a direction is one of its own


def explained_by_form(study: Study, before: Option, after: Option, threshold: float) -> bool:
    """Whether beside other forms of the effects of `before` the last effect of `after` gains less than chance, the
    `threshold`."""
    curves = _curves(study, before)
    if not curves.shape[1]:
        return False
    rows = len(curves)
    left = before.fitted.residual[:rows]
    taken = np.hstack([before.fitted.jacobian[:rows], curves])
    basis, sizes, _ = np.linalg.svd(taken / np.maximum(np.linalg.norm(taken, axis=0), 1e-300), full_matrices=False)
    basis = basis[:, sizes > SINGULAR * sizes[0]]
    direction = left - after.fitted.residual[:rows]
    direction = direction - basis @ (basis.T @ direction)
    return float(left @ direction) ** 2 < threshold * float(direction @ direction)


def _curves(study: Study, option: Option) -> np.ndarray:
    """Curves over the contribution of every effect that has other forms, whitened as the residual is, (N, curves)."""
    found = [_over(study, c) for i in option.ids if not study.catalogue[i].exact and (c := _part(study, option, i))]
    rows = sum(p.record.size for p in study.training)
    return np.hstack([np.empty((rows, 0)), *found])


def _part(study: Study, option: Option, name: str) -> list[np.ndarray]:
    """The contribution of an effect to what is read in every training piece (SI); [] where it cannot be computed."""
    response = study.response(option.ids, study.training)
    values = study.shared(option.fitted.values)
    try:
        without = response.outputs(values | switched_off(study.catalogue[name]))
    except KernelError:  # no answer without the effect
        return []
    return [a - b for a, b in zip(response.outputs(values), without, strict=True)]


def _over(study: Study, parts: list[np.ndarray]) -> np.ndarray:
    """Powers of a contribution and its rate, whitened, shape (N, curves)."""
    largest: dict[str, float] = {}
    for piece, part in zip(study.training, parts, strict=True):
        for reading, rows in zip(piece.case.readings, piece.case.parts, strict=True):
            largest[reading.output] = max(largest.get(reading.output, 0.0), float(np.abs(part[rows]).max(initial=0.0)))
    return np.concatenate([_white(study, *one, largest) for one in zip(study.training, parts, strict=True)])


def _white(study: Study, piece: Piece, part: np.ndarray, largest: Mapping[str, float]) -> np.ndarray:
    columns = np.zeros((part.size, len(POWERS) + 1))
    for reading, rows in zip(piece.case.readings, piece.case.parts, strict=True):
        share = part[rows] / (largest[reading.output] or 1.0)
        powers = [part[rows] * share ** (power - 1) for power in POWERS]
        columns[rows] = np.column_stack([*powers, np.gradient(part[rows], reading.times)])
    return piece.marginal.apply(whitened(piece.case, columns, study.noise, piece.weight))
