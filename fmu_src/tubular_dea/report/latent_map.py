"""Where a model fails: its residual over its output and an input, rising and falling separately."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from ..discover.engine import Discovery
from ..identify.study.nuisances import with_nuisances
from .parts import shown_unit, thinned


def latent_map(found: Discovery) -> go.Figure:
    """The residual of the first output in colour over output and input; rising and falling outputs separately."""
    plant = found.study.plant
    signal = next((s for s in plant.inputs if s.held), plant.inputs[0])
    y_scale, y_unit = shown_unit(plant.quantity(plant.outputs[0].name))
    u_scale, u_unit = shown_unit(plant.quantity(signal.name))
    drawn = make_subplots(rows=1, cols=2, subplot_titles=("rising", "falling"), shared_yaxes=True)
    answer, rate, driven, left = (np.concatenate(columns) for columns in zip(*_runs(found, signal.name), strict=True))
    limit = float(np.quantile(np.abs(left), 0.98)) or 1.0
    for column, chosen in ((1, rate >= 0), (2, rate < 0)):
        drawn.add_trace(
            go.Scattergl(
                x=answer[chosen] / y_scale,
                y=driven[chosen] / u_scale,
                mode="markers",
                marker={
                    "color": left[chosen] / y_scale,
                    "colorscale": "RdBu",
                    "cmin": -limit / y_scale,
                    "cmax": limit / y_scale,
                    "size": 6,
                    "showscale": column == 2,
                    "colorbar": {"title": y_unit},
                },
                hovertemplate=f"%{{x:.4g}} {y_unit}, %{{y:.4g}} {u_unit}: %{{marker.color:.3g}} {y_unit}"
                "<extra></extra>",
            ),
            row=1,
            col=column,
        )
    reading = plant.outputs[0].name.replace("_", " ")
    drawn.update_xaxes(title=f"{reading} [{y_unit}]")
    drawn.update_yaxes(title=f"{signal.name} [{u_unit}]", col=1)
    return drawn.update_layout(showlegend=False, height=420)


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
