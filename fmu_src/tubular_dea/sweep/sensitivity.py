"""What the results depend on: Sobol indices by SALib, tornado bars, and the spread of sampled results."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..extra import load
from .axes import Axis, Joint
from .design import Design
from .saltelli import problem


@dataclass(frozen=True)
class Indices:
    """Sobol indices of one output: first and total, each with the half width of its 95 % interval, by factor."""

    column: str
    factors: tuple[str, ...]
    first: np.ndarray
    first_interval: np.ndarray
    total: np.ndarray
    total_interval: np.ndarray


@dataclass(frozen=True)
class Tornado:
    """One output in the middle of all axes, and where each axis alone is low and high."""

    column: str
    factors: tuple[str, ...]
    middle: float
    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True)
class Distribution:
    """One output of a sampled design: mean, deviation and quantiles (5, 50, 95 %) of the rows that succeeded."""

    column: str
    count: int
    mean: float
    deviation: float
    quantiles: tuple[float, float, float]


def factors(axes: tuple[Axis, ...]) -> tuple[str, ...]:
    """A name for each uniform number of a row."""
    names: list[str] = []
    for axis in axes:
        if isinstance(axis, Joint):
            names += [f"{axis.name} {i + 1} ({name})" for i, (name, _) in enumerate(axis.columns)]
        else:
            names.append(axis.name)
    return tuple(names)


def sobol_indices(design: Design, column: str, values: np.ndarray) -> Indices | None:
    """The indices of one output over the whole design; None where rows failed or nothing varies."""
    if not np.all(np.isfinite(values)) or np.ptp(values) <= 1e-12 * np.max(np.abs(values)):
        return None
    analyze = load("SALib.analyze.sobol", "Sobol indices", "sweep")
    centred = (values - values.mean()) / values.std()  # the estimates are the same, with less rounding
    found = analyze.analyze(
        problem(design.dimensions), centred, calc_second_order=False, conf_level=0.95, seed=design.seed
    )
    first, first_interval, total, total_interval = (
        np.asarray(found[k], float) for k in ("S1", "S1_conf", "ST", "ST_conf")
    )
    return Indices(column, factors(design.axes), first, first_interval, total, total_interval)


def tornado(design: Design, column: str, values: np.ndarray) -> Tornado:
    """The bars of one output of a `one_at_a_time` design."""
    return Tornado(column, factors(design.axes), float(values[0]), values[1::2], values[2::2])


def spread(column: str, values: np.ndarray) -> Distribution | None:
    """Mean, deviation and quantiles of one output; None where fewer than two rows have it."""
    good = values[np.isfinite(values)]
    if good.size < 2:
        return None
    low, middle, high = np.quantile(good, [0.05, 0.5, 0.95])
    return Distribution(
        column, good.size, float(good.mean()), float(good.std(ddof=1)), (float(low), float(middle), float(high))
    )
