"""Oscillations in what a model leaves of a record: each is told once, and only if it lasts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from tubular_dea.discover.answer import oscillations
from tubular_dea.discover.engine import Discovery
from tubular_dea.identify.signals.noise import Noise

TIME = np.arange(0, 4000, 1.0)
STEADY = 1e-3 * np.sin(2 * np.pi * 0.2 * TIME)
AFTER_A_PULSE = np.where((TIME > 1000) & (TIME < 1040), 0.2 * STEADY / 1e-3, 0.0)


SLOW = 0.2 * (TIME % 500) / 500  # a ramp in every part of the record


NOTHING = np.zeros(TIME.size)
STEPS = np.floor(TIME / 700) % 2
THIRD_OF_IT = np.sin(2 * np.pi * 0.2 / 3 * TIME)  # friction makes waves of three times the frequency


@pytest.mark.parametrize(
    ("left", "driven", "told", "force"),
    [
        (STEADY, NOTHING, 1, STEPS),
        (STEADY, 3 * STEADY, 0, STEPS),
        (AFTER_A_PULSE, NOTHING, 0, STEPS),
        (SLOW, NOTHING, 0, STEPS),
        (STEADY, NOTHING, 0, THIRD_OF_IT),
        (STEADY + 10e-3 * STEPS, NOTHING, 0, STEPS),  # the model misses much else
    ],
)
def test_a_line_that_lasts_is_told_once_and_what_a_model_misses_otherwise_is_none(
    monkeypatch: pytest.MonkeyPatch, left: np.ndarray, driven: np.ndarray, told: int, force: np.ndarray
) -> None:
    monkeypatch.setattr(oscillations, "with_nuisances", lambda study, piece, answer: answer)
    waves = oscillations.oscillations(found(left, driven, force, force))
    assert [w.frequency for w in waves] == pytest.approx([0.2] * told, abs=3e-3)
    assert not any(w.recorded for w in waves)


def found(left: np.ndarray, driven: np.ndarray, force: np.ndarray, recorded: np.ndarray) -> Discovery:
    """A model that leaves so much beside what it is `driven` to by a force, of which there is a record."""
    record = driven + left + 1e-4 * np.random.default_rng(0).standard_normal(TIME.size)
    case = SimpleNamespace(
        readings=[SimpleNamespace(output="voltage", times=TIME)],
        parts=[slice(None)],
        protocol=SimpleNamespace(at=lambda times: {"force": force}, time=TIME),
    )
    plant = SimpleNamespace(inputs=[SimpleNamespace(name="force")])
    piece = SimpleNamespace(name="a", source="a", record=record, case=case)
    noisy = recorded + 2e-3 * np.random.default_rng(1).standard_normal(TIME.size)
    experiment = SimpleNamespace(name="a", time=TIME, inputs={"force": noisy})
    noise = {"voltage": Noise(1e-4, 0.0, lines=(0.18, 0.2, 0.21), step=1.0)}
    answers = SimpleNamespace(outputs=lambda values: [driven])
    study = SimpleNamespace(plant=plant, noise=noise, pieces=[piece], response=lambda ids, pieces: answers)
    named = SimpleNamespace(ids=(), fitted=SimpleNamespace(values={}))
    recordings = SimpleNamespace(experiments=[experiment])
    return cast(Discovery, SimpleNamespace(study=study, named=named, recordings=recordings))


def test_a_wave_that_an_input_s_record_has_too_is_told_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A syringe pump's ripple of 26 Pa at 19 Hz beside noise of 35 Pa was something "that nobody recorded"."""
    monkeypatch.setattr(oscillations, "with_nuisances", lambda study, piece, answer: answer)
    (wave,) = oscillations.oscillations(found(STEADY, NOTHING, STEPS, STEPS + STEADY))
    assert wave.recorded == ("force",)
