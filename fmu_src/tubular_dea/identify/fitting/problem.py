"""The least squares problem behind an identification: whitened residuals of all experiments and their Jacobian.

Parameters enter scaled: as the logarithm of what must stay positive, as multiples of their size otherwise. Both
residuals and columns are in units of the sensor's noise, so that half the sum of squares is minus the log likelihood.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...kernel import KernelError
from ..signals.noise import Noise
from .cases import Case
from .marginal import Marginal
from .response import Response

# Set by measurement: a tube without pressure rings where it is not stretched, and takes 51 000 steps for 6000 samples
# and points of inputs where a search starts, 82 000 where it ends.
# Check: `pytest tests/test_unusual_recordings.py -k without_pressure`
MORE_STEPS = 2.0  # [1] times the integrator's steps at its start that a search may take, where these are many

# Set by judgement: 20 000 times the usual size, or a part of it. Check: `pytest tests/test_identify.py`
FARTHEST = 10.0  # [1] of a logarithm, from the usual size: no parameter is sought beyond
MOST_LOG = 60.0  # [1] of a logarithm: steps of a search that go beyond are computed as if they went so far
OFF_BOUND = 1e-9  # [1] of the solver's numbers by which a search starts off a bound


@dataclass(frozen=True)
class Free:
    """A parameter that is identified: its typical `size`, and bounds in SI units (None where there is none).

    `logarithmic` ones stay positive and are searched over orders of magnitude. `usual` is where a weak prior holds it
    (its size, if not given). A `vanishing` one is counted by its logarithm far above its size and as it is below, so
    that it may be nothing.
    """

    name: str
    size: float
    lower: float | None = None
    upper: float | None = None
    logarithmic: bool = False
    usual: float | None = None
    vanishing: bool = False

    def to_scaled(self, value: float) -> float:
        """The number the solver works with."""
        if self.vanishing:
            return float(np.arcsinh(value / (2 * self.size)))
        return float(np.log(value / self.size)) if self.logarithmic else value / self.size

    def to_si(self, scaled: float) -> float:
        """Back to SI units."""
        if not (self.vanishing or self.logarithmic):
            return float(scaled) * self.size
        near = np.clip(scaled, -MOST_LOG, MOST_LOG)
        return 2 * self.size * float(np.sinh(near)) if self.vanishing else self.size * float(np.exp(near))

    def usually(self) -> float:
        """The scaled number about which a weak prior holds it."""
        return self.to_scaled(self.size if self.usual is None else self.usual)

    def pulled(self, scaled: float, prior: float) -> tuple[float, float]:
        """How far a number is from where a weak prior of width `prior` holds it, in widths, and its slope.

        One that is counted in multiples of its usual size may be many times as large: the logarithm counts then.
        """
        away = (scaled - self.usually()) / prior
        if self.logarithmic or self.vanishing:
            return away, 1 / prior
        return float(np.arcsinh(away)), 1 / (prior * float(np.hypot(1.0, away)))

    def slope(self, value: float) -> float:
        """d(SI value)/d(scaled)."""
        if self.vanishing:
            return float(np.hypot(value, 2 * self.size))
        return value if self.logarithmic else self.size

    def bounds(self) -> tuple[float, float]:
        """Bounds of the scaled number."""
        low = -np.inf if self.lower is None else self.to_scaled(self.lower)
        high = np.inf if self.upper is None else self.to_scaled(self.upper)
        return low, high


@dataclass
class Problem:
    """Residuals of `response` against `records` (each (n,), in SI units) at `free` parameters, the others `fixed`.

    `noise` is that of each output. `weights`, one array (n,) a case, lower the say of samples whose inputs are
    uncertain; `marginals`, one a case, are each record's own numbers, integrated out. `prior` holds the solver's
    numbers (k,) near their usual ones within about `prior`: so weakly that it affects only directions which the
    records do not determine.
    """

    response: Response
    records: Sequence[np.ndarray]
    noise: Mapping[str, Noise]
    free: Sequence[Free]
    fixed: Mapping[str, float]
    weights: Sequence[np.ndarray] | None = None
    prior: float | None = None
    marginals: Sequence[Marginal] | None = None

    @property
    def names(self) -> list[str]:
        """The free parameters in the order of the Jacobian's columns."""
        return [f.name for f in self.free]

    def values(self, scaled: np.ndarray) -> dict[str, float]:
        """Parameters in SI units for the solver's numbers (k,)."""
        return dict(self.fixed) | {f.name: f.to_si(s) for f, s in zip(self.free, scaled, strict=True)}

    def scaled(self, values: Mapping[str, float]) -> np.ndarray:
        """The solver's numbers (k,) for parameters in SI units, moved inside their bounds."""
        return self.inside(np.array([f.to_scaled(values[f.name]) for f in self.free]))

    def inside(self, scaled: np.ndarray) -> np.ndarray:
        """The nearest numbers (k,) at which a search may start: off the bounds, and not far from the usual sizes."""
        low, high = self.bounds()
        far = np.array([FARTHEST if f.logarithmic else np.inf for f in self.free])
        room = OFF_BOUND * (1 + np.abs(scaled))
        return np.clip(scaled, np.maximum(low, -far) + room, np.minimum(high, far) - room)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds of the solver's numbers, each (k,)."""
        pairs = np.array([f.bounds() for f in self.free]).reshape(-1, 2)
        return pairs[:, 0], pairs[:, 1]

    def whiten(self, columns: Sequence[np.ndarray]) -> np.ndarray:
        """Values or columns of all cases, whitened, weighted and stacked."""
        parts = []
        for i, (case, part) in enumerate(zip(self.response.cases, columns, strict=True)):
            white = whitened(case, part, self.noise, None if self.weights is None else self.weights[i])
            parts.append(white if self.marginals is None else self.marginals[i].apply(white))
        return np.concatenate(parts)

    def residuals(self, scaled: np.ndarray, most_steps: float = np.inf) -> np.ndarray:
        """Model minus record, whitened, shape (N,), the prior last; infinite where the model cannot be solved, or only
        in more than `most_steps` of the integrator.

        Far from any usual size it is not simulated: it may ring there for millions of steps.
        """
        try:
            if any(f.logarithmic and abs(s) > FARTHEST for f, s in zip(self.free, scaled, strict=True)):
                raise KernelError("a parameter is far from any usual size")
            outputs = self.response.outputs(self.values(scaled), total_steps=most_steps)
            if self.response.steps > most_steps:
                raise KernelError("the model moves faster than these records show")
        except KernelError:
            rows = sum(r.size for r in self.records) + (len(self.free) if self.prior else 0)
            return np.full(rows, np.inf)
        return self._residual(scaled, outputs)

    def most_steps(self) -> float:
        """The steps that a search from the last point may take: as many as records can show, or somewhat more than
        there."""
        return max(self.response.most_steps, MORE_STEPS * self.response.steps)

    def numerical_error(self, finer: float) -> float:
        """What a `finer` tolerance changes at the `fixed` values: the sum of squares in units of the noise."""
        here, there = self.response.outputs(self.fixed), self.response.outputs(self.fixed, finer)
        changed = self.whiten([a - b for a, b in zip(here, there, strict=True)])
        return float(changed @ changed)

    def _residual(self, scaled: np.ndarray, outputs: Sequence[np.ndarray]) -> np.ndarray:
        white = self.whiten([y - r for y, r in zip(outputs, self.records, strict=True)])
        return np.concatenate([white, self.pulled(scaled)[:, 0]]) if self.prior else white

    def pulled(self, scaled: np.ndarray) -> np.ndarray:
        """How far the prior finds every number from its usual one, and the slopes of that (k, 2)."""
        pairs = [f.pulled(s, self.prior) for f, s in zip(self.free, scaled.tolist(), strict=True)] if self.prior else []
        return np.array(pairs).reshape(-1, 2)

    def linearised(self, scaled: np.ndarray, more: Sequence[str] = ()) -> tuple[np.ndarray, np.ndarray]:
        """Residuals (N,) and Jacobian (N, k + len(more)); `more` are fixed parameters, their columns in SI units."""
        values = self.values(scaled)
        outputs, columns = self.response.sensitivities(values, [*self.names, *more])
        slopes = np.array([*(f.slope(values[f.name]) for f in self.free), *(1.0 for _ in more)])
        jacobian = self.whiten(columns)
        jacobian *= slopes
        if self.prior:
            held = np.eye(len(self.free), len(self.free) + len(more))
            jacobian = np.concatenate([jacobian, held * self.pulled(scaled)[:, 1:]])
        return self._residual(scaled, outputs), jacobian


def whitened(
    case: Case, values: np.ndarray, noise: Mapping[str, Noise], weight: np.ndarray | None = None
) -> np.ndarray:
    """Values (N,) or columns (N, k) of a case in units of each output's noise, weighted."""
    white = np.concatenate(
        [
            noise[reading.output].whiten(reading.clock, reading.evened(values[part]))
            for reading, part in zip(case.readings, case.parts, strict=True)
        ]
    )
    if weight is not None:
        white *= weight.reshape(-1, *[1] * (values.ndim - 1))
    return white
