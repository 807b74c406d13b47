"""The characteristic of an effect alone, as identified: a curve, a loop, a step response or a drift, with a band.

The effect is isolated from the model (`model.alone`). One of the inputs or states that it acts on is moved through its
range in the records, with all others held where the effect is largest. An effect without memory is a curve. One with a
rate-independent memory is a loop: first part of the way and back, then all of it. Any other is shown by its response to
a step, as fast as in the records, until it settles; or over time, if it depends on the time since the start only.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from ...identify.fitting.fit import Fit
from ...kernel import Kernel, KernelError
from ...model.alone import Alone, alone
from ...model.declare import Model, Quantity
from ...model.effect import Effect
from ...protocol import Protocol
from ..scores.parameters import switched_on

# Set by judgement: what is drawn, and nothing is decided by it. Check: `pytest tests/test_own_curve.py`
CURVE_POINTS = 400  # [1] points of a curve
WAY = (0.0, 0.6, 0.0, 1.0, 0.0)  # [1] of the range: the corners of a loop
FASTER = 10.0  # [1] times as fast, a loop has to stay the same
SAME = 0.3  # [1] share of its height within which that is the same
FELT = 1e-3  # [1] of what an effect does: what moves it by less does not
STEP_RISE = 0.1  # [1] of the longest record that a step rises for at most
STEP_SETTLED = 0.05  # [1] of a step's answer that is left when it counts as settled
STEP_SHOWN = 1.6  # [1] times as long as that it is shown
BEFORE = 0.15  # [1] of the time shown that lies before a step
FIRST_LOOK = 1e-6  # [1] of the longest record: the first moment of a step's answer that is looked at
BRIEFEST_SHOWN = 1e-4  # [1] of the longest record that is shown of a step's answer at least,
RISES_SHOWN = 4.0  # [1] and times the step's rise
CURVE_STEPS = 100_000  # [1] internal steps of a run between two points, after which it is given up

# Set by convention: a band of 95 %. Check: `pytest tests/test_own_curve.py`
DRAWS = 400  # [1] draws of the parameters for a band
BAND_SEED = 1  # [1] of these
BAND = (0.025, 0.975)  # [1] quantiles of the draws
ANSWERED = 0.9  # [1] share of them that have to have an answer

Given = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Excitation:
    """What drives an isolated effect: `time` (n,) and, by name, inputs and states of the plant, each (n,)."""

    time: np.ndarray
    given: Given


@dataclass(frozen=True)
class OwnCurve:
    """A `kind` "curve", "loop", "step" or "time": `on` with the effect and `off` without, over x, each (n,).

    `low` and `high` are the ends of its band. x is the quantity `over`, or the time where that is None; for a curve
    of a sensor or monitor it is the input of the effect. `moved` is the quantity that is moved between `ends`, or
    None.
    """

    kind: str
    x: np.ndarray
    on: np.ndarray
    low: np.ndarray
    high: np.ndarray
    off: np.ndarray
    shown: Quantity
    over: Quantity | None
    moved: Quantity | None
    ends: tuple[float, float]


class IsolatedEffect:
    """An effect without the rest of the model, compiled, at identified parameters."""

    def __init__(self, base: Model, effect: Effect, fitted: Fit, jumping: Collection[str] = ()) -> None:
        """`fitted` has the effect's parameters; `jumping` are inputs that are held between samples."""
        self.base, self.effect, self.fitted, self.jumping = base, effect, fitted, jumping
        self.cut = alone(base, effect)
        self._kernel = Kernel(self.cut.model, differentiated=False)
        values = switched_on(effect) | dict(fitted.values)
        self.on = {n: v for n, v in values.items() if n in self.cut.model.parameter_values()}
        self.off = self.on | dict(effect.off)

    @property
    def shown(self) -> Quantity:
        """What the effect changes."""
        return self.cut.model.quantity(self.cut.output)

    def run(
        self, excitation: Excitation, values: Mapping[str, float], times: np.ndarray | None = None
    ) -> dict[str, np.ndarray]:
        """The quantity that the effect changes, and its own states, under an excitation."""
        inputs = {inner: excitation.given[name] for name, inner in self.cut.acts_on.items()}
        at = excitation.time if times is None else times
        found = self._kernel.simulate(Protocol(excitation.time, inputs), np.unique(at), values, max_steps=CURVE_STEPS)
        places = np.searchsorted(found.time, at)
        wanted = [self.cut.output, *(s.quantity.name for s in self.cut.model.states)]
        return {name: found[name][places] for name in wanted}

    def change(self, excitation: Excitation, times: np.ndarray | None = None) -> np.ndarray:
        """The change that the effect makes under an excitation."""
        name = self.cut.output
        return self.run(excitation, self.on, times)[name] - self.run(excitation, self.off, times)[name]

    def band(self, excitation: Excitation, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The ends of the 95 % band: quantiles of runs at parameters drawn from their covariance, inside their bounds.

        nan where the model cannot be solved for too many of these.
        """
        mine = [i for i, f in enumerate(self.fitted.free) if f.name in {q.name for q in self.effect.parameters}]
        free = [self.fitted.free[i] for i in mine]
        size, directions = scipy.linalg.eigh(self.fitted.covariance[np.ix_(mine, mine)])
        half = np.random.default_rng(BAND_SEED).standard_normal((DRAWS // 2, len(mine)))
        drawn = np.concatenate([half, -half]) * np.sqrt(np.maximum(size, 0.0)) @ directions.T
        runs = []
        for moved in self.fitted.scaled[mine] + drawn:
            values = {f.name: f.to_si(float(np.clip(x, *f.bounds()))) for f, x in zip(free, moved, strict=True)}
            try:
                runs.append(self.run(excitation, self.on | values, times)[self.cut.output])
            except KernelError:
                continue
        if len(runs) < ANSWERED * DRAWS:
            return np.full(times.size, np.nan), np.full(times.size, np.nan)
        low, high = np.quantile(runs, BAND, axis=0)
        return low, high


def own_curve(isolated: IsolatedEffect, excitations: Sequence[Excitation]) -> OwnCurve | None:
    """The effect's characteristic over the ranges of some records; None where it is constant."""
    usual, cut = _Usual.of(isolated, excitations), isolated.cut
    if cut.clock:
        return _drawn(isolated, "time", None, usual, *usual.still(cut, usual.longest))
    name = _most(isolated, usual)
    if name is None:
        return None
    if not cut.remembers:
        return _drawn(isolated, "curve", name, usual, *usual.way(cut, name, usual.longest))
    slow = isolated.change(*usual.way(cut, name, usual.longest))
    fast = isolated.change(*usual.way(cut, name, usual.longest / FASTER))
    if np.abs(slow - fast).max() < SAME * np.abs(slow).max():
        return _drawn(isolated, "loop", name, usual, *usual.way(cut, name, usual.longest))
    return _drawn(isolated, "step", name, usual, *_step(isolated, name, usual))


def _most(isolated: IsolatedEffect, usual: _Usual) -> str | None:
    """The quantity that moves the effect most: the one it declares, else the one with the largest influence."""
    cut = isolated.cut
    names = [cut.over] if cut.over else [n for n in cut.drivers if n in usual.moving]
    excitation, at = usual.still(cut, usual.longest)
    still, size = isolated.change(excitation, at), {}
    for name in names:
        excitation, times = usual.way(cut, name, usual.longest)
        size[name] = float(np.abs(isolated.change(excitation, times) - np.interp(times, at, still)).max())
    moved = [n for n in names if size[n] > FELT * np.abs(still).max()]
    return max(moved, key=lambda n: size[n]) if moved else None


@dataclass(frozen=True)
class _Usual:
    """For the quantities an effect acts on: values where it is largest, ranges and largest rates; longest record
    [s]."""

    values: dict[str, float]
    ends: dict[str, tuple[float, float]]
    rates: dict[str, float]
    longest: float

    @classmethod
    def of(cls, isolated: IsolatedEffect, excitations: Sequence[Excitation]) -> _Usual:
        changes = [np.abs(isolated.change(excitation)) for excitation in excitations]
        most = int(np.argmax([c.max() for c in changes]))
        at = int(np.argmax(changes[most]))
        names = {*isolated.cut.acts_on, *isolated.cut.drivers}
        joined = {n: np.concatenate([c.given[n] for c in excitations]) for n in names}
        return cls(
            {n: float(excitations[most].given[n][at]) for n in names},
            {n: (float(v.min()), float(v.max())) for n, v in joined.items()},
            {n: max(float(np.abs(np.diff(c.given[n]) / np.diff(c.time)).max()) for c in excitations) for n in names},
            max(float(np.ptp(c.time)) for c in excitations),
        )

    @property
    def moving(self) -> list[str]:
        """The quantities that move."""
        return [n for n, (low, high) in self.ends.items() if high > low]

    def way(self, cut: Alone, name: str, lasts: float) -> tuple[Excitation, np.ndarray]:
        """The excitation of `name` through its range within `lasts` seconds, and the times of the samples."""
        shares = np.array(WAY if cut.remembers else (0.0, 1.0))
        gone = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(shares)))])
        corners = lasts * (gone / gone[-1])
        times = np.unique(np.concatenate([np.linspace(0, lasts, CURVE_POINTS), corners]))
        return self.excitation(cut, name, corners, shares), times

    def still(self, cut: Alone, lasts: float) -> tuple[Excitation, np.ndarray]:
        """The excitation in which nothing moves."""
        at = self.values | (dict.fromkeys(cut.moving.values(), 0.0) if cut.remembers else {})
        return Excitation(np.array([0.0, lasts]), {n: np.full(2, v) for n, v in at.items()}), np.linspace(
            0, lasts, CURVE_POINTS
        )

    def excitation(self, cut: Alone, name: str, time: np.ndarray, shares: np.ndarray) -> Excitation:
        """The excitation of `name` through fractions of its range, linear between times; all else at its usual
        values."""
        low, high = self.ends[name]
        values = low + (high - low) * shares
        begin = np.flatnonzero(np.diff(time) > 0)
        slopes = np.diff(values)[begin] / np.diff(time)[begin]
        both = np.column_stack([begin, begin + 1]).ravel()
        given = {n: np.full(both.size, v) for n, v in self.values.items()}
        if cut.remembers:  # what is held does not move
            given |= {v: np.zeros(both.size) for v in cut.moving.values()}
        given[name] = values[both]
        if name in cut.moving:
            given[cut.moving[name]] = np.repeat(slopes, 2)
        return Excitation(time[both], given)


def _step(isolated: IsolatedEffect, name: str, usual: _Usual) -> tuple[Excitation, np.ndarray]:
    """The excitation by a step of `name`, and the times of the samples until the response has settled."""
    low, high = usual.ends[name]
    rise = 0.0 if name in isolated.jumping else min((high - low) / usual.rates[name], STEP_RISE * usual.longest)
    shares = np.array([0.0, 0.0, 1.0, 1.0])
    far = usual.excitation(isolated.cut, name, np.array([-usual.longest, 0.0, rise, usual.longest]), shares)
    looked = np.unique(np.concatenate([[0.0], np.geomspace(FIRST_LOOK, 1, CURVE_POINTS) * usual.longest]))
    left = np.abs(_settling(isolated.change(far, looked)))
    unsettled = looked[left > STEP_SETTLED * left.max()] if left.max() > 0 else looked[:1]
    least = max(RISES_SHOWN * rise, BRIEFEST_SHOWN * usual.longest)
    lasts = float(np.clip(STEP_SHOWN * unsettled[-1], least, usual.longest))
    excitation = usual.excitation(isolated.cut, name, np.array([-BEFORE * lasts, 0.0, rise, lasts]), shares)
    return excitation, np.unique(np.concatenate([np.linspace(-BEFORE * lasts, lasts, CURVE_POINTS), [0.0, rise]]))


def _settling(change: np.ndarray) -> np.ndarray:
    return change - change[-1]


def _drawn(
    isolated: IsolatedEffect, kind: str, name: str | None, usual: _Usual, excitation: Excitation, times: np.ndarray
) -> OwnCurve:
    on, off = (isolated.run(excitation, values, times)[isolated.cut.output] for values in (isolated.on, isolated.off))
    low, high = isolated.band(excitation, times)
    x, over, moved, ends = times, None, None, (0.0, 0.0)
    if name is not None:
        moved, ends = isolated.base.quantity(name), usual.ends[name]
    if name is not None and kind in ("curve", "loop"):
        x, over = Protocol(excitation.time, {name: excitation.given[name]}).at(times)[name], moved
    if kind == "curve" and isolated.effect.recording:
        x, over = off, isolated.shown
    return OwnCurve(kind, x, on, low, high, off, isolated.shown, over, moved, ends)
