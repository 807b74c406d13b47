"""A model driven by its inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .. import tabular
from ..errors import ArgumentError, MissingError, list_of_names
from ..files import write_atomically
from ..kernel import DEFAULT_TOLERANCE, Kernel, Trajectory
from ..kernel.checks import check_protocol, doubles
from ..model.declare import Model, Quantity, nearest
from ..model.scheduler import FIELD_LIMIT
from ..model.starts import started
from ..model.units import factor, three
from ..plants.load import shipped_of
from ..plants.plant import Input, Plant
from ..protocol import INTERVAL, STOP, Protocol, from_specifications
from . import tables
from .given import Amount, AnyModel, AnyPlant, amount, brief, model_of, parameters_of, plant_of

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

MOST_ROWS = 10_000_000
PANELS = 4  # outputs in the picture
ROUGHLY = 1.1  # times the usual interval that rows of a file are apart at most, for the result to have these rows


@dataclass(frozen=True, repr=False)
class SimulationResult(Trajectory):
    """The response of a model: values by name at `time` [s], each of shape (n,), in SI units.

    ``run["radial_displacement"]`` is one of them. `model` is what was driven; `remarks` are warnings in words, `jumps`
    the times [s] at which inputs jump; `between` says how inputs from a file were taken to go on between its rows.
    """

    model: Model = field(kw_only=True)
    remarks: tuple[str, ...] = ()
    jumps: np.ndarray = field(default_factory=lambda: np.empty(0))
    between: str = ""

    def __repr__(self) -> str:
        return f"<SimulationResult: {self.model.name}, {self.time.size} samples, {'; '.join(self.lines())}>"

    @property
    def units(self) -> dict[str, str]:
        """The unit of each value, inputs first."""
        return {name: self.model.quantity(name).unit for name in self._ordered()}

    def _ordered(self) -> list[str]:
        inputs = [q.name for q in self.model.inputs]
        return [*inputs, *(name for name in self.values if name not in inputs)]

    def lines(self) -> list[str]:
        """A summary as text: what drove the model (a number without a unit was SI), and what it did."""
        said = [f"driven by {' and '.join(map(self._course, self.model.inputs))}"] if self.model.inputs else []
        said += [self.between] if self.between else []
        if "snap_through_margin" in self.values:
            return [*said, *self._fold()]
        for name in self.model.outputs:
            low, high = self[name].min(), self[name].max()
            said.append(f"{name} from {low:.4g} to {high:.4g} {self.model.quantity(name).unit}")
        return said

    def _course(self, q: Quantity) -> str:
        """The values of an input, in its customary unit."""
        unit = q.display_unit or q.unit
        low, high = (f"{end / factor(unit, q.unit):.4g}" for end in (self[q.name].min(), self[q.name].max()))
        return f"{q.name} {low if low == high else f'{low} to {high}'}{'' if unit == '1' else f' {unit}'}"

    def _fold(self) -> list[str]:
        """The largest displacement of the tube, and its margin to snap-through."""
        low, high = 1e3 * self["radial_displacement"].min(), 1e3 * self["radial_displacement"].max()
        inward = f"smallest displacement {low:.3f} mm (inward), " if low < -5e-4 else ""
        return [
            f"{inward}largest displacement {high:.3f} mm, "
            f"largest field {1e-6 * np.abs(self['electric_field']).max():.1f} V/um, "
            f"smallest margin to snap-through {self['snap_through_margin'].min() / factor('mmHg', 'Pa'):.1f} mmHg"
        ]

    def to_pandas(self) -> pandas.DataFrame:
        """All values over `time` [s] as a DataFrame (n rows, SI units; ``attrs["units"]`` has them).

        Needs the extra `tables`.
        """
        return tables.over_time(self.time, {name: self[name] for name in self._ordered()}, self.units)

    def to_xarray(self) -> xarray.Dataset:
        """All values over `time` [s] as a Dataset; each variable has its unit in ``attrs["units"]``.

        Needs the extra `tables`.
        """
        return tables.dataset(self.time, {name: self[name] for name in self._ordered()}, self.units)

    def plot(self, figure: Figure | None = None) -> Figure:
        """The inputs and the first outputs over time, in their customary units; drawn into `figure` if it is given."""
        from ..report.figures import panels_figure

        model = self.model
        outputs = [n for n in ("radial_displacement", "electric_field") if n in model.outputs] or model.outputs[:PANELS]
        # Held to each jump of an input: what follows it must not seem to begin a sample early.
        jumps = self.jumps[(self.jumps > self.time[0]) & (self.jumps <= self.time[-1])]
        places = np.searchsorted(self.time, jumps)
        time, panels = np.insert(self.time, places, jumps), []
        for q in [*model.inputs, *map(model.quantity, outputs)]:
            unit = q.display_unit or q.unit
            values = np.insert(self[q.name], places, self[q.name][places - 1]) / factor(unit, q.unit)
            panels.append((f"{q.name.replace('_', ' ')} [{unit}]", {"": values}))
        return panels_figure(time, panels, figure=figure)

    def report(self, out: str | Path) -> list[Path]:
        """Write the table (response.csv) and the picture (response.png) to the folder `out`; returns their paths."""
        from ..report.figures import png

        columns = {name: self[name] for name in self._ordered()}
        content = {
            "response.csv": tabular.text(self.time, columns, self.units).encode(),
            "response.png": png(self.plot()),
        }
        return [write_atomically(Path(out) / name, data) for name, data in content.items()]


def simulate(
    model: AnyModel = "tube",
    inputs: Protocol | Mapping[str, Amount] | str | Path | None = None,
    *,
    stop: Amount | None = None,
    interval: Amount | None = None,
    times: Sequence[float] | np.ndarray | None = None,
    parameters: Mapping[str, Amount] | None = None,
    tolerance: float = DEFAULT_TOLERANCE,
    plant: AnyPlant | None = None,
    columns: Sequence[str] = (),
    **signals: Amount,
) -> SimulationResult:
    """The response of a model to its inputs over time.

    Parameters
    ----------
    model : Model, Plant, str or Path
        What is driven: ``td.tube()``, ``td.load("model.json")``, ``"tube"``, ``"aorta"``, ``"FILE.py[:NAME]"``, or a
        model.json.
    inputs : Protocol, mapping, str or Path, optional
        Breakpoints of all inputs, straight in between; or a file as `read_recordings` reads them, between whose rows
        inputs go on as the plant declares them (`held` or straight; straight up to a time that is listed twice); or
        inputs by name as in `signals`.
    stop : float or str
        End of the run [s], where inputs are not given over a time of their own (default: 5 s).
    interval : float or str, optional
        Time between samples of the result [s] (default: 10 ms, or the rows of a file that has them as close).
    times : array of shape (n,), optional
        Ascending times of the samples [s], in the place of `interval`.
    parameters : mapping of str to float or str
        Parameters that differ from the model's, in SI or with a unit.
    tolerance : float
        Approximate relative error: 1e-12 to 1e-2.
    plant : Plant, str or Path, optional
        The plant of a model.json, if it is declared in a file of your own.
    columns : sequence of str
        Columns of the file by heading or number where these are no inputs' names: ``["voltage=AI3[kV]"]``.
    **signals : float or str
        The inputs by name: a number in SI, which is held, or ``"95 mmHg"``, ``"step 0 5 kV at 1 until 2"``,
        ``"ramp 0 95 mmHg from 0 to 1"``, ``"pulses 0 5 kV every 0.8 from 0.1 for 0.3"``.

    Returns
    -------
    SimulationResult
        Inputs, states and outputs by name, each of shape (n,), in SI units.

    Raises
    ------
    UserError
        For invalid arguments, and where the integration ends early, with the time and the reason.

    Examples
    --------
    >>> import tubular_dea as td
    >>> run = td.simulate(td.tube(), pressure="95 mmHg", voltage="step 0 5 kV at 1", stop=3)
    >>> f"{1e3 * run['radial_displacement'][-1]:.2f} mm"
    '3.77 mm'
    >>> float(run.to_pandas().loc[3.0, "voltage"])
    5000.0

    Source: Rodas5P of G. Steinebach, BIT Numer. Math. 63 (2023) 27, the integrator that the FMUs have.
    """
    chosen = started(model_of(model, plant), parameters if isinstance(parameters, Mapping) else ())
    named = {**inputs, **signals} if isinstance(inputs, Mapping) else signals
    timed = None if isinstance(inputs, Mapping) else inputs
    # What was given is judged before what was not: who mistyped a value should not be told of the next one first.
    values = parameters_of(chosen, parameters)
    spacing = amount(INTERVAL if interval is None else interval, "s", "interval")
    tolerance, wanted = amount(tolerance, "1", "tolerance"), None if times is None else doubles("times", times)
    if wanted is not None and not wanted.size:
        raise ArgumentError("times", ": expected at least one time [s] but was given none")
    if not 1e-12 <= tolerance <= 1e-2:
        raise ArgumentError("tolerance", f": expected 1e-12 to 1e-2 but was given {tolerance:g}")
    protocol = _protocol(chosen, timed, named, stop, list_of_names("columns", columns))
    owner = _owner(model, chosen, plant)
    remarks: tuple[str, ...] = ()
    between = ""
    if isinstance(timed, str | Path):
        wanted = _rows(protocol, spacing) if wanted is None and interval is None else wanted
        remarks = tuple(_odd(Path(timed), protocol, owner)) if owner is not None else ()
        protocol, between = _as_recorded(protocol, owner)
    elif isinstance(inputs, Mapping) and owner is not None:
        remarks = tuple(_faint(protocol, owner))
    sampled = _times(protocol, spacing) if wanted is None else wanted
    remarks += tuple(_unset(chosen, values, owner))
    kernel = Kernel(chosen, differentiated=False)
    found = kernel.simulate(protocol, sampled, values, tolerance, with_fold=chosen.curve is not None)
    remarks += tuple(_runs_away(found) or _breaks_down(found))
    return SimulationResult(
        found.time,
        found.values,
        found.steps,
        found.rejected,
        model=chosen,
        remarks=remarks,
        jumps=protocol.jumps,
        between=between,
    )


def _owner(model: AnyModel, chosen: Model, plant: AnyPlant | None) -> Plant | None:
    """The plant that says how inputs are recorded; None where nobody told which one it is."""
    if isinstance(model, Plant):
        return model
    if isinstance(model, str | Path) and not str(model).endswith(".json"):
        return plant_of(str(model))
    given = None if plant is None else plant_of(plant)
    return given if given is not None and given.name == chosen.name else shipped_of(chosen.name)


def _as_recorded(protocol: Protocol, plant: Plant | None) -> tuple[Protocol, str]:
    """The inputs of a file as the plant declares that they go on between its rows, and that in words."""
    known = {s.name: s for s in plant.inputs} if plant is not None else {}
    signals = [known.get(name, Input(name)) for name in protocol.inputs]
    ways = {
        "held until the next row": [s.name for s in signals if s.held and not s.mean],
        "the mean since the row before": [s.name for s in signals if s.mean],
        "straight": [s.name for s in signals if not s.held],
    }
    held, means, _ = ways.values()
    told = ", ".join(f"{' and '.join(names)} {way}" for way, names in ways.items() if names)
    between = f"between the rows of the file: {told}" if told else ""
    return protocol.holding(held, means) if held or means else protocol, between


def _protocol(
    model: Model,
    timed: Protocol | str | Path | None,
    named: Mapping[str, Amount],
    stop: Amount | None,
    columns: Sequence[str],
) -> Protocol:
    """The inputs over time: those that have times of their own, or each by its name."""
    units = {q.name: q.unit for q in model.inputs}
    if columns and not isinstance(timed, str | Path):
        raise ArgumentError("columns", ": these are of a file of inputs, but none was given; give one, as inputs")
    unknown = [name for name in named if name not in units]
    if unknown:
        raise ArgumentError("input", f" {unknown[0]}: {model.name} has no such input{nearest(unknown[0], units)}")
    if timed is not None:
        if named or stop is not None:
            other = next(iter(named), "stop")
            raise ArgumentError(
                other, " and inputs exclude each other: these inputs have times of their own; give one of the two"
            )
        return _given(model, timed, columns)
    end = STOP if stop is None else amount(stop, "s", "stop")
    texts = {n: v if isinstance(v, str) else f"{amount(v, units[n], n):.17g}" for n, v in named.items()}
    protocol = from_specifications(texts, units, end)
    missing = [q for q in model.inputs if q.name not in named]
    if missing:
        text = f" is missing: expected a file of inputs, or each of {', '.join(units)}"
        raise MissingError(missing[0].name, text, _step_of(missing[0], end))
    return protocol


def _given(model: Model, timed: Protocol | str | Path, columns: Sequence[str]) -> Protocol:
    """The inputs that are given over a time of their own, checked."""
    if isinstance(timed, Protocol):
        check_protocol(model, timed)
        return timed
    if not isinstance(timed, str | Path):
        raise ArgumentError("inputs", f": expected a Protocol, a file or inputs by name but was given {brief(timed)}")
    from ..identify.records.driven import read_inputs  # half a second, which a run without a file need not wait for

    return read_inputs(Path(timed), model, columns)


def _step_of(q: Quantity, stop: float) -> str:
    """A step of an input to its usual size, within a run until `stop` [s], as somebody would write it."""
    unit = q.display_unit or q.unit
    height = f"{three(q.nominal / factor(unit, q.unit))} {unit}".removesuffix(" 1")
    return f"step 0 {height} at {three(stop / 5)}"


def _odd(path: Path, protocol: Protocol, plant: Plant) -> list[str]:
    """Columns that seem to have another unit; a small signal may be intended."""
    from ..identify.records.checks import mislabelled  # as in `_given`

    said = []
    for signal in plant.inputs:
        problem = mislabelled(protocol.inputs[signal.name], signal, plant.quantity(signal.name))
        if problem:
            said.append(f"{path}: column {signal.name!r}: {problem}")
    return said


def _faint(protocol: Protocol, plant: Plant) -> list[str]:
    """Inputs that were given, and are too small for their unit: it may have been left out."""
    said = []
    for signal in plant.inputs:
        top, q = float(np.abs(protocol.inputs[signal.name]).max()), plant.quantity(signal.name)
        if 0 < top < signal.least:
            said.append(
                f"{signal.name}: the largest value is {q.told(top)}; expected at least {q.told(signal.least)}: was its "
                "unit left out?"
            )
    return said


def _unset(model: Model, values: Mapping[str, float], owner: Plant | None) -> list[str]:
    """Free start values that were not given, nor changed in the model from what its plant declares: every run needs
    some."""
    declared = {} if owner is None else owner.model.parameter_values()
    free = [p.quantity for p in model.parameters if p.start and p.quantity.name not in values]
    free = [q for q in free if q.value == declared.get(q.name, q.value)]
    if not free:
        return []
    taken = ", ".join(f"{q.name} = {q.value:g} {q.unit}".removesuffix(" 1") for q in free)
    usual = f"{free[0].nominal:g}{free[0].unit}".removesuffix("1")
    chosen = f"--set {free[0].name}={usual}"
    return [f"{taken}: the plant leaves the start free, and the default was taken; choose, as by {chosen}"]


def _runs_away(found: Trajectory) -> list[str]:
    """When a tube passes the fold of its equilibria, if it does."""
    beyond = found.values["snap_through_margin"] < 0 if "snap_through_margin" in found.values else np.zeros(1, bool)
    if not beyond.any():
        return []
    return [f"the pressure passes the snap-through fold at {found.time[beyond][0]:.3g} s: the tube runs away there"]


def _breaks_down(found: Trajectory) -> list[str]:
    """Where a tube's field is more than the scheduler would allow it."""
    largest = float(np.max(found.values.get("electric_field", np.zeros(1))))
    if not largest > FIELD_LIMIT:
        return []
    return [
        f"the electric field reaches {1e-6 * largest:.4g} V/um: expected at most {1e-6 * FIELD_LIMIT:g} V/um, which is "
        "what the scheduler allows (field_limit): beyond, the elastomer may break down"
    ]


def _rows(protocol: Protocol, interval: float) -> np.ndarray | None:
    """The times (n,) [s] of a file's rows, for a result beside what was recorded; None where they are farther apart
    than `interval` [s]."""
    rows = np.unique(protocol.time)
    return rows if float(np.median(np.diff(rows))) < ROUGHLY * interval else None


def _times(protocol: Protocol, interval: float) -> np.ndarray:
    start, stop = protocol.time[0], protocol.time[-1]
    if not 0 < interval <= stop - start:
        raise ArgumentError(
            "interval", f": expected more than 0 and at most {stop - start:g} s but was given {interval:g}"
        )
    rows = (stop - start) / interval
    if rows > MOST_ROWS:
        raise ArgumentError("interval", f": {interval:g} s makes {rows:.3g} rows; expected at most 1e7")
    grid = start + interval * np.arange(int(np.floor(rows + 1e-9)) + 1)
    return np.minimum(grid, stop)
