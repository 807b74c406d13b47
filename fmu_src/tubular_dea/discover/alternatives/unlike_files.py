"""Files that differ as if a monitor's gain did: another specimen, a part that was lost, a scale that was set anew.

Gains of monitors are taken off each file before errors are told, and those of two inputs together make up for a plant
that is 7 % stiffer in some files. Where one would have to change by far more than monitors do, the model does not
explain the files together, however small its error is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...identify.study.nuisances import GAIN, GAIN_OF, own_numbers, share_unknown
from ...identify.study.study import Piece, Study
from ...kernel import KernelError
from ..options.options import Option

# Set by measurement: a layer lost after the third of six files, another tube from the fourth on, a stiffness that
# differs by 2 % came as gains of 1.0 to 6.0 %; of sixteen sets with nothing hidden none was more than 0.1 %.
# Check: `pytest tests/test_unlike_files.py`, `python -m blind.score --nulls 12 --conventions monitor_gains --seed 1000`
MOST_USUAL_GAINS = 5.0  # [1] times the usual change of a gain, beyond which a file's is no monitor's

# Set by measurement: 1/f noise of a laser, of which files of 14 s show too little, moved a gain by 1.1 %, known to
# 0.3 % by the noise that was told. Check: `pytest tests/test_unlike_files.py -k well_known`
KNOWN = 5.0  # [standard deviations] that such a gain is off at least: slow noise is known least


@dataclass(frozen=True)
class Unlike:
    """The gain of an `input` that changes most from file to file: in `piece` it moves `output` by `value` [SI, rms].

    `changes` are the gains, less 1, of the monitors in each piece, by its name and the input.
    """

    input: str
    piece: str
    output: str
    value: float
    changes: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def unlike_files(study: Study, option: Option) -> Unlike | None:
    """The largest change of a gain that no monitor has and that moves an output by more than its noise; else None."""
    found: dict[float, tuple[str, str, str, float]] = {}
    changes: dict[str, dict[str, float]] = {}
    try:
        known = own_numbers(study, option.ids, option.fitted.values)
    except KernelError:
        return None
    for piece, own in known:
        changes[piece.name] = {n.removeprefix(GAIN_OF): v for n, v in own.items() if n.startswith(GAIN_OF)}
        for name, value in changes[piece.name].items():
            index = piece.nuisances.names.index(GAIN_OF + name)
            if abs(value) <= MOST_USUAL_GAINS * GAIN or not _well_known(study, piece, index, value):
                continue
            column = piece.nuisances.columns[:, index] * value
            for reading, rows in zip(piece.case.readings, piece.case.parts, strict=True):
                moved = float(np.sqrt(np.mean(column[rows] ** 2)))
                if moved > study.noise[reading.output].rms:
                    found[abs(value)] = (name, piece.name, reading.output, moved)
    return Unlike(*found[max(found)], changes) if found else None


def _well_known(study: Study, piece: Piece, index: int, value: float) -> bool:
    """Whether a nuisance parameter of a piece is known to be off, by its standard deviation there."""
    return abs(value) > KNOWN * float(share_unknown(study, piece)[index] * piece.nuisances.sd[index])
