"""The colour of noise: white, coloured with one time constant, or both together, at any sampling rate.

A first-order process of time constant tau, seen every `step` seconds, is an autoregression with phi = exp(-step / tau);
with white noise on top it is ARMA(1, 1), whose innovations whiten it (Box and Jenkins, "Time series analysis", ch. 4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter


@dataclass(frozen=True)
class Colour:
    """Noise of variance 1 at one sampling rate.

    A share `white` of the variance is white, the rest an autoregression with coefficient `phi`.
    """

    phi: float
    white: float = 0.0

    @property
    def correlation(self) -> float:
        """Between neighbouring samples."""
        return (1 - self.white) * self.phi

    @property
    def theta(self) -> float:
        """Coefficient of the moving average: y_t - phi y_(t-1) = e_t - theta e_(t-1)."""
        if self.white <= 0 or self.phi == 0:
            return 0.0
        ratio = (1 + self.phi**2 - 2 * self.phi**2 * (1 - self.white)) / (self.white * self.phi)
        return float(ratio - np.sign(ratio) * np.sqrt(max(ratio**2 - 4, 0.0))) / 2

    @property
    def innovation(self) -> float:
        """Variance of what is new in each sample."""
        theta = self.theta
        return self.white * self.phi / theta if theta else 1 - self.correlation**2

    def density(self, frequency: float = 0.0) -> float:
        """Spectral density at a `frequency` in cycles a sample; 1 for white noise."""
        turn = 2 * np.pi * frequency
        line = (1 - self.phi**2) / (1 + self.phi**2 - 2 * self.phi * np.cos(turn))
        return float((1 - self.white) * line + self.white)

    def whiten(self, values: np.ndarray) -> np.ndarray:
        """Values (n,) or columns (n, k) without a gap, in units of the innovation; the first in units of 1."""
        phi, theta, new = self.phi, self.theta, self.innovation
        white = np.empty(values.shape)
        white[0] = values[0]
        if len(values) > 1:
            begin = (theta * new - phi) * values[:1]  # what the first sample says of its own innovation
            white[1:] = lfilter([1.0, -phi], [1.0, -theta], values[1:], axis=0, zi=begin)[0] / np.sqrt(new)
        return white

    def sample(self, count: int, random: np.random.Generator) -> np.ndarray:
        """Noise of this colour."""
        fresh = random.standard_normal(count) * np.sqrt(1 - self.phi**2)
        fresh[:1] /= np.sqrt(1 - self.phi**2)
        coloured = lfilter([1.0], [1.0, -self.phi], fresh)
        return np.sqrt(1 - self.white) * coloured + np.sqrt(self.white) * random.standard_normal(count)
