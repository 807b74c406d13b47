"""A command that acts late: an independent rig's voltage comes after its record."""

from __future__ import annotations

from pathlib import Path

import pytest

import tubular_dea as td
from blind.laboratory import laboratory, write


@pytest.mark.long
@pytest.mark.parametrize("seed", [17, 18])
def test_a_voltage_that_comes_late_is_told_from_a_sensor_that_does(seed: int, tmp_path: Path) -> None:
    lab = laboratory(seed, "voltage_delay", only=["edges"])
    write(lab, tmp_path / "set")
    found = td.discover(tmp_path / "set")
    (effect,) = found.effects
    assert effect.id == "voltage_delay" and "sensor_delay" not in effect.equivalent
    delay, (hidden,) = effect.parameters["voltage_delay"], lab.tube.hidden["voltage_delay"]
    assert delay.value == pytest.approx(hidden, abs=4 * delay.stderr)
    assert delay.stderr < 0.1 * hidden
