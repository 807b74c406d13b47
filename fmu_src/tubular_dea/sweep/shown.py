"""Names and units of columns for display: displacement in mm, pressure in mmHg."""

from __future__ import annotations

from dataclasses import dataclass

from ..model.declare import Quantity
from ..model.units import factor
from .plan import Plan
from .quantities import Quantities

CUSTOMARY = {"Pa": "mmHg", "V": "kV", "V/m": "V/um", "m": "mm", "m3": "mL", "m3/s": "mL/s", "J": "mJ"}


@dataclass(frozen=True)
class Shown:
    """A column's label with its unit, and what its values are multiplied by."""

    label: str
    unit: str
    scale: float


def shown(plan: Plan) -> dict[str, Shown]:
    """How every numeric column is shown."""
    quantities = Quantities.of(plan.model)
    known: dict[str, Quantity] = {**quantities.variables, **quantities.parameters, **quantities.inputs}
    variables = {w.column: w.probes[0].variable for w in plan.outputs if w.probes and w.unit != "s"}
    found = {}
    for column, unit in plan.columns.items():
        quantity = known.get(variables.get(column, column))
        wanted = quantity.display_unit if quantity and quantity.display_unit and quantity.unit == unit else None
        target = wanted or (CUSTOMARY.get(unit, unit) if not quantity or column in variables else unit)
        found[column] = _shown(column, unit, target)
    return found


def _shown(column: str, unit: str, target: str) -> Shown:
    try:
        scale = factor(unit, target) if unit else 1.0
    except ValueError:  # an FMU's own unit
        scale, target = 1.0, unit
    text = column.replace("_", " ")
    target = "" if target == "1" else target
    return Shown(f"{text} [{target}]" if target else text, target, scale)
