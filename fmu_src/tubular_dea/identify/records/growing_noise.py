"""Experiments with the noise of their sensors, where it grows with the reading."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..signals.growing import growth
from .experiment import Experiment, Recordings


def with_growing_noise(recordings: Recordings) -> Recordings:
    """The recordings with `relative_noise` where the files tell that a sensor's noise grows, unless it was stated."""
    found = {}
    for output in recordings.fitted_outputs:
        seen = [e.outputs[output.name][e.seen(output.name)] for e in recordings.experiments if output.name in e.outputs]
        stated = any(heading in recordings.noise for heading in output.headings)
        if not stated and (grows := growth(seen)) is not None:
            found[output.name] = grows
    if not found:
        return recordings

    def of(experiment: Experiment) -> Experiment:
        relative = {}
        for name, grows in found.items():
            seen = experiment.seen(name)
            if seen.any():
                relative[name] = np.ones(seen.size)
                relative[name][seen] = grows.at(experiment.outputs[name][seen])
        return replace(experiment, relative_noise=relative)

    return replace(recordings, experiments=[of(e) for e in recordings.experiments])
