"""WebAssembly modules from the C sources of several models: each part's global names get its prefix, then one link.

The sources are those of the FMUs and of the kernel; only the names differ. A reactor: `_initialize` first, then any
exported function. It imports nothing but, for some models, the `random_get` of WASI.
"""

from __future__ import annotations

import hashlib
import re
import subprocess
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

from ..files import working_folder
from .cache import compiler_environment, keep, kept, why_compiling_failed
from .compile import CompileError, zig
from .wasm_runtime import TARGET, include_flags, runtime

# As for shared libraries: no fused operations. WebAssembly has none, so both compute the same bits.
FLAGS = (
    *TARGET,
    "-flto",
    "-mexec-model=reactor",
    "-std=c99",
    "-O3",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fvisibility=hidden",
    "-g0",
    "-s",
    "-Wl,-z,stack-size=1048576",
)
_DEFINED = re.compile(  # a function's body or an array's values, at the beginning of a line and not static
    r"^(?!static|typedef|#|struct)\w[^;{}()]*?\b\*?(\w+)\s*(?:\([^;{}]*\)\s*\{|\[[^;]*\]\s*=)", re.MULTILINE
)
_PLAIN = "#define fmi2FullName(name) name"  # of FMPy's copy of the FMI header


def wasm_module(parts: Mapping[str, Mapping[str, str]], shared: Mapping[str, str], exports: Sequence[str]) -> bytes:
    """One module from `parts` (prefix -> C files) and `shared` C files, which call the parts by their prefixed names.

    Raises `CompileError` with what the compiler said.
    """
    with working_folder("compiling") as folder:
        return _compiled(folder, parts, shared, exports)


def remembered_module(key: str, make: Callable[[], bytes]) -> bytes:
    """The module that is in the cache under this key, made if it is not there; its compiler's version is in the key."""
    library = hashlib.sha256(runtime()).hexdigest()
    name = f"{hashlib.sha256(repr((key, FLAGS, library, version('ziglang'))).encode()).hexdigest()}.wasm"
    return (kept(name) or keep(name, make())).read_bytes()


def _compiled(
    folder: Path, parts: Mapping[str, Mapping[str, str]], shared: Mapping[str, str], exports: Sequence[str]
) -> bytes:
    files = dict(shared)
    for prefix, sources in parts.items():
        files |= {
            f"{prefix}/{name}": text.replace(_PLAIN, f"{_PLAIN[:-4]}{prefix}##name") for name, text in sources.items()
        }
        files[f"{prefix}names.h"] = _names(prefix, sources)
        for name in sources:
            if name.endswith(".c"):
                files[f"{prefix}{name}"] = f'#include "{prefix}names.h"\n#include "{prefix}/{name}"\n'
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8", newline="\n")
    compiled = sorted(name for name in files if name.endswith(".c") and "/" not in name)
    command = ["-I.", *(f"-Wl,--export={name}" for name in exports), "-o", "module.wasm", *compiled]
    (folder / "runtime.o").write_bytes(runtime())
    problem = _zig_cc(folder, *command, "-nostdlib", "-rtlib=none", *include_flags(), "runtime.o")
    if "undefined symbol" in problem:  # a model may want more of the C library than was compiled beforehand
        problem = _zig_cc(folder, *command)
    if problem:
        raise CompileError(f"compiling for WebAssembly failed:{why_compiling_failed(problem)}")
    return (folder / "module.wasm").read_bytes()


def _zig_cc(folder: Path, *arguments: str) -> str:
    """Compile in a folder; what the compiler said where it failed, else nothing."""
    command = [*zig(), "cc", *FLAGS, *arguments]
    done = subprocess.run(command, cwd=folder, env=compiler_environment(), capture_output=True, text=True, check=False)
    return (done.stderr.strip() or "no word from the compiler") if done.returncode else ""


def _names(prefix: str, sources: Mapping[str, str]) -> str:
    """Macros that put `prefix` before every global name the sources define; one that is missed fails to link."""
    names = {name for text in sources.values() for name in _DEFINED.findall(text)}
    plain = sorted(name for name in names if not name.startswith("fmi2"))  # the FMI header renames these
    return "".join(f"#define {n} {prefix}{n}\n" for n in plain)
