"""A check of coarse sensors: could the rounding of readings explain an effect?

Where readings are rounded to steps that are larger than the noise, the error follows the reading: a sawtooth over it
(Widrow and Kollar, "Quantization noise", 2008, ch. 4), which does not average out while the plant creeps or turns, and
is like friction. Its first waves are integrated out (`beside`) along what the model says that the sensor reads; a zero
of every file makes their phases its own.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...identify.fitting.problem import whitened
from ...identify.study.study import Piece, Study
from ..options.options import Option
from .beside import Curves, marginal_misfit, taken

# Set by theory: a sawtooth's waves fall as 1 / k, and faster with noise. Check: `pytest tests/test_rounding.py`
WAVES = 3  # [1] waves of the sawtooth


def explained_by_rounding(study: Study, before: Option, after: Option, threshold: float) -> bool:
    """Whether beside the rounding of coarse readings the last effect of `after` gains less than chance, the
    `threshold`."""
    if not any(noise.grain for noise in study.noise.values()):
        return False
    left, now = (marginal_misfit(one, sawtooth(study, one)) for one in (before, after))
    return left - now < threshold


def sawtooth(study: Study, option: Option) -> Iterator[Curves]:
    """How much of the rounding's waves is in every training piece."""
    answers = study.response(option.ids, study.training).outputs(study.shared(option.fitted.values))
    return taken(option, (_waves(study, p, y) for p, y in zip(study.training, answers, strict=True)))


def _waves(study: Study, piece: Piece, answer: np.ndarray) -> np.ndarray:
    """The waves of every coarse output over a piece, whitened as its record is, shape (N, waves)."""
    found, waves = [], np.arange(1, WAVES + 1)
    for reading, part in zip(piece.case.readings, piece.case.parts, strict=True):
        grain = study.noise[reading.output].grain
        if grain:
            turns = 2 * np.pi * np.outer(answer[part] / grain, waves)
            columns = np.zeros((piece.record.size, 2 * WAVES))
            columns[part] = np.hstack([np.sin(turns) / waves, np.cos(turns) / waves]) * grain / np.pi
            found.append(columns)
    if not found:
        return np.empty((piece.record.size, 0))
    return piece.marginal.apply(whitened(piece.case, np.hstack(found), study.noise, piece.weight))
