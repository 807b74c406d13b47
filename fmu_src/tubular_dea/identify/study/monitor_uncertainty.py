"""The uncertainty of parameters due to the noise of the monitors.

The lines that `drive` fits to a continuous monitor (`monitors.polyline`) have errors, because noise moves their
corners. These errors drive the model slowly, and so act like a change of parameters. The corners are a linear fit to
the monitor's samples, so their covariance is known. The model's static gain and the normal equations of the fit
convert it into a covariance of the parameters, whose uncertainty increases by 3 to 20 % on a bench. The levels of held
inputs and the choice of the corners' positions are not included. Where a held input switches is unknown to a sample: by
what all its edges may have happened earlier or later together, a delay of that input is unknown, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import solveh_banded

from ...emit.jacobian import real
from ...emit.variables import direct_dependencies
from ...protocol import Protocol
from ..fitting.cases import Case
from ..fitting.fit import Fit
from ..fitting.problem import Problem
from ..fitting.response import Response
from ..records.start import FIRST_SAMPLES
from ..signals.quiet import Clock
from ..threads import side_by_side
from .instants import untold_delay
from .remembered import left_between
from .study import Piece

# Set by judgement: small against any curvature, large against the integrator's tolerance.
# Check: `pytest tests/test_identify.py::test_linearised_intervals_hold`, `python -m blind.coverage --trials 60`
INPUT_STEP = 4e-3  # [1] of an input's largest value: shift at which its gain is taken
CHUNK = 200  # [1] corners at a time, so that a monitor with one at every sample fits into memory
UNASKED = 1e-9  # [1] of the largest information, added: corners that no sample asks for have an answer
WHITENING_REACH = 100  # [samples] over which whitening carries a value on


def with_monitor_noise(problem: Problem, best: Fit, pieces: Sequence[Piece], levels: Mapping[str, float]) -> Fit:
    """The fit with a covariance and standard errors that include the monitors' noise; `pieces` are those of its
    cases, and `levels` (SI, by name) is how much slow noise there is at least."""
    drives = [p.driven for p in pieces]
    weights = [np.ones(r.size) for r in problem.records] if problem.weights is None else problem.weights
    solver = best.covariance @ best.jacobian.T  # makes parameters of white residuals
    parts = np.split(solver, np.cumsum([r.size for r in problem.records]), axis=1)[:-1]
    if problem.marginals is not None:  # symmetric, so it may as well act on the solver
        parts = [m.apply(part.T).T for m, part in zip(problem.marginals, parts, strict=True)]
    covariance = solver @ solver.T
    for part, weight in zip(parts, weights, strict=True):  # the weights' share of the noise is counted below
        covariance -= (part * (1 - weight**2)) @ part.T
    for name in sorted({n for d in drives for n in d.corners if d.noise[n] > 0}):
        sensitivities = noise_sensitivities(problem.response, best.values, name, pieces)
        for i, driven in enumerate(drives):
            level = max(driven.noise[name], levels.get(name, 0.0))
            covariance += level**2 * _added(problem, i, parts[i] * weights[i], sensitivities[i], driven.corners[name])
    for delay in problem.response.kernel.model.delays:
        if delay.by in best.names:
            place = best.names.index(delay.by)
            untold = untold_delay(pieces, delay.of) / best.stderr[delay.by]
            covariance[place, place] += untold**2 * best.covariance[place, place]
    return best.with_covariance(covariance)


def noise_sensitivities(
    response: Response, values: Mapping[str, float], name: str, pieces: Sequence[Piece]
) -> list[np.ndarray]:
    """The change of the output of every case with noise of an input, each (N,), SI: its static gain, the change with a
    constant added to the input; where the plant remembers noise, what nuisance parameters do not tell of that.

    An output that an input enters at once may change by more: a current through a capacitance has no static gain. There
    it is how much of white noise at the corners of the input's line it passes, if that is more.

    Where the model has no answer with more of an input, near a fold, less of it is asked; where it has none at all, the
    gain is 0.
    """
    model = response.kernel.model
    at_once = {o for o in model.outputs if name in direct_dependencies(model, real(o))}

    def alone(case: Case) -> np.ndarray | None:
        return response.of([case]).possible(values)[0]

    def gain(number: int) -> np.ndarray:
        case, left = response.cases[number], left_between(pieces[number], name)
        if left is not None:
            return left
        here = alone(case)
        if here is None:
            return np.zeros(case.times.size)
        found = np.zeros(case.times.size)
        for sign in (1, -1):
            moved, step = shifted(case, name, sign)
            if (there := alone(moved)) is not None:
                found = np.asarray((there - here) / step)
                break
        if at_once & {*case.outputs}:
            noisy, draw = _with_draw(case, name)
            if (there := alone(noisy)) is not None:
                found = _or_passed(case, found, there - here, draw, at_once)
        return found

    return side_by_side(gain, range(len(pieces)))


def _with_draw(case: Case, name: str) -> tuple[Case, np.ndarray]:
    """The case with a small draw of white noise added to an input at its corners, and that noise at its readings (N,),
    in the input's unit."""
    protocol = case.protocol
    draw = INPUT_STEP * (float(np.abs(protocol.inputs[name]).max()) or 1.0)
    noise = draw * np.random.default_rng(0).standard_normal(protocol.time.size)
    moved = Protocol(protocol.time, protocol.inputs | {name: protocol.inputs[name] + noise})
    return replace(case, protocol=moved), moved.at(case.times)[name] - protocol.at(case.times)[name]


def _or_passed(case: Case, found: np.ndarray, changed: np.ndarray, draw: np.ndarray, at_once: set[str]) -> np.ndarray:
    """Gains (N,), with that of the noise that passed where outputs that it enters `at_once` changed by more."""
    found = found.copy()
    for reading, rows in zip(case.readings, case.parts, strict=True):
        noise = float(draw[rows] @ draw[rows])
        if reading.output in at_once and noise > 0:
            passed = float(np.sqrt(changed[rows] @ changed[rows] / noise))
            if passed**2 * found[rows].size > found[rows] @ found[rows]:
                found[rows] = passed
    return found


def shifted(case: Case, name: str, sign: int = 1) -> tuple[Case, float]:
    """The case with a small constant added to an input, and that constant.

    Where the input begins with nothing, so did what the plant rested under, and the constant comes within some samples:
    a plant without damping at rest would ring from a step of it.
    """
    protocol, first = case.protocol, float(case.protocol.time[0])
    step = sign * INPUT_STEP * (float(np.abs(protocol.inputs[name]).max()) or 1.0)
    part = np.ones(1)
    if protocol.inputs[name][0] == 0.0:
        last = float(case.instants[min(FIRST_SAMPLES, case.instants.size - 1)])
        protocol = protocol.with_time(last)
        part = np.clip((protocol.time - first) / (last - first), 0.0, 1.0)
    inputs = protocol.inputs | {name: protocol.inputs[name] + step * part}
    return replace(case, protocol=Protocol(protocol.time, inputs)), step


def _added(problem: Problem, number: int, solved: np.ndarray, gain: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """The covariance (k, k) that a monitor of one case adds, whose line bends at `corners` (m,) [s], for noise of 1;
    `solved` (k, n) makes parameters of white residuals."""
    case = problem.response.cases[number]
    moved = np.zeros((solved.shape[0], corners.size))
    for reading, rows in zip(case.readings, case.parts, strict=True):
        times = reading.times
        place, part = _between(corners, times)
        along, driving = solved[:, rows], reading.evened(gain[rows])
        for begin in range(0, corners.size, CHUNK):
            wanted = np.arange(begin, min(begin + CHUNK, corners.size))
            first = int(np.searchsorted(place, begin - 1))
            last = min(int(np.searchsorted(place, begin + CHUNK)) + WHITENING_REACH, times.size)  # whitening looks back
            near, share = place[first:last, None], part[first:last, None]
            columns = (near == wanted) * (1 - share) + (near + 1 == wanted) * share
            white = problem.noise[reading.output].whiten(
                Clock.of(times[first:last]), columns * driving[first:last, None]
            )
            moved[:, wanted] += along[:, first:last] @ white
    known = solveh_banded(_information(corners, case.instants), moved.T)
    return np.asarray(moved @ known)


def _between(corners: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The corner before each of `times` (n,), and which part of the way to the next one each is."""
    place = np.clip(np.searchsorted(corners, times, side="right") - 1, 0, corners.size - 2)
    return place, (times - corners[place]) / np.diff(corners)[place]


def _information(corners: np.ndarray, times: np.ndarray) -> np.ndarray:
    """What a monitor's samples at `times` (n,), each of noise 1, tell of its line's corners (m,): a symmetric matrix,
    as rows (2, m) of what is above its diagonal and of that."""
    place, part = _between(corners, times)
    diagonal = np.bincount(place, (1 - part) ** 2, corners.size) + np.bincount(place + 1, part**2, corners.size)
    beside = np.append(0.0, np.bincount(place, part * (1 - part), corners.size)[:-1])
    return np.stack([beside, diagonal + UNASKED * diagonal.max()])
