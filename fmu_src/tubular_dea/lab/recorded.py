"""Recordings as the page carries them: one small CSV a file, in SI units, as they were read and checked here."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..identify.records.experiment import Experiment, Recordings
from ..plants.plant import Output

DIGITS = 9  # of a number: finer than any monitor
ROOM = 800_000  # bytes of all of them; the page may have 1.5 MB


@dataclass(frozen=True)
class Carried:
    """CSV `texts` by file name; of those in `thinned`, only one sample of k, for lack of space."""

    texts: dict[str, str]
    thinned: dict[str, int]

    def words(self) -> list[str]:
        """What was left out, in words."""
        return [f"{name}: one sample of {k} is in the page" for name, k in self.thinned.items()]


def carried(recordings: Recordings) -> Carried:
    """All recordings in the available space."""
    whole = {f"{e.name}.csv": _lines(e, recordings) for e in recordings.experiments}
    size = sum(len(line) + 1 for lines in whole.values() for line in lines)
    step = -(-size // ROOM)
    texts = {name: "\n".join([lines[0], *lines[1::step]]) + "\n" for name, lines in whole.items()}
    return Carried(texts, dict.fromkeys(whole, step) if step > 1 else {})


def _lines(experiment: Experiment, recordings: Recordings) -> list[str]:
    plant = recordings.plant
    columns = {f"{s.name} [{plant.quantity(s.name).unit}]": experiment.inputs[s.name] for s in plant.inputs}
    columns |= {
        f"{_heading(o)} [{plant.quantity(o.name).unit}]": experiment.outputs[o.name]
        for o in plant.outputs
        if o.name in experiment.outputs
    }
    table = np.column_stack([experiment.time, *columns.values()])
    rows = (",".join("" if np.isnan(v) else f"{v:.{DIGITS}g}" for v in row) for row in table)
    return [",".join(["time [s]", *columns]), *rows]


def _heading(output: Output) -> str:
    """A heading under which the output stands as the model puts it out, with nothing to be subtracted."""
    return next((name for name, parameter in output.columns.items() if not parameter), output.name)
