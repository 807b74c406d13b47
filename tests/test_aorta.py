"""The loop on measured aortic flow and pressure: a delay in vivo, nothing ex vivo; and on records made elsewhere."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from blind import aorta as blind
from tubular_dea.cli import main
from tubular_dea.discover.aorta.candidates import CANDIDATES, modelled, relaxed
from tubular_dea.discover.aorta.fits import Fitted
from tubular_dea.discover.aorta.records import FLOW, PRESSURE, Record, records
from tubular_dea.discover.aorta.search import search
from tubular_dea.identify.bench import AORTA
from tubular_dea.identify.data import read_folder
from tubular_dea.kernel import Kernel
from tubular_dea.model.afterload import aortic_afterload
from tubular_dea.protocol import Protocol

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data" / "aorta"
COMMAND = ["--model", "aortic-windkessel", "--out"]


def test_the_windkessel_is_solved_exactly() -> None:
    t = np.array([0.0, 0.3, 0.7])
    found = relaxed(t, np.array([1.0, 2.0, 2.0]), 0.5, 0.0)
    ramp = 1 + 0.3 / 0.3 - 0.5 / 0.3 + (0.5 / 0.3 - 1) * np.exp(-0.3 / 0.5)
    assert found[1] == pytest.approx(ramp)
    assert found[2] == pytest.approx(2 + (ramp - 2) * np.exp(-0.4 / 0.5))


@pytest.mark.parametrize("effect", CANDIDATES)
def test_the_exported_model_has_every_effect(effect: str) -> None:
    """The declared equations, driven by the true flow, give the pressure that the fit's closed formulas give."""
    t = np.arange(0, 3, 0.005)
    true = 80 * (1 + np.sin(2 * np.pi * 1.2 * t))
    value = {"inertance": 0.003, "outflow_pressure": 30.0, "parallel_inertance": 8.0}.get(effect, 0.03)
    late = effect == "flow_delay"
    seen = np.interp(t - value, t, true) if late else true
    record = Record("made", t, seen, np.zeros_like(t), t >= 0)
    values = {"R": 1.1, "C": 1.3, "Z_c": 0.06, "p_C_start": 90.0, CANDIDATES[effect].unknown.name: value}
    expected = modelled(record, (effect,), values) * PRESSURE
    model = Kernel(aortic_afterload(Fitted(record, (effect,), values, {}, expected).si()))
    run = model.simulate(Protocol(t, {"flow": true * FLOW}), t, {})
    middle = slice(20, -20)  # a delay has nothing to look back to at the start, and nothing ahead at the end
    np.testing.assert_allclose(run["measured_pressure"][middle], expected[middle], atol=0.4 * PRESSURE)
    np.testing.assert_allclose(run["measured_flow"][middle], seen[middle] * FLOW, atol=1e-3 * FLOW * seen.max())


def _searched(folder: Path, seed: int, effect: str, count: int = 2) -> tuple[str, ...]:
    blind.write(folder / f"{effect}{seed}", seed, effect, count)
    return search(records(read_folder(folder / f"{effect}{seed}", AORTA))).chosen


@pytest.mark.parametrize("effect", ["flow_delay", "inertance"])
def test_what_hides_in_records_made_elsewhere_is_found(tmp_path: Path, effect: str) -> None:
    assert [_searched(tmp_path, seed, effect) for seed in range(4)] == 4 * [(effect,)]


def test_nothing_is_named_where_nothing_is_missing(tmp_path: Path) -> None:
    assert [_searched(tmp_path, seed, "none", 1 + seed % 2) for seed in range(16)] == 16 * [()]


def _spoilt(kind: str, rows: list[list[str]], header: str) -> tuple[str, list[list[str]]]:
    """Header and cells (time, flow, pressure) with a fault."""
    if kind == "no flow":
        return "time [s],pressure [mmHg]", [[t, p] for t, _, p in rows]
    if kind == "labelled":
        return header.replace("mmHg", "Pa"), rows
    if kind == "milliseconds":
        return header.replace("[s]", "[ms]"), rows
    if kind == "short":
        return header, rows[:60]
    change = {
        "constant pressure": lambda i, q, p: (q, "95"),
        "constant flow": lambda i, q, p: ("5", p),
        "reversed": lambda i, q, p: (str(-float(q)), p),
        "frozen": lambda i, q, p: (rows[300][1] if 300 <= i < 360 else q, p),
        "mL/s": lambda i, q, p: (str(float(q) * 1000 / 60), p),
    }[kind]
    return header, [[t, *change(i, q, p)] for i, (t, q, p) in enumerate(rows)]


@pytest.mark.parametrize(("kind", "words"), [
    ("no flow", ["record1.csv, line 1", "'flow [m3/s]' is missing"]),
    ("labelled", ["record1.csv, line ", "'pressure'", "mmHg or kPa labelled Pa"]),
    ("milliseconds", ["record1.csv, lines ", "'time'", "s labelled ms"]),
    ("short", ["record1.csv", "too few samples: 60"]),
    ("constant pressure", ["record1.csv, lines 2 to ", "'pressure'", "constant record"]),
    ("constant flow", ["record1.csv, lines 2 to ", "'flow'", "constant record"]),
    ("reversed", ["record1.csv, lines 2 to ", "'flow'", "turn its sign"]),
    ("frozen", ["record1.csv, lines 302 to 361", "'flow'", "frozen"]),
    ("mL/s", ["record1.csv, line ", "'flow'", "mL/s labelled L/min"]),
])  # fmt: skip
def test_a_fault_is_named_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture, kind: str, words: list[str]
) -> None:
    data = tmp_path / "data"
    blind.write(data, 1)
    header, *lines = (data / "record1.csv").read_text().splitlines()
    spoilt, rows = _spoilt(kind, [line.split(",") for line in lines], header)
    (data / "record1.csv").write_text("\n".join([spoilt, *(",".join(row) for row in rows)]) + "\n")
    assert main(["close-loop", str(data), *COMMAND, str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert all(word in said for word in words), said
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()


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
    results = {}
    for kind, numbers in (("invivo", "12"), ("exvivo", "1")):
        for number in numbers:
            _measured(kind, number, tmp_path / kind)
        assert main(["close-loop", str(tmp_path / kind), *COMMAND, str(tmp_path / "o" / kind)]) == 0
        results[kind] = json.loads((tmp_path / "o" / kind / "result.json").read_text())
    inside, outside = results["invivo"], results["exvivo"]
    assert inside["verdict"] == "effect_found"
    assert [e["id"] for e in inside["effects"]] == ["flow_delay"]
    for record in inside["error"]["recalibrated"]["per_experiment"].values():
        assert record["fit_percent"] == pytest.approx(61.5, abs=1)
    for record in inside["error"]["after"]["per_experiment"].values():
        assert record["fit_percent"] > 72
    assert outside["verdict"] == "no_effect"
    out = tmp_path / "o" / "invivo"
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "flow_delay convinces" in page
    assert "not explained" in page
    assert main(["build", "--model", str(out / "model.json"), "--out", str(tmp_path / "built")]) == 0
    name = Path("fmi2", "AorticAfterload.fmu")
    assert (tmp_path / "built" / name).read_bytes() == (out / name).read_bytes()
