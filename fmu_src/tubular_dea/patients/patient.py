"""A patient from a recorded beat: ventricle and windkessel fitted to an arterial pressure, and to a flow with it.

The model is the declared ventricle and windkessel (three elements) in its steady beat. What a recording says little
about stays where the base patient has it: every parameter has a prior (SPREADS, in its logarithm), and counts as
identified where the recording narrows that prior to less than half. Without a flow, pressure alone cannot tell a large
heart before small arteries from a small one before large ones: all flows scale together. Then the cardiac output is
taken from outside, with the uncertainty given for it.

Intervals: of the posterior (Gauss-Newton), with the misfit's own size as noise, at least DISCREPANCY of the swing, and
not more numbers in a beat than are independent.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from ..errors import UserError
from ..identify.fitting.fit import NORMAL_95
from ..identify.threads import side_by_side
from ..kernel import Kernel, KernelError
from ..model.units import factor
from ..model.windkessel import PARAMETERS, aortic_windkessel
from ..protocol import Protocol
from .recorded_beat import BEAT_POINTS, RecordedBeat

# Set by judgement: about how much adults differ (0.7: a factor of two).
# Check: `pytest tests/test_patient.py::test_a_known_patient_is_found_again`
# [1] standard deviations of the priors, of the logarithm of a parameter
SPREADS = {
    "E_max": 0.7,
    "E_min": 0.4,
    "V_0": 0.4,
    "filling_pressure": 0.4,
    "T_offset": 0.3,
    "R": 0.7,
    "C": 0.7,
    "Z_c": 0.7,
}
NARROWED = 0.5  # [1] of its prior: a parameter with less uncertainty left is identified
OUTPUT_UNCERTAINTY = 0.2  # [1] of an assumed cardiac output, relative (standard deviation)

# Set by judgement: from the base's pressure, which is near, R C is three or four beats.
# Check: `pytest tests/test_patient.py::test_a_known_patient_is_found_again`
BEATS = 8  # [1] beats until the beat is steady
NOISE_ROUNDS = 3  # [1] rounds of refitting with the noise that the misfit shows
PATIENT_TOLERANCE = 1e-7  # [1] of the kernel
PATIENT_STEP = 3e-3  # [1] of the logarithm of a parameter, and of the beat: half a difference quotient's width

# Set by judgement: where the search ends by itself after a handful. Check: `pytest tests/test_patient.py`
PATIENT_EVALUATIONS = 25  # [evaluations] of a round of refitting at most
NO_FLOW = 1e-9  # [m3/s] that a mean flow is taken to be at least

# Set by convention: the healthy patient's own beat without assist. Check: `tubular-dea assist --patient healthy`,
# `pytest tests/test_patient.py::test_a_known_patient_is_found_again`
USUAL_STROKE = 68e-6  # [m3] stroke volume
USUAL_RATE = 1.25  # [1/s] heart rate
USUAL_PRESSURE = 92  # [mmHg] mean pressure of the aorta

# Set by judgement: where a search begins. Check:
# `pytest tests/test_patient.py::test_a_known_patient_is_found_again`
LEAST_HEAD = 0.2  # [1] of the mean pressure that drives the flow through the arteries at least
Z_C_SHARE = 0.05  # [1] of the arteries' resistance: the characteristic impedance
DECAY = 1.3  # [s] R C, time constant of the pressure's fall
OFFSET_SHARE = 0.25  # [s] T_offset, the activation's time scale, at the usual heart rate; longer in longer beats,
LONGEST_OFFSET = 0.2  # [s] up to this

# Set by measurement: a windkessel has no reflected waves, which are 4 to 5 % of the swing in the human aorta.
# Check: `pytest tests/test_patient.py -k human`
DISCREPANCY = 0.05  # [1] of the swing: what the model is wrong by at least

# Set by judgement: ten harmonics hold all of a pressure pulse. Check: `pytest tests/test_patient.py`
MISSES = 0.25  # [1] of the swing: a best patient that misses the beat by more is none
INDEPENDENT = 20  # [1] numbers in a beat, whatever the points it is drawn with


class PatientFitError(UserError, RuntimeError):
    """No patient of this model has such a beat."""


@dataclass(frozen=True)
class Estimate:
    """A parameter: value and 95 % interval (SI), and whether the recording identifies it."""

    value: float
    low: float
    high: float
    identified: bool


@dataclass(frozen=True)
class Patient:
    """Estimates by name, the complete parameter set, the fitted beat (pressure [Pa], flow [m3/s]), its misfit [Pa]."""

    estimates: dict[str, Estimate]
    values: dict[str, float]
    pressure: np.ndarray
    flow: np.ndarray
    misfit: float
    cardiac_output: float


def fit_patient(
    beat: RecordedBeat,
    base: Mapping[str, float],
    cardiac_output: float | None,
    progress: Callable[[], None] = lambda: None,
) -> Patient:
    """The patient whose steady beat is nearest to `beat`, from `base` on.

    `cardiac_output` [m3/s] is assumed where there is no flow; of a recording with a flow it is None.
    """
    problem = _PatientProblem(beat, base, cardiac_output, progress)
    theta = problem.start()
    noise = problem.noise(theta)
    for _ in range(NOISE_ROUNDS):
        found = least_squares(
            problem.residuals, theta, problem.jacobian, args=(noise,), x_scale="jac", max_nfev=PATIENT_EVALUATIONS
        )
        theta = found.x
        noise = problem.noise(theta)
    return problem.patient(theta, noise)


class _PatientProblem:
    def __init__(
        self, beat: RecordedBeat, base: Mapping[str, float], cardiac_output: float | None, progress: Callable[[], None]
    ) -> None:
        self.beat, self.names, self._progress = beat, list(SPREADS), progress
        self.output = float(beat.flow.mean()) if beat.flow is not None else cardiac_output
        if not self.output or not np.isfinite(self.output) or self.output <= 0:
            mean = (self.output or 0.0) * factor("m3/s", "L/min")
            raise PatientFitError(f"expected a flow with a positive mean but it is {mean:.3g} L/min; check its sign")
        self.base = {**base, "heart_rate": 1 / beat.period, "elements": 3.0}
        self.base |= self._scaled()
        self.kernel = Kernel(aortic_windkessel())

    def _scaled(self) -> dict[str, float]:
        """The base patient made to the recording's size: its mean pressure at this cardiac output and heart rate."""
        b, mean = self.base, float(self.beat.pressure.mean())
        assert self.output is not None
        resistance = max(mean - b["venous_pressure"], LEAST_HEAD * mean) / self.output
        usual = USUAL_STROKE * USUAL_RATE
        volume = self.output / b["heart_rate"] / (usual / USUAL_RATE)
        pressure = mean / (USUAL_PRESSURE * factor("mmHg", "Pa"))
        scaled = {
            "R": resistance,
            "Z_c": Z_C_SHARE * resistance,
            "C": DECAY / resistance,
            "V_0": b["V_0"] * volume,
            "E_max": b["E_max"] * pressure / volume,
            "E_min": b["E_min"] / volume,
            "R_mitral": b["R_mitral"] / volume,
            "R_aortic": b["R_aortic"] / volume,
            "ventricular_volume_start": b["ventricular_volume_start"] * volume,
            "aortic_pressure_start": float(self.beat.pressure.min()),
            "T_offset": min(LONGEST_OFFSET, OFFSET_SHARE * self.beat.period / (1 / USUAL_RATE)),
        }
        return {name: _within(name, value) for name, value in scaled.items()}

    def start(self) -> np.ndarray:
        """The base, its beat turned until it fits best (last entry: how much of a beat it is late)."""
        theta = np.zeros(len(self.names) + 1)
        pressure, _ = self.steady(theta)
        shifts = np.arange(BEAT_POINTS)
        errors = [np.sum((np.roll(pressure, s) - self.beat.pressure) ** 2) for s in shifts]
        theta[-1] = shifts[int(np.argmin(errors))] / BEAT_POINTS
        return theta

    def values(self, theta: np.ndarray) -> dict[str, float]:
        """All parameters: the base's, with those that are fitted."""
        given = {n: _within(n, self.base[n] * float(np.exp(t))) for n, t in zip(self.names, theta, strict=False)}
        return {**self.base, **given}

    def steady(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pressure and aortic flow of the last beat, at the recording's points."""
        period = self.beat.period
        late = float(theta[-1]) % 1.0
        times = (BEATS - 1) * period + ((np.arange(BEAT_POINTS) / BEAT_POINTS - late) % 1.0) * period
        order = np.argsort(times)
        try:
            run = self.kernel.simulate(
                Protocol.of([0, BEATS * period], tube_flow=[0, 0]), times[order], self.values(theta), PATIENT_TOLERANCE
            )
        except KernelError as problem:
            raise PatientFitError(f"no steady beat: {problem}") from None
        self._progress()
        back = np.argsort(order)
        return run["aortic_pressure"][back], run["aortic_flow"][back]

    def residuals(self, theta: np.ndarray, noise: np.ndarray) -> np.ndarray:
        """Misfit over noise, and what the priors say."""
        pressure, flow = self.steady(theta)
        parts = [(pressure - self.beat.pressure) / noise[0]]
        if self.beat.flow is not None:
            parts.append((flow - self.beat.flow) / noise[1])
        else:
            parts.append(np.array([np.log(max(flow.mean(), NO_FLOW) / self.output) / OUTPUT_UNCERTAINTY]))
        parts.append(theta[:-1] / np.array(list(SPREADS.values())))
        return np.concatenate(parts)

    def jacobian(self, theta: np.ndarray, noise: np.ndarray) -> np.ndarray:
        """By central differences of PATIENT_STEP: the integrator's own error is 1e-4 of that."""
        sides = [theta + sign * PATIENT_STEP * e for e in np.eye(theta.size) for sign in (1, -1)]
        found = side_by_side(lambda point: self.residuals(point, noise), sides)
        return np.stack(
            [(up - down) / (2 * PATIENT_STEP) for up, down in zip(found[::2], found[1::2], strict=True)], axis=1
        )

    def swing(self) -> np.ndarray:
        """Of the recorded pressure [Pa] and flow [m3/s]."""
        flow = 0.0 if self.beat.flow is None else float(np.ptp(self.beat.flow))
        return np.array([float(np.ptp(self.beat.pressure)), flow])

    def noise(self, theta: np.ndarray) -> np.ndarray:
        """Of a point of pressure [Pa] and flow [m3/s]: as large as the misfit, at least DISCREPANCY of the swing."""
        pressure, flow = self.steady(theta)
        of_flow = 0.0 if self.beat.flow is None else _rms(flow - self.beat.flow)
        size = np.maximum([_rms(pressure - self.beat.pressure), of_flow], DISCREPANCY * self.swing())
        return np.asarray(size * np.sqrt(BEAT_POINTS / INDEPENDENT))

    def patient(self, theta: np.ndarray, noise: np.ndarray) -> Patient:
        """Estimates with intervals, and the beat."""
        J = self.jacobian(theta, noise)
        deviations = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
        values, estimates = self.values(theta), {}
        for name, deviation in zip(self.names, deviations, strict=False):
            v = values[name]
            estimates[name] = Estimate(
                v,
                v * np.exp(-NORMAL_95 * deviation),
                v * np.exp(NORMAL_95 * deviation),
                bool(deviation < NARROWED * SPREADS[name]),
            )
        pressure, flow = self.steady(theta)
        misfit = float(np.sqrt(np.mean((pressure - self.beat.pressure) ** 2)))
        swing = float(np.ptp(self.beat.pressure))
        if misfit > MISSES * swing:
            raise PatientFitError(
                f"no patient of this model has such a beat: the best one misses it by {misfit * MMHG:.1f} mmHg of "
                f"{swing * MMHG:.0f}; check that it is an arterial pressure, and its unit"
            )
        values = {**values, "ventricular_volume_start": self._filled(theta), "aortic_pressure_start": pressure.min()}
        return Patient(estimates, values, pressure, flow, misfit, float(flow.mean()))

    def _filled(self, theta: np.ndarray) -> float:
        """Volume at the R wave of the steady beat [m3]."""
        end = np.array([BEATS * self.beat.period])
        run = self.kernel.simulate(
            Protocol.of([0, end[0]], tube_flow=[0, 0]), end, self.values(theta), PATIENT_TOLERANCE
        )
        return float(run["ventricular_volume"][0])


MMHG = factor("Pa", "mmHg")
_DECLARED = {p.quantity.name: p.quantity for p in PARAMETERS}


def _within(name: str, value: float) -> float:
    """Inside the declared bounds."""
    return _DECLARED[name].inside(float(value))


def _rms(left: np.ndarray) -> float:
    return float(np.sqrt(np.mean(left**2)))
