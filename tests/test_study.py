"""A study: how finely its models are integrated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from shared_data import shared
from tubular_dea.identify.data import read_folder
from tubular_dea.identify.response import ROUGH, TOLERANCE
from tubular_dea.identify.study import study
from tubular_dea.plants.tube import PLANT


def test_the_tolerance_follows_the_noise() -> None:
    """What the coarse one changes is nothing beside 15 um; beside a noise of 0.1 um the usual one is taken."""
    recordings = read_folder(Path(shared("lab/lab-1")), PLANT)
    coarse = study(recordings)
    assert coarse.tolerance == ROUGH
    values = PLANT.model.parameter_values()
    rough, exact = (coarse.response((), coarse.pieces).outputs(values, finer) for finer in (1.0, 1e3))
    furthest = max(float(np.abs(a - b).max()) for a, b in zip(rough, exact, strict=True))
    assert furthest < 0.01 * coarse.noise["measured_displacement"].rms
    known = replace(recordings, noise=dict(recordings.noise) | {"radius": 1e-7})
    assert study(known).tolerance == TOLERANCE
