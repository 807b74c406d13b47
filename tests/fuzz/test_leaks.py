"""No memory is lost over many lifecycles of an instance, by LeakSanitizer; 10000 by `--fuzz-lifecycles 10000`.

The binary as it is shipped, without a sanitizer, goes through a tenth of that under valgrind (Debian: valgrind).
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from hosts.beside_sources import compile_driver
from hosts.compile import FMI_HEADERS, run_host
from hosts.compile import SOURCE as HOST
from tubular_dea.model.dea import tubular_dea
from tubular_dea.plants.effects import with_effects

SOURCE = Path(__file__).parent / "lifecycles.c"
FLAGS = ["-std=c99", "-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-ffp-contract=off"]
EFFECTS = {"tube": [], "delayed tube": ["pressure_delay", "sensor_delay"]}


@pytest.mark.skipif(not shutil.which("gcc"), reason="the sanitizers come with gcc")
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", EFFECTS)
def test_nothing_leaks(
    name: str, version: int, tmp_path: Path, request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    model = with_effects(tubular_dea(), EFFECTS[name])
    driver = compile_driver(model, version, [SOURCE], FLAGS, tmp_path)
    lifecycles = str(request.config.getoption("--fuzz-lifecycles"))
    done = subprocess.run([driver, lifecycles], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with capsys.disabled():
        print(f"\n{name}: {done.stdout.strip()}, nothing lost", end="")
    leaking = subprocess.run([driver, "1", "leak"], capture_output=True, text=True)
    assert "LeakSanitizer" in leaking.stderr, "the sanitizer does not see leaks here"


@pytest.mark.skipif(not shutil.which("valgrind") or not shutil.which("gcc"), reason="needs valgrind and gcc")
def test_the_shipped_binary_under_valgrind(
    fmi2_fmu: Path, tmp_path: Path, request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the C host: no error, no leak; states are saved on the way."""
    host, checked, lifecycles = (
        tmp_path / "host",
        tmp_path / "checked",
        request.config.getoption("--fuzz-lifecycles") // 10,
    )
    flags = ["-std=c11", "-D_POSIX_C_SOURCE=200809L", "-O1", "-g", f"-I{FMI_HEADERS}"]
    subprocess.run(["gcc", *flags, "-o", str(host), str(HOST), "-lm", "-ldl"], check=True)
    checked.write_text(f'#!/bin/sh\nexec valgrind -q --error-exitcode=9 --leak-check=full "{host}" "$@"\n')
    checked.chmod(0o755)
    time = np.arange(21)
    inputs = np.column_stack([1e-3 * time, 12000.0 + 0 * time, np.where(time > 5, 5000.0, 0.0)])
    outputs = ["lambda_2", "snap_through_pressure"]
    seen = run_host(
        checked, fmi2_fmu, inputs, outputs, ["--repeat", str(lifecycles), "--save", "10", str(tmp_path / "s")]
    )
    assert np.array_equal(seen, run_host(host, fmi2_fmu, inputs, outputs))
    with capsys.disabled():
        print(f"\nshipped binary under valgrind: {lifecycles} lifecycles, nothing lost", end="")
