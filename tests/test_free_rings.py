"""A tube that was released rings below the noise of its laser, and a fit must not listen to it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import erf

from tubular_dea.discover.scores.parameters import base_parameters
from tubular_dea.identify.inputs.drive import joined
from tubular_dea.identify.records.experiment import Experiment, Recordings
from tubular_dea.identify.study.free_rings import with_slow_rings
from tubular_dea.identify.study.study import PRIOR, Study, study
from tubular_dea.kernel import Kernel
from tubular_dea.plants.tube import PLANT

TIME = np.arange(0, 8, 0.002)
NOISE = 20e-6  # m
OUTPUT = PLANT.outputs[0].name
TRUE = PLANT.model.parameter_values()


def released(seed: int, softly: float) -> Experiment:
    """A tube under 60 mmHg that is released within `softly` [s] at 3 s, with a pulse of 4 kV before."""
    random = np.random.default_rng(seed)
    pressure = 4000 * (erf((TIME - 0.7) / 0.1) - erf((TIME - 3) / softly))
    voltage = np.where((TIME > 1.5) & (TIME < 2.2), 4000.0, 0.0)
    switched = np.repeat(TIME, 2)[1:], np.repeat(voltage, 2)[:-1]
    radius = Kernel(PLANT.model).simulate(joined([(TIME, pressure), switched], ["pressure", "voltage"]), TIME)
    monitors = {
        "pressure": pressure + 35 * random.standard_normal(TIME.size),
        "voltage": voltage + 5 * random.standard_normal(TIME.size),
    }
    laser = radius["radial_displacement"] + NOISE * random.standard_normal(TIME.size)
    return Experiment(str(seed), TIME, monitors, {OUTPUT: laser}, np.arange(TIME.size))


def prepared(softly: float) -> Study:
    return study(Recordings(PLANT, [released(i, softly) for i in range(3)], {}, {}, "released"), (), PRIOR)


def rises(work: Study) -> tuple[float, float]:
    """By how much the misfit rises where C_1 is 0.3 % more: as its derivatives tell, and as it does."""
    free = [f for f in base_parameters(PLANT) if f.name == "C_1"]
    problem = work.problem((), free, TRUE)
    here, there = (problem.scaled({**TRUE, "C_1": TRUE["C_1"] * by}) for by in (1.0, 1.003))
    residual, jacobian = problem.linearised(here)
    told, happened = residual + jacobian @ (there - here), problem.residuals(there)
    return float(told @ told - residual @ residual), float(happened @ happened - residual @ residual)


def test_what_rings_below_the_noise_has_no_say() -> None:
    before = prepared(0.06)
    after = with_slow_rings(before)
    assert all(not p.case.rings for p in before.pieces) and all(p.case.rings for p in after.pieces)
    for piece in after.pieces:
        assert all(begin > 3 for begin, _ in piece.case.rings), "under load nothing rings"
    rough, smooth = (s.response((), s.pieces).outputs(TRUE) for s in (before, after))
    for piece, a, b in zip(after.pieces, rough, smooth, strict=True):
        loaded = piece.case.times < min(begin for begin, _ in piece.case.rings)
        assert np.array_equal(a[loaded], b[loaded])
        assert 0 < np.abs(a - b).max() < NOISE
    (told, happened), (told_so, happened_so) = (rises(s) for s in (before, after))
    assert told > 5 * happened, "a change of 0.3 % turns phases"
    assert told_so == pytest.approx(happened_so, rel=0.1)


def test_a_ring_that_a_record_shows_stays() -> None:
    """Released within a millisecond it rings by more than the noise."""
    after = with_slow_rings(prepared(0.002))
    assert all(not p.case.rings for p in after.pieces)
