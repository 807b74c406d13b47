"""What the README says runs, runs; and the example's picture comes from its script."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_ten_lines(fmi2_fmu: Path, tmp_path: Path) -> None:
    (tmp_path / "build" / "fmi2").mkdir(parents=True)
    shutil.copy(fmi2_fmu, tmp_path / "build" / "fmi2" / "TubularDEA.fmu")
    code = re.search(r"```python\n(.*?)```", README, re.DOTALL)[1]
    assert len(code.splitlines()) <= 10
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert re.fullmatch(r"3\.\d\d mm, 6\d\.\d V/um\n", done.stdout), done.stdout + done.stderr


def test_measured_pressure_example(fmi2_fmu: Path, tmp_path: Path) -> None:
    """Runs on the data that comes with the project, and on a file of the user's."""
    (tmp_path / "build" / "fmi2").mkdir(parents=True)
    shutil.copy(fmi2_fmu, tmp_path / "build" / "fmi2" / "TubularDEA.fmu")
    time = np.arange(0, 5, 0.01)
    table = np.column_stack([time, 95 + 20 * np.sin(2 * np.pi * 1.2 * time)])
    np.savetxt(tmp_path / "mine.csv", table, "%.5g", ",", header="time [s],pressure [mmHg]", comments="")
    script = ROOT / "cosim_examples" / "measured_pressure.py"
    for argument, beats in ((str(ROOT / "cosim_examples" / "data" / "heartbeat.csv"), 12), ("mine.csv", 6)):
        done = subprocess.run([sys.executable, str(script), argument], cwd=tmp_path, capture_output=True, text=True,
                              timeout=120)  # fmt: skip
        assert done.stdout.startswith(f"{beats} beats; the wall moves over"), done.stdout + done.stderr
        assert (tmp_path / "measured_pressure.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time [s],pressure [mmHg]\n0,95\n5,95\n", "at least two beats"),
        ("time [s],pressure [kV]\n0,95\n5,95\n", "line 1: column 'pressure'"),
        ("#output name: x\ntimestamp,v\nnoon,1\n", "line 3: expected HH:MM:SS.mmm,value"),
    ],
)
def test_measured_pressure_refuses_in_one_line(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "bad.csv").write_text(text)
    script = ROOT / "cosim_examples" / "measured_pressure.py"
    done = subprocess.run([sys.executable, str(script), "bad.csv"], cwd=tmp_path, capture_output=True, text=True,
                          timeout=120)  # fmt: skip
    assert done.returncode != 0
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["bad.csv"]
