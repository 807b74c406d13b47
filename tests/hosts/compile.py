"""Compile the C host and run an FMU in it: natively, its Windows halves under wine, its ARM half under qemu.

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
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Literal
from zipfile import ZipFile

import fmpy
import numpy as np

from tubular_dea.export.cache import compiler_environment
from tubular_dea.export.compile import LINKED, WINDOWS_SOURCE, windows_headers

Target = Literal["host", "x86_64-windows", "x86-windows", "aarch64-linux"]

SOURCE = Path(__file__).with_name("fmi2_host.c")
FMI_HEADERS = Path(fmpy.__file__).parent / "c-code"


@dataclass(frozen=True)
class OtherPlatform:
    """A platform that is not this one: how to compile for it, the FMU's folder and suffix, and what runs it here."""

    zig: str
    folder: str
    suffix: str
    runner: Callable[[], list[str] | None]


def find_wine(bits: int) -> list[str] | None:
    """The command that starts Windows executables of so many bits here, or None."""
    if os.name == "nt":
        return []
    wine = (shutil.which("wine64") if bits == 64 else None) or shutil.which("wine")
    here = bits == 64 or any(Path("/usr/lib").glob("i386-linux-gnu/wine/i386-windows"))
    return [wine] if wine and here else None


def find_qemu() -> list[str] | None:
    """The command that starts 64-bit ARM executables of Linux here, or None."""
    libraries = Path("/usr/aarch64-linux-gnu")
    qemu = shutil.which("qemu-aarch64") or shutil.which("qemu-aarch64-static")
    return [qemu, "-L", str(libraries)] if qemu and libraries.is_dir() else None


OTHER_PLATFORMS: dict[Target, OtherPlatform] = {
    "x86_64-windows": OtherPlatform("x86_64-windows-gnu", "win64", ".dll", lambda: find_wine(64)),
    "x86-windows": OtherPlatform("x86-windows-gnu", "win32", ".dll", lambda: find_wine(32)),
    "aarch64-linux": OtherPlatform("aarch64-linux-gnu.2.17", "aarch64-linux", ".so", find_qemu),
}
INPUTS = ("pressure", "voltage")

# A first start of wine fills its prefix: 5 s on an idle machine, more when all cores are busy.
TIMEOUT_S = 300


def compile_host(target: Target, out_dir: Path) -> Path:
    """Compile the host for `target` into `out_dir`; an executable newer than the source is kept."""
    windows = "windows" in target or (target == "host" and os.name == "nt")
    suffix = ".exe" if windows else ""
    executable = out_dir / f"fmi2_host-{target}{suffix}"
    if executable.exists() and executable.stat().st_mtime > SOURCE.stat().st_mtime:
        return executable
    out_dir.mkdir(parents=True, exist_ok=True)
    given = ["-target", OTHER_PLATFORMS[target].zig] if target in OTHER_PLATFORMS else []
    zig = [sys.executable, "-m", "ziglang", "cc", *given]
    flags = ["-std=c11", "-O2", "-g0", "-s", "-Wall", "-Wextra", "-Werror"]
    files = [f"-I{FMI_HEADERS}", "-o", str(executable), str(SOURCE)]
    system = _on_windows() if windows else ["-D_POSIX_C_SOURCE=200809L", "-lm", "-ldl"]
    subprocess.run([*zig, *flags, *files, *system], env=compiler_environment(), check=True)
    return executable


def compile_ones(out_dir: Path) -> Path:
    """A library to preload on Linux, which tells at once who uses what C++ has deleted (`ones.c`)."""
    library = out_dir / "ones.so"
    command = [
        sys.executable,
        "-m",
        "ziglang",
        "cc",
        "-shared",
        "-fPIC",
        "-O2",
        "-g0",
        "-s",
        "-Wall",
        "-Wextra",
        "-Werror",
    ]
    files = ["-o", str(library), str(SOURCE.with_name("ones.c"))]
    subprocess.run([*command, *files], env=compiler_environment(), check=True)
    return library


def _on_windows() -> list[str]:
    """What the host needs besides to begin, write and find libraries on Windows, with the system's C library alone."""
    own = resources.files("tubular_dea") / "native" / WINDOWS_SOURCE
    sources = [str(SOURCE.with_name("windows_start.c")), str(own), "-Wl,-e,mainCRTStartup", "-Wl,--subsystem,console"]
    libraries = ["-lapi-ms-win-crt-runtime-l1-1-0", "-lapi-ms-win-crt-convert-l1-1-0", "-lkernel32"]
    return [*sources, *windows_headers(), *LINKED["windows"], *libraries]


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
    executable: Path,
    fmu: Path,
    inputs: np.ndarray,
    outputs: Sequence[str],
    options: Sequence[str] = (),
    names: Sequence[str] = INPUTS,
) -> np.ndarray:
    """Run an FMI 2.0 FMU in the host.

    `inputs`: rows `time [s], pressure [Pa], voltage [V]` (or two other inputs, `names`) at equidistant communication
    points, the last of them the stop time; `options` as in fmi2_host.c. Returns rows `time [s], output...` at the same
    points.
    """
    stdout, _ = _run(executable, fmu, inputs, outputs, list(options), names)
    return np.loadtxt(stdout.splitlines(), delimiter=",", ndmin=2)


def time_host(executable: Path, fmu: Path, inputs: np.ndarray, outputs: Sequence[str], repeat: int) -> float:
    """Nanoseconds per step (set inputs, step, get outputs), the least of `repeat` runs."""
    _, stderr = _run(executable, fmu, inputs, outputs, ["--repeat", str(repeat), "--time"])
    return float(stderr.split()[-4])


def _run(
    executable: Path,
    fmu: Path,
    inputs: np.ndarray,
    outputs: Sequence[str],
    options: list[str],
    names: Sequence[str] = INPUTS,
) -> tuple[str, str]:
    """Unpack the FMU, run the host once and return what it wrote to stdout and stderr."""
    other = next((f for target, f in OTHER_PLATFORMS.items() if executable.stem == f"fmi2_host-{target}"), None)
    runner = (other.runner() or ["missing"]) if other else []
    wine = bool(other) and executable.suffix == ".exe" and os.name != "nt"
    with tempfile.TemporaryDirectory(prefix="fmu-") as folder:
        arguments = _arguments(Path(folder), other, fmu, inputs, outputs, names)
        finished = subprocess.run(
            [*runner, str(executable), *arguments, *options],
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
    folder: Path,
    other: OtherPlatform | None,
    fmu: Path,
    inputs: np.ndarray,
    outputs: Sequence[str],
    names: Sequence[str],
) -> list[str]:
    """The host's positional arguments for this FMU, unpacked into `folder`."""
    with ZipFile(fmu) as archive:
        archive.extractall(folder)
    description = fmpy.read_model_description(folder)
    reference = {v.name: str(v.valueReference) for v in description.modelVariables}
    platform, suffix = (other.folder, other.suffix) if other else (fmpy.platform, fmpy.sharedLibraryExtension)
    identifier = description.coSimulation.modelIdentifier
    library = folder / "binaries" / platform / f"{identifier}{suffix}"
    if not library.exists():
        raise FileNotFoundError(f"{fmu.name} has no {library.relative_to(folder)}")
    # Wine shows the whole file system as its drive Z:.
    drive = "Z:" if suffix == ".dll" and os.name != "nt" else ""
    return [
        f"{drive}{library}",
        description.guid,
        (folder / "resources").as_uri().replace("file:///", f"file:///{drive and 'Z:/'}"),
        repr(float(inputs[-1, 0])),
        repr(float(inputs[1, 0])),
        *(reference[name] for name in names),
        ",".join(reference[name] for name in outputs),
    ]
