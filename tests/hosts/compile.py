"""Compile the C host and run an FMU in it: natively, or its Windows half under wine.

The host (`fmi2_host.c`) calls the FMU's library directly, so a difference between it and an
importer is the importer's; and it is the only program here small enough to run under wine.
"""

import atexit
import functools
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Literal
from zipfile import ZipFile

import fmpy
import numpy as np

Target = Literal["host", "x86_64-windows"]

SOURCE = Path(__file__).with_name("fmi2_host.c")
FMI_HEADERS = Path(fmpy.__file__).parent / "c-code"
ZIG_TARGET: dict[Target, list[str]] = {
    "host": [],
    "x86_64-windows": ["-target", "x86_64-windows-gnu"],
}
INPUTS = ("pressure", "voltage")

# A first start of wine fills its prefix: 5 s on an idle machine, more when all cores are busy.
TIMEOUT_S = 300


def compile_host(target: Target, out_dir: Path) -> Path:
    """Compile the host for `target` into `out_dir`; an executable newer than the source is kept."""
    suffix = ".exe" if target != "host" or os.name == "nt" else ""
    executable = out_dir / f"fmi2_host-{target}{suffix}"
    if executable.exists() and executable.stat().st_mtime > SOURCE.stat().st_mtime:
        return executable
    out_dir.mkdir(parents=True, exist_ok=True)
    zig = [sys.executable, "-m", "ziglang", "cc", *ZIG_TARGET[target]]
    flags = ["-std=c11", "-D_POSIX_C_SOURCE=200809L", "-O2", "-Wall", "-Wextra", "-Werror"]
    files = [f"-I{FMI_HEADERS}", "-o", str(executable), str(SOURCE), "-lm"]
    subprocess.run([*zig, *flags, *files], check=True)
    return executable


def find_wine() -> str | None:
    """The program that starts 64-bit Windows executables here, or None."""
    return shutil.which("wine64") or shutil.which("wine")


@functools.cache
def wine_environment() -> dict[str, str]:
    """Environment of a throw-away wine: all it writes is in one temporary folder, removed at exit.

    The prefix takes about 0.7 GB: wine copies its system libraries into it.
    """
    folder = Path(tempfile.mkdtemp(prefix="wine-"))
    environment = os.environ | {
        "HOME": str(folder),
        "TMPDIR": str(folder),
        "WINEPREFIX": str(folder / "prefix"),
        "WINEDEBUG": "-all",
        # No offers to download .NET or a browser engine, no entries in a desktop menu.
        "WINEDLLOVERRIDES": "mscoree,mshtml,winemenubuilder.exe=",
    }
    environment.pop("DISPLAY", None)
    atexit.register(_remove_wine, folder, environment)
    return environment


def _remove_wine(folder: Path, environment: dict[str, str]) -> None:
    """End the wine services of this prefix alone, then delete it."""
    wineserver = shutil.which("wineserver")
    if wineserver and (folder / "prefix").exists():
        subprocess.run([wineserver, "--kill"], env=environment, timeout=TIMEOUT_S)
        subprocess.run([wineserver, "--wait"], env=environment, timeout=TIMEOUT_S)
    shutil.rmtree(folder, ignore_errors=True)


def run_host(
    executable: Path, fmu: Path, inputs: np.ndarray, outputs: Sequence[str], options: Sequence[str] = ()
) -> np.ndarray:
    """Run an FMI 2.0 FMU in the host.

    `inputs`: rows `time [s], pressure [Pa], voltage [V]` at equidistant communication points, the
    last of them the stop time; `options` as in fmi2_host.c. Returns rows `time [s], output...` at the same points.
    """
    stdout, _ = _run(executable, fmu, inputs, outputs, list(options))
    return np.loadtxt(stdout.splitlines(), delimiter=",", ndmin=2)


def time_host(
    executable: Path, fmu: Path, inputs: np.ndarray, outputs: Sequence[str], repeat: int
) -> float:
    """Nanoseconds per step (set inputs, step, get outputs), the least of `repeat` runs."""
    _, stderr = _run(executable, fmu, inputs, outputs, ["--repeat", str(repeat), "--time"])
    return float(stderr.split()[-4])


def _run(
    executable: Path, fmu: Path, inputs: np.ndarray, outputs: Sequence[str], options: list[str]
) -> tuple[str, str]:
    """Unpack the FMU, run the host once and return what it wrote to stdout and stderr."""
    wine = [find_wine() or "wine"] if executable.suffix == ".exe" and os.name != "nt" else []
    with tempfile.TemporaryDirectory(prefix="fmu-") as folder:
        arguments = _arguments(Path(folder), executable, fmu, inputs, outputs)
        finished = subprocess.run(
            [*wine, str(executable), *arguments, *options],
            input="\n".join(" ".join(f"{value:.17g}" for value in row) for row in inputs),
            env=wine_environment() if wine else None,
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=TIMEOUT_S,
        )
    if finished.returncode != 0:
        raise RuntimeError(f"{executable.name} failed on {fmu.name}: {finished.stderr.strip()}")
    return finished.stdout, finished.stderr


def _arguments(
    folder: Path, executable: Path, fmu: Path, inputs: np.ndarray, outputs: Sequence[str]
) -> list[str]:
    """The host's positional arguments for this FMU, unpacked into `folder`."""
    windows = executable.suffix == ".exe"
    with ZipFile(fmu) as archive:
        archive.extractall(folder)
    description = fmpy.read_model_description(folder)
    reference = {v.name: str(v.valueReference) for v in description.modelVariables}
    platform, suffix = (
        ("win64", ".dll") if windows else (fmpy.platform, fmpy.sharedLibraryExtension)
    )
    identifier = description.coSimulation.modelIdentifier
    library = folder / "binaries" / platform / f"{identifier}{suffix}"
    if not library.exists():
        raise FileNotFoundError(f"{fmu.name} has no {library.relative_to(folder)}")
    # Wine shows the whole file system as its drive Z:.
    drive = "Z:" if windows and os.name != "nt" else ""
    return [
        f"{drive}{library}",
        description.guid,
        (folder / "resources").as_uri().replace("file:///", f"file:///{drive and 'Z:/'}"),
        repr(float(inputs[-1, 0])),
        repr(float(inputs[1, 0])),
        *(reference[name] for name in INPUTS),
        ",".join(reference[name] for name in outputs),
    ]
