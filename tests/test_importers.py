"""The FMUs give the same trajectory in every importer as in FMPy.

Protocol: 95 mmHg after a start ramp of 0.1 s, 5 kV between 0.5 s and 1.0 s; 1.5 s in steps of 1 ms,
inputs held during each step. Communication points and holds are the same everywhere, so the
trajectories must agree to rounding. Importers differ only in the time they file a step under, which
`hosts/importers.py` settles.
"""

import functools
import importlib.util
import os
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hosts import importers
from hosts.compile import OTHER_PLATFORMS, Target, compile_host, compile_ones, run_host, time_host

STEP = 1e-3  # s
STEPS = 1500
PRESSURE = 12665.59  # Pa, 95 mmHg
VOLTAGE = 5000.0  # V
TOLERANCE = 1e-9  # of lambda_2, dimensionless
TIMEOUT_S = 300
PACKAGES = {"ecos": "ecospy", "libcosim": "libcosimpy", "pathsim": "pathsim_fmi"}

Trajectory = Callable[[str, Path], np.ndarray]


def protocol() -> np.ndarray:
    """Rows `time [s], pressure [Pa], voltage [V]`, one per communication point."""
    k = np.arange(STEPS + 1)
    pressure = PRESSURE * np.minimum(k / 100, 1.0)
    voltage = np.where((k >= 500) & (k < 1000), VOLTAGE, 0.0)
    return np.column_stack([k * STEP, pressure, voltage])


def unavailable(reason: str) -> None:
    """Skip where a tool is missing, but fail in CI, whose task is to run every importer."""
    if "CI" in os.environ:
        pytest.fail(reason)
    pytest.skip(reason)


PROGRAMS = {
    "x86_64-windows": "wine wine64",
    "x86-windows": "wine wine32:i386",
    "aarch64-linux": "qemu-user libc6-arm64-cross",
}


def require_runner(target: Target) -> None:
    """Skip unless programs for `target` run here."""
    if target == "x86-windows" and "NO_WINE32" in os.environ:  # .ci/run has tried
        pytest.skip(os.environ["NO_WINE32"])
    if target in OTHER_PLATFORMS and OTHER_PLATFORMS[target].runner() is None:
        unavailable(f"the binary for {target} needs the Debian packages {PROGRAMS[target]}")


def require_importer(importer: str) -> None:
    """Skip unless the importer's package can be imported; ecos also needs a system library."""
    package = PACKAGES[importer]
    if importlib.util.find_spec(package) is None:
        unavailable(f"{importer} needs the Python package {package}")
    loads = subprocess.run(
        [sys.executable, "-c", f"import {package}"], capture_output=True, text=True, timeout=TIMEOUT_S
    )
    if loads.returncode != 0:
        unavailable(f"{package} does not load: {loads.stderr.strip().splitlines()[-1]}")


@pytest.fixture(scope="session")
def trajectory(tmp_path_factory: pytest.TempPathFactory) -> Trajectory:
    """`trajectory(importer, fmu)`: rows `time [s], lambda_2 [1]` as the importer reports them."""
    folder = tmp_path_factory.mktemp("importers")
    np.save(folder / "inputs.npy", protocol())

    @functools.cache
    def run(importer: str, fmu: Path) -> np.ndarray:
        result = folder / f"result-{len(list(folder.iterdir()))}.npy"
        arguments = [importer, str(fmu), str(folder / "inputs.npy"), str(result)]
        finished = subprocess.run(
            [sys.executable, importers.__file__, *arguments],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=TIMEOUT_S,
        )
        log = f"{finished.stdout}\n{finished.stderr}"
        assert finished.returncode == 0, f"{importer} failed on {fmu.name}:\n{log[-4000:]}"
        return np.load(result)

    return run


def assert_same(reported: np.ndarray, reference: np.ndarray) -> None:
    """Compare lambda_2 at every communication point after the start; none may be missing."""
    step_index = np.rint(reported[:, 0] / STEP).astype(int)
    assert np.abs(reported[:, 0] - step_index * STEP).max() < 1e-9, "reported between the steps"
    assert set(step_index) >= set(range(1, STEPS + 1)), "communication points are missing"
    difference = np.abs(reported[:, 1] - reference[step_index, 1])
    worst = int(np.argmax(difference))
    assert difference[worst] <= TOLERANCE, (
        f"lambda_2 differs by {difference[worst]:.3g} at t = {reported[worst, 0]:.3f} s"
    )


def assert_moves(reference: np.ndarray) -> None:
    """The tube must inflate under pressure, widen with the voltage and come back without it."""
    assert reference.shape == (STEPS + 1, 2)
    start, inflated, driven, released = reference[[0, 500, 1000, STEPS], 1]
    assert np.isfinite(reference).all()
    assert inflated > start + 0.01
    assert driven > inflated + 1e-3
    assert released < driven - 1e-3


@pytest.mark.parametrize("fixture", ["fmi2_fmu", "fmi3_fmu", "python_fmu"])
def test_reference_moves(fixture: str, trajectory: Trajectory, request: pytest.FixtureRequest) -> None:
    assert_moves(trajectory("fmpy", request.getfixturevalue(fixture)))


@pytest.mark.long
@pytest.mark.parametrize(
    ("importer", "fixture"),
    [
        ("ecos", "fmi2_fmu"),
        ("ecos", "fmi3_fmu"),
        ("ecos", "python_fmu"),
        # libcosim reads FMI 1 and 2 only.
        ("libcosim", "fmi2_fmu"),
        ("libcosim", "python_fmu"),
        ("pathsim", "fmi2_fmu"),
        ("pathsim", "fmi3_fmu"),
        ("pathsim", "python_fmu"),
    ],
)
def test_importer_agrees_with_fmpy(
    importer: str, fixture: str, trajectory: Trajectory, request: pytest.FixtureRequest
) -> None:
    require_importer(importer)
    fmu = request.getfixturevalue(fixture)
    assert_same(trajectory(importer, fmu), trajectory("fmpy", fmu))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="where pythonfmu's library releases twice")
@pytest.mark.parametrize("importer", ["fmpy", *PACKAGES])
def test_python_fmu_lets_its_host_end(
    importer: str, python_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No use of freed memory as the process ends (`export/slave/ending.py`)."""
    if importer in PACKAGES:
        require_importer(importer)
    np.save(tmp_path / "inputs.npy", protocol()[:11])
    monkeypatch.setenv("LD_PRELOAD", str(compile_ones(tmp_path)))
    arguments = [importer, str(python_fmu), str(tmp_path / "inputs.npy"), str(tmp_path / "result.npy")]
    finished = subprocess.run([sys.executable, importers.__file__, *arguments], timeout=TIMEOUT_S)
    assert np.load(tmp_path / "result.npy")[-1, 1] > 1
    assert finished.returncode == 0


@pytest.mark.skipif(not sysconfig.get_config_var("Py_ENABLE_SHARED"), reason="needs Python as a shared library")
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="where pythonfmu's library releases twice")
def test_python_fmu_lets_a_host_end_that_is_not_python(
    python_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here pythonfmu's library starts the interpreter, and ends it while its static pointer is destroyed."""
    host, ones = compile_host("host", tmp_path), compile_ones(tmp_path)
    python = Path(sysconfig.get_config_var("LIBDIR"), sysconfig.get_config_var("INSTSONAME"))
    monkeypatch.setenv("PYTHONHOME", sys.base_prefix)
    monkeypatch.setenv("LD_PRELOAD", f"{python} {ones}")
    assert run_host(host, python_fmu, protocol()[:11], ["lambda_2"])[-1, 1] > 1


def test_c_host_agrees_with_fmpy(
    fmi2_fmu: Path, trajectory: Trajectory, tmp_path_factory: pytest.TempPathFactory
) -> None:
    host = compile_host("host", tmp_path_factory.getbasetemp())
    reported = run_host(host, fmi2_fmu, protocol(), ["lambda_2"])
    assert_same(reported, trajectory("fmpy", fmi2_fmu))


@pytest.mark.long
@pytest.mark.parametrize("target", OTHER_PLATFORMS)
def test_external_binaries_agree_with_fmpy(
    target: Target,
    fmi2_fmu_other_platforms: Path,
    fmi2_fmu: Path,
    trajectory: Trajectory,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    require_runner(target)
    host = compile_host(target, tmp_path_factory.getbasetemp())
    reported = run_host(host, fmi2_fmu_other_platforms, protocol(), ["lambda_2"])
    assert_same(reported, trajectory("fmpy", fmi2_fmu))


@pytest.mark.long
@pytest.mark.parametrize(
    ("giver", "taker"),
    [
        ("host", "x86_64-windows"),
        ("x86_64-windows", "host"),
        ("host", "host"),
        ("host", "aarch64-linux"),
        ("host", "x86-windows"),
    ],
)
def test_states_move_between_platforms(
    giver: Target,
    taker: Target,
    fmi2_fmu_other_platforms: Path,
    tmp_path: Path,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    """A state stored by one process in mid-motion, and taken up by another that came there along another way."""
    require_runner(giver)
    require_runner(taker)
    whole, at, file = protocol()[:901], 600, tmp_path / "state"
    other = whole.copy()
    other[:at, 1:] = 1000.0
    drive = {t: "Z:" if t.endswith("windows") and os.name != "nt" else "" for t in ("host", *OTHER_PLATFORMS)}
    hosts = {target: compile_host(target, tmp_path_factory.getbasetemp()) for target in (giver, taker)}
    outputs = ["lambda_2", "lambda_2_rate", "sigma_vis1", "sigma_vis2"]
    save, restore = (["--save", str(at), drive[giver] + str(file)], ["--restore", str(at), drive[taker] + str(file)])
    given = run_host(hosts[giver], fmi2_fmu_other_platforms, whole, outputs, save)
    taken = run_host(hosts[taker], fmi2_fmu_other_platforms, other, outputs, restore)
    apart = np.abs(given - taken)[:, 1:] / [1, 10, 1e5, 1e5]
    assert apart[at].max() > 1e-3, "the other way led to the same place"
    assert apart[at + 1 :].max() <= (0 if giver == taker else 1e-12)


def test_c_host_tells_what_is_wrong(fmi2_fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    host = compile_host("host", tmp_path_factory.getbasetemp())
    gap = np.delete(protocol(), 7, axis=0)
    with pytest.raises(RuntimeError, match=r"expected input row 8 at t = 0\.007 s"):
        run_host(host, fmi2_fmu, gap, ["lambda_2"])
    with pytest.raises(KeyError, match="lambda_9"):
        run_host(host, fmi2_fmu, protocol(), ["lambda_9"])


def test_c_host_times_a_step(fmi2_fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    host = compile_host("host", tmp_path_factory.getbasetemp())
    nanoseconds = time_host(host, fmi2_fmu, protocol()[:101], ["lambda_2"], repeat=3)
    assert 0 < nanoseconds < 1e9
