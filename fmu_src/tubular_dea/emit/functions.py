"""The functions that are emitted from a model, in a form that every language prints alike.

A `Function` unpacks arrays into the names of the declaration, runs named assignments, and writes result arrays.
Arrays: `x` states, `u` inputs, `du` their rates, `p` parameters, `fold` the fold of the equilibrium curve,
`dx` state derivatives, `y` definitions that are put out; `v_...` tangents of the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy

from ..model.declare import TIME, EquilibriumCurve, Model, before, rate
from .jacobian import Assignment, assignments, at_rest, forward, needed, real


@dataclass(frozen=True)
class Function:
    """One emitted function: `arguments` and `results` map array names to symbols and expressions."""

    name: str
    description: str
    arguments: dict[str, list[sympy.Symbol]]
    body: list[Assignment]
    results: dict[str, list[sympy.Expr]]

    def live(self) -> list[Assignment]:
        """The assignments that the results use; the others are dropped."""
        used = self.free(self.results_flat())
        kept: list[Assignment] = []
        for name, expression in reversed(self.body):
            if real(name) in used:
                kept.append((name, expression))
                used |= self.free([expression])
        return kept[::-1]

    def used(self) -> set[sympy.Symbol]:
        """The symbols that have to be unpacked from the arguments."""
        body = self.live()
        named = {real(name) for name, _ in body}
        return self.free([*(e for _, e in body), *self.results_flat()]) - named

    def results_flat(self) -> list[sympy.Expr]:
        """All result expressions, in order."""
        return [e for expressions in self.results.values() for e in expressions]

    @staticmethod
    def free(expressions: Sequence[sympy.Expr]) -> set[sympy.Symbol]:
        """The symbols in any of the expressions."""
        return set().union(*(sympy.sympify(e).free_symbols for e in expressions))


@dataclass(frozen=True)
class Layout:
    """The symbols of a model in the order of the arrays."""

    x: list[sympy.Symbol]
    u: list[sympy.Symbol]
    du: list[sympy.Symbol]
    p: list[sympy.Symbol]
    fold: list[sympy.Symbol]
    y: list[sympy.Symbol]

    def arrays(self) -> dict[str, list[sympy.Symbol]]:
        """The arguments common to all functions of the model."""
        return {"time": [TIME], "x": self.x, "u": self.u, "du": self.du, "p": self.p, "fold": self.fold}


def layout(model: Model) -> Layout:
    """Array order: as declared; `y` holds the outputs that are definitions. The discretes are the tail of `p`:
    parameters that the model itself changes, between steps. Delayed signals are the tail of `u`, and the definitions
    among what they delay the tail of `y`."""
    defined = {d.quantity.name for d in model.definitions}
    delayed = [d.quantity for d in model.delays]
    late = [real(d.of) for d in model.delays if d.of in defined]
    outputs = [real(name) for name in model.outputs if name in defined]
    return Layout(
        x=[s.quantity.symbol for s in model.states],
        u=[q.symbol for q in (*model.inputs, *delayed)],
        du=[rate(q) for q in (*model.inputs, *delayed)],
        p=[*(p.quantity.symbol for p in model.parameters), *(d.quantity.symbol for d in model.discretes)],
        fold=[model.curve.fold.symbol] if model.curve else [],
        y=[*outputs, *(s for s in late if s not in outputs)],
    )


def functions(model: Model) -> list[Function]:
    """All functions of the model, in the order they are printed."""
    made = [_derivatives(model), _jacobian(model), _outputs(model), _tangent(model)]
    made += [_start(model), _start_tangent(model)]
    if model.curve:
        made += [_curve(model, model.curve), _curve_tangent(model, model.curve)]
    if model.discretes:
        made += [_sample_start(model), _sample(model)]
    return made


def _sample_start(model: Model) -> Function:
    """Discretes at the start."""
    arrays = layout(model)
    return Function("sample_start", "Discretes before the first sample.", {"u": arrays.u, "p": arrays.p}, [],
                    {"discrete": [sympy.sympify(d.start) for d in model.discretes]})  # fmt: skip


def _sample(model: Model) -> Function:
    """One sample of all discretes; in `p` they are as they were before it."""
    arrays = layout(model)
    p = [*(p.quantity.symbol for p in model.parameters), *(before(d.quantity) for d in model.discretes)]
    body = [(d.quantity.name, sympy.sympify(d.update)) for d in model.discretes]
    return Function("sample", "The discretes after a sample.",
                    {"time": [TIME], "x": arrays.x, "u": arrays.u, "p": p}, body,
                    {"discrete": [d.quantity.symbol for d in model.discretes]})  # fmt: skip


def _rates(model: Model) -> list[sympy.Expr]:
    return [s.derivative for s in model.states]


def _body(model: Model, expressions: Sequence[sympy.Expr]) -> list[Assignment]:
    return assignments(needed(model, expressions))


def _derivatives(model: Model) -> Function:
    rates = _rates(model)
    return Function("derivatives", "State derivatives, equation (18).", layout(model).arrays(),
                    _body(model, rates), {"dx": rates})  # fmt: skip


def _jacobian(model: Model) -> Function:
    """Row-major d(dx)/dx, and the derivative of dx along time at fixed states (inputs move at their rates)."""
    arrays = layout(model)
    rates = _rates(model)
    body = _body(model, rates)
    extra: list[Assignment] = []
    columns = []
    for symbol in arrays.x:
        added, column = forward(body, rates, {symbol: sympy.Integer(1)}, f"d_{{}}_d_{symbol}")
        extra += added
        columns.append(column)
    along_time = {TIME: sympy.Integer(1)} | dict(zip(arrays.u, arrays.du, strict=True))
    added, in_time = forward(body, rates, along_time, "d_{}_d_time")
    rows = [columns[j][i] for i in range(len(rates)) for j in range(len(rates))]
    return Function("jacobian", "d(dx)/dx by rows, and d(dx)/dt at fixed states.", arrays.arrays(),
                    [*body, *extra, *added], {"J": rows, "dx_dt": in_time})  # fmt: skip


def _outputs(model: Model) -> Function:
    arrays = layout(model)
    return Function("outputs", "The outputs that are not states.", arrays.arrays(),
                    _body(model, arrays.y), {"y": list(arrays.y)})  # fmt: skip


def _tangent(model: Model) -> Function:
    """Directional derivative of (dx, y) for a tangent of everything they depend on."""
    arrays = layout(model)
    results = [*_rates(model), *arrays.y]
    body = _body(model, results)
    tangents = {f"v_{array}": [real(f"v_{s}") for s in symbols] for array, symbols in arrays.arrays().items()}
    seeds = {s: real(f"v_{s}") for symbols in arrays.arrays().values() for s in symbols}
    added, values = forward(body, results, seeds, "v_{}")
    n = len(model.states)
    return Function("tangent", "Directional derivative of (dx, y).", arrays.arrays() | tangents,
                    [*body, *added], {"v_dx": values[:n], "v_y": values[n:]})  # fmt: skip


def _start(model: Model) -> Function:
    """Initial states as the parameters give them."""
    arrays = layout(model)
    starts = [sympy.sympify(s.start) for s in model.states]
    return Function("start", "Initial states away from equilibrium.", {"u": arrays.u, "p": arrays.p},
                    _body(model, starts), {"x": starts})  # fmt: skip


def _start_tangent(model: Model) -> Function:
    """How the initial states move with inputs and parameters."""
    arrays = layout(model)
    starts = [sympy.sympify(s.start) for s in model.states]
    body = _body(model, starts)
    seeds = {"u": arrays.u, "p": arrays.p}
    tangents = {f"v_{array}": [real(f"v_{s}") for s in symbols] for array, symbols in seeds.items()}
    added, values = forward(body, starts, {s: real(f"v_{s}") for group in seeds.values() for s in group}, "v_{}")
    return Function("start_tangent", "Directional derivative of the initial states.", seeds | tangents,
                    [*body, *added], {"v_x": values})  # fmt: skip


def _at_rest(model: Model, curve: EquilibriumCurve) -> tuple[list[Assignment], sympy.Symbol]:
    """The assignments that lead from the curve's unknown to the balance, the other states at equilibrium."""
    body = at_rest(model, [real(curve.balance)])
    named = {name for name, _ in body}
    settled = [(s.quantity.name, sympy.sympify(s.equilibrium)) for s in model.states
               if s.quantity.name != curve.unknown and s.quantity.name not in named]  # fmt: skip
    return [*settled, *body], real(curve.balance)


def _curve(model: Model, curve: EquilibriumCurve) -> Function:
    """The load that holds the model at rest at a value of the unknown, its slope, and the settled states."""
    arrays = layout(model)
    body, balance = _at_rest(model, curve)
    added, (slope,) = forward(body, [balance], {real(curve.unknown): sympy.Integer(1)}, f"d_{{}}_d_{curve.unknown}")
    return Function("equilibrium", f"{curve.load} at rest over {curve.unknown}, its slope, and the states there.",
                    {"unknown": [real(curve.unknown)], "u": arrays.u, "p": arrays.p},
                    [*body, *added], {"load": [balance], "slope": [slope], "x": list(arrays.x)})  # fmt: skip


def _curve_seeds(model: Model, curve: EquilibriumCurve) -> dict[str, list[sympy.Symbol]]:
    arrays = layout(model)
    return {"unknown": [real(curve.unknown)], "u": arrays.u, "p": arrays.p}


def _curve_tangent(model: Model, curve: EquilibriumCurve) -> Function:
    seeds = _curve_seeds(model, curve)
    body, balance = _at_rest(model, curve)
    states = layout(model).x
    added, values = forward(
        body, [balance, *states], {s: real(f"v_{s}") for group in seeds.values() for s in group}, "v_{}"
    )
    tangents = {f"v_{array}": [real(f"v_{s}") for s in symbols] for array, symbols in seeds.items()}
    return Function("equilibrium_tangent", "Directional derivative of the load and of the states at rest.",
                    seeds | tangents, [*body, *added], {"v_load": values[:1], "v_x": values[1:]})  # fmt: skip
