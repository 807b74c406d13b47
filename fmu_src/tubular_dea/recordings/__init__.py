"""Recordings in any format, as tables of numbers: `read(path)`. This folder knows files, but no plant.

Text with any delimiter, decimal mark, encoding and head; MATLAB (both formats), HDF5, TDMS and Parquet with the extra
`files`. The first bytes determine the format, not the ending.
"""

from ..errors import ReadError
from .files import is_no_recording, is_recording, is_spreadsheet, read
from .table import Column, NoTableError, Table

__all__ = ["Column", "NoTableError", "ReadError", "Table", "is_no_recording", "is_recording", "is_spreadsheet", "read"]
