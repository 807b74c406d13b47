"""Readings in coarse steps: what their rounding does is told from an effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tubular_dea as td
from test_plain_models import one_state
from tubular_dea.discover.alternatives.rounding import explained_by_rounding, sawtooth
from tubular_dea.discover.options.options import Option, fitted_option
from tubular_dea.identify.study.study import PRIOR, Study, study
from tubular_dea.plants.plant import Input, Output, Plant

PLANT = Plant(one_state(), [Input("load")], [Output("reading")])
TIME, NOISE = 0.01 * np.arange(4000), 0.01
THRESHOLD = 40.0


def rounded(number: int, grain: float) -> dict[str, np.ndarray]:
    """A slow wave, read in steps of `grain`."""
    load = 1 + (0.5 + 0.1 * number) * np.sin(2 * np.pi * (0.05 + 0.03 * number) * TIME)
    run = td.Kernel(PLANT.model).simulate(td.Protocol.of(TIME, load=load), TIME)["reading"]
    read = run + NOISE * np.random.default_rng(number).standard_normal(TIME.size)
    return {"time [s]": TIME, "load [N]": load, "reading [m]": np.round(read / grain) * grain}


def work_of(grain: float) -> tuple[Study, Option]:
    work = study(td.read_recordings({f"file {n}": rounded(n, grain) for n in range(3)}, plant=PLANT), [], PRIOR)
    base = fitted_option(work, (), PLANT.model.parameter_values(), ())
    assert base is not None
    return work, base


def better(base: Option, by: np.ndarray) -> Option:
    """The option with a residual that is less `by` so much."""
    residual = base.fitted.residual.copy()
    residual[: by.size] -= by
    return replace(base, fitted=replace(base.fitted, residual=residual, cost=float(residual @ residual)))


def test_what_rounding_explains_is_no_effect_and_the_rest_is_one() -> None:
    work, base = work_of(grain=0.1)
    assert work.noise["reading"].grain == pytest.approx(0.1)
    rows, columns, found = next(sawtooth(work, base))
    assert float(base.fitted.residual[rows] @ columns @ found) > THRESHOLD  # rounding does show
    assert explained_by_rounding(work, base, better(base, columns @ found), THRESHOLD)
    slow = 0.2 * np.sin(2 * np.pi * TIME / 7)
    lacking = better(base, -slow)  # a model that lacks a slow wave, beside the rounding
    assert not explained_by_rounding(work, lacking, base, THRESHOLD)


def test_fine_readings_are_left_alone() -> None:
    work, base = work_of(grain=0.01)
    assert work.noise["reading"].grain == 0
    assert not explained_by_rounding(work, base, base, THRESHOLD)
