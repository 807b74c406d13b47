"""The loop on measured recordings that come with the project."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from measured import table
from measured.table import PLANTS

LOOP = PLANTS.parent / "data" / "mock_loop"


@pytest.mark.long
def test_the_shipped_levels_of_the_mock_loop_name_its_resistance(carried_out: Callable[..., Path]) -> None:
    out = carried_out("close-loop", str(LOOP), "--plant", str(PLANTS / "mock_loop.py"), "--hold-out", "level_10")
    result = json.loads((out / "result.json").read_text())
    outflow, wave = result["effects"]
    assert outflow["id"] == "power(outflow)"
    assert outflow["equivalent"][0] == "quadratic_resistance(outflow)"  # the nearest; a curved sensor may be in the set
    assert {*outflow["equivalent"]} <= {"quadratic_resistance(outflow)", "power(pressure)"}
    # the wave alone takes over half of it: 2.2 to 1 (3.1 with lines, which miss this flow by two to five times as much
    # between samples: test_monitors.py -k measured_flow)
    assert outflow["explained"] > 2 * wave["explained"]
    assert wave["id"] == "echo(flow)"
    before, after = (result["error"][k]["held_out_rmse"] for k in ("recalibrated", "after"))
    assert after < 0.145 * before  # 1.49 of 10.4 mmHg; with lines between samples at 50 Hz 1.54


def test_the_table_skips_what_is_not_beside_the_project(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(table, "DATA", tmp_path)
    table.table([])
    skipped = [line for line in capsys.readouterr().out.splitlines() if "skipped" in line]
    assert len(skipped) == len(table.cases(tmp_path))
    assert all(str(tmp_path) in line for line in skipped)
