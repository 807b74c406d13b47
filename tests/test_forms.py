"""Another functional form of an effect that is found is told from a further effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import tubular_dea as td
from test_plain_models import one_state
from tubular_dea.discover.alternatives.forms import explained_by_form
from tubular_dea.discover.options.options import Option, fitted_option
from tubular_dea.identify.study.study import PRIOR, Study, study
from tubular_dea.laws.places import Path
from tubular_dea.plants.plant import Input, Output, Plant

PLANT = Plant(one_state(), [Input("load")], [Output("reading")], places=[Path("reading")])
TIME, NOISE = 0.01 * np.arange(4000), 0.01
THRESHOLD = 40.0
LEVELS_OFF = 0.06 * (1 - np.exp(-TIME / 5))  # fitted as t / (1 + t / T)
WAVE = 0.01 * np.sin(2 * np.pi * TIME / 3)


def drifting(wave: float) -> tuple[Study, Option]:
    """A slow load, read with a drift of another form than the law's, and with `wave` times a wave of its own cause."""

    def recorded(number: int) -> dict[str, np.ndarray]:
        load = 1 + (0.5 + 0.1 * number) * np.sin(2 * np.pi * (0.05 + 0.03 * number) * TIME)
        run = td.Kernel(PLANT.model).simulate(td.Protocol.of(TIME, load=load), TIME)["reading"]
        noise = NOISE * np.random.default_rng(number).standard_normal(TIME.size)
        return {"time [s]": TIME, "load [N]": load, "reading [m]": run + LEVELS_OFF + wave * WAVE + noise}

    recordings = td.read_recordings({f"file {n}": recorded(n) for n in range(3)}, plant=PLANT)
    work, name = study(recordings, [], PRIOR), "drift(reading)"
    drift = fitted_option(work, (name,), work.catalogue[name].typical | PLANT.model.parameter_values(), (name,))
    assert drift is not None
    return work, drift


def without(option: Option, curve: np.ndarray) -> Option:
    """The option with a residual from which as much of a curve in each file is taken as is in there."""
    residual = option.fitted.residual.copy()
    for rows in np.array_split(np.arange(3 * TIME.size), 3):
        residual[rows] -= curve * (curve @ residual[rows]) / (curve @ curve)
    return replace(option, fitted=replace(option.fitted, residual=residual, cost=float(residual @ residual)))


def test_what_another_form_explains_is_no_further_effect() -> None:
    work, drift = drifting(wave=0.0)
    alike = np.mean(np.split(drift.fitted.residual[: 3 * TIME.size], 3), axis=0)
    further = without(drift, np.polynomial.Legendre.fit(TIME, alike, 6)(TIME))  # a smooth cause
    assert drift.cost - further.cost > 3 * THRESHOLD
    assert explained_by_form(work, drift, further, THRESHOLD)


def test_what_no_form_explains_may_be_one() -> None:
    work, drift = drifting(wave=1.0)
    further = without(drift, WAVE)
    assert drift.cost - further.cost > 3 * THRESHOLD
    assert not explained_by_form(work, drift, further, THRESHOLD)


def test_a_base_has_no_other_form() -> None:
    work, _ = drifting(wave=1.0)
    base = fitted_option(work, (), PLANT.model.parameter_values(), ())
    assert base is not None
    assert not explained_by_form(work, base, without(base, WAVE), THRESHOLD)
