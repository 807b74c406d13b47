"""Which parameters are fitted, from which start, and in what scale."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from ...identify.fitting.fit import Fit
from ...identify.fitting.intervals import interval
from ...identify.fitting.problem import Free
from ...model.declare import Quantity
from ...model.effect import Effect
from ...plants.plant import Plant

# Set by measurement: a base of electric drives whose speed was counted without its sign ended at 1/250 of its rate; a
# tube behind a slewing amplifier with its first branch in the place of the solid's viscosity, and a third was named.
# Check: `pytest tests/test_known_benchmarks.py tests/test_settle.py`
LOST_FIT = 1.5  # [1] of the solver's numbers (a factor of 4.5) from the declared value: a fit may be lost

# Set by judgement. Check: `python -m blind.score --external 12 --seed 1000`
IMPLAUSIBLE = 3.0  # [1] factor from the declared value beyond which a refitted parameter is hardly the plant's


def base_parameters(plant: Plant) -> list[Free]:
    """The parameters that may be identified: all tunable ones of the base model, and starts shared by all."""
    return [
        _free(p.quantity, abs(p.quantity.value or 0.0) or abs(p.quantity.nominal) or 1.0)
        for p in plant.model.parameters
        if p.tunable or p.start == "shared"
    ]


def declared_values(plant: Plant, fitted: Fit) -> dict[str, float]:
    """The declared values of the fitted parameters that are the plant's own."""
    return {n: v for n, v in plant.model.parameter_values().items() if n in fitted.names}


def lost(plant: Plant, fitted: Fit) -> bool:
    """Whether a fit ended far from the declared values, where it may not be at its best."""
    declared = declared_values(plant, fitted)
    there = [(f, s) for f, s in zip(fitted.free, fitted.scaled, strict=True) if f.name in declared]
    return any(abs(scaled - free.to_scaled(declared[free.name])) > LOST_FIT for free, scaled in there)


def implausible(plant: Plant, fitted: Fit) -> list[str]:
    """The fitted parameters of the plant's own that are implausible all over their intervals.

    One that may be exchanged with another is not if it is plausible in its place: which is which may not be told.
    """
    return [*_times_declared(plant, {n: interval(fitted, n) for n in fitted.names})]


def implausible_values(plant: Plant, fitted: Fit) -> dict[str, float]:
    """By how many times their declared values such parameters are implausible, whatever their intervals say."""
    return _times_declared(plant, {n: (fitted.values[n], fitted.values[n]) for n in fitted.names})


def _times_declared(plant: Plant, found: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    """The parameters of which all that lies between two ends is implausible, and the first end over the declared
    value."""
    declared = plant.model.parameter_values()
    judged = [n for n in declared if n in found and declared[n] != 0]
    places = {n: [n, *(e.pairs[n] for e in plant.exchanges if n in e.pairs)] for n in judged}

    def far(name: str, place: str) -> bool:
        low, high = sorted(end / declared[place] for end in found[name])
        return low >= IMPLAUSIBLE or high <= 1 / IMPLAUSIBLE

    return {n: found[n][0] / declared[n] for n in judged if all(far(n, place) for place in places[n])}


def effect_parameters(effect: Effect, refined: bool = False) -> list[Free]:
    """The parameters of an effect that are identified, including those of its finer form if `refined`."""
    names = [*effect.fit, *(effect.refine if refined else ())]
    return [_free(q, size(effect, q.name), effect) for q in effect.parameters if q.name in names]


def size(effect: Effect, name: str) -> float:
    """The typical distance of a parameter from its off value."""
    typical, off = effect.typical[name], effect.off.get(name, 0.0)
    quantity = next(q for q in effect.parameters if q.name == name)
    return abs(typical - off) or abs(quantity.nominal) or 1.0


def strengths_at_bounds(effect: Effect, fitted: Fit) -> list[str]:
    """The parameters at a bound that say how strong an effect is; one that refines its form may end its range."""
    return [n for n in at_bounds(effect, fitted) if n in effect.off and n not in effect.refine]


def at_bounds(effect: Effect, fitted: Fit) -> dict[str, int]:
    """The parameters of an effect that ended at a bound: -1 at the least value, 1 at the largest.

    Neither nothing nor the whole is a bound: 0 where a parameter cannot be negative, a share of 0 or 1, where the
    effect is off, and the largest of what is `hard`.
    """
    quantities = {q.name: q for q in effect.parameters}
    return {
        name: side
        for name, side in fitted.at_bounds().items()
        if name in quantities and not _natural(effect, quantities[name], side)
    }


def _natural(effect: Effect, quantity: Quantity, side: int) -> bool:
    """Whether a bound is nothing or the whole of what a parameter says, and no opinion on how large it may be."""
    bound = quantity.minimum if side < 0 else quantity.maximum
    if side > 0 and quantity.name in effect.hard:
        return True
    return bound in (0, effect.off.get(quantity.name)) or (is_share(quantity) and bound == 1)


def is_share(quantity: Quantity) -> bool:
    """Whether a parameter is a share, of which 1 is all that there is."""
    return quantity.unit == "1" and quantity.minimum == 0 and quantity.maximum == 1


def unusual(effect: Effect, fitted: Fit) -> float:
    """The size of an effect relative to its usual one, or how many powers of ten beyond one its time constants are.

    What takes the place of a size (`trades`), such as the time constant of a whole lag, counts as one, and the more,
    the less usual the rest of its shape is: slow by its damping is slow, too. What is `hard` may be of any size.
    """
    shape = {
        n: fitted.values[n] / effect.typical[n]
        for n in effect.fit
        if n in fitted.names and n not in effect.off and effect.typical[n] != 0
    }
    if effect.trades:
        return float(np.prod([x ** effect.trades.get(n, np.sign(x - 1)) for n, x in shape.items()]))
    soft = {n: off for n, off in effect.off.items() if n in fitted.names and n not in effect.hard}
    sizes = [abs(fitted.values[n] - off) / size(effect, n) for n, off in soft.items()]
    return max([0.0, *sizes, *(10 ** (abs(np.log10(x)) - 1) if x > 0 else 1.0 for x in shape.values())])


def switched_on(effect: Effect) -> dict[str, float]:
    """Values of the parameters that are not fitted: fixed ones on, refinements off."""
    held = {q.name: float(q.value or 0.0) for q in effect.parameters if q.name in effect.refine}
    return held | {n: v for n, v in effect.off.items() if n in effect.refine} | dict(effect.on)


def switched_off(effect: Effect) -> dict[str, float]:
    """Values at which the effect is off, refinements included."""
    return switched_on(effect) | dict(effect.off)


def all_off(ids: Iterable[str], catalogue: Mapping[str, Effect]) -> dict[str, float]:
    """The same of several effects, as a model with many of them has it where none acts."""
    return {n: v for name in ids if name in catalogue for n, v in switched_off(catalogue[name]).items()}


def clipped(free: Free, value: float) -> float:
    """A value, clipped to the bounds of its parameter."""
    low = -float("inf") if free.lower is None else free.lower
    high = float("inf") if free.upper is None else free.upper
    return min(max(value, low), high)


def _free(quantity: Quantity, scale: float, effect: Effect | None = None) -> Free:
    """Logarithmic where it must stay positive and is not an amplitude (which may pass through zero)."""
    low, high = quantity.minimum, quantity.maximum
    amplitude = effect is not None and quantity.name in effect.off
    positive = low is not None and low > 0 and not amplitude
    usual = quantity.value if effect is None else effect.off.get(quantity.name, effect.typical[quantity.name])
    return Free(quantity.name, scale, low, high, positive, usual)
