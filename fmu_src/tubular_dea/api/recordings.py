"""Recordings of a plant: read, checked, shown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from ..errors import ArgumentError, list_of_names
from ..files import write_atomically
from ..identify.fitting import scales, signs
from ..identify.records.bench_file import BenchFile
from ..identify.records.data import of_tables, read_folder
from ..identify.records.experiment import Experiment, Recordings
from ..identify.records.unused import not_used
from ..kernel.checks import doubles
from ..protocol import Protocol
from ..recordings import Column, Table
from ..recordings.heading import parts
from . import tables, unusual
from .given import Amount, AnyPlant, brief, items, parameters_of, path_of, plant_of

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from ..report.understood import Understanding

IN_MEMORY = "in memory"  # the format of a table that was not in a file
PICTURE = "recordings.png"
Columns: TypeAlias = Mapping[str, str | int] | Sequence[str]
Data: TypeAlias = str | Path | Recordings


@dataclass(frozen=True, repr=False)
class RecordingSet(Recordings):
    """Recordings of a plant, one experiment a file, checked and in SI units.

    `experiments` have `name`, `time` (n,) [s], `inputs` and `outputs` by name, each (n,).
    """

    def __repr__(self) -> str:
        return f"<RecordingSet: {self._understood.lines()[0]}>"

    def __getitem__(self, name: str) -> Experiment:
        for experiment in self.experiments:
            if experiment.name == name:
                return experiment
        raise KeyError(f"no experiment {name!r}; there are {', '.join(self)}")

    def __iter__(self) -> Iterator[str]:
        return (e.name for e in self.experiments)

    def protocol(self, name: str) -> Protocol:
        """The inputs of an experiment as they were recorded: held ones jump at their samples, others run straight.

        Parameters
        ----------
        name : str
            Of the experiment.

        Returns
        -------
        Protocol
            For ``td.simulate(model, data.protocol(name), times=data[name].time)``.
        """
        experiment = self[name]
        twice = np.repeat(np.arange(experiment.time.size), 2)
        sides = {True: twice[:-1], False: twice[1:]}
        inputs = {s.name: experiment.inputs[s.name][sides[s.held]] for s in self.plant.inputs}
        return Protocol.of(experiment.time[sides[False]], **inputs)

    @cached_property
    def _understood(self) -> Understanding:
        from ..report.understood import Understanding

        return Understanding(self)

    def lines(self) -> list[str]:
        """How the files were understood: formats, columns, units, sampling, starts, edges, noise."""
        return self._understood.lines()

    def remarks(self) -> list[str]:
        """What was not used, as text."""
        return not_used(self)

    @cached_property
    def _asked(self) -> list[str]:
        return [*scales.findings(self), *signs.wrong_signs(self)]

    def findings(self) -> list[str]:
        """Units and signs that may be wrong, spikes, gaps, and files that are copies of others, as text."""
        return [*self._asked, *unusual.findings(self)]

    def to_pandas(self) -> pandas.DataFrame:
        """All samples as a DataFrame over experiment and time [s]: inputs, and outputs as the model puts them out.

        In SI units (``attrs["units"]``); NaN where a sample is missing. Needs the extra `tables`.
        """
        pd = tables.pandas_module()
        names = [*(s.name for s in self.plant.inputs), *(o.name for o in self.plant.outputs)]
        units = {name: self.plant.quantity(name).unit for name in names}
        frames = {e.name: tables.over_time(e.time, {**e.inputs, **e.outputs}, units) for e in self.experiments}
        joined: pandas.DataFrame = pd.concat(frames, names=["experiment"])
        joined.attrs["units"] = {"time": "s", **units}
        return joined

    def plot(self, figure: Figure | None = None) -> Figure:
        """All signals of all files, edges marked; drawn into `figure` if it is given."""
        return self._understood.drawing(figure)

    def report(self, out: str | Path) -> list[Path]:
        """Write the picture (recordings.png) to the folder `out`; returns its path in a list."""
        return [write_atomically(Path(out) / PICTURE, self._understood.picture())]


def read_recordings(
    data: str | Path | Mapping[str, Any],
    plant: AnyPlant = "tube",
    *,
    columns: Columns = (),
    geometry: Mapping[str, Amount] | None = None,
) -> RecordingSet:
    """Recordings of a plant from a folder of files, or from tables in memory.

    Parameters
    ----------
    data : str, Path or mapping
        A folder, one experiment a file, in any format that is read, with an optional bench.toml. Or tables by the name
        of the experiment: mappings (or DataFrames) of headings with units, such as ``"pressure [mmHg]"``, to arrays of
        shape (n,).
    plant : Plant, str or Path
        What was recorded: a plant, ``"tube"``, ``"aorta"`` or ``"FILE.py[:NAME]"``.
    columns : mapping or sequence of str
        Columns with other names: ``{"radius": "laser_2 [um]", "voltage": 3}``, by heading or number.
    geometry : mapping of str to float or str, optional
        Of this plant, where tables are in memory and it is not the declared one; a folder has its bench.toml.

    Returns
    -------
    RecordingSet
        Experiments in SI units, with what was understood of the files.

    Raises
    ------
    UserError
        For invalid files, columns and values, with file, line and column.

    References
    ----------
    Hampel, J. Am. Stat. Assoc. 69 (1974) 383: samples that stand out.

    Examples
    --------
    >>> import tubular_dea as td
    >>> data = td.read_recordings("cosim_examples/data/bench")
    >>> [experiment.name for experiment in data.experiments][:2]
    ['01_ramp_4kV', '03_step_6kV']
    >>> run = td.simulate("tube", data.protocol("03_step_6kV"), times=data["03_step_6kV"].time)
    >>> float(data.to_pandas().loc["03_step_6kV", "voltage"].max().round(-2))
    6000.0

    From memory:

    >>> run = td.simulate(pressure="95 mmHg", voltage="step 0 5 kV at 1", stop=3)
    >>> table = {"time [s]": run.time, "pressure [Pa]": run["pressure"], "voltage [V]": run["voltage"],
    ...          "radius [m]": run["radius"]}
    >>> td.read_recordings({"step": table})["step"].time.size
    301
    """
    chosen = plant_of(plant)
    if isinstance(columns, Mapping):
        settings = [f"{name}={column}" for name, column in columns.items()]
    else:
        settings = list_of_names("columns", columns)
    if isinstance(data, Mapping):
        known = parameters_of(chosen.model, geometry, "geometry")
        found = of_tables(
            [_table(name, given) for name, given in items("data", data)], chosen, settings, BenchFile(known)
        )
    elif geometry is not None:
        raise ArgumentError("geometry", f": {data} is a folder; write the geometry into its bench.toml")
    else:
        found = read_folder(path_of(data, "data"), chosen, settings)
    return recording_set(found)


def recording_set(found: Recordings) -> RecordingSet:
    """The same recordings, with what people look at."""
    return RecordingSet(
        found.plant, found.experiments, found.geometry, found.noise, found.source, found.left_out, found.still
    )


def recordings_of(data: Data, plant: AnyPlant) -> Recordings:
    """Recordings as they are, or those of a folder."""
    return data if isinstance(data, Recordings) else read_recordings(data, plant)


def findings_of(recordings: Recordings) -> list[str]:
    """The findings in recordings, with what was computed before where they are a set."""
    known = recordings if isinstance(recordings, RecordingSet) else recording_set(recordings)
    return known.findings()


def folder_of(recordings: Recordings) -> str:
    """The folder that recordings were read from, as it was given; "" for what was in memory."""
    source = recordings.experiments[0].source
    return "" if source is None or source.format == IN_MEMORY else str(source.path.parent)


def _table(name: str, given: Mapping[str, Any]) -> Table:
    """A table in memory as if it had been read."""
    columns = []
    if not isinstance(given, Mapping) and not hasattr(given, "columns"):
        raise ArgumentError("data", f" {name}: expected arrays by heading, as in a dict, but was given {brief(given)}")
    for number, heading in enumerate(given, start=1):
        label, unit = parts(str(heading))
        values = doubles(f"data {name}: {heading}", given[heading])
        columns.append(Column(label, unit, str(heading), values, number))
    sizes = {c.values.shape for c in columns}
    if len(sizes) != 1 or len(next(iter(sizes))) != 1:
        raise ArgumentError("data", f" {name}: expected columns of one length but was given the shapes {sorted(sizes)}")
    return Table(Path(name), tuple(columns), np.arange(1, columns[0].values.size + 1), IN_MEMORY, row="sample")
