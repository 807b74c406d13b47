"""Numbers in a plan that may differ from row to row: "{name}" or arithmetic on names, "{0.3 / heart_rate}"."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from ..errors import UserError
from ..model.declare import nearest
from ..model.units import quantity

Values = Mapping[str, np.ndarray | float]

_OPERATORS: dict[type, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


class PlanError(UserError, ValueError):
    """A plan that cannot be carried out; the text names the place in it and what was expected."""


@dataclass(frozen=True)
class Number:
    """A constant in SI units, or an expression in braces whose names stand for numbers in SI units."""

    text: str
    constant: float | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The names that the expression uses."""
        if self.constant is not None:
            return ()
        return tuple(sorted({node.id for node in ast.walk(_tree(self.text)) if isinstance(node, ast.Name)}))

    def __call__(self, values: Values) -> np.ndarray:
        """Its value for every row, shape (rows, 1); (1, 1) where it is the same for all."""
        with np.errstate(all="ignore"):  # a row that divides by zero says so itself
            value = self.constant if self.constant is not None else _evaluate(_tree(self.text), values, self.text)
        return np.reshape(np.asarray(value, float), (-1, 1))


def number(text: str | float, unit: str, place: str) -> Number:
    """A number from a plan: 0.3, "95 mmHg", "{name}"; `PlanError` naming `place` for anything else."""
    if isinstance(text, str) and text.strip().startswith("{"):
        inner = text.strip()[1:].removesuffix("}").strip()
        try:
            _check(_tree(inner), inner)
        except (SyntaxError, PlanError):
            raise PlanError(
                f"{place}: cannot read {text!r}; expected a name or arithmetic (+ - * /) on names in braces"
            ) from None
        return Number(inner)
    if isinstance(text, bool) or not isinstance(text, str | int | float):
        raise PlanError(f"{place}: expected a number or text like '1 {unit}' but was given {text!r}")
    try:
        return Number(str(text), quantity(str(text), unit))
    except UserError as problem:
        raise PlanError(f"{place}: {problem}") from None


@cache
def _tree(text: str) -> ast.expr:
    return ast.parse(text, mode="eval").body


def _check(node: ast.expr, text: str) -> None:
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        _check(node.left, text)
        _check(node.right, text)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        _check(node.operand, text)
    elif not (isinstance(node, ast.Name) or (isinstance(node, ast.Constant) and isinstance(node.value, int | float))):
        raise PlanError(text)


def _evaluate(node: ast.expr, values: Values, text: str) -> np.ndarray:
    if isinstance(node, ast.Name):
        if node.id not in values:
            raise PlanError(f"{{{text}}}: there is no number {node.id!r}{nearest(node.id, values)}")
        return np.asarray(values[node.id], float)
    if isinstance(node, ast.BinOp):
        return _OPERATORS[type(node.op)](_evaluate(node.left, values, text), _evaluate(node.right, values, text))
    if isinstance(node, ast.UnaryOp):
        return -_evaluate(node.operand, values, text)
    assert isinstance(node, ast.Constant) and isinstance(node.value, int | float)
    return np.asarray(node.value, float)
