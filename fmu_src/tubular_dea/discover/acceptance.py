"""When an effect is accepted, and when what is left is noise.

A first effect needs more gain than the largest score of nulls and than the numerics could feign, and must predict
blocks that were left out. A further one must besides remove most of what the ones before it left, and more than
another functional form of them would: no law of a catalogue is exactly the one in the tube, and a candidate may pick
up in part what that leaves.

The held-out experiments are asked at once where the evidence is weak. Where it is strong they are asked at the end:
one of two effects alone may predict them worse than none.
"""

from __future__ import annotations

import numpy as np

from ..identify.fit import NORMAL_95, Fit, interval
from ..identify.misfit import SLOW_CHANCE
from ..model.effect import Effect
from .options import Option
from .residuals import LackOfFit

# Set by convention: one in a thousand. Check: `python -m blind.score --nulls 60 --seed 1000`
FALSE_ALARMS = 0.001  # [1] share of records with nothing missing whose largest score passes

# Set by judgement: no law of a catalogue is quite the plant's, and a further effect may be no more than what
# the first one's law leaves. Check: `pytest tests/test_acceptance.py`, `python -m blind.score --pairs 20 --seed 1000`
SECOND_SHARE = 0.5  # [1] share of what is left that a further effect has to explain
SECOND_PART = 0.004  # [1] share of the first effect's gain that a further one has to bring
FORM_PART = 0.03  # [1] the same, where what is left is so little that another form of the first may be all there is
NOISE_PART = 0.1  # [1] the same, where what is left looks like noise
NOISE_GAIN = 70.0  # [squared standard deviations] that it has to gain there at least: three times what nulls do
CLEARED = 0.8  # [1] share of what is left: another form of the first would hardly look so much like one other effect
NEARLY_RATIO = 1.1  # [1] residual over noise up to which little is left
NEARLY_EXPLAINED = 0.95  # [1] share explained from which on little is left
ALMOST_RATIO = 1.2  # [1] residual over noise that is little where nearly all of a large effect is explained
ALMOST_EXPLAINED = 0.98  # [1] share explained from which on that is nearly all
FAINT_SLOW = 1.5  # [standard deviations] of the slow parts up to which these hide no further effect

# Set by judgement. Check: `pytest tests/test_acceptance.py`, `python -m measured.table`
FURTHER = 0.25  # [1] share of what is left that a further effect has to explain where models are that far

# Set by judgement. Check: `pytest tests/test_acceptance.py`, `python -m blind.score --singles 2 --seed 1000`
STRONG = 3.0  # [1] times the threshold from which on the held-out experiments are asked at the end only
VISIBLE = 10.0  # [1] squared distance of two models on the held-out experiments from which these can tell them apart
DENIED_PART = 0.05  # [1] share of an effect's gain that the held-out experiments may lose by it: no law is exact
PARTLY = 0.5  # [1] share of what is not noise: effects that explain less are not named where a remainder stays

# Set by theory: chances of a normal number (2 ln 20 = 6.0; 3.3 standard deviations, squared, are 10.8).
# Check: `pytest tests/test_acceptance.py`
DENIAL = 6.0  # [squared standard deviations] rise on held-out experiments: odds of 20 to 1 against an effect
EARNS = 10.8  # [squared standard deviations] that an effect gains, over what the misfit makes of noise: 1 in 1000

# Set by judgement. Check: `pytest tests/test_acceptance.py`, `python -m blind.score --nulls 60 --seed 1000`
CLEAN_TOTAL = 4.0  # [standard deviations] of all samples up to which an excess is noise


def far(option: Option) -> bool:
    """Whether what an option leaves is the model's own error, beside which noise hardly counts."""
    return option.lack_of_fit.ratio > option.lack_of_fit.far


def clean(state: LackOfFit) -> bool:
    """Nothing is left that stands out of the noise."""
    return state.z_slow < SLOW_CHANCE and state.z_total < CLEAN_TOTAL


def nearly(state: LackOfFit, before: LackOfFit, held_ratio: float = 1.0) -> bool:
    """What stands out of the noise is little, and little of what stood out `before`."""
    explained = 1 - max(state.excess, 0.0) / max(before.excess, 1.0)
    allowed = ALMOST_RATIO if explained >= ALMOST_EXPLAINED else NEARLY_RATIO
    return explained >= NEARLY_EXPLAINED and max(state.ratio, held_ratio) <= allowed


def finished(base: Option, chosen: Option) -> bool:
    """Whether nothing is left to look for: noise, and less of it than a further effect would have to bring.

    Or noise in its slow parts by all means: what is left of the undamped ringing at rest is fast, and no effect.
    """
    if not clean(chosen.lack_of_fit) or chosen.exact:
        return False
    return chosen.lack_of_fit.z_slow < FAINT_SLOW or chosen.lack_of_fit.excess < _least_gain(base, chosen, 0.0)


def accept(base: Option, before: Option, best: Option, threshold: float) -> tuple[bool, str]:
    """Whether `best` is accepted over `before`, and why (not), in words."""
    gain, name = before.fitted.cost - best.fitted.cost, best.ids[-1]
    if gain < threshold:
        return False, f"refitted, {name} gains {gain:.1f}, less than nulls do ({threshold:.1f})"
    if best.cross_validated >= before.cross_validated and not far(before):  # so far off, linear models predict nothing
        return False, f"{name} does not predict the blocks left out"
    if (gain < STRONG * threshold or far(best)) and not confirmed(before, best):
        return False, f"{name} does not predict the held-out experiments"
    refusal = no_further_effect(base, before, gain, name, best) if before.ids else ""
    if refusal:
        return False, refusal
    return (
        True,
        f"{name} gains {gain:.1f}, on blocks {before.cross_validated - best.cross_validated:.1f}, "
        f"held out {before.held_out - best.held_out:.1f}",
    )


def confirmed(before: Option, after: Option) -> bool:
    """Whether data that no fit has seen speak for `after`: the held-out experiments, or where they can hardly tell the
    two apart, experiments left out in turn."""
    if not np.all(np.isfinite(after.unseen)):
        return False
    apart = after.unseen - before.unseen
    if float(apart @ apart) >= VISIBLE:
        return after.held_out < before.held_out
    return after.across < before.across


def size_interval(effect: Effect, fitted: Fit, name: str) -> tuple[float, float]:
    """The 95 % interval of a parameter of an effect (SI).

    A size that cannot be negative has one in proportion: that it is there at all is told by what it gains.
    """
    low, high = interval(fitted, name)
    quantity = next(q for q in effect.parameters if q.name == name)
    off = effect.off.get(name)
    above = fitted.values[name] - off if off is not None and quantity.minimum == off else 0.0
    if off is None or above <= 0:
        return low, high
    factor = float(np.exp(NORMAL_95 * fitted.stderr[name] / above))
    return off + above / factor, off + above * factor


def bounded_away(effect: Effect, fitted: Fit) -> bool:
    """Whether the 95 % interval of a size of the effect leaves out the value at which it is off."""
    sizes = [n for n in effect.off if n in fitted.names]
    for name in sizes:
        low, high = size_interval(effect, fitted, name)
        if not low <= effect.off[name] <= high:
            return True
    lengths = [n for n in effect.fit if n in fitted.names and not sizes]  # a lag is off where it is short
    return any(NORMAL_95 * fitted.stderr[n] < abs(fitted.values[n]) for n in lengths)


def denied(before: Option, after: Option) -> bool:
    """Whether the held-out experiments speak against `after`, by odds that chance does not explain."""
    gain = before.fitted.cost - after.fitted.cost
    return after.held_out > before.held_out + max(DENIAL, DENIED_PART * gain)


def earned(base: Option, chosen: Option) -> bool:
    """Whether effects that leave a significant remainder have earned their names: on data that no fit has seen."""
    before = max(base.lack_of_fit.excess, 1.0)
    held = base.held_out - chosen.held_out
    return held > DENIAL and 1 - chosen.lack_of_fit.excess / before >= PARTLY


def settled(base: Option, accepted: list[Option]) -> Option:
    """The last of the options accepted in turn that the held-out experiments do not deny against those before it."""
    best = base
    for one in accepted:
        if not denied(best, one):
            best = one
    return best


def no_further_effect(base: Option, before: Option, gain: float, name: str, after: Option | None = None) -> str:
    """Why an effect that gains `gain` besides those of `before` is no further effect; empty if it may be one.

    Where `after` it the slow parts are noise, what is left besides is that the noise's level is not known better.
    """
    if far(before):
        held = 0.0 if after is None else after.held_out - (1 - FURTHER) * before.held_out
        little = gain < FURTHER * before.lack_of_fit.excess or held > 0
        return f"{name} explains less than {FURTHER:.0%} of what is left" if little else ""
    if gain < _least_gain(base, before, gain):
        return f"{name} gains {gain:.1f}: another form of {', '.join(before.ids)} may be all there is"
    settles = after is not None and after.lack_of_fit.z_slow < SLOW_CHANCE
    if gain < SECOND_SHARE * max(before.lack_of_fit.excess, 0.0) and not settles:
        return f"{name} removes less than half of what is left"
    return ""


def _least_gain(base: Option, before: Option, gain: float) -> float:
    """What one that gains `gain` besides `before` has to gain: more where another form of `before` might do it."""
    first = base.fitted.cost - before.fitted.cost
    if before.exact:
        return SECOND_PART * first
    if clean(before.lack_of_fit):
        return max(NOISE_PART * first, NOISE_GAIN)
    clears = gain > CLEARED * before.lack_of_fit.excess
    return first * (FORM_PART if nearly(before.lack_of_fit, base.lack_of_fit) and not clears else SECOND_PART)
