"""What is odd about a set of recordings though each file can be read: sizes, gaps, files that are copies of others."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..identify.data import Experiment, Recordings
from ..identify.monitors import noise_level

# Set by judgement: signals of the examples reach 0.5 to 9 times their nominal values. Check: `pytest
# tests/test_recordings.py -k odd`
FACTOR = 100.0  # [1] times its declared size that a signal is too large or too small for its unit
STRUCTURE = 20.0  # [1] times the noise that a small signal spans, to be one
GAPS = 0.1  # [1] share of samples without a number that is worth a sentence


def findings(recordings: Recordings) -> list[str]:
    """All of it, in words."""
    return [*_sizes(recordings), *_gaps(recordings), *_copies(recordings)]


def _sizes(recordings: Recordings) -> Iterator[str]:
    """Signals far from the size that the plant declares."""
    plant = recordings.plant
    for name in [*(s.name for s in plant.inputs), *(o.name for o in plant.outputs)]:
        q = plant.quantity(name)
        records = [v for e in recordings.experiments if (v := _values(e, name)).size]
        largest = max((float(np.abs(v).max()) for v in records), default=0.0)
        if largest > FACTOR * q.nominal or (0 < largest < q.nominal / FACTOR and any(map(_moves, records))):
            unit = "" if q.unit == "1" else f" {q.unit}"
            yield (
                f"{name} reaches {largest:.3g}{unit} in these records, {largest / q.nominal:.2g} times its declared "
                f"size (nominal: {q.nominal:.3g}{unit}): is its unit in the files right? If so, correct nominal"
            )


def _gaps(recordings: Recordings) -> Iterator[str]:
    """Outputs with many samples that hold no number."""
    for e in recordings.experiments:
        for name, values in e.outputs.items():
            empty = int(np.count_nonzero(~np.isfinite(values)))
            if empty > GAPS * values.size:
                yield f"{e.name}: {empty} of {values.size} samples of {name} hold no number, and are left out"


def _copies(recordings: Recordings) -> Iterator[str]:
    """Experiments that hold the same numbers: one that is held out tests nothing then."""
    seen: dict[bytes, str] = {}
    for e in recordings.experiments:
        numbers = b"".join(np.ascontiguousarray(v).tobytes() for v in (*e.inputs.values(), *e.outputs.values()))
        first = seen.setdefault(numbers, e.name)
        if first != e.name:
            yield f"{first} and {e.name} hold the same numbers: held out, one tests nothing of the other; remove one"


def _values(experiment: Experiment, name: str) -> np.ndarray:
    values = (experiment.inputs | experiment.outputs).get(name, np.empty(0))
    return values[np.isfinite(values)]


def _moves(values: np.ndarray) -> bool:
    return values.size > 3 and float(np.ptp(values)) > STRUCTURE * noise_level(values)
