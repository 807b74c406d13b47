"""Nothing in the package carries out or unpickles what is in files; and the licences of what it depends on."""

from __future__ import annotations

import ast
import re
import tomllib
from importlib.metadata import PackageNotFoundError, distribution, metadata
from pathlib import Path

import pytest

import tubular_dea

PACKAGE = Path(tubular_dea.__file__).parent
# What carries out text, or what lets a file choose what is carried out.
CALLS = {"eval", "exec", "compile", "__import__", "sympify", "parse_expr", "literal_eval", "lambdify"}
MODULES = {"pickle", "cPickle", "dill", "joblib", "shelve", "marshal", "yaml", "code", "runpy"}
METHODS = {("os", "system"), ("os", "popen"), ("pandas", "read_pickle"), ("pandas", "eval"), ("np", "fromregex")}
# Where it is allowed, and why.
ALLOWED = {
    ("emit/python.py", "exec"): "the text is printed from a model's declaration, in the same process",
    ("emit/python.py", "compile"): "as above",
    ("model/sizes.py", "lambdify"): "the expression is a model's declaration, in the same process",
    ("sweep/backends.py", "pickle"): "a plan made here, on its way to Dask's workers; nothing from files",
    ("sweep/parts.py", "pickle"): "the worker's end of it",
}


def found(tree: ast.AST) -> list[tuple[str, int]]:
    """Names of the above that are used, with their lines."""
    names = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            modules = [a.name for a in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            level = getattr(node, "level", 0)
            names += [(m, node.lineno) for m in modules if not level and m.split(".")[0] in MODULES]
        if isinstance(node, ast.Call):
            called, words = node.func, {k.arg: k.value for k in node.keywords}
            if isinstance(called, ast.Name) and called.id in CALLS - {"sympify"}:
                names.append((called.id, node.lineno))
            if isinstance(called, ast.Attribute) and isinstance(called.value, ast.Name):
                if (called.value.id, called.attr) in METHODS:
                    names.append((f"{called.value.id}.{called.attr}", node.lineno))
                if called.value.id == "sympy" and called.attr in CALLS - {"sympify"}:
                    names.append((called.attr, node.lineno))
            for word in ("shell", "allow_pickle"):
                if word in words and not (isinstance(words[word], ast.Constant) and words[word].value is False):
                    names.append((word, node.lineno))
    return names


def test_no_text_from_files_is_carried_out() -> None:
    files = sorted(PACKAGE.rglob("*.py"))
    assert len(files) > 50
    wrong = []
    for path in files:
        name = path.relative_to(PACKAGE).as_posix()
        tree = ast.parse(path.read_text(encoding="utf-8"))
        wrong += [f"{name}:{line}: {what}" for what, line in found(tree) if (name, what) not in ALLOWED]
    assert not wrong


def test_sympify_is_given_no_text() -> None:
    """sympy.sympify evaluates strings: the package never gives it what was read from a file."""
    reads = re.compile(r"tomllib|json\.load|read_text\(|csv\.reader")
    readers = [p for p in PACKAGE.rglob("*.py") if reads.search(p.read_text())]
    assert readers
    assert not [p.name for p in readers if "sympify" in p.read_text()]


@pytest.mark.parametrize(
    "text",
    [
        "eval(x)",
        "exec(x)",
        "import pickle",
        "from pickle import loads",
        "os.system(x)",
        "subprocess.run(x, shell=True)",
        "np.load(x, allow_pickle=True)",
        "sympy.parse_expr(x)",
    ],
)
def test_the_scan_finds_them(text: str) -> None:
    assert found(ast.parse(text))


def licence(name: str) -> str:
    """What a distribution says of its licence, in a few words."""
    about = metadata(name)
    classified = [c.split(" :: ")[-1] for c in about.get_all("Classifier") or [] if c.startswith("License ::")]
    own = (about.get("License-Expression") or "") or (about.get("License") or "").strip().split("\n")[0][:60]
    named = about.get("License-Expression") or ", ".join(c for c in classified if c != "OSI Approved") or own
    return named or _from_file(name)


def _from_file(name: str) -> str:
    """What the text of its licence begins with, or grants."""
    texts = [f.read_text() for f in distribution(name).files or [] if "licen" in f.name.lower() and f.suffix != ".py"]
    granted = [text for text in texts if "Redistribution and use in source and binary forms" in text]
    return "BSD (by its text)" if granted else next((text.strip().split("\n")[0] for text in texts), "")


def dependencies() -> list[str]:
    """What the package needs at run time, extras left out."""
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
    listed: list[str] = project["dependencies"]
    return sorted({re.split(r"[^\w.-]", r)[0] for r in listed}, key=str.lower)


def test_dependencies_have_licences_that_allow_use(capsys: pytest.CaptureFixture[str]) -> None:
    table = {}
    for name in dependencies():
        try:
            table[name] = (metadata(name)["Version"], licence(name))
        except PackageNotFoundError:
            continue
    assert len(table) >= 5
    with capsys.disabled():
        print("\n" + "\n".join(f"{name:12} {number:12} {text}" for name, (number, text) in table.items()))
    for name, (_, text) in table.items():
        assert text, f"{name} names no licence"
        assert not re.search(r"\bA?GPL", text), f"{name}: {text}"
