"""Random call sequences against both FMI versions, under AddressSanitizer and UndefinedBehaviorSanitizer.

The models between them have all that an instance can hold: states, a fold, discretes, delay lines (whose long
states make it slow: a tenth of the calls). Short by default, longer by
`pytest tests/fuzz --fuzz-calls 10000000 --fuzz-seed 7`. The driver, and what it stops at, is in fmi_fuzz.c.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from hosts.beside_sources import compile_driver
from tubular_dea.model.dea import tubular_dea
from tubular_dea.model.declare import Model
from tubular_dea.model.scheduler import heartbeat_scheduler
from tubular_dea.model.windkessel import aortic_windkessel
from tubular_dea.plants.effects import with_effects

MODELS: dict[str, Callable[[], Model]] = {
    "tube": tubular_dea,
    "delayed tube": lambda: with_effects(tubular_dea(), ["pressure_delay", "sensor_delay", "mullins_softening"]),
    "windkessel": aortic_windkessel,
    "scheduler": heartbeat_scheduler,
}
HERE = Path(__file__).parent
FLAGS = [
    "-std=c99",
    "-O1",
    "-g",
    "-Wall",
    "-Wextra",
    "-Werror",
    "-ffp-contract=off",
    "-fsanitize=address,undefined",
    "-fno-sanitize-recover=all",
]
FILES = [HERE / "fmi_fuzz.c", *HERE.glob("*.h")]
MAX_STEPS = 3000  # internal steps of one doStep, so that absurd inputs cost milliseconds


@pytest.mark.long
@pytest.mark.skipif(not shutil.which("gcc"), reason="the sanitizers come with gcc")
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", MODELS)
def test_random_calls(
    name: str, version: int, tmp_path: Path, request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    calls, seed = request.config.getoption("--fuzz-calls"), request.config.getoption("--fuzz-seed")
    model = MODELS[name]()
    calls //= 10 if model.delays else 1
    fuzzer = compile_driver(model, version, FILES, [*FLAGS, f"-DMAX_STEPS={MAX_STEPS}"], tmp_path)
    done = subprocess.run([fuzzer, str(calls), str(seed)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with capsys.disabled():
        print(f"\n{name}: {done.stdout.strip()}", end="")
    assert int(done.stdout.split(" calls")[0].split()[-1]) >= calls  # those from inside steps count, too
    assert " 0 steps" not in done.stdout
