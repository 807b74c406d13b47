"""Recordings: a folder of files, one experiment each, in any format that `recordings` reads, checked and in SI units.

An implausible recording is refused with file, line and column: time that decreases, mmHg labelled Pa, kV labelled V,
a frozen or saturated sensor, a radius below that of the tube at rest.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from ...errors import SeveralErrors
from ...model.units import converted
from ...plants.plant import Input, Plant
from ...recordings import NoTableError, Table, is_no_recording, is_recording, is_spreadsheet, read
from ...recordings.heading import name as plain
from ...recordings.table import FEW, some
from ..signals.monitors import noise_level
from ..signals.sampling import sampling, usual_step
from . import appended, checks, gaps
from .bench_file import BenchFile, read_bench
from .columns import TRIGGER, Assigned, Choice, assigned, choices, is_worded, signals, unused
from .experiment import DataError, Experiment, Recordings, Source, fitted_outputs
from .lost import is_mark, lost_samples
from .spikes import lapses, spikes
from .start import detected
from .updates import repeated_readings

BENCH_FILE = "bench.toml"
NOTES = (".txt", ".log", ".asc", ".dat")  # endings of files that may be a table or somebody's notes

# Set by judgement. Check: `pytest tests/test_growing_noise.py -k rests`
FIRST_SAMPLES_READ = 9  # [samples] that tell where an input is at first
NOISE_AT_FIRST = 6.0  # [1] times its noise by which it is off that at most while nothing moves the plant yet

# Set by judgement. Check: `pytest tests/test_reading.py -k calendar`
DAY = 86_400.0  # [s] beyond which a time is one of the calendar, as since 1970: it counts from the first sample


class StillError(DataError):
    """A file in which nothing moves: it says nothing, and harms nothing."""


def read_folder(folder: Path, plant: Plant, columns: Sequence[str] = ()) -> Recordings:
    """Every recording of a folder, in the order of their names, and its optional bench.toml.

    `columns` say which column is which signal where headings do not, as in "radius=laser_2[um]".
    """
    files = _files(folder, plant)
    said = read_bench(folder / BENCH_FILE, plant, [path.stem for path in files])
    chosen = said.columns | choices(columns, plant)
    experiments, left_out, still = [], [], {}
    faults: list[DataError] = []
    for path in files:
        try:
            table = read(path, signals(plant), pipe=False)
        except DataError as finding:
            if not isinstance(finding, NoTableError) or path.suffix.lower() not in NOTES:
                raise _all_of([*faults, finding]) from None
            left_out.append(path.name)
            continue
        try:
            experiments += _experiments(path.stem, table, plant, chosen, said)
        except StillError as finding:
            still[path.name] = finding
        except DataError as finding:
            faults.append(finding)
    if faults:
        raise _all_of(faults)
    if still and not experiments:
        raise next(iter(still.values()))
    if not experiments:
        raise DataError(f"{folder}: no experiment usable: {some(left_out)} hold no rows of numbers")
    names = [e.name for e in experiments]
    twice = next((name for name in names if names.count(name) > 1), "")
    if twice:
        raise DataError(
            f"{folder}: two experiments are called {twice}: a file, and a part of another one; rename the file"
        )
    ordered = _ordered(experiments)
    plant = _fitted_first(plant, experiments)
    left_out += sorted(path.name for path in folder.iterdir() if is_no_recording(path) and path.name != BENCH_FILE)
    return Recordings(plant, ordered, said.geometry, said.noise, folder.name, tuple(left_out), tuple(still))


def _all_of(faults: Sequence[DataError]) -> DataError:
    """One error that says what is wrong with every file, of many with the first ones."""
    return faults[0] if len(faults) == 1 else SeveralErrors(faults[:FEW], len(faults) - FEW)


def of_tables(
    tables: Sequence[Table], plant: Plant, columns: Sequence[str] = (), said: BenchFile | None = None
) -> Recordings:
    """Recordings that are in memory, each named by its table's path; `said` is what bench.toml would say of them."""
    if not tables:
        raise DataError("recordings: expected at least one table but was given none")
    said = said or BenchFile()
    chosen = said.columns | choices(columns, plant)
    experiments = [e for t in tables for e in _experiments(str(t.path), t, plant, chosen, said)]
    plant, ordered = _fitted_first(plant, experiments), _ordered(experiments)
    return Recordings(plant, ordered, said.geometry, said.noise, "recordings")


def _experiments(
    name: str, table: Table, plant: Plant, chosen: Mapping[str, Choice], said: BenchFile
) -> list[Experiment]:
    """The experiments of one table: of each run that was appended to it, and of the parts between long gaps."""
    found = []
    for own, run in appended.runs(name, table, plant, chosen, said.rate).items():
        one = experiment_of(run, plant, said.geometry, chosen, said.rate, said.commanded)
        whole = replace(one, name=own, part_of="" if own == name else name)
        found += gaps.cut(_placed(whole, said, plant), plant)
    return found


def _fitted_first(plant: Plant, experiments: Sequence[Experiment]) -> Plant:
    """The plant, the outputs that take part in fits before the others: of the first one, answers tell the error."""
    fitted = fitted_outputs(plant, experiments)
    if not fitted or fitted[0] == plant.outputs[0]:
        return plant
    return replace(plant, outputs=[*fitted, *(o for o in plant.outputs if o not in fitted)])


def _placed(experiment: Experiment, said: BenchFile, plant: Plant) -> Experiment:
    """The experiment with its kind of start, from bench.toml or from its first samples, and its start time."""
    start = said.start.get(experiment.name, said.start.get("default", ""))
    placed = replace(experiment, start_said=bool(start), begins=said.order.get(experiment.name))
    return replace(placed, start=start or detected(experiment, plant))


def _ordered(experiments: Sequence[Experiment]) -> list[Experiment]:
    """The experiments, each with the name of the one that it follows; `DataError` where two overlap."""
    row = sorted((e.begins, e.name, float(np.ptp(e.time))) for e in experiments if e.begins is not None)
    follows = {}
    for (begins, first, lasts), (then, name, _) in pairwise(row):
        if begins + lasts >= then:
            raise DataError(
                f"bench.toml: [order] {first} begins at {begins:g} s and lasts {lasts:.4g} s, but {name} begins at "
                f"{then:g} s; expected start times one after the other"
            )
        follows[name] = first
    return [replace(e, follows=follows.get(e.name, "")) for e in experiments]


def _files(folder: Path, plant: Plant) -> list[Path]:
    """The files of a folder that may be recordings; each name once."""
    if not folder.is_dir():
        there = f"a file; give the folder that it lies in, {folder.parent}" if folder.exists() else "nothing"
        raise DataError(f"{folder}: expected a folder of recordings but there is {there}")
    files = sorted(path for path in folder.iterdir() if is_recording(path))
    stems = {path.stem for path in files}  # the recording itself, where somebody has saved the sheet beside it
    unread = sorted(path.name for path in folder.iterdir() if is_spreadsheet(path) and path.stem not in stems)
    if unread:
        raise DataError(
            f"{folder}: {some(unread)}: expected recordings as text (such as CSV), MATLAB, HDF5, TDMS or Parquet files "
            "but found spreadsheets, which are not read; save each as CSV beside it, or move away what is no recording"
        )
    if not files:
        raise DataError(f"{folder}: no experiment usable: expected files headed {plant.headers()!r} but found none")
    by_name: dict[str, Path] = {}
    for path in files:
        if path.stem in by_name:
            raise DataError(
                f"{folder}: expected one file an experiment but found {by_name[path.stem].name} and "
                f"{path.name}; move one away"
            )
        by_name[path.stem] = path
    return files


def read_experiment(
    path: Path,
    plant: Plant,
    geometry: Mapping[str, float] | None = None,
    chosen: Mapping[str, Choice] | None = None,
    rate: float | None = None,
    commanded: Collection[str] = (),
) -> Experiment:
    """One file, checked. `geometry` has the values of parameters that are subtracted from a column (a radius).

    `chosen` says which column a signal is, `rate` [Hz] how a file without a time was sampled, `commanded` which inputs
    were not measured. `DataError` for what cannot be used.
    """
    return experiment_of(read(path, signals(plant), pipe=False), plant, geometry, chosen, rate, commanded)


def experiment_of(
    table: Table,
    plant: Plant,
    geometry: Mapping[str, float] | None = None,
    chosen: Mapping[str, Choice] | None = None,
    rate: float | None = None,
    commanded: Collection[str] = (),
) -> Experiment:
    """One table of numbers, checked; the arguments are those of `read_experiment`."""
    path, chosen = table.path, chosen or {}
    columns, gone = _without_lost(table, plant, assigned(table, plant, chosen, rate))
    if table.lines.size < plant.least_samples:
        raise DataError(
            f"{path}: too few samples: {table.lines.size} {table.row}s of numbers; expected at least "
            f"{plant.least_samples}"
        )
    taken = sampling(table, columns["time"].values, np.array([a.values for n, a in columns.items() if n != "time"]))
    values, lines = {name: a.values[taken.kept] for name, a in columns.items()}, table.lines[taken.kept]
    time = taken.time - (taken.time[0] if columns["time"].column.clock or abs(taken.time[0]) > DAY else 0.0)
    _check_time(table, lines, time, plant)
    inputs = {s.name: _filled(path, time, values[s.name], s) for s in plant.inputs}
    units = {name: a.unit for name, a in columns.items()}
    for finding in checks.inputs(values, plant, lines, commanded, units):
        raise DataError(f"{path}, {finding}")
    parameters = plant.model.parameter_values() | dict(geometry or {})
    outputs, idle = _outputs(table, plant, columns, values, lines, inputs, parameters)
    told = _read_from(plant, {n: a for n, a in columns.items() if n not in chosen})
    source = _source(table, columns, [*told, *gone, *taken.remarks, *idle])
    trigger, guessed = _switched(values.get(TRIGGER)), gaps.guessed(values, plant.inputs)
    return Experiment(path.stem, time, inputs, outputs, lines, trigger, source=source, guessed=guessed)


def _read_from(plant: Plant, columns: Mapping[str, Assigned]) -> list[str]:
    """What is said of signals that are in columns of other names, which nobody chose."""
    sensed = [name for o in plant.outputs for name in o.headings]
    told = []
    for name, a in columns.items():
        column = a.column
        if name in (TRIGGER, "time") or column.name == plain(name):
            continue
        if a.times != 1.0:
            told.append(f"{name} is {a.times:g} times {column.shown}")
            continue
        worded = name in sensed and is_worded(name, column)
        only = "with that in its heading" if worded else "in a unit of its kind"
        told.append(f"{name} is read from {column.shown}, the only column {only}")
    return told


def _without_lost(table: Table, plant: Plant, columns: Mapping[str, Assigned]) -> tuple[dict[str, Assigned], list[str]]:
    """The columns with gaps where a number stands for a sample that was lost, and what is said of it."""
    most = {s.name: s.most for s in plant.inputs} | {name: o.most for o in plant.outputs for name in o.headings}
    sensed = {name for o in plant.outputs for name in o.headings}
    found, said = dict(columns), []
    for name in most.keys() & columns.keys():
        column, values = columns[name].column, columns[name].values
        numbers = lost_samples(column.values, np.abs(values) > most[name], name in sensed)
        for number, at in numbers.items():
            more = f" and in {at.size - 1} more" if at.size > 1 else ""
            said.append(f"{name} is {number:.10g} in {table.row} {table.lines[at[0]]}{more}: lost samples, left out")
        gone = np.isin(column.values, list(numbers))
        empty = replace(column, values=np.where(gone, np.nan, column.values))
        found[name] = replace(columns[name], column=empty, values=np.where(gone, np.nan, values))
        left = empty.values[np.isfinite(empty.values)]
        for end in {float(left.min()), float(left.max())} if left.size else ():
            if is_mark(end):
                line = table.lines[int(np.flatnonzero(empty.values == end)[0])]
                said.append(
                    f"{name} is {end:.10g} in {table.row} {line}, which may be a value or a mark of a lost sample; if "
                    "it is a mark, empty these cells"
                )
    return found, sorted(said)


def _outputs(
    table: Table,
    plant: Plant,
    columns: Mapping[str, Assigned],
    values: Mapping[str, np.ndarray],
    lines: np.ndarray,
    inputs: Mapping[str, np.ndarray],
    known: Mapping[str, float],
) -> tuple[dict[str, np.ndarray], list[str]]:
    """The outputs by name (n,) in SI, as the model puts them out, and remarks on them; `DataError` where they are none.

    One output may stand still where another one moves.
    """
    undriven, waits = _nothing_moves(inputs, plant), _as_at_first(inputs, plant)
    found: dict[str, np.ndarray] = {}
    said: list[str] = []
    headings = {o.name: next((name for name in o.headings if name in values), None) for o in plant.outputs}
    there = [h for h in headings.values() if h is not None and _there(values[h]).size]
    still = [h for h in there if any(checks.constant(_there(values[h]), h, lines, ""))]
    for output in plant.outputs:
        heading = headings[output.name]
        if heading is None:
            continue
        if not output.required and (heading in still or heading not in there):
            said.append(f"{heading} {'stands still' if heading in still else 'has no number'} here, and is not used")
            continue
        if undriven and heading in still:
            raise StillError(f"{table.path}: neither an input nor {heading!r} moves in it; expected an experiment")
        read = values[heading]
        if not output.feels_rates:  # a current peaks where its voltage switches
            unit = plant.quantity(output.name).unit
            again, lasts = repeated_readings(read)
            if lasts > 1:
                said.append(
                    f"{heading} is new in every {lasts} or {lasts + 1} samples only, as of a sensor that is read more "
                    "often than it measures: readings that are repeated are left out"
                )
            read = np.where(again, np.nan, read)
            units = (unit, columns[heading].unit or unit)
            gone, stand_out = _standing_out(read, heading, units, lines, table.row, _driving(inputs, plant))
            said += stand_out
            read = np.where(gone, np.nan, read)
        zero = known[output.columns[heading]] if output.columns.get(heading) else 0.0
        rests = heading in still and len(still) < len(there)
        said += [f"{heading} stands still here"] * rests
        unit_read = columns[heading].unit
        for finding in checks.output(read, output, plant, lines, heading, zero, rests, unit_read, waits):
            raise DataError(f"{table.path}, {finding}")
        found[output.name] = read - zero
    return found, said


def _driving(inputs: Mapping[str, np.ndarray], plant: Plant) -> dict[str, np.ndarray]:
    """The inputs (n,) as they drive the plant: 0 where one shows nothing but the noise of its monitor."""
    little = {s.name: s.little for s in plant.inputs}
    return {name: v if np.ptp(v) > little[name] else np.zeros_like(v) for name, v in inputs.items()}


def _standing_out(
    read: np.ndarray,
    heading: str,
    units: tuple[str, str],
    lines: np.ndarray,
    row: str,
    inputs: Mapping[str, np.ndarray],
) -> tuple[np.ndarray, list[str]]:
    """Which samples of an output (n,) no plant makes, and what is said of them; `units`: SI, and that of the file."""
    alone, said = spikes(read, inputs.values()), []
    gone = np.isin(np.arange(read.size), alone)
    written = converted(read, *units)
    if alone.size:
        said.append(_spiky(heading, written, units[1], alone, lines, row))
    places = []
    for lapse in lapses(np.where(gone, np.nan, read), inputs.values()) if inputs else ():
        off = abs(written[lapse[lapse.size // 2]] - _there(np.where(gone, np.nan, written)[: lapse[0]])[-1])
        places.append(f"by {off:.3g} {units[1]} from {row} {lines[lapse[0]]} to {lines[lapse[-1]]}")
        gone[lapse] = True
    if places:
        left_out = "a lapse of the sensor" if len(places) == 1 else f"{len(places)} lapses of the sensor"
        listed = ", ".join(places)
        said.append(
            f"{heading} is off {listed}, and back at once, while no input moves abruptly: left out as {left_out}"
        )
    return gone, said


def _spiky(heading: str, values: np.ndarray, unit: str, alone: np.ndarray, lines: np.ndarray, row: str) -> str:
    """What is said of single samples that stand out."""
    first, more = int(alone[0]), f", as {alone.size - 1} more do" if alone.size > 1 else ""
    return (
        f"{heading} is {values[first]:.4g} {unit} in {row} {lines[first]}, far from the samples beside it{more}: "
        "left out as a spike"
    )


def _nothing_moves(inputs: Mapping[str, np.ndarray], plant: Plant) -> bool:
    """Whether every input is a constant and its noise, or moves by next to nothing."""

    def rests(values: np.ndarray, signal: Input) -> bool:
        return np.ptp(values) <= signal.little or any(
            checks.constant(values, signal.name, np.zeros(values.size, dtype=int), "")
        )

    return all(rests(inputs[s.name], s) for s in plant.inputs)


def _as_at_first(inputs: Mapping[str, np.ndarray], plant: Plant) -> np.ndarray:
    """Where every input (n,) is as at first, but for what its monitor moves by at rest (n,)."""
    near = []
    for signal in plant.inputs:
        values = inputs[signal.name]
        noise = max(NOISE_AT_FIRST * noise_level(values), signal.little)
        near.append(np.abs(values - np.nanmedian(values[:FIRST_SAMPLES_READ])) <= noise)
    return np.asarray(np.all(near, axis=0))


def _there(values: np.ndarray) -> np.ndarray:
    return values[np.isfinite(values)]


def _source(table: Table, columns: Mapping[str, Assigned], remarks: Sequence[str]) -> Source:
    shown = {name: _shown(a) for name, a in columns.items()}
    missing = {name: a.column.missing for name, a in columns.items() if a.column.missing}
    units, said = {name: a.unit for name, a in columns.items() if a.unit}, (*table.remarks, *remarks)
    return Source(table.path, table.format, shown, tuple(unused(table, columns)), said, missing, units, table.row)


def _shown(a: Assigned) -> str:
    """A column's heading, with its unit if the heading does not contain it."""
    text = a.column.heading or f"number {a.column.number}"
    if a.column.clock:
        return f"{text} (clock)"
    said = re.search(rf"(?<![^\W_]){re.escape(a.unit)}(?![^\W_])", text)
    return text if said or not a.unit else f"{text} in {a.unit}"


def _switched(trigger: np.ndarray | None) -> np.ndarray | None:
    """A trigger as 0 and 1, whatever its levels; None where it never changes."""
    if trigger is None or not np.any(np.isfinite(trigger)):
        return None
    low, high = np.nanmin(trigger), np.nanmax(trigger)
    return np.where(trigger > 0.5 * (low + high), 1.0, 0.0) if high > low else None


def _filled(path: Path, time: np.ndarray, values: np.ndarray, signal: Input) -> np.ndarray:
    """An input with its gaps filled: by the last value where the signal is held, else by a straight line; means from
    the begin of their time on."""
    there = np.flatnonzero(np.isfinite(values))
    if there.size < max(2, values.size // 2):
        raise DataError(f"{path}, column {signal.name!r}: expected numbers but more than half of the lines have none")
    if signal.held:
        last = np.clip(np.searchsorted(there, np.arange(values.size), side="right") - 1, 0, None)
        held = values[there[last]]
        return np.append(held[1:], held[-1]) if signal.mean else held
    return np.interp(time, time[there], values[there])


def _check_time(table: Table, lines: np.ndarray, time: np.ndarray, plant: Plant) -> None:
    span, step = float(time[-1] - time[0]), usual_step(time)
    if span < plant.shortest or step > plant.coarsest:
        label = "s labelled ms" if span < plant.shortest else "ms labelled s"
        raise DataError(
            f"{table.path}, {table.row}s {lines[0]} to {lines[-1]}, column 'time': {span:g} s in steps of {step:g} s; "
            f"expected at least {plant.shortest:g} s in steps of at most {plant.coarsest:g} s: {label}?"
        )
