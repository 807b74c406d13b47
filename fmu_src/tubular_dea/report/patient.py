"""The recorded beat and the patient that was fitted to it, as a picture."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..model.units import factor
from ..patients.patient import Patient
from ..patients.recorded_beat import RecordedBeat
from .colours import COLOURS
from .figures import sized

MMHG, ML = factor("Pa", "mmHg"), factor("m3", "mL")


def draw(beat: RecordedBeat, found: Patient, figure: Figure | None = None) -> Figure:
    """Pressure (with its spread from beat to beat) and flow over one beat, in `figure` if it is given."""
    figure = sized(figure, 8, 5.5)
    top, bottom = figure.subplots(2, 1, sharex=True)
    time = beat.phase * beat.period
    top.fill_between(
        time,
        (beat.pressure - beat.spread) * MMHG,
        (beat.pressure + beat.spread) * MMHG,
        color="#9aa5b1",
        alpha=0.4,
        linewidth=0,
        label="± sd from beat to beat",
    )
    top.plot(time, beat.pressure * MMHG, color="#1b2733", label="recorded")
    top.plot(time, found.pressure * MMHG, color=COLOURS[0], label="fitted")
    top.set_ylabel("arterial pressure [mmHg]")
    if beat.flow is not None:
        bottom.plot(time, beat.flow * ML, color="#1b2733", label="recorded")
    bottom.plot(time, found.flow * ML, color=COLOURS[0], label="fitted")
    bottom.set_ylabel("aortic flow [mL/s]")
    bottom.set_xlabel("time [s]")
    bottom.set_xlim(0, float(np.max(time)))
    for axis in (top, bottom):
        axis.grid(alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
        axis.legend(loc="upper left", bbox_to_anchor=(1, 1), frameon=False, fontsize=8)
    return figure
