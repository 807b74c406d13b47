"""Compile a C driver together with the FMU's own sources, for what a finished library would hide."""

from __future__ import annotations

import hashlib
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from tubular_dea.export.cache import cache_folder
from tubular_dea.export.package import sources
from tubular_dea.model.declare import Model


def compile_driver(model: Model, version: int, files: Sequence[Path], flags: Sequence[str], folder: Path) -> Path:
    """The driver `files` and the FMI `version` sources of a model, by gcc in `folder`; kept in the cache."""
    code = sources(model, version) | {path.name: path.read_text() for path in files}
    flags = [*flags, f"-DVERSION={version}"]
    key = hashlib.sha256(repr((sorted(code.items()), flags)).encode()).hexdigest()
    cached = cache_folder() / f"{files[0].stem}-{key}"
    if cached.exists():
        return cached
    for name, text in code.items():
        (folder / name).write_text(text)
    compiled = [name for name in code if name.endswith(".c")]
    subprocess.run(["gcc", *flags, "-I.", "-o", "driver", *compiled, "-lm"], cwd=folder, check=True)
    cached.parent.mkdir(parents=True, exist_ok=True)
    shutil.move(folder / "driver", cached)
    return cached
