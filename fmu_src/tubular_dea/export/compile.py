"""Shared libraries from C sources, for this machine and for every platform an FMU carries, with zig from PyPI.

Compiled libraries are cached by a hash of everything that goes into them, so a second build costs nothing.
"""

from __future__ import annotations

import hashlib
import platform
import struct
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from ..errors import UserError
from ..files import working_folder
from .cache import compiler_environment, keep, kept, why_compiling_failed


class CompileError(UserError, RuntimeError):
    """The compiler refused; the text carries what it said."""


@dataclass(frozen=True)
class Platform:
    """A platform of an FMU: zig's target (with the oldest system it runs on) and the FMI folder names."""

    name: str
    target: str
    fmi2: str
    fmi3: str
    suffix: str

    @property
    def system(self) -> str:
        """The operating system."""
        return self.name.split("-")[0]


PLATFORMS = (
    Platform("linux-x86_64", "x86_64-linux-gnu.2.17", "linux64", "x86_64-linux", ".so"),
    Platform("linux-aarch64", "aarch64-linux-gnu.2.17", "aarch64-linux", "aarch64-linux", ".so"),
    Platform("windows-x86_64", "x86_64-windows-gnu", "win64", "x86_64-windows", ".dll"),
    Platform("windows-x86", "x86-windows-gnu", "win32", "x86-windows", ".dll"),
    Platform("macos-x86_64", "x86_64-macos.10.15", "x86_64-darwin", "x86_64-darwin", ".dylib"),
    Platform("macos-aarch64", "aarch64-macos.11.0", "aarch64-darwin", "aarch64-darwin", ".dylib"),
)

# -ffp-contract=off: no fused multiply-add anywhere, so that platforms agree to the last digits.
FLAGS = (
    "-std=c99",
    "-O3",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fno-slp-vectorize",
    "-fvisibility=hidden",
    "-g0",
    "-s",
    "-shared",
)

# What is linked, by system. On Linux doubles need nothing of the compiler's own runtime library, which zig would first
# compile from source (3 s, once for each processor it is compiled for); were something needed after all, linking fails.
# For Windows zig would also compile a C library's start-up code and mathematics (190 s once, and 94 s for 32 bit). The
# system has these: what is taken from its library is named here, and WINDOWS_SOURCE is all the rest.
LINKED = {
    "linux": ("-fPIC", "-lm", "-rtlib=none", "-Wl,-z,defs"),
    "windows": (
        *("-nostdlib", "-rtlib=compiler-rt", "-D_UCRT"),
        *(f"-lapi-ms-win-crt-{part}-l1-1-0" for part in ("math", "heap", "string", "private", "stdio")),
    ),
    "macos": ("-fPIC", "-lm", "-Wl,-install_name,@rpath/library.dylib"),  # not the name of the temporary folder
}
WINDOWS_SOURCE = "windows.c"

# The vector units that are used where the processor has them, by the names of both Linux and clang.
AVX2 = ("avx", "avx2", "bmi2", "fma", "movbe")
AVX512 = ("avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl")


def host() -> Platform:
    """The platform this Python runs on."""
    system = {"linux": "linux", "darwin": "macos", "win32": "windows"}.get(sys.platform, sys.platform)
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    if struct.calcsize("P") == 4 and machine == "x86_64":
        machine = "x86"
    for candidate in PLATFORMS:
        if candidate.name == f"{system}-{machine}":
            return candidate
    names = ", ".join(p.name for p in PLATFORMS)
    raise CompileError(f"no known compiler target for {system}-{machine}; known platforms are {names}")


def native_source(name: str) -> str:
    """The text of a hand-written C file of this package."""
    return (resources.files("tubular_dea") / "native" / name).read_text(encoding="utf-8")


def shared_library(sources: Mapping[str, str], target: Platform) -> bytes:
    """The shared library compiled from `sources` (file name to text; headers among them) for `target`."""
    return cached_library(sources, target).read_bytes()


def cached_library(sources: Mapping[str, str], target: Platform, processor: tuple[str, ...] = ()) -> Path:
    """The path of that library in the cache, compiled if it is not there yet.

    `processor` are compiler flags for more than the oldest processor of the platform, as `processor_flags` gives.
    """
    flags = (*FLAGS, *LINKED[target.system], *processor)
    if target.system == "windows":
        sources = {**sources, WINDOWS_SOURCE: native_source(WINDOWS_SOURCE)}
    key = hashlib.sha256(repr((sorted(sources.items()), target, flags, _zig_version())).encode()).hexdigest()
    cached = kept(f"{key}{target.suffix}")
    if cached:
        return cached
    with working_folder("compiling") as folder:
        for name, text in sources.items():
            (folder / name).write_text(text, encoding="utf-8", newline="\n")
        library = folder / f"library{target.suffix}"
        _zig_cc(target, [name for name in sources if name.endswith(".c")], library, flags)
        return keep(f"{key}{target.suffix}", library.read_bytes())


def processor_flags() -> tuple[str, ...]:
    """Compiler flags for the vector units of this machine's processor; none where they are not known.

    They change speed alone: without fused multiply-adds (FLAGS) every processor rounds alike. They are told to clang
    behind zig's back: for a processor of its own (-mcpu) zig would compile its part of the C library again (0.5 s).
    """
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return ()
    features = next((line.split() for line in text.splitlines() if line.startswith("flags")), [])
    if {*AVX512, *AVX2} <= set(features):
        return (*_told((*AVX2, *AVX512)), "-mprefer-vector-width=512")
    return _told(AVX2) if {*AVX2} <= set(features) else ()


def _told(features: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(flag for name in features for flag in ("-Xclang", "-target-feature", "-Xclang", f"+{name}"))


def universal(x86_64: bytes, arm64: bytes) -> bytes:
    """A macOS library for both processors: a "fat" Mach-O header in front of the two (page-aligned)."""
    page = 1 << 14
    entries, body, offset = [], b"", page
    for cpu, subtype, data in ((0x01000007, 3, x86_64), (0x0100000C, 0, arm64)):
        entries.append(struct.pack(">5I", cpu, subtype, offset, len(data), 14))
        padded = data + b"\0" * (-len(data) % page)
        body += padded
        offset += len(padded)
    header = struct.pack(">2I", 0xCAFEBABE, len(entries)) + b"".join(entries)
    return header + b"\0" * (page - len(header)) + body


def zig() -> list[str]:
    """The command of the compiler, without the Python that `python -m ziglang` starts first."""
    return [str(resources.files("ziglang") / ("zig.exe" if sys.platform == "win32" else "zig"))]


def _zig_version() -> str:
    from importlib.metadata import version

    return version("ziglang")


def windows_headers() -> list[str]:
    """Flags for the headers of the C library, which zig does not look for where it links none of its own."""
    return ["-isystem", str(resources.files("ziglang") / "lib" / "libc" / "include" / "any-windows-any")]


def _zig_cc(target: Platform, compiled: list[str], library: Path, flags: tuple[str, ...]) -> None:
    """Compile into `library`, beside the sources."""
    command = [*zig(), "cc", "-target", target.target, *flags, "-I.", "-o", str(library)]
    if target.system == "windows":
        command += windows_headers()
    done = subprocess.run(
        [*command, *compiled],
        cwd=library.parent,
        env=compiler_environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise CompileError(f"compiling for {target.name} failed:{why_compiling_failed(done.stderr.strip())}")
