"""Plain functions of numbers, translated from Python into C: what both languages have, and nothing else.

`step_control_header` prints the choice of step sizes.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable
from typing import Any

from .step_control import at_corner, growth, is_accepted, is_last, is_too_short, larger, resolving, smaller, wanted_next

TYPES = {"float": "double", "bool": "int", "int": "int"}
NAMES = {"inf": "INFINITY", "abs": "fabs"}
WIDTH = 118
SIGNS: dict[type[ast.AST], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.And: "&&",
    ast.Or: "||",
    ast.Not: "!",
    ast.USub: "-",
}


def c_function(function: Callable[..., Any]) -> str:
    """A `static inline` C function that computes the same, its docstring above it.

    Raises
    ------
    TypeError
        Where it has something that is not in C as it is in Python.
    """
    (node,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
    assert isinstance(node, ast.FunctionDef)
    about = textwrap.wrap(" ".join(str(ast.get_docstring(node)).split()), WIDTH, break_on_hyphens=False)
    taken = ", ".join(f"{_type(a.annotation)} {a.arg}" for a in node.args.args)
    lines = [
        "/* " + "\n * ".join(about) + " */",
        f"static inline {_type(node.returns)} {node.name}({taken})",
        "{",
        *(_statement(statement) for statement in node.body[1:]),
        "}",
    ]
    return "\n".join(lines)


def _type(annotation: ast.expr | None) -> str:
    return TYPES[ast.unparse(annotation)] if annotation else "void"


def _statement(node: ast.stmt) -> str:
    match node:
        case ast.Return(value=ast.expr() as value):
            return f"    return {_whole(value)};"
        case ast.Assign(targets=[ast.Name(id=name)], value=value):
            return f"    const double {name} = {_whole(value)};"
        case ast.If(test=test, body=[ast.Return(value=ast.expr() as value)], orelse=[]):
            return f"    if ({_whole(test)}) return {_whole(value)};"
    raise TypeError(f"expected a return, an assignment or an early return but found {ast.unparse(node)!r}")


def _term(node: ast.expr) -> str:
    """An expression as a part of another one: in brackets, but for names, numbers and calls."""
    plain = isinstance(node, ast.Name | ast.Constant | ast.Call)
    return _whole(node) if plain else f"({_whole(node)})"


def _whole(node: ast.expr) -> str:
    match node:
        case ast.Name(id=name):
            text = NAMES.get(name, name)
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            text = repr(value)
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
            text = f"{NAMES.get(name, name)}({', '.join(map(_whole, args))})"
        case ast.BinOp(left=left, op=sign, right=right) | ast.Compare(left=left, ops=[sign], comparators=[right]):
            text = f"{_term(left)} {_sign(sign)} {_term(right)}"
        case ast.UnaryOp(op=sign, operand=operand):
            text = f"{_sign(sign)}{_term(operand)}"
        case ast.BoolOp(op=sign, values=values):
            text = f" {_sign(sign)} ".join(map(_term, values))
        case ast.IfExp(test=test, body=body, orelse=otherwise):
            text = f"{_term(test)} ? {_term(body)} : {_term(otherwise)}"
        case _:
            raise TypeError(f"expected numbers, comparisons and calls but found {ast.unparse(node)!r}")
    return text


def _sign(sign: ast.AST) -> str:
    if type(sign) not in SIGNS:
        raise TypeError(f"expected one of {' '.join(SIGNS.values())} but found {type(sign).__name__}")
    return SIGNS[type(sign)]


def step_control_header() -> str:
    """`step_control.h`: the same for C; the including file has `inverse_root`."""
    translated = (smaller, larger, growth, resolving, at_corner, is_last, is_too_short, is_accepted, wanted_next)
    lines = [
        "/* The choice of step sizes, printed from emit/step_control.py. */",
        "#ifndef STEP_CONTROL_H",
        "#define STEP_CONTROL_H",
        "",
        *("\n".join([c_function(function), ""]) for function in translated),
        "#endif",
        "",
    ]
    return "\n".join(lines)
