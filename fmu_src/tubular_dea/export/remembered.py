"""Libraries of models that were compiled before, found without printing the model's C again.

Printing C from a declaration takes longer than anything else about a library that is in the cache already. The place
of a library is remembered under a hash of the declaration and of everything in this package that turns declarations
into libraries.
"""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from threading import Lock

from ..model.declare import Model
from .cache import keep, kept
from .compile import cached_library, host

_making: defaultdict[str, Lock] = defaultdict(Lock)  # by library: of threads that want one, the first makes it

MAKERS = ("emit", "native", "export", "model", "kernel")


def remembered_library(
    model: Model, kind: str, sources: Callable[[], Mapping[str, str]], flags: Sequence[str] = ()
) -> Path:
    """The library of `model` for this machine; `sources` (file name to text) is called where it is not known yet."""
    key = hashlib.sha256(repr((model, kind, host(), tuple(flags), fingerprint())).encode()).hexdigest()
    with _making[key]:
        note = kept(f"{key}.place")
        library = kept(note.read_text(encoding="utf-8")) if note else None
        if library:
            return library
        made = cached_library(sources(), host(), tuple(flags))
        keep(f"{key}.place", made.name.encode())
        return made


@cache
def fingerprint() -> str:
    """A hash of the files of this package that libraries are made from and by."""
    found = hashlib.sha256()
    root = resources.files("tubular_dea")
    for name in MAKERS:
        for path, data in sorted(_files(root / name, name)):
            found.update(path.encode() + b"\0" + data + b"\0")
    return found.hexdigest()


def _files(place: Traversable, path: str) -> list[tuple[str, bytes]]:
    if place.is_file():
        return [(path, place.read_bytes())] if path.endswith((".py", ".c", ".h")) else []
    return [entry for child in place.iterdir() for entry in _files(child, f"{path}/{child.name}")]
