"""Why a trajectory ended before its time, in words."""

from __future__ import annotations

from ..model.declare import Model


def _floors(model: Model) -> str:
    """In words, that a state reached its minimum."""
    names = [f"{model.states[place].quantity.name} would come to {floor:g}" for place, floor in model.floors().items()]
    return " or ".join(names)


def _load(model: Model) -> str:
    return model.curve.load if model.curve else "the load"


def failure(model: Model, status: int, time: float) -> str:
    """Why a trajectory ended at `time` [s], from the status that C gave."""
    reasons = {
        -1: f"there is no rest state to start at: {_load(model)} is beyond the fold; lower it, change the other "
        "inputs, or do not start at equilibrium",
        2: "too many internal steps were needed; use a larger tolerance",
        3: "no step size, however small, solves the equations; check inputs and parameters",
        4: f"{_floors(model)}, where the equations end; check start, inputs and parameters",
    }
    return f"the trajectory ended at {time:.6g} s: {reasons.get(status, f'status {status}')}"
