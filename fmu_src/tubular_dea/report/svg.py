"""Small pictures as SVG text: a few kilobytes each, drawn for a page, without a plotting library on it."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence

import numpy as np

from ..stretches import true_stretches

GRID, QUIET = "#dde3e8", "#5b6b7a"
FONT = 12.0  # px, as are all lengths here


class Plot:
    """Curves over two axes; what is added later lies on top. Values that are not finite leave a gap.

    `labels` are those of the axes, `name` says to a screen reader what is drawn. Without labels there are no ticks
    either: a picture of 150 px, say, that stands among others of the same axes.
    """

    def __init__(
        self,
        name: str,
        x: tuple[float, float],
        y: tuple[float, float],
        labels: tuple[str, str] | None = None,
        size: tuple[float, float] = (460.0, 270.0),
    ) -> None:
        self.name, self.labels, self.size = name, labels, size
        self.x, self.y = _opened(x), _opened(y)
        self.box = (58.0, 8.0, size[0] - 8.0, size[1] - 40.0) if labels else (1.0, 1.0, size[0] - 1.0, size[1] - 1.0)
        self._parts: list[str] = []
        self._legend: list[tuple[str, str]] = []

    def line(self, x: np.ndarray, y: np.ndarray, colour: str, name: str = "", dashed: bool = False) -> None:
        """A line through points, each array (n,); with a `name` it stands in the legend."""
        style = ' stroke-dasharray="5 3"' if dashed else ""
        for part in _finite(x, y):
            points = self._points(x[part], y[part])
            self._parts.append(
                f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.6"{style} '
                'stroke-linejoin="round"/>'
            )
        self._named(name, f'<path d="M0 -4h18" stroke="{colour}" stroke-width="2"{style}/>')

    def band(self, x: np.ndarray, low: np.ndarray, high: np.ndarray, colour: str, name: str = "") -> None:
        """What lies between two curves over the same x, each (n,)."""
        for part in _finite(x, low + high):
            there, back = self._points(x[part], low[part]), self._points(x[part][::-1], high[part][::-1])
            self._parts.append(f'<polygon points="{there} {back}" fill="{colour}" fill-opacity="0.22"/>')
        self._named(name, f'<rect y="-9" width="18" height="10" fill="{colour}" fill-opacity="0.22"/>')

    def solid(self, x: np.ndarray, low: np.ndarray, high: np.ndarray, colour: str) -> None:
        """A line as thick as what lies between two curves: one of more points than can be drawn."""
        for part in _finite(x, low + high):
            there, back = self._points(x[part], low[part]), self._points(x[part][::-1], high[part][::-1])
            self._parts.append(
                f'<polygon points="{there} {back}" fill="{colour}" stroke="{colour}" stroke-width="1" '
                'stroke-linejoin="round"/>'
            )

    def level(self, y: float, colour: str = QUIET) -> None:
        """A thin line at a value of y."""
        at = self._y(np.array([y]))[0]
        self._parts.append(
            f'<path d="M{self.box[0]:g} {at:.1f}H{self.box[2]:g}" stroke="{colour}" stroke-width="0.7"/>'
        )

    def mark(self, x: float, colour: str = GRID) -> None:
        """A thin line at a value of x."""
        at = self._x(np.array([x]))[0]
        self._parts.append(f'<path d="M{at:.1f} {self.box[1]:g}V{self.box[3]:g}" stroke="{colour}"/>')

    def svg(self) -> str:
        """The picture, as wide as where it stands allows and no wider than its size."""
        width, height = self.size[0], self.size[1] + (20.0 * len(self._rows()) if self._legend else 0.0)
        title = html.escape(self.name)
        return (
            f'<svg viewBox="0 0 {width:g} {height:g}" style="max-width:{width:g}px" role="img" '
            f'aria-label="{title}"><title>{title}</title>{self._axes()}{"".join(self._parts)}{self._names()}</svg>'
        )

    def _axes(self) -> str:
        left, top, right, bottom = self.box
        if not self.labels:
            return ""
        parts = []
        for value, text in ticks(*self.x, 6):
            at = self._x(np.array([value]))[0]
            parts.append(f'<path d="M{at:.1f} {top:g}V{bottom:g}" stroke="{GRID}"/>')
            parts.append(_text(at, bottom + FONT + 2, text, "middle"))
        for value, text in ticks(*self.y, 5):
            at = self._y(np.array([value]))[0]
            parts.append(f'<path d="M{left:g} {at:.1f}H{right:g}" stroke="{GRID}"/>')
            parts.append(_text(left - 5, at + 4, text, "end"))
        parts.append(_text((left + right) / 2, bottom + 2 * FONT + 6, self.labels[0], "middle"))
        middle = (top + bottom) / 2
        turned = f' transform="rotate(-90 {FONT:g} {middle:g})"'
        parts.append(_text(FONT, middle, self.labels[1], "middle", turned))
        return "".join(parts)

    def _rows(self) -> list[list[tuple[str, str]]]:
        """The legend in rows that are no wider than the picture."""
        rows: list[list[tuple[str, str]]] = [[]]
        for entry in self._legend:
            if rows[-1] and sum(_width(n) for n, _ in [*rows[-1], entry]) > self.size[0] - self.box[0]:
                rows.append([])
            rows[-1].append(entry)
        return rows

    def _names(self) -> str:
        parts = []
        for number, row in enumerate(self._rows() if self._legend else []):
            at = self.box[0]
            for name, mark in row:
                y = self.size[1] + 14 + 20 * number
                parts.append(f'<g transform="translate({at:g} {y:g})">{mark}</g>' + _text(at + 24, y, name, "start"))
                at += _width(name)
        return "".join(parts)

    def _named(self, name: str, mark: str) -> None:
        if name:
            self._legend.append((name, mark))

    def _x(self, values: np.ndarray) -> np.ndarray:
        return self.box[0] + (values - self.x[0]) / (self.x[1] - self.x[0]) * (self.box[2] - self.box[0])

    def _y(self, values: np.ndarray) -> np.ndarray:
        return self.box[3] - (values - self.y[0]) / (self.y[1] - self.y[0]) * (self.box[3] - self.box[1])

    def _points(self, x: np.ndarray, y: np.ndarray) -> str:
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(self._x(x), self._y(y), strict=True))


def span(*values: np.ndarray, room: float = 0.04) -> tuple[float, float]:
    """The range of all finite values, with some room at both ends."""
    joined = np.concatenate([np.ravel(v) for v in values])
    joined = joined[np.isfinite(joined)]
    low, high = (float(joined.min()), float(joined.max())) if joined.size else (0.0, 1.0)
    return low - room * (high - low), high + room * (high - low)


def ticks(low: float, high: float, most: int) -> list[tuple[float, str]]:
    """At most so many round values in a range, with their text."""
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= rough * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    if digits <= 4 and max(abs(low), abs(high)) < 1e5:
        return [(i * step, f"{i * step + 0.0:.{digits}f}") for i in range(first, last + 1)]
    return [(i * step, f"{i * step:.3g}") for i in range(first, last + 1)]


def thinned(x: np.ndarray, y: np.ndarray, columns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x and the least and largest y in as many equal parts of x as can be drawn, each (columns,) or fewer."""
    edges = np.linspace(x[0], x[-1], columns + 1)
    first = np.unique(np.clip(np.searchsorted(x, edges[:-1]), 0, x.size - 1))
    return x[first], np.minimum.reduceat(y, first), np.maximum.reduceat(y, first)


def _opened(ends: tuple[float, float]) -> tuple[float, float]:
    """A range that is not empty."""
    low, high = ends
    if high > low:
        return low, high
    room = abs(low) or 1.0
    return low - 0.5 * room, high + 0.5 * room


def _finite(x: np.ndarray, y: np.ndarray) -> Sequence[slice]:
    """The stretches in which all is finite."""
    good = np.isfinite(x) & np.isfinite(y)
    return [slice(a, b) for a, b in true_stretches(good)]


def _text(x: float, y: float, text: str, anchor: str, more: str = "") -> str:
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{FONT:g}" fill="{QUIET}"{more}>'
        f"{html.escape(text)}</text>"
    )


def _width(name: str) -> float:
    return 36 + 0.55 * FONT * len(name)


def bars(name: str, entries: Sequence[tuple[str, float, str, str]], width: float = 460.0) -> str:
    """Horizontal bars from 0, one below the other: what each is, its value, the value in words, and its colour."""
    height, top = 22.0 * len(entries) + 4, max([value for _, value, _, _ in entries], default=0.0) or 1.0
    left = 12 + 0.6 * FONT * max(len(words) for words, _, _, _ in entries)
    room, parts = width - left - 80, []
    for number, (words, value, said, colour) in enumerate(entries):
        y = 22.0 * number + 4
        parts.append(_text(left - 6, y + 13, words, "end"))
        parts.append(f'<rect x="{left:g}" y="{y:g}" width="{room * value / top:.1f}" height="17" fill="{colour}"/>')
        parts.append(_text(left + room * value / top + 6, y + 13, said, "start"))
    title = html.escape(name)
    return (
        f'<svg viewBox="0 0 {width:g} {height:g}" style="max-width:{width:g}px" role="img" aria-label="{title}">'
        f"<title>{title}</title>{''.join(parts)}</svg>"
    )
