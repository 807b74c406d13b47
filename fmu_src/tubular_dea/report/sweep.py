"""The report of a sweep: its pictures as PNG files, and one HTML page with all of them that opens offline."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ..files import write_atomically
from ..model.declare import Model
from ..sweep.axes import Axis, Joint, Levels, Normal, grid_points
from ..sweep.plan import Plan
from ..sweep.rows import failures
from ..sweep.sensitivity import Distribution, Indices, Tornado, sobol_indices, spread, tornado
from ..sweep.shown import Shown, shown
from ..sweep.store import Store
from .equilibria import equilibrium_curves, snap_boundary
from .figures import png
from .page import Page
from .pictures import Bars, Curves, Histogram, Line, Map, Picture

MANY = 24  # outputs beyond these are in the table, not in pictures


def write_report(store: Store, plan: Plan) -> list[Path]:
    """Write DIR/report.html, DIR/*.png and, for sampled designs, DIR/statistics.json; returns their paths."""
    values = _values(store, plan)
    drawn = list(_pictures(plan, values))
    written = [write_atomically(store.folder / f"{p.name}.png", png(p.draw())) for p in drawn]
    page = Page(plan.name, f"{plan.design.rows} rows ({plan.design.kind.replace('_', ' ')}), model {plan.model.name}.")
    _describe(page, store, plan, shown(plan))
    statistics = _statistics(plan, values)
    if statistics:
        written.append(write_atomically(store.folder / "statistics.json", _json(statistics)))
        _spreads(page, statistics, shown(plan))
    for picture in drawn:
        page.figure(picture.plotly(), picture.caption)
    return [*written, page.write(store.folder / "report.html")]


def pictures(store: Store, plan: Plan) -> list[Picture]:
    """The pictures of the report, in its order."""
    return list(_pictures(plan, _values(store, plan)))


def _values(store: Store, plan: Plan) -> dict[str, np.ndarray]:
    return {w.column: store.column(w.column) for w in plan.outputs}


# Words and numbers ----------------------------------------------------------------------------------------------------


def _describe(page: Page, store: Store, plan: Plan, labels: dict[str, Shown]) -> None:
    page.table(["varies", "over"], [(a.name, _over(a, labels)) for a in plan.design.axes])
    if plan.fixed:
        page.table(["set", "to (SI)"], plan.fixed)
    failed = failures({"status": store.column("status")})
    if failed:
        page.text("Rows that could not be computed, with their reason in the column message:")
        page.table(["reason", "rows"], failed.items())


def _over(axis: Axis, labels: dict[str, Shown]) -> str:
    """What an axis goes over, in words."""
    if isinstance(axis, Joint):
        return "jointly normal: " + ", ".join(name for name, _ in axis.columns)
    if isinstance(axis, Levels):
        only = labels[axis.columns[0][0]]
        names = axis.labels or [f"{only.scale * row[0]:g} {only.unit}".rstrip() for row in axis.table]
        return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
    way = labels[axis.name]
    if isinstance(axis, Normal):
        return f"normal, {way.scale * axis.mean:g} +- {way.scale * axis.deviation:g} {way.unit}"
    notes = (f", {axis.count} points" if axis.count else "") + (", logarithmic" if axis.log else "")
    return f"{way.scale * axis.low:g} to {way.scale * axis.high:g} {way.unit}".rstrip() + notes


def _statistics(plan: Plan, values: dict[str, np.ndarray]) -> list[Indices | Tornado | Distribution]:
    design = plan.design
    if design.kind == "one_at_a_time":
        return [tornado(design, name, v) for name, v in values.items()]
    if design.kind == "grid":
        return []
    spreads = [s for s in (spread(name, v) for name, v in values.items()) if s]
    if design.kind != "sobol_indices":
        return list(spreads)
    indices = [i for i in (sobol_indices(design, name, v) for name, v in values.items()) if i]
    return [*spreads, *indices]


def _json(statistics: list[Indices | Tornado | Distribution]) -> bytes:
    plain = [
        {"kind": type(s).__name__.lower()}
        | {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in asdict(s).items()}
        for s in statistics
    ]
    return (json.dumps(plain, indent=1) + "\n").encode()


def _spreads(page: Page, statistics: list[Indices | Tornado | Distribution], labels: dict[str, Shown]) -> None:
    rows = []
    for s in statistics:
        if isinstance(s, Distribution):
            scale = labels[s.column].scale
            rows.append(
                (labels[s.column].label, s.count, *(f"{scale * v:.6g}" for v in (s.mean, s.deviation, *s.quantiles)))
            )
    if rows:
        page.table(["output", "rows", "mean", "standard deviation", "5 %", "median", "95 %"], rows)


# Pictures -------------------------------------------------------------------------------------------------------------


def _pictures(plan: Plan, values: dict[str, np.ndarray]) -> Iterator[Picture]:
    labels = shown(plan)
    if plan.design.kind == "grid":
        yield from _grid_pictures(plan, values, labels)
    for s in _statistics(plan, values)[:MANY]:
        if isinstance(s, Tornado):
            yield _tornado_bars(s, labels[s.column])
        elif isinstance(s, Indices):
            yield _sobol_bars(s, labels[s.column])
        elif plan.design.kind != "sobol_indices":
            yield _histogram(s, values[s.column], labels[s.column])
    if isinstance(plan.model, Model) and plan.model.curve:
        yield equilibrium_curves(plan)


def _grid_pictures(plan: Plan, values: dict[str, np.ndarray], labels: dict[str, Shown]) -> Iterator[Picture]:
    """Maps over the two longest axes, or curves over one, for every name of an axis with names."""
    axes, shape = plan.design.axes, plan.design.shape
    named = next((i for i, axis in enumerate(axes) if isinstance(axis, Levels) and axis.labels), None)
    candidates = [i for i in range(len(axes)) if i != named and shape[i] > 1]
    long = sorted(sorted(candidates, key=lambda i: -shape[i])[:2])
    if not long:
        return
    others = {axes[i].name: shape[i] // 2 for i in candidates if i not in long}
    note = f" Other axes are at point {', '.join(f'{v} of {k}' for k, v in others.items())}." if others else ""
    view = _View(plan, named, tuple(long), note, labels)
    for name, all_values in list(values.items())[:MANY]:
        cube = labels[name].scale * all_values.reshape(shape)
        yield from view.curves(name, cube) if len(long) == 1 else view.maps(name, cube)


@dataclass(frozen=True)
class _View:
    """A cut through a grid: the axes `long` are drawn, the names of the axis `named` are gone through."""

    plan: Plan
    named: int | None
    long: tuple[int, ...]
    note: str
    labels: dict[str, Shown]

    def cuts(self, cube: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
        """Every name and the values over the drawn axes, the others in their middle."""
        axes = self.plan.design.axes
        names: tuple[str, ...] = ("",)
        if self.named is not None:
            axis = axes[self.named]
            names = axis.labels if isinstance(axis, Levels) else names
        for k, name in enumerate(names):
            at = [slice(None) if i in self.long else k if i == self.named else n // 2 for i, n in enumerate(cube.shape)]
            yield name, cube[tuple(at)]

    def points(self, i: int) -> tuple[str, np.ndarray]:
        """Label and points of a drawn axis."""
        axis = self.plan.design.axes[self.long[i]]
        shown_as = self.labels[axis.name]
        values = grid_points(axis)[axis.name]
        return shown_as.label, np.asarray(values, float) * shown_as.scale

    def curves(self, name: str, cube: np.ndarray) -> Iterator[Curves]:
        """One picture with a curve for every name."""
        label, x = self.points(0)
        lines = tuple(Line(who, x, y, k) for k, (who, y) in enumerate(self.cuts(cube)))
        text = self.labels[name].label
        yield Curves(name, f"{text} over {label}.{self.note}", lines, (label, text))

    def maps(self, name: str, cube: np.ndarray) -> Iterator[Map]:
        """One picture for every name."""
        (x_label, x), (y_label, y) = self.points(0), self.points(1)
        text = self.labels[name].label
        first, second = (self.plan.design.axes[i] for i in self.long)
        boundary = snap_boundary(self.plan, first, second, self.labels)
        grey = " Grey: no rest state." if self.plan.study == "rest" else ""
        for who, z in self.cuts(cube):
            caption = f"{f'{who}: ' if who else ''}{text} over {x_label} and {y_label}.{self.note}{grey}"
            yield Map(f"{name}_{who}" if who else name, caption, x, y, z.T, (x_label, y_label, text), boundary)


def _tornado_bars(s: Tornado, label: Shown) -> Bars:
    order = np.argsort(-np.nan_to_num(np.abs(s.high - s.low)))
    names = tuple(s.factors[i] for i in order)
    middle = np.full(order.size, s.middle * label.scale)
    groups = (("low", middle, s.low[order] * label.scale, None), ("high", middle, s.high[order] * label.scale, None))
    caption = f"{label.label} as each axis alone goes to its low and its high end, the others in the middle."
    return Bars(f"tornado_{s.column}", caption, names, groups, label.label, s.middle * label.scale, stacked=True)


def _sobol_bars(s: Indices, label: Shown) -> Bars:
    zero = np.zeros(len(s.factors))
    groups = (("first", zero, s.first, s.first_interval), ("total", zero, s.total, s.total_interval))
    caption = (
        f"Sobol indices of {label.label}: the share of its variance that each factor makes alone (first) "
        "and with others (total), with 95 % intervals."
    )
    return Bars(f"sobol_{s.column}", caption, s.factors, groups, "share of the variance")


def _histogram(s: Distribution, values: np.ndarray, label: Shown) -> Histogram:
    counts, edges = np.histogram(
        values[np.isfinite(values)] * label.scale, bins=min(60, max(10, int(np.sqrt(s.count))))
    )
    marks = tuple(q * label.scale for q in s.quantiles)
    caption = f"{label.label} of {s.count} rows; the lines are at 5, 50 and 95 %."
    return Histogram(f"histogram_{s.column}", caption, edges, counts, marks, label.label)
