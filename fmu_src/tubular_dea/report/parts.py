"""Parts that several reports share: a record with its models, and a row of a table of parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..model.declare import Model, Quantity
from ..model.units import factor, readable, with_ends
from .colours import COLOURS
from .page import Drawing

POINTS = 700  # drawn of each record: averages over as many blocks
RECORD, BEFORE, AFTER = "#1b2733", COLOURS[0], COLOURS[1]


def record_and_residuals(
    time: np.ndarray, record: np.ndarray, models: Mapping[str, np.ndarray], axis: str, residual: tuple[str, float]
) -> Drawing:
    """A record (n,) over `time` (n,) with one or two models by legend name above, what they leave below.

    `axis` is the label of the record; `residual` the label of what is left, and the factor to its unit. There is one a
    recording: as plotly's objects each takes 0.2 s.
    """
    t, (label, scale) = thinned(time), residual
    drawn: list[Drawing] = [
        {"type": "scatter", "x": t, "y": thinned(record), "name": "record", "line": {"color": RECORD}}
    ]
    for (name, values), colour in zip(models.items(), (BEFORE, AFTER), strict=False):
        line = {"type": "scatter", "x": t, "name": name, "line": {"color": colour, "width": 1.5}}
        drawn.append(line | {"y": thinned(values)})
        drawn.append(line | {"y": thinned(record - values) * scale, "yaxis": "y2", "showlegend": False})
    layout = {
        "height": 460,
        "xaxis": {"anchor": "y2", "title": {"text": "time [s]"}},
        "yaxis": {"domain": [0.483, 1.0], "title": {"text": axis}},
        "yaxis2": {"domain": [0.0, 0.423], "title": {"text": label}},
    }
    return {"data": drawn, "layout": layout}


def percent(share: float) -> str:
    """A share (0 to 1) in words: only nothing is 0 %, only all of it is 100 %."""
    if 0 < share < 0.005:
        return "less than 1%"
    return "more than 99%" if 0.995 <= share < 1 else f"{share:.0%}"


def thinned(values: np.ndarray) -> np.ndarray:
    """Averages over as many equal blocks as are drawn."""
    size = max(1, values.size // POINTS)
    return values[: values.size // size * size].reshape(-1, size).mean(axis=1)


def bars(values: Mapping[str, float], label: str, line: float | None = None) -> Drawing:
    """Named values as horizontal bars in their order, the first on top; `line` marks a value to compare with."""
    drawn = {"type": "bar", "x": list(values.values()), "y": list(values), "orientation": "h"}
    layout: Drawing = {
        "height": 120 + 24 * len(values),
        "xaxis": {"title": {"text": label}},
        "yaxis": {"autorange": "reversed", "automargin": True},
    }
    if line is not None:
        mark = {"color": BEFORE, "width": 2}
        layout["shapes"] = [
            {"type": "line", "x0": line, "x1": line, "y0": 0, "y1": 1, "yref": "y domain", "line": mark}
        ]
    return {"data": [drawn | {"marker": {"color": AFTER}}], "layout": layout}


def parameter_row(name: str, p: Mapping[str, Any], *others: float, told: bool = True) -> list[str]:
    """Name, value, 95 % interval and unit of a parameter of result.json, then other values of it in that unit.

    Unless the records have `told` it, there is no interval: from it nobody could read more.
    """
    scale, unit = readable(p["value"], p["unit"])
    value, low, high = with_ends(p["value"] / scale, [None if e is None else e / scale for e in p["ci95"]], least=4)
    return [name, value, f"{low} to {high}" if told else "not determined", unit, *(f"{o / scale:.4g}" for o in others)]


def shown_unit(quantity: Quantity) -> tuple[float, str]:
    """Factor and name of the unit in which a quantity is shown: the customary one where it has one."""
    unit = quantity.display_unit or quantity.unit
    return factor(unit, quantity.unit), unit


def usual_scale(value: float, unit: str, model: Model) -> tuple[float, str]:
    """As `readable`; for a unit that takes no prefix (m3/s) the one in which `model` shows such quantities."""
    alike = [q for q in model.quantities().values() if q.display_unit and q.unit == unit]
    return shown_unit(alike[0]) if alike and unit[1:2].isdigit() else readable(value, unit)
