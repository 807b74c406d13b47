"""The result folder: Parquet parts, written as they are computed, and a manifest of their plan.

    DIR/manifest.json                     plan's fingerprint, columns and units, rows, rows a part
    DIR/parts/part-000000000.parquet      the rows from that number on; there whole or not at all

A part is named by its first row, so a sweep that is started again sees what is there and computes the rest. A folder
of another plan is refused, and nothing in it is touched.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import UserError
from ..extra import load
from ..files import is_unfinished, read_whole, write_atomically
from .axes import grid_points
from .parts import Part, RowRange, arrow
from .plan import Plan
from .rows import Rows

FORMAT = 2
PARTS = 64  # a sweep has at most so many, and at least half of them, between the limits below
SMALLEST_PART, LARGEST_PART = 64, 16384


class StoreError(UserError, RuntimeError):
    """A result folder that cannot be used; the text says why and what to do. It has not been changed."""


@dataclass(frozen=True)
class Manifest:
    """What DIR/manifest.json says."""

    format: int
    name: str
    fingerprint: str
    rows: int
    part: int
    columns: dict[str, str]


class Store:
    """The results of a plan in a folder."""

    def __init__(self, folder: Path, manifest: Manifest) -> None:
        self.folder = folder
        self.manifest = manifest

    @staticmethod
    def open(folder: Path, plan: Plan) -> Store:
        """The store of `plan` in `folder`, begun or continued; `StoreError` where the folder is not this plan's."""
        store = Store.checked(folder, plan)
        path = folder / "manifest.json"
        if not path.exists():
            write_atomically(path, (json.dumps(asdict(store.manifest), indent=1) + "\n").encode())
        return store

    @staticmethod
    def checked(folder: Path, plan: Plan) -> Store:
        """As `open`, but nothing is written: the folder may be not there yet."""
        arrow()
        mine = Manifest(
            FORMAT, plan.name, plan.fingerprint, plan.design.rows, part_size(plan.design.rows), plan.columns
        )
        path = folder / "manifest.json"
        if path.exists():
            _same(_manifest(path), mine, folder)
        elif folder.exists() and any(entry for entry in folder.iterdir() if not is_unfinished(entry)):
            raise StoreError(f"{folder}: it is not empty and holds no sweep; give another folder, or empty it")
        else:
            check_room(plan, folder)
        return Store(folder, mine)

    @staticmethod
    def read(folder: Path) -> Store:
        """The store in `folder`, to read from."""
        return Store(folder, _manifest(folder / "manifest.json"))

    @property
    def ranges(self) -> list[RowRange]:
        """First row and end of every part there will be: small ones first, so that there soon is something to keep."""
        found: list[RowRange] = []
        start, size = 0, min(SMALLEST_PART, self.manifest.part)
        while start < self.manifest.rows:
            found.append((start, min(start + size, self.manifest.rows)))
            start, size = start + size, min(2 * size, self.manifest.part)
        return found

    def missing(self) -> list[RowRange]:
        """The parts that are not there, or not whole."""
        return [(start, stop) for start, stop in self.ranges if not self._whole(start, stop)]

    def write(self, part: Part) -> None:
        """Write a part that has been computed."""
        write_atomically(self._part(part.start), part.data)

    def column(self, name: str) -> np.ndarray:
        """One column of all rows."""
        _, pq = arrow()
        if name not in self.manifest.columns:
            raise StoreError(f"{self.folder}: there is no column {name!r}; it has {', '.join(self.manifest.columns)}")
        parts = [pq.read_table(self._part(start), columns=[name])[name].to_numpy() for start, _ in self.ranges]
        return np.concatenate(parts)

    def table(self) -> Rows:
        """All columns of all rows; for sweeps that fit into memory."""
        return {name: self.column(name) for name in self.manifest.columns}

    def _part(self, start: int) -> Path:
        return self.folder / "parts" / f"part-{start:09d}.parquet"

    def _whole(self, start: int, stop: int) -> bool:
        _, pq = arrow()
        try:
            return bool(pq.read_metadata(self._part(start)).num_rows == stop - start)
        except Exception:  # not there, or cut off by a power failure: it is computed again
            return False


def part_size(rows: int) -> int:
    """Rows a part: a power of two."""
    wanted = max(1, -(-rows // PARTS))
    return min(LARGEST_PART, max(SMALLEST_PART, 1 << (wanted - 1).bit_length()))


def check_room(plan: Plan, folder: Path) -> None:
    """`StoreError` where the results would not fit on the disk, or the design not into memory."""
    where = folder.absolute()
    while not where.exists():
        where = where.parent
    needed, free = 8.0 * plan.design.rows * len(plan.columns), shutil.disk_usage(where).free
    if needed > 0.9 * free:
        sizes = f"{needed / 1e9:.3g} GB on disk, and {free / 1e9:.3g} GB are free at {where}"
        raise StoreError(f"{plan.design.rows:.3g} rows need about {sizes}; take fewer points")
    available = _memory()
    if plan.design.memory > 0.8 * available:
        raise StoreError(
            f"[design] {plan.design.kind}: drawing {plan.design.rows:.3g} rows needs about "
            f"{plan.design.memory / 1e9:.3g} GB of memory, and {available / 1e9:.3g} GB are available; "
            f"take fewer points, or random or sobol, which need none"
        )


def check_cube(plan: Plan) -> None:
    """`StoreError` where the results are no cube."""
    if plan.design.kind != "grid":
        raise StoreError(f"a cube needs a grid; this design is {plan.design.kind!r}")


def cube(store: Store, plan: Plan) -> Any:
    """The results of a grid as an xarray Dataset, one dimension for each axis; `StoreError` for other designs."""
    xarray = load("xarray", "a cube", "sweep")
    check_cube(plan)
    shape, axes = plan.design.shape, plan.design.axes
    names = [axis.name for axis in axes]
    coords: dict[str, Any] = {}
    for axis in axes:
        points = grid_points(axis)
        own = points.pop(axis.name, np.arange(axis.count or 1))
        coords[axis.name] = (axis.name, own.astype(str) if own.dtype == object else own)
        coords |= {name: (axis.name, values) for name, values in points.items()}
    wanted = [*(w.column for w in plan.outputs), "status"]
    units = store.manifest.columns
    data = {c: (names, store.column(c).reshape(shape), {"units": units[c]}) for c in wanted}
    made = xarray.Dataset(data, coords=coords, attrs={"plan": plan.name, "fingerprint": plan.fingerprint})
    for name in made.coords:
        made[name].attrs["units"] = units.get(str(name), "")
    return made


def write_cube(store: Store, plan: Plan) -> Path:
    """The cube as DIR/cube.zarr."""
    load("zarr", "a cube", "sweep")
    made = cube(store, plan)
    path = store.folder / "cube.zarr"
    fresh, old = path.with_suffix(".zarr.new"), path.with_suffix(".zarr.old")
    shutil.rmtree(fresh, ignore_errors=True)
    made.to_zarr(fresh, mode="w", zarr_format=2, consolidated=True)
    shutil.rmtree(old, ignore_errors=True)
    if path.exists():
        path.rename(old)  # whole: a folder cannot be replaced at one stroke as a file can
    fresh.rename(path)
    shutil.rmtree(old, ignore_errors=True)
    return path


def _manifest(path: Path) -> Manifest:
    try:
        content = json.loads(read_whole(path))
        if content.get("format") != FORMAT:
            raise StoreError(
                f"{path}: expected format {FORMAT} but found {content.get('format')!r}; give another folder"
            )
        return Manifest(**content)
    except (OSError, ValueError, TypeError, AttributeError) as problem:
        raise StoreError(f"{path}: cannot be read as a sweep's manifest: {problem}; give another folder") from None


def _same(found: Manifest, mine: Manifest, folder: Path) -> None:
    if found.fingerprint == mine.fingerprint:
        return
    differences = []
    if found.rows != mine.rows:
        differences.append(f"{found.rows} rows there, {mine.rows} here")
    if list(found.columns) != list(mine.columns):
        differences.append(f"columns {', '.join(found.columns)} there")
    what = f" ({'; '.join(differences)})" if differences else ""
    raise StoreError(
        f"{folder}: it holds the results of another plan, {found.name!r}{what}; give another folder. "
        f"Nothing was overwritten"
    )


def _memory() -> float:
    """Bytes of memory that are available; infinite where the system does not say."""
    try:
        text = Path("/proc/meminfo").read_text(encoding="utf-8")
        return 1024.0 * float(next(line.split()[1] for line in text.splitlines() if line.startswith("MemAvailable")))
    except (OSError, StopIteration):
        return float("inf")
