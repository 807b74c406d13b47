"""What a docstring says: its first paragraph, a paragraph by the word it begins with, the whole of it as HTML.

Read are plain paragraphs, literal blocks behind `::`, lists behind 1. or *, examples, `names`, and numpydoc's sections.
"""

from __future__ import annotations

import html
import inspect
import itertools
import re
import textwrap
from collections.abc import Iterator

TERMS = ("Parameters", "Other Parameters", "Attributes", "Returns", "Yields", "Raises", "Warns")
"""Sections that are lists: a term flush left, what it is indented below."""


def summary(text: str) -> str:
    """The first paragraph, in one line."""
    return " ".join(inspect.cleandoc(text).split("\n\n")[0].split())


def paragraph(text: str, head: str) -> str:
    """The paragraph that begins with `head`, in one line and without what stands before its colon; "" without one."""
    for block in inspect.cleandoc(text).split("\n\n"):
        first, colon, rest = " ".join(block.split()).partition(":")
        if colon and first.startswith(head):
            return rest.strip()
    return ""


def without(text: str, head: str) -> str:
    """The text without the paragraph that begins with `head`, and without the literal blocks behind it."""
    kept, left_out = [], False
    for block in inspect.cleandoc(text).split("\n\n"):
        left_out = block.startswith(head) or (left_out and block.startswith(" "))
        kept += [] if left_out else [block]
    return "\n\n".join(kept)


def rendered(text: str) -> str:
    """The whole docstring."""
    parts = []
    for title, lines in _sections(inspect.cleandoc(text).splitlines()):
        head = f"<h5>{html.escape(title)}</h5>" if title else ""
        parts.append(head + (_terms(lines) if title in TERMS else _prose(lines)))
    return "".join(parts)


def inline(text: str) -> str:
    """Text with ``names`` and `names` set as code."""
    return re.sub(r"(`{1,2})(.+?)\1", r"<code>\2</code>", html.escape(text, quote=False))


def signature(name: str, called: object) -> str:
    """How a function or method is called, without `self`; annotations as they are written."""
    assert callable(called)
    declared = inspect.signature(called)
    given = [p for p in declared.parameters.values() if p.name != "self"]
    return name + re.sub(r"(: |-> )'([^']*)'", r"\1\2", str(declared.replace(parameters=given)))


def _sections(lines: list[str]) -> Iterator[tuple[str, list[str]]]:
    """Title ("" for what comes first) and lines of each section; a title is underlined with dashes."""
    bounds = [i - 1 for i, line in enumerate(lines) if i and line and set(line) == {"-"}] + [len(lines)]
    yield "", lines[: bounds[0]]
    for start, end in itertools.pairwise(bounds):
        yield lines[start].strip(), lines[start + 2 : end]


def _terms(lines: list[str]) -> str:
    bounds = [i for i, line in enumerate(lines) if line and not line.startswith(" ")] + [len(lines)]
    parts = []
    for start, end in itertools.pairwise(bounds):
        described = textwrap.dedent("\n".join(lines[start + 1 : end])).splitlines()
        parts.append(f"<dt>{inline(lines[start])}</dt><dd>{_prose(described)}</dd>")
    return f"<dl>{''.join(parts)}</dl>"


def _prose(lines: list[str]) -> str:
    """Paragraphs; what is indented or begins with >>> as it stands."""
    blocks = [b for b in re.split(r"\n\s*\n", "\n".join(lines).strip("\n")) if b.strip()]
    return "".join(map(_block, blocks))


def _block(block: str) -> str:
    if block.startswith((" ", ">>>")):
        return f"<pre>{html.escape(textwrap.dedent(block))}</pre>"
    if block.startswith("1. "):
        items = "".join(f"<li>{inline(' '.join(i.split()))}</li>" for i in re.split(r"(?m)^\d+\. ", block) if i)
        return f"<ol>{items}</ol>"
    if block.startswith("* "):
        items = "".join(f"<li>{inline(' '.join(i.split()))}</li>" for i in re.split(r"(?m)^\* ", block) if i)
        return f"<ul>{items}</ul>"
    text = inline(re.sub("::$", ":", " ".join(block.split())))
    return f"<p>{text}</p>" if text != ":" else ""
