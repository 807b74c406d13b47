"""Parts of a sweep: some rows, computed and packed as a Parquet file, wherever that happens."""

from __future__ import annotations

import io
import pickle
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from time import perf_counter
from typing import Any

import numpy as np

from ..extra import load
from .rows import PreparedPlan, Rows

RowRange = tuple[int, int]  # the first row of a part, and the end


@dataclass(frozen=True)
class Part:
    """Rows `start` to `stop`, `failed` of them without a result, as the bytes of a Parquet file."""

    start: int
    stop: int
    failed: int
    data: bytes


def part(prepared: PreparedPlan, start: int, stop: int) -> Part:
    """The part of rows `start` to `stop`: the same bytes whoever computes it."""
    rows = prepared.rows(start, stop)
    return Part(start, stop, int(np.count_nonzero(rows["status"])), parquet(prepared.plan.columns, rows))


def parquet(units: Mapping[str, str], rows: Rows) -> bytes:
    """A Parquet file of `rows`, with the SI unit of every column ("" for text) in its schema."""
    pa, pq = arrow()
    fields = [pa.field(name, _type(pa, name, unit), metadata={"unit": unit}) for name, unit in units.items()]
    arrays = [pa.array(rows[name], type=field.type) for name, field in zip(units, fields, strict=True)]
    buffer = io.BytesIO()
    pq.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields)), buffer, compression="zstd")
    return buffer.getvalue()


def arrow() -> tuple[Any, Any]:
    """pyarrow and its Parquet module."""
    return load("pyarrow", "a sweep's result table", "sweep"), load(
        "pyarrow.parquet", "a sweep's result table", "sweep"
    )


def _type(pa: Any, name: str, unit: str) -> Any:
    if name == "row":
        return pa.int64()
    if name == "status":
        return pa.int32()
    return pa.float64() if unit else pa.string()


_LOCK = threading.Lock()


@lru_cache(maxsize=4)
def _prepared(fingerprint: str, content: bytes) -> PreparedPlan:
    return PreparedPlan(pickle.loads(content))


def task(fingerprint: str, content: bytes, ranges: Sequence[RowRange]) -> tuple[list[Part], float]:
    """The parts of a pickled plan, and the seconds they took: what a worker runs. It compiles the model once."""
    begin = perf_counter()
    with _LOCK:
        prepared = _prepared(fingerprint, content)
    return [part(prepared, *rows) for rows in ranges], perf_counter() - begin
