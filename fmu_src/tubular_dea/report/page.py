"""Self-contained HTML pages: text, tables and pictures in one file that opens offline, on a telephone too."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
from plotly.io import templates, to_html
from plotly.offline import get_plotlyjs

from ..emit.tables import SCROLLS
from ..files import write_atomically
from .colours import COLOURS

Drawing = dict[str, Any]  # a plotly figure as JSON: `data` and `layout`

_STYLE = (
    SCROLLS
    + """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem; color: #1b2733; }
h1, h2, h3 { line-height: 1.2; overflow-wrap: anywhere; }
h2 { margin-top: 2.4rem; border-bottom: 2px solid #c8402f; padding-bottom: .2rem; } h3 { margin: 1.8rem 0 .4rem; }
table { border-collapse: collapse; margin: 1rem 0; }
td, th { text-align: left; padding: .3rem 1rem .3rem 0; border-bottom: 1px solid #dde3e8; vertical-align: top;
font-variant-numeric: tabular-nums; }
.note { color: #5b6b7a; } .lead { font-size: 1.15em; } figure { margin: 1rem 0; } figcaption { max-width: 46rem; }
p, dd { max-width: 46rem; } dt { font-weight: 600; margin-top: .8rem; } dd { margin: 0; } dd p { margin: 0 0 .4rem; }
.broad { min-width: 44rem; } svg { width: 100%; height: auto; display: block; font-family: inherit; }
.beside { display: grid; gap: 1rem 1.5rem; grid-template-columns: repeat(auto-fit, minmax(min(100%, 24rem), 1fr)); }
.panels { display: grid; gap: .5rem; grid-template-columns: repeat(auto-fill, minmax(max(10rem, 22%), 1fr)); }
.beside figure, .panels figure { margin: 0; } .panels figcaption { font-size: .8em; line-height: 1.2; }
.strips { display: grid; grid-template-columns: minmax(9rem, 15rem) 1fr; gap: .15rem 1rem; align-items: center; }
.strips a { overflow-wrap: anywhere; line-height: 1.15; } .legend span { margin-right: 1rem; white-space: nowrap; }
@media (max-width: 40rem) { .strips { grid-template-columns: 1fr; } .strips a { margin-top: .5rem; }
table { font-size: .82em; line-height: 1.3; } td, th { padding-right: .5rem; } }
pre { background: #f3f5f7; padding: .6rem .8rem; overflow-x: auto; font-size: 13px; line-height: 1.25; }
pre.words { font: inherit; white-space: pre-wrap; max-width: 46rem; }
"""
)


class Page:
    """A report under construction; parts appear in the order they are added. All text is plain."""

    def __init__(self, title: str, lead: str) -> None:
        self.title = title
        self._parts = [f"<h1>{html.escape(title)}</h1>", f'<p class="lead">{html.escape(lead)}</p>']
        self._zoomed = False

    def heading(self, text: str, anchor: str = "", level: int = 2) -> None:
        """A section heading; `anchor` is where `links` lead to."""
        place = f' id="{html.escape(anchor)}"' if anchor else ""
        self._parts.append(f"<h{level}{place}>{html.escape(text)}</h{level}>")

    def text(self, text: str) -> None:
        """A paragraph of plain text."""
        self._parts.append(f"<p>{html.escape(text)}</p>")

    def links(self, text: str, anchors: Iterable[tuple[str, str]]) -> None:
        """A paragraph that ends in links to headings: (anchor, words) each."""
        listed = ", ".join(f'<a href="#{html.escape(a)}">{html.escape(w)}</a>' for a, w in anchors)
        self._parts.append(f"<p>{html.escape(text)} {listed}</p>")

    def answers(self, entries: Iterable[tuple[str, Sequence[str]]]) -> None:
        """Questions, each with paragraphs that answer it."""
        body = "".join(
            f"<dt>{html.escape(question)}</dt><dd>{''.join(f'<p>{html.escape(t)}</p>' for t in texts)}</dd>"
            for question, texts in entries
        )
        self._parts.append(f"<dl>{body}</dl>")

    def lines(self, text: str, drawing: bool = False) -> None:
        """Text that keeps its line ends: equations, or a drawing made of letters."""
        style = "" if drawing else ' class="words"'
        self._parts.append(f"<pre{style}>{html.escape(text)}</pre>")

    def table(self, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        """A table; cells are shown as text."""
        head = "".join(f"<th>{html.escape(cell)}</th>" for cell in header)
        body = "".join("<tr>" + "".join(f"<td>{html.escape(str(c))}</td>" for c in row) + "</tr>" for row in rows)
        self._parts.append(f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>')

    def drawings(self, drawn: Iterable[tuple[str, str]], kind: str = "beside") -> None:
        """Pictures (SVG text, caption) beside each other where there is room; `kind` "panels" are small ones."""
        figures = "".join(
            f'<figure>{svg}<figcaption class="note">{html.escape(caption)}</figcaption></figure>'
            for svg, caption in drawn
        )
        self._parts.append(f'<div class="{kind}">{figures}</div>')

    def strips(self, drawn: Iterable[tuple[str, str]]) -> None:
        """Rows of a name, which is the anchor of a heading, and a wide picture (SVG text)."""
        rows = "".join(
            f'<a href="#{html.escape(name)}">{html.escape(name).replace("_", "_<wbr>")}</a><div>{svg}</div>'
            for name, svg in drawn
        )
        self._parts.append(f'<div class="strips">{rows}</div>')

    def legend(self, entries: Iterable[tuple[str, str]]) -> None:
        """What colours mean: (words, colour) each."""
        said = " ".join(
            f'<span><b style="color:{colour}">&#9632;</b> {html.escape(words)}</span>' for words, colour in entries
        )
        self._parts.append(f'<p class="legend">{said}</p>')

    def figure(self, figure: go.Figure | Drawing, caption: str) -> None:
        """A plotly figure, or its JSON, with a caption in words; its legend is above it, below the toolbar, unless it
        has a place."""
        drawn = figure if isinstance(figure, dict) else figure.to_plotly_json()
        layout = drawn["layout"]
        above = len(drawn["data"]) > 1 and "x" not in layout.get("legend", {})
        margin = {"l": 60, "r": 20, "t": 64 if above else 30, "b": 50}
        layout |= {"colorway": COLOURS, "margin": margin}
        if above:
            layout["legend"] = layout.get("legend", {}) | {"orientation": "h", "x": 0, "y": 1, "yanchor": "bottom"}
        layout["template"] = templates["plotly_white"].to_plotly_json()  # setting it in a figure takes 12 ms
        place = f"figure{len(self._parts)}"
        text = to_html(drawn, full_html=False, include_plotlyjs=False, div_id=place, validate=False)
        note = f'<figcaption class="note">{html.escape(caption)}</figcaption>'
        if not above and "x" in layout.get("legend", {}):  # a legend beside the curves: on a telephone they scroll
            text = f'<div class="wide"><div class="broad">{text}</div></div>'
        self._parts.append(f"<figure>{text}{note}</figure>")
        self._zoomed = True

    def document(self) -> str:
        """The page as HTML, with the plotting library inside where a figure needs it."""
        script = f"<script>{get_plotlyjs()}</script>" if self._zoomed else ""
        return (
            '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f"<title>{html.escape(self.title)}</title><style>{_STYLE}</style>{script}</head>"
            f"<body>{''.join(self._parts)}</body></html>\n"
        )

    def write(self, path: Path) -> Path:
        """Write the page."""
        return write_atomically(path, self.document().encode("utf-8"))
