"""Causes named on hardware that nobody here built; skipped where the measured data are not beside the project."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from measured.table import MMHG, cases, run
from shared_data import shared

pytestmark = pytest.mark.long
FITTED, HELD_OUT = ("NV_step03", "NV_step21"), ("NV_step05", "NV_step10", "NV_step15")  # of the mock loop's levels


def result_of(name: str, folder: Path, parts: dict[str, slice] | None = None) -> dict:
    """result.json of a row of the table, from all its recordings or from parts of those that are named."""
    shared("measured"), shared("aorta")
    case = next(c for c in cases(folder) if c.name == name)
    if parts:
        some = folder / "some"
        some.mkdir()
        for recording, samples in parts.items():
            heading, *lines = (case.data / f"{recording}.csv").read_text().splitlines()
            (some / f"{recording}.csv").write_text("\n".join([heading, *lines[samples]]))
        case = replace(case, data=some)
    return run(case, folder / "out")[0]


def test_tanks_with_a_linear_outflow_lack_its_power_law_and_the_overflow(tmp_path: Path) -> None:
    result = result_of("tanks, linear outflow", tmp_path)
    named = [e["id"] for e in result["effects"]]
    assert named[0].startswith("power(outflow_")
    assert any(name.startswith("spill_over(") for name in named)
    assert result["error"]["recalibrated"]["held_out_rmse"] == pytest.approx(1.12, abs=0.02)
    assert result["error"]["after"]["held_out_rmse"] <= 0.55
    assert result["verdict"] == "partly_explained"
    assert result["residual"]["remainder"]["rms"] > 0


def test_the_pigs_flow_probe_is_late(tmp_path: Path) -> None:
    result = result_of("pig in vivo", tmp_path)
    assert "flow_delay" in [e["id"] for e in result["effects"]]
    assert all(e["fit_percent"] >= 73 for e in result["error"]["after"]["per_experiment"].values())


def test_the_silverbox_hardens_with_the_third_power(tmp_path: Path) -> None:
    """On a tenth of each record: of the arrow, whose force grows, on its end, beyond what the others reach."""
    first, last = slice(4000), slice(-4000, None)
    result = result_of("silverbox", tmp_path, {"multisine_1": first, "multisine_2": first, "arrow": last})
    assert [e["id"] for e in result["effects"]] == ["cubic(velocity)"]
    before, after = (result["error"][k]["per_experiment"] for k in ("recalibrated", "after"))
    assert after["arrow"]["rmse"] <= min(0.55e-3, 0.035 * before["arrow"]["rmse"])
    assert after["multisine_2"]["rmse"] <= 0.35e-3


def test_what_leaves_the_mock_loop_meets_a_resistance_that_grows(tmp_path: Path) -> None:
    """Fitted to two of the table's six levels, and held against half of each of the same three others."""
    parts = dict.fromkeys(FITTED, slice(None)) | dict.fromkeys(HELD_OUT, slice(2000))
    result = result_of("mock loop", tmp_path, parts)
    first = result["effects"][0]
    assert "quadratic_resistance(outflow)" in [first["id"], *first["equivalent"]]
    after = result["error"]["after"]["per_experiment"]
    assert all(after[level]["rmse"] <= 2.7 * MMHG for level in HELD_OUT)
