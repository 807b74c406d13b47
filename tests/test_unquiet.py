"""Records without a quiet stretch: noise is what the best model leaves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

import made_up
from tubular_dea.discover import engine
from tubular_dea.discover.engine import discover
from tubular_dea.identify.records.experiment import Experiment, Recordings
from tubular_dea.identify.signals.noise_bound import TOO_MUCH
from tubular_dea.identify.study.procedure import alternating_fit
from tubular_dea.identify.study.study import study
from tubular_dea.kernel import Kernel
from tubular_dea.plants import Build, Input, Output, Path, Plant
from tubular_dea.protocol import Protocol

TIME = 0.01 * np.arange(1500)
NOISE = 0.02


def lag() -> Plant:
    """A first-order lag that never rests."""
    m = Build("Lag")
    load, tau = m.input("load", "N"), m.parameter("tau", "s", 0.2, minimum=1e-3)
    gain = m.parameter("gain", "m/N", 1.5)
    x = m.state("x", "m", start="free", nominal=1.0)
    m.derivative(x, (gain * load - x) / tau)
    m.output("reading", "m", x)
    return Plant(m.model(), [Input("load")], [Output("reading")], places=[Path("reading")])


PLANT = lag()


def recordings(bent: float) -> Recordings:
    """Four records of the lag under a load that wanders; the sensor reads `bent` times the square too much."""
    listed = []
    for number in range(4):
        random = np.random.default_rng([number, 3])
        load = 6 * gaussian_filter1d(random.standard_normal(TIME.size), 8)
        true = Kernel(PLANT.model).simulate(Protocol(TIME, {"load": load}), TIME, {"tau": 0.17})["reading"]
        read = true + bent * true**2 + NOISE * random.standard_normal(TIME.size)
        listed.append(Experiment(f"run-{number}", TIME, {"load": load}, {"reading": read}, np.arange(TIME.size) + 2))
    return Recordings(PLANT, listed)


@pytest.mark.long
def test_the_noise_is_less_where_an_effect_explains_what_looked_like_it(monkeypatch: pytest.MonkeyPatch) -> None:
    found = discover(recordings(bent=0.05))
    assert found.named.ids == ("quadratic(reading)",)
    noise = found.study.noise["reading"]
    assert not noise.quiet
    assert NOISE < noise.innovation < TOO_MUCH * NOISE
    monkeypatch.setattr(engine, "MOST_QUIETER", 0)
    assert discover(recordings(bent=0.05)).study.noise["reading"].innovation > TOO_MUCH * NOISE


def test_a_fit_alone_limits_the_noise() -> None:
    """Before any fit the signal itself is taken for noise."""
    work = study(recordings(bent=0.0), held_out=())
    assert work.noise["reading"].rms > 2 * NOISE
    found = alternating_fit(work, PLANT.model.parameter_values())[0]
    assert found.noise["reading"].rms == pytest.approx(NOISE, rel=0.05)


def test_noise_is_told_while_the_model_stands_still_though_an_input_moves() -> None:
    """The pressure of a valve's supply wanders while its spool rests: 9.8 um were taken for a sensor's 2 um."""
    m = Build("Valve")
    opening, supply = m.input("opening", "1"), m.input("supply", "Pa", nominal=1e5)
    gain, tau = m.parameter("gain", "m/Pa", 1.5e-5), m.parameter("tau", "s", 0.2, minimum=1e-3)
    x = m.state("x", "m", nominal=1.0)
    m.derivative(x, (gain * opening * supply - x) / tau)
    m.output("reading", "m", x)
    plant = Plant(m.model(), [Input("opening", held=True), Input("supply")], [Output("reading")])
    listed = []
    for number in range(4):
        random = np.random.default_rng([number, 4])
        drive = {
            "opening": np.where(TIME < 4, 0.0, 1 + np.sin(3 * TIME)),
            "supply": 1e5 + 6e4 * gaussian_filter1d(random.standard_normal(TIME.size), 8),
        }
        true = Kernel(plant.model).simulate(Protocol(TIME, drive), TIME, {"tau": 0.17})["reading"]
        read = true + NOISE * random.standard_normal(TIME.size)
        listed.append(Experiment(f"run-{number}", TIME, drive, {"reading": read}, np.arange(TIME.size) + 2))
    work = study(Recordings(plant, listed), held_out=())
    assert not work.noise["reading"].quiet
    noise = alternating_fit(work, plant.model.parameter_values())[0].noise["reading"]
    assert noise.quiet and noise.by_residual
    assert noise.rms == pytest.approx(NOISE, rel=0.05)


@dataclass(frozen=True)
class Levels:
    """What a study knows of noise."""

    noise: str
    monitor_noise: Mapping[str, float]


@pytest.mark.parametrize(
    ("effect", "quieter", "allowed", "beside_least", "less"),
    [
        ("lag", False, 10e-6, 10e-6, Levels("as before", {"load": 25.0})),  # it was the missing effect
        ("lag", False, 18e-6, 18e-6, None),  # little changes
        ("lag", False, 18e-6, 4e-6, Levels("as before", {"load": 6.0})),  # beside much noise, instants leave as much
        ("", False, 10e-6, 10e-6, None),  # at the base the same was asked
        ("", True, 20e-6, 20e-6, Levels("less", {"load": 180.0})),
    ],
)
def test_a_search_is_repeated_where_its_choice_leaves_less_room_for_noise(
    effect: str,
    quieter: bool,
    allowed: float,
    beside_least: float,
    less: Levels | None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A friction was found beside a pressure of 184 Pa of noise; with it, the outputs tell 45 Pa."""
    before, settled = Levels("as before", {"load": 180.0}), Levels("as before", {"load": 180.0})
    told, least = Levels("as before", {"load": 25.0}), Levels("as before", {"load": 6.0})
    rms = {id(before): 20e-6, id(told): allowed, id(least): beside_least}
    monkeypatch.setattr(engine, "with_noise_of", lambda *_: Levels("less", {}))
    monkeypatch.setattr(engine, "quieter", lambda *_: quieter)
    monkeypatch.setattr(engine, "_settled_beside_least", lambda *_: (settled, {}))
    monkeypatch.setattr(engine.input_noise, "input_sensitivities", lambda *_: {})
    monkeypatch.setattr(engine.input_noise, "told_by_outputs", lambda study, *_: least if study is settled else told)
    monkeypatch.setattr(engine.input_noise, "weighted", lambda study, gains: study)
    monkeypatch.setattr(engine.input_noise, "allowed_rms", lambda study: {"reading": rms[id(study)]})
    chosen = made_up.option(*([effect] if effect else []))
    found = SimpleNamespace(chosen=chosen, study=before, base_study=before)
    assert engine._with_less_noise(found, monitors=True) == less
    assert engine._with_less_noise(found, monitors=False) == (less if quieter else None)
