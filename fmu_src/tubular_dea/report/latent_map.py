"""Where a model fails: its residual as the pressure that would explain it, over stretch, rate and voltage."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from ..discover.engine import Discovery
from ..discover.inputs_noise import input_gains
from .parts import thinned

LEAST_GAIN = 0.1  # of the largest: where pressure hardly moves the tube, no pressure explains anything


def latent_map(found: Discovery) -> go.Figure:
    """The latent force in colour over stretch and voltage; stretching and returning apart."""
    drawn = make_subplots(rows=1, cols=2, subplot_titles=("stretching", "returning"), shared_yaxes=True)
    stretch, speed, voltage, left = (np.concatenate(columns) for columns in zip(*_runs(found), strict=True))
    limit = float(np.quantile(np.abs(left), 0.98)) or 1.0
    for column, rising in ((1, speed >= 0), (2, speed < 0)):
        drawn.add_trace(go.Scattergl(
            x=stretch[rising], y=voltage[rising] / 1e3, mode="markers",
            marker={"color": left[rising], "colorscale": "RdBu", "cmin": -limit, "cmax": limit, "size": 6,
                    "showscale": column == 2, "colorbar": {"title": "Pa"}},
            customdata=np.column_stack([speed[rising], left[rising]]),
            hovertemplate="%{x:.3f}, %{y:.2f} kV, rate %{customdata[0]:.3f}/s: %{customdata[1]:.0f} Pa<extra></extra>",
        ), row=1, col=column)  # fmt: skip
    drawn.update_xaxes(title="lambda_2").update_yaxes(title="voltage [kV]", col=1)
    return drawn.update_layout(showlegend=False, height=420)


def _runs(found: Discovery) -> list[tuple[np.ndarray, ...]]:
    """Stretch, rate, voltage and latent pressure of every piece, averaged over blocks."""
    kernel, values = found.study.compiled.kernel(found.chosen.ids), found.chosen.fitted.values
    gains = input_gains(found.study, found.base.fitted.values)["pressure"]
    made = []
    for piece, gain in zip(found.study.pieces, gains, strict=True):
        run = kernel.simulate(piece.case.protocol, piece.case.times, found.study.geometry | values)
        left = (piece.record - run[found.study.measured]) / np.maximum(gain, LEAST_GAIN * float(np.max(gain)))
        made.append(tuple(thinned(v) for v in (run["lambda_2"], run["lambda_2_rate"], run["voltage"], left)))
    return made
