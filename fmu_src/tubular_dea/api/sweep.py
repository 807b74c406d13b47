"""Sweeps over many points."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ArgumentError
from . import tables
from .given import AnyPlant, path_of, plant_of, whole

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

    from ..sweep.plan import Plan
    from ..sweep.store import Store


@dataclass(frozen=True, repr=False)
class SweepResult:
    """The rows of a sweep: one column for each that varies, each that was wanted, `status` (0: computed), `message`.

    They stand in Parquet files below `folder`.
    """

    plan: Plan
    store: Store

    def __repr__(self) -> str:
        return f"<SweepResult: {self.plan.name}, {self.lines()[0]}>"

    def __getitem__(self, name: str) -> np.ndarray:
        """One column of all rows, shape (rows,)."""
        return self.store.column(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self.store.manifest.columns)

    @property
    def folder(self) -> Path:
        """The folder of the rows."""
        return self.store.folder

    @property
    def failed(self) -> int:
        """How many rows have no result; their `message` says why."""
        return int((self.store.column("status") != 0).sum())

    @property
    def units(self) -> dict[str, str]:
        """The unit of each column ("" for text)."""
        return dict(self.plan.columns)

    def lines(self) -> list[str]:
        """The number of rows and failures, as text."""
        note = f", {self.failed} of them beyond what can be computed (column message says why)" if self.failed else ""
        return [f"{self.store.manifest.rows} rows in {self.folder / 'parts'}{note}"]

    def to_pandas(self) -> pandas.DataFrame:
        """All rows as a DataFrame over the number of the row, in SI units (``attrs["units"]``).

        Needs the extra `tables`.
        """
        pd = tables.pandas_module()
        frame: pandas.DataFrame = pd.DataFrame(self.store.table()).set_index("row")
        frame.attrs["units"] = self.units
        return frame

    def to_xarray(self) -> xarray.Dataset:
        """The results of a grid as a Dataset, one dimension for each axis; `UserError` for other designs."""
        from ..sweep.store import cube

        found: xarray.Dataset = cube(self.store, self.plan)
        return found

    def plot(self, name: str | None = None, figure: Figure | None = None) -> Figure:
        """The picture of one output (default: the first), as the report has it; in `figure` if it is given."""
        from ..report.sweep import pictures

        drawn = {picture.name: picture for picture in pictures(self.store, self.plan)}
        chosen = next(iter(drawn), "") if name is None else name
        if chosen not in drawn:
            raise ArgumentError("name", f": expected one of {', '.join(drawn)} but was given {chosen!r}")
        return drawn[chosen].draw(figure)

    def report(self) -> list[Path]:
        """Write report.html, its pictures and, of sampled designs, statistics.json to the folder; their paths."""
        from ..report.sweep import write_report

        return write_report(self.store, self.plan)

    def write_cube(self) -> Path:
        """Write the results of a grid as a zarr cube beside the rows; returns its path."""
        from ..sweep.store import write_cube

        return write_cube(self.store, self.plan)


def sweep(
    plan: str | Path | Mapping[str, Any],
    out: str | Path | None = None,
    *,
    workers: int | None = None,
    local_cluster: int | None = None,
    scheduler: str | None = None,
    cube: bool = False,
    plant: AnyPlant | None = None,
    progress: bool = False,
) -> SweepResult:
    """Compute a plan of many points: designs, patients, uncertain parameters.

    Parameters
    ----------
    plan : str, Path or mapping
        A TOML file, or its tables: what varies, over what, what is wanted; see `tubular_dea.sweep.plan`. ``"model"``
        may also be a Model.
    out : str or Path, optional
        Folder to write to or to continue (default: a temporary one, deleted with the result).
    workers : int, optional
        Threads in this process (default: all processors).
    local_cluster : int, optional
        Worker processes of Dask on this machine, instead.
    scheduler : str, optional
        A Dask scheduler, for example ``"tcp://10.0.0.1:8786"``, instead.
    cube : bool
        Refuse, before anything is computed, a plan whose results are no cube.
    plant : Plant, str or Path, optional
        The plant of a model.json, if it is declared in a file of your own; or the plan's ``"plant"``.
    progress : bool
        Show a bar on standard error.

    Returns
    -------
    SweepResult
        The rows; those that could not be computed say why.

    Raises
    ------
    UserError
        For an invalid plan or folder, and where the extra `sweep` is not installed.

    References
    ----------
    M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21 (1979) 239: the Latin hypercube.

    A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259: the design and the estimates of Sobol indices.

    Examples
    --------
    >>> import tubular_dea as td
    >>> swept = td.sweep({"model": td.tube(), "study": "rest", "outputs": ["radial_displacement"],
    ...                   "vary": {"voltage": {"from": "0 kV", "to": "6 kV", "count": 4}},
    ...                   "inputs": {"pressure": "95 mmHg"}})
    >>> [f"{1e3 * x:.2f} mm" for x in swept["radial_displacement"]]
    ['2.82 mm', '2.95 mm', '3.40 mm', '4.41 mm']
    """
    from ..sweep.backends import backend
    from ..sweep.plan import make_plan, read_plan
    from ..sweep.run import carry_out
    from ..sweep.store import Store, check_cube

    for name, number in (("workers", workers), ("local_cluster", local_cluster)):
        if number is not None:
            whole(number, 1, name)
    chosen = None if plant is None else plant_of(plant)
    made = make_plan(plan, plant=chosen) if isinstance(plan, Mapping) else read_plan(path_of(plan, "plan"), chosen)
    if cube:
        check_cube(made)
    if out is None:
        out = tempfile.mkdtemp(prefix="tubular-dea-sweep-")
        weakref.finalize(made, shutil.rmtree, out, ignore_errors=True)  # the plan goes with the result
    folder = path_of(out, "out")
    Store.checked(folder, made)  # refuses one of another plan before a cluster is started, which may fail: no writing
    with backend(workers, local_cluster, scheduler) as computing:
        return SweepResult(made, carry_out(made, folder, computing, progress))
