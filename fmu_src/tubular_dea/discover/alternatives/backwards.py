"""Outputs that are counted the other way: with their sign changed, the refitted base explains what it else misses.

The declared values of a plant may be first guesses, so records are compared with it once these are refitted.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np

from ...errors import UserError
from ...identify.fitting.fit import Fit, FitError
from ...identify.study.study import Piece, Study
from ...kernel import KernelError

# Set by measurement: a signal of the wrong sign is best explained by nothing at all, which missed 1.00 of a knee's; of
# a tube behind a leaking line 0.3 is missed. Check: `pytest tests/test_backwards.py`
MISSED_ALL = 0.8  # [1] of what an output moves by (rms) that the refitted base misses before signs are changed
SIGN_LEFT = 0.3  # [1] of that error which the base may leave with a sign changed


@dataclass(frozen=True)
class Backwards:
    """Outputs that seem to be counted the other way, and the share of the error that is left without that."""

    outputs: tuple[str, ...]
    left: float


def backwards(prepared: Study, work: Study, fitted: Fit, refit: Callable[[Study], Fit]) -> Backwards | None:
    """The outputs of the wrong sign; None where the base, `fitted` to `work`, misses little, or no sign explains it.

    `refit` gives the base of a study that is `prepared` only. An input of the wrong sign looks like all outputs.
    """
    if _missed(work, fitted) < MISSED_ALL:
        return None
    names = sorted({r.output for p in prepared.training for r in p.case.readings})
    tried = [(n,) for n in names] + ([tuple(names)] if len(names) > 1 else [])
    left = [float(np.sqrt(_cost(prepared, turned, refit) / fitted.cost)) for turned in tried]
    best = int(np.argmin(left))
    return Backwards(tried[best], left[best]) if left[best] < SIGN_LEFT else None


def _missed(study: Study, fitted: Fit) -> float:
    """The share that a fit of the base misses of what its training records move by (rms), with numbers of their own,
    beyond noise: where that is slow, records hardly move by more than it."""
    moved, noise = 0.0, sum(p.record.size for p in study.training)
    for piece in study.training:
        for reading, rows in zip(piece.case.readings, piece.case.parts, strict=True):
            record = piece.record[rows] - piece.record[rows].mean()
            moved += float(np.sum((record * piece.weight[rows] / study.noise[reading.output].slow) ** 2))
    return float(np.sqrt(max(fitted.cost - noise, 0.0) / moved)) if moved > 0 else 0.0


def _cost(prepared: Study, outputs: Collection[str], refit: Callable[[Study], Fit]) -> float:
    """The misfit of the refitted base where some outputs have their sign changed; infinite where it has no answer."""
    try:
        return refit(replace(prepared, pieces=[_turned(p, outputs) for p in prepared.pieces])).cost
    except (FitError, KernelError, UserError):
        return float("inf")


def _turned(piece: Piece, outputs: Collection[str]) -> Piece:
    """The piece with the sign of some outputs changed."""
    record = piece.record.copy()
    for reading, rows in zip(piece.case.readings, piece.case.parts, strict=True):
        if reading.output in outputs:
            record[rows] *= -1.0
    return replace(piece, record=record)
