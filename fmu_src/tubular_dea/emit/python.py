"""Plain Python from a model: right-hand side, exact Jacobian, outputs and sensitivities.

The emitted text needs nothing but the standard library's `math`. Its functions take and return tuples in the
order of `layout(model)` and read like the paper: one named intermediate a line, integer powers as products.

Usage::

    print(source(model))                # a module, to read or to keep
    plain = compile_python(model)       # the same module, ready to use
    p = tuple(plain.PARAMETERS.values())
    plain.derivatives(0.0, x, u, du, p, fold)    # dx/dt
    plain.jacobian(0.0, x, u, du, p, fold)       # rows of d(dx)/dx, and d(dx)/dt
    plain.tangent(0.0, x, u, du, p, fold, 0.0, v_x, v_u, v_du, v_p, v_fold)    # change of (dx, y) along v
"""

from __future__ import annotations

import keyword
from collections.abc import Mapping
from types import SimpleNamespace

import sympy
from sympy.printing.pycode import PythonCodePrinter

from ..model.declare import Model
from .elimination import linear_algebra
from .functions import SCALARS, Function, functions, layout

WIDTH = 110
POWERS = {2: "square", 3: "cube", 4: "fourth"}
HELPERS = """\
def square(a):
    return a * a


def cube(a):
    return a * a * a


def fourth(a):
    return (a * a) * (a * a)
"""


RESERVED = frozenset([*keyword.kwlist, *POWERS.values(), "math", "max", "min", "abs", "float"])


class _PythonPrinter(PythonCodePrinter):
    """Integer powers as products: written out for names and short sums, by a helper for all else."""

    def _print_Pow(self, expr: sympy.Pow, rational: bool = False) -> str:
        base, exponent = expr.as_base_exp()
        if not (exponent.is_Integer and 1 < abs(int(exponent)) <= 4):
            return str(super()._print_Pow(expr, rational=rational))
        power = abs(int(exponent))
        text = self._print(base)
        if power < 4 and (base.is_Symbol or _is_short_sum(base)):
            factor = text if base.is_Symbol else f"({text})"
            text = f"({'*'.join([factor] * power)})"
        else:
            text = f"{POWERS[power]}({text})"
        return text if exponent > 0 else f"(1.0/{text})"

    def _print_Float(self, expr: sympy.Float) -> str:
        return repr(float(expr))

    def _print_positive_part(self, expr: sympy.Expr) -> str:
        return f"max({self._print(expr.args[0])}, 0.0)"

    def _print_step(self, expr: sympy.Expr) -> str:
        return f"(1.0 if {self._print(expr.args[0])} > 0.0 else 0.0)"


def _is_short_sum(base: sympy.Expr) -> bool:
    """Cheaper to calculate twice than to call a function: `x - 1`."""
    return bool(base.is_Add) and len(base.args) == 2 and all(a.is_Symbol or a.is_Number for a in base.args)


_PRINTER = _PythonPrinter({"fully_qualified_modules": True})


def expression(expr: sympy.Expr) -> str:
    """A sympy expression as a Python expression of floats."""
    return str(_PRINTER.doprint(sympy.sympify(expr)))


def source(model: Model) -> str:
    """The whole module: names and values of what is declared, then `equations(model)`."""
    return "\n".join(
        [
            '"""',
            model.documentation.strip().replace("\\", "\\\\"),
            '"""',
            "",
            "import math",
            "",
            names(model),
            "",
            equations(model),
        ]
    )


def names(model: Model) -> str:
    """`STATES`, `INPUTS`, `OUTPUTS` in the order of their tuples, and `PARAMETERS` with their values (SI)."""
    arrays = layout(model)
    lines: list[str] = []
    for title, symbols in (("STATES", arrays.x), ("INPUTS", arrays.u), ("OUTPUTS", arrays.y)):
        lines += tuple_lines(f"{title} = ", [f'"{s}"' for s in symbols])
    rows = [
        f'    "{q.name}": {float(q.value or 0.0)!r},  # {q.unit}: {q.description}'
        for q in (p.quantity for p in model.parameters)
    ]
    return "\n".join([*lines, "PARAMETERS = {", *rows, "}"]) + "\n"


def equations(model: Model) -> str:
    """All functions of the model, and the helpers for powers."""
    return "\n\n".join([HELPERS, *(definition(f, sources(model)) for f in functions(model))])


def sources(model: Model) -> dict[str, str]:
    """Where each definition comes from: "Eq. (8)"."""
    return {d.quantity.name: d.quantity.source for d in model.definitions if d.quantity.source}


def definition(function: Function, remarks: Mapping[str, str] | None = None) -> str:
    """The whole Python function; only what is used is unpacked. `remarks` follow the names they are on."""
    function = function.sparing(RESERVED)
    used = function.used()
    lines = [f"def {function.name}({', '.join(function.arguments)}):", f'    """{function.description}"""']
    for array, symbols in function.arguments.items():
        lines += _unpack(array, symbols, used)
    for name, value in function.live():
        remark = (remarks or {}).get(name, "")
        lines += wrapped(f"    {name} = ", expression(value), f"  # {remark}" if remark else "")
    return "\n".join([*lines, *_returned(function), ""])


def compile_python(model: Model) -> SimpleNamespace:
    """The module of `source(model)` as a namespace; the one place where emitted Python is executed."""
    namespace: dict[str, object] = {"__name__": f"{model.name}_equations"}
    exec(compile(source(model), f"<{model.name} in plain Python>", "exec"), namespace)
    return SimpleNamespace(**{name: value for name, value in namespace.items() if not name.startswith("__")})


def integrator_functions(model: Model) -> str:
    """What a Rosenbrock method calls besides `derivatives`, for J reduced to its entries that are not zero:

    `linearise(...)` gives the state derivatives, these entries and d(dx)/dt; `multiply(J, v)`,
    `factorise(shift, J)` and `solve(L, b)`, which is k with (shift I - J) k = b, work on them. `PLACES` says
    where in the matrix they are.
    """
    by_name = {f.name: f for f in functions(model)}
    plain, full = by_name["derivatives"], by_name["jacobian"]
    n = len(layout(model).x)
    entries = [sympy.sympify(e) for e in full.results["J"]]
    places = [(i, j) for i in range(n) for j in range(n) if entries[i * n + j] != 0]
    kept = [entries[i * n + j] for i, j in places]
    reduced = {"dx": plain.results["dx"], "J": kept, "dx_dt": full.results["dx_dt"]}
    text = "State derivatives, d(dx)/dx at `PLACES`, and d(dx)/dt at fixed states."
    linearise = Function("linearise", text, full.arguments, full.body, reduced)
    listed = "\n".join(tuple_lines("PLACES = ", [str(place) for place in places])) + "\n"
    written = [definition(f, sources(model)) for f in (linearise, *linear_algebra(n, places)[0])]
    return "\n\n".join([listed, *written])


def _unpack(array: str, symbols: list[sympy.Symbol], used: set[sympy.Symbol]) -> list[str]:
    wanted = [(i, s) for i, s in enumerate(symbols) if s in used]
    if array in SCALARS:
        return [f"    {s} = {array}" for _, s in wanted if str(s) != array]
    if len(wanted) == len(symbols) > 1:
        return unpacked([str(s) for s in symbols], array)
    return [f"    {s} = {array}[{i}]" for i, s in wanted]


def _returned(function: Function) -> list[str]:
    """`return` of the one result, or of all of them as a tuple."""
    if len(function.results) == 1:
        ((array, expressions),) = function.results.items()
        return _result("    return ", array, expressions, function)
    lines = ["    return ("]
    for array, expressions in function.results.items():
        lines += _result("        ", array, expressions, function, ",")
    return [*lines, "    )"]


def _result(before: str, array: str, expressions: list[sympy.Expr], function: Function, after: str = "") -> list[str]:
    """A number, a tuple, or, for a matrix, the tuple of its rows."""
    texts = [expression(e) if e.free_symbols else repr(float(e)) for e in map(sympy.sympify, expressions)]
    if array in SCALARS:
        return wrapped(before, texts[0], after)
    if function.name != "jacobian" or array != "J":
        return tuple_lines(before, texts, after)
    n = len(function.arguments["x"])
    indent = " " * (len(before) - len(before.lstrip()))
    rows = [tuple_lines(f"{indent}    ", texts[i * n : (i + 1) * n], ",") for i in range(n)]
    return [f"{before}(", *(line for row in rows for line in row), f"{indent}){after}"]


def unpacked(targets: list[str], array: str) -> list[str]:
    """`a, b = array`, over several lines where there are many; nothing where there is none."""
    if not targets:
        return []
    line = f"    {', '.join(targets)}{',' if len(targets) == 1 else ''} = {array}"
    return [line] if len(line) <= WIDTH else tuple_lines("    ", targets, f" = {array}")


def tuple_lines(before: str, texts: list[str], after: str = "") -> list[str]:
    """A tuple on one line, or one element a line."""
    line = f"{before}({', '.join(texts)}{',' if len(texts) == 1 else ''}){after}"
    if len(line) <= WIDTH:
        return [line]
    indent = " " * (len(before) - len(before.lstrip()))
    elements = [line for text in texts for line in wrapped(f"{indent}    ", text, ",")]
    return [f"{before}(", *elements, f"{indent}){after}"]


def wrapped(before: str, text: str, after: str = "") -> list[str]:
    """One line, or the text in brackets over several lines, broken in front of its outermost sums."""
    if len(before + text + after) <= WIDTH:
        return [before + text + after]
    indent = " " * (len(before) - len(before.lstrip()))
    room = WIDTH - len(indent) - 4
    depth = 0
    while max(map(len, _broken(text, depth))) > room and depth < text.count("("):
        depth += 1
    lines = [""]
    for piece in _broken(text, depth):
        joined = f"{lines[-1]} {piece}".strip()
        if len(joined) <= room:
            lines[-1] = joined
        else:
            lines.append(piece)
    return [f"{before}(", *(f"{indent}    {line}" for line in lines), f"{indent}){after}"]


def _broken(text: str, depth: int) -> list[str]:
    """The text cut in front of every " + " and " - ", and after every ", ", in at most `depth` brackets."""
    pieces, level = [""], 0
    for i, character in enumerate(text):
        level += (character in "([") - (character in ")]")
        cut = text[i + 1 : i + 3] in ("+ ", "- ") or text[i - 1] == ","
        if character == " " and level <= depth and cut:
            pieces.append("")
        else:
            pieces[-1] += character
    return pieces
