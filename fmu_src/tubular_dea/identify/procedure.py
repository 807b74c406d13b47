"""How parameters are found: the paper's way in stages, and all of them jointly.

The paper fixes what an experiment says little about: C_1 and eps_r come from the ramp with the lowest voltage, C_2
and C_3 from the ramp with the highest, the viscous parameters from a step. The joint fit takes every experiment and
every parameter at once, from where the stages end.

Table II starts both Maxwell branches with the same values. There the cost has a saddle (the branches are
exchangeable), so the stages move them apart by their relaxation times.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import UserError
from ..kernel import Kernel
from ..model.declare import Model
from . import noise as noises
from .bench import Bench
from .data import Experiment, Recordings
from .doubt import with_monitors
from .drive import Drive, drive
from .fit import Fit, FitError, fit
from .noise import Noise
from .problem import Free, Problem
from .response import Case, Response

ELASTIC_LOW, ELASTIC_HIGH = ("C_1", "eps_r"), ("C_2", "C_3")
VISCOUS = ("eta_o", "k_1", "eta_1", "k_2", "eta_2")
EXCHANGED = {"k_1": "k_2", "k_2": "k_1", "eta_1": "eta_2", "eta_2": "eta_1"}  # the branches, told apart by order only
TABLE_II = {
    "C_1": 195e3, "C_2": -1.5e3, "C_3": 2.5e3, "eps_r": 2.8, "eta_o": 500e3,
    "k_1": 10e6, "eta_1": 500e3, "k_2": 10e6, "eta_2": 500e3,
}  # fmt: skip
JUMP = 0.2  # of the largest voltage: an experiment with such a jump is a step, one without is a ramp

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Prepared:
    """Experiments with their drives and noise, ready for problems."""

    experiments: list[Experiment]
    drives: list[Drive]
    cases: list[Case]
    noise: Noise
    kernel: Kernel
    bench: Bench
    geometry: dict[str, float]

    def problem(self, free: Sequence[Free], fixed: Mapping[str, float], chosen: Sequence[int] | None = None) -> Problem:
        """The least squares problem over some of the experiments (all of them)."""
        chosen = range(len(self.experiments)) if chosen is None else chosen
        response = Response(self.kernel, [self.cases[i] for i in chosen], self.bench.measured, self.geometry)
        records = [self.experiments[i].output[self.experiments[i].seen] for i in chosen]
        return Problem(response, records, self.noise, list(free), dict(fixed) | self.geometry)


def prepare(recordings: Recordings, model: Model) -> Prepared:
    """Monitors without their noise, and the sensor's noise, for all experiments."""
    drives = [drive(e, recordings.bench, recordings.noise) for e in recordings.experiments]
    noise = sensor_noise(recordings, drives)
    cases = [Case(d.protocol, e.time[e.seen]) for d, e in zip(drives, recordings.experiments, strict=True)]
    kernel, geometry = Kernel(model), dict(recordings.geometry)
    return Prepared(recordings.experiments, drives, cases, noise, kernel, recordings.bench, geometry)


def sensor_noise(recordings: Recordings, drives: Sequence[Drive]) -> Noise:
    """The noise of the sensor: as bench.toml states it, else from quiet stretches of all records."""
    records = []
    for experiment, driven in zip(recordings.experiments, drives, strict=True):
        seen = experiment.seen
        records.append((experiment.time[seen], experiment.output[seen], np.unique(driven.protocol.time)))
    found = noises.estimate(records)
    stated = next((recordings.noise[n] for n in recordings.bench.output_names if n in recordings.noise), None)
    floor = 1e-6 * max(float(np.nanmax(np.abs(e.output))) for e in recordings.experiments)
    return Noise(max(stated or found.rms, floor), found.correlation, np.inf if stated else found.freedom)


def free_parameters(model: Model, start: Mapping[str, float], names: Sequence[str] | None = None) -> list[Free]:
    """The tunable parameters of a model (or those of `names`), sized by their starting values."""
    listed = [p.quantity for p in model.parameters if p.tunable and (names is None or p.quantity.name in names)]
    unknown = sorted(set(names or ()) - {q.name for q in listed})
    if unknown:
        raise UserError(f"{model.name} has no tunable parameter {unknown[0]!r}; expected some of "
                        f"{', '.join(p.quantity.name for p in model.parameters if p.tunable)}")  # fmt: skip
    return [Free(q.name, abs(start[q.name]) or 1.0, q.minimum, q.maximum, q.minimum is not None and q.minimum > 0)
            for q in listed]  # fmt: skip


def staged(
    ready: Prepared, model: Model, start: Mapping[str, float], tell: Progress = lambda what: None
) -> dict[str, float]:
    """The paper's procedure; returns all parameters (SI)."""
    low, high, step = stages(ready)
    values = dict(start)
    for names, chosen, words in ((ELASTIC_LOW, low, "C_1 and eps_r from the lowest ramp"),
                                 (ELASTIC_HIGH, high, "C_2 and C_3 from the highest ramp"),
                                 (ELASTIC_LOW + ELASTIC_HIGH, [*low, *high], "the elastic ones from both ramps"),
                                 (VISCOUS, step, "the viscous ones from a step")):  # fmt: skip
        tell(words)
        if names == VISCOUS:
            values = _apart(values)
        problem = ready.problem(free_parameters(model, values, names), values, chosen)
        values = _from_anywhere(problem, values)
    return ordered(values)


def ordered(values: Mapping[str, float]) -> dict[str, float]:
    """Branches may be exchanged: the faster one is called the first, as in Table III."""
    if values["k_1"] / values["eta_1"] >= values["k_2"] / values["eta_2"]:
        return dict(values)
    return {name: values[EXCHANGED.get(name, name)] for name in values}


def ordered_fit(problem: Problem, best: Fit) -> Fit:
    """The same for a fit, its covariance and its Jacobian; as it is where some of the branches' parameters are held."""
    values = ordered(best.values)
    if values == best.values or not set(EXCHANGED) <= set(best.names):
        return best
    order = [best.names.index(EXCHANGED.get(n, n)) for n in best.names]
    stderr = {n: best.stderr[EXCHANGED.get(n, n)] for n in best.names}
    return replace(best, values=values, scaled=problem.scaled(values), stderr=stderr,
                   jacobian=best.jacobian[:, order], covariance=best.covariance[np.ix_(order, order)])  # fmt: skip


def joint(ready: Prepared, model: Model, start: Mapping[str, float], starts: int = 3, seed: int = 0,
          names: Sequence[str] | None = None) -> tuple[Problem, Fit]:  # fmt: skip
    """All parameters (or `names`) from all experiments at once, from several starts around `start`.

    The branches are ordered (`ordered_fit`), and the doubt counts the monitors' noise (`doubt.with_monitors`).
    """
    problem = ready.problem(free_parameters(model, start, names), start)
    samples = sum(r.size for r in problem.records)
    if samples < 10 * len(problem.free):
        raise UserError(f"{samples} samples are too few for {len(problem.free)} parameters; expected at least "
                        f"{10 * len(problem.free)}: record longer, or free fewer with --free")  # fmt: skip
    best = ordered_fit(problem, fit(problem, start, starts, 0.1, seed))
    return problem, with_monitors(problem, best, ready.drives)


def stages(ready: Prepared) -> tuple[list[int], list[int], list[int]]:
    """Which experiments serve the stages: the lowest ramp, the highest ramp, a step (all, where there is none)."""
    everything = list(range(len(ready.experiments)))
    voltages = [np.asarray(c.protocol.inputs["voltage"]) for c in ready.cases]
    heights = [float(np.abs(v).max()) for v in voltages]
    top = max(heights)
    driven = [i for i in everything if heights[i] > 0.1 * top]
    ramps = [
        i
        for i in driven
        if np.abs(np.diff(voltages[i])[np.diff(ready.cases[i].protocol.time) == 0]).max(initial=0) < JUMP * top
    ]
    steps = [i for i in driven if i not in ramps]
    by_height = sorted(ramps, key=lambda i: heights[i])
    few = sorted(steps, key=lambda i: (len(ready.cases[i].protocol.time), heights[i]))
    return by_height[:1] or everything, by_height[-1:] or everything, few[:1] or everything


def _apart(values: Mapping[str, float]) -> dict[str, float]:
    """Branches with equal relaxation times get different ones: a fast and a slow one."""
    moved = dict(values)
    if abs(values["eta_1"] / values["k_1"] - values["eta_2"] / values["k_2"]) < 1e-3 * values["eta_1"] / values["k_1"]:
        moved["eta_1"], moved["eta_2"] = values["eta_1"] * 5, values["eta_2"] * 25
    return moved


def _from_anywhere(problem: Problem, start: Mapping[str, float]) -> dict[str, float]:
    """From the start, or from stiffer tubes where the model has no answer there."""
    best: Fit | None = None
    for stiffer in (1.0, 1.3, 1.8):
        moved = {n: v * (stiffer if n == "C_1" and n in problem.names else 1.0) for n, v in start.items()}
        try:
            found = fit(problem, moved, 1, evaluations=40)
        except FitError:
            continue
        if best is None or found.cost < best.cost:
            best = found
        if best.converged and best.cost < 4 * best.residual.size:
            break
    if best is None:
        raise FitError("the model has no answer at the starting values; expected parameters under which the tube "
                       "carries the recorded pressures: try a larger C_1")  # fmt: skip
    return dict(start) | best.values
