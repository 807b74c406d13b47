"""A supply that falls more slowly than it rises: an independent rig's diode and bleeder are told from electrodes."""

from __future__ import annotations

from pathlib import Path

import pytest

import tubular_dea as td
from blind.laboratory import laboratory, write


@pytest.mark.long
@pytest.mark.parametrize("seed", [17, 18])
def test_a_voltage_that_falls_slowly_is_told_from_electrodes(seed: int, tmp_path: Path) -> None:
    lab = laboratory(seed, "slow_discharge", only=["edges"])
    write(lab, tmp_path / "set")
    found = td.discover(tmp_path / "set")
    (effect,) = found.effects
    assert effect.id == "slow_discharge" and "electrode_resistance" not in effect.equivalent
    tau, (hidden,) = effect.parameters["tau_discharge"], lab.tube.hidden["slow_discharge"]
    assert tau.value == pytest.approx(hidden, abs=4 * tau.stderr)
    assert tau.stderr < 0.1 * hidden
