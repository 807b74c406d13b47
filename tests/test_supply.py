"""What a supply does behind the record of its voltage: it comes late, or falls more slowly than it rises."""

from __future__ import annotations

from pathlib import Path

import pytest

import tubular_dea as td
from blind.laboratory import laboratory, write


@pytest.mark.long
@pytest.mark.parametrize("seed", [17, 18])
@pytest.mark.parametrize(
    ("kind", "size", "other"),
    [
        ("voltage_delay", "voltage_delay", "sensor_delay"),
        ("slow_discharge", "tau_discharge", "electrode_resistance"),  # there: a diode and a bleeder
    ],
)
def test_a_fault_of_the_voltage_is_told_from_what_is_like_it(
    kind: str, size: str, other: str, seed: int, tmp_path: Path
) -> None:
    lab = laboratory(seed, kind, only=["edges"])
    write(lab, tmp_path / "set")
    found = td.discover(tmp_path / "set")
    (effect,) = found.effects
    assert effect.id == kind and other not in effect.equivalent
    fitted, (hidden,) = effect.parameters[size], lab.tube.hidden[kind]
    assert fitted.value == pytest.approx(hidden, abs=4 * fitted.stderr)
    assert fitted.stderr < 0.1 * hidden
