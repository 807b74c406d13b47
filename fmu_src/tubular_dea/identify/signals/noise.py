"""The sensor's noise, from the record alone: the residual of smooth curves in stretches without events.

The misfit of a model has no part in it, so an effect that the model lacks cannot hide in the noise. Between events a
plant creeps, so exponentials of all time constants and polynomials are taken out; what slow drift a sensor has goes
with them. The rest is noise of some colour (`colour`), by restricted maximum likelihood (Patterson and Thompson,
Biometrika 58 (1971) 545) over stretches long enough to show a correlation that lasts a quarter of them. Lines at mains
frequency and its harmonics are separated (`hum`). Where events follow so fast that no stretch is quiet, the parts
between them are used, and the uncertainty is larger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import erfc, rel_entr

from ...errors import UserError
from ..threads import one_blas_thread
from . import hum as hums
from .bridges import MOST_BRIDGED, bridged
from .colour import Colour
from .colour_estimate import as_told, clocked_or_not, coloured, freedom, unlikely
from .monitors import resolution
from .quiet import (
    APART,
    BARELY_CALM,
    CALMEST,
    LOUDER,
    NOT_CALM,
    Clock,
    Records,
    Stretches,
    calm,
    first_event,
    louder,
    stretches,
    whole_rests,
)
from .sampling import usual_step

# Set by judgement. Check: `pytest tests/test_noise.py`,
# `python -m blind.score --nulls 12 --conventions colour drift --seed 1000`
MOST_LINES = 12  # [1] lines that are looked for

# Set by theory: of noise of the longer memory, less than one rest in 100 000 says so (a likelihood ratio). Check:
# `pytest tests/test_noise.py -k memory_that_is_not_there_at_rest`
ANOTHER = 25.0  # [squared standard deviations] by which what is before the first events tells of another noise

# Set by theory: at a third both formulas agree within 2 %. Check: `pytest tests/test_noise.py -k readings_that_change`
SINGLE_STEPS = 1 / 3  # [steps squared] up to which readings change by one step at most
BY_ROUNDING = 1 / 6  # [steps squared] that rounding adds to the square of a change

# Set by theory: hardly any reading repeats then. Check: `pytest tests/test_noise.py -k encoder`
MOST_CHANGES = 0.99  # [1] share of samples at which readings in steps change, at most

# Set by measurement: a motor's 0.24 s between time constants that are four apart left 18 to 75 times the slow noise of
# its sensor, and none with these; slow noise itself stays. Check: `pytest tests/test_noise.py -k settles_at`
CLOSER = 2.0  # [1] ratio of the time constants of creep where noise seems slow
SEEMS_SLOW = 3.0  # [1] times the noise that white noise would be as slow as, for that
CREPT = 0.5  # [1] share of what is slow that is left, where it was creep

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions colour drift --seed 1000`
ENOUGH_FREEDOM = 1000  # [1] degrees of freedom in quiet stretches, from which on they tell the noise by themselves

# Set by measurement: with 8 samples a line, stretches of 31 samples without four lines looked calmer than all others.
# Check: `pytest tests/test_noise.py -k harmonics`
ROOM_A_LINE = 32  # [samples] that a stretch has for each line of hum that is taken out of it

# Set by judgement: noise that is white and has a colour may be 1/f noise. Check: `pytest tests/test_noise.py -k slow`
SLOW_STRETCH = 3.0  # [s] that stretches have to last to tell that noise is not, at the usual pace,
SLOW_SAMPLES = 300  # [samples] and at least, where a plant that is sampled seldom has a short time for that
SOME_FREEDOM = 300  # [1] degrees of freedom that they have together

# Set by judgement: no noise is quite of this form. Check: `python -m blind.score --nulls 60 --seed 1000`
FORM = 0.012  # [1] relative error of the variance that remains however long the record
UNQUIET = 0.2  # [1] the same where no stretch is quiet

# Set by judgement. Check: `pytest tests/test_acceptance.py -k quiet`, `python -m measured.table`
CALM_SHARE = 0.75  # [1] of the stretches that are calm where a plant comes to rest: with fewer it rings
BRIEF = 5.0  # [samples] of memory that noise may have where a plant rings or is never at rest: more may be its signal,
# unless that is slower still: its bandwidth's time constant is allowed where it is longer

# Set by theory: no digits are lost. Check: `pytest tests/test_noise.py`
LEAST_COLOUR = 1e-12  # [1] share of the variance that has a colour, at least

# Set by measurement: stretches between corners of a smooth input were read as 22 mm of noise beside a laser of 30 um;
# slow noise of the bench is a four hundredth. Check: `pytest tests/test_noise.py -k as_large`
MOST_SLOW = 0.03  # [1] of the largest variance of a record: slow noise with more is what the plant does

# Set by theory: noise of a third of a step and more makes rounding white, and a record at rest shows all of it.
# Check: `pytest tests/test_noise.py -k rounding`, `python -m blind.score --nulls 12 --conventions bits --seed 1000`
COARSE_OUTPUT = 0.8  # [1] of what is new in a sample: rounding up to that shows at rest


@dataclass(frozen=True)
class Tempo:
    """How fast a plant is: `faster` is the time constant of its bandwidth [s], 0 where none is known, and `pace` how
    many times as long as usual it takes for all that it does (`quiet.pace_of`)."""

    faster: float = 0.0
    pace: float = 1.0


@dataclass(frozen=True)
class Noise:
    """Noise of standard deviation `rms` (the output's unit), with `correlation` between neighbours `step` [s] apart.

    A share `white` of its variance is white; the rest has one time constant, so that other steps have other
    correlations (not where it is `clocked`, and counts samples, nor with `step` 0). `slower`, the pole and the zero of
    a filter behind it, makes it 1/f noise. `freedom` is the number of degrees of freedom that `rms` was estimated with
    (infinite: it was stated), `form` the relative error of the variance, where effects are sought, that the colour
    leaves. `hum` are the frequencies [Hz] of lines of the mains beside the noise, `lines` those of other lines, which
    are no noise either.
    `by_residual` is whether no stretch is quiet, but what a model leaves tells the noise: while its answer stands
    still, or by what repetitions of its course do not share (`repeats`).
    `faster` is the time constant of the plant's bandwidth [s]: a memory as short is no signal's; 0 where none is known.
    `pace` is how many times as long as usual the plant takes for all that it does (`quiet.pace_of`).
    `quiet` is False where no stretch was quiet enough to tell it from the signal, `slow_known` where none was long
    enough to tell how much of it is slower than what they show; 1/f noise goes on beyond any stretch. `driven` is white
    noise on top (the same unit) that no record at rest shows: fast noise of the monitors that drive the model. `grain`
    is the step (the same unit) that readings are rounded to where that is coarse beside the noise, else 0.
    """

    rms: float
    correlation: float
    freedom: float = np.inf
    hum: tuple[float, ...] = ()
    lines: tuple[float, ...] = ()
    step: float = 0.0
    white: float = 0.0
    form: float = FORM
    quiet: bool = True
    driven: float = 0.0
    slower: tuple[float, float] = (0.0, 0.0)
    slow_known: bool = True
    grain: float = 0.0
    by_residual: bool = False
    faster: float = 0.0
    pace: float = 1.0
    clocked: bool = False

    @property
    def stated(self) -> bool:
        """Whether the level is known, and not from these records."""
        return not np.isfinite(self.freedom)

    @property
    def plant(self) -> Tempo:
        """How fast the plant is."""
        return Tempo(self.faster, self.pace)

    def of(self, plant: Tempo) -> Noise:
        """The same beside a plant of some tempo."""
        return replace(self, faster=plant.faster, pace=plant.pace)

    @property
    def brief(self) -> float:
        """The memory [samples] of noise up to which it cannot be the plant's signal."""
        return _brief(self.faster, self.step)

    @property
    def uncertainty(self) -> float:
        """Relative standard error of the variance: by chance, and as no noise is quite of this form."""
        return max(self.form, float(np.sqrt(2 / self.freedom)))

    @property
    def innovation(self) -> float:
        """Standard deviation of what is new in each sample."""
        return self.total * float(np.sqrt(self.colour(self.step).innovation))

    @property
    def own_innovation(self) -> float:
        """The same without what is driven: that of the sensor alone."""
        return replace(self, driven=0.0).innovation

    @property
    def total(self) -> float:
        """Standard deviation with what is driven."""
        return float(np.hypot(self.rms, self.driven))

    @property
    def slow(self) -> float:
        """Standard deviation per sample of what averages over many samples come from."""
        return self.slow_at(self.step)

    def slow_at(self, step: float) -> float:
        """The same for samples `step` [s] apart."""
        return self.total * float(np.sqrt(self.colour(step).density()))

    @property
    def neighbours(self) -> float:
        """The correlation between neighbouring samples of the sensor alone."""
        return replace(self, driven=0.0).colour(self.step).neighbours

    @property
    def phi(self) -> float:
        """The correlation between neighbouring samples of the coloured part."""
        return self.correlation / max(1 - self.white, LEAST_COLOUR)

    @property
    def tau(self) -> float:
        """Time constant of the coloured part [s]; 0 where there is none."""
        return float(-self.step / np.log(self.phi)) if 0 < self.phi < 1 else 0.0

    def colour(self, step: float) -> Colour:
        """The colour of samples `step` [s] apart."""
        steps = step / self.step if self.step > 0 and step > 0 and not self.clocked else 1.0
        pole, zero = self.slower
        own = Colour(self.phi, self.white, pole, zero).at(steps)
        if not self.driven:
            return own
        before = self.rms**2 / Colour(self.phi, self.white, pole, zero).raised  # the filter raises no driven noise
        slow, driven = before * Colour(self.phi, self.white).density(), self.driven**2
        more = float(np.sqrt((slow * ((1 - zero) / (1 - pole)) ** 2 + driven) / (slow + driven)))
        white = (self.white * before + driven) / (before + driven)
        return Colour(own.phi, white, own.pole, (1 - more * (1 - pole)) ** steps)

    def whiten(self, clock: Clock, values: np.ndarray) -> np.ndarray:
        """Values (n,) or columns (n, k) read at a clock's times, in units of the innovation; a gap starts anew."""
        colours = {step: self.colour(step) for step in clock.steps}
        pairs = zip(clock.steps, clock.parts, strict=True)
        white = np.concatenate([colours[step].whiten(values[part]) for step, part in pairs])
        white /= self.total
        return white

    def sample(self, time: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """Noise of this kind at `time`, for a bootstrap; without hum."""
        step = usual_step(time) if time.size > 1 else 0.0
        return self.total * self.colour(step).sample(time.size, random)


class NoStretchError(UserError, ValueError):
    """Records that are broken too often for their noise to be told."""


@one_blas_thread
def estimate(records: Records, bandwidth: float = np.inf, pace: float = 1.0) -> Noise:
    """The noise common to records of (time, output, times of events); outputs without gaps. A plant passes hardly more
    than its `bandwidth` [Hz], and takes `pace` times as long as usual for all that it does."""
    plant = Tempo(1 / (2 * np.pi * bandwidth), pace)
    records = [(*bridged(time, values), events) for time, values, events in records]
    found = _estimated(records, plant, APART)
    if not found.quiet or found.slow < SEEMS_SLOW * found.rms:
        return found
    finer = _estimated(records, plant, CLOSER)
    return finer if finer.quiet and finer.slow < CREPT * found.slow else found


def _estimated(records: Records, plant: Tempo, apart: float) -> Noise:
    """The noise beside creep whose time constants are `apart`, of a plant of some tempo."""
    chosen, quiet, rings = _chosen(records, apart, plant.pace)
    if not chosen:
        raise NoStretchError(
            "no stretch of readings without a gap is long enough to tell their noise; expected at most "
            f"{MOST_BRIDGED:.0%} of them to be lost here and there: give files with fewer, or without this column"
        )
    found, still = _told(records, chosen, quiet, rings, plant), _before_events(records, apart, plant.pace)
    if freedom(still) < CALMEST:
        return found
    alike = _left(chosen) < NOT_CALM * max(_left(still), usual_resolution(records) ** 2)
    if found.quiet and alike and not (rings and freedom(still) >= SOME_FREEDOM):
        return _as_at_rest(records, found, still)
    told = _told(records, still, True, True, plant)  # what rings out has a colour of its own, and noise no long one
    if not told.quiet and _at_rest(still):  # curves that take out creep would take most of such noise
        told = _told(records, whole_rests(records) or still, True, False, plant)
    return told if told.quiet else found


def _at_rest(still: Sequence[Stretches]) -> bool:
    """Whether a plant rests before anything happens: enough stretches show it, and it is no calmer at their end than at
    their begin, as one would be that rings out."""
    if freedom(still) < SOME_FREEDOM:
        return False
    halves = [np.array_split(s.left, 2) for s in still]
    first, last = (sum(float(np.sum(part[i] ** 2)) for part in halves) for i in (0, 1))
    return first < LOUDER * last


def of_residual(known: Noise, rest: Sequence[Stretches]) -> Noise:
    """The noise that a `rest` tells which a model leaves, as quiet stretches do; `known` where that is too little, or
    where it was stated."""
    if known.stated or freedom(rest) < SOME_FREEDOM:
        return known
    found = coloured(rest, min(s.step for s in rest), pace=known.pace)
    colour = found.at_step
    return replace(
        known,
        rms=float(np.sqrt(found.variance)),
        correlation=colour.correlation,
        freedom=found.freedom,
        step=found.step,
        white=colour.white,
        form=max(FORM, found.uncertainty),
        quiet=True,
        slower=(colour.pole, colour.zero),
        slow_known=not colour.pole,
        by_residual=True,
        clocked=found.clocked,
    )


def _as_at_rest(records: Records, found: Noise, still: list[Stretches]) -> Noise:
    """Noise as it is before anything happens, where enough stretches show there that it has less of a memory: the rest
    is what the plant does."""
    if found.neighbours <= 0:
        return found
    if _left(still) < usual_resolution(records) ** 2:
        return _hidden_by_steps(records, found, still)
    if freedom(still) < SOME_FREEDOM:
        return found
    lines = [*found.hum, *found.lines]
    told = _told(records, [s.without(lines) for s in still], True, True, found.plant)
    told = replace(told, hum=found.hum, lines=found.lines)
    rests = [s.without(lines) for s in whole_rests(records)]
    worse = 2 * (unlikely(rests, found.colour, found.rms**2) - unlikely(rests, told.colour, told.rms**2))
    return told if told.quiet and told.slow < found.slow and worse > ANOTHER else found


def _hidden_by_steps(records: Records, found: Noise, still: list[Stretches]) -> Noise:
    """Noise of readings in coarse steps, which hide it at rest: as it is there, with no more memory than it shows
    there, if readings change less often than noise as `found` would make them."""
    rests = whole_rests(records)
    if not rests:  # they have gaps
        return found
    step = usual_resolution(records)
    changed = np.concatenate([np.abs(np.diff(s.values, axis=0)).ravel() for s in rests])
    seen = float(np.mean(changed > 0.5 * step))
    expected = min(_changing(2 * (1 - found.neighbours) * (found.rms / step) ** 2), MOST_CHANGES)
    worse = 2 * changed.size * float(rel_entr(seen, expected) + rel_entr(1 - seen, 1 - expected))
    if seen >= expected or worse < ANOTHER:
        return found
    told = _told(records, still, True, True, found.plant)
    if told.quiet and freedom(still) >= SOME_FREEDOM:
        return replace(told, hum=found.hum, lines=found.lines)
    rms, known = float(np.sqrt(_left(still))), float(freedom(still))
    return Noise(rms, 0.0, known, found.hum, found.lines, found.step, white=1.0).of(found.plant)


def _changing(square: float) -> float:
    """The share of readings that differ from the one before, where they change by `square` [steps squared] in the mean,
    of which rounding is part: by one step at most while that is little, else as Gaussian changes do."""
    if square < SINGLE_STEPS:
        return square
    change = float(np.sqrt(square - BY_ROUNDING))  # before rounding: its readings differ if it passes a step
    return float(change * np.sqrt(2 / np.pi) * -np.expm1(-0.5 / change**2) + erfc(1 / (change * np.sqrt(2))))


def _before_events(records: Records, apart: float, pace: float) -> list[Stretches]:
    """The calm stretches before anything happens in their records."""
    first = [first_event(time, events) for time, _, events in records]
    kept = []
    for one in calm(stretches(records, apart=apart, pace=pace), usual_resolution(records)):
        ends = [records[r][0][a + len(one.values) - 1] for r, a in zip(one.record, one.first, strict=True)]
        kept.append(one.only(np.array(ends) <= np.array(first)[one.record]))
    return [k for k in kept if k.record.size]


def _brief(faster: float, step: float) -> float:
    """The memory [samples] that noise may have beside a plant whose bandwidth has the time constant `faster` [s]."""
    return max(BRIEF, faster / step) if step > 0 else BRIEF


def _left(groups: Sequence[Stretches]) -> float:
    """The variance of stretches without what creeps."""
    return sum(float(np.sum(g.left**2)) for g in groups) / max(freedom(groups), 1)


def _told(records: Records, chosen: list[Stretches], quiet: bool, rings: bool, plant: Tempo) -> Noise:
    """The noise that chosen stretches tell, of which it is known whether they are quiet, and others are not."""
    step = min(s.step for s in chosen)
    plain, lines = _stripped(chosen, records, Colour(0.0), plant.pace)
    found = clocked_or_not(plain, step, plant.pace)
    if found.at_step.correlation:
        plain, lines = _stripped(chosen, records, found.colour(step), plant.pace)
        found = clocked_or_not(plain, step, plant.pace) if lines else found
    colour = found.colour(step)
    long = colour.phi > np.exp(-1 / _brief(plant.faster, step))
    moves = found.variance > (MOST_SLOW if long else 1.0) * _variance(records)
    quiet = quiet and not moves and not (long and (rings or found.freedom < CALMEST))
    if quiet:
        found = as_told(plain, found, plant.pace)
        colour = found.colour(step)
    form = max(FORM, found.uncertainty) if quiet else UNQUIET
    one_colour = not 0 < colour.white < 1 or colour.phi <= 0
    mains = tuple(sorted(f for f in lines if hums.is_hum(f, step)))
    others = tuple(sorted(f for f in lines if f not in mains))
    return Noise(
        float(np.sqrt(found.variance)),
        colour.correlation,
        found.freedom,
        mains,
        others,
        step,
        colour.white,
        form,
        quiet,
        slower=(colour.pole, colour.zero) if quiet else (0.0, 0.0),
        slow_known=quiet
        and not colour.pole
        and (
            (one_colour and found.freedom >= SOME_FREEDOM)
            or _longest(chosen) >= max(SLOW_STRETCH * plant.pace, SLOW_SAMPLES * step)
        ),
        clocked=found.clocked,
    ).of(plant)


def _chosen(records: Records, apart: float, pace: float) -> tuple[list[Stretches], bool, bool]:
    """The stretches that tell the noise, whether they are quiet, and whether the plant rings in others."""
    coarse, every = usual_resolution(records), stretches(records, apart=apart, pace=pace)
    chosen = calm(every, coarse)
    mains = _mains(chosen, records, pace)
    if mains:
        every = _with_room(every, mains)
        chosen = calm(every, coarse, lines=mains)
    if freedom(chosen) < CALMEST:
        every = stretches(records, short=True, apart=apart, pace=pace)
        chosen = calm(every, coarse, BARELY_CALM)
    if freedom(chosen) < ENOUGH_FREEDOM:  # then everything between events is used, if there is more of it
        whole = [(t, y, t[[0, -1]]) for t, y, _ in records]
        between = stretches(records, 0.0, apart=apart, pace=pace) or stretches(whole, 0.0, apart=apart, pace=pace)
        other = calm(between, coarse)
        if freedom(other) > 2 * freedom(chosen) and not louder(other, chosen):
            return other, False, True
    return chosen, True, freedom(chosen) < CALM_SHARE * freedom(every)


def _with_room(every: list[Stretches], lines: Sequence[float]) -> list[Stretches]:
    """The stretches of which lines take little, if these are enough: of short ones they take most of the noise."""
    long = [s for s in every if len(s.values) >= ROOM_A_LINE * len(lines)]
    return long if freedom(long) >= ENOUGH_FREEDOM else every


def usual_resolution(records: Records) -> float:
    """The step of the sensor's readings."""
    return float(np.median([resolution(y) for _, y, _ in records]))


def _mains(chosen: list[Stretches], records: Records, pace: float) -> list[float]:
    """The lines [Hz] of hum in chosen stretches; none where they are too few to tell. No ringing of a plant is hum."""
    if freedom(chosen) < CALMEST:
        return []
    step = min(s.step for s in chosen)
    return [f for f in _stripped(chosen, records, Colour(0.0), pace)[1] if hums.is_hum(f, step)]


def _variance(records: Records) -> float:
    """The largest variance of a record: noise with more is a signal, the ringing of a plant that has not settled."""
    return max(float(np.var(values)) for _, values, _ in records)


def _longest(quiet: Sequence[Stretches]) -> float:
    """The longest stretches [s] that tell something together."""
    return max((s.step * len(s.values) for s in quiet if s.freedom >= SOME_FREEDOM), default=0.0)


def rounded(noise: Noise, step: float) -> Noise:
    """Noise with what rounding to steps adds where the signal moves: it is white there, and hardly shows at rest.

    Where it is larger than the noise, it follows slow signals, and nothing tells how slow it is.
    """
    rounding = step / float(np.sqrt(12.0))
    if step > 0:
        noise = replace(noise, form=max(noise.form, _by_place(noise.rms, step)))
    if 2 * rounding**2 >= noise.rms**2:
        noise = replace(noise, slow_known=False, grain=step)
    if rounding < COARSE_OUTPUT * noise.innovation:
        return noise
    rms = float(np.hypot(noise.rms, rounding))
    white = (noise.white * noise.rms**2 + rounding**2) / rms**2
    return replace(noise, rms=rms, white=white, correlation=(1 - white) * noise.phi)


def _by_place(rms: float, step: float) -> float:
    """The relative error of the variance at rest: how much noise readings in steps show depends on where they rest.

    The first wave of the variance over the place between two steps (Widrow and Kollar, "Quantization noise", 2008,
    ch. 9): 2 % for noise of half a step, 30 % for a third. `rms` is that of readings, with what rounding adds.
    """
    own = max(rms**2 - step**2 / 12, 0.0)
    wave = (step**2 / np.pi**2 + 4 * own) * np.exp(-2 * np.pi**2 * own / step**2)
    return float(wave / (own + step**2 / 12))


def _stripped(
    quiet: list[Stretches], records: Records, colour: Colour, pace: float
) -> tuple[list[Stretches], list[float]]:
    """The stretches without lines, and their frequencies [Hz]: the strongest first, until none stands out.

    One at a time, as the pattern of the stretches gives every line others beside it.
    """
    lines: list[float] = []
    plain = quiet
    while len(lines) < MOST_LINES:
        line = _strongest(plain, records, colour, pace)
        if line is None:
            break
        lines.append(line)
        plain = [s.without(lines) for s in quiet]
    return plain, lines


def _strongest(quiet: Sequence[Stretches], records: Records, colour: Colour, pace: float) -> float | None:
    """The line [Hz] that stands out most of what is left of the stretches of the finest sampling."""
    step = min(s.step for s in quiet)
    rests: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    for group in (s for s in quiet if s.step == step):
        rest = group.rest(colour)
        for j, (record, first) in enumerate(zip(group.record.tolist(), group.first.tolist(), strict=True)):
            times = records[record][0][first : first + len(rest)]
            rests.setdefault(record, []).append((times, rest[:, j]))
    joined = [
        tuple(np.concatenate(x) for x in zip(*sorted(parts, key=lambda p: p[0][0]), strict=True))
        for parts in rests.values()
    ]
    return hums.strongest([(t, r) for t, r in joined], step, pace)
