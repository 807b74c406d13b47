"""Stretches of a record in which nothing happens: what a smooth curve leaves of them is the sensor's noise.

Between events a plant creeps, so exponentials of all time constants and polynomials are taken out; what slow drift a
sensor has goes with them. A plant that rings after every event is at rest nowhere but before the first one, and where
it has rung out: stretches that move much more from sample to sample than the calmest ones are no quiet ones.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular

from . import hum as hums
from .colour import Colour
from .sampling import SAME_STEP, usual_step

# Set by judgement: at the usual pace, a slower plant takes longer. Check: `pytest tests/test_noise.py`,
# `python -m blind.score --nulls 12 --conventions colour drift --seed 1000`
LONGEST_STRETCH = 8.0  # [s] that a stretch has at most; longer ones are cut
LEAST_STRETCH = 30  # [samples] that it has at least
SHORT_STRETCH = 32  # [samples] that short ones have, where records hardly rest
SETTLED = 0.1  # [s] after an event until the plant moves slowly
DEGREE = 3  # [1] degree of the polynomial that is taken out
BENDS = 0.3  # [1/s] by which it is more in longer stretches
FASTEST = 0.02  # [s] shortest time constant of creep that is taken out
APART = 4.0  # [1] ratio of one time constant to the next
POLYNOMIAL_ROOM = 4  # [samples] of a stretch for each degree of the polynomial,
CREEP_ROOM = 8  # [samples] and for each time constant
LIKE_ANOTHER = 1e-7  # [1] of the largest singular value: curves with less are others once more
ON_TIME = 1e-9  # [s] by which a sample may be too early for a stretch that begins with it
SKIPPED = 1.5  # [1] times the usual step from which on time has a gap
SAME_RATE = 0.1  # [1] by which a step differs at most from the one before, of samples of one rate

# Set by measurement: tanks and an oven read every 0.5 s to 5 s lost most of noise with a memory to curves that take out
# creep; what is read every 1 to 20 ms keeps it.
# Check: `pytest tests/test_time_scale.py tests/test_ringing_plants.py`, `python -m measured.table`
USUAL_BANDWIDTH = 25.0  # [Hz] of a plant of the usual pace, the tube
USUAL_STEPS = (5e-4, 0.02)  # [s] between samples of plants of the usual pace, where no bandwidth tells it: the least
# and the most

# Set by judgement. Check: `pytest tests/test_noise.py -k rings`, `python -m measured.table`
CALMEST = 100  # [1] degrees of freedom of the calmest stretches together, that the others are held against
BARELY_CALM = 50  # [1] the same where records hardly rest
NOT_CALM = 5.0  # [1] times their variance of differences from which on a stretch is not quiet
LOUDER = 1.5  # [1] times it from which on stretches together are louder than quiet ones
COARSE = 4.0  # [1] squared steps of a sensor, that its readings differ by at most where nothing moves
DIFFERENCES = (1, 4, 16)  # [samples] over which differences are taken, of each sampling step,
LAGS_A_STRETCH = 8  # [1] times which stretches last at least,
LONG_LAG = 4  # [samples] and those of more than that by the root of it more: in shorter ones a smooth curve takes much
# of what noise with a colour changes over the lag, and they would seem calm
SAME_SPAN = 1.05  # [1] ratio up to which two times are one lag

Records = Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Stretches:
    """Quiet stretches of one length and sampling `step` [s]: `values` (n, m), and what is taken out, `basis` (n, p).

    Stretch j is that of record `record[j]` from its sample `first[j]` on.
    """

    step: float
    values: np.ndarray
    basis: np.ndarray
    record: np.ndarray
    first: np.ndarray

    @property
    def freedom(self) -> int:
        """Degrees of freedom left."""
        return self.values.shape[1] * (self.values.shape[0] - self.basis.shape[1])

    @property
    def left(self) -> np.ndarray:
        """The values without the basis (n, m)."""
        return self.values - self.basis @ (self.basis.T @ self.values)

    def only(self, chosen: np.ndarray) -> Stretches:
        """Some of them, (m,) of truth values."""
        return replace(self, values=self.values[:, chosen], record=self.record[chosen], first=self.first[chosen])

    def without(self, lines: Sequence[float]) -> Stretches:
        """With lines at some frequencies [Hz] taken out as well."""
        waves = hums.columns(lines, np.arange(len(self.values)) * self.step)
        return replace(self, basis=_orthonormal(np.concatenate([self.basis, waves], axis=1)))

    def rest(self, colour: Colour) -> np.ndarray:
        """The whitened values without the basis (n, m)."""
        q, _ = np.linalg.qr(colour.whiten(self.basis))
        white = colour.whiten(self.values)
        return white - q @ (q.T @ white)

    def restricted(self, colour: Colour) -> tuple[float, float]:
        """The sum of squares of `rest`, and half the logarithm of the determinant of the basis' normal equations."""
        basis, white = colour.whiten(self.basis), colour.whiten(self.values)
        factor = np.linalg.cholesky(basis.T @ basis)
        along = solve_triangular(factor, basis.T @ white, lower=True)
        squares = float(np.vdot(white, white) - np.vdot(along, along))
        return squares, float(np.log(np.diag(factor)).sum())


def pace_of(bandwidth: float, steps: Sequence[float]) -> float:
    """How many times as long as the tube a plant takes for all that it does: told by its `bandwidth` [Hz], and where
    that is unknown by the `steps` [s] between samples, which whoever records a plant fits to how fast it is. Of what is
    sampled as the tube may be, it is 1."""
    if np.isfinite(bandwidth):
        return USUAL_BANDWIDTH / bandwidth
    usual = float(np.median(steps)) if len(steps) else 0.0
    return usual / float(np.clip(usual, *USUAL_STEPS)) if usual > 0 else 1.0


def paced(step: float, pace: float) -> float:
    """The `step` [s] between samples that it would be at the usual pace: rounded, as lengths in samples follow."""
    return round(step / pace, SAME_STEP)


def stretches(
    records: Records, settled: float = SETTLED, short: bool = False, apart: float = APART, pace: float = 1.0
) -> list[Stretches]:
    """All stretches without an event inside or `settled` [s] before, cut into lengths that are halves of each other.
    These and the time constants of creep are of a plant that takes `pace` times as long as usual.

    `short` ones too: half a second before the first event may be all that a record rests. What comes before that, if
    not long, is a stretch of its own length. `apart` is the ratio of the time constants of creep that are taken out.
    """
    cut: dict[tuple[float, int], list[tuple[int, int]]] = {}
    settled, on_time = settled * pace, ON_TIME * pace
    for number, (time, _, events) in enumerate(records):
        clock = Clock.of(time)
        begins = [part.start for part in clock.parts]
        marks = np.union1d(events, time[begins[1:]])
        marks = np.union1d(marks, [time[0] - settled, time[-1] + clock.step])
        firsts = np.searchsorted(time, marks[:-1] + settled - on_time)
        lasts = np.searchsorted(time, marks[1:])
        for mark, first, last in zip(marks[:-1].tolist(), firsts.tolist(), lasts.tolist(), strict=True):
            rest, step = last - first, round(clock.steps[bisect_right(begins, first) - 1], SAME_STEP)
            sizes = [*_sizes(paced(step, pace)), SHORT_STRETCH] if short else _sizes(paced(step, pace))
            alone = mark <= time[0] and LEAST_STRETCH <= rest < 2 * sizes[-1]
            taken = 0
            for size in [rest] if alone else sizes:
                while rest - taken >= size:
                    taken += size  # from the end where records hardly rest: if they do, they do so there
                    cut.setdefault((step, size), []).append((number, last - taken if short else first + taken - size))
    made = []
    for (step, size), places in sorted(cut.items()):
        values = np.stack([records[r][1][a : a + size] for r, a in places], axis=1)
        smooth = basis(size, paced(step, pace), apart)
        values -= smooth @ (smooth.T @ values)  # the rest is small beside it: no digits are lost later
        made.append(Stretches(step, values, smooth, *np.array(places).T))
    return made


def whole_rests(records: Records) -> list[Stretches]:
    """All that comes before the first event of each record, but for a straight line: a plant at rest does not creep."""
    found = []
    for number, (time, values, events) in enumerate(records):
        rest = values[: int(np.searchsorted(time, first_event(time, events)))]
        if rest.size >= LEAST_STRETCH and steady(time[: rest.size]).all():
            line = _orthonormal(np.polynomial.legendre.legvander(np.linspace(-1, 1, rest.size), 1))
            where = np.array([number]), np.array([0])
            found.append(Stretches(round(usual_step(time), SAME_STEP), rest[:, None] - rest.mean(), line, *where))
    return found


def first_event(time: np.ndarray, events: np.ndarray) -> float:
    """When something first happens in a record [s]; its begin where nothing does."""
    return float(next((e for e in events if time[0] < e < time[-1]), time[0]))


def _sizes(step: float) -> list[int]:
    """Lengths of stretches of samples `step` apart (at the usual pace), the longest first."""
    longest = max(LONGEST_STRETCH / step, 2 * LEAST_STRETCH)
    return [int(longest / 2**k) for k in range(int(np.log2(longest / LEAST_STRETCH)) + 1)]


def basis(size: int, step: float, apart: float = APART) -> np.ndarray:
    """Creep and drift over a stretch of samples `step` apart (at the usual pace): polynomials, and exponentials of all
    time constants up to its length."""
    lasts = size * step
    degree = min(DEGREE + int(BENDS * lasts), size // POLYNOMIAL_ROOM)
    columns = [np.polynomial.legendre.legvander(np.linspace(-1, 1, size), degree)]
    time = np.arange(size) * step
    tau = FASTEST
    while tau < lasts / apart and len(columns) < size // CREEP_ROOM:
        columns.append(np.exp(-time / tau)[:, None])
        tau *= apart
    return _orthonormal(np.concatenate(columns, axis=1))


def _orthonormal(columns: np.ndarray) -> np.ndarray:
    left, values, _ = np.linalg.svd(columns, full_matrices=False)
    return left[:, values > LIKE_ANOTHER * values[0]]


def calm(
    groups: Sequence[Stretches], step: float, enough: int = CALMEST, lines: Sequence[float] = ()
) -> list[Stretches]:
    """The stretches that move no more from sample to sample than the calmest ones do, which have `enough` degrees of
    freedom, but for chance, and for hum at `lines` [Hz], which differs from file to file.

    Nor more than a sensor with this smallest `step` does, which is calm in the middle of one and not between two.
    Those without any noise are none to hold others against.
    """
    rings = [np.zeros(g.values.shape[1], dtype=bool) for g in groups]
    left = [g.without(lines).left for g in groups] if lines else [g.values for g in groups]
    for span in _spans(groups):
        moved = [_differences(v, span / g.step) for v, g in zip(left, groups, strict=True)]
        calmest = _calmest([(m, len(g.values) - g.basis.shape[1]) for m, g in zip(moved, groups, strict=True)], enough)
        limit = max(NOT_CALM * calmest, COARSE * step**2)
        rings = [r | (m > limit) for r, m in zip(rings, moved, strict=True)]
    return [g.only(~r) if r.any() else g for g, r in zip(groups, rings, strict=True) if not r.all()]


def _spans(groups: Sequence[Stretches]) -> list[float]:
    """The times [s] over which differences are taken: DIFFERENCES of every sampling step.

    Noise with a colour changes more over 10 ms than over 2 ms, so records of different rates are compared over the same
    time.
    """
    spans: list[float] = []
    for span in sorted(lag * step for step in {g.step for g in groups} for lag in DIFFERENCES):
        if not spans or span > SAME_SPAN * spans[-1]:
            spans.append(span)
    return spans


def louder(groups: Sequence[Stretches], quiet: Sequence[Stretches]) -> bool:
    """Whether stretches move more from sample to sample than quiet ones of their sampling step, of which there are
    enough to tell."""
    if sum(g.freedom for g in quiet) < CALMEST:
        return False
    here, there = 0.0, 0.0
    for step in {g.step for g in groups} & {g.step for g in quiet}:
        moves, rests = (
            np.concatenate([_differences(g.values, 1) for g in each if g.step == step]) for each in (groups, quiet)
        )
        here, there = here + moves.sum(), there + moves.size * rests.mean()
    return bool(here > LOUDER * there)


def _differences(values: np.ndarray, lag: float) -> np.ndarray:
    """The mean square of differences over a lag [samples] of every stretch (m,); not a number where the stretch is too
    short for that, or the lag is less than a sample."""
    lag = round(lag)
    if lag < 1 or len(values) < LAGS_A_STRETCH * lag * max(lag / LONG_LAG, 1.0) ** 0.5:
        return np.full(values.shape[1], np.nan)
    return np.asarray(np.mean((values[lag:] - values[:-lag]) ** 2, axis=0))


def _calmest(groups: Sequence[tuple[np.ndarray, int]], enough: int) -> float:
    """The mean of the smallest of values (m,), each with so many degrees of freedom; infinite where there are few."""
    values = np.concatenate([v for v, _ in groups])
    freedom = np.concatenate([np.full(v.size, f) for v, f in groups])
    order = np.argsort(values)
    order = order[values[order] > 0]  # not a number is not
    total = np.cumsum(freedom[order])
    if not total.size or total[-1] < enough:
        return np.inf
    few = order[: int(np.searchsorted(total, enough)) + 1]
    return float(np.average(values[few], weights=freedom[few]))


@dataclass(frozen=True)
class Clock:
    """Times (n,) at which something was read: the usual `step` [s], and `parts` without a gap, with the step of each.

    A logger that samples faster after an event, and slower where nothing happens, has parts of several steps.
    """

    step: float
    parts: tuple[slice, ...]
    steps: tuple[float, ...]

    @staticmethod
    def of(time: np.ndarray) -> Clock:
        """The clock of times [s]."""
        if time.size < 2:
            return Clock(0.0, (slice(0, time.size),), (0.0,))
        step, usual = np.diff(time), usual_step(time)
        own = _other_rates(step, usual)
        gaps = ~steady(time)
        for first, last in own:
            gaps[first:last] = False
        inner = {*(np.flatnonzero(gaps) + 1).tolist(), *(b for first, last in own for b in (first + 1, last + 1))}
        ends = sorted({0, *inner, time.size})
        rates = {first + 1: float(np.median(step[first:last])) for first, last in own}
        parts = tuple(slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True))
        return Clock(usual, parts, tuple(rates.get(a, usual) for a in ends[:-1]))


def _other_rates(step: np.ndarray, usual: float) -> list[tuple[int, int]]:
    """Where many steps (n,) in a row are the same, and not the usual one: the first, and the one after the last."""
    changes = np.flatnonzero(np.abs(np.diff(step)) > SAME_RATE * step[:-1]) + 1
    first, last = np.append(0, changes), np.append(changes, step.size)
    other = (step[first] > SKIPPED * usual) | (step[first] * SKIPPED < usual)
    many = (last - first >= LEAST_STRETCH) & other & (step[first] > 0)
    return list(zip(first[many].tolist(), last[many].tolist(), strict=True))


def steady(time: np.ndarray) -> np.ndarray:
    """Whether each step (n - 1,) of a record's time (n,) is a usual one, and no gap."""
    step = np.diff(time)
    return step < SKIPPED * np.median(step)
