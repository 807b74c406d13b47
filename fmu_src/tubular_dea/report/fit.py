"""The picture of a fit: the experiment that it misses most."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure

from ..identify.fitting.fit import Fit
from ..identify.study.nuisances import with_nuisances
from ..identify.study.study import Study
from .figures import panels_figure
from .parts import shown_unit


def worst_fit(work: Study, best: Fit, errors: Mapping[str, Mapping[str, Any]], figure: Figure | None = None) -> Figure:
    """Record, model and residual of the experiment with the largest of `errors` (rmse by name)."""
    model = work.plant.model
    worst = max((p for p in work.training if p.name in errors), key=lambda p: errors[p.name]["rmse"])
    answer = work.response((), [worst]).outputs(best.values)[0]
    part, reading = worst.case.parts[0], worst.case.readings[0]
    record, answer = worst.record[part], with_nuisances(work, worst, answer)[part]
    scale, unit = shown_unit(model.quantity(reading.output))
    heading = reading.output.replace("_", " ")  # the heading in the files may be that of another quantity
    panels = [
        (f"{heading} [{unit}]", {"record": record / scale, "model": answer / scale}),
        (f"residual [{unit}]", {"": (record - answer) / scale}),
    ]
    return panels_figure(reading.times, panels, f"{worst.name}: the largest misfit", figure)
