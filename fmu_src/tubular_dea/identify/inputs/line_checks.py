"""Whether an input may drive a model: how far its line misses the record, and what is unknown between samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...protocol import Protocol
from ..records.experiment import DataError, Experiment
from ..signals.monitors import LARGEST, WRONG, resolution
from ..signals.sampling import usual_step
from .band import JITTER, off_even
from .edges import Edge
from .held import HeldLine
from .transitions import Transitions

# Set by judgement. Check: `pytest tests/test_edges.py tests/test_monitors.py`,
# `python -m blind.score --nulls 12 --conventions edges rounded --seed 1000`
NEAR_EDGE = 2  # [samples] from an edge within which a record is no measure of the line's error
HARMLESS = 1e-3  # [1] of its span by which a line may miss its record, whatever the noise is
CUBIC = np.array([1, 0, -9, 16, -9, 0, 1]) / 16  # [1] times seven samples: the middle one less a cubic beside it
COARSE_INPUT = 0.01  # [1] of its span: what may be unknown of an input between its samples


def line_error(
    experiment: Experiment,
    name: str,
    line: HeldLine,
    noise: float,
    found: Transitions | None = None,
    edges: Sequence[Edge] = (),
    delay: float = 0.0,
    hum: np.ndarray | float = 0.0,
) -> float:
    """How far a line misses its record (rms) where no edge is near; `DataError` where that is more than noise."""
    time, values = experiment.time, experiment.inputs[name] - hum
    step = usual_step(time)
    near = np.zeros(time.size, dtype=bool)
    for edge in edges:
        begin, end = edge.corners[0][[0, -1]] * edge.rise / 2 + np.array([-NEAR_EDGE, NEAR_EDGE]) * step
        near[slice(*np.searchsorted(time, [edge.earliest + begin, edge.latest + end]))] = True
    for before, after in zip(found.before, found.after, strict=True) if found is not None else ():
        near[before : after + 1] = True
    if near.all():
        return 0.0
    left = (values - Protocol(line.time, {"": line.values}).at(time + delay)[""])[~near]
    error = float(np.sqrt(np.mean(left**2)))
    coarse = resolution(experiment.inputs[name])
    small = HARMLESS * float(np.ptp(values))  # what a filter that rings leaves
    if error > max(WRONG * float(np.hypot(noise, coarse / 2)), small):  # a coarse monitor may toggle
        raise DataError(
            f"{experiment.name}, column {name!r}: the line drawn through it misses it by {error:.3g} (rms, SI units), "
            f"but its noise is {noise:.3g}; expected a monitor that the model can be driven by: look at this column"
        )
    return error


def check_sampling(experiment: Experiment, name: str, noise: float, stated: bool) -> None:
    """`DataError` where an input moves so much between samples that its values there are unknown.

    The error over one omitted sample is measured, of a straight line or of the cubic through the four next to it, which
    a line follows where it is curved; over half the distance it is a quarter of that, at most. Noise that is not
    `stated` may be the signal itself, and only a little of it counts.
    """
    time, values = experiment.time, experiment.inputs[name]
    if time.size < 3:
        return
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    omitted = [(values[1:-1] - (1 - share) * values[:-2] - share * values[2:], 1.5)]
    if values.size >= CUBIC.size:
        omitted.append((np.convolve(values, CUBIC, mode="valid"), float(CUBIC @ CUBIC)))
    span = float(np.abs(values).max())  # of a record that holds still, the range is noise
    noise = noise if stated else min(noise, LARGEST * span)
    missed = float(np.mean(omitted[0][0] ** 2))
    unknown = min(float(np.sqrt(max(float(np.mean(o**2)) - power * noise**2, 0.0))) / 4 for o, power in omitted)
    allowed = max(noise, COARSE_INPUT * span)
    if unknown <= allowed:
        return
    rate = 1 / usual_step(time)
    curves = ", band_limited=True (a smooth curve through all samples)" if off_even(time) <= JITTER else ""
    raise DataError(
        f"{experiment.name}, column {name!r}: sampled at {rate:.3g} Hz it moves so fast that between samples it is "
        f"unknown by {unknown:.3g} (rms, SI units), beside a noise of {noise:.3g}; expected a rate that follows it: "
        f"record at {np.ceil(np.sqrt(unknown / allowed)) * rate:.3g} Hz, or say how these records are to be read: in "
        "your own plant's declaration the input held=True (each value holds until the next; with mean=True, it is "
        f"the mean over the time before, as of a meter){curves}, or, if what is fast is noise, "
        f"`{name} = {np.sqrt(missed / 1.5):.2g}` under [noise] in bench.toml (a number is in SI units): "
        "what that moves is not missed then, and hides effects of its size"
    )
