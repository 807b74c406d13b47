"""Tables in binary files: MATLAB 5 and 7.3, HDF5, TDMS, Parquet. Their libraries are imported when they are needed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ReadError
from ..extra import MissingExtraError, load
from .heading import parts
from .table import Column, Table, some

UNIT_NAMES = ("unit", "units", "unit_string", "Unit", "Units")


@dataclass(frozen=True)
class Series:
    """One array of a file, under its name, with the unit that the file says beside it ("" for none)."""

    heading: str
    values: np.ndarray
    unit: str = ""


@dataclass
class Found:
    """What a file holds, before it is made a table."""

    series: list[Series] = field(default_factory=list)
    notes: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)


def read_mat5(path: Path) -> Table:
    """A MATLAB file up to version 7: vectors, matrices with names beside them, or structures of vectors."""
    from scipy.io import loadmat

    try:
        content = loadmat(path, squeeze_me=True, struct_as_record=False, mat_dtype=True)
    except Exception as problem:  # whatever a broken file makes the library do
        raise _broken(path, "a MATLAB 5 file", problem) from None
    found = Found()
    for name, value in content.items():
        if not name.startswith("__"):
            _structure(found, name, value)
    return _table(path, "MATLAB 5", found)


def read_hdf5(path: Path) -> Table:
    """A MATLAB 7.3 or HDF5 file: data sets, with their units as attributes."""
    h5py = _library("h5py", path)
    try:
        with h5py.File(path, "r") as file:
            found = Found()
            file.visititems(lambda name, item: _dataset(found, h5py, name, item))
    except OSError as problem:
        raise _broken(path, "an HDF5 (MATLAB 7.3) file", problem) from None
    with path.open("rb") as raw:
        kind = "MATLAB 7.3" if raw.read(6) == b"MATLAB" else "HDF5"
    return _table(path, kind, found)


def read_tdms(path: Path) -> Table:
    """A LabVIEW TDMS file: channels with the property unit_string; their increment makes the time where none is."""
    nptdms = _library("nptdms", path)
    found = Found()
    try:
        file = nptdms.TdmsFile.read(path)
        for group in file.groups():
            for channel in group.channels():
                found.series.append(Series(channel.name, np.asarray(channel[:]), _unit(channel.properties)))
                step = channel.properties.get("wf_increment")
                if step and not any(parts(s.heading)[0] == "time" for s in found.series):
                    start = channel.properties.get("wf_start_offset", 0.0)
                    found.series.insert(0, Series("time", start + step * np.arange(len(channel)), "s"))
        found.notes.update({str(k): str(v) for k, v in file.properties.items()})
    except Exception as problem:
        raise _broken(path, "a TDMS file", problem) from None
    return _table(path, "TDMS", found)


def read_parquet(path: Path) -> Table:
    """A Parquet file, its units in the headings or in the fields' metadata."""
    parquet = _library("pyarrow.parquet", path)
    try:
        content = parquet.read_table(path)
    except Exception as problem:
        raise _broken(path, "a Parquet file", problem) from None
    found = Found()
    for name, column in zip(content.column_names, content.columns, strict=True):
        about = {k.decode(): v.decode(errors="replace") for k, v in (content.schema.field(name).metadata or {}).items()}
        found.series.append(Series(name, column.to_numpy(zero_copy_only=False), _unit(about)))
    return _table(path, "Parquet", found)


def _library(module: str, path: Path) -> Any:
    try:
        return load(module, f"{path}: reading it", "files", ", or export the recording as CSV")
    except MissingExtraError as problem:
        raise ReadError(str(problem)) from None


def _broken(path: Path, what: str, problem: Exception) -> ReadError:
    said = " ".join(str(problem).split()) or type(problem).__name__
    return ReadError(f"{path}: expected {what}, as its first bytes say, but it cannot be read: {said[:200]}")


def _unit(properties: Mapping[str, Any]) -> str:
    return next((str(properties[n]) for n in UNIT_NAMES if properties.get(n)), "")


def _structure(found: Found, name: str, value: Any) -> None:
    """A variable of a MATLAB file: a vector, a matrix, a text, or a structure of them."""
    if hasattr(value, "_fieldnames"):
        fields = {n: getattr(value, n) for n in value._fieldnames}
        if name.lower() in UNIT_NAMES:
            found.units.update({n: str(v) for n, v in fields.items()})
            return
        for inner, part in fields.items():
            _structure(found, inner, part)
        return
    array = np.asarray(value)
    if array.dtype.kind in "US" or (array.dtype == object and all(isinstance(x, str) for x in array.flat)):
        _texts(found, name, [str(x) for x in array.flat])
    elif array.dtype.kind in "biuf":
        _matrix(found, name, array)


def _texts(found: Found, name: str, texts: list[str]) -> None:
    """Names or units of the columns of a matrix, or a remark."""
    key = "names" if name.lower() in ("names", "labels", "headers", "columns", "channels") else name.lower()
    found.notes[key] = "\t".join(texts)


def _matrix(found: Found, name: str, array: np.ndarray) -> None:
    if array.ndim == 0:
        found.notes[name.lower()] = f"{array[()]:.12g}"
    elif array.ndim == 1:
        found.series.append(Series(name, array.astype(float)))
    elif array.ndim == 2:
        tall = array if array.shape[0] >= array.shape[1] else array.T
        if tall.shape[1] == 1:
            found.series.append(Series(name, tall[:, 0].astype(float)))
            return
        found.series += [Series(f"{name}:{i + 1}", tall[:, i].astype(float)) for i in range(tall.shape[1])]


def _dataset(found: Found, h5py: Any, name: str, item: Any) -> None:
    """A data set of an HDF5 file; MATLAB's own are turned, its texts are numbers."""
    if not isinstance(item, h5py.Dataset) or name.startswith("#"):
        return
    last = name.rpartition("/")[2]
    kind = item.attrs.get("MATLAB_class", b"")
    if kind == b"char":
        text = "".join(map(chr, np.asarray(item[()]).flat))
        if name.rpartition("/")[0].lower().endswith(UNIT_NAMES):
            found.units[last] = text
        else:
            _texts(found, last, [text])
    elif item.dtype.kind in "biuf" and item.shape is not None:
        before = len(found.series)
        _matrix(found, last, np.squeeze(item[()]))
        unit = item.attrs.get("unit", item.attrs.get("units", ""))
        unit = unit.decode() if isinstance(unit, bytes) else str(unit)
        found.series[before:] = [Series(s.heading, s.values, unit) for s in found.series[before:]]


def _table(path: Path, kind: str, found: Found) -> Table:
    """Columns of the length that most values have; what is of another length is named as left out."""
    numeric = [s for s in _named(found) if s.values.dtype.kind in "biufM" and s.values.ndim == 1]
    if not numeric:
        raise ReadError(f"{path}: expected vectors of numbers such as 'time' and 'pressure' but found none")
    sizes = [s.values.size for s in numeric]
    size = max(set(sizes), key=lambda n: (sizes.count(n), n))
    others = [f"{s.heading!r} ({s.values.size} values)" for s in numeric if s.values.size != size]
    columns = tuple(_columns([s for s in numeric if s.values.size == size], found.units))
    remarks = (f"of another length than {size}, left out: {some(others)}",) if others else ()
    return Table(path, columns, np.arange(1, size + 1), kind, found.notes, remarks, row="sample")


def _named(found: Found) -> list[Series]:
    """The columns of a matrix under the names that a list beside it gives, if there are as many."""
    matrix = [s for s in found.series if ":" in s.heading]
    names = found.notes.get("names", "").split("\t")
    units = found.notes.get("units", "").split("\t")
    if len(names) != len(matrix):
        return found.series
    given = dict(zip((s.heading for s in matrix), names, strict=True))
    known = dict(zip((s.heading for s in matrix), units, strict=False)) if len(units) == len(names) else {}
    return [Series(given.get(s.heading, s.heading), s.values, known.get(s.heading, s.unit)) for s in found.series]


def _columns(series: list[Series], units: Mapping[str, str]) -> Iterator[Column]:
    for number, s in enumerate(series, 1):
        name, unit = parts(s.heading)
        clock = s.values.dtype.kind == "M"
        values = s.values
        if clock:
            values = (values - values.astype("datetime64[D]").min()).astype("timedelta64[ns]").astype(float) * 1e-9
        infinite = np.flatnonzero(np.isinf(values.astype(float)))
        problem = ""
        if infinite.size:
            problem = f"sample {infinite[0] + 1}, column {name!r}: expected a finite number but found inf"
        yield Column(
            name,
            "s" if clock else s.unit or units.get(s.heading, unit),
            s.heading,
            values.astype(float),
            number,
            clock,
            problem,
        )
