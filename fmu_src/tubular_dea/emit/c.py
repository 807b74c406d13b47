"""C99 from a model: `model.h` (sizes, names) and `model.c` (the functions and the variable table)."""

from __future__ import annotations

from functools import lru_cache

import sympy
from sympy import default_sort_key
from sympy.printing.c import C99CodePrinter

from ..model.declare import Delay, Model
from .functions import SCALARS, Function, functions, layout
from .solver import solver_functions
from .variables import Variable, guid, moved_by, variables

REFERENCES = (
    "/* The variable of a value reference: its place in the table from 1 on (to some hosts 0 is none), or NULL. */",
    "static inline const Variable *model_variable(unsigned reference)",
    "{",
    "    return reference - 1 < MODEL_VARIABLES ? &model_variables[reference - 1] : 0;",
    "}",
)

# C's own words, and what math.h and powers.h define: a local variable must not hide them.
_WORDS = """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while asm
    _Bool _Complex _Imaginary NAN INFINITY NULL EOF I errno
    fabs fmax fmin fmod floor ceil round trunc copysign sqrt cbrt hypot pow exp exp2 expm1 log log2 log10 log1p
    sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh erf erfc tgamma lgamma gamma
    j0 j1 jn y0 y1 yn
    square cube fourth
"""
RESERVED = frozenset(_WORDS.split())


class _CPrinter(C99CodePrinter):
    """Integer powers as products, rationals as quotients of doubles; no `pow` where a product will do."""

    def _print_Pow(self, expr: sympy.Pow) -> str:
        base, exponent = expr.as_base_exp()
        if exponent.is_Integer and 1 < abs(int(exponent)) <= 4:
            power = {2: "square", 3: "cube", 4: "fourth"}[abs(int(exponent))]
            text = f"{power}({self._print(base)})"
            return text if exponent > 0 else f"(1.0/{text})"
        return super()._print_Pow(expr)

    def _print_Float(self, expr: sympy.Float) -> str:
        return repr(float(expr))

    def _print_Piecewise(self, expr: sympy.Piecewise) -> str:
        *pieces, (last, _) = expr.args
        tests = [f"({self._print(condition)}) ? {self._print(value)} : " for value, condition in pieces]
        return f"({''.join(tests)}{self._print(last)})"

    def _print_Or(self, expr: sympy.Or) -> str:
        """With parentheses around && inside ||, which compilers ask for."""
        texts = [(isinstance(arg, sympy.And), self._print(arg)) for arg in sorted(expr.args, key=default_sort_key)]
        return " || ".join(f"({text})" if nested else text for nested, text in texts)

    def _print_Pi(self, expr: sympy.Expr) -> str:
        return "3.141592653589793"

    def _print_positive_part(self, expr: sympy.Expr) -> str:
        return f"fmax({self._print(expr.args[0])}, 0.0)"

    def _print_step(self, expr: sympy.Expr) -> str:
        return f"(({self._print(expr.args[0])}) > 0.0 ? 1.0 : 0.0)"


_PRINTER = _CPrinter({"precision": 17, "contract": False})


@lru_cache(maxsize=50_000, typed=True)
def expression(expr: sympy.Expr) -> str:
    """A sympy expression as a C expression of doubles; models that share a part print it once."""
    return str(_PRINTER.doprint(sympy.sympify(expr)))


def header(model: Model, directional: bool = True) -> str:
    """`model.h`: array sizes, identity and prototypes; and the solver's functions, for the file that asks for them.

    Without `directional`, header and source leave out `model_tangent`.
    """
    solver = solver_functions(model)
    arrays = layout(model)
    table = variables(model)
    curve = model.curve
    lines = [
        f"/* {model.name}: generated from its declaration; edit the declaration, not this file. */",
        "#ifndef MODEL_H",
        "#define MODEL_H",
        "",
        f'#define MODEL_NAME "{model.name}"',
        f'#define MODEL_GUID "{guid(model)}"',
        f"#define MODEL_NX {len(arrays.x)}",
        f"#define MODEL_NU {len(arrays.u)}",
        f"#define MODEL_NP {len(arrays.p)}",
        f"#define MODEL_ND {len(model.discretes)} /* discretes, the tail of p */",
        f"#define MODEL_DELAYS {len(model.delays)} /* delayed signals, the tail of u */",
        f"#define MODEL_NY {len(arrays.y)}",
        f"#define MODEL_VARIABLES {len(table)}",
        *(f"#define MODEL_{name} {size}" for name, size in solver.sizes.items()),
        f"#define MODEL_HAS_CURVE {1 if curve else 0}",
    ]
    if curve:
        lines += [
            f"#define CURVE_LOWER {curve.lower!r}",
            f"#define CURVE_FOLD_LOWER {curve.fold_lower!r}",
            f"#define CURVE_UPPER {curve.upper!r}",
            f"#define CURVE_UNKNOWN {[str(s) for s in arrays.x].index(curve.unknown)} /* state {curve.unknown} */",
            f"#define CURVE_LOAD {[str(s) for s in arrays.u].index(curve.load)} /* input {curve.load} */",
            f"#define CURVE_SWITCH {[str(s) for s in arrays.p].index(curve.start_switch)} /* {curve.start_switch} */",
            f"#define CURVE_MOVED_BY {{{', '.join(str(int(u in moved_by(model))) for u in arrays.u)}}} /* inputs */",
        ]
    lines += ["", '#include "powers.h"', '#include "variable.h"', "", *REFERENCES, ""]
    lines += [prototype(f) + ";" for f in functions(model, directional)]
    lines += ["", "#ifdef MODEL_SOLVER /* the equations as the integrator wants them: emit/solver.py */"]
    lines += ["#include <math.h>", "", *(definition(f, "static inline ") for f in solver.functions)]
    lines += _below(model)
    lines += ["#endif", "", "#endif", ""]
    return "\n".join(lines)


def _below(model: Model) -> list[str]:
    """`model_below`, which the integrator asks of every stage; compilers drop it where no state has a minimum."""
    tests = " | ".join(f"(x[{place}] <= {floor!r})" for place, floor in model.floors().items())
    return [
        "/* Whether a state is not above its minimum, where the equations end. */",
        "static inline int model_below(const double *x)",
        "{",
        f"    return {tests};" if tests else "    (void)x;\n    return 0;",
        "}",
        "",
    ]


def source(model: Model, directional: bool = True) -> str:
    """`model.c`: the variable table and the emitted functions."""
    lines = [
        f"/* {model.name}: generated from its declaration; edit the declaration, not this file. */",
        '#include "model.h"',
        "#include <math.h>",
        "",
        "const Variable model_variables[MODEL_VARIABLES] = {",
        *(f"    {_row(v)}," for v in variables(model)),
        "};",
        "",
        "const DelayLine model_delays[] = {",
        *(f"    {_delay_row(model, d)}," for d in model.delays),
        "    {-1, -1, -1, -1, 0, 1}};",
        "",
        "const double model_nominal[] = {"
        + (", ".join(repr(float(s.quantity.nominal)) for s in model.states) or "0 /* C has no empty arrays */")
        + "};",
        "",
        *(definition(f) for f in functions(model, directional)),
    ]
    return "\n".join(lines)


def prototype(function: Function) -> str:
    """`void model_NAME(const double *..., double *...)`; scalars by value."""
    arguments = [f"double {array}" if array in SCALARS else f"const double *{array}" for array in function.arguments]
    results = [f"double *{_out(array)}" for array in function.results]
    return f"void model_{function.name}({', '.join([*arguments, *results])})"


def definition(function: Function, storage: str = "") -> str:
    """The whole C function; only what is used is unpacked, and unused arguments are said to be so."""
    function = function.sparing(RESERVED | {_out(array) for array in function.results})
    used = function.used()
    lines = [f"/* {function.description} */", storage + prototype(function), "{"]
    for array, symbols in function.arguments.items():
        lines += _unpack(array, symbols, used)
    lines += [f"    const double {name} = {expression(e)};" for name, e in function.live()]
    for array, expressions in function.results.items():
        lines += [f"    {_out(array)}[{i}] = {expression(e)};" for i, e in enumerate(expressions)]
        lines += [] if expressions else [f"    (void)({_out(array)});"]
    return "\n".join([*lines, "}", ""])


def _out(array: str) -> str:
    return f"{array}_out"


def _unpack(array: str, symbols: list[sympy.Symbol], used: set[sympy.Symbol]) -> list[str]:
    if array in SCALARS:
        name = str(symbols[0])
        if symbols[0] not in used:
            return [f"    (void)({array});"]
        return [] if name == array else [f"    const double {name} = {array};"]
    lines = [f"    const double {s} = {array}[{i}];" for i, s in enumerate(symbols) if s in used]
    return lines or [f"    (void)({array});"]


def _delay_row(model: Model, delay: Delay) -> str:
    """Places of a delayed signal, of what it delays (input or output) and of the delay; longest delay, size."""
    arrays = layout(model)
    u, y, p = ([str(s) for s in symbols] for symbols in (arrays.u, arrays.y, arrays.p))
    is_input = delay.of in [q.name for q in model.inputs]
    places = [u.index(delay.quantity.name), u.index(delay.of) if is_input else -1]
    places += [-1 if is_input else y.index(delay.of), p.index(delay.by)]
    sizes = [float(model.quantity(delay.by).maximum or 0.0), float(delay.quantity.nominal)]
    return f"{{{', '.join(map(str, [*places, *sizes]))}}}"


def _row(variable: Variable) -> str:
    q = variable.quantity
    low = "-INFINITY" if q.minimum is None else repr(float(q.minimum))
    high = "INFINITY" if q.maximum is None else repr(float(q.maximum))
    start = repr(float(q.value or 0.0))
    return (
        f'{{"{variable.name}", "{q.unit}", {variable.kind}, {variable.index}, TYPE_{q.type.upper()}, '
        f"{variable.variability.upper()}, {low}, {high}, {start}, {int(variable.needs_fold)}}}"
    )
