"""The C library for WebAssembly modules, compiled beforehand: `wasm_runtime.o.xz`, 120 kB.

zig compiles all of its C library for WebAssembly from source, some 600 files, before the first module can be linked:
25 s. Modules need the functions of math.h and a few others. These are here as one object file, with what they need
themselves, made by zig from its own sources, whose licences are in wasm_runtime.txt. To make it again:

    python -m tubular_dea.export.wasm_runtime
"""

from __future__ import annotations

import lzma
import os
import subprocess
import sys
from importlib import resources
from importlib.util import find_spec
from pathlib import Path

from ..errors import UserError
from ..files import working_folder

PLACE = "wasm_runtime.o.xz"
TARGET = ("-target", "wasm32-wasi", "-mbulk-memory", "-mnontrapping-fptoint", "-msign-ext")

# What a printed model, the hand-written C or the page may call.
MATHEMATICS = """
    acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1 fabs floor fmax fmin fmod
    hypot lgamma log log10 log1p log2 pow round sin sinh sqrt tan tanh tgamma trunc
"""
OTHERS = """
    malloc free calloc realloc memcpy memmove memset memcmp strlen strcmp strncmp strcpy strncpy strchr
    snprintf vsnprintf
"""
HEADERS = ("math.h", "stdio.h", "stdlib.h", "string.h")


def runtime() -> bytes:
    """The object file."""
    return lzma.decompress((resources.files("tubular_dea") / "export" / PLACE).read_bytes())


def include_flags() -> list[str]:
    """Flags for the headers of zig's C library, which `-nostdlib` leaves out."""
    origin = (find_spec("ziglang") or sys.__spec__).origin
    include = Path(str(origin)).parent / "lib" / "libc" / "include"
    return [flag for name in ("wasm-wasi-musl", "generic-musl") for flag in ("-isystem", str(include / name))]


def make() -> bytes:
    """The object file from zig's sources: a module that uses everything is linked once, for zig to compile its
    libraries; then what it has used of them becomes one file."""
    with working_folder("runtime") as folder:
        names = [*MATHEMATICS.split(), *OTHERS.split()]
        used = "".join(f"    (void (*)(void)){name},\n" for name in names)
        text = "".join(f"#include <{header}>\n" for header in HEADERS)
        text += f"void (*const wasm_runtime[])(void) = {{\n{used}}};\n"
        (folder / "roots.c").write_text(text, encoding="utf-8")
        flags = [*TARGET, "-O3", "-g0", "-fno-builtin", "-fvisibility=hidden"]
        _zig(folder, "cc", *flags, "-c", "-o", "roots.o", "roots.c")
        _zig(folder, "cc", *flags, "-mexec-model=reactor", "-Wl,--export=wasm_runtime", "-o", "module.wasm", "roots.o")
        start, *_ = sorted((folder / "cache").rglob("crt1-reactor.o"))
        libraries = [next((folder / "cache").rglob(f"lib{name}.a")) for name in ("c", "zigc", "compiler_rt")]
        _zig(folder, "wasm-ld", "-r", "-s", "-o", "runtime.o", "roots.o", *map(str, [start, *libraries]))
        return (folder / "runtime.o").read_bytes()


def _zig(folder: Path, *arguments: str) -> None:
    places = {name: str(folder / "cache") for name in ("ZIG_GLOBAL_CACHE_DIR", "ZIG_LOCAL_CACHE_DIR")}
    command = [sys.executable, "-m", "ziglang", *arguments]
    done = subprocess.run(command, cwd=folder, env=os.environ | places, capture_output=True, text=True, check=False)
    if done.returncode:
        raise UserError(f"making the C library for WebAssembly failed:\n{done.stderr.strip()}")


if __name__ == "__main__":
    Path(__file__).with_name(PLACE).write_bytes(lzma.compress(make(), preset=9))
