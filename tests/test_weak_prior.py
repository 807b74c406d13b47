"""The weak prior of fits: it holds what nothing determines, and lets go of what is many times its usual size."""

from __future__ import annotations

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.discover.options.refit import fit_effects
from tubular_dea.identify.fitting.problem import Free
from tubular_dea.identify.study.study import PRIOR, study
from tubular_dea.plants import Build, Input, Output, Path, Plant

SHARE, TAU, NOISE = -0.6, 0.8, 0.3


def lag() -> Plant:
    """A vessel that follows what it is driven by; its sensor shows less than there is, which is missing."""
    m = Build("Lag", "A lag")
    drive, tau = m.input("drive", "V", nominal=10.0), m.parameter("tau", "s", 1.0, minimum=0.01)
    x = m.state("x", "V", nominal=10.0)
    m.derivative(x, (drive - x) / tau)
    m.output("reading", "V", x)
    return Plant(m.model(), [Input("drive")], [Output("reading")], places=[Path("reading")])


def test_an_effect_many_times_its_usual_size_is_not_held_back() -> None:
    """A cell's second pair of 74 times the usual size ended at 26 times it, with half of what it explains."""
    time, tables = np.arange(0, 12, 0.05), {}
    for number in range(3):
        random = np.random.default_rng(number)
        drive = np.interp(time, np.arange(13), random.uniform(0, 20, 13))
        x, state = np.zeros(time.size), 0.0
        for k in range(1, time.size):
            state += 0.05 * (0.5 * (drive[k - 1] + drive[k]) - state) / TAU
            x[k] = state
        read = (1 + SHARE) * x + NOISE * random.standard_normal(time.size)
        tables[f"file {number}"] = {"time [s]": time, "drive [V]": drive, "reading [V]": read}
    recordings = td.read_recordings(tables, lag())
    ids, start = ("gain(reading)",), {"tau": 1.0, "reading_gain": -0.05}
    held, free = (fit_effects(study(recordings, (), prior), ids, start) for prior in (PRIOR, None))
    usual = next(f.size for f in held.free if f.name == "reading_gain")
    assert abs(free.values["reading_gain"]) > 10 * usual
    assert held.values["reading_gain"] == pytest.approx(
        free.values["reading_gain"], abs=0.3 * free.stderr["reading_gain"]
    )


@pytest.mark.parametrize("logarithmic", [False, True])
@pytest.mark.parametrize("away", [-70.0, -0.3, 0.0, 2.0, 70.0])
def test_the_slope_of_its_pull(away: float, logarithmic: bool) -> None:
    free = Free("k", size=2.0, logarithmic=logarithmic, usual=1.0)
    at, by = free.usually() + away, 1e-5
    (above, _), (below, _), (pull, slope) = (free.pulled(s, PRIOR) for s in (at + by, at - by, at))
    assert slope == pytest.approx((above - below) / (2 * by), rel=1e-6)
    assert pull == pytest.approx(away / PRIOR if logarithmic else np.arcsinh(away / PRIOR))
