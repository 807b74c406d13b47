"""One name, one meaning: the words of the README are in the code, no class or public function of the engine twice, no
discouraged word."""

from __future__ import annotations

import ast
import importlib
import io
import re
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from tubular_dea import load_plant

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "fmu_src" / "tubular_dea"
README = (ROOT / "README.md").read_text(encoding="utf-8")
SOURCES = sorted(PACKAGE.rglob("*.py"))
C_SOURCES = sorted(path for suffix in ("c", "h") for path in PACKAGE.rglob(f"*.{suffix}"))

# Words that no name, comment, docstring or message has, and what is said instead.
DISCOURAGED = {
    "doubt": "uncertainty",
    "adequacy": "lack of fit",
    "localise": "isolate",
    "punctual": "undelayed",
    "feign": "explain",
    "betray": "show",
    "mend": "correct",
    "foretell": "predict",
    "foretold": "predicted",
    "foreign": "external",
    "lest": "so that ... not",
    "right side": "right-hand side",
}


def words() -> list[tuple[str, str]]:
    """The README's words: each with the name in the package that stands for it."""
    section = README.partition("### Words\n")[2].partition("\n## ")[0]
    rows = [line.strip("|").split("|") for line in section.splitlines() if line.startswith("| ")]
    return [(term.strip(), re.fullmatch(r" `(.+)` ", code)[1]) for term, _, code in rows[1:]]  # below the headings


def test_the_words_are_sorted_and_there_once() -> None:
    terms = [term.lower() for term, _ in words()]
    assert 25 <= len(terms) <= 60
    assert terms == sorted(set(terms))


@pytest.mark.parametrize(("term", "code"), words())
def test_the_code_of_a_word_exists(term: str, code: str) -> None:
    """`file.py: Class.field` or `file.py: NAME`, below fmu_src/tubular_dea."""
    file, _, name = code.partition(": ")
    assert (PACKAGE / file).is_file(), f"{term}: there is no {file}"
    found = importlib.import_module("tubular_dea." + file.removesuffix(".py").replace("/", "."))
    for part in name.split("."):
        fields = getattr(found, "__dataclass_fields__", {})
        assert part in fields or hasattr(found, part), f"{term}: {file} has no {name}"
        found = getattr(found, part, None)


def test_no_class_is_defined_twice() -> None:
    """Nor in another spelling: an underscore or a capital makes no other word."""
    names = Counter(
        node.name.strip("_").lower()
        for path in SOURCES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef)
    )
    assert [name for name, count in names.items() if count > 1] == []


def test_no_public_function_of_the_engine_is_defined_twice() -> None:
    names = Counter(
        node.name
        for path in SOURCES
        if path.relative_to(PACKAGE).parts[0] in ("discover", "identify", "patients")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")
    )
    assert len(names) > 150  # they are found at all
    assert [name for name, count in names.items() if count > 1] == []


def text_of(path: Path) -> Iterator[tuple[int, str]]:
    """Names, comments and texts of a source, with their lines; all of one in C."""
    if path.suffix != ".py":
        yield from enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        return
    kinds = (tokenize.NAME, tokenize.COMMENT, tokenize.STRING, getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING))
    for token in tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline):
        if token.type in kinds:
            yield token.start[0], token.string


def test_no_discouraged_word_is_used() -> None:
    wrong = re.compile(rf"(?<![a-z])({'|'.join(DISCOURAGED)})(?:s|ed|d|ly)?(?![a-z])", re.IGNORECASE)
    found = [
        f"{path.relative_to(ROOT)}, line {line}: {match[1]!r}; say {DISCOURAGED[match[1].lower()]!r}"
        for path in [*SOURCES, *C_SOURCES]
        for line, text in text_of(path)
        for match in wrong.finditer(text)
    ]
    found += [f"README.md: {match[1]!r}; say {DISCOURAGED[match[1].lower()]!r}" for match in wrong.finditer(README)]
    assert found == []


def test_the_engine_names_no_quantity_of_a_plant() -> None:
    """What holds for any plant stands in discover, identify and report: no name of the tube's or the aorta's there."""
    names = set()
    for name in ("tube", "aorta"):
        model = load_plant(name).model
        names |= {q.name for q in model.inputs} | {s.quantity.name for s in model.states} | {*model.parameter_values()}
        names |= {*model.outputs} | {d.quantity.name for d in model.definitions}
    assert {"voltage", "C_1", "lambda_2", "flow"} <= names
    engine = [p for p in SOURCES if p.relative_to(PACKAGE).parts[0] in ("discover", "identify", "report")]
    said = [
        f"{path.relative_to(PACKAGE)}, line {node.lineno}: {node.value}"
        for path in engine
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and len(node.value) > 1
        if node.value in names
    ]
    assert said == []
