"""Where compiled libraries are kept, and that they are still what was compiled.

The user's cache folder, or TUBULAR_DEA_CACHE. Every file has its hash beside it: one that a full disk or a tool has
damaged is compiled again, never loaded or packed. Files in a folder of another user are never loaded either.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from functools import cache
from pathlib import Path

from ..files import FileError, write_atomically


def cache_folder() -> Path:
    """The folder, there and ours; where the usual one cannot be used, one in the temporary folder, said once."""
    wanted = _wanted()
    reason = _unusable(wanted) if wanted else "there is no home folder"
    return wanted if wanted and not reason else _stand_in(str(wanted or "the cache"), reason)


def _wanted() -> Path | None:
    if chosen := os.environ.get("TUBULAR_DEA_CACHE"):  # an empty variable is one that is not set
        return Path(chosen)
    variable = "LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME"
    try:
        root = Path(os.environ.get(variable) or Path.home() / ".cache")
    except RuntimeError:  # no HOME, and nobody of that number in the system's list
        return None
    return root / "tubular-dea"


@cache
def _unusable(folder: Path) -> str:
    """Why a folder cannot be used; empty where it can."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        owner = folder.stat().st_uid
    except OSError as problem:
        return problem.strerror or str(problem)
    if hasattr(os, "getuid") and owner not in (os.getuid(), 0):
        return "it belongs to another user"
    return "" if os.access(folder, os.W_OK | os.X_OK) else "it cannot be written to"


@cache
def _stand_in(wanted: str, reason: str) -> Path:
    mine = f"-{os.getuid()}" if hasattr(os, "getuid") else ""
    folder = Path(tempfile.gettempdir()) / f"tubular-dea{mine}"
    print(f"tubular-dea: {wanted} cannot be used as a cache: {reason}; using {folder}", file=sys.stderr)
    problem = _unusable(folder)
    if problem:
        raise FileError(f"{folder}: cannot be used as a cache: {problem}; set TUBULAR_DEA_CACHE to a folder of yours")
    os.chmod(folder, 0o700)
    return folder


def compiler_environment() -> dict[str, str]:
    """The environment for zig, whose own cache goes where ours goes unless the user has said where."""
    return {"ZIG_GLOBAL_CACHE_DIR": str(cache_folder() / "zig")} | dict(os.environ)


def why_compiling_failed(said: str) -> str:
    """What a compiler said that failed; where there is no space left, what to do."""
    if "No space left on device" not in said:
        return f"\n{said or 'no word from the compiler'}"
    return (
        f" no space is left on the device of {cache_folder()}, where compiled models are kept, or of "
        f"{tempfile.gettempdir()}; free some, or set TUBULAR_DEA_CACHE or TMPDIR to another folder"
    )


def kept(name: str) -> Path | None:
    """A file of the cache; None where it is not there, or is not what was written."""
    path = cache_folder() / name
    try:
        whole = _digest(path.read_bytes()) == _note(path).read_text(encoding="ascii")
    except (OSError, ValueError):
        return None
    return path if whole else None


def keep(name: str, data: bytes) -> Path:
    """Write a file of the cache, with its hash."""
    path = write_atomically(cache_folder() / name, data)
    write_atomically(_note(path), _digest(data).encode())
    return path


def _note(path: Path) -> Path:
    return path.with_name(f"{path.name}.sha256")


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
