"""Results: written as they come, whole after a kill, refused where they are another plan's; cubes, FMUs, reports."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from tqdm import tqdm

from sweeps import parts, steps
from tubular_dea.cli import main
from tubular_dea.report.sweep import _pictures, write_report
from tubular_dea.sweep.backends import Threads
from tubular_dea.sweep.plan import make_plan, read_plan
from tubular_dea.sweep.run import FORMAT, carry_out
from tubular_dea.sweep.store import Store, StoreError, cube, part_size, write_cube

pytest.importorskip("pyarrow")


def test_progress_fits_a_terminal() -> None:
    with open(os.devnull, "w") as nowhere:
        bar = tqdm(total=1_000_000, initial=123_456, unit_scale=True, bar_format=FORMAT, ncols=80, file=nowhere)
        bar.set_postfix_str("123456 cannot be computed")
        assert str(bar).endswith("?, 123456 cannot be computed]") and len(str(bar)) <= 80
        bar.close()


SLOW = """
outputs = ["min snap_through_margin"]
[design]
kind = "random"
points = 1500
[run]
stop = "1 s"
tolerance = 1e-5
[inputs]
pressure = "ramp 0 {top} from 0 to 1"
voltage = "ramp 0 5 kV from 0 to 1"
[vary]
top = { from = "50 mmHg", to = "95 mmHg" }
"""
GRID = """
name = "grid"
study = "rest"
outputs = ["radial_displacement", "snap_through_margin"]
[vary]
pressure = { from = "0 mmHg", to = "160 mmHg", count = 9 }
voltage = { from = "0 kV", to = "6 kV", count = 7 }
"""


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_workers_do_not_change_a_byte(tmp_path: Path) -> None:
    for workers in (1, 3):
        carry_out(steps(512), tmp_path / str(workers), Threads(workers))
    assert parts(tmp_path / "1") == parts(tmp_path / "3")
    table = Store.read(tmp_path / "1").table()
    assert table["row"].tolist() == list(range(512))
    failed = table["status"] != 0
    assert 0 < failed.sum() < 100
    assert all("no rest state" in text for text in table["message"][failed])
    assert (
        np.isnan(table["max_electric_field"][failed]).all() and np.isfinite(table["max_electric_field"][~failed]).all()
    )


@pytest.mark.long
def test_a_killed_sweep_goes_on(tmp_path: Path) -> None:
    plan, out = write(tmp_path / "plan.toml", SLOW), tmp_path / "out"
    command = [
        sys.executable,
        "-m",
        "tubular_dea.cli",
        "sweep",
        str(plan),
        "--out",
        str(out),
        "--workers",
        "1",
        "--no-report",
    ]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    victim = subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while len(list(out.glob("parts/*.parquet"))) < 3 and time.monotonic() < deadline:
        time.sleep(0.01)
    victim.send_signal(signal.SIGKILL)
    victim.wait()
    before = parts(out)
    assert 3 <= len(before) < 24, "killed on the way"
    stamps = {p.name: p.stat().st_mtime_ns for p in out.glob("parts/*.parquet")}
    cut = next(iter(before))
    (out / "parts" / cut).write_bytes(before[cut][:100])  # as after a power failure
    assert subprocess.run(command, env=environment, stderr=subprocess.DEVNULL).returncode == 0
    carry_out(read_plan(plan), tmp_path / "whole", Threads(2))
    assert parts(out) == parts(tmp_path / "whole")
    again = {p.name: p.stat().st_mtime_ns for p in out.glob("parts/*.parquet")}
    assert all(again[name] == stamps[name] for name in before if name != cut), "what was there was not computed again"


def test_a_folder_of_another_plan_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan, out = write(tmp_path / "plan.toml", GRID), tmp_path / "out"
    assert main(["sweep", str(plan), "--out", str(out), "--no-report"]) == 0
    before = {p: p.read_bytes() for p in out.rglob("*") if p.is_file()}
    other = write(tmp_path / "other.toml", GRID.replace("160", "150"))
    assert main(["sweep", str(other), "--out", str(out)]) == 2
    assert "holds the results of another plan, 'grid'" in capsys.readouterr().err
    assert {p: p.read_bytes() for p in out.rglob("*") if p.is_file()} == before
    write(tmp_path / "mine" if (tmp_path / "mine").mkdir() else tmp_path / "mine" / "thesis.txt", "")
    assert main(["sweep", str(plan), "--out", str(tmp_path / "mine")]) == 2
    assert "not empty and holds no sweep" in capsys.readouterr().err
    (out / "manifest.json").write_text("{", encoding="utf-8")
    assert main(["sweep", str(plan), "--out", str(out)]) == 2


def test_too_large_is_said_before_starting(tmp_path: Path) -> None:
    huge = {
        "study": "rest",
        "outputs": ["radius"],
        "vary": {name: {"from": 1, "to": 2, "count": 10_000_000} for name in ("pressure", "voltage")},
    }
    with pytest.raises(StoreError, match=r"1e\+14 rows need about .* GB on disk"):
        carry_out(make_plan(huge), tmp_path / "out")
    many = {
        "study": "rest",
        "outputs": ["radius"],
        "vary": {n: {"from": 2, "to": 3} for n in ("eps_r", "C_2")},
        "design": {"kind": "latin_hypercube", "points": 1_000_000_000},
    }
    with pytest.raises(StoreError, match="memory|disk"):
        carry_out(make_plan(many), tmp_path / "out")
    assert not (tmp_path / "out").exists()
    assert [part_size(n) for n in (1, 100, 10_000, 1_000_000, 10**9)] == [64, 64, 256, 16384, 16384]


def test_a_grid_is_a_cube(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("zarr")
    plan = read_plan(write(tmp_path / "plan.toml", GRID))
    store = carry_out(plan, tmp_path / "out")
    made = cube(store, plan)
    assert dict(made.sizes) == {"pressure": 9, "voltage": 7}
    rows = store.table()
    one = made["radial_displacement"].sel(pressure=rows["pressure"][30], voltage=rows["voltage"][30])
    assert float(one) == rows["radial_displacement"][30]
    read = xarray.open_zarr(write_cube(store, plan))
    xarray.testing.assert_identical(read.compute(), made)
    with pytest.raises(StoreError, match="a cube needs a grid"):
        cube(store, steps())


def test_an_fmu_made_elsewhere_takes_the_same_plan(fmi2_fmu: Path, tmp_path: Path) -> None:
    changes = {
        "design": {},
        "set": {},
        "vary": {"pressure": ["80 mmHg", "95 mmHg"], "amplitude": ["4 kV"], "on": [0.5], "C_1": ["300 kPa", "333 kPa"]},
    }
    outputs = ["final lambda_2", "max electric_field", "mean radius", "time radius rises above 17 mm", "radius at 1 s"]
    own = steps(outputs=outputs, **changes)
    external = steps(outputs=outputs, model=str(fmi2_fmu), **changes)
    tables = [carry_out(plan, tmp_path / str(i)).table() for i, plan in enumerate((own, external))]
    assert tables[1]["status"].tolist() == [0] * 4
    for name in tables[0]:
        if tables[0][name].dtype == float:
            between = 4e-3 if name.startswith("time") else 0.0  # s, from sample to sample
            np.testing.assert_allclose(tables[1][name], tables[0][name], rtol=2e-3, atol=between)
    assert own.fingerprint != external.fingerprint


def test_a_report_with_pictures(tmp_path: Path) -> None:
    grid = read_plan(write(tmp_path / "plan.toml", GRID))
    store = carry_out(grid, tmp_path / "grid")
    names = {path.name for path in write_report(store, grid)}
    assert names == {"radial_displacement.png", "snap_through_margin.png", "equilibrium_curves.png", "report.html"}
    assert (tmp_path / "grid" / "equilibrium_curves.png").read_bytes().startswith(b"\x89PNG")
    page = (tmp_path / "grid" / "report.html").read_text(encoding="utf-8")
    assert "snap-through" in page and "<script src" not in page


def test_a_map_is_coloured_up_to_its_boundary(tmp_path: Path) -> None:
    """No gaps where the boundary cuts through cells without a rest state; beyond it, one polygon of no colour."""
    grid = read_plan(write(tmp_path / "plan.toml", GRID))
    values = carry_out(grid, tmp_path / "grid").column("radial_displacement")
    heat, beyond, line = next(_pictures(grid, {"radial_displacement": values})).plotly().data
    z = values.reshape(9, 7).T
    assert np.isnan(z[5, 7]) and np.isfinite(heat.z[5, 7]), "the fold at 5 kV, 135 mmHg, is in the cell of 140 mmHg"
    there = np.isfinite(z)
    np.testing.assert_array_equal(heat.z[there], 1e3 * z[there])
    assert max(beyond.x) == 160 and min(beyond.x) == pytest.approx(min(line.x)) == pytest.approx(120.9, abs=0.1)


@pytest.mark.parametrize("kind", ["sobol_indices", "one_at_a_time"])
def test_sensitivities_find_what_matters(kind: str, tmp_path: Path) -> None:
    """The displacement of a thin tube goes nearly as p / C_1: of 10 % in p and 5 % in C_1, p makes four fifths."""
    pytest.importorskip("SALib")
    plan = make_plan(
        {
            "study": "rest",
            "outputs": ["radial_displacement"],
            "design": {"kind": kind, "points": 256},
            "vary": {
                "pressure": {"from": "9 mmHg", "to": "11 mmHg"},
                "C_1": {"from": "316 kPa", "to": "350 kPa"},
                "rho": {"from": 900, "to": 1100},
            },
        }
    )
    store = carry_out(plan, tmp_path)
    assert any(path.name.startswith(("sobol_", "tornado_")) for path in write_report(store, plan))
    found = {s["kind"]: s for s in json.loads((tmp_path / "statistics.json").read_text())}
    if kind == "one_at_a_time":
        bars = np.array(found["tornado"]["high"]) - np.array(found["tornado"]["low"])
        assert bars[0] > -bars[1] > 0 and bars[2] == 0
        return
    indices = found["indices"]
    assert indices["first"] == pytest.approx([0.8, 0.2, 0.0], abs=0.05)
    assert indices["total"] == pytest.approx([0.8, 0.2, 0.0], abs=0.05)
    assert all(0 < width < 0.3 for width in indices["total_interval"][:2])
    assert indices["total_interval"][2] == 0
