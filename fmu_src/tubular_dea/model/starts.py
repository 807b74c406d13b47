"""Where a model starts: as declared, and by how much each state may be off, as in a record that begins anywhere."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

from .declare import Model, Parameter, Quantity


def loosened(model: Model) -> Model:
    """The model with a parameter for every state by which it may be off at the start, 0 by default.

    The unknown of an equilibrium curve has none: it follows from the first inputs; nor has a state whose start is an
    unknown of every record anyway. States that have one keep it.
    """
    known, sought = {p.quantity.name for p in model.parameters}, unknowns(model)
    states, parameters = [], []
    for state in model.states:
        q = state.quantity
        if off_name(q.name) in known or off_name(q.name) not in sought:
            states.append(state)
            continue
        off = Quantity(off_name(q.name), q.unit, f"By how much {q.name} is off at the start", 0.0, nominal=q.nominal)
        parameters.append(Parameter(off))
        settled = None if state.equilibrium is None else state.equilibrium + off.symbol
        states.append(dataclasses.replace(state, start=state.start + off.symbol, equilibrium=settled))
    return dataclasses.replace(model, states=tuple(states), parameters=(*model.parameters, *parameters))


def off_name(state: str) -> str:
    """The parameter by which a state is off at the start."""
    return f"{state}_off_at_start"


def unknowns(model: Model) -> dict[str, float]:
    """The parameters of an unknown start, with their usual sizes (SI)."""
    curve = model.curve.unknown if model.curve else None
    free = {p.quantity.symbol for p in model.parameters if p.start == "each"}
    off = [s.quantity for s in model.states if s.quantity.name != curve and s.start not in free]
    return {off_name(q.name): q.nominal for q in off}


def started(model: Model, names: Iterable[str]) -> Model:
    """The model, loosened where one of the `names` of given values is by how much a state is off at the start."""
    declared = {p.quantity.name for p in model.parameters}
    return loosened(model) if {*names} & (unknowns(model).keys() - declared) else model
