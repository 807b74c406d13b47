"""The example that draws the paper's figures: its inputs are the reference traces', its folds the paper's."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scenarios import case

SCRIPT = Path(__file__).resolve().parents[1] / "cosim_examples" / "paper_figures.py"
FOLDS = {"4": (24.5, 147), "5": (24.0, 135), "5.5": (23.8, 128), "6": (23.5, 121), "7": (23.0, 104.6)}  # design.md


@pytest.mark.parametrize(
    ("name", "kind", "kilovolt"),
    [
        ("ramp_4kV", "ramp", 4),
        ("ramp_7kV_snap_through", "ramp", 7),
        ("step_4kV", "step", 4),
        ("step_5kV", "step", 5),
        ("step_5500V", "step", 5.5),
        ("step_6kV", "step", 6),
    ],
)
def test_inputs_are_those_of_the_references(name: str, kind: str, kilovolt: float) -> None:
    spec = importlib.util.spec_from_file_location("paper_figures", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    ours, theirs = getattr(module, kind)(kilovolt), case(name).inputs
    assert list(ours.time) == theirs["time"]
    np.testing.assert_allclose(ours.inputs["pressure"], theirs["pressure"], rtol=1e-6)
    np.testing.assert_allclose(ours.inputs["voltage"], theirs["voltage"], rtol=1e-6)


def test_the_picture_and_what_is_read_off_it(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, str(SCRIPT)], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-2000:]
    assert (tmp_path / "paper_figures.png").read_bytes().startswith(b"\x89PNG")
    folds = re.findall(r"fold at ([\d.]+) kV: ([\d.]+) mm, ([\d.]+) mmHg", done.stdout)
    for kilovolt, radius, pressure in folds:
        assert (float(radius), float(pressure)) == pytest.approx(FOLDS[kilovolt], abs=0.6), kilovolt
    assert [f[0] for f in folds] == list(FOLDS)
    assert "Table II: up to 21.66 mm" in done.stdout
