"""What the tests share: FMUs for this machine, the compiled model, results of long commands; made once a session."""

from __future__ import annotations

import fcntl
import hashlib
import os
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path

import pytest

from tubular_dea.cli import main
from tubular_dea.export.compile import PLATFORMS, host
from tubular_dea.export.package import native_fmu
from tubular_dea.kernel import Kernel
from tubular_dea.model.dea import tubular_dea
from tubular_dea.model.declare import Model

# Each worker has a processor of its own: threads that wait for one cost a fifth of the time.
WORKER = os.environ.get("PYTEST_XDIST_WORKER")
if WORKER and hasattr(os, "sched_setaffinity"):
    PROCESSORS = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {PROCESSORS[int(WORKER.removeprefix("gw")) % len(PROCESSORS)]})


def pytest_addoption(parser: pytest.Parser) -> None:
    """How long and how the fuzzers run."""
    parser.addoption("--fuzz-calls", type=int, default=100_000, help="calls of each FMI fuzzer (100000)")
    parser.addoption("--fuzz-cases", type=int, default=2000, help="random tubes of the physics fuzzer (2000)")
    parser.addoption("--fuzz-lifecycles", type=int, default=300, help="create-run-free cycles of the leak test (300)")
    parser.addoption("--fuzz-kills", type=int, default=2, help="kills of each writing command (2)")
    parser.addoption("--fuzz-seed", type=int, default=1, help="seed of the fuzzers (1)")


os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # commands in processes of their own would compile all of it each time

# Files that take longest begin first, and each goes to one worker as a whole (--dist=loadfile in pyproject.toml).
FIRST = ["readme", "discover", "assist", "kills", "importers", "api", "package", "page", "numbers"]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """So that no worker is left with a long one at the end."""
    places = {f"test_{name}": place for place, name in enumerate(FIRST)}
    items.sort(key=lambda item: places.get(item.path.stem, len(places)))


@pytest.fixture(scope="session")
def carried_out(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """The OUT of a long command, which only the first test that asks carries out, whichever worker it is in.

    What it printed is in OUT.said.
    """
    root = tmp_path_factory.getbasetemp()
    root = root.parent if "PYTEST_XDIST_WORKER" in os.environ else root

    def out(*words: str) -> Path:
        name = hashlib.sha256(repr(words).encode()).hexdigest()[:16]
        with (root / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not (root / f"{name}.done").exists():
                with (root / f"{name}.said").open("w", encoding="utf-8") as said, redirect_stdout(said):
                    assert main([*words, "--out", str(root / name)]) == 0
                (root / f"{name}.done").touch()
        return root / name

    return out


@pytest.fixture(scope="session")
def model() -> Model:
    """The paper's model."""
    return tubular_dea()


@pytest.fixture(scope="session")
def kernel(model: Model) -> Kernel:
    """The paper's model, compiled and called from Python."""
    return Kernel(model)


@pytest.fixture(scope="session")
def fmi2_fmu(model: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The native FMI 2.0 FMU for this machine."""
    return native_fmu(model, 2, tmp_path_factory.mktemp("fmi2") / "TubularDEA.fmu")


@pytest.fixture(scope="session")
def fmi3_fmu(model: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The native FMI 3.0 FMU for this machine."""
    return native_fmu(model, 3, tmp_path_factory.mktemp("fmi3") / "TubularDEA.fmu")


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def fmu(request: pytest.FixtureRequest) -> Path:
    """The native FMU of each FMI version: for what both do alike."""
    return request.getfixturevalue(f"fmi{request.param}_fmu")


@pytest.fixture(scope="session")
def fmi2_fmu_other_platforms(model: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The native FMI 2.0 FMU for this machine and for those whose programs can be run on it: wine, qemu."""
    targets = [p for p in PLATFORMS if p == host() or "macos" not in p.name]
    return native_fmu(model, 2, tmp_path_factory.mktemp("others") / "TubularDEA.fmu", targets)


@pytest.fixture(scope="session")
def python_fmu(model: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pythonfmu FMU."""
    from tubular_dea.export.python_fmu import python_fmu as package

    return package(model, tmp_path_factory.mktemp("python") / "TubularDEA.fmu")
