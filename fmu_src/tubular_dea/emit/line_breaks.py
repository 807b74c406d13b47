"""MathML that is too wide for its column, broken into lines: no browser breaks an equation itself.

An equation, a sum or a product that is too wide becomes a table of lines, broken before its operators; brackets around
it grow with the table. Widths are counted in letters, as the font is not known here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

WIDEST = 55.0  # letters of an equation that is left as it is: a column of the handbook at 1200 px
ROOM = 48.0  # letters in a line: less, for what tables and brackets inside each other add
LEAST = 26.0  # letters: what would be given less room is not broken, but what is around it
INDENT = 2.0  # letters by which all lines but the first are indented, as the page's style has it
SCRIPT = 0.7  # size of an index or an exponent
SPACED = 2  # letters that the space around an operator takes
SUMS, PRODUCTS = ("+", "-"), ("\u00b7", "&#xB7;")
BRACKETS = "()[]{|"


def break_lines(equation: Any) -> None:
    """Break an equation, a row of three, in place where it is too wide: what it is equal to goes below, in lines."""
    if _width(equation) <= WIDEST:
        return
    left, sign, right = list(equation.childNodes)
    _break_wide(right, ROOM - INDENT - _width(sign))
    sign.setAttribute("form", "infix")
    _in_lines(equation, [[left], [sign, right]])


def _break_wide(node: Any, room: float) -> None:
    """Break an element in place, so that it is no wider than `room` letters as far as it has operators to break at."""
    if _width(node) <= room:
        return
    if node.tagName == "mtable":
        for row in node.childNodes:
            _break_row(row.childNodes, room)
    elif node.tagName == "mfrac":
        for part in node.childNodes:
            _break_wide(part, room)
    else:
        _break_row(node.childNodes, room, node)


def _break_row(parts: Sequence[Any], room: float, node: Any = None) -> None:
    """Break what stands beside each other; a row of a table (without `node`) cannot be broken itself."""
    if not parts or parts[0].nodeType == parts[0].TEXT_NODE:
        return
    sums, products = ([p for p in parts[1:] if _text(p) in signs] for signs in (SUMS, PRODUCTS))
    widths = [_width(p) for p in parts]
    beside = sum(widths) - max(widths)
    left = room - beside  # for the widest part
    if node is not None and (sums or (products and left < LEAST < 2 * beside)):
        _break(node, sums or products, room)
        return
    wide = [p for p, width in zip(parts, widths, strict=True) if width > max(LEAST, room / 2)]
    for part in wide:
        _break_wide(part, max(LEAST, left if len(wide) == 1 else room / len(wide)))


def _break(node: Any, breaks: Sequence[Any], room: float) -> None:
    """Put the parts of a sum or a product into the lines of a table, as many into each as there is room for."""
    lines: list[list[Any]] = [[]]
    for term in _terms(node.childNodes, breaks):
        if lines[-1] and sum(map(_width, [*lines[-1], *term])) > room - INDENT * (len(lines) > 1):
            lines.append([])
        lines[-1] += term
    for number, line in enumerate(lines):
        _break_row(line, room - INDENT * (number > 0))
    if len(lines) > 1:
        _in_lines(node, lines)


def _in_lines(node: Any, lines: Sequence[Sequence[Any]]) -> None:
    """Put the parts of an element into the lines of a table."""
    table = _made(node, "mtable", [_made(node, "mtr", [_made(node, "mtd", line)]) for line in lines])
    table.setAttribute("class", "lines")
    table.setAttribute("displaystyle", "true")  # a table sets its fractions small by itself
    node.appendChild(table)


def _terms(parts: Sequence[Any], breaks: Sequence[Any]) -> list[list[Any]]:
    """The parts from one operator to the next, each with the operator before it."""
    terms: list[list[Any]] = [[]]
    for part in list(parts):
        if any(part is b for b in breaks):
            part.setAttribute("form", "infix")  # with its spaces, though it begins the line
            terms.append([])
        terms[-1].append(part)
    return [term for term in terms if term]


def _made(node: Any, kind: str, children: Sequence[Any]) -> Any:
    made = node.ownerDocument.createElement(kind)
    for child in children:
        made.appendChild(child)
    return made


def _text(node: Any) -> str:
    """What an operator is; "" for everything else."""
    return str(node.firstChild.data) if node.tagName == "mo" and node.firstChild else ""


def _width(node: Any) -> float:
    """About as many letters as the element is wide."""
    if node.nodeType == node.TEXT_NODE:
        return 1.0 if node.data.startswith("&") else float(len(node.data))
    widths = [_width(child) for child in node.childNodes]
    match node.tagName:
        case "mo":
            return 1.0 if _text(node) in BRACKETS else 1.0 + SPACED
        case "mfrac":
            return max(widths)
        case "msub" | "msup":
            return widths[0] + SCRIPT * widths[1]
        case "mtable":
            columns = [[_width(cell) for cell in row.childNodes] for row in node.childNodes]
            return sum(max(row[i] for row in columns if i < len(row)) for i in range(max(map(len, columns)))) + 1.0
        case _:
            return sum(widths)
