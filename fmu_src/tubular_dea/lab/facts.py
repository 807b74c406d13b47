"""The facts of models for the page: names, units, bounds and indices, from the declarations, as JSON."""

from __future__ import annotations

from typing import Any

from ..emit.functions import layout
from ..emit.variables import variables
from ..kernel.trajectories import needs_fold
from ..model.declare import Model, Quantity
from ..model.delays import input_delays, undelayed
from ..model.units import factor


def model_facts(model: Model) -> dict[str, Any]:
    """Inputs, states, outputs and parameters in the order of the kernel's arrays."""
    now, delayed = undelayed(model)
    arrays = layout(now)
    known = now.quantities()
    facts: dict[str, Any] = {
        "name": model.name,
        "description": model.description,
        "effects": list(model.effects),
        "inputs": [quantity_facts(q) for q in model.inputs],
        "driven": [str(s) for s in arrays.u],
        "delays": {d.quantity.name: {"of": d.of, "by": d.by} for d in input_delays(model)},
        "states": [quantity_facts(known[str(s)]) for s in arrays.x],
        "outputs": [quantity_facts(known[str(s)]) for s in arrays.y],
        "delayed": delayed,
        "needFold": needs_fold(model),
        "parameters": [
            quantity_facts(p.quantity) | {"tunable": p.tunable, "source": p.quantity.source} for p in model.parameters
        ],
    }
    curve = model.curve
    if curve:
        facts["curve"] = {
            "lower": curve.lower,
            "foldLower": curve.fold_lower,
            "upper": curve.upper,
            "unknown": str(curve.unknown),
            "load": str(curve.load),
            "fold": quantity_facts(curve.fold),
            "switch": curve.start_switch,
        }
    return facts


def quantity_facts(q: Quantity) -> dict[str, Any]:
    """A quantity for display: `shown` is the customary unit, `factor` its value in SI."""
    shown = q.display_unit or q.unit
    return {
        "name": q.name,
        "unit": q.unit,
        "shown": shown,
        "factor": factor(shown, q.unit),
        "description": q.description,
        "value": q.value,
        "minimum": q.minimum,
        "maximum": q.maximum,
        "nominal": q.nominal,
        "type": q.type,
    }


def part_facts(model: Model) -> dict[str, Any]:
    """Parameters and outputs of a part of the assisted heart with their value references."""
    table = [
        quantity_facts(v.quantity) | {"reference": i, "causality": v.causality}
        for i, v in enumerate(variables(model), start=1)
    ]
    return {
        "name": model.name,
        "parameters": [v for v in table if v["causality"] == "parameter"],
        "outputs": [v for v in table if v["causality"] == "output"],
    }
