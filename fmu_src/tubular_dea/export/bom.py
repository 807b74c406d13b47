"""The bill of materials of a build: what every FMU holds, for which platforms, from which compiler; no clock."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path, PurePosixPath
from typing import Any

from .. import __version__
from ..files import write_atomically
from .compile import FLAGS, PLATFORMS, Platform


def bill_of_materials(archives: Iterable[Path], targets: Iterable[Platform], out: Path) -> Path:
    """Write bom.json into `out`, for FMUs and SSPs below it: sizes and SHA-256 of each and of the binaries inside."""
    content = {
        "package": {"name": "tubular-dea", "version": __version__},
        "compiler": {"name": "zig cc (PyPI ziglang)", "version": version("ziglang"), "flags": list(FLAGS)},
        "platforms": {p.name: p.target for p in targets},
        "files": {path.relative_to(out).as_posix(): _entry(path.read_bytes()) for path in sorted(archives)},
    }
    return write_atomically(out / "bom.json", (json.dumps(content, indent=1) + "\n").encode())


def _entry(data: bytes) -> dict[str, Any]:
    """Size and hash of an archive, and of each binary or FMU in it."""
    inside = {}
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        for name in sorted(archive.namelist()):
            if name.endswith(".fmu") or PurePosixPath(name).suffix in {p.suffix for p in PLATFORMS}:
                inside[name] = _stamp(archive.read(name))
    return _stamp(data) | ({"binaries": inside} if inside else {})


def _stamp(data: bytes) -> dict[str, Any]:
    return {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
