"""How Rodas5P chooses its steps, declared once: the pythonfmu slave holds these functions, and C is printed from them.

So they are written in what both languages have: numbers, comparisons, and each other. `to_c` translates them.
"""

from __future__ import annotations

import struct
from math import inf, sqrt

from .rodas5p import (
    CRUMB,
    GROWTH_ROOT,
    LARGEST_GROWTH,
    LEAST_ERROR,
    LEAST_GROWTH,
    RESOLVED,
    RESOLVING_ROOT,
    SAFETY,
    SHORTEST,
    TIME_ROUNDING,
)

DOUBLE, LONG = struct.Struct("<d"), struct.Struct("<q")
(BITS_OF_ONE,) = LONG.unpack(DOUBLE.pack(1.0))


def inverse_root(value: float, n: int) -> float:
    """value^(-1/n), up to 7 % too large, for positive values: the bits of a double are nearly its logarithm.

    Unlike pow() it is the same on every machine with IEEE doubles. method.h has its own, of the same bits.
    """
    (bits,) = LONG.unpack(DOUBLE.pack(value))
    part = abs(bits - BITS_OF_ONE) // n
    (root,) = DOUBLE.unpack(LONG.pack(BITS_OF_ONE - (part if bits > BITS_OF_ONE else -part)))
    return float(root)


# Translated into C from here on -------------------------------------------------------------------------------


def smaller(a: float, b: float) -> float:
    """Not fmin, which is a call into the library with some compilers."""
    return a if a < b else b


def larger(a: float, b: float) -> float:
    """Not fmax, for the same reason."""
    return a if a > b else b


def growth(error: float) -> float:
    """By how much a step may grow (or must shrink) for the square of its error over the tolerance.

    To remember the error before would gain nothing.
    """
    if not (error >= 0 and error < inf):
        return LEAST_GROWTH
    factor = SAFETY * inverse_root(larger(error, LEAST_ERROR), GROWTH_ROOT)
    return smaller(LARGEST_GROWTH, larger(LEAST_GROWTH, factor))


def resolving(second: float, third: float, limit: float) -> float:
    """A step that resolves the fastest motion, at most `limit`: after a jump the step size of before says nothing.

    Along the solution x'' = J x' + d(x')/dt, and x''' is near J x''; `second` and `third` are their mean squares over
    the tolerance. Their ratio is the speed of the fastest motion, and x'' over the square of that speed how far it
    goes; if that is beyond the tolerance, the step has to resolve it.
    """
    if not second > 0:
        return limit
    speed = third / second  # squares, here and below
    fourth_power = speed * speed  # of the speed itself
    if not fourth_power > 0:
        return limit
    reach = second / fourth_power
    if not (reach > 1 and reach < inf):
        return limit
    return smaller(limit, inverse_root(RESOLVED * reach, RESOLVING_ROOT) / sqrt(speed))


def at_corner(wanted: float, corner: float) -> float:
    """The step size to begin with at a corner of the inputs, where only rates jump: no larger than what the corner
    before it allowed, if there was one (`corner` > 0).

    Noise of a monitor bends inputs at every sample by about as much. What was wanted before says little of that, and
    half of all attempts were refused; where corners are faint, they allow more than is wanted.
    """
    return smaller(wanted, corner) if corner > 0 else wanted


def is_last(wanted: float, left: float, time: float) -> bool:
    """Whether a step as large as wanted reaches the end of what is left, or leaves no more than a crumb of it."""
    return wanted >= left - larger(CRUMB * left, TIME_ROUNDING * abs(time))


def is_too_short(h: float, time: float) -> bool:
    """Whether a step of size `h` does not move the time."""
    return not (h > SHORTEST * abs(time) and h > 1e-300)


def is_accepted(error: float) -> bool:
    """Whether a step with this error holds; where a state left the range of the equations, it is negative."""
    return error >= 0 and error <= 1


def wanted_next(error: float, h: float, wanted: float, last: bool, rejected: bool) -> float:
    """The step size to try next, after a step of size `h` where `wanted` was wanted.

    A step cut short by the end of its piece says little against what was wanted; one that follows a refusal does not
    grow.
    """
    proposed = h * growth(error)
    if not is_accepted(error):
        return proposed
    return smaller(proposed, h) if rejected else larger(proposed, wanted) if last else proposed
