"""Slow noise is alike wherever one looks; what a model lacks is where it is driven."""

import numpy as np
import pytest

from tubular_dea.identify.fitting.misfit import alike_throughout


def flicker(random: np.random.Generator, count: int, power: float) -> np.ndarray:
    """Noise with a density of frequency^-power, less a parabola (a fit takes that much)."""
    frequency = np.fft.rfftfreq(4 * count)[1:]
    lines = random.standard_normal((2, frequency.size)) * frequency ** (-power / 2)
    values = np.fft.irfft(np.r_[0, lines[0] + 1j * lines[1]])[:count]
    smooth = np.vander(np.linspace(-1, 1, count), 3)
    left = values - smooth @ np.linalg.lstsq(smooth, values, rcond=None)[0]
    return np.asarray(left / left.std())


@pytest.mark.parametrize(("files", "blocks"), [(3, 120), (8, 60), (1, 300), (2, 40)])
def test_noise_is_alike_in_all_parts_however_slow(files: int, blocks: int) -> None:
    random = np.random.default_rng(1)
    for power in (0.0, 0.5, 1.0):
        for _ in range(100):
            assert alike_throughout([flicker(random, blocks, power) for _ in range(files)])


def test_of_random_walks_few_are_unlike() -> None:
    random = np.random.default_rng(2)
    assert np.mean([not alike_throughout([flicker(random, 120, 2.0) for _ in range(3)]) for _ in range(300)]) < 0.05


@pytest.mark.parametrize("files", [2, 3])
def test_what_rings_after_a_drive_is_unlike(files: int) -> None:
    """A swing of 2.3 Hz, seen every 0.125 s, from the tenth block of one file on."""
    random, number = np.random.default_rng(3), np.arange(128)
    for _ in range(50):
        means = [random.standard_normal(128) for _ in range(files)]
        means[0] += 5.0 * np.sin(2 * np.pi * 2.3 * 0.125 * number) * (number > 60)
        assert not alike_throughout(means)


def test_too_little_is_alike() -> None:
    assert alike_throughout([]) and alike_throughout([np.ones(8)]) and alike_throughout([np.zeros(100), np.zeros(3)])
