"""Modules of a package joined into one file: imports first, each module's own text under its title."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from ..emit import rodas5p

WIDTH = 106


@dataclass(frozen=True)
class SourceModule:
    """A module by its name and text. Its docstring begins with a title and a colon, or is the title."""

    name: str
    text: str

    @cached_property
    def _nodes(self) -> list[ast.stmt]:
        return ast.parse(self.text).body

    def title(self) -> str:
        """A comment line in the place of the docstring."""
        words = (ast.get_docstring(ast.parse(self.text)) or self.name).split("\n")[0].split(":")[0].rstrip(".")
        return f"# {words} ".ljust(WIDTH, "-") + "\n"

    def imports(self) -> list[ast.Import | ast.ImportFrom]:
        """The imports of other packages, `__future__` left out."""
        found = [n for n in self._nodes if isinstance(n, ast.Import | ast.ImportFrom)]
        return [n for n in found if isinstance(n, ast.Import) or (not n.level and n.module != "__future__")]

    def body(self, replaced: Mapping[str, str] | None = None) -> str:
        """The text without docstring and imports, some functions `replaced` by name. Constants of the method, which an
        FMU cannot import, are printed."""
        lines = self.text.split("\n")
        out: list[str] = []
        done = 0
        for node in self._nodes:
            text = self._instead(node, replaced or {})
            if text is not None:
                out += [*lines[done : node.lineno - 1], *([text] if text else [])]
                done = node.end_lineno or node.lineno
        return "\n".join([*out, *lines[done:]]).strip("\n")

    def _instead(self, node: ast.stmt, replaced: Mapping[str, str]) -> str | None:
        """What stands in the place of a statement; None: itself."""
        if isinstance(node, ast.ImportFrom) and node.module in ("emit.rodas5p", "rodas5p"):
            return _constants([alias.name for alias in node.names])
        if isinstance(node, ast.Import | ast.ImportFrom):
            return ""
        if isinstance(node, ast.FunctionDef) and node.name in replaced:
            return replaced[node.name].strip("\n")
        return "" if isinstance(node, ast.Expr) and node is self._nodes[0] else None


def _constants(names: Sequence[str]) -> str:
    values = {name: getattr(rodas5p, name) for name in names}
    return "\n".join(f"{name} = {value!r}" for name, value in values.items() if isinstance(value, int | float)) + "\n"


def merged_imports(modules: Sequence[SourceModule]) -> str:
    """All imports of other packages by all modules, each once, in the usual order."""
    plain: set[str] = set()
    named: dict[str, set[str]] = {}
    for node in [node for part in modules for node in part.imports()]:
        if isinstance(node, ast.Import):
            plain |= {alias.name for alias in node.names}
        else:
            named.setdefault(node.module or "", set()).update(alias.name for alias in node.names)
    froms = {module: f"from {module} import {', '.join(sorted(names))}" for module, names in sorted(named.items())}
    own = [line for module, line in froms.items() if module.startswith("pythonfmu")]
    standard = [*(f"import {name}" for name in sorted(plain)), *(line for line in froms.values() if line not in own)]
    return "\n".join(["from __future__ import annotations", "", *standard, "", *own])
