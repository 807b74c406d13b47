"""The colour of noise: white, coloured with one time constant, both together, or 1/f noise, at any sampling rate.

A first-order process of time constant tau, seen every `step` seconds, is an autoregression with phi = exp(-step / tau);
with white noise on top it is ARMA(1, 1), whose innovations whiten it (Box and Jenkins, "Time series analysis", ch. 4).
Noise whose spectrum falls over decades (1/f) is that behind a filter which raises what is slow, and so ARMA(2, 2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

# Set by theory: what is left of its start is 2 %. Check: `pytest tests/test_noise.py -k colour`
FADED = 4.0  # [time constants] after which a filter has settled
NEIGHBOURS = 1.5  # [1] times the step of neighbours from which on samples are none


@dataclass(frozen=True)
class Colour:
    """Noise of variance 1 at one sampling rate.

    A share `white` of the variance is white, the rest an autoregression with coefficient `phi`; all this is behind the
    filter (1 - zero z) / (1 - pole z), z a delay of one sample, if `pole` is more than `zero`.
    """

    phi: float
    white: float = 0.0
    pole: float = 0.0
    zero: float = 0.0

    def at(self, steps: float) -> Colour:
        """The colour of samples so many times as far apart; a negative correlation is one of neighbours alone."""
        alone = self.phi if steps < NEIGHBOURS else 0.0
        return Colour(self.phi**steps if self.phi > 0 else alone, self.white, self.pole**steps, self.zero**steps)

    @property
    def raised(self) -> float:
        """The variance behind the filter of what has variance 1 before it."""
        own, beside = self._response
        return own + 2 * self.correlation * beside / (1 - self.pole * self.phi)

    @property
    def _response(self) -> tuple[float, float]:
        """The autocorrelation of the filter's response: at no lag, and at one sample; behind it falls as `pole`."""
        p, d = self.pole, self.pole - self.zero
        return 1 + d**2 / (1 - p**2), d + d**2 * p / (1 - p**2)

    @property
    def correlation(self) -> float:
        """Between neighbouring samples, before the filter."""
        return (1 - self.white) * self.phi

    @property
    def neighbours(self) -> float:
        """The correlation between neighbouring samples."""
        own, beside = self._response
        lasting = beside * (self.pole + self.phi) / (1 - self.pole * self.phi)
        return (beside + self.correlation * (own + lasting)) / self.raised

    @property
    def theta(self) -> float:
        """Coefficient of the moving average: y_t - phi y_(t-1) = e_t - theta e_(t-1)."""
        if self.white <= 0 or self.phi == 0:
            return 0.0
        ratio = (1 + self.phi**2 - 2 * self.phi**2 * (1 - self.white)) / (self.white * self.phi)
        return float(2 / (ratio + np.sign(ratio) * np.sqrt(max(ratio * ratio - 4, 0.0))))  # 0 where that is too large

    @property
    def innovation(self) -> float:
        """Variance of what is new in each sample."""
        return self._new / self.raised

    @property
    def _new(self) -> float:
        theta = self.theta
        return self.white * self.phi / theta if theta else 1 - self.correlation**2

    def density(self, frequency: float = 0.0) -> float:
        """Spectral density at a `frequency` in cycles a sample; 1 for white noise."""
        along = np.cos(2 * np.pi * frequency)
        line = (1 - self.phi**2) / (1 + self.phi**2 - 2 * self.phi * along)
        filtered = (1 + self.zero**2 - 2 * self.zero * along) / (1 + self.pole**2 - 2 * self.pole * along)
        return float(((1 - self.white) * line + self.white) * filtered / self.raised)

    def whiten(self, values: np.ndarray) -> np.ndarray:
        """Values (n,) or columns (n, k) without a gap, in units of the innovation; the first in units of 1."""
        new = self._new
        return _sieved(self._unfiltered(values), self.phi, self.theta, new, 1 / np.sqrt(new))

    def _unfiltered(self, values: np.ndarray) -> np.ndarray:
        """Values (n,) or (n, k) before the filter, of variance 1."""
        if self.pole == self.zero:
            return values
        raised, d = self.raised, self.pole - self.zero
        known = (1 + d * (1 - self.white) * self.phi / (1 - self.pole * self.phi)) / raised
        return _sieved(values, self.pole, self.zero, known, np.sqrt(raised))

    def sample(self, count: int, random: np.random.Generator) -> np.ndarray:
        """Noise of this colour."""
        if self.pole > self.zero:
            settles = int(FADED / (1 - self.pole))
            before = Colour(self.phi, self.white).sample(settles + count, random)
            return filtered([1.0, -self.zero], [1.0, -self.pole], before)[settles:] / np.sqrt(self.raised)
        fresh = random.standard_normal(count) * np.sqrt(1 - self.phi**2)
        fresh[:1] /= np.sqrt(1 - self.phi**2)
        coloured = filtered([1.0], [1.0, -self.phi], fresh)
        return np.sqrt(1 - self.white) * coloured + np.sqrt(self.white) * random.standard_normal(count)


def _sieved(values: np.ndarray, pole: float, zero: float, known: float, scale: float) -> np.ndarray:
    """Values (n,) or (n, k) behind `scale` (1 - pole z) / (1 - zero z); of what comes out first, a share `known` of the
    first value is known. The first value stays."""
    if zero == 0:
        found = scale * values
        found[1:] -= scale * pole * values[:-1]
    else:
        found = filtered([scale, -scale * pole], [1.0, -zero], values, scale * (known - 1) * values[:1])
    found[:1] = values[:1]
    return found


def filtered(
    above: Sequence[float], below: Sequence[float], values: np.ndarray, begin: np.ndarray | None = None
) -> np.ndarray:
    """Values (n,) or (n, k) behind a recursive filter with these coefficients, of a pole and a zero at most, from the
    state `begin` (1,) or (1, k), or from rest."""
    from scipy.signal import lfilter  # half a second, for which white noise does not wait

    if values.size == 0:
        return values.copy()
    return lfilter(above, below, values, axis=0, zi=np.zeros_like(values[:1]) if begin is None else begin)[0]
