"""No memory is lost over many lives of an instance, by LeakSanitizer; 10000 by `--fuzz-lives 10000`."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from tubular_dea.export.package import sources
from tubular_dea.model.dea import tubular_dea
from tubular_dea.model.effects import with_effects

SOURCE = Path(__file__).parent / "lives.c"
FLAGS = ["-std=c99", "-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-ffp-contract=off"]
EFFECTS = {"tube": [], "delayed tube": ["pressure_delay", "sensor_delay"]}


@pytest.mark.skipif(not shutil.which("gcc"), reason="the sanitizers come with gcc")
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", EFFECTS)
def test_nothing_leaks(
    name: str, version: int, tmp_path: Path, request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    model = with_effects(tubular_dea(), EFFECTS[name])
    code = sources(model, version) | {SOURCE.name: SOURCE.read_text()}
    for file, text in code.items():
        (tmp_path / file).write_text(text)
    compiled = [file for file in code if file.endswith(".c")]
    command = ["gcc", *FLAGS, f"-DVERSION={version}", "-I.", "-o", "lives", *compiled, "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    lives = str(request.config.getoption("--fuzz-lives"))
    done = subprocess.run([tmp_path / "lives", lives], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with capsys.disabled():
        print(f"\n{name}: {done.stdout.strip()}, nothing lost", end="")
    leaking = subprocess.run([tmp_path / "lives", "1", "leak"], capture_output=True, text=True)
    assert "LeakSanitizer" in leaking.stderr, "the sanitizer does not see leaks here"
