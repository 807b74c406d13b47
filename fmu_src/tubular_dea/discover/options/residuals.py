"""Analysis of residuals: their size, their whiteness and their correlations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...identify.fitting.compiled import Ids
from ...identify.fitting.fit import Fit
from ...identify.fitting.misfit import BLOCK, SLOW_CHANCE, block_sums, parts, slow_noise_told
from ...identify.fitting.problem import whitened
from ...identify.signals.colour import filtered
from ...identify.signals.noise import Noise
from ...identify.study.nuisances import with_nuisances
from ...identify.study.remembered import remembers
from ...identify.study.study import Piece, Study

# Set by judgement. Check: `pytest tests/test_acceptance.py -k far`,
# `python -m measured.table`
FAR = 3.0  # [1] residual over noise above which a model is far from the plant
FAR_UNQUIET = 1.5  # [1] the same where noise is bounded only

# Set by judgement: a spectrum without lines is smooth. Check: `pytest tests/test_acceptance.py -k sensor`
PASSED = 16  # [1] frequencies over which the monitors' noise is compared with the sensor's

# Set by judgement: for the reader only, nothing is decided by them. Check: `tubular-dea close-loop DATA --out OUT`
LAG = 25  # [samples] lag of an input that a residual is held against
FAST_SHARE = 0.3  # [1] of all samples: the fastest and the slowest so many are compared for hysteresis
ON_SHARE = 0.1  # [1] of an input's largest value from which on it is on
WHITENESS_LAGS = 20  # [1] lags of block means that their whiteness is judged by


@dataclass(frozen=True)
class LackOfFit:
    """The lack of fit. `excess` is the sum of squares beyond `expected`, the value for noise alone.

    `z_slow` and `z_total` are the excess of block means and of all samples in standard deviations; `structure` is the
    root mean square of the residual beyond noise [SI], `ratio` that of the residual over the noise. Above a ratio of
    `far`, the error of the model's form and not the noise limits the distinction between effects. `coloured` is the
    variance of the block means relative to that of noise where no stretch is quiet or long enough to tell how much slow
    noise there is, and it is alike in all parts of the records; 1 elsewhere. `driven` is the variance of block means
    that the monitors' noise makes of white noise of variance 1, which the likelihood takes the residual for; 1 where it
    makes no more.
    """

    excess: float
    expected: float
    z_slow: float
    z_total: float
    structure: float
    ratio: float
    far: float = FAR
    coloured: float = 1.0
    driven: float = 1.0

    @property
    def by_chance(self) -> float:
        """By how much more effects gain by chance than beside white noise: they are slow, and so is this noise."""
        return max(self.coloured, self.driven)


def lack_of_fit(study: Study, fitted: Fit, pieces: Sequence[Piece] | None = None) -> LackOfFit:
    """The lack of fit of a fit to the training pieces."""
    pieces = study.training if pieces is None else pieces
    n = sum(p.record.size for p in pieces)
    residual = fitted.residual[:n]
    expected = max(expected_squares(study, pieces) - len(fitted.names), 1.0)
    excess = float(residual @ residual) - expected
    means, variance = block_means(residual, pieces), _block_variance(study, pieces)
    level = max(noise.uncertainty for noise in study.noise.values())
    quiet = all(noise.quiet for noise in study.noise.values())
    slow = float(means @ means - variance.sum())
    ends = np.cumsum([p.record.size // BLOCK for p in pieces])[:-1]
    told = slow_noise_told(study.noise.values(), np.split(means / np.sqrt(variance), ends))
    z_slow = slow / np.hypot(np.sqrt(2.0) * np.linalg.norm(variance), level * variance.sum())
    uncertainty = np.hypot(np.sqrt(2.0 * n), level * n)
    share = float(np.mean(np.concatenate([p.weight for p in pieces]) ** 2))
    beyond = max(excess, slow) if z_slow > SLOW_CHANCE else excess  # where the level of the noise hides what is slow
    gained = beyond / n / share * study.noise[pieces[0].case.readings[0].output].slow ** 2
    return LackOfFit(
        excess,
        expected,
        float(z_slow),
        float(excess / uncertainty),
        float(np.sqrt(max(gained, 0.0))),
        float(np.sqrt(max(1 + excess / expected, 0.0))),
        FAR if quiet else FAR_UNQUIET,
        1.0 if told else max(1.0, float(means @ means / variance.sum())),
        max(1.0, float(variance.mean())),
    )


def expected_squares(study: Study, pieces: Sequence[Piece]) -> float:
    """The sum of squares expected from noise: the sensor's, and the part of the monitors' that reaches the residual.

    Where the switching instants of a piece were fitted, their part is removed.
    """
    return float(sum(np.sum(expected_variance(study, p, 1)) for p in pieces))


def excess(study: Study, squares: float) -> float:
    """By how much the `squares` of all experiments are more than noise makes, less what the records' own numbers take.

    Sums of squares alone do not compare between studies that allow for other noise of their monitors.
    """
    return squares - expected_squares(study, study.pieces)


def sensor_squares(study: Study, ids: Ids, values: Mapping[str, float], noise: Mapping[str, Noise]) -> float:
    """The sum of squares that a model leaves of the training records in units of the sensors' `noise`, by output: no
    sample weighs less for what inputs may have done. Infinite where the model has no answer."""
    total = 0.0
    answers = study.response(ids, study.training).possible(study.shared(values))
    for piece, answer in zip(study.training, answers, strict=True):
        if answer is None:
            return float("inf")
        white = whitened(piece.case, with_nuisances(study, piece, answer) - piece.record, noise)
        total += float(white @ white)
    return total


def expected_variance(study: Study, piece: Piece, block: int) -> np.ndarray:
    """The variance of every whitened sample (N,), as it counts in averages over `block` samples."""
    sensor = piece.weight**2
    transmitted = _transmitted(study, piece, block) * (1 - sensor) * _beside_the_sensor(study, piece, block)
    return (sensor + transmitted) * (1 - piece.marginal.variance_removed(sensor.size))


def _beside_the_sensor(study: Study, piece: Piece, block: int) -> np.ndarray:
    """How much larger the monitors' noise is beside the sensor's than where both are slowest (N,).

    Weights compare them there. A sensor whose noise is slow has less of it at the frequencies up to which the lines
    through monitors, the plant and averages over `block` samples pass noise.
    """
    found = np.ones(piece.record.size)
    corners = np.unique(piece.case.protocol.time).size / piece.record.size
    for reading, rows in zip(piece.case.readings, piece.case.parts, strict=True):
        step, noise = reading.clock.step, study.noise[reading.output]
        colour = noise.colour(step)
        fastest = min(0.5 / block, 0.5 * corners, study.plant.bandwidth * step)  # cycles a sample
        passed = np.linspace(0, fastest, PASSED)
        found[rows] = np.mean([colour.density() / colour.density(float(f)) for f in passed])
    return found


def _transmitted(study: Study, piece: Piece, block: int) -> float:
    """The share of the monitors' noise that is in averages over `block` samples.

    A monitor fitted by straight lines keeps noise slower than its corners; the plant keeps noise in its bandwidth. What
    is left of noise that it remembers is alike in neighbouring samples.
    """
    if remembers(piece):
        return 1.0
    corners = np.unique(piece.case.protocol.time).size
    kept = 2 * study.plant.bandwidth * piece.case.readings[0].clock.step
    return min(1.0, block * corners / piece.record.size, block * kept)


def _block_variance(study: Study, pieces: Sequence[Piece]) -> np.ndarray:
    """The variance of `block_means` under noise alone."""
    return np.concatenate([over_blocks(expected_variance(study, p, BLOCK)) for p in pieces])


def over_blocks(values: np.ndarray) -> np.ndarray:
    """The averages of values (n,) over blocks; samples after the last full one are left out."""
    return values[: values.size // BLOCK * BLOCK].reshape(-1, BLOCK).mean(axis=1)


def block_means(residual: np.ndarray, pieces: Sequence[Piece]) -> np.ndarray:
    """Sums over blocks of each piece, scaled to unit variance under white noise."""
    return block_sums(parts(residual, [p.record for p in pieces])) / np.sqrt(BLOCK)


def slow_variance(fitted: Fit, pieces: Sequence[Piece]) -> float:
    """The variance of the white residual's block means relative to that of noise, at least 1."""
    n = sum(p.record.size for p in pieces)
    return max(1.0, float(np.mean(block_means(fitted.residual[:n], pieces) ** 2)))


def tests(study: Study, ids: Ids, fitted: Fit) -> dict[str, float]:
    """Named statistics of the residual: whiteness, correlation with inputs and outputs, asymmetry, hysteresis.

    Correlations are of block means, so that their 95 % limit under the null hypothesis is about 2 / sqrt(blocks).
    """
    pieces = study.training
    n = sum(p.record.size for p in pieces)
    residual = fitted.residual[:n]
    means = block_means(residual, pieces)
    signals = _signals(study, ids, fitted)
    blocks = {name: _block_averages(columns, pieces) for name, columns in signals.items()}
    found = {"blocks": float(means.size), "whiteness": whiteness(means), "limit": 2 / float(np.sqrt(means.size))}
    found["widening"] = widening(means)
    for name, values in blocks.items():
        found[f"correlation with {name}"] = _correlation(means, values)
    for name in [n for n in blocks if n.startswith("rate of")]:
        speed = blocks[name]
        rising, falling = speed > np.quantile(speed, 1 - FAST_SHARE), speed < np.quantile(speed, FAST_SHARE)
        found[f"hysteresis over {name}"] = float(means[rising].mean() - means[falling].mean())
    for name in [s.name for s in study.plant.inputs if s.held and np.ptp(blocks[s.name]) > 0]:
        size = np.abs(blocks[name])
        on = size > ON_SHARE * size.max()
        if 0 < on.sum() < on.size:
            found[f"asymmetry {name} on/off"] = float(np.mean(means[on] ** 2) - np.mean(means[~on] ** 2))
    return found


def whiteness(means: np.ndarray, lags: int = WHITENESS_LAGS) -> float:
    """The Ljung-Box statistic of the block means, in standard deviations under the null hypothesis."""
    centred = means - means.mean()
    power = float(centred @ centred)
    n = centred.size
    lags = min(lags, n // 2)
    q = n * (n + 2) * sum((float(centred[k:] @ centred[:-k]) / power) ** 2 / (n - k) for k in range(1, lags + 1))
    return float((q - lags) / np.sqrt(2 * lags))


def widening(means: np.ndarray, lags: int = WHITENESS_LAGS) -> float:
    """The factor, at least 1, by which standard errors grow as block means resemble those that follow them.

    Newey and West, Econometrica 55 (1987) 703, with their weights.
    """
    centred = means - means.mean()
    lags = min(lags, centred.size // 2)
    alike = sum((1 - k / (lags + 1)) * float(centred[k:] @ centred[:-k]) for k in range(1, lags + 1))
    return float(np.sqrt(max(1.0, 1 + 2 * alike / max(float(centred @ centred), 1e-300))))


def _signals(study: Study, ids: Ids, fitted: Fit) -> dict[str, list[np.ndarray]]:
    """Inputs, outputs, their rates and lags at the samples of each training piece."""
    found: dict[str, list[np.ndarray]] = {}
    outputs = study.response(ids, study.training).outputs(fitted.values)
    for piece, read in zip(study.training, outputs, strict=True):
        times = piece.case.times
        step = piece.case.readings[0].clock.step
        names = dict(piece.case.protocol.at(times))
        for name in list(names):
            names[f"{name}^2"] = names[name] ** 2
            names[f"{name} lag"] = names[name] - _lagged(names[name], step, LAG * step)
        first = piece.case.readings[0].output
        names |= {first: read, f"rate of {first}": np.gradient(read, step)}
        for name, values in names.items():
            found.setdefault(name, []).append(values)
    return found


def _lagged(values: np.ndarray, step: float, tau: float) -> np.ndarray:
    keep = float(np.exp(-step / tau))
    return filtered([1 - keep], [1, -keep], values, keep * values[:1])


def _block_averages(columns: Sequence[np.ndarray], pieces: Sequence[Piece]) -> np.ndarray:
    joined = np.concatenate(list(columns))
    return block_means(joined, pieces) / np.sqrt(BLOCK)


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    deviation = float(np.std(a) * np.std(b))
    return float(np.mean((a - a.mean()) * (b - b.mean())) / deviation) if deviation > 0 else 0.0
