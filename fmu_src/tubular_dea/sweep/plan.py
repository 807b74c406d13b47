"""The plan of a sweep, from TOML or from the same tables in Python.

::

    name = "Displacement over pressure and voltage"
    model = "tube"                          # aorta, AssistedHeart, AorticWindkessel, tanks.py[:NAME], model.json, FMU
    plant = "tanks.py"                      # of a model.json, where it is one of your own
    tube = "closed/model.json"              # of an AssistedHeart, where it is not the paper's
    study = "rest"                          # or "trajectory"
    outputs = ["radial_displacement", "snap_through_margin"]

    [design]
    kind = "grid"                           # random, latin_hypercube, sobol, sobol_indices, one_at_a_time
    points = 1024                           # of sampled designs; seed = 1

    [run]                                   # of trajectories
    stop = "4 s"
    tolerance = 1e-6

    [set]                                   # parameters that do not vary
    h_o = "0.8 mm"

    [inputs]                                # also ramp, pulses, or { file = "beat.csv" }: see `simulate --help`
    pressure = "95 mmHg"
    voltage = "step 0 {amplitude} at 1 s"

    [vary]                                  # parameters, inputs, or names that the inputs use in braces
    amplitude = { from = "0 kV", to = "6 kV", count = 61 }
    C_1 = { mean = "333 kPa", deviation = "10 kPa" }
    eps_r = [2.6, 2.8, 3.0]
    patient = { file = "patients.csv" }     # or { patients = ["healthy", "failing"], part = "heart" }
    calibration = { model = "model.json" }  # jointly normal, from its covariance
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from ..emit.variables import guid
from ..errors import UserError
from ..files import FileError, read_whole
from ..model.declare import Model, nearest
from ..plants.plant import Plant
from .axes import units
from .axis_tables import axis
from .design import KINDS, Design, design
from .expression import Number, PlanError, number
from .inputs import Template, template
from .models import ExternalFmu, of_file, resolve
from .quantities import Quantities
from .wanted import Wanted, spelled_out, wanted

TABLES = ("name", "model", "plant", "tube", "effects", "study", "outputs", "design", "run", "set", "inputs", "vary")
RESERVED = ("row", "status", "message")


@dataclass(frozen=True)
class Plan:
    """A checked plan; everything it refers to is inside, so that any worker can carry out any part of it."""

    name: str
    model: Model | ExternalFmu
    study: str
    design: Design
    fixed: tuple[tuple[str, float], ...]
    inputs: tuple[tuple[str, Template], ...]
    stop: Number
    tolerance: float
    outputs: tuple[Wanted, ...]

    @property
    def fingerprint(self) -> str:
        """A hash of everything that determines the results."""
        model = guid(self.model) if isinstance(self.model, Model) else repr(self.model)
        rest = [repr(getattr(self, f.name)) for f in fields(self) if f.name not in ("name", "model")]
        return hashlib.sha256("\n".join([model, *rest]).encode()).hexdigest()

    @property
    def columns(self) -> dict[str, str]:
        """Every column of the results and its unit ("" for text), in order."""
        found = {"row": "1"} | units(self.design.axes)
        return found | {w.column: w.unit for w in self.outputs} | {"status": "1", "message": ""}


def read_plan(path: Path, plant: Plant | None = None) -> Plan:
    """The plan in a TOML file; files it names are taken relative to it. `PlanError` says what to correct."""
    try:
        content = tomllib.loads(read_whole(path).decode())
    except FileError as problem:
        raise PlanError(str(problem)) from None
    except UnicodeDecodeError:
        raise PlanError(
            f"{path}: expected a plan in TOML, which is UTF-8 text, but it is not: save it as UTF-8"
        ) from None
    except (ValueError, RecursionError) as problem:
        raise PlanError(f"{path}: cannot be read as TOML; expected a plan: {problem}") from None
    try:
        return make_plan(content, path.parent, plant)
    except UserError as problem:
        raise PlanError(f"{path}: {problem}") from None


def make_plan(content: Mapping[str, Any], folder: Path = Path(), plant: Plant | None = None) -> Plan:
    """A plan from the tables of the TOML form; `model` may also be a `Model`. Raises `PlanError`.

    `plant` is the one that a model.json is of, in the place of the plan's own entry.
    """
    _known("the plan", content, TABLES)
    plant = plant or of_file(content.get("plant"), folder)
    given_model = content.get("model", plant.model if plant else "TubularDEA")
    model = resolve(given_model, tuple(content.get("effects", ())), folder, content.get("tube"), plant)
    quantities = Quantities.of(model)
    study = _one_of("study", content.get("study", "trajectory"), ("trajectory", "rest"))
    run, scheme = _table(content, "run", ("stop", "tolerance")), _table(content, "design", ("kind", "points", "seed"))
    axes = [axis(name, given, quantities, folder, plant) for name, given in _table(content, "vary").items()]
    kind = _one_of("[design] kind", scheme.get("kind", "grid"), KINDS)
    made = design(kind, axes, _whole(scheme, "points", 0), _whole(scheme, "seed", 1))
    given = {
        name: template(name, text, quantities.input_unit(name), folder)
        for name, text in _table(content, "inputs").items()
    }
    inputs = _complete_inputs(given, made, quantities)
    stop = number(run.get("stop", 1.0), "s", "[run] stop")
    if stop.constant is not None and not stop.constant > 0:
        raise PlanError(f"[run] stop: expected a positive time but was given {stop.constant:g} s")
    plan = Plan(
        name=_name(content.get("name", "sweep")),
        model=model,
        study=study,
        design=made,
        fixed=tuple((n, quantities.parameter(n, v, "[set]")) for n, v in _table(content, "set").items()),
        inputs=tuple(sorted(inputs.items())),
        stop=stop,
        tolerance=_tolerance(run.get("tolerance", 1e-6)),
        outputs=_outputs(content.get("outputs"), quantities, study, stop),
    )
    _check(plan, quantities)
    return plan


# Checks -----------------------------------------------------------------------------------------------------------


def _known(place: str, given: Mapping[str, Any], names: tuple[str, ...]) -> None:
    for name in given:
        if name not in names:
            raise PlanError(f"{place} has no entry {name!r}{nearest(name, names)}")


def _table(content: Mapping[str, Any], name: str, entries: tuple[str, ...] | None = None) -> Mapping[str, Any]:
    table = content.get(name, {})
    if not isinstance(table, Mapping):
        raise PlanError(f"[{name}]: expected a table but was given {table!r}")
    if entries is not None:
        _known(f"[{name}]", table, entries)
    return table


def _one_of(place: str, given: object, names: tuple[str, ...]) -> str:
    if given not in names:
        raise PlanError(f"{place}: expected one of {', '.join(names)} but was given {given!r}")
    return str(given)


def _name(given: object) -> str:
    if not isinstance(given, str):
        raise PlanError(f"name: expected text but was given {given!r}")
    return given


def _whole(table: Mapping[str, Any], name: str, default: int) -> int:
    value = table.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise PlanError(f"[design] {name}: expected a whole number from 0 on but was given {value!r}")
    return value


def _tolerance(value: object) -> float:
    if not isinstance(value, int | float) or not 1e-12 <= value <= 1e-2:
        raise PlanError(f"[run] tolerance: expected 1e-12 to 1e-2 but was given {value!r}")
    return float(value)


def _complete_inputs(given: dict[str, Template], made: Design, quantities: Quantities) -> dict[str, Template]:
    """An input that varies and has no course of its own is held at the value that varies."""
    for column in units(made.axes):
        if column in quantities.inputs and column not in given:
            given[column] = Template("level", (Number(column),))
    return given


def _outputs(given: object, quantities: Quantities, study: str, stop: Number) -> tuple[Wanted, ...]:
    listed = given.items() if isinstance(given, Mapping) else [(None, text) for text in _list(given)]
    found = []
    for column, text in listed:
        for one in spelled_out(str(text), stop):
            found.append(wanted(one, quantities.variable_unit, study == "rest", column if one == text else None))
    if not found:
        raise PlanError('outputs: expected what is wanted of every row, for example ["final radial_displacement"]')
    return tuple(found)


def _list(given: object) -> list[object]:
    if given is not None and not isinstance(given, list | tuple):
        raise PlanError(f"outputs: expected a list or a table but was given {given!r}")
    return list(given or [])


def _check(plan: Plan, quantities: Quantities) -> None:
    """Names are used once and known; everything that varies is a parameter, an input, or used by one."""
    varied = units(plan.design.axes)
    listed = [*varied, *(w.column for w in plan.outputs)]
    for column in listed:
        if listed.count(column) > 1 or column in RESERVED:
            raise PlanError(f"the results would have two columns {column!r}; give one another name")
    for name, _ in plan.fixed:
        if name in varied:
            raise PlanError(f"[set] {name}: it is in [vary] too; keep one")
    used = (
        {n for _, t in plan.inputs for n in t.names} | set(plan.stop.names) | {n for w in plan.outputs for n in w.names}
    )
    numbers = {*(n for n, unit in varied.items() if unit), *quantities.parameters}
    for name in sorted(used - numbers):
        raise PlanError(
            f"{{{name}}}: there is no number {name!r} in [vary] or in the model{nearest(name, sorted(numbers))}"
        )
    for name, unit in varied.items():
        if unit and name not in quantities.parameters and name not in quantities.inputs and name not in used:
            known = [*quantities.parameters, *quantities.inputs]
            raise PlanError(
                f"[vary] {name}: {quantities.name} has no such parameter or input, and no input uses "
                f"{{{name}}}{nearest(name, known)}"
            )
    if plan.study == "rest" and any(t.kind != "level" for _, t in plan.inputs):
        raise PlanError("[inputs]: expected constant inputs for rest states, not steps, ramps, pulses or records")
    quantities.check_study(plan.study, plan.outputs)
