"""Self-contained HTML pages: text, tables and figures a person can zoom, in one file that opens offline."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from pathlib import Path

import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from ..files import write_atomically
from .figures import COLOURS

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem; color: #1b2733; }
h1, h2 { line-height: 1.2; } h2 { margin-top: 2.4rem; border-bottom: 2px solid #c8402f; padding-bottom: .2rem; }
table { border-collapse: collapse; margin: 1rem 0; } td, th { text-align: left; padding: .3rem 1rem .3rem 0;
border-bottom: 1px solid #dde3e8; vertical-align: top; font-variant-numeric: tabular-nums; }
.note { color: #5b6b7a; } .lead { font-size: 1.15em; } figure { margin: 1rem 0; }
"""


class Page:
    """A report under construction; parts appear in the order they are added."""

    def __init__(self, title: str, lead: str) -> None:
        self.title = title
        self._parts = [f"<h1>{html.escape(title)}</h1>", f'<p class="lead">{html.escape(lead)}</p>']

    def heading(self, text: str) -> None:
        """A section heading."""
        self._parts.append(f"<h2>{html.escape(text)}</h2>")

    def text(self, text: str) -> None:
        """A paragraph of plain text."""
        self._parts.append(f"<p>{html.escape(text)}</p>")

    def table(self, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        """A table; cells are shown as text."""
        head = "".join(f"<th>{html.escape(cell)}</th>" for cell in header)
        body = "".join("<tr>" + "".join(f"<td>{html.escape(str(c))}</td>" for c in row) + "</tr>" for row in rows)
        self._parts.append(f"<table><tr>{head}</tr>{body}</table>")

    def figure(self, figure: go.Figure, caption: str) -> None:
        """A plotly figure with a caption in words."""
        figure.update_layout(template="plotly_white", colorway=COLOURS, margin={"l": 60, "r": 20, "t": 30, "b": 50})
        drawn = figure.to_html(full_html=False, include_plotlyjs=False, div_id=f"figure{len(self._parts)}")
        note = f'<figcaption class="note">{html.escape(caption)}</figcaption>'
        self._parts.append(f"<figure>{drawn}{note}</figure>")

    def write(self, path: Path) -> Path:
        """Write the page, with the plotting library inside."""
        text = (
            f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(self.title)}</title>'
            f"<style>{_STYLE}</style><script>{get_plotlyjs()}</script></head><body>{''.join(self._parts)}</body></html>\n"
        )
        return write_atomically(path, text.encode("utf-8"))
