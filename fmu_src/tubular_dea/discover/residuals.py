"""What is left over: how large, how white, and what it goes along with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..identify.fit import Fit
from ..identify.misfit import BLOCK, block_sums, parts
from .compiled import Ids
from .study import Piece, Study

BANDWIDTH = 25.0  # Hz, of the tube: what comes in by the monitors does not reach further


@dataclass(frozen=True)
class Adequacy:
    """Whether a residual is noise. `excess` is what the sum of squares has beyond what noise leaves, `expected`.

    `z_slow` and `z_total` are the excess of block means and of all samples in standard deviations; `structure` is the
    root mean square of what is not noise [SI], `ratio` the residual's over the noise's.
    """

    excess: float
    expected: float
    z_slow: float
    z_total: float
    structure: float
    ratio: float


def adequacy(study: Study, fitted: Fit, pieces: Sequence[Piece] | None = None) -> Adequacy:
    """How the residual of a fit to the training pieces compares with the noise."""
    pieces = study.training if pieces is None else pieces
    n = sum(p.record.size for p in pieces)
    residual = fitted.residual[:n]
    expected = max(expected_squares(study, pieces) - len(fitted.names), 1.0)
    excess = float(residual @ residual) - expected
    means, variance = block_means(residual, pieces), _block_variance(pieces)
    level = study.noise.doubt
    z_slow = float(means @ means - variance.sum()) / np.hypot(np.sqrt(2.0) * np.linalg.norm(variance),
                                                              level * variance.sum())  # fmt: skip
    doubt = np.hypot(np.sqrt(2.0 * n), level * n)
    share = float(np.mean(np.concatenate([p.weight for p in pieces]) ** 2))
    gained = excess / n / share * (study.noise.innovation / (1 - study.noise.correlation)) ** 2
    return Adequacy(excess, expected, float(z_slow), float(excess / doubt), float(np.sqrt(max(gained, 0.0))),
                    float(np.sqrt(max(1 + excess / expected, 0.0))))  # fmt: skip


def expected_squares(study: Study, pieces: Sequence[Piece]) -> float:
    """The sum of squares that noise leaves: the sensor's in full, the monitors' as far as it came through."""
    return float(sum(np.sum(p.weight**2 + _through(p, 1) * (1 - p.weight**2)) for p in pieces))


def _through(piece: Piece, block: int) -> float:
    """The share of the monitors' noise that is in averages over `block` samples.

    A monitor drawn as straight lines keeps the noise slower than its corners; the tube keeps what is in its bandwidth.
    """
    corners = np.unique(piece.case.protocol.time).size
    tube = 2 * BANDWIDTH * float(np.median(np.diff(piece.case.times)))
    return min(1.0, block * corners / piece.record.size, block * tube)


def _block_variance(pieces: Sequence[Piece]) -> np.ndarray:
    """The variance of `block_means` under noise alone."""
    weights = [p.weight[: p.weight.size // BLOCK * BLOCK].reshape(-1, BLOCK) ** 2 for p in pieces]
    return np.concatenate([
        (w + _through(p, BLOCK) * (1 - w)).mean(axis=1) for w, p in zip(weights, pieces, strict=True)
    ])  # fmt: skip


def block_means(residual: np.ndarray, pieces: Sequence[Piece]) -> np.ndarray:
    """Sums over blocks of each piece, scaled to unit variance under white noise."""
    return block_sums(parts(residual, [p.record for p in pieces])) / np.sqrt(BLOCK)


def tests(study: Study, ids: Ids, fitted: Fit) -> dict[str, float]:
    """Named statistics of the residual: whiteness, correlation with what drives the tube, asymmetry, hysteresis.

    Correlations are of block means, so that 2 / sqrt(blocks) is about their 95 % limit under the null.
    """
    pieces = study.training
    n = sum(p.record.size for p in pieces)
    residual = fitted.residual[:n]
    means = block_means(residual, pieces)
    signals = _signals(study, ids, fitted)
    blocks = {name: _block_averages(columns, pieces) for name, columns in signals.items()}
    found = {"blocks": float(means.size), "whiteness": whiteness(means), "limit": 2 / float(np.sqrt(means.size))}
    for name, values in blocks.items():
        found[f"correlation with {name}"] = _correlation(means, values)
    speed, voltage = blocks["lambda_2_rate"], blocks["voltage"]
    rising, falling = speed > np.quantile(speed, 0.7), speed < np.quantile(speed, 0.3)
    found["hysteresis"] = float(means[rising].mean() - means[falling].mean())
    if np.ptp(voltage) > 0:
        on = voltage > 0.1 * voltage.max()
        found["asymmetry on/off"] = (
            float(np.mean(means[on] ** 2) - np.mean(means[~on] ** 2)) if 0 < on.sum() < on.size else 0.0
        )
    return found


def whiteness(means: np.ndarray, lags: int = 20) -> float:
    """Ljung and Box's statistic of the block means in standard deviations of its null."""
    centred = means - means.mean()
    power = float(centred @ centred)
    n = centred.size
    lags = min(lags, n // 2)
    q = n * (n + 2) * sum((float(centred[k:] @ centred[:-k]) / power) ** 2 / (n - k) for k in range(1, lags + 1))
    return float((q - lags) / np.sqrt(2 * lags))


def _signals(study: Study, ids: Ids, fitted: Fit) -> dict[str, list[np.ndarray]]:
    """Inputs, stretch and their lags at the samples of each training piece."""
    kernel = study.compiled.kernel(ids)
    found: dict[str, list[np.ndarray]] = {}
    for piece in study.training:
        run = kernel.simulate(piece.case.protocol, piece.case.times, study.geometry | fitted.values)
        step = float(np.median(np.diff(piece.case.times)))
        names = {name: run[name] for name in (*kernel.inputs, *kernel.states[:2]) if name in run.values}
        if "voltage" in names:
            names["voltage^2"] = names["voltage"] ** 2
        for name, values in list(names.items()):
            if name in kernel.inputs:
                names[f"{name} lag"] = values - _lagged(values, step, 0.1)
        for name, values in names.items():
            found.setdefault(name, []).append(values)
    return found


def _lagged(values: np.ndarray, step: float, tau: float) -> np.ndarray:
    from scipy.signal import lfilter

    keep = float(np.exp(-step / tau))
    return lfilter([1 - keep], [1, -keep], values, zi=[keep * values[0]])[0]


def _block_averages(columns: Sequence[np.ndarray], pieces: Sequence[Piece]) -> np.ndarray:
    joined = np.concatenate(list(columns))
    return block_means(joined, pieces) / np.sqrt(BLOCK)


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    deviation = float(np.std(a) * np.std(b))
    return float(np.mean((a - a.mean()) * (b - b.mean())) / deviation) if deviation > 0 else 0.0
