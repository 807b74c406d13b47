"""The loop on measured aortic flow and pressure: a delay in vivo, nothing ex vivo; and on records made here."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from tubular_dea.cli import main
from tubular_dea.discover.aorta import Record, modelled, relaxed, search

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data" / "aorta"


def beats(noise: float, late: float = 0.0, seed: int = 0) -> Record:
    """Six beats of a windkessel whose flow is recorded `late` [s]; mmHg and mL/s."""
    t = np.arange(0, 4.8, 0.005)
    phase = t % 0.8

    def flow(at: np.ndarray) -> np.ndarray:
        return np.where(at % 0.8 < 0.3, 300 * np.sin(np.pi * (at % 0.8) / 0.3), 0.0) + 8 * np.sin(2 * np.pi * 1.7 * at)

    empty = Record("made", t, flow(t), np.zeros_like(t), phase >= 0)
    pressure = modelled(empty, (), {"R": 1.1, "C": 1.3, "Z_c": 0.06, "p_C_start": 85.0})
    random = np.random.default_rng(seed)
    rough = np.convolve(random.standard_normal(t.size), np.ones(4) / 2, mode="same")
    return Record("made", t, flow(t - late), pressure + noise * rough, t <= 3.6)


def test_the_windkessel_is_solved_exactly() -> None:
    t = np.array([0.0, 0.3, 0.7])
    found = relaxed(t, np.array([1.0, 2.0, 2.0]), 0.5, 0.0)
    ramp = 1 + 0.3 / 0.3 - 0.5 / 0.3 + (0.5 / 0.3 - 1) * np.exp(-0.3 / 0.5)
    assert found[1] == pytest.approx(ramp)
    assert found[2] == pytest.approx(2 + (ramp - 2) * np.exp(-0.4 / 0.5))


def test_a_late_flow_probe_is_found_and_nothing_is_named_without_it() -> None:
    late = search([beats(0.5, 0.03), beats(0.5, 0.03, 1)], lambda what: None)
    assert late.chosen == ("flow_delay",)
    assert late.after[0].values["flow_delay"] == pytest.approx(0.03, abs=0.003)
    assert search([beats(0.5), beats(0.5, seed=1)], lambda what: None).chosen == ()


def _measured(kind: str, number: str, folder: Path) -> None:
    """One record of the shared data in the command's format."""
    source = SHARED / f"{kind}_data"
    if not source.is_dir():
        assert "CI" not in os.environ, f"{source} is missing: CI has to check out the shared data"
        pytest.skip(f"{source} is not there: the measured records lie beside the repository")
    columns = {}
    for letter in "PQ":
        rows = [
            line.split(",") for line in (source / f"Ao_baseline1_Ao{letter}{number}.csv").read_text().splitlines()[2:]
        ]
        clock = [[float(x) for x in row[0].split(":")] for row in rows]
        columns[letter] = np.array([h * 3600 + m * 60 + s for h, m, s in clock]), np.array([float(r[1]) for r in rows])
    (tp, p), (tq, q) = columns["P"], columns["Q"]
    t = np.arange(max(tp[0], tq[0]), min(tp[-1], tq[-1]), 0.005)
    table = np.column_stack([t - t[0], np.interp(t, tq, q), np.interp(t, tp, p)])
    folder.mkdir(exist_ok=True)
    header = "time [s],flow [L/min],pressure [mmHg]"
    np.savetxt(folder / f"{kind}{number}.csv", table, delimiter=",", fmt="%.6g", header=header, comments="")


def test_a_pig_in_vivo_and_its_heart_ex_vivo(tmp_path: Path) -> None:
    for kind, numbers in (("invivo", "12"), ("exvivo", "1")):
        for number in numbers:
            _measured(kind, number, tmp_path / kind)
        assert (
            main(
                [
                    "close-loop",
                    str(tmp_path / kind),
                    "--model",
                    "aortic-windkessel",
                    "--out",
                    str(tmp_path / "o" / kind),
                ]
            )
            == 0
        )
    inside = json.loads((tmp_path / "o" / "invivo" / "result.json").read_text())
    assert [e["id"] for e in inside["effects"]] == ["flow_delay"]
    for record in inside["error"]["recalibrated"]["per_experiment"].values():
        assert record["fit_percent"] == pytest.approx(61.5, abs=1)
    for record in inside["error"]["after"]["per_experiment"].values():
        assert record["fit_percent"] > 72
    outside = json.loads((tmp_path / "o" / "exvivo" / "result.json").read_text())
    assert outside["verdict"] == "no_effect"
    assert (tmp_path / "o" / "invivo" / "fmi2" / "AorticAfterload.fmu").exists()
