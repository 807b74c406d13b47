"""Checks and explanations: what a call may name, set and expect."""

from __future__ import annotations

import math

from .guard import Refused
from .integrator import MAX_STEPS, Unsolvable
from .stand_in import NOMINAL, VARIABLES
from .table import SlaveVariable


def variable_of(function: str, transported: str, vr: int) -> SlaveVariable:
    """The variable of a value reference, if it is of the type that the function transports."""
    if not 1 <= vr <= len(VARIABLES):
        raise Refused(f"{function}: unknown value reference {vr}; expected 1 to {len(VARIABLES)}")
    variable = VARIABLES[vr - 1]
    if variable.type != transported:
        raise Refused(
            f"{function}: {variable.name} is of type {variable.type}, not {transported}; use the function of its type"
        )
    return variable


def check_range(function: str, variable: SlaveVariable, value: float) -> None:
    """`Refused` for a value that is no finite number or out of the variable's bounds."""
    subject = f"{function}: {variable.name}"
    unit = "" if variable.unit == "1" else f" {variable.unit}"
    if not math.isfinite(value):
        in_unit = f" in{unit}" if unit else ""
        raise Refused(f"{subject}: expected a finite number{in_unit} but was given {value:g}")
    if value < variable.minimum:
        raise Refused(f"{subject}: expected at least {variable.minimum:g}{unit} but was given {value:g}")
    if value > variable.maximum:
        raise Refused(f"{subject}: expected at most {variable.maximum:g}{unit} but was given {value:g}")


def explained(failure: Unsolvable) -> str:
    """What the integrator could not do, and where it was."""
    states = sorted((v for v in VARIABLES if v.kind == "STATE"), key=lambda v: v.place)
    values = ", ".join(f"{v.name} = {value:.6g}" for v, value in zip(states, failure.x))
    where = f"at time {failure.time:.9g} with {values}; the instance is as it was before the step"
    if str(failure) == "steps":
        return (
            f"more than {MAX_STEPS} internal steps were needed: stopped {where}; use a shorter step or a "
            "larger tolerance"
        )
    if str(failure) == "minimum":
        v = min(states, key=lambda v: (failure.x[v.place] - v.minimum) / NOMINAL[v.place])
        return (
            f"{v.name} would come to {v.minimum:g}, where the equations end, {where}; check inputs and "
            "parameters, and their units"
        )
    return f"no step size, however small, solves the equations {where}; check inputs and parameters"
