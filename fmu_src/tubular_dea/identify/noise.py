"""The sensor's noise, from the record alone: what a low polynomial leaves over in stretches without any event.

The misfit of a model has no part in it, so an effect that the model lacks cannot hide in the noise. The noise is
taken as an autoregression of first order (white where `correlation` is 0), by restricted maximum likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

WINDOW, LEAST, DEGREE = 60, 30, 3  # samples a stretch has, at most and at least, and the polynomial's degree
FORM = 0.012  # relative error of the variance that remains however long the record
SETTLED = 0.1  # s after an event until the radius moves slowly


@dataclass(frozen=True)
class Noise:
    """First-order autoregressive noise: `rms` in the output's unit, `correlation` between neighbouring samples.

    `freedom` is the number of degrees of freedom that `rms` was estimated with.
    """

    rms: float
    correlation: float
    freedom: float = np.inf

    @property
    def doubt(self) -> float:
        """Relative standard error of the variance: by chance, and as no noise is quite of this form."""
        return max(FORM, float(np.sqrt(2 / self.freedom)))

    @property
    def innovation(self) -> float:
        """Standard deviation of what is new in each sample."""
        return self.rms * float(np.sqrt(1 - self.correlation**2))

    def whiten(self, time: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Values (n,) or columns (n, k) in units of the innovation; a gap in `time` starts anew."""
        follows = np.append(False, _steady(time))
        scale = np.where(follows, 1 / self.innovation, 1 / self.rms).reshape(-1, *[1] * (values.ndim - 1))
        white = values * scale
        if self.correlation:
            white[1:] -= self.correlation * follows[1:].reshape(scale[1:].shape) * scale[1:] * values[:-1]
        return white

    def sample(self, time: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """Noise of this kind at `time`, for a bootstrap."""
        from scipy.signal import lfilter

        new = random.standard_normal(time.size) * self.innovation
        new[0] *= self.rms / self.innovation
        return lfilter([1.0], [1.0, -self.correlation], new)


def _steady(time: np.ndarray) -> np.ndarray:
    step = np.diff(time)
    return step < 1.5 * np.median(step)


def quiet_stretches(time: np.ndarray, events: np.ndarray) -> list[slice]:
    """Stretches of up to WINDOW samples with no event inside or shortly before."""
    found = []
    for begin, end in zip(events[:-1], events[1:], strict=True):
        first, last = np.searchsorted(time, [begin + SETTLED, end])
        pieces = max(1, round((last - first) / WINDOW))
        bounds = np.linspace(first, last, pieces + 1).astype(int)
        found += [slice(a, b) for a, b in zip(bounds[:-1], bounds[1:], strict=True) if b - a >= LEAST]
    return found


def estimate(records: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> Noise:
    """The noise common to records of (time, output, times of events); outputs without gaps.

    Where no record has a quiet stretch, all of them are used, cut into windows.
    """
    stretches = [output[s] for time, output, events in records for s in quiet_stretches(time, events)]
    if not stretches:
        stretches = [y[a : a + LEAST] for _, y, _ in records for a in range(0, y.size - LEAST + 1, LEAST)]
    by_size: dict[int, np.ndarray] = {}
    for size in {s.size for s in stretches}:
        by_size[size] = np.stack([s for s in stretches if s.size == size])
    best = minimize_scalar(lambda c: _restricted(by_size, c)[0], bounds=(-0.5, 0.97), method="bounded",
                           options={"xatol": 1e-3})  # fmt: skip
    correlation = float(best.x) if abs(best.x) > 0.03 else 0.0
    innovation = _restricted(by_size, correlation)[1]
    freedom = sum(len(s) * (size - DEGREE - 1) for size, s in by_size.items())
    return Noise(innovation / float(np.sqrt(1 - correlation**2)), correlation, freedom)


def _restricted(by_size: dict[int, np.ndarray], correlation: float) -> tuple[float, float]:
    """Minus the restricted log likelihood (but for constants), and the innovation's standard deviation."""
    squares, freedom, terms = 0.0, 0, 0.0
    for size, stretches in by_size.items():
        basis = np.polynomial.legendre.legvander(np.linspace(-1, 1, size), DEGREE)
        white = _whitened(basis, correlation)
        q, r = np.linalg.qr(white)
        data = _whitened(stretches.T, correlation)
        left = data - q @ (q.T @ data)
        squares += float(np.sum(left**2))
        freedom += stretches.shape[0] * (size - basis.shape[1])
        terms += stretches.shape[0] * (2 * np.sum(np.log(np.abs(np.diag(r)))) - np.log(1 - correlation**2))
    variance = max(squares / max(freedom, 1), 1e-300)
    return 0.5 * (freedom * np.log(variance) + terms), float(np.sqrt(variance))


def _whitened(columns: np.ndarray, correlation: float) -> np.ndarray:
    first = columns[:1] * np.sqrt(1 - correlation**2)
    return np.concatenate([first, columns[1:] - correlation * columns[:-1]])
