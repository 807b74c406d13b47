"""Zeros of sensors of which nobody said how large they are: do they explain what effects would have to?

Every sensor has a zero, and after each setting up another one. A plant that declares none (`zero=`) has none in fits:
then files do not agree, and what moves an output a little in each of them passes for an effect. So what was found is
asked once more with zeros of a usual size, and where fewer effects then leave noise alone, these zeros are the answer.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...identify.study.study import RANGE, Study, declared_zeros
from ..judgement import held_ratio
from ..options.acceptance import PREDICTED, noise_alone
from ..options.options import Option, fitted_option
from ..search.revision import Search
from ..search.settle import iterated

# Set by convention: the zero error that data sheets of pressure sensors and load cells allow, 0.5 % of full scale.
# Check: `pytest tests/test_assumed_zeros.py`, `python -m measured.table`
SHARE = 0.005  # [1] of how far a signal moves: the usual zero of one that the plant says nothing of

# Set by judgement: bounds the cost, as what is then found has to leave noise alone. Check:
# `pytest tests/test_assumed_zeros.py`
SPARED = 0.5  # [1] share of what effects leave beyond noise that zeros have to explain for a search with them


def with_assumed(study: Study) -> Study | None:
    """The study with zeros of a usual size where the plant declares none; None where all are declared."""
    zeros = {name: SHARE * _span(np.concatenate(_recorded(study, name))) for name in study.assumable}
    return replace(study, zeros=declared_zeros(study.plant) | zeros) if any(zeros.values()) else None


def _recorded(study: Study, name: str) -> list[np.ndarray]:
    """What was recorded of a signal in each piece that has it."""
    if name in study.noise:
        return _read(study, name)
    return [p.case.protocol.inputs[name] for p in study.pieces]


def _read(study: Study, output: str) -> list[np.ndarray]:
    """What was read of an output in each piece that has it."""
    pairs = [(p.record[part], r) for p in study.pieces for r, part in zip(p.case.readings, p.case.parts, strict=True)]
    return [values for values, reading in pairs if reading.output == output]


def _span(values: np.ndarray) -> float:
    """How far a signal moves, but for its rarest values."""
    return float(np.ptp(np.quantile(values, [1 - RANGE, RANGE])))


def enough(study: Study, option: Option) -> bool:
    """Whether an option leaves noise alone, on what was held out too."""
    return noise_alone(option) and held_ratio(study, option) <= PREDICTED


def explain(found: Search, allowed: Study) -> bool:
    """Whether a search with the zeros that are `allowed` may find more than was found: with them fewer effects are
    enough, or where these are not, zeros explain most of what they leave."""
    ids, left = found.chosen.ids, found.chosen.lack_of_fit.excess
    if enough(found.study, found.chosen):
        settled = (_settled(found, allowed, tuple(i for i in ids if i != one)) for one in ids)
        return any(enough(*one) for one in settled if one is not None)
    with_zeros = _settled(found, allowed, ids)
    if with_zeros is None:
        return False
    return enough(*with_zeros) or with_zeros[1].lack_of_fit.excess <= (1 - SPARED) * left


def _settled(found: Search, allowed: Study, ids: tuple[str, ...]) -> tuple[Study, Option] | None:
    """Some of the effects that were found, with zeros that are `allowed`; None where no fit has an answer."""
    known = found.study if ids else found.base_study
    study = replace(known, zeros=allowed.zeros)
    begun = fitted_option(study, ids, (found.chosen if ids else found.base).fitted.values, found.chosen.refined)
    return None if begun is None else iterated(study, begun)
