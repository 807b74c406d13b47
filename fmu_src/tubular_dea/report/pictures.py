"""The pictures of a sweep, each drawn twice from the same numbers: as a PNG, and to be zoomed in the report."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go
from matplotlib.figure import Figure

from .colours import COLOURS
from .figures import legend_above, sized

BOUNDARY = "#1b2733"
NOTHING = "#dde3e8"  # where there is no value


@dataclass(frozen=True)
class Boundary:
    """A curve on a map, and the polygon `beyond` it if there is nothing there."""

    name: str
    x: np.ndarray
    y: np.ndarray
    beyond: tuple[np.ndarray, ...] = ()


@dataclass(frozen=True)
class Map:
    """An output over two axes, z of shape (y, x), NaN where there is none; a `boundary` may be drawn on top."""

    name: str
    caption: str
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    labels: tuple[str, str, str]
    boundary: Boundary | None = None

    def draw(self, figure: Figure | None = None) -> Figure:
        """Drawn with matplotlib, in `figure` if it is given."""
        figure, axis = _axes(figure)
        z = np.ma.masked_invalid(self._drawn())
        mesh = axis.pcolormesh(self.x, self.y, z, shading="nearest", cmap="viridis", rasterized=True)
        axis.set_facecolor(NOTHING)
        figure.colorbar(mesh, ax=axis, label=self.labels[2])
        if self.boundary:
            axis.fill(*self.boundary.beyond, color=NOTHING)
            axis.plot(self.boundary.x, self.boundary.y, color=BOUNDARY, linewidth=2, label=self.boundary.name)
            legend_above(axis)
        axis.set(xlabel=self.labels[0], ylabel=self.labels[1], xlim=_ends(self.x), ylim=_ends(self.y))
        return figure

    def plotly(self) -> go.Figure:
        """Drawn with plotly."""
        bar = {"title": {"text": self.labels[2], "side": "right"}}
        figure = go.Figure(go.Heatmap(x=self.x, y=self.y, z=self._drawn(), colorscale="Viridis", colorbar=bar))
        if self.boundary:
            if self.boundary.beyond:
                x, y = self.boundary.beyond
                figure.add_scatter(
                    x=x, y=y, fill="toself", fillcolor=NOTHING, mode="none", showlegend=False, hoverinfo="skip"
                )
            figure.add_scatter(
                x=self.boundary.x,
                y=self.boundary.y,
                name=self.boundary.name,
                mode="lines",
                showlegend=True,
                line={"color": BOUNDARY, "width": 3},
            )
        figure.update_xaxes(title=self.labels[0], range=_ends(self.x))
        figure.update_yaxes(title=self.labels[1], range=_ends(self.y))
        return figure.update_layout(plot_bgcolor=NOTHING)

    def _drawn(self) -> np.ndarray:
        """z, and up to a boundary also in the cells that it cuts: they take the mean of their neighbours."""
        z = np.asarray(self.z, float)
        for _ in range(2 if self.boundary and self.boundary.beyond else 0):
            padded = np.pad(z, 1, constant_values=np.nan)
            around = np.stack([padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:]])
            there = np.isfinite(around)
            mean = np.where(there, around, 0.0).sum(0) / np.where(there.any(0), there.sum(0), np.nan)
            z = np.where(np.isfinite(z), z, mean)
        return z


@dataclass(frozen=True)
class Line:
    """One curve of `Curves`; `dashed` for what is unstable, `marks` for single points."""

    name: str
    x: np.ndarray
    y: np.ndarray
    colour: int | None = 0  # None: of no line in particular
    dashed: bool = False
    marks: bool = False

    @property
    def shade(self) -> str:
        """The colour as it is drawn."""
        return BOUNDARY if self.colour is None else COLOURS[self.colour % len(COLOURS)]


@dataclass(frozen=True)
class Curves:
    """Lines over a common axis; those without a name are not in the legend."""

    name: str
    caption: str
    lines: tuple[Line, ...]
    labels: tuple[str, str]

    def draw(self, figure: Figure | None = None) -> Figure:
        """Drawn with matplotlib, in `figure` if it is given."""
        figure, axis = _axes(figure)
        for line in self.lines:
            style = {"linestyle": "none", "marker": "o"} if line.marks else {"linestyle": "--" if line.dashed else "-"}
            axis.plot(line.x, line.y, color=line.shade, label=line.name or None, **style)
        if 1 < sum(bool(line.name) for line in self.lines) <= 12:
            legend_above(axis)
        axis.grid(alpha=0.3)
        axis.set(xlabel=self.labels[0], ylabel=self.labels[1])
        return figure

    def plotly(self) -> go.Figure:
        """Drawn with plotly."""
        figure = go.Figure()
        for line in self.lines:
            style = {"color": line.shade, "dash": "dash" if line.dashed else "solid"}
            marker = {"color": line.shade, "size": 9}
            mode = "markers" if line.marks else "lines"
            figure.add_scatter(
                x=line.x, y=line.y, name=line.name, showlegend=bool(line.name), line=style, marker=marker, mode=mode
            )
        return figure.update_xaxes(title=self.labels[0]).update_yaxes(title=self.labels[1])


@dataclass(frozen=True)
class Bars:
    """Horizontal bars from `start` to `end` for each factor, in groups by colour; `error` is a half width."""

    name: str
    caption: str
    factors: tuple[str, ...]
    groups: tuple[tuple[str, np.ndarray, np.ndarray, np.ndarray | None], ...]
    label: str
    base: float = 0.0
    stacked: bool = False

    def draw(self, figure: Figure | None = None) -> Figure:
        """Drawn with matplotlib, in `figure` if it is given."""
        figure, axis = _axes(figure, 1.4 + 0.45 * len(self.factors) * (1 if self.stacked else 1.4))
        place = np.arange(len(self.factors), dtype=float)[::-1]
        width = 0.7 if self.stacked else 0.8 / len(self.groups)
        for k, (name, start, end, error) in enumerate(self.groups):
            at = place if self.stacked else place + 0.4 - width * (k + 0.5)
            axis.barh(at, end - start, width, left=start, color=COLOURS[k], label=name, xerr=error, capsize=3)
        axis.axvline(self.base, color=BOUNDARY, linewidth=1)
        axis.set_yticks(place, self.factors)
        legend_above(axis)
        axis.set_xlabel(self.label)
        axis.grid(alpha=0.3, axis="x")
        return figure

    def plotly(self) -> go.Figure:
        """Drawn with plotly."""
        figure = go.Figure()
        for name, start, end, error in self.groups:
            bars = None if error is None else {"type": "data", "array": error}
            figure.add_bar(y=self.factors, x=end - start, base=start, orientation="h", name=name, error_x=bars)
        figure.update_layout(barmode="overlay" if self.stacked else "group", height=180 + 45 * len(self.factors))
        figure.add_vline(x=self.base, line_color=BOUNDARY)
        return figure.update_xaxes(title=self.label).update_yaxes(autorange="reversed")


@dataclass(frozen=True)
class Histogram:
    """How often values of an output occur: `counts` between `edges`; quantiles are marked."""

    name: str
    caption: str
    edges: np.ndarray
    counts: np.ndarray
    marks: tuple[float, ...]
    label: str

    def draw(self, figure: Figure | None = None) -> Figure:
        """Drawn with matplotlib, in `figure` if it is given."""
        figure, axis = _axes(figure)
        axis.stairs(self.counts, self.edges, fill=True, color=COLOURS[1])
        for mark in self.marks:
            axis.axvline(mark, color=COLOURS[0], linewidth=1.2)
        axis.set(xlabel=self.label, ylabel="rows")
        return figure

    def plotly(self) -> go.Figure:
        """Drawn with plotly."""
        middle, width = (self.edges[1:] + self.edges[:-1]) / 2, np.diff(self.edges)
        figure = go.Figure(go.Bar(x=middle, y=self.counts, width=width, marker={"color": COLOURS[1]}))
        for mark in self.marks:
            figure.add_vline(x=mark, line_color=COLOURS[0])
        return figure.update_xaxes(title=self.label).update_yaxes(title="rows")


Picture = Map | Curves | Bars | Histogram


def _axes(figure: Figure | None, height: float = 4.6) -> tuple[Figure, Any]:
    figure = sized(figure, 7.6, height)
    axis = figure.subplots()
    axis.spines[["top", "right"]].set_visible(False)
    return figure, axis


def _ends(values: np.ndarray) -> list[float]:
    return [float(np.min(values)), float(np.max(values))]
