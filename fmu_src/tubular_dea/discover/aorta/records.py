"""Records of flow and pressure in the units the fits work in: mmHg and mL/s."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...identify.checks import constant
from ...identify.data import DataError, Experiment, Recordings
from ...model.patients import ML, MMHG

HELD_SHARE = 0.25  # of every record, at its end
PRESSURE, FLOW = MMHG, ML  # Pa and m3/s of the units here


@dataclass(frozen=True)
class Record:
    """`time` [s], `flow` [mL/s] and `pressure` [mmHg], each (n,); `training` (n,) marks what takes part in fits."""

    name: str
    time: np.ndarray
    flow: np.ndarray
    pressure: np.ndarray
    training: np.ndarray

    @staticmethod
    def of(experiment: Experiment) -> Record:
        """An experiment, without the samples whose pressure is missing."""
        seen = experiment.seen
        time = experiment.time[seen] - experiment.time[seen][0]
        training = time <= (1 - HELD_SHARE) * time[-1]
        return Record(experiment.name, time, experiment.inputs["flow"][seen] / FLOW,
                      experiment.output[seen] / PRESSURE, training)  # fmt: skip


def records(recordings: Recordings) -> list[Record]:
    """All experiments of a folder; `DataError` for a flow that drives nothing or runs backwards."""
    for experiment in recordings.experiments:
        flow, lines = experiment.inputs["flow"], experiment.lines
        for finding in constant(flow, "flow", lines, "the flow pulses"):
            raise DataError(f"{experiment.name}.csv, {finding}")
        if flow.mean() <= 0:
            raise DataError(
                f"{experiment.name}.csv, lines {lines[0]} to {lines[-1]}, column 'flow': the mean is "
                f"{flow.mean() / FLOW:.3g} mL/s; expected the flow out of the heart to be positive: turn its sign"
            )
    return [Record.of(e) for e in recordings.experiments]
