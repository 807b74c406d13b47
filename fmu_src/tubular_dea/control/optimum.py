"""When to pulse the tube, and how strongly: the best pulse for a patient under the limits of tube and amplifier.

A coarse map over begin, end and voltage by the batch kernel, then refined around its best point; the whole takes
seconds. Usage::

    best = optimise(patient("failing"), Limits())
    best.pulse, best.gain, best.robustness
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import UserError
from ..model.declare import Model
from ..model.scheduler import FIELD_LIMIT
from .assisted import TOLERANCE, AssistedHeart, Pulses

Figures = dict[str, np.ndarray]

# Objectives: name -> (is more better?, words). All are indices of the last beat.
OBJECTIVES = {
    "stroke_work_per_stroke_volume": (False, "stroke work per stroke volume"),
    "stroke_work": (False, "stroke work"),
    "stroke_volume": (True, "stroke volume"),
    "mean_aortic_pressure": (True, "mean aortic pressure"),
}
# The map: begins and ends of pulses in beats after R, and voltages as parts of the largest one (`_largest_voltage`).
TIMING, VOLTAGE = 0.04, 0.1  # mesh
BEGINS, ENDS = np.arange(-0.20, 0.281, TIMING), np.arange(0.14, 0.701, TIMING)
VOLTAGES = np.array([0.6, 0.8, 0.9, 1.0, 1.1])
SHORTEST = 0.06  # beats: a pulse that is all flanks is none
# The refinement draws DRAWN points a round around the ELITE best so far, from half the map's mesh down to 1/16 of it.
# The best pulses lie on a narrow ridge (an end just before the valve closes, at a voltage that does not close it
# sooner): a search along the axes stopped 0.5 % short of it in the healthy heart.
ELITE, DRAWN, ROUNDS = 12, 120, 4
# Then it steps from the best one to better neighbours, POLISHED times: long steps along the ridge, short ones across.
POLISH, POLISHED = np.array([0.03, 0.004, 0.01]), 8
# Gains as good as the best: before ejection the start barely matters. Of equally good pulses the latest start is taken,
# which holds the voltage least long.
ALIKE = 1e-3
# s: a pulse that ends with the closure of the valve loses most of its gain when it ends a little later. An optimum on
# that edge is none: what the amplifier's lag and a communication step shift is counted in.
LATE = 5e-3
MAP_TOLERANCE = 1e-5  # of the integrator; the refinement takes the tighter one of `assisted`
# The steady rhythm of the map is less demanding than the first assisted beats: their largest field is 0.4 % larger and
# their margin 0.2 mmHg smaller (`tubular-dea assist --voltage 5.5kV`: whole run against judged beats).
FIELD_RESERVE, MARGIN_RESERVE = 0.01, 0.5 * 133.322
SHIFT, RATE_CHANGE = 0.02, 0.1  # s; of the heart rate


class OptimumError(UserError, ValueError):
    """No pulse meets the limits, or none helps."""


@dataclass(frozen=True)
class Limits:
    """Of the tube: largest field [V/m], smallest margin to snap-through [Pa]. Of the amplifier: largest voltage [V],
    slew rate [V/s], current [A] into its load [F]. Of a pulse: longest one [s]."""

    field: float = FIELD_LIMIT
    margin: float = 10 * 133.322
    voltage: float = 10e3
    slew_rate: float = 1e6
    current: float = 10e-3
    load: float = 20e-9
    longest: float = 0.4

    @property
    def rate(self) -> float:
        """Fastest change of the voltage [V/s]."""
        return min(self.slew_rate, self.current / self.load)


@dataclass(frozen=True)
class Pulse:
    """Begin and end in beats after R (a negative begin is before it), voltage [V]."""

    begin: float
    end: float
    voltage: float


@dataclass(frozen=True)
class Change:
    """A disturbance of the best pulse: what, the change of the objective then, and whether limits still hold."""

    what: str
    gain: float
    within: bool


@dataclass(frozen=True)
class Optimum:
    """The best pulse, what it gains and the map around it.

    `gain` is the relative change of the objective (negative: lower); `ejection` when ejection begins with it [s after
    R]; `gains` (begins, ends) the best gain over all voltages at each timing of the map, NaN where limits forbid all.
    """

    objective: str
    pulse: Pulse
    period: float
    gain: float
    figures: dict[str, float]
    without: dict[str, float]
    default: Pulse
    default_gain: float
    gains: np.ndarray
    robustness: tuple[Change, ...]
    rows: int

    @property
    def ahead(self) -> float:
        """When the pulse begins, after the beginning of ejection without assist [s]; negative is before."""
        return self.pulse.begin * self.period - self.without["ejection_begins"]


def optimise(
    patient: Mapping[str, float],
    limits: Limits,
    objective: str = "stroke_work_per_stroke_volume",
    default: Pulse = Pulse(0.05, 0.38, 5500.0),
    tube: Model | None = None,
    progress: Callable[[int], None] = lambda rows: None,
) -> Optimum:
    """The best pulse for `patient` within `limits`; `OptimumError` where no pulse meets them, or none helps.

    `progress` receives the number of trajectories computed.
    """
    search = _PulseSearch(AssistedHeart(patient, limits.rate, tube), limits, objective, progress)
    elite, gains = search.map()
    return search.report(search.refined(elite), gains, default)


@dataclass(frozen=True)
class _Elite:
    """The best points so far, best first: rows begin [beats], end [beats], voltage [of the largest]."""

    points: np.ndarray
    gains: np.ndarray

    def with_(self, points: np.ndarray, gains: np.ndarray) -> _Elite:
        """The best of these and others."""
        every, all_gains = np.concatenate([self.points, points]), np.concatenate([self.gains, gains])
        order = np.argsort(all_gains)[: min(ELITE, np.isfinite(all_gains).sum())]
        return _Elite(every[order], all_gains[order])


class _PulseSearch:
    def __init__(self, heart: AssistedHeart, limits: Limits, objective: str, progress: Callable[[int], None]) -> None:
        if objective not in OBJECTIVES:
            raise OptimumError(f"objective: expected one of {', '.join(OBJECTIVES)} but was given {objective!r}")
        self.heart, self.limits, self.objective, self._progress = heart, limits, objective, progress
        self.period, self.rows = heart.period, 0
        self.without = self._run(Pulses.of(0.0, 0.1, 0.0))
        if self.without["smallest_margin"][0] < limits.margin:
            raise OptimumError(
                f"no pulse meets the limits: without any voltage the margin to snap-through is "
                f"{self.without['smallest_margin'][0] / 133.322:.1f} mmHg, and at least "
                f"{limits.margin / 133.322:g} mmHg are wanted"
            )
        self._largest = self._largest_voltage()

    def map(self) -> tuple[_Elite, np.ndarray]:
        """The best points of the coarse map, and the best gain over the voltages at each timing."""
        begin, end, volt = np.meshgrid(BEGINS, ENDS, VOLTAGES * self._largest, indexing="ij")
        gains = np.full(begin.shape, np.nan)
        sensible = self._sensible(begin, end, volt)
        pulses = self._pulses(begin[sensible], end[sensible], volt[sensible])
        if not sensible.any():
            raise OptimumError(
                f"no pulse meets the limits: the smallest voltage tried is {volt.min() / 1e3:.2g} kV, and the "
                f"amplifier gives {self.limits.voltage / 1e3:.3g} kV; give a larger voltage"
            )
        gains[sensible] = self.gains(pulses, MAP_TOLERANCE)
        if not np.isfinite(gains).any():
            raise OptimumError(
                f"no pulse meets the limits: from {volt.min() / 1e3:.2g} kV on, each of the {sensible.sum()} tried "
                f"exceeds {self.limits.field * 1e-6:g} V/um, comes within {self.limits.margin / 133.322:g} mmHg of "
                "snap-through, or is more than the amplifier gives; relax a limit"
            )
        timings = np.min(np.where(np.isnan(gains), np.inf, gains), axis=2)
        order = np.argsort(gains, axis=None)[: min(ELITE, np.isfinite(gains).sum())]  # NaN comes last
        best = np.stack([begin.ravel()[order], end.ravel()[order], volt.ravel()[order] / self._largest], axis=1)
        return _Elite(best, gains.ravel()[order]), np.where(np.isinf(timings), np.nan, timings)

    def refined(self, elite: _Elite) -> Pulse:
        """The best point found by drawing around the best ones so far (cross-entropy), round by round closer."""
        random, tried, gained = np.random.default_rng(1), [elite.points], [elite.gains]
        mesh = np.array([TIMING, TIMING, VOLTAGE])
        for number in range(ROUNDS):
            spread = np.cov(elite.points.T) if len(elite.points) > 1 else np.zeros((3, 3))
            wide = spread + np.diag((mesh * 0.5 ** (number + 1)) ** 2)
            drawn = random.multivariate_normal(elite.points.mean(axis=0), wide, DRAWN)
            drawn = drawn[self._sensible(drawn[:, 0], drawn[:, 1], drawn[:, 2] * self._largest)]
            gains = self.gains(self._pulses(drawn[:, 0], drawn[:, 1], drawn[:, 2] * self._largest))
            elite = elite.with_(drawn, gains)
            tried.append(drawn)
            gained.append(gains)
        points, values = self._polished(np.concatenate(tried), np.concatenate(gained))
        alike = points[values <= np.nanmin(values) + ALIKE]
        begin, end, voltage = alike[np.argmax(alike[:, 0])]
        return Pulse(float(begin), float(end), float(voltage * self._largest))

    def _polished(self, points: np.ndarray, gains: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """All points tried, after steps to better neighbours of the best one, and finer where there is none."""
        part = 1.0
        sides = np.stack(np.meshgrid(*3 * [[-1.0, 0.0, 1.0]]), axis=-1).reshape(-1, 3)
        for _ in range(POLISHED):
            best = int(np.nanargmin(gains))
            near = points[best] + part * sides * POLISH
            near = near[self._sensible(near[:, 0], near[:, 1], near[:, 2] * self._largest)]
            found = self.gains(self._pulses(near[:, 0], near[:, 1], near[:, 2] * self._largest))
            if not np.nanmin(np.append(found, np.inf)) < gains[best] - 1e-5:
                part /= 2
            points, gains = np.concatenate([points, near]), np.concatenate([gains, found])
        return points, gains

    def _sensible(self, begin: np.ndarray, end: np.ndarray, voltage: np.ndarray) -> np.ndarray:
        length = end - begin
        return np.asarray(
            (length >= SHORTEST) & (length * self.period <= self.limits.longest) & (voltage <= self.limits.voltage)
        )

    def gains(self, pulses: Pulses, tolerance: float = TOLERANCE) -> np.ndarray:
        """Change of the objective, signed so that less is better, at worst of the pulse and one that ends LATE later;
        NaN beyond the limits."""
        if not pulses.on.size:
            return np.empty(0)
        found = self._run(pulses, tolerance=tolerance)
        later = self._run(Pulses(pulses.on, pulses.off + LATE, pulses.voltage), tolerance=tolerance)
        gain = np.maximum(self._change(found, self.without), self._change(later, self.without))
        return np.where(self._within(found), gain, np.nan)

    def report(self, best: Pulse, gains: np.ndarray, default: Pulse) -> Optimum:
        """The results for `best`."""
        found = self._run(self._pulses(np.array([best.begin]), np.array([best.end]), np.array([best.voltage])))
        gain = float(self._change(found, self.without)[0])
        if gain >= 0:
            raise OptimumError(
                f"no pulse within the limits improves the {OBJECTIVES[self.objective][1]}; "
                "relax a limit, or do not assist this patient"
            )
        sign = -1.0 if OBJECTIVES[self.objective][0] else 1.0
        usual = self._run(self._pulses(*(np.array([v]) for v in (default.begin, default.end, default.voltage))))
        return Optimum(
            self.objective,
            best,
            self.period,
            sign * gain,
            {n: float(v[0]) for n, v in found.items()},
            {n: float(v[0]) for n, v in self.without.items()},
            default,
            sign * float(self._change(usual, self.without)[0]),
            sign * gains,
            tuple(self._robustness(best, sign)),
            self.rows,
        )

    def _robustness(self, best: Pulse, sign: float) -> list[Change]:
        """Begin, end or both earlier and later; the heart slower and faster, the pulse keeping its part of the beat."""
        changes = []
        for what, on, off in (("begin", 1, 0), ("end", 0, 1), ("begin and end", 1, 1)):
            for shift in (-SHIFT, SHIFT):
                begin, end = best.begin * self.period + on * shift, best.end * self.period + off * shift
                moved = Pulses.of(begin, end, best.voltage)
                changes.append(self._changed(f"{what} {1e3 * shift:+.0f} ms", moved, 1.0, sign))
        for rate in (1 - RATE_CHANGE, 1 + RATE_CHANGE):
            period = self.period / rate
            moved = Pulses.of(best.begin * period, best.end * period, best.voltage)
            changes.append(self._changed(f"heart rate {100 * (rate - 1):+.0f} %", moved, rate, sign))
        return changes

    def _changed(self, what: str, pulses: Pulses, rate: float, sign: float) -> Change:
        found, without = self._run(pulses, rate), self._run(Pulses.of(0.0, 0.1, 0.0), rate)
        return Change(what, sign * float(self._change(found, without)[0]), bool(self._within(found, 0.0)[0]))

    def _change(self, found: Figures, without: Figures) -> np.ndarray:
        change = found[self.objective] / without[self.objective] - 1
        return -change if OBJECTIVES[self.objective][0] else change

    def _within(self, found: Figures, reserve: float = 1.0) -> np.ndarray:
        field = found["largest_field"] <= self.limits.field * (1 - reserve * FIELD_RESERVE)
        return np.asarray(field & (found["smallest_margin"] >= self.limits.margin + reserve * MARGIN_RESERVE))

    def _largest_voltage(self) -> float:
        """About the one that meets the field limit: at the stretch of the resting tube under the mean pressure [V]."""
        model = self.heart.tube_values()
        stretch = self.heart.rest_stretch(float(self.without["mean_aortic_pressure"][0]))
        along = np.sqrt(1 + (model["r_o"] / model["l_o"]) ** 2 * (stretch - 1) ** 2)
        return float(self.limits.field * model["h_ao"] / (along * stretch))

    def _pulses(self, begin: np.ndarray, end: np.ndarray, voltage: np.ndarray) -> Pulses:
        return Pulses.of(begin * self.period, end * self.period, voltage)

    def _run(self, pulses: Pulses, rate: float = 1.0, tolerance: float = TOLERANCE) -> Figures:
        found = self.heart.run(pulses, rate, tolerance)
        self.rows += pulses.on.size
        self._progress(pulses.on.size)
        return found
