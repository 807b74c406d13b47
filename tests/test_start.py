"""Whether a signal begins off zero: from its first samples, on made-up ones."""

from __future__ import annotations

import numpy as np
import pytest

from tubular_dea.identify.start import _begins_off

TIME = 0.004 * np.arange(100)
LATER = np.where(np.arange(100) < 12, 0.0, 100.0)  # what comes after the first samples


@pytest.mark.parametrize(("level", "off"), [(2.9, False), (3.1, True), (-3.1, True)])
def test_a_load_is_more_than_zeros_usually_are(level: float, off: bool) -> None:
    assert _begins_off(TIME, level + LATER, zero=1.0) is off


@pytest.mark.parametrize(("level", "off"), [(1.95, False), (2.1, True)])
def test_a_load_is_no_small_part_of_a_signal_whose_zero_is_unknown(level: float, off: bool) -> None:
    assert _begins_off(TIME, level + LATER, zero=0.0) is off


@pytest.mark.parametrize(("errors", "off"), [(4.9, False), (5.1, True)])
def test_a_load_stands_out_of_the_noise(errors: float, off: bool) -> None:
    noise = np.where(np.arange(12) % 2, -1.0, 1.0)
    (_, begin), covariance = np.polyfit(TIME[:12], noise, 1, cov=True)
    level = errors * np.sqrt(covariance[1, 1]) - begin
    assert _begins_off(TIME[:12], noise + level, zero=1e-6) is off


def test_a_few_samples_tell_nothing() -> None:
    assert not _begins_off(TIME[:11], np.full(11, 50.0), zero=1.0)
