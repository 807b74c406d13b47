"""A check of slow effects: could a sensor's zero that wanders slowly within a file explain them?

Slow effects (heating, softening, drift) resemble a wandering zero: a smooth curve over the time of each file, of the
usual size of zeros. They are accepted only if they explain more than such curves. The curves are integrated out
(`beside`) for this comparison only, as large as is likeliest. The plant's own parameters are fitted without them,
because they would absorb the slow parts that determine these parameters.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.polynomial.legendre import legvander

from ...identify.fitting.problem import whitened
from ...identify.study.study import Piece, Study
from ..options.acceptance import EARNS
from ..options.options import Option
from ..options.residuals import LackOfFit, lack_of_fit
from .beside import Curves, marginal_misfit, taken

# Set by judgement: 1 to 4 um for the tube's laser.
# Check: `python -m blind.score --nulls 12 --conventions drift --seed 1000`
WANDERS = (0.05, 0.1, 0.2)  # [1] of the usual size of an output's zero, by which each curve may wander (rms)
CURVES = 4  # [1] curves over a file's time: Legendre polynomials from a straight line up

# Set by measurement: with 5 um of drift at 5 kHz, four laws that are not there gain 0.02 to 0.09 of it, as no zero
# wanders so smoothly. Check: `python -m blind.score --singles 1 --only field_dependent_permittivity --seed 136000`
GAINED_BESIDE = 0.2  # [1] share of what wandering explains that an effect has to gain beside it


def explained_by_wandering(study: Study, before: Option, after: Option, threshold: float) -> bool:
    """Whether the last effect of `after` has no clearly better evidence than a wandering zero, beside which it gains
    less than `threshold` over `before`, or less than a share of what wandering explains.

    An effect of the sensor's own channel that few files cannot tell from such wandering is none either.
    """
    size, wandering = _likeliest(study, before)
    gained = 2 * (after.evidence - before.evidence) - (before.held_out - after.held_out)
    beside = _misfit(study, before, size) - _misfit(study, after, size)
    return beside < _least_beside(threshold, wandering) and wandering > gained - EARNS


def leaves(study: Study, before: Option, options: Sequence[Option], threshold: float) -> bool:
    """Whether some option gains over `before` what an effect has to gain beside the wandering of zeros."""
    size, wandering = _likeliest(study, before)
    left, least = _misfit(study, before, size), _least_beside(threshold, wandering)
    return any(left - _misfit(study, one, size) > least for one in options)


def _least_beside(threshold: float, wandering: float) -> float:
    """What an effect has to gain beside wandering: more than chance, the `threshold`, and a share of what that
    explains."""
    return max(threshold, GAINED_BESIDE * wandering)


def without(study: Study, option: Option) -> LackOfFit:
    """How what an option leaves compares with the noise, once the wandering of zeros is taken off."""
    residual = option.fitted.residual.copy()
    for rows, columns, found in _found(study, option, _likeliest(study, option)[0]):
        residual[rows] -= columns @ found
    return lack_of_fit(study, replace(option.fitted, residual=residual))


def largest(study: Study, option: Option) -> tuple[str, float]:
    """The piece in which the first output's zero wanders most, and the root mean square of that [SI]."""
    first, size = study.plant.outputs[0].name, _likeliest(study, option)[0]
    sizes = {}
    for piece, (_, _, found) in zip(study.training, _found(study, option, size), strict=True):
        read = piece.case.outputs
        if first not in read:
            continue
        place = read.index(first) * CURVES
        squares = found[place : place + CURVES] ** 2 / (2 * np.arange(1, CURVES + 1) + 1)
        sizes[piece.name] = size * study.zero(first) * float(np.sqrt(squares.sum()))
    return max(sizes.items(), key=lambda one: one[1])


def _likeliest(study: Study, option: Option) -> tuple[float, float]:
    """Which of WANDERS is the likeliest, and its evidence: by how much more of the misfit it explains than it costs."""
    evidence = {s: option.fitted.cost - _misfit(study, option, s) - _complexity(study, option, s) for s in WANDERS}
    return max(evidence.items(), key=lambda one: one[1])


def _misfit(study: Study, option: Option, size: float) -> float:
    """The sum of squares of the training pieces, with the wandering of each integrated out."""
    return marginal_misfit(option, _found(study, option, size))


def _complexity(study: Study, option: Option, size: float) -> float:
    """What wandering costs, in units of `_misfit`: the logarithm of how much wider it makes the likelihood."""
    return float(sum(np.linalg.slogdet(np.eye(c.shape[1]) + c.T @ c)[1] for _, c, _ in _found(study, option, size)))


def _found(study: Study, option: Option, size: float) -> Iterator[Curves]:
    """How far zeros wander in every training piece, along curves of some `size`."""
    return taken(option, (_curves(study, piece, size) for piece in study.training))


def _curves(study: Study, piece: Piece, size: float) -> np.ndarray:
    """The curves of every output over a piece, whitened as its record is, shape (N, curves)."""
    found = []
    for reading, part in zip(piece.case.readings, piece.case.parts, strict=True):
        span = float(np.ptp(reading.times)) or 1.0
        columns = np.zeros((piece.record.size, CURVES))
        columns[part] = legvander(2 * (reading.times - reading.times[0]) / span - 1, CURVES)[:, 1:]
        found.append(size * study.zero(reading.output) * columns)
    return piece.marginal.apply(whitened(piece.case, np.hstack(found), study.noise, piece.weight))
