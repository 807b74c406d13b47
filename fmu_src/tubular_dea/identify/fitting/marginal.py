"""The marginal likelihood: nuisance parameters of a record integrated out (zeros, hum, switching instants, starts).

A nuisance parameter b with a Gaussian prior of standard deviation s adds a column c b to a whitened residual r. With b
integrated out, r has covariance I + s^2 c c'. Multiplying by the inverse square root of that makes it white again: the
part of r along c shrinks by 1 / sqrt(1 + s^2 |c|^2). The same matrix whitens Jacobians and candidates' columns, so the
rest of the code does not depend on it (Kennedy and O'Hagan 2001; Bishop, "Pattern recognition", ch. 3).

Nuisance parameters that act for a short time (a switching instant) have their own windows, which do not overlap; they
come first and cost nothing. Those that act throughout (zeros) come after them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtr

# Set by theory: far from rounding and from what counts; no unit test tells a factor of four.
# Check: `pytest tests/test_marginal.py`
POINTLIKE = 1e-3  # [standard deviations] of a window below which a difference of large terms has lost its digits


@dataclass(frozen=True)
class Window:
    """A nuisance parameter that acts only on the samples `where`: its direction `unit` (m,) of length 1, `size` = s
    |c|, and `usual_size`, the same for |c| on average over all that the parameter may be."""

    where: slice
    unit: np.ndarray
    size: float
    usual_size: float


@dataclass(frozen=True)
class Marginal:
    """The nuisance parameters of one record: `windows`, and whitened `columns` (n, k) times their standard deviations.

    The columns' singular values are `sizes` (k,), along the directions `turned` (k, k): no direction in the record is
    computed, which would take longer than anything else where it is long.

    In the windows the parameter was fitted to the record within its bounds (its mean and `size` to both sides), which
    removes a part of the noise too.
    """

    windows: tuple[Window, ...] = ()
    columns: np.ndarray | None = None
    turned: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    sizes: np.ndarray = field(default_factory=lambda: np.empty(0))

    def apply(self, white: np.ndarray) -> np.ndarray:
        """Whitened values (n,) or columns (n, m) with the nuisance parameters integrated out; a new array."""
        out = white.copy()
        for window in self.windows:
            part = out[window.where]
            part += _outer(window.unit, shrink(window.size) * (window.unit @ part))
        wide = np.hypot(1, self.sizes)
        self._add(out, -1 / (wide * (1 + wide)))  # shrink(size) / size^2
        return out

    def undone(self, white: np.ndarray) -> np.ndarray:
        """What `apply` makes of values (n,) or columns (n, m), whitened as before; a new array."""
        out = white.copy()
        self._add(out, 1 / (1 + np.hypot(1, self.sizes)))
        for window in self.windows:
            part = out[window.where]
            part += _outer(window.unit, (np.hypot(1, window.size) - 1) * (window.unit @ part))
        return out

    def _add(self, out: np.ndarray, weights: np.ndarray) -> None:
        """Add to `out` (n,) or (n, m) its parts along all directions in the record, times `weights` (k,) of size^2."""
        if self.columns is not None:
            out += self.columns @ ((self.turned * weights) @ (self.turned.T @ (self.columns.T @ out)))

    def with_columns_at(self, places: np.ndarray, columns: np.ndarray, sd: np.ndarray) -> Marginal:
        """The nuisances with other whitened columns (n, k) throughout, and sd (k,), at some `places` (k,) of theirs."""
        if self.columns is None:
            return self
        scaled = self.columns.copy()
        scaled[:, places] = Marginal(self.windows).apply(columns * sd)
        return _turned(self.windows, scaled)

    @property
    def log_determinant(self) -> float:
        """By how much the nuisance parameters widen the likelihood: the logarithm of the covariance's determinant.

        Sums of squares with different priors, or different columns, compare with this added to them. What windows add
        must not depend on where in their bounds an instant was found: there may be hundreds of them.
        """
        windows = sum(np.log1p(w.usual_size**2) for w in self.windows)
        return float(windows + np.log1p(self.sizes**2).sum())

    def variance_removed(self, n: int) -> np.ndarray:
        """The share of each sample's variance that fitting the windows removes, shape (n,)."""
        out = np.zeros(n)
        for window in self.windows:
            out[window.where] += window.unit**2 * (1 - _left_over(window.size))
        return out


def marginal(
    windows: Sequence[tuple[slice, np.ndarray, float, float]], columns: np.ndarray, sd: np.ndarray
) -> Marginal:
    """The nuisances with whitened columns: in windows (where, column, sd, usual length of the column), and throughout:
    (n, k) with sd (k,)."""
    made = []
    for where, column, deviation, usual in windows:
        length = float(np.linalg.norm(column))
        if length > 0 and deviation > 0:
            made.append(Window(where, column / length, deviation * length, deviation * usual))
    return beside_windows(tuple(made), columns, sd)


def beside_windows(windows: tuple[Window, ...], columns: np.ndarray, sd: np.ndarray) -> Marginal:
    """The nuisances of known windows with whitened columns (n, k) throughout, and sd (k,)."""
    local = Marginal(windows)
    if not np.any(sd > 0):
        return local
    return _turned(windows, local.apply(columns * sd))  # columns that are not used become nothing, and add nothing


def _turned(windows: tuple[Window, ...], scaled: np.ndarray) -> Marginal:
    """The nuisances with columns (n, k) that are scaled already."""
    squares, turned = np.linalg.eigh(scaled.T @ scaled)  # of small ones, less than rounding of the largest is lost
    return Marginal(windows, scaled, turned, np.sqrt(np.maximum(squares, 0.0)))


def shrink(size: float) -> float:
    """What is added of a direction with standard deviation `size` beside noise of 1, to make it white."""
    return float(1 / np.hypot(1, size) - 1)


def _left_over(size: float) -> float:
    """The variance along a window's direction when the record was followed there, and the window was integrated out.

    There z = n + t, noise n ~ N(0, 1) and a truth t that is anywhere between -size and size alike; following takes the
    nearest number between these bounds from z, and `shrink` leaves a part 1 / sqrt(1 + size^2). The mean square of what
    of z is beyond the bounds is E max(n - d, 0)^2, averaged over distances d from 0 to 2 size, and once more for the
    other bound. (Were t ~ N(0, size^2) and followed to its most likely value, 1 / (1 + size^2)^2 would be left.)
    """
    if size < POINTLIKE:
        return 1.0
    d = 2 * size
    density = np.exp(-0.5 * d**2) / np.sqrt(2 * np.pi)
    beyond = 2 / np.sqrt(2 * np.pi) - (2 + d**2) * density + (d**3 + 3 * d) * ndtr(-d)
    return float(beyond / (3 * size * (1 + size**2)))


def _outer(unit: np.ndarray, along: np.ndarray | float) -> np.ndarray:
    return unit[:, None] * along if np.ndim(along) else unit * along
