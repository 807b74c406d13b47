"""What a plan may name in its model, whether it is the package's own or an FMU made elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import UserError
from ..kernel.checks import fractional
from ..model.declare import Model, Quantity, nearest
from ..model.units import quantity
from .expression import PlanError
from .models import ExternalFmu
from .unpacked import declared
from .wanted import Wanted


@dataclass(frozen=True)
class Quantities:
    """Parameters, inputs and variables by name."""

    name: str
    parameters: dict[str, Quantity]
    inputs: dict[str, Quantity]
    variables: dict[str, Quantity]
    has_curve: bool

    @staticmethod
    def of(model: Model | ExternalFmu) -> Quantities:
        """Those of a model."""
        if isinstance(model, ExternalFmu):
            found = declared(model)
            return Quantities(model.name, found.parameters, found.inputs, found.variables, False)
        variables = model.quantities()
        parameters = {p.quantity.name: p.quantity for p in model.parameters}
        inputs = {q.name: q for q in model.inputs}
        if model.curve:
            unknown = model.quantity(model.curve.unknown)
            variables |= {n: Quantity(n, unknown.unit, "") for n in ("fold_place", "beyond_fold")}
        observed = {n: q for n, q in variables.items() if n not in parameters}
        return Quantities(model.name, parameters, inputs, observed, model.curve is not None)

    def input_unit(self, name: str) -> str:
        """The unit of an input; `PlanError` with the nearest names if there is none."""
        if name not in self.inputs:
            raise PlanError(f"[inputs] {self.name} has no input {name!r}{nearest(name, self.inputs)}")
        return self.inputs[name].unit

    def variable_unit(self, name: str) -> str:
        """The unit of a variable; `PlanError` with the nearest names if there is none."""
        if name not in self.variables:
            raise PlanError(f"outputs: {self.name} has no variable {name!r}{nearest(name, self.variables)}")
        return self.variables[name].unit

    def parameter(self, name: str, given: object, place: str) -> float:
        """The value of a parameter in SI units from 0.001, "1 mm" or true; checked against its bounds."""
        if name not in self.parameters:
            raise PlanError(f"{place} {self.name} has no parameter {name!r}{nearest(name, self.parameters)}")
        try:
            value = float(given) if isinstance(given, bool) else quantity(str(given), self.parameters[name].unit)
        except UserError as problem:
            raise PlanError(f"{place} {name}: {problem}") from None
        self.check_bounds(name, value, place)
        return value

    def check_bounds(self, name: str, value: float, place: str) -> None:
        """`PlanError` where the value is outside the parameter's bounds, or of an integer between two."""
        q = self.parameters[name]
        if fractional(q, np.array(value)):
            raise PlanError(f"{place} {name}: expected a whole number but was given {value:g}")
        if not q.allows(value):
            low = -float("inf") if q.minimum is None else q.minimum
            high = float("inf") if q.maximum is None else q.maximum
            raise PlanError(f"{place} {name}: expected {low:g} to {high:g} {q.unit} but was given {value:g}")

    def check_study(self, study: str, outputs: Sequence[Wanted]) -> None:
        """`PlanError` where rest states or snap-through are wanted of a model without an equilibrium curve."""
        about_fold = [w.description for w in outputs for p in w.probes if p.variable == "beyond_fold"]
        if not self.has_curve and (study == "rest" or about_fold):
            what = "rest states" if study == "rest" else repr(about_fold[0])
            raise PlanError(f"{self.name} has no equilibrium curve; {what} cannot be computed")
