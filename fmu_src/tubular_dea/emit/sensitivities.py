"""What the kernel needs beside the solver's functions to carry sensitivities along: exact first derivatives.

`gradients.h` holds `gradients` (state derivatives, the non-zero entries of d(dx)/dx and of d(dx)/dp at once, at every
stage of every step) and `observed` (the chosen outputs with their derivatives). They are compiled into the kernel only.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import sympy

from ..model.declare import Model
from . import c
from .functions import Function, layout
from .jacobian import ZERO, assignments, forward, needed, real
from .solver import DirectionalDerivative, Hoisted, arranged_rates, cheapened, rate_tangents

Entry = tuple[int, int]


def header(model: Model, observed: Sequence[str]) -> str:
    """`gradients.h`: sizes, prototypes, and for every entry its row and column. `observed` are names of outputs."""
    seeds = columns(model)
    functions, places, entries = _gradients(model, seeds)
    outputs, output_entries = _observed(model, seeds, observed)
    lines = [
        f"/* {model.name}: generated from its declaration; edit the declaration, not this file. */",
        "#ifndef GRADIENTS_H",
        "#define GRADIENTS_H",
        "",
        f"#define GRADIENTS_NQ {len(functions[0].results['prepared'])}",
        f"#define GRADIENTS_NP {len(entries)}",
        f"#define COLUMNS {len(seeds)} /* {' '.join(map(str, seeds))} */",
        f"#define OBSERVED {len(observed)} /* {' '.join(observed)} */",
        f"#define OBSERVED_N {len(output_entries)}",
        "",
        "/* Entries of d(dx)/dx, of d(dx)/d(columns), and of d(observed)/d(states, then columns, then inputs). */",
        _integers("J_ROW", [row for row, _ in places]),
        _integers("J_COLUMN", [column for _, column in places]),
        _integers("P_ROW", [row for row, _ in entries]),
        _integers("P_COLUMN", [column for _, column in entries]),
        "/* The parameter of each column, or -1 and the place among the inputs of the delayed signal. */",
        _integers("COLUMN_PARAMETER", [_place(s, layout(model).p) for s in seeds]),
        _integers("COLUMN_INPUT", [_place(s, layout(model).u) for s in seeds]),
        _integers("OBSERVED_ROW", [row for row, _ in output_entries]),
        _integers("OBSERVED_COLUMN", [column for _, column in output_entries]),
        "",
        *(c.prototype(f) + ";" for f in [*functions, outputs]),
        "",
        "#endif",
        "",
    ]
    return "\n".join(lines)


def source(model: Model, observed: Sequence[str]) -> str:
    """`gradients.c`: the functions."""
    seeds = columns(model)
    functions = [*_gradients(model, seeds)[0], _observed(model, seeds, observed)[0]]
    lines = [
        f"/* {model.name}: generated from its declaration; edit the declaration, not this file. */",
        '#include "gradients.h"',
        '#include "powers.h"',
        "#include <math.h>",
        "",
        *(c.definition(f) for f in functions),
    ]
    return "\n".join(lines)


def columns(model: Model) -> tuple[sympy.Symbol, ...]:
    """What sensitivities can be taken to: real parameters that are tunable or set a start value, then the delayed
    signals (in the place of delays)."""
    starts = [sympy.sympify(s.start) for s in model.states]
    used = Function.free([*starts, *(d.expression for d in needed(model, starts))])
    varied = [p.quantity for p in model.parameters if p.tunable or p.quantity.symbol in used]
    return (*(q.symbol for q in varied if q.type == "Real"), *(d.quantity.symbol for d in model.delays))


@lru_cache(maxsize=8)
def _gradients(model: Model, seeds: tuple[sympy.Symbol, ...]) -> tuple[list[Function], list[Entry], list[Entry]]:
    """prepare and gradients, and the (row, column) of each entry of J and of d(dx)/d(seeds) that is not zero."""
    body, rates = arranged_rates(model)
    states, _ = rate_tangents(model, body, rates)
    along = [_along(body, rates, seed) for seed in seeds]
    n = len(rates)
    places = [(i, j) for i in range(n) for j in range(n) if states[j].values[i] != ZERO]
    entries = [(i, j) for i in range(n) for j in range(len(seeds)) if along[j].values[i] != ZERO]
    hoisted = Hoisted(set(layout(model).p), set(model.quantities()))
    arguments = {k: v for k, v in layout(model).arrays().items() if k not in ("p", "fold")}
    results = {
        "dx": rates,
        "J": [states[j].values[i] for i, j in places],
        "P": [along[j].values[i] for i, j in entries],
    }
    added = [a for tangent in [*states, *along] for a in tangent.added]
    description = "State derivatives and their exact derivatives."
    function = Function("gradients", description, arguments, [*body, *added], results)
    x = [s.name for s in layout(model).x]
    names = {
        "dx": [f"der_{a}" for a in x],
        "J": [f"d_der_{x[i]}_d_{x[j]}" for i, j in places],
        "P": [f"d_der_{x[i]}_d_{seeds[j]}" for i, j in entries],
    }
    cheap = cheapened(function, names, hoisted)
    q = hoisted.symbols()
    prepare = hoisted.prepare(layout(model).p)
    return (
        [
            Function("prepare_gradients", prepare.description, prepare.arguments, prepare.body, prepare.results),
            Function(cheap.name, cheap.description, cheap.arguments | {"prepared": q}, cheap.body, cheap.results),
        ],
        places,
        entries,
    )


def _along(
    body: list[tuple[str, sympy.Expr]], rates: Sequence[sympy.Expr], seed: sympy.Symbol
) -> DirectionalDerivative:
    return DirectionalDerivative(*forward(body, rates, {seed: sympy.Integer(1)}, f"d_{{}}_d_{seed}"))


def _observed(model: Model, seeds: Sequence[sympy.Symbol], observed: Sequence[str]) -> tuple[Function, list[Entry]]:
    """The outputs `observed` with their derivatives; (row, column) of each entry: states, then `seeds`, then inputs."""
    arrays = layout(model)
    results = [real(name) for name in observed]
    for name in observed:
        model.quantity(name)
    body = assignments(needed(model, results))
    tangents = [_along(body, results, symbol) for symbol in [*arrays.x, *seeds, *arrays.u[: len(model.inputs)]]]
    entries = [(i, j) for i in range(len(results)) for j in range(len(tangents)) if tangents[j].values[i] != ZERO]
    values = [tangents[j].values[i] for i, j in entries]
    return Function(
        "observed",
        "The observed outputs and their derivatives.",
        arrays.arrays(),
        [*body, *(a for t in tangents for a in t.added)],
        {"y": results, "Y": values},
    ), entries


def _place(symbol: sympy.Symbol, symbols: Sequence[sympy.Symbol]) -> int:
    return symbols.index(symbol) if symbol in symbols else -1


def _integers(name: str, values: Sequence[int]) -> str:
    return f"static const int {name}[] = {{{', '.join(map(str, [*values, -1]))}}};"
