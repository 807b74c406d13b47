"""Documentation from the declaration: equations as MathML, tables of parameters and variables, one HTML page."""

from __future__ import annotations

import html
from collections.abc import Iterable
from typing import Any

import sympy
from sympy.printing.mathml import MathMLPresentationPrinter

from .. import __version__
from ..docstrings import inline, rendered, without
from ..model import units
from ..model.declare import TIME, Definition, Delay, Model, Parameter, Quantity, State
from .line_breaks import break_lines
from .variables import Variable, variables

SCROLLS = """
.wide, .eq { overflow: auto hidden;
background: linear-gradient(to right, #fff 40%, #fff0) 0 / 2rem 100% no-repeat local,
linear-gradient(to left, #fff 40%, #fff0) 100% / 2rem 100% no-repeat local,
linear-gradient(to right, #0004, #0000) 0 / .6rem 100% no-repeat,
linear-gradient(to left, #0004, #0000) 100% / .6rem 100% no-repeat; }
"""
"""Style of what scrolls sideways in a box of its own: a shadow at the side on which there is more."""

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #1b2733; }
h1, h2 { line-height: 1.2; } h2 { margin-top: 2.2rem; border-bottom: 2px solid #c8402f; padding-bottom: .2rem; }
table { border-collapse: collapse; width: 100%; } td, th { text-align: left; padding: .25rem .7rem .25rem 0;
border-bottom: 1px solid #dde3e8; vertical-align: top; } td.n { white-space: nowrap; } code { font-size: .95em; }
pre { background: #f3f5f7; padding: 1rem; overflow-x: auto; font-size: 13px; line-height: 1.25; }
math { font-size: 1.05em; font-family: "STIX Two Math", "Cambria Math", "Latin Modern Math", "Noto Sans Math",
"DejaVu Math TeX Gyre", math; } /* "math" alone may be a font in which no root grows with what is under it */
.lines > mtr > mtd { text-align: left; padding: .1em 0; } .lines > mtr + mtr > mtd { padding-left: 1em; }
.eq { width: 0; min-width: min(100%, 36rem); max-width: 36rem; }
.note { color: #5b6b7a; font-size: .9em; } .src { color: #6b7a88; }
@media (max-width: 40rem) { td.n { white-space: normal; overflow-wrap: anywhere; min-width: 5rem; } }
"""


def page(model: Model) -> str:
    """documentation/index.html of an FMU: drawing, equations, citation, parameters, usage; opens offline."""
    return document(model.name, STYLE + SCROLLS, f"<h1>{html.escape(model.name)}</h1>{body(model)}")


def document(title: str, style: str, content: str) -> str:
    """A page of HTML that asks nothing of a network."""
    return (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{style}</style></head><body>{content}</body></html>\n"
    )


def body(model: Model, heading: str = "h2") -> str:
    """Everything that a model declares, in the order drawing, equations, parameters, interface, use; as HTML.

    How the source is used, which its docstring says under "Usage", is left out: these readers have an FMU or a plant.
    """
    listed = "".join(f"<li><code>{html.escape(e)}</code></li>" for e in model.effects)
    sections = {
        "Effects added": f"<ul>{listed}</ul>" if listed else "",
        "Equations": _equations(model.definitions),
        "State derivatives": _derivatives(model.states),
        "Delays": _delays(model.delays),
        "Samples": _samples(model) if model.discretes else "",
        "Parameters": parameter_table(model.parameters),
        "Inputs and outputs": _interface(model),
        "Use": _use(model),
    }
    told = "".join(f"<{heading}>{title}</{heading}>{text}" for title, text in sections.items() if text)
    lead = f"<p>{inline(model.description)}. tubular-dea {__version__}.</p>"
    return f"{lead}{rendered(without(model.documentation, 'Usage'))}{told}"


def changes(before: Model, after: Model) -> str:
    """The equations of `after` that `before` lacks or has otherwise, as HTML."""
    known = {d.quantity.name: d.expression for d in before.definitions}
    moved = {s.quantity.name: s.derivative for s in before.states}
    return (
        _equations(d for d in after.definitions if known.get(d.quantity.name) != d.expression)
        + _derivatives(s for s in after.states if moved.get(s.quantity.name) != s.derivative)
        + _delays(d for d in after.delays if d not in before.delays)
    )


def parameter_table(parameters: Iterable[Parameter]) -> str:
    """Parameters as an HTML table: name, value in display units, bounds, meaning, source."""
    head = "<tr><th>Name</th><th>Value</th><th>Allowed</th><th>Meaning</th><th>Source</th></tr>"
    return _table("".join(map(_parameter_row, parameters)), head)


def _table(rows: str, head: str = "") -> str:
    """A table of these rows; nothing where there are none."""
    return f"<div class=wide><table>{head}{rows}</table></div>" if rows else ""


def shown(q: Quantity) -> str:
    """A quantity's value as people read it: in its display unit, without "1" for what has no unit."""
    value = q.value or 0.0
    if q.type == "Boolean":
        return "true" if value else "false"
    unit = q.display_unit or q.unit
    number = f"{value * units.factor(q.unit, unit):.10g}"
    return number if unit == "1" else f"{number} {unit}"


def _parameter_row(parameter: Parameter) -> str:
    q = parameter.quantity
    kind = "tunable" if parameter.tunable else "fixed"
    low = "" if q.minimum is None else f"from {q.minimum:g} "
    high = "" if q.maximum is None else f"to {q.maximum:g} "
    unit = "" if q.unit == "1" else q.unit
    bounds = f"; {low}{high}{unit}".rstrip() if low or high else ""
    return (
        f"<tr><td class=n><code>{q.name}</code></td><td class=n>{shown(q)}</td><td>{kind}{bounds}</td>"
        f"<td>{inline(q.description)}</td><td class=src>{inline(q.source)}</td></tr>"
    )


def _equations(definitions: Iterable[Definition]) -> str:
    rows = "".join(
        f"<tr><td class=n><code>{d.quantity.name}</code></td><td><div class=eq>"
        f"{_math(d.quantity.symbol, d.expression)}</div><div class=note>{inline(d.quantity.description)} "
        f"[{d.quantity.unit}]</div></td><td class=src>{inline(d.quantity.source)}</td></tr>"
        for d in definitions
    )
    return _table(rows, "<tr><th>Name</th><th>Equation</th><th>Source</th></tr>")


def _derivatives(states: Iterable[State]) -> str:
    return _described((s.quantity, _math(sympy.Symbol(f"d{s.quantity.name}/dt"), s.derivative)) for s in states)


def _delays(delays: Iterable[Delay]) -> str:
    """What is another signal some time ago."""
    return _described(
        (d.quantity, _math(d.quantity.symbol, sympy.Function(d.of)(TIME - sympy.Symbol(d.by)))) for d in delays
    )


def _described(equations: Iterable[tuple[Quantity, str]]) -> str:
    """A row an equation: it, and what its quantity is."""
    return _table(
        "".join(
            f"<tr><td><div class=eq>{shown}</div><div class=note>{inline(q.description)} [{q.unit}]</div></td></tr>"
            for q, shown in equations
        )
    )


def _samples(model: Model) -> str:
    """The discretes in the order they are sampled; `x_before` is x before the sample."""
    rows = "".join(
        f"<tr><td class=n><code>{d.quantity.name}</code></td><td>{inline(d.quantity.description)} "
        f"[{d.quantity.unit}]</td></tr>"
        for d in model.discretes
    )
    return f"<p>Sampled at the start of every communication step, in this order:</p>{_table(rows)}"


def _use(model: Model) -> str:
    """How whoever has the model as an FMU drives it."""
    inputs = " and ".join(f"<code>{q.name}</code> [{q.unit}]" for q in model.inputs)
    connect = f"connect {inputs}, " if inputs else ""
    return (
        f"<p>In a tool that reads FMUs: {connect}give fixed parameters before the start and tunable ones at any time. "
        "All values are in SI units.</p>"
    )


def _interface(model: Model) -> str:
    rows = "".join(_interface_row(v) for v in variables(model) if v.causality in ("input", "output"))
    head = "<tr><th>Name</th><th></th><th>Unit</th><th>Meaning</th><th>Depends directly on</th></tr>"
    return _table(rows, head)


def _interface_row(variable: Variable) -> str:
    q = variable.quantity
    unit = q.unit if q.display_unit is None else f"{q.unit} ({q.display_unit})"
    needs = ", ".join(variable.dependencies)
    return (
        f"<tr><td class=n><code>{variable.name}</code></td><td>{variable.causality}</td><td>{unit}</td>"
        f"<td>{inline(q.description)}</td><td>{needs}</td></tr>"
    )


_GREEK = {
    "lambda": "\u03bb",
    "sigma": "\u03c3",
    "eta": "\u03b7",
    "eps": "\u03b5",
    "phi": "\u03c6",
    "rho": "\u03c1",
    "tau": "\u03c4",
    "theta": "\u03b8",
    "alpha": "\u03b1",
    "beta": "\u03b2",
    "gamma": "\u03b3",
}


class _MathML(MathMLPresentationPrinter):
    """Names as the paper sets them: Greek letters and one-letter names with an index, words as they are."""

    def _print_Symbol(self, sym: sympy.Symbol, style: str = "plain") -> Any:
        letter, _, index = sym.name.partition("_")
        if not index or not (letter in _GREEK or len(letter) == 1):
            return self._name(_GREEK.get(sym.name, sym.name))
        return self._node("msub", self._name(_GREEK.get(letter, letter)), self._name(index))

    def _print_Piecewise(self, expr: sympy.Piecewise) -> Any:
        """A brace, and a row for each value with its condition."""
        rows = []
        for value, condition in expr.args:
            words = ("otherwise",) if condition is sympy.S.true else ("if", condition)
            cells = [self._node("mtd", self._print(value))]
            cells += [self._node("mtd", self._word(w) if isinstance(w, str) else self._print(w)) for w in words]
            rows.append(self._node("mtr", *cells))
        return self._node("mrow", self._node("mo", self.dom.createTextNode("{")), self._node("mtable", *rows))

    def _word(self, text: str) -> Any:
        return self._node("mtext", self.dom.createTextNode(text))

    def _node(self, kind: str, *children: Any) -> Any:
        node = self.dom.createElement(kind)
        for child in children:
            node.appendChild(child)
        return node

    def _name(self, text: str) -> Any:
        return self._node("mi", self.dom.createTextNode(text))


def _math(left: sympy.Symbol, right: sympy.Expr) -> str:
    equation = _MathML({"mul_symbol": "dot"})._print(sympy.Eq(left, right, evaluate=False))
    break_lines(equation)
    text = equation.toxml().encode("ascii", "xmlcharrefreplace").decode()
    return f'<math displaystyle="true">{text}</math>'
