"""What went wrong in a plant file, in one line: file, line, what was declared there, and what to do."""

from __future__ import annotations

import builtins
import difflib
import inspect
import linecache
import re
import sys
import traceback
from collections.abc import Iterable
from pathlib import Path

from ..model.declare import DeclarationError, nearest

LONGEST = 70  # characters of a line of the file in a message
DECIDED = "{0} is not known while the file is read: write step({1}), positive_part({1}) or sympy.Piecewise"
FUNCTIONS = ("sqrt", "exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh", "Piecewise", "Abs", "Max", "Min", "pi")
MODULES = ("math", "np", "numpy", "cmath")
FOR_NUMBERS = " for numbers, and this is a quantity: import the function from sympy, as in `from sympy import tanh`"
ADVICE = (  # what Python, NumPy and sympy say of quantities that are taken for numbers, and what to do instead
    (r"cannot determine truth value of Relational: (.*)", DECIDED),
    (
        r"unsupported operand type\(s\) for .*: '\w+' and '(?:Strict)?(?:Greater|Less)Than'",
        "a comparison is no number: write step(x), which is 1 where x > 0, or sympy.Piecewise",
    ),
    (
        r"loop of ufunc does not support argument \d+ of type \w+ which has no callable (\w+) method",
        "NumPy's {0} is" + FOR_NUMBERS,
    ),
    (r"Cannot convert expression to float", "a function of the module math is" + FOR_NUMBERS),
    (r"must be real number, not (?:Symbol|Mul|Add|Pow)", "a function of the module math is" + FOR_NUMBERS),
)


def message(path: Path, problem: BaseException) -> str:
    """The one line for an exception that a plant file raised."""
    if isinstance(problem, SyntaxError):
        line = f", line {problem.lineno}" if problem.lineno else ""
        return f"{path}{line}: cannot be read as Python: {problem.msg}"
    said = " ".join(str(problem).split())
    named = re.match(rf"{re.escape(path.name)}, line (\d+): ", said)
    line_number = int(named[1]) if named else _line(path, problem)
    where = f"{path}, line {line_number}" if line_number else str(path)
    said = said[named.end() :] if named else said
    if isinstance(problem, DeclarationError):
        return f"{where}: {said}"
    if keyword := _keyword(said):
        return f"{where}: {keyword}"
    said += _meant(problem)
    advice = _advice(said) if isinstance(problem, TypeError) else ""
    if not advice or line_number is None:
        return f"{where}: {type(problem).__name__}: {said}"
    return f"{where}: in {_shortened(linecache.getline(str(path), line_number))}: {advice}"


def _line(path: Path, problem: BaseException) -> int | None:
    """The line of the file at which it was left."""
    lines = [
        f.lineno
        for f in traceback.extract_tb(problem.__traceback__)
        if Path(f.filename) == path.absolute() or Path(f.filename) == path
    ]
    return lines[-1] if lines else None


def _keyword(said: str) -> str:
    """What there is instead of an argument that something of `tubular_dea.plants` does not have."""
    found = re.match(r"(\w+)\.(\w+)\(\) got an unexpected keyword argument '(\w+)'", said)
    called = found and getattr(getattr(sys.modules[__package__], found[1], None), found[2], None)
    if not found or not called:
        return ""
    shown = found[1] if found[2] == "__init__" else f"{found[1]}.{found[2]}"
    names = [name for name in inspect.signature(called).parameters if name != "self" and not name.startswith("_")]
    return f"{shown} has no argument {found[3]!r}{nearest(found[3], names)}"


def _meant(problem: BaseException) -> str:
    """What a misspelt name was meant to be."""
    if isinstance(problem, ImportError) and problem.name in sys.modules:
        imported = re.match(r"cannot import name '(\w+)'", str(problem))
        return close_to(imported[1], dir(sys.modules[problem.name])) if imported else ""
    if isinstance(problem, NameError) and problem.name and problem.__traceback__:
        *_, (frame, _) = traceback.walk_tb(problem.__traceback__)
        if problem.name in MODULES:
            return "; functions of quantities are sympy's: write `from sympy import sqrt`, say"
        if problem.name in FUNCTIONS:
            return f"; write `from sympy import {problem.name}`"
        meant = close_to(problem.name, [*frame.f_locals, *frame.f_globals]) or close_to(
            problem.name, dir(builtins), 0.8
        )
        return meant or f"; declare it before, as m.parameter({problem.name!r}, ...) or m.define({problem.name!r}, ...)"
    return ""


def close_to(name: str, names: Iterable[str], like: float = 0.6) -> str:
    """A hint for an error message: "; did you mean a?", or "" where nothing is like it."""
    known = [n for n in dict.fromkeys(names) if not n.startswith("_")]
    found = difflib.get_close_matches(name, known, n=1, cutoff=like)
    return f"; did you mean {found[0]}?" if found else ""


def _advice(said: str) -> str:
    for pattern, words in ADVICE:
        found = re.fullmatch(pattern, said)
        if found and words == DECIDED:
            return words.format(found[1], re.split(r" [<>=!]+ ", found[1])[0])
        if found:
            return words.format(*found.groups())
    return ""


def _shortened(text: str) -> str:
    plain = " ".join(text.split())
    return plain if len(plain) <= LONGEST else f"{plain[: LONGEST - 4]} ..."
