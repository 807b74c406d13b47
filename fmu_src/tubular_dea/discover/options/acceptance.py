"""When an effect is accepted, and when the residual is noise.

A first effect must gain more than the largest score of nulls and more than numerical errors can, and must improve the
prediction of blocks left out, unless it gains much and predicts the held-out experiments: what shows in one block
alone, the others do not predict. What it predicts of the held-out experiments counts too. A further one must also
remove most of the residual that the earlier ones leave, and more than another functional form of those would: no law of
the catalogue is exactly that of the plant, and a candidate may explain part of the difference.

An effect whose strength ends at a bound is refused: the records ask for more of it than there can be, so it stands in
for something else. Where another of its parameters does, its interval is open there.

Where the evidence is weak, the held-out experiments are checked at once. Where it is strong they are checked at the
end: one of two effects alone may predict them worse than none.
"""

from __future__ import annotations

import numpy as np

from ...identify.fitting.fit import NORMAL_95, Fit
from ...identify.fitting.intervals import interval
from ...identify.fitting.misfit import CLEAN_TOTAL, SLOW_CHANCE, coloured_noise
from ...model.effect import Effect
from ..scores.parameters import at_bounds
from .options import Option
from .residuals import LackOfFit

# Set by convention: one in a thousand. Check: `python -m blind.score --nulls 60 --seed 1000`
FALSE_ALARMS = 0.001  # [1] share of records with nothing missing whose largest score passes

# Set by judgement: no law of a catalogue is quite the plant's, and a further effect may be no more than what
# the first one's law leaves. Check: `pytest tests/test_acceptance.py`, `python -m blind.score --pairs 20 --seed 1000`
SECOND_SHARE = 0.5  # [1] share of what is left that a further effect has to explain
SECOND_PART = 0.004  # [1] share of the first effect's gain that a further one has to bring
FORM_PART = 0.03  # [1] the same, where what is left is so little that another form of the first may be all there is
CLEARED_PART = 0.02  # [1] the same of one that removes nearly all of it, or where it looks like noise: the laws of a
# motor's friction (Stribeck) left as much as a dead zone that was not there, 1.1 %
NOISE_GAIN = 70.0  # [squared standard deviations] that it has to gain where what is left is noise: twice nulls' most
CLEARED = 0.8  # [1] share of what is left: another form of the first would hardly look so much like one other effect
NEARLY_RATIO = 1.1  # [1] residual over noise up to which little is left
NEARLY_EXPLAINED = 0.95  # [1] share explained from which on little is left
ALMOST_RATIO = 1.2  # [1] residual over noise that is little where nearly all of a large effect is explained
PREDICTED = 1.5  # [1] error on held-out experiments over noise up to which a model with effects predicts them
ALMOST_EXPLAINED = 0.98  # [1] share explained from which on that is nearly all

# Set by measurement: thermal softening and trapped charge in place of a supply that falls slowly left 2.3 and 1.8 times
# the squares of noise where samples at edges weigh as others do; right answers on 60 sets of others leave 1.2 at most.
# Check: `pytest tests/test_acceptance.py -k weigh`
UNWEIGHTED = 1.6  # [1] squares that a model leaves over those of all noise, up to which weights may hide something

# Set by judgement. Check: `pytest tests/test_acceptance.py`, `python -m measured.table`
FURTHER = 0.25  # [1] share of what is left that an effect has to explain where models are that far

# Set by judgement. Check: `pytest tests/test_acceptance.py`, `python -m blind.score --singles 2 --seed 1000`
STRONG = 3.0  # [1] times the threshold from which on the held-out experiments are asked at the end only
LITTLE = 100.0  # [squared standard deviations] that an effect gains which has to be supported by both
INVISIBLE = 1.0  # [1] the same up to which they tell nothing, since chance alone decides
VISIBLE = 10.0  # [1] squared distance of two models on the held-out experiments from which these can tell them apart
# What held-out experiments gain is (2 s - 1) times that distance where the effect has s times the fitted size there. Of
# ten effects that were there s was 0.9 and more; of a sensor that drifted otherwise in another file 0.51.
AS_LARGE = 0.6  # [1] times its fitted size that an effect has there at least, if chance is no other explanation
SMALLER_BY = 3.0  # [standard deviations] by which its size there is less than fitted, to be so
DENIED_PART = 0.05  # [1] share of an effect's gain that the held-out experiments may lose by it: no law is exact
PARTLY = 0.5  # [1] share of what is not noise: effects that explain less are not named where a remainder stays,
PREDICTS = 0.5  # [1] unless they explain this share of what held-out experiments have beyond noise

# Set by judgement: the measured temperature of a photovoltaic module kept 11.4 with a law that its records contradict.
# Check: `pytest tests/test_acceptance.py -k slow_noise`, `python -m blind.score --nulls 12 --singles 2 --seed 1000`
SLOW_BESIDE_EFFECTS = 4.0  # [1] times the variance of white noise that slow noise may have beside effects

# Set by convention: a range of twenty decades and more is none. Check: `pytest tests/test_acceptance.py -k interval`
UNKNOWN_SIZE = 50.0  # [1] logarithm of an interval's end over its middle, at most

# Set by measurement: of 119 answers with an effect, three had a weak one beside a residual that was so far from white,
# and were wrong (11, 32 and 22 standard deviations; 11, 34 and 20 without the effect).
# Check: `pytest tests/test_acceptance.py -k white`
NOT_WHITE = 5.0  # [standard deviations] of whiteness from which on a residual is no white noise for certain
AS_LITTLE_WHITE = 0.8  # [1] share of the base's whiteness from which on an effect has made it no whiter

# Set by theory: chances of a normal number (2 ln 20 = 6.0; 3.3 standard deviations, squared, are 10.8).
# Check: `pytest tests/test_acceptance.py`
DENIAL = 6.0  # [squared standard deviations] rise on held-out experiments: odds of 20 to 1 against an effect
EARNS = 10.8  # [squared standard deviations] that an effect gains, over what the misfit makes of noise: 1 in 1000


def far(option: Option) -> bool:
    """Whether the residual of an option is dominated by the error of the model's form, not by noise."""
    return option.lack_of_fit.ratio > option.lack_of_fit.far


def clean(state: LackOfFit) -> bool:
    """Whether the residual is consistent with noise."""
    return state.z_slow < SLOW_CHANCE and state.z_total < CLEAN_TOTAL


def noise_alone(option: Option) -> bool:
    """Whether the residual may be noise alone: where no stretch shows slow noise, noise with a colour too, but beside
    effects less of it, as another law or another effect would leave the same."""
    state = option.lack_of_fit
    if option.ids and state.coloured > SLOW_BESIDE_EFFECTS:
        return clean(state)
    return clean(state) or coloured_noise(state.coloured, state.z_total)


def nearly(state: LackOfFit, before: LackOfFit, held_ratio: float = 1.0) -> bool:
    """Whether the excess over noise is small, also relative to that of `before`."""
    explained = 1 - max(state.excess, 0.0) / max(before.excess, 1.0)
    allowed = ALMOST_RATIO if explained >= ALMOST_EXPLAINED else NEARLY_RATIO
    return explained >= NEARLY_EXPLAINED and max(state.ratio, held_ratio) <= allowed


def accept(base: Option, before: Option, best: Option, threshold: float) -> tuple[bool, str]:
    """Whether `best` is accepted over `before`, and why (not), in words."""
    gain, name = before.cost - best.cost, best.ids[-1]
    chance = threshold * (1.0 if far(best) else best.lack_of_fit.by_chance)  # slow noise gives slow effects more
    if gain < chance and _with_held_out(before, best) < threshold + DENIAL:
        return False, f"refitted, {name} gains {gain:.1f}, less than chance can ({chance:.1f})"
    if name in best.impossible:
        return False, f"{name} would {'need' if name in best.pinned else 'have'} {best.wrong_with(name)}"
    strong = gain >= STRONG * threshold
    predicts = strong and before.held_out - best.held_out > DENIAL
    blocks_tell = not predicts and not far(before)  # so far off, linear models predict nothing
    if blocks_tell and best.cross_validated >= before.cross_validated:
        return False, f"{name} does not improve the prediction of blocks left out"
    if (not strong or far(best)) and not confirmed(before, best):
        return False, f"{name} does not improve the prediction of the held-out experiments"
    refusal = no_further_effect(base, before, gain, name, best) if before.ids else ""
    if refusal:
        return False, refusal
    return (
        True,
        f"{name} gains {gain:.1f}, on blocks {before.cross_validated - best.cross_validated:.1f}, "
        f"held out {before.held_out - best.held_out:.1f}",
    )


def _with_held_out(before: Option, after: Option) -> float:
    """What an effect gains with what it predicts of the held-out experiments, which counts as much at most.

    Where there may be slow noise, it predicts that too, and nothing is gained.
    """
    if far(after) or after.lack_of_fit.by_chance > 1:
        return 0.0
    gain = before.cost - after.cost
    return gain + float(np.clip(before.held_out - after.held_out, 0.0, gain))


def confirmed(before: Option, after: Option) -> bool:
    """Whether data that no fit used support `after`: the held-out experiments or, where these hardly distinguish the
    two, experiments left out in turn and no contradiction. An effect that gains little has to be supported by both."""
    if not np.all(np.isfinite(after.unseen)):
        return False
    difference = after.unseen - before.unseen
    apart, held = float(difference @ difference), before.held_out - after.held_out
    if apart >= VISIBLE:
        return held > max(0.0, min((2 * AS_LARGE - 1) * apart, apart - 2 * SMALLER_BY * float(np.sqrt(apart))))
    little = before.cost - after.cost < LITTLE
    if held < -DENIAL or (little and apart >= INVISIBLE and held <= 0):
        return False
    return held > DENIAL or after.across < before.across


def size_interval(effect: Effect, fitted: Fit, name: str) -> tuple[float, float]:
    """The 95 % interval of a parameter of an effect (SI), open where it ended at a bound.

    For a size that cannot be negative the interval is logarithmic: whether it is zero is decided by its gain.
    """
    low, high = _inside_interval(effect, fitted, name)
    side = at_bounds(effect, fitted).get(name, 0)
    return (-np.inf if side < 0 else low), (np.inf if side > 0 else high)


def _inside_interval(effect: Effect, fitted: Fit, name: str) -> tuple[float, float]:
    low, high = interval(fitted, name)
    quantity = next(q for q in effect.parameters if q.name == name)
    off = effect.off.get(name)
    if off is None:  # no size: how the effect acts, within its range
        least, most = quantity.minimum, quantity.maximum
        return low if least is None else max(low, least), high if most is None else min(high, most)
    above = fitted.values[name] - off if quantity.minimum == off else 0.0
    if above <= 0:
        return low, high
    factor = float(np.exp(min(NORMAL_95 * fitted.stderr[name] / above, UNKNOWN_SIZE)))
    most = np.inf if quantity.maximum is None else quantity.maximum  # a part is no more than the whole
    return off + above / factor, min(off + above * factor, most)


def bounded_away(effect: Effect, fitted: Fit) -> bool:
    """Whether the 95 % interval of a size of the effect excludes the value at which it is off."""
    sizes = [n for n in effect.off if n in fitted.names]
    for name in sizes:
        low, high = size_interval(effect, fitted, name)
        if not low <= effect.off[name] <= high:
            return True
    lengths = [n for n in effect.fit if n in fitted.names and not sizes]  # a lag is off where it is short
    return any(NORMAL_95 * fitted.stderr[n] < abs(fitted.values[n]) for n in lengths)


def denied(before: Option, after: Option) -> bool:
    """Whether the held-out experiments contradict `after` by more than chance explains."""
    gain = before.cost - after.cost
    return after.held_out > before.held_out + max(DENIAL, DENIED_PART * gain)


def earned(base: Option, chosen: Option) -> bool:
    """Whether effects that leave a significant remainder may be named: they explain most of what they were fitted to,
    and a part of what the held-out experiments have beyond noise; or most of that, as other disturbances of the fitted
    ones may be larger."""
    explained = 1 - chosen.lack_of_fit.excess / max(base.lack_of_fit.excess, 1.0)
    held = base.held_out - chosen.held_out
    missed = max(base.unseen_squares - base.unseen.size, 1.0)
    needed = FURTHER if explained >= PARTLY else PREDICTS
    return held > max(DENIAL, needed * missed)


def last_undenied(base: Option, accepted: list[Option]) -> Option:
    """The last of the options accepted in turn that the held-out experiments do not contradict."""
    best = base
    for one in accepted:
        if not denied(best, one):
            best = one
    return best


def no_further_effect(base: Option, before: Option, gain: float, name: str, after: Option | None = None) -> str:
    """Why an effect that gains `gain` in addition to those of `before` is no further effect; "" if it may be one.

    Where the slow part of the residual of `after` is noise, the rest is the uncertainty of the noise's level.
    """
    form = f"{name} gains {gain:.1f}, which another form of {', '.join(before.ids)} could explain"
    if far(before):
        return form if gain < _another_form(base, before) else _little(before, gain, name, after)
    if gain < _least_gain(base, before, gain):
        return form
    settles = after is not None and after.lack_of_fit.z_slow < SLOW_CHANCE
    if gain < SECOND_SHARE * max(before.lack_of_fit.excess, 0.0) and not settles:
        return f"{name} removes less than half of the remaining residual"
    return ""


def _another_form(base: Option, before: Option) -> float:
    """The gain that another form of the effects of `before` may reach: a share of theirs, and hardly all that is left,
    whatever they gain."""
    return min(SECOND_PART * (base.cost - before.cost), CLEARED * before.lack_of_fit.excess)


def _little(before: Option, gain: float, name: str, after: Option | None) -> str:
    """Why an effect explains too little of what a model leaves that is far from the plant; "" if it does not."""
    if gain < FURTHER * before.lack_of_fit.excess:
        return f"{name} explains less than {FURTHER:.0%} of the remaining residual"
    if after is not None and after.unseen_squares > (1 - FURTHER) * before.unseen_squares:
        return f"{name} explains less than {FURTHER:.0%} of what the held-out experiments leave"
    return ""


def _least_gain(base: Option, before: Option, gain: float) -> float:
    """The gain that a further effect needs: more where another form of the effects of `before` could reach `gain`."""
    first = base.cost - before.cost
    if before.exact:
        return SECOND_PART * first
    if clean(before.lack_of_fit):
        return max(CLEARED_PART * first, NOISE_GAIN)
    if not nearly(before.lack_of_fit, base.lack_of_fit):
        return _another_form(base, before)
    clears = gain > CLEARED * before.lack_of_fit.excess
    return first * (CLEARED_PART if clears else FORM_PART)
