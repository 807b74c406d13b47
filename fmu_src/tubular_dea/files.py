"""Files on a user's machine: written whole or not at all, read up to a size, unpacked up to a size.

Errors of the system (a full disk, a dangling link, a folder of another user) are reported as a `FileError`, in one line
that names the path.
"""

from __future__ import annotations

import errno
import os
import shutil
import stat
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from .errors import UserError

UNFINISHED = ".unfinished"
LARGEST_INPUT = 1 << 30  # bytes: more than any recording; an endless device has them in seconds
LARGEST_ARCHIVE = 1 << 30  # bytes, unpacked
CHUNK = 1 << 20
FULL = (errno.ENOSPC, errno.EDQUOT)


class FileError(UserError, OSError):
    """A file that cannot be read or written; the text names it and gives the system's reason."""


class FullDiskError(FileError):
    """There is no room to write a file; what was to be written, or unpacked, has no fault."""


@contextmanager
def as_file_error(path: Path, what: str) -> Iterator[None]:
    """`FileError` in the place of an `OSError`: `path`: cannot be `what`: and why."""
    try:
        yield
    except FileError:
        raise
    except OSError as problem:
        kind = FullDiskError if problem.errno in FULL else FileError
        raise kind(f"{path}: cannot be {what}: {_reason(path, problem)}") from None


def _reason(path: Path, problem: OSError) -> str:
    dangling = next((p for p in (path, *path.parents) if p.is_symlink() and not p.exists()), None)
    if dangling is not None:
        return f"{dangling} is a link to {os.readlink(dangling)}, which is not there"
    return problem.strerror or str(problem)


def write_atomically(path: Path, data: bytes) -> Path:
    """Write a file that is there whole or not at all, and the folders above it; returns its path.

    Raises `FileError`, and leaves nothing, where that cannot be done. Where the process is killed meanwhile, what was
    there before stays, and a hidden `.NAME.*.unfinished` may be left.
    """
    with as_file_error(path, "written"):
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
    """Whether the file is an unfinished one of a killed process."""
    return path.name.startswith(".") and path.name.endswith(UNFINISHED)


def read_whole(path: Path, largest: int = LARGEST_INPUT, pipe: bool = True) -> bytes:
    """The content of a file, or of a `pipe` if it will do; `FileError` for all else and for more than `largest` bytes.

    A pipe that nobody writes to never ends: it will do where it was given itself, and not where it is in a folder.
    """
    with as_file_error(path, "read"):
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            raise FileError(f"{path}: expected a file but it is a folder")
        if stat.S_ISFIFO(mode) and not pipe:
            raise FileError(f"{path}: expected a file but it is a pipe; move it away, or put a file in its place")
        if not (stat.S_ISREG(mode) or stat.S_ISFIFO(mode)):
            raise FileError(f"{path}: expected a file but it is a device; give a file")
        with path.open("rb") as file:
            data = file.read(largest + 1)
    if len(data) > largest:
        raise FileError(f"{path}: expected at most {largest / 1e9:.3g} GB; give a smaller file")
    return data


@contextmanager
def working_folder(purpose: str) -> Iterator[Path]:
    """A temporary folder that is removed again; `FileError` where there is no space for it or its files."""
    try:
        folder = Path(tempfile.mkdtemp(prefix="tubular-dea-"))
    except OSError as problem:
        raise FileError(
            f"{purpose}: no temporary folder can be made: {problem}; set TMPDIR to one with space"
        ) from None
    try:
        with as_file_error(folder, f"used for {purpose}"):
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def unpack(archive: Path, folder: Path, largest: int = LARGEST_ARCHIVE) -> None:
    """Unpack a zip archive (an FMU) into `folder`.

    `FullDiskError` where there is no room; `FileError` for what is no archive, for more than `largest` bytes unpacked
    (counted as they come: what the archive says of itself may be false), and for names that lead out of the folder;
    what was unpacked so far stays.
    """
    try:
        with as_file_error(archive, f"unpacked to {folder}"), zipfile.ZipFile(archive) as bundle:
            left = largest
            for entry in bundle.infolist():
                target = _inside(archive, folder, entry.filename)
                if entry.is_dir():
                    target.mkdir(parents=True, exist_ok=True)
                    continue
                target.parent.mkdir(parents=True, exist_ok=True)
                with bundle.open(entry) as source, target.open("wb") as sink:
                    while data := source.read(min(CHUNK, left + 1)):
                        left -= len(data)
                        if left < 0:
                            raise FileError(f"{archive}: unpacks to more than {largest / 1e9:.3g} GB; expected an FMU")
                        sink.write(data)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as problem:
        raise FileError(f"{archive}: cannot be unpacked: {problem}; expected an FMU, a zip archive") from None


def _inside(archive: Path, folder: Path, name: str) -> Path:
    parts = PurePosixPath(name.replace("\\", "/"))
    if parts.is_absolute() or ".." in parts.parts or ":" in name:
        raise FileError(f"{archive}: holds the name {name!r}, which leads out of it; expected names inside")
    return folder.joinpath(*parts.parts)
