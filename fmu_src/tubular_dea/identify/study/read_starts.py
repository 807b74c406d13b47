"""Unknown starts that an output shows: where a sensor reads a state itself, its first samples are where fits begin.

From far away they would come back only by the way of parameters that make up for them: of a muscle that begins at
26 mm and sticks, a fit that began at 0 needed six turns, and ended where it seemed to begin with 11 kPa too much.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...model.reduced import expanded
from ...plants.plant import Plant
from ..fitting.cases import Case

if TYPE_CHECKING:
    from .study import Piece, Study

# Set by judgement: one of them may be an outlier. Check: `pytest tests/test_read_starts.py`
OFF_READING = 5.0  # [standard deviations] of a sensor's noise and zero by which a start is not what it reads
FIRST_READ = 3  # [samples] whose median is what a record begins with


def read_starts(plant: Plant, case: Case, record: np.ndarray) -> dict[str, float]:
    """The starts (SI) of a record's own that one of its sensors reads from the first sample of its inputs on.

    `record` (N,) is what was read.
    """
    shown = {output: name for name, output in _shown(plant).items()}
    begins, found = float(case.protocol.time[0]), {}
    for reading, part in zip(case.readings, case.parts, strict=True):
        name, times = shown.get(reading.output), reading.times
        if name is not None and times.size >= FIRST_READ and times[0] - begins <= times[FIRST_READ - 1] - times[0]:
            found[name] = plant.quantity(name).inside(float(np.median(record[part][:FIRST_READ])))
    return found


def begins_elsewhere(study: Study, pieces: Sequence[Piece]) -> bool:
    """Whether some records are computed from a start that is far from what a sensor reads there."""
    outputs = _shown(study.plant)

    def off(piece: Piece, name: str, value: float) -> bool:
        output = outputs[name]
        usual = float(np.hypot(study.noise[output].rms, study.zero(output)))
        return abs(piece.case.own.get(name, value) - value) > OFF_READING * usual

    return any(off(p, *one) for p in pieces for one in read_starts(study.plant, p.case, p.record).items())


def _shown(plant: Plant) -> dict[str, str]:
    """By the name of an unknown start, the output that is its state."""
    model = plant.model
    starts = {s.quantity.symbol: str(s.start) for s in model.states if str(s.start) in plant.each_start}
    read = {o.name: expanded(model, o.name) for o in plant.outputs}
    return {starts[e]: name for name, e in reversed(read.items()) if e in starts}
