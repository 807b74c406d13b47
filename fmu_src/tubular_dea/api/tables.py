"""Tables of results as pandas and xarray have them; both are optional."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..extra import load

if TYPE_CHECKING:
    import pandas
    import xarray

EXTRA = "tables"


def pandas_module() -> Any:
    """The library; `MissingExtraError` says how to install it."""
    return load("pandas", "a DataFrame", EXTRA)


def over_time(time: np.ndarray, values: Mapping[str, np.ndarray], units: Mapping[str, str]) -> pandas.DataFrame:
    """Columns over `time` [s]; the units are in `attrs["units"]`."""
    pd = pandas_module()
    frame: pandas.DataFrame = pd.DataFrame(dict(values), index=pd.Index(time, name="time"))
    frame.attrs["units"] = {"time": "s"} | {name: units.get(name, "1") for name in values}
    return frame


def dataset(time: np.ndarray, values: Mapping[str, np.ndarray], units: Mapping[str, str]) -> xarray.Dataset:
    """The same as a Dataset over `time`, each variable with its unit."""
    xr = load("xarray", "a Dataset", EXTRA)
    variables = {name: ("time", column, {"units": units.get(name, "1")}) for name, column in values.items()}
    found: xarray.Dataset = xr.Dataset(variables, {"time": ("time", time, {"units": "s"})})
    return found


def table(rows: Sequence[Mapping[str, Any]], index: str) -> pandas.DataFrame:
    """Rows as a DataFrame, one column of them as its index."""
    frame: pandas.DataFrame = pandas_module().DataFrame(list(rows)).set_index(index)
    return frame
