"""Detection of single files in which a signal counts the other way: a transducer upside down.

The declared plant answers every file by itself. Its values may be rough, so only the shape counts: what is missed is
what a positive gain and an offset of each output leave. Where that is most of one file, little of the others, and
little of this one with the sign of one signal changed, that is asked about. Nothing is changed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...kernel import Kernel, KernelError
from ...plants.plant import Plant
from ...protocol import Protocol
from ..records.checks import STRUCTURE
from ..records.experiment import Experiment, Recordings
from ..signals.monitors import noise_level
from .cases import Case, Reading
from .compiled import Compiled
from .scales import ROUGHLY, SCALE_STEPS, coarse_record, from_best_start

# Set by measurement: of the laboratory's tubes, a house, a servo, a motor and an inverter the declared plants miss 0 to
# 74 % of a file so, with a sign changed nearly all of it, and put right as before; files of which a model misses all (a
# melt) no sign puts right. Check: `pytest tests/test_reading.py -k other_way`,
# `pytest tests/test_reading.py -k no_sign_is_asked`
WRONG_WAY = 0.7  # [1] share of a file's worst output that is missed before anything is said
RIGHT_WAY = 0.25  # [1] share that may be missed with the sign changed, and in the other files
OTHER_FILES = 2  # [files] that the declared plant follows, for one to be unlike them
FOLLOWED_PER_WRONG = 2  # [1] files that it follows for each one that is missed, for a sign to be asked about


@dataclass(frozen=True)
class _File:
    """What drove one experiment, and by output the times and the values read."""

    name: str
    driven: Protocol
    read: Mapping[str, tuple[np.ndarray, np.ndarray]]


def wrong_signs(recordings: Recordings) -> list[str]:
    """Signals of single files that seem to count the other way, in words."""
    outputs = [o.name for o in recordings.fitted_outputs]
    files = [file for file in (_file(e, outputs) for e in recordings.experiments) if file.read]
    if len(files) <= OTHER_FILES:
        return []
    missed = partial(_missed, recordings, Compiled(recordings.plant, outputs).kernel())
    left = {file.name: missed(file) for file in files}
    followed = [name for name, share in left.items() if share < RIGHT_WAY]
    wrong = [file for file in files if left[file.name] > WRONG_WAY]
    if len(followed) < max(OTHER_FILES, FOLLOWED_PER_WRONG * len(wrong)):
        return []
    return list(_asked(recordings.plant, wrong, missed))


def _asked(plant: Plant, wrong: list[_File], missed: Callable[[_File], float]) -> Iterator[str]:
    """A sentence for every file that one sign would put right."""
    for file in wrong:
        signals = [s.name for s in plant.inputs if np.any(file.driven.inputs[s.name])]
        right = [name for name in (*signals, *file.read) if missed(_turned(file, name)) < RIGHT_WAY]
        if right:
            yield (
                f"{file.name}: is {' or '.join(right)} of the wrong sign there? As it is, the declared {plant.name} "
                "goes the other way in this file and follows the others; if so, correct it"
            )


def _file(experiment: Experiment, outputs: Sequence[str]) -> _File:
    """An experiment with those of its `outputs` that move; thinned, with their noise."""
    moving = {n: experiment.outputs[n][experiment.seen(n)] for n in outputs if experiment.seen(n).any()}
    names = [n for n, v in moving.items() if v.size > 1 and np.ptp(v) > STRUCTURE * noise_level(v)]
    records = {name: record for name in names if np.ptp((record := coarse_record(experiment, name))[-1]) > 0}
    driven = next((driven for driven, *_ in records.values()), Protocol(experiment.time, experiment.inputs))
    return _File(experiment.name, driven, {name: (times, seen) for name, (_, times, seen) in records.items()})


def _turned(file: _File, name: str) -> _File:
    """The file with a signal of the other sign."""
    inputs = {n: -v if n == name else v for n, v in file.driven.inputs.items()}
    read = {n: (times, -v if n == name else v) for n, (times, v) in file.read.items()}
    return replace(file, driven=Protocol(file.driven.time, inputs), read=read)


def _missed(recordings: Recordings, kernel: Kernel, file: _File) -> float:
    """The share (of the variance) of the file's worst output that the declared plant misses; 1 where it has no
    answer."""
    case = Case(file.driven, tuple(Reading(name, times) for name, (times, _) in file.read.items()))
    size = np.concatenate([np.full(values.size, values.std()) for _, values in file.read.values()])
    seen = np.concatenate([values for _, values in file.read.values()]) / size
    known = recordings.known_parameters

    def at(starts: Mapping[str, float]) -> np.ndarray:
        run = kernel.simulate(file.driven, case.instants, known | dict(starts), ROUGHLY, max_steps=SCALE_STEPS)
        return case.read(run.values) / size

    try:
        answer = from_best_start(recordings.plant, at, seen)
    except KernelError:
        return 1.0
    return max(_left(seen[part], answer[part]) for part in case.parts)


def _left(seen: np.ndarray, answer: np.ndarray) -> float:
    """The share of the variance of `seen` (n,) that a positive gain of `answer` (n,) and an offset leave."""
    seen, answer = seen - seen.mean(), answer - answer.mean()
    size = float(np.sqrt(np.sum(seen**2) * np.sum(answer**2)))
    alike = max(0.0, float(seen @ answer) / size) if 0 < size < np.inf else 0.0
    return 1.0 - alike**2
