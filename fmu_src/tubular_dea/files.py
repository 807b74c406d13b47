"""Files written whole or not at all, whatever interrupts."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

UNFINISHED = ".unfinished"


def write_atomically(path: Path, data: bytes) -> Path:
    """Write a file that is there whole or not at all, and the folders above it; returns its path.

    Where the process is killed meanwhile, what was there before stays, and a hidden `.NAME.*.unfinished` may be left.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=UNFINISHED)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        os.unlink(name)
        raise
    return path


def is_unfinished(path: Path) -> bool:
    """Whether the file is what a killed process left of its writing."""
    return path.name.startswith(".") and path.name.endswith(UNFINISHED)
