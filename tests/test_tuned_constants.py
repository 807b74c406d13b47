"""Every tuned number of discover/ and identify/ says what it means, how it was set and what shows its effect.

A record stands above the numbers that it is about, up to the next empty line, and each has its unit and meaning:

    # Set by judgement: so many are told apart. Check: `pytest tests/test_x.py`, `python -m blind.score --nulls 60`
    FEW = 3  # [samples] on the way at most

Inside functions stand only small whole numbers, halves, and the numbers of formulas that are listed here.
"""

from __future__ import annotations

import ast
import re
import shlex
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tubular_dea.commands import COMMANDS

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "fmu_src" / "tubular_dea"
FILES = sorted(path for room in ("discover", "identify", "patients") for path in (PACKAGE / room).rglob("*.py"))
WAYS = ("judgement", "measurement", "theory", "convention")
SELF_EVIDENT = {0, 1, 2, 0.5}
NO_DIVISION_BY_ZERO = 1e-300  # far below anything that is divided by
UNIFORM = 12  # a uniform distribution of width 1 has the variance 1 / 12
# Numbers of formulas: where they stand, which they are, and why they are not tuned.
FORMULAS: dict[str, tuple[set[float], str]] = {
    "discover/alternatives/input_noise.py: _between_samples": ({6}, "the middle weight of a fourth difference"),
    "discover/scores/parameters.py: unusual": ({10}, "powers of ten"),
    "identify/fitting/fit.py: goodness": ({100}, "per cent"),
    "identify/fitting/marginal.py: _left_over": ({3}, "the integral in its docstring"),
    "identify/inputs/drive.py: _smooth": ({7, 9, 16, 164, 256}, "the cubic through four samples, and its noise"),
    "identify/inputs/line_checks.py: check_sampling": (
        {3, 1.5, 4},
        "noise of a sample less the mean of its neighbours",
    ),
    "patients/patient.py: __init__": ({3}, "a windkessel of three elements"),
    "patients/recorded_beat.py: average": ({60}, "seconds of a minute"),
    "patients/recorded_beat.py: _one_beat": ({60}, "seconds of a minute"),
    "patients/recorded_beat.py: _upstrokes": ({60}, "seconds of a minute"),
    "identify/records/bench_file.py: _amount": ({1e300}, "what a float can hold, nearly"),
    "identify/signals/colour.py: theta": ({4}, "a quadratic equation"),
    "identify/signals/monitors.py: thirds": ({3}, "a third difference"),
    "identify/signals/monitors.py: seen": ({30}, "third differences of an autoregression"),
    "identify/signals/monitors.py: _toggling": ({3}, "a third difference"),
    "identify/signals/monitors.py: polyline": ({3}, "samples of which each one is a corner"),
    "identify/signals/monitors.py: _cubic": ({6}, "the cubic through four samples"),
    "identify/signals/noise.py: _by_place": ({4}, "the formula in its docstring"),
    "identify/signals/colour_estimate.py: _falling": ({4}, "as many numbers as a colour has"),
    "identify/signals/colour_estimate.py: _numbered": ({4}, "as many numbers as a colour has"),
    "identify/signals/colour_estimate.py: _standard_error": ({4}, "a mixed difference quotient"),
    "identify/signals/sampling.py: _resolution": ({10}, "powers of ten"),
}
RECORD = re.compile(rf"# Set by ({'|'.join(WAYS)})\b[^`]*\. Check: (`[^`]+`(, `[^`]+`)*)$")


@dataclass(frozen=True)
class Constant:
    """A number at the top of a file: the comments of its record, and what it is said to mean."""

    name: str
    line: int
    record: str
    meaning: str


def constants(text: str) -> Iterator[Constant]:
    """All numbers (or groups of them) that a file's top level gives a name in capitals."""
    lines = text.splitlines()
    for node in ast.parse(text).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None or not _numeric(node.value):
            continue
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        name = ast.unparse(target)
        if name.isupper():
            first = lines[node.lineno - 1]
            above = _above(lines, node.lineno - 1)
            record = next((c for c in above if c.startswith("# Set by")), "")
            meaning = re.search(r"  # (\[.*)", first)
            yield Constant(name, node.lineno, record, meaning[1] if meaning else _last(above))


def _numeric(value: ast.expr) -> bool:
    return any(isinstance(n, ast.Constant) and type(n.value) in (int, float) for n in ast.walk(value))


def _above(lines: list[str], end: int) -> list[str]:
    """The comments above a line up to the next empty one, nearest first; those that go on are one."""
    found: list[str] = []
    part: list[str] = []
    for line in reversed(lines[:end]):
        if not line:
            break
        if not line.startswith("# "):
            part = []
            continue
        part.insert(0, line if line.startswith(("# Set by", "# [")) else line[2:])
        if line.startswith(("# Set by", "# [")):
            found.append(" ".join(part))
            part = []
    return found


def _last(above: list[str]) -> str:
    return above[0][2:] if above and above[0].startswith("# [") else ""


def faults(text: str) -> Iterator[str]:
    """What is wrong with the records of a file."""
    for alone in re.finditer(r"^# Set by.*\n(# .*\n)*(\n|\Z)", text, re.MULTILINE):
        yield f"a record without a number: {alone[0].strip()}"
    for c in constants(text):
        record = RECORD.fullmatch(c.record)
        if "," in c.name:
            yield f"line {c.line}: {c.name}: expected a line for each"
        elif not record:
            yield (
                f"line {c.line}: {c.name}: expected a comment '# Set by ({'|'.join(WAYS)})[: how]. Check: `command`' "
                f"above it but found {c.record!r}"
            )
        elif not re.fullmatch(r"\[[^\]]+\] \w.*", c.meaning):
            yield f"line {c.line}: {c.name}: expected '# [unit] meaning' beside it but found {c.meaning!r}"
        else:
            for command in re.findall(r"`([^`]+)`", record[2]):
                missing = unknown(shlex.split(command))
                if missing:
                    yield f"line {c.line}: {c.name}: `{command}`: there is no {missing}"


def literals(text: str) -> Iterator[tuple[int, str, float]]:
    """Line, innermost function ("" outside) and value of each number below a file's top level that is no index, no
    whole power and not self-evident."""
    tree = ast.parse(text)
    named = [node for node in tree.body if isinstance(node, ast.Assign | ast.AnnAssign)]
    yield from _literals([node for node in tree.body if node not in named], "")


def _literals(nodes: Iterable[ast.AST], function: str) -> Iterator[tuple[int, str, float]]:
    for node in nodes:
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            if node.value not in (*SELF_EVIDENT, NO_DIVISION_BY_ZERO, UNIFORM):
                yield node.lineno, function, node.value
        elif isinstance(node, ast.Subscript):  # what is indexed, not by what
            yield from _literals([node.value], function)
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow) and isinstance(node.right, ast.Constant):
            whole = float(node.right.value).is_integer()
            yield from _literals([node.left] if whole else [node.left, node.right], function)
        else:
            inner = node.name if isinstance(node, ast.FunctionDef) else function
            yield from _literals(ast.iter_child_nodes(node), inner)


def unknown(words: list[str]) -> str:
    """What of a command is not in this repository; "" for one that can be run."""
    match words:
        case ["pytest", *where, "-k", word]:
            return _unknown_tests(where, word)
        case ["pytest", *where]:
            return _unknown_tests(where)
        case ["python", "-m", module, *rest]:  # of tests/, where it is run
            return _unknown_script(ROOT / "tests" / Path(*module.split(".")).with_suffix(".py"), rest)
        case ["python", script, *rest]:
            return _unknown_script(ROOT / script, rest)
        case ["tubular-dea", command, *_]:
            return "" if command in COMMANDS else f"command {command}"
    return f"way to run {words[0]} here"


def _unknown_tests(where: list[str], word: str = "") -> str:
    found: list[str] = []
    for place in where:
        path, _, name = place.partition("::")
        if not (ROOT / path).is_file():
            return path
        tests = re.findall(r"^def (test_\w+)", (ROOT / path).read_text("utf-8"), re.MULTILINE)
        if name and name not in tests:
            return f"test {name}"
        found += tests
    return "" if any(word in test for test in found) else f"test with {word!r} in its name"


def _unknown_script(path: Path, rest: list[str]) -> str:
    if not path.is_file():
        return str(path.relative_to(ROOT))
    text = path.read_text("utf-8")
    return next((f"option {w}" for w in rest if w.startswith("--") and f'"{w}"' not in text), "")


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_every_number_has_a_record(path: Path) -> None:
    assert not list(faults(path.read_text("utf-8")))


def test_no_name_is_used_for_two_ideas() -> None:
    places: dict[str, list[str]] = {}
    for path in FILES:
        for c in constants(path.read_text("utf-8")):
            places.setdefault(c.name, []).append(f"{path.parent.name}/{path.name}")
    assert len(places) > 200  # they are found at all
    assert not {name: where for name, where in places.items() if len(where) > 1}


def test_every_number_is_used() -> None:
    everything = "\n".join(path.read_text("utf-8") for path in PACKAGE.rglob("*.py"))
    words = Counter(re.findall(r"\w+", re.sub(r"#.*", "", everything)))
    named = [c.name for path in FILES for c in constants(path.read_text("utf-8"))]
    assert not [name for name in named if words[name] < 2]


def test_no_tuned_number_stands_inside_a_function() -> None:
    nameless: list[str] = []
    used: dict[str, set[float]] = {}
    for path in FILES:
        where = path.relative_to(PACKAGE).as_posix()
        for line, function, value in literals(path.read_text("utf-8")):
            place = f"{where}: {function}"
            if value in FORMULAS.get(place, (set(), ""))[0]:
                used.setdefault(place, set()).add(value)
            else:
                nameless.append(f"{where}:{line}: {value} in {function or 'a class'}")
    assert not nameless  # give it a name and a record at the top, or, as a number of a formula, a line in FORMULAS
    assert used == {place: values for place, (values, _) in FORMULAS.items()}  # and no line too many


@pytest.mark.parametrize(
    ("body", "seen"),
    [
        ("x > 0.3", [0.3]),
        ("-7", [7]),
        ("f(x, xtol=1e-8)", [1e-8]),
        ("x**2.5 + x**3", [2.5]),
        ("[a[7], a[:5], a[3:-1], 2 * x, 0.5 * x, x / 12]", []),
        ("np.maximum(x, 1e-300)", []),
        ("f'{x[:40]} {1e3 * x:.3g}'", [1e3]),
    ],
)
def test_a_number_without_a_name_is_seen(body: str, seen: list[float]) -> None:
    text = f"NAMED = 0.7\n\n\ndef f(x, a):\n    return {body}\n"
    assert [(function, value) for _, function, value in literals(text)] == [("f", value) for value in seen]


@pytest.mark.parametrize("text", ["def f(x=5):\n    pass\n", "class A:\n    x: int = 5\n", "if x > 5:\n    y = 1\n"])
def test_a_number_is_seen_in_defaults_and_classes(text: str) -> None:
    assert [value for *_, value in literals(text)] == [5]


GOOD = (
    "# Set by judgement: so. Check: `pytest tests/test_plants.py`, `tubular-dea atlas`\nFEW = 3  # [samples] at most\n"
)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("# Set by judgement: so. Check:", "# Check:", "Set by"),
        ("judgement", "magic", "Set by"),
        (" Check: `pytest tests/test_plants.py`, `tubular-dea atlas`", "", "Set by"),
        ("# [samples] at most", "# at most", "[unit] meaning"),
        ("  # [samples] at most", "", "[unit] meaning"),
        ("FEW = 3", "FEW, MANY = 3, 4", "a line for each"),
        ("FEW = 3  # [samples] at most\n", "", "without a number"),
        ("test_plants.py", "test_planets.py", "no tests/test_planets.py"),
        ("test_plants.py", "test_plants.py::test_nothing", "no test test_nothing"),
        ("test_plants.py", "test_plants.py -k feasibly", "no test with 'feasibly'"),
        ("pytest tests/test_plants.py", "python -m blind.scores", "no tests/blind/scores.py"),
        ("pytest tests/test_plants.py", "python -m blind.score --null 3", "no option --null"),
        ("pytest tests/test_plants.py", "python tests/benchmarks/none.py", "no tests/benchmarks/none.py"),
        ("tubular-dea atlas", "tubular-dea globe", "no command globe"),
        ("tubular-dea atlas", "make", "no way to run make"),
    ],
)
def test_a_number_without_its_record_is_seen(old: str, new: str, said: str) -> None:
    assert not list(faults(GOOD))
    assert old in GOOD
    found = list(faults(GOOD.replace(old, new)))
    assert len(found) == 1 and said in found[0]


def test_a_record_ends_at_an_empty_line() -> None:
    alone, numberless = faults(GOOD.replace("atlas`\n", "atlas`\n\n"))
    assert "without a number" in alone and "FEW" in numberless


def test_records_and_meanings_may_go_on_over_lines() -> None:
    text = (
        "# Set by measurement: of eight\n# and twelve. Check:\n# `python -m blind.score --nulls 3\n# --seed 1`\n"
        "FEW = 3  # [1] few\n# [1] weights of each,\n# in turn\nMANY: tuple = {\n    1: 2.0,\n}\nNAME = 'many'\n"
    )
    assert not list(faults(text))
    assert [(c.name, c.meaning) for c in constants(text)] == [
        ("FEW", "[1] few"),
        ("MANY", "[1] weights of each, in turn"),
    ]
