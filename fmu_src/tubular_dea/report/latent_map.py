"""Where a model fails: its residual over its output and an input, rising and falling separately."""

from __future__ import annotations

import numpy as np

from ..discover.engine import Discovery
from ..identify.study.nuisances import with_nuisances
from .page import Drawing
from .parts import shown_unit, thinned

RISING, FALLING = (0.0, 0.45), (0.55, 1.0)  # of the width: the panels


def latent_map(found: Discovery) -> Drawing:
    """The residual of the first output in colour over output and input; rising and falling outputs separately."""
    plant = found.study.plant
    signal = next((s for s in plant.inputs if s.held), plant.inputs[0])
    y_scale, y_unit = shown_unit(plant.quantity(plant.outputs[0].name))
    u_scale, u_unit = shown_unit(plant.quantity(signal.name))
    answer, rate, driven, left = (np.concatenate(columns) for columns in zip(*_runs(found, signal.name), strict=True))
    limit = float(np.quantile(np.abs(left), 0.98)) or 1.0
    colours = {"colorscale": "RdBu", "cmin": -limit / y_scale, "cmax": limit / y_scale, "size": 6}
    points = {"type": "scattergl", "mode": "markers"}
    told = f"%{{x:.4g}} {y_unit}, %{{y:.4g}} {u_unit}: %{{marker.color:.3g}} {y_unit}<extra></extra>"
    drawn = []
    for axis, chosen in (("x", rate >= 0), ("x2", rate < 0)):
        bar = {"showscale": axis == "x2", "colorbar": {"title": {"text": y_unit}}}
        place = {"xaxis": axis, "x": answer[chosen] / y_scale, "y": driven[chosen] / u_scale, "hovertemplate": told}
        drawn.append(points | place | {"marker": colours | bar | {"color": left[chosen] / y_scale}})
    label = {"text": f"{plant.outputs[0].name.replace('_', ' ')} [{y_unit}]"}
    layout = {
        "xaxis": {"domain": RISING, "title": label},
        "xaxis2": {"domain": FALLING, "title": label},
        "yaxis": {"title": {"text": f"{signal.name} [{u_unit}]"}},
        "annotations": [_above(RISING, "rising"), _above(FALLING, "falling")],
    }
    return {"data": drawn, "layout": layout | {"showlegend": False, "height": 420}}


def _above(domain: tuple[float, float], text: str) -> Drawing:
    """The title of a panel, above its middle."""
    place = {"x": sum(domain) / 2, "y": 1, "xref": "paper", "yref": "paper", "xanchor": "center", "yanchor": "bottom"}
    return place | {"text": text, "showarrow": False, "font": {"size": 16}}


def _runs(found: Discovery, name: str) -> list[tuple[np.ndarray, ...]]:
    """Answer, its rate, input and residual of every piece's first output, averaged over blocks."""
    study, option = found.study, found.named
    made = []
    answers = study.response(option.ids, study.pieces).outputs(option.fitted.values)
    for piece, answer in zip(study.pieces, answers, strict=True):
        part, times = piece.case.parts[0], piece.case.readings[0].times
        left = (piece.record - with_nuisances(study, piece, answer))[part]
        driven = piece.case.protocol.at(times)[name]
        made.append(tuple(thinned(v) for v in (answer[part], np.gradient(answer[part], times), driven, left)))
    return made
