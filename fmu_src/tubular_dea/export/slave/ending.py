"""Ending: what lets the host's process end in peace."""

from __future__ import annotations

import atexit
import ctypes
import functools
import os
import sys
from pathlib import Path

from .stand_in import NAME


@functools.cache
def release_at_exit(resources: str) -> None:
    """Have pythonfmu's library release its interpreter while Python ends, once for each library.

    On Linux that library (0.7) releases it twice as the process ends: by the destructor of its static pointer,
    which frees what it points to, and by its own destructor, which counts down in what was freed. Where glibc has
    put a link of its lists there, the process aborts with "corrupted double-linked list". Released before, the
    pointer is null, and both find nothing to do.
    """
    path = Path(resources).parent / "binaries" / "linux64" / f"{NAME}.so"
    if not sys.platform.startswith("linux"):
        return
    try:
        library = ctypes.CDLL(str(path), mode=os.RTLD_NOLOAD)
    except OSError:  # the host has loaded a copy of it from another place
        return
    atexit.register(library.finalizePythonInterpreter)
