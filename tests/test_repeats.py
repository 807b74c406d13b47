"""The noise of records that repeat a course without rest: what one repetition does not share with the others."""

from __future__ import annotations

import numpy as np
import pytest

from tubular_dea.identify.signals.colour import Colour
from tubular_dea.identify.signals.noise import Noise, of_residual
from tubular_dea.identify.signals.repeats import LEAST_REPETITIONS, NEAR, Repeated, unrepeated

STEP, RMS = 0.004, 15e-6
UNKNOWN = Noise(60e-6, 0.0, 1000.0, quiet=False)


def beats(colour: Colour, lacks: float, count: int = 240, seed: int = 5) -> Repeated:
    """Noise of a colour, `lacks` times its rms in every beat (growing), and at each switching a peak of its own."""
    random = np.random.default_rng(seed)
    begins = 0.5 + np.cumsum(0.4 * (1 + 0.03 * random.standard_normal(count)))
    off = begins + 0.15
    time = np.arange(int((begins[-1] + 0.4) / STEP)) * STEP
    values = RMS * colour.sample(time.size, random)
    phase = time - begins[np.clip(np.searchsorted(begins, time, side="right") - 1, 0, None)]
    values += lacks * RMS * np.sin(2 * np.pi * np.clip(phase, 0, 0.4) / 0.4) * (1 + time / time[-1])
    for at in (*begins, *off):
        values[np.searchsorted(time, at)] += 10 * RMS * random.standard_normal()
    return Repeated(time, values, begins, np.sort(np.concatenate([begins, off])))


@pytest.mark.parametrize("lacks", [0.0, 5.0])
@pytest.mark.parametrize("colour", [Colour(0.0), Colour(0.83), Colour(0.9, 0.3)], ids=["white", "ar1", "arma"])
def test_the_noise_of_beats_is_told_whatever_repeats(colour: Colour, lacks: float) -> None:
    """Level and colour are those of the noise, also beside what a model lacks, and where switchings are missed."""
    found = of_residual(UNKNOWN, unrepeated([beats(colour, lacks)]))
    assert found.quiet and found.by_residual
    assert found.innovation == pytest.approx(RMS * np.sqrt(colour.innovation), rel=0.05)
    assert found.slow == pytest.approx(RMS * np.sqrt(colour.density()), rel=0.25)


def test_few_beats_tell_nothing() -> None:
    """Noise stays as it is known where too few repetitions follow each other."""
    assert of_residual(UNKNOWN, unrepeated([beats(Colour(0.5), 0.0, LEAST_REPETITIONS)])) is UNKNOWN


def test_nothing_is_told_near_switchings() -> None:
    """No stretch has a sample that is near a switching."""
    record = beats(Colour(0.0), 0.0)
    told = unrepeated([record])
    assert told
    at = np.searchsorted(record.time, record.switchings)
    for stretch in told:
        inside = stretch.first[:, None] + np.arange(len(stretch.values))
        assert np.abs(inside[..., None] - at).min() > NEAR - 2
