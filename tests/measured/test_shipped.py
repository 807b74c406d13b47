"""The loop on measured recordings that come with the project."""

from __future__ import annotations

import json
from pathlib import Path

from measured.table import PLANTS
from tubular_dea.cli import main

LOOP = PLANTS.parent / "data" / "mock_loop"


def test_the_shipped_levels_of_the_mock_loop_name_its_resistance(tmp_path: Path) -> None:
    plant = str(PLANTS / "mock_loop.py")
    assert main(["close-loop", str(LOOP), "--plant", plant, "--hold-out", "level_10", "--out", str(tmp_path)]) == 0
    result = json.loads((tmp_path / "result.json").read_text())
    outflow, wave = result["effects"]
    assert [outflow["id"], *outflow["equivalent"]] == ["power(outflow)", "quadratic_resistance(outflow)"]
    assert outflow["explained"] > 0.85
    assert wave["id"] == "echo(flow)"
    before, after = (result["error"][k]["held_out_rmse"] for k in ("recalibrated", "after"))
    assert after < 0.25 * before
