"""The optional file `bench.toml` beside recordings, in which a laboratory describes them; unknown keys are refused.

::

    [geometry]                # of this plant, where it is not the declared one; a number without a unit is in SI
    r_o = "14.8 mm"
    n_layers = 6

    [noise]                   # standard deviation of a monitor or sensor, where it is known (else it is estimated)
    radius = "15 um"
    voltage = "0 V"           # an input that was commanded, not measured: it is what stands in the file

    [columns]                 # which column is which signal, where headings do not say so: a heading or a number
    radius = "laser_2 [um]"

    [sampling]                # of files without a time
    rate = "250 Hz"

    [start]                   # rested, equilibrium (under the first inputs) or unknown; without it, detected (of a
                              # plant whose states all start free: unknown)
    default = "rested"
    02_step_4kV = "equilibrium"

    [order]                   # when experiments began that follow one another without rest, on one clock
    01_ramp_4kV = "0 s"
    02_step_4kV = "95 s"
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ...files import read_whole
from ...model.declare import nearest
from ...model.units import UnitError, quantity
from ...plants.plant import Plant
from ...recordings import ReadError
from .columns import TRIGGER, Choice, choices, signals
from .experiment import EQUILIBRIUM, RESTED, STARTS, UNKNOWN, commanded


@dataclass(frozen=True)
class BenchFile:
    """What bench.toml says: geometry (SI, by parameter), noise (SI, by signal), start and begin of experiments.

    `columns` says which column of the files is which signal, `rate` [Hz] how files without a time were sampled.
    """

    geometry: dict[str, float] = field(default_factory=dict)
    noise: dict[str, float] = field(default_factory=dict)
    start: dict[str, str] = field(default_factory=dict)
    order: dict[str, float] = field(default_factory=dict)
    columns: dict[str, Choice] = field(default_factory=dict)
    rate: float | None = None

    @property
    def commanded(self) -> set[str]:
        """The inputs that were not measured: what stands in the files is exact."""
        return commanded(self.noise)


TABLES = ("geometry", "noise", "columns", "sampling", "start", "order")


def read_bench(path: Path, plant: Plant, experiments: Sequence[str]) -> BenchFile:
    """The optional bench.toml of a folder with these experiments; unknown keys are refused."""
    if not path.exists():
        return BenchFile()
    try:
        text = tomllib.loads(read_whole(path, pipe=False).decode())
    except (OSError, ValueError, RecursionError) as problem:
        raise ReadError(f"{path}: cannot be read as TOML: {problem}") from None
    unknown = sorted(set(text) - set(TABLES))
    if unknown:
        raise ReadError(
            f"{path}: expected some of the tables {', '.join(TABLES)} but found {unknown[0]!r}"
            f"{nearest(unknown[0], TABLES)}"
        )
    for name, table in text.items():
        if not isinstance(table, dict):
            raise ReadError(f"{path}: expected a table [{name}] but found {name} = {str(table)[:40]!r}")
    known = {name: unit for name, unit in signals(plant).items() if name not in ("time", TRIGGER)}
    units = {name: plant.quantity(name).unit for name in plant.geometry}
    geometry = {k: _amount(f"{path}: [geometry]", k, v, units) for k, v in text.get("geometry", {}).items()}
    for name, value in geometry.items():
        q = plant.quantity(name)
        if not q.allows(value):
            raise ReadError(
                f"{path}: [geometry] {name}: expected {q.minimum:g} to {q.maximum:g} {q.unit} but found {value:g}; a "
                "number without a unit is in SI"
            )
        if q.type == "Integer" and value != int(value):
            raise ReadError(f"{path}: [geometry] {name}: expected a whole number but found {value:g}")
    noise = {k: _noise(f"{path}: [noise]", k, v, known, plant) for k, v in text.get("noise", {}).items()}
    start = {k: _start(path, k, v, experiments, plant) for k, v in text.get("start", {}).items()}
    order = {k: _begin(path, k, v, experiments) for k, v in text.get("order", {}).items()}
    if len(order) == 1:
        raise ReadError(
            f"{path}: [order] {next(iter(order))}: expected the starts of two files at least, on one clock: add that "
            "of the file before it, as 0 s"
        )
    columns = choices([f"{k}={v}" for k, v in text.get("columns", {}).items()], plant, f"{path}: [columns]")
    sampling = {k: _amount(f"{path}: [sampling]", k, v, {"rate": "Hz"}) for k, v in text.get("sampling", {}).items()}
    return BenchFile(geometry, noise, start, order, columns, sampling.get("rate"))


def _start(path: Path, name: str, value: object, experiments: Sequence[str], plant: Plant) -> str:
    """How an experiment starts, or all that are not named ("default")."""
    if name != "default":
        _experiment(path, "start", name, experiments)
    if value not in STARTS:
        raise ReadError(f"{path}: [start] {name}: expected {', '.join(STARTS)} but found {value!r}")
    if value == EQUILIBRIUM and plant.model.states and plant.model.curve is None:
        raise ReadError(
            f"{path}: [start] {name}: {plant.name} declares no equilibrium (m.equilibrium_curve) to start at; expected "
            f'"{UNKNOWN}", or "{RESTED}" for what the declaration says'
        )
    return str(value)


def _begin(path: Path, name: str, value: object, experiments: Sequence[str]) -> float:
    """When an experiment begins [s], on a clock of the whole folder."""
    _experiment(path, "order", name, experiments)
    try:
        return quantity(str(value), "s")
    except UnitError as problem:
        raise ReadError(f"{path}: [order] {name}: {problem}") from None


def _experiment(path: Path, table: str, name: str, experiments: Sequence[str]) -> None:
    if name not in experiments:
        raise ReadError(f"{path}: [{table}] there is no experiment {name!r}{nearest(name, experiments)}")


def _noise(where: str, name: str, value: object, units: Mapping[str, str], plant: Plant) -> float:
    """A standard deviation; an input that was commanded has none, a sensor always has some."""
    if name in [s.name for s in plant.inputs]:
        return _amount(where, name, value, units, least=0.0)
    why = ": no sensor is without noise; leave the line out to have it estimated"
    return _amount(where, name, value, units, why=why)


def _amount(
    where: str, name: str, value: object, units: Mapping[str, str], least: float = sys.float_info.min, why: str = ""
) -> float:
    """A number in SI units, or a text with a unit, as in `r_o = "15 mm"`; above 0, or from `least` on."""
    if name not in units:
        raise ReadError(f"{where} {name!r} is not known{nearest(name, units)} (another plant's? name it with --plant)")
    if isinstance(value, int) and abs(value) > 1e300:  # Python would not even print it
        raise ReadError(f"{where} {name}: expected a number with a unit like {units[name]!r} but found a huge integer")
    try:
        amount = quantity(str(value), units[name])
    except UnitError as problem:
        raise ReadError(f"{where} {name}: {problem}") from None
    if amount < least:
        bound = "at least" if least == 0 else "more than"
        raise ReadError(f"{where} {name}: expected {bound} 0 but found {value!r}{why}")
    return amount
