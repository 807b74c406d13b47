"""Which reader a file needs: its first bytes tell, not its ending."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path

from ..errors import ReadError
from ..files import FileError, read_whole
from . import containers
from .table import Table
from .text import read_text

ENDINGS = (
    ".csv",
    ".txt",
    ".dat",
    ".tsv",
    ".asc",
    ".prn",
    ".lvm",
    ".log",
    ".tab",
    ".mat",
    ".h5",
    ".hdf5",
    ".tdms",
    ".parquet",
)
SPREADSHEETS = (".xlsx", ".xls", ".xlsm", ".xlsb", ".ods")
BINARY: tuple[tuple[bytes, Callable[[Path], Table]], ...] = (
    (b"MATLAB 5.0 MAT-file", containers.read_mat5),
    (b"MATLAB 7.3 MAT-file", containers.read_hdf5),
    (b"\x89HDF\r\n\x1a\n", containers.read_hdf5),
    (b"TDSm", containers.read_tdms),
    (b"PAR1", containers.read_parquet),
)
UNSUPPORTED = {
    b"PK\x03\x04": "a spreadsheet or an archive",
    b"\xd0\xcf\x11\xe0": "an old spreadsheet",
    b"\x1f\x8b": "a compressed file",
    b"BZh": "a compressed file",
    b"\xfd7zXZ": "a compressed file",
    b"%PDF": "a PDF",
    b"\x89PNG": "a picture",
    b"TDSh": "a TDMS index; the data is in the .tdms file beside it",
}


def is_recording(path: Path) -> bool:
    """Whether a file of a folder may be a recording, by its name; hidden ones are what editors and systems leave."""
    return path.suffix.lower() in ENDINGS and not path.name.startswith((".", "~"))


def is_spreadsheet(path: Path) -> bool:
    """Whether a file of a folder is a spreadsheet, by its name, which may hold a recording but is not read."""
    return path.suffix.lower() in SPREADSHEETS and not path.name.startswith((".", "~"))


def is_no_recording(path: Path) -> bool:
    """Whether something in a folder is a file that is neither, such as a document, and not hidden."""
    return path.is_file() and not (is_recording(path) or is_spreadsheet(path) or path.name.startswith("."))


def read(path: Path, names: Collection[str] = (), pipe: bool = True) -> Table:
    """The table in a file, or of a `pipe` if that will do; `ReadError` says what was expected, and where.

    `names` are expected headings.
    """
    try:
        raw = read_whole(path, pipe=pipe)
    except FileError as problem:
        raise ReadError(str(problem)) from None
    for start, reader in BINARY:
        if raw.startswith(start):
            return reader(path)
    for start, what in UNSUPPORTED.items():
        if raw.startswith(start):
            raise ReadError(
                f"{path}: expected a table as text, MATLAB, TDMS or Parquet file but found {what}; export it as CSV"
            )
    return read_text(path, raw, names)
