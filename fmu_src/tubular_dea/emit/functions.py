"""The functions that are emitted from a model, in a form that every language prints alike.

A `Function` unpacks arrays into the names of the declaration, runs named assignments, and writes result arrays.
Arrays: `x` states, `u` inputs, `du` their rates, `p` parameters, `fold` the fold of the equilibrium curve,
`dx` state derivatives, `y` definitions that are put out; `v_...` tangents of the same.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache

import sympy

from ..model.declare import TIME, EquilibriumCurve, Model, before, rate
from .jacobian import Assignment, assignments, at_rest, forward, needed, real

SCALARS = ("time", "unknown", "v_time", "v_unknown", "shift", "load", "slope", "v_load")  # not arrays


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

    def sparing(self, reserved: Collection[str]) -> Function:
        """The same function where no name is `reserved` or that of an array it does not mean: `x` becomes `x_`.

        Names are the user's: a language's own words, and the arrays' names, are free to them too.
        """
        given = {str(s) for symbols in self.arguments.values() for s in symbols}
        names = given | {name for name, _ in self.body}
        taken = {array for array in self.arguments if array not in SCALARS} | set(reserved)
        other = {name: free_name(name, taken | names) for name in sorted(names & taken)}
        if not other:
            return self
        symbols = {real(name): real(new) for name, new in other.items()}
        return Function(
            self.name,
            self.description,
            {array: [symbols.get(s, s) for s in listed] for array, listed in self.arguments.items()},
            [(other.get(name, name), sympy.sympify(e).xreplace(symbols)) for name, e in self.body],
            {array: [sympy.sympify(e).xreplace(symbols) for e in listed] for array, listed in self.results.items()},
        )

    @staticmethod
    def free(expressions: Sequence[sympy.Expr]) -> set[sympy.Symbol]:
        """The symbols in any of the expressions."""
        return set().union(*(sympy.sympify(e).free_symbols for e in expressions))


def free_name(name: str, taken: Collection[str]) -> str:
    """`name` with as many underscores behind it as make it new."""
    while name in taken:
        name += "_"
    return name


@dataclass(frozen=True)
class ArrayLayout:
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


def layout(model: Model) -> ArrayLayout:
    """Array order: as declared; `y` holds the outputs that are definitions. The discretes are the tail of `p`:
    parameters that the model itself changes, between steps. Delayed signals are the tail of `u`, and the definitions
    among what they delay the tail of `y`."""
    defined = {d.quantity.name for d in model.definitions}
    delayed = [d.quantity for d in model.delays]
    late = [real(d.of) for d in model.delays if d.of in defined]
    outputs = [real(name) for name in model.outputs if name in defined]
    return ArrayLayout(
        x=[s.quantity.symbol for s in model.states],
        u=[q.symbol for q in (*model.inputs, *delayed)],
        du=[rate(q) for q in (*model.inputs, *delayed)],
        p=[*(p.quantity.symbol for p in model.parameters), *(d.quantity.symbol for d in model.discretes)],
        fold=[model.curve.fold.symbol] if model.curve else [],
        y=[*outputs, *(s for s in late if s not in outputs)],
    )


@lru_cache(maxsize=8)
def functions(model: Model, directional: bool = True) -> tuple[Function, ...]:
    """All functions of the model, in the order they are printed; `directional`: the tangent, the longest, too."""
    made = [_derivatives(model), _jacobian(model), _outputs(model), *([_tangent(model)] if directional else [])]
    made += [_start(model), _start_tangent(model)]
    if model.curve:
        made += [_curve(model, model.curve), _curve_tangent(model, model.curve)]
    if model.discretes:
        made += [_sample_start(model), _sample(model)]
    return tuple(made)


def _sample_start(model: Model) -> Function:
    """Discretes at the start."""
    arrays = layout(model)
    return Function(
        "sample_start",
        "Discretes before the first sample.",
        {"u": arrays.u, "p": arrays.p},
        [],
        {"discrete": [sympy.sympify(d.start) for d in model.discretes]},
    )


def _sample(model: Model) -> Function:
    """One sample of all discretes; in `p` they are as they were before it."""
    arrays = layout(model)
    p = [*(p.quantity.symbol for p in model.parameters), *(before(d.quantity) for d in model.discretes)]
    body = [(d.quantity.name, sympy.sympify(d.update)) for d in model.discretes]
    return Function(
        "sample",
        "The discretes after a sample.",
        {"time": [TIME], "x": arrays.x, "u": arrays.u, "p": p},
        body,
        {"discrete": [d.quantity.symbol for d in model.discretes]},
    )


def _rates(model: Model) -> list[sympy.Expr]:
    return [s.derivative for s in model.states]


def _body(model: Model, expressions: Sequence[sympy.Expr]) -> list[Assignment]:
    return assignments(needed(model, expressions))


def _derivatives(model: Model) -> Function:
    rates = _rates(model)
    return Function(
        "derivatives", "State derivatives, equation (18).", layout(model).arrays(), _body(model, rates), {"dx": rates}
    )


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
    return Function(
        "jacobian",
        "d(dx)/dx by rows, and d(dx)/dt at fixed states.",
        arrays.arrays(),
        [*body, *extra, *added],
        {"J": rows, "dx_dt": in_time},
    )


def _outputs(model: Model) -> Function:
    arrays = layout(model)
    return Function(
        "outputs", "The outputs that are not states.", arrays.arrays(), _body(model, arrays.y), {"y": list(arrays.y)}
    )


def _tangent(model: Model) -> Function:
    """Directional derivative of (dx, y) for a tangent of everything they depend on."""
    arrays = layout(model)
    results = [*_rates(model), *arrays.y]
    body = _body(model, results)
    tangents, added, values = _along(model, body, results, arrays.arrays())
    n = len(model.states)
    return Function(
        "tangent",
        "Directional derivative of (dx, y).",
        arrays.arrays() | tangents,
        [*body, *added],
        {"v_dx": values[:n], "v_y": values[n:]},
    )


def _along(
    model: Model, body: list[Assignment], results: Sequence[sympy.Expr], seeds: dict[str, list[sympy.Symbol]]
) -> tuple[dict[str, list[sympy.Symbol]], list[Assignment], list[sympy.Expr]]:
    """Tangents of the arrays `seeds` as more arguments, and what leads from them to the tangents of `results`.

    The tangent of `x` is called `v_x`, with more underscores where a quantity has such a name.
    """
    prefix = "v_"
    while any(name.startswith(prefix) for name in model.quantities()):
        prefix += "_"
    along = {s: real(f"{prefix}{s}") for symbols in seeds.values() for s in symbols}
    arguments = {f"v_{array}": [along[s] for s in symbols] for array, symbols in seeds.items()}
    return arguments, *forward(body, results, along, f"{prefix}{{}}")


def _start(model: Model) -> Function:
    """Initial states as the parameters give them."""
    arrays = layout(model)
    body, starts = _starts(model)
    return Function(
        "start", "Initial states away from equilibrium.", {"u": arrays.u, "p": arrays.p}, body, {"x": starts}
    )


def _start_tangent(model: Model) -> Function:
    """How the initial states move with inputs and parameters."""
    arrays = layout(model)
    body, starts = _starts(model)
    seeds = {"u": arrays.u, "p": arrays.p}
    tangents, added, values = _along(model, body, starts, seeds)
    return Function(
        "start_tangent",
        "Directional derivative of the initial states.",
        seeds | tangents,
        [*body, *added],
        {"v_x": values},
    )


def _starts(model: Model) -> tuple[list[Assignment], list[sympy.Expr]]:
    """Start of every state, each after the definitions and the other starts it uses: inputs are what they are at the
    start (delayed ones too) and do not move yet."""
    late = {d.quantity.symbol: real(d.of) for d in model.delays}
    still = {rate(q): sympy.Integer(0) for q in (*model.inputs, *(d.quantity for d in model.delays))}
    starts = {s.quantity.symbol: sympy.sympify(s.start).xreplace(late) for s in model.states}
    defined = {d.quantity.symbol: sympy.sympify(d.expression).xreplace(late).xreplace(still) for d in model.definitions}
    left = defined | starts
    body: list[Assignment] = []

    def place(symbol: sympy.Symbol) -> None:
        expression = left.pop(symbol)
        for used in sorted(expression.free_symbols, key=str):
            if used in left:
                place(used)
        body.append((str(symbol), expression))

    for symbol in starts:
        if symbol in left:
            place(symbol)
    return body, list(starts.values())


def _at_rest(model: Model, curve: EquilibriumCurve) -> tuple[list[Assignment], sympy.Symbol]:
    """The assignments that lead from the curve's unknown to the balance, the other states at equilibrium."""
    body = at_rest(model, [real(curve.balance)])
    named = {name for name, _ in body}
    settled = [
        (s.quantity.name, sympy.sympify(s.equilibrium))
        for s in model.states
        if s.quantity.name != curve.unknown and s.quantity.name not in named
    ]
    return [*settled, *body], real(curve.balance)


def _curve(model: Model, curve: EquilibriumCurve) -> Function:
    """The load that holds the model at rest at a value of the unknown, its slope, and the settled states."""
    arrays = layout(model)
    body, balance = _at_rest(model, curve)
    added, (slope,) = forward(body, [balance], {real(curve.unknown): sympy.Integer(1)}, f"d_{{}}_d_{curve.unknown}")
    return Function(
        "equilibrium",
        f"{curve.load} at rest over {curve.unknown}, its slope, and the states there.",
        {"unknown": [real(curve.unknown)], "u": arrays.u, "p": arrays.p},
        [*body, *added],
        {"load": [balance], "slope": [slope], "x": list(arrays.x)},
    )


def _curve_seeds(model: Model, curve: EquilibriumCurve) -> dict[str, list[sympy.Symbol]]:
    arrays = layout(model)
    return {"unknown": [real(curve.unknown)], "u": arrays.u, "p": arrays.p}


def _curve_tangent(model: Model, curve: EquilibriumCurve) -> Function:
    seeds = _curve_seeds(model, curve)
    body, balance = _at_rest(model, curve)
    states = layout(model).x
    tangents, added, values = _along(model, body, [balance, *states], seeds)
    return Function(
        "equilibrium_tangent",
        "Directional derivative of the load and of the states at rest.",
        seeds | tangents,
        [*body, *added],
        {"v_load": values[:1], "v_x": values[1:]},
    )
