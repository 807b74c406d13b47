"""The colour of noise in quiet stretches: white, an autoregression, both, or these as 1/f noise.

By restricted maximum likelihood (Patterson and Thompson, Biometrika 58 (1971) 545): the simplest colour whose further
numbers earn their place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.optimize import minimize, minimize_scalar

from .colour import Colour
from .quiet import Stretches

# Set by judgement. Check: `pytest tests/test_noise.py`
SLOWEST_COLOUR = 0.996  # [1] correlation between neighbouring samples up to which one is sought
WHITE = (0.1, 0.5)  # [1] white shares to begin with
MEMORY = 0.25  # [1] of the longest stretch, that noise can be seen to remember at most
LOW = 0.01  # [1/sample] frequency where the uncertainty of the colour counts, as slow effects are sought there

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions colour --seed 1000`
EARNED = 8.0  # [squared standard deviations] by which a further number of the colour must explain the record better
UNSEEN = 16.0  # [squared standard deviations] the same of a memory that the stretches are too short for
ONE_STRETCH = 0.1  # [1] share of all degrees of freedom up to which a stretch that alone tells of 1/f noise is none
SLOWER = (0.3, 1.0, 2.0)  # [1] atanh of correlations, beyond that of one colour alone, to begin with
SLOW_TAU = (0.05, 0.3, 1.5)  # [s] time constants of the filter that makes noise 1/f, to begin with, at the usual pace
SLOW_TIMES = (1.5, 4.0)  # [1] times that it raises what is slow, to begin with
SLOWEST_POLE = 0.9998  # [1] pole of it up to which one is sought
NO_WHITE = -6.0  # [1] logit of a white share that is none

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions colour --seed 1000`
FASTEST_COLOUR = -0.6  # [1] atanh of the correlation from which on that of one colour alone is sought,
COLOURS_TRIED = 8  # [1] and how many up to the slowest are tried
COLOUR_MISSED = 2e-3  # [1] of atanh of its correlation by which the best of them may be missed
SEARCH_WIDTHS = (0.3, 0.7, 0.5, 0.5)  # [1] first steps of a search for the numbers of a colour, in their order
TWO_MISSED = 0.01  # [1] by which two numbers may be missed,
TWO_COST = 0.1  # [log likelihood] by which their likelihood may,
TWO_TURNS = 80  # [1] turns of their search at most
FOUR_MISSED = 0.02  # [1] by which four numbers may be missed,
FOUR_COST = 0.2  # [log likelihood] by which their likelihood may,
FOUR_TURNS = 150  # [1] turns of their search at most
CURVED_OVER = 0.02  # [1] step of the difference quotients that tell how sharp the likelihood is

# Set by theory: near enough to 1, and so that no digits are lost. Check: `pytest tests/test_noise.py`
MOST_OPPOSED = -0.999  # [1] correlation between neighbouring samples at least,
MOST_ALIKE_BESIDE = 0.9995  # [1] and at most
MOST_WHITE = 12.0  # [1] logit of the largest share of white noise, and less that of the least
LEAST_RAISED = -12.0  # [1] log of how much more than once a filter raises what is slow: the least
MOST_RAISED = 6.0  # [1] and the largest
ROUNDED_OFF = 1e-15  # [1] of the largest eigenvalue: those below are rounding


@dataclass(frozen=True)
class ColourEstimate:
    """A colour at the base step, and the variance; `uncertainty` is the relative standard error of the slow noise that
    they make. The memory of noise that is `clocked` counts samples, whatever the step: that of a converter's filter.
    """

    at_step: Colour
    step: float
    variance: float
    freedom: int
    uncertainty: float
    clocked: bool = False

    def colour(self, step: float) -> Colour:
        """The colour at a sampling step [s]."""
        return self.at_step if self.clocked else self.at_step.at(step / self.step)


def as_told(quiet: Sequence[Stretches], found: ColourEstimate, pace: float = 1.0) -> ColourEstimate:
    """An estimate without a memory that is longer than stretches can show: the longest one that they can, if that
    explains them clearly better than none."""
    most = float(np.exp(-found.step / (MEMORY * max(s.step * len(s.values) for s in quiet))))
    return coloured(quiet, found.step, most, UNSEEN, pace, found.clocked) if found.at_step.phi > most else found


def clocked_or_not(quiet: Sequence[Stretches], step: float, pace: float) -> ColourEstimate:
    """As `coloured`, with a memory that counts samples in place of seconds where stretches of several sampling steps
    tell that it does: noise of 12 um that had one of a sample at 40 and at 125 Hz was 114 um, a random walk."""
    found = coloured(quiet, step, pace=pace)
    if not found.at_step.correlation or len({s.step for s in quiet}) < 2:
        return found
    other = coloured(quiet, step, pace=pace, clocked=True)
    better = unlikely(quiet, found.colour, found.variance) - unlikely(quiet, other.colour, other.variance)
    return other if 2 * better > EARNED else found


def coloured(
    quiet: Sequence[Stretches],
    step: float,
    most: float = MOST_ALIKE_BESIDE,
    earned: float = EARNED,
    pace: float = 1.0,
    clocked: bool = False,
) -> ColourEstimate:
    """White, an autoregression, both, or these as 1/f noise: the simplest whose further numbers earn their place.

    Neighbours of the autoregression are correlated by `most` at most; `earned` is what a number has to explain. The
    plant takes `pace` times as long as usual. The memory of noise that is `clocked` counts samples.
    """

    def numbered(x: np.ndarray) -> Colour:
        return _numbered(x, most)

    def colour_at(x: np.ndarray) -> Callable[[float], Colour]:
        colour = numbered(x)
        return lambda s: colour if clocked else colour.at(s / step)

    def objective(x: np.ndarray, told: Sequence[Stretches] = quiet) -> float:
        return _restricted(told, colour_at(x))[0]

    far = float(np.arctanh(min(SLOWEST_COLOUR, most)))
    tried = {v: objective(np.array([v])) for v in (*np.linspace(FASTEST_COLOUR, far, COLOURS_TRIED).tolist(), 0.0)}
    near = min(tried, key=lambda v: tried[v])
    bounds = (max((v for v in tried if v < near), default=near), min((v for v in tried if v > near), default=near))
    one = minimize_scalar(
        lambda v: objective(np.array([v])), bounds=bounds, method="bounded", options={"xatol": COLOUR_MISSED}
    )
    chosen, cost = np.array([0.0]), tried[0.0]
    if 2 * (cost - one.fun) > earned:
        chosen, cost = np.array([float(one.x)]), float(one.fun)
    starts = [
        np.array([min(max(float(one.x), 0.0) + more, far), np.log(share / (1 - share))])
        for share in WHITE
        for more in SLOWER
    ]
    begin = min(starts, key=objective)
    if objective(begin) < cost:
        simplex = begin + np.vstack([np.zeros(2), np.diag(SEARCH_WIDTHS[:2])])
        two = minimize(
            objective,
            begin,
            method="Nelder-Mead",
            options={"xatol": TWO_MISSED, "fatol": TWO_COST, "maxiter": TWO_TURNS, "initial_simplex": simplex},
        )
        if 2 * (cost - two.fun) > earned and numbered(two.x).phi > 0:
            chosen, cost = two.x, float(two.fun)
    plain, chosen = chosen, _falling(objective, chosen, cost, step / pace, 2 * earned)
    if chosen is not plain:
        rest = _without_loudest(quiet, colour_at(plain))
        alone = freedom(rest) > (1 - ONE_STRETCH) * freedom(quiet)
        if alone and 2 * (objective(plain, rest) - objective(chosen, rest)) < 2 * earned:
            # something moved in the one stretch that told of 1/f noise
            return coloured(rest, step, most, earned, pace, clocked)
    colour, told = numbered(chosen), freedom(quiet)
    _, variance = _restricted(quiet, colour_at(chosen))
    return ColourEstimate(colour, step, variance, told, _standard_error(objective, numbered, chosen, told), clocked)


def _without_loudest(quiet: Sequence[Stretches], colour_at: Callable[[float], Colour]) -> list[Stretches]:
    """The stretches but the one that stands out most from noise of a colour, and those too short to tell anything."""
    quiet = [g for g in quiet if g.freedom > 0]
    _, variance = _restricted(quiet, colour_at)
    squares = [np.sum(g.rest(colour_at(g.step)) ** 2, axis=0) / variance for g in quiet]
    each = [g.freedom / s.size for g, s in zip(quiet, squares, strict=True)]
    out = [(s - f) / np.sqrt(2 * f) for s, f in zip(squares, each, strict=True)]
    loudest = max(o.max() for o in out)
    kept = [g.only(o < loudest) for g, o in zip(quiet, out, strict=True)]
    return [g for g in kept if g.record.size]


def _falling(
    objective: Callable[[np.ndarray], float], chosen: np.ndarray, cost: float, step: float, earned: float
) -> np.ndarray:
    """The numbers with those of a filter that makes it 1/f noise, if they earn their place, of samples `step` apart (at
    the usual pace)."""
    plain = np.array([*chosen, NO_WHITE]) if chosen.size < 2 else chosen
    begins = [
        np.array([*plain, np.arctanh(np.exp(-step / tau)), np.log(np.expm1(np.log(times)))])
        for tau in SLOW_TAU
        for times in SLOW_TIMES
    ]
    begin = min(begins, key=objective)
    if objective(begin) > cost:
        return chosen
    found = minimize(
        objective,
        begin,
        method="Nelder-Mead",
        options={
            "xatol": FOUR_MISSED,
            "fatol": FOUR_COST,
            "maxiter": FOUR_TURNS,
            "initial_simplex": begin + np.vstack([np.zeros(4), np.diag(SEARCH_WIDTHS)]),
        },
    )
    return found.x if 2 * (cost - found.fun) > earned else chosen


def _numbered(x: np.ndarray, most: float) -> Colour:
    """The colour at the base step of the numbers that are searched; neighbours are correlated by `most` at most."""
    phi = float(np.clip(np.tanh(x[0]), MOST_OPPOSED, most))
    white = float(1 / (1 + np.exp(-np.clip(x[1], -MOST_WHITE, MOST_WHITE)))) if x.size > 1 else 0.0
    if x.size < 4:
        return Colour(phi, white)
    pole = float(np.clip(np.tanh(x[2]), 0.0, SLOWEST_POLE))
    raised = np.clip(x[3], LEAST_RAISED, MOST_RAISED)
    more = np.exp(np.log1p(np.exp(raised)))  # times that the filter raises what is slow
    return Colour(phi, white, pole, float(max(1 - more * (1 - pole), 0.0)))


def _restricted(quiet: Sequence[Stretches], colour_at: Callable[[float], Colour]) -> tuple[float, float]:
    """Minus the restricted log likelihood (but for constants), and the variance."""
    squares, freedom, terms = 0.0, 0, 0.0
    for group in quiet:
        colour = colour_at(group.step)
        n, m = group.values.shape
        left, lengths = group.restricted(colour)
        squares += left
        freedom += group.freedom
        terms += m * (2 * lengths + (n - 1) * np.log(colour.innovation))
    variance = max(squares / max(freedom, 1), 1e-300)
    return 0.5 * (freedom * np.log(variance) + terms), variance


def unlikely(quiet: Sequence[Stretches], colour_at: Callable[[float], Colour], variance: float) -> float:
    """Minus the restricted log likelihood (but for constants) of noise of a colour and a variance."""
    least, best = _restricted(quiet, colour_at)
    count = freedom(quiet)
    return least + 0.5 * count * (float(np.log(variance / best)) + best / variance - 1)


def _standard_error(
    objective: Callable[[np.ndarray], float], numbered: Callable[[np.ndarray], Colour], at: np.ndarray, freedom: int
) -> float:
    """Relative standard error of the density at LOW cycles a sample, from how sharp the likelihood is."""
    if not at[0]:
        return float(np.sqrt(2 / freedom))
    k, width = at.size, CURVED_OVER
    steps = np.eye(k) * width
    curvature = np.array(
        [
            [
                (objective(at + a + b) - objective(at + a - b) - objective(at - a + b) + objective(at - a - b))
                / 4
                / width**2
                for b in steps
            ]
            for a in steps
        ]
    )

    def log_density(x: np.ndarray) -> float:
        colour = numbered(x)
        return float(np.log(colour.density(LOW) / colour.innovation))

    slope = np.array([(log_density(at + s) - log_density(at - s)) / (2 * width) for s in steps])
    spread = scipy.linalg.pinvh(curvature, rtol=ROUNDED_OFF)
    return float(np.sqrt(2 / freedom + max(slope @ spread @ slope, 0.0)))


def freedom(quiet: Sequence[Stretches]) -> int:
    """The degrees of freedom of stretches together."""
    return sum(s.freedom for s in quiet)
