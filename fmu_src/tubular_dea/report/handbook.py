"""The handbook: models, effects, laws, the Python API and the commands on one page, printed from what is declared.

Nothing is written here that stands elsewhere: equations and parameters come from models, drawings and sources from
docstrings, usual sizes from effects, options from the commands' help.
"""

from __future__ import annotations

import html
import inspect
import re
from collections.abc import Iterable, Mapping, Sequence

from ..docstrings import inline, paragraph, rendered, signature, summary
from ..emit.tables import SCROLLS, STYLE, body, changes, document, parameter_table
from ..laws import kinds, laws
from ..model.declare import Model
from ..model.effect import Effect
from ..model.units import in_words
from ..plants.plant import Plant

_STYLE = (
    STYLE
    + SCROLLS
    + """
body { max-width: none; margin: 0; padding: 0; display: grid; grid-template-columns: 17rem minmax(0, 1fr); }
nav { position: sticky; top: 0; height: 100vh; overflow-y: auto; background: #f3f5f7; font-size: .85em;
padding: 1rem; box-sizing: border-box; } nav ul { list-style: none; margin: .2rem 0 1rem; padding: 0; }
nav b a { color: inherit; } a { color: #2a6f97; text-decoration: none; } a:hover { text-decoration: underline; }
main { max-width: 66rem; padding: 0 2rem 6rem; box-sizing: border-box; }
section { margin-top: 2.5rem; } dt { font-weight: 600; }
article { border-bottom: 1px solid #dde3e8; padding-bottom: 1.2rem; } h3 { margin: 1.6rem 0 .3rem; }
h5 { margin: .8rem 0 .2rem; font-size: .95em; } dd { margin-left: 1.5rem; } dd p { margin: .1rem 0 .5rem; }
h1, h3, dt, .call { overflow-wrap: anywhere; }
.call { font-family: ui-monospace, monospace; font-size: .9em; background: #f3f5f7; padding: .3rem .5rem; }
summary { cursor: pointer; color: #2a6f97; } .index td { font-size: .9em; }
@media (max-width: 55rem) { body { display: block; } nav { position: static; height: 40vh; }
main { padding: 0 1rem; } }
"""
)

Entry = tuple[str, str]
"""A name in the contents, and what stands under it, as HTML."""


def handbook(
    models: Iterable[Model], plants: Sequence[Plant], public: Mapping[str, object], commands: Mapping[str, str]
) -> str:
    """The page, as HTML that opens offline; `public` are the names of the Python API with what they stand for.

    `commands` are their help texts by name.
    """
    sections: dict[str, tuple[str, list[Entry]]] = {"Models": ("", [(m.name, body(m, "h4")) for m in models])}
    for plant in plants:
        index, entries = _catalogue(plant)
        sections[f"What {plant.name} may lack"] = (index, entries)
    sections["Laws"] = _laws()
    functions_first = sorted(public.items(), key=lambda item: inspect.isclass(item[1]))
    sections["Python"] = ("", [(name, _documented(name, value)) for name, value in functions_first])
    if commands:
        sections["Commands"] = ("", [(name, f"<pre>{html.escape(text)}</pre>") for name, text in commands.items()])
    content = "".join(_section(title, *section) for title, section in sections.items())
    lead = "<h1>tubular-dea: handbook</h1><p>Printed from what is declared in the code; it opens offline.</p>"
    return document("tubular-dea: handbook", _STYLE, f"{_contents(sections)}<main>{lead}{content}</main>")


def _anchor(section: str, name: str = "") -> str:
    """Where a name stands; a law and an effect of it, say, may be called the same."""
    return html.escape(f"{section}:{name}".replace(" ", "-"))


def _contents(sections: Mapping[str, tuple[str, list[Entry]]]) -> str:
    parts = []
    for title, (_, entries) in sections.items():
        names = "".join(f'<li><a href="#{_anchor(title, n)}">{html.escape(n)}</a></li>' for n, _ in entries)
        parts.append(f'<b><a href="#{_anchor(title)}">{html.escape(title)}</a></b><ul>{names}</ul>')
    return f"<nav>{''.join(parts)}</nav>"


def _section(title: str, index: str, entries: list[Entry]) -> str:
    articles = "".join(
        f'<article id="{_anchor(title, name)}"><h3>{html.escape(name)}</h3>{text}</article>' for name, text in entries
    )
    return f'<section id="{_anchor(title)}"><h2>{html.escape(title)}</h2>{index}{articles}</section>'


def _index(section: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table whose first column leads to the entries of a section; the other cells are HTML."""
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in header)
    lines = "".join(
        f'<tr><td><a href="#{_anchor(section, name)}"><code>{html.escape(name)}</code></a></td>'
        + "".join(f"<td>{cell}</td>" for cell in cells)
        + "</tr>"
        for name, *cells in rows
    )
    return f'<div class="wide"><table class="index"><tr>{head}</tr>{lines}</table></div>'


def _in_short(what: str, documentation: str) -> str:
    """What an effect or a law is, and the first sentence of its equation."""
    equation = re.split(r"\.(?:\s|$)", paragraph(documentation, "Equation"))[0]
    return f'{inline(what)}<div class="note">{inline(equation)}</div>'


def _catalogue(plant: Plant) -> tuple[str, list[Entry]]:
    """The index of a plant's effects with equation and usual size, and each of them."""
    rows = [(e.id, e.channel, _in_short(e.summary, e.documentation), _typical(e)) for e in plant.catalogue.values()]
    index = _index(f"What {plant.name} may lack", ("effect", "channel", "what, and its equation", "usual size"), rows)
    return index, [(effect.id, _effect(plant.model, effect)) for effect in plant.catalogue.values()]


def _typical(effect: Effect) -> str:
    """The parameters at which an effect has its usual size, in readable units."""
    return inline(", ".join(f"`{q.name}` {in_words(effect.typical[q.name], q.unit)}" for q in effect.parameters))


def _effect(model: Model, effect: Effect) -> str:
    """What an effect is, its parameters (at the values at which it is off), and what it changes in the model."""
    after = effect(model)
    own = [p for p in after.parameters if p.quantity.name in effect.typical]
    changed = f"<details><summary>Equations that it adds or changes</summary>{changes(model, after)}</details>"
    return rendered(effect.documentation or f"{effect.summary}.") + parameter_table(own) + changed


def _laws() -> tuple[str, list[Entry]]:
    """The index of laws, and each of them."""
    rows, entries = [], []
    for name, module in laws().items():
        text = inspect.cleandoc(module.__doc__ or "")
        at, needs, usual = kinds(module), inline(module.NEEDS), inline(paragraph(text, "Typical"))
        rows.append((name, at, _in_short(summary(text), text), usual, needs))
        entries.append((name, f"<p>Acts at: {at}. Needs: {needs}.</p>{rendered(text)}"))
    return _index("Laws", ("law", "at", "what, and its equation", "usual size", "needs"), rows), entries


def _documented(name: str, value: object) -> str:
    """A function, or a class with its public methods."""
    text = rendered(inspect.getdoc(value) or "")
    if not inspect.isclass(value):
        return f'<p class="call">{html.escape(signature(name, value))}</p>{text}'
    public = [name for name in vars(value) if not name.startswith("_")]
    return text + "".join(_member(name, inspect.getattr_static(value, name), getattr(value, name)) for name in public)


def _member(name: str, declared: object, found: object) -> str:
    """A method or a property of a class; nothing for what has a value only."""
    if not (callable(found) or isinstance(declared, property)):
        return ""
    head = name if isinstance(declared, property) else signature(name, found)
    return f'<p class="call">.{html.escape(head)}</p>{rendered(inspect.getdoc(declared) or "")}'
