"""From recorded inputs to the protocol that drives the model: without the monitors' noise, with exact switching."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from ...plants.plant import Input
from ...protocol import Protocol
from ..records.experiment import DataError, Experiment, commanded
from ..signals import hum as hums
from ..signals.curve_kinks import leaving
from ..signals.hum import MAINS, within
from ..signals.kinks import kinked, untold
from ..signals.monitors import (
    COLOURED,
    ENOUGH_REST,
    NO_MEMORY,
    QUIET,
    Polyline,
    at_rest,
    changes_by_itself,
    coarseness,
    curved,
    halved,
    level,
    long_run,
    memory,
    noise_level,
    polyline,
    resolution,
    smoothed,
)
from ..signals.sampling import usual_step
from ..threads import one_blas_thread
from .band import JITTER, band_limited, evened, noise_floor, off_even
from .clocked import sent_at
from .edges import MATTERS, Edge, Rise, located
from .edges import rise as rise_of
from .held import HeldLine, held_line
from .line_checks import check_sampling, line_error
from .transitions import LEADS_ON, Transitions, transitions
from .trigger import triggered

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions edges rounded --seed 1000`
STAIR = 5.0  # [1] times the noise that a staircase steps by: a ramp in a noisy monitor moves far less
TURNS = 3  # [1] times that an exact signal steps back at the next sample: fewer may be spikes
STEPPING = 0.25  # [1] share of samples at which a staircase steps by more: a controller rests too, an edge is brief
SMOOTHLY = 0.3  # [1] of its steps by which cubics miss a signal that moves smoothly; they miss stairs by 0.9

# Set by theory: between a signal that holds and one that moves straight on, which are 0 and 0.5 samples late.
# Check: `pytest tests/test_monitors.py -k smoothly`
MIDWAY = 0.25  # [samples] by which a held input that moves smoothly is late, and the uncertainty of that

# Set by judgement. Check: `pytest tests/test_monitors.py -k band_limited`
CLOCK_JITTER = 0.05  # [1] of the time between samples: jitter of a clock that prints few digits

# Set by judgement. Check: `pytest tests/test_monitors.py -k hum`,
# `python -m blind.score --nulls 12 --conventions hum --seed 1000`
HUM_PASSES = 6  # [1] times that hum and the line that it is no part of are told from each other, at most
HUM_LEFT = 0.05  # [1] of the noise: a smaller change of the hum is none

# Set by judgement. Check: `pytest tests/test_monitors.py::test_hum_of_the_mains_is_no_part_of_a_line`
SLOPES = 50  # [samples] over which a held signal that moves runs straight, for its hum to be seen

# Set by convention: a computer writes a set point down when it sends it.
# Check: `pytest tests/test_edges.py::test_a_set_point_switches_where_it_is_first_written`
ON_SAMPLES = 1.0  # [samples] after the last of the old level at which such an input switches

# Set by judgement: a supply's ripple grows with its voltage. Check: `pytest tests/test_edges.py -k sweep`
NOISIER = 3.0  # [1] times the noise in a set's quietest record of a held input that moves; more may be a signal
QUIET_BLOCK = 64  # [samples] of a part of a record, of which the quietest tell its noise then:
STILLEST = 0.1  # [1] share of them

# Set by judgement: no sine with a tenth of that between samples is drawn worse by lines. Check:
# `pytest tests/test_edges.py -k leaps`
LEAP = 10.0  # [1] times as far as between any other two samples: there a continuous input that moves otherwise leaps
RARE = 3.0  # [1] times the median step that the largest is of noise: 1.4 of a sine, 5 of noise in 1000 samples

# Set by measurement: noise is told to some 5 %; a monitor that moves between its steps is off its levels by more.
# Check: `pytest tests/test_edges.py -k only_steps`
LEVEL_ALONE = 1.2  # [1] times the noise by which a continuous input that only steps is off its levels (rms), at most


@dataclass(frozen=True)
class Drive:
    """The `protocol` of one experiment, and the noise that was removed: `noise` (standard deviation, SI) by input.

    A coloured monitor's `noise` is that of white noise whose averages vary equally. `corners` are the times (k,) [s] at
    which the line through each continuous input bends, `edges` all switchings of held inputs that matter, `error` is
    how far the lines miss the record where no edge is near (rms, SI) by input, or straight lines a band-limited one.
    `shown` is whether edges were recorded on their way: then they are slow, or the monitors are. `zeros` (SI, by name)
    are those of monitors that were taken off, and `loads` how much of them the plant may have rested under instead
    (SI, by name). `unheld` names held inputs that also move between their edges. `rises`
    are those of the amplifiers behind monitors that switch, by input. `step` [s] is the time between samples.
    In the spans `untold` (k, 2) [s], by name, samples do not tell how a continuous input moved.
    Of inputs that moved from the first sample on, `begun` is how well it is known when they began (s, by name), and of
    those that a computer sent on its own clock, `room` by how much earlier or later that was.
    Inputs that are `noisy` have the noise of their monitors still: they are band-limited, and no line smooths them.
    """

    protocol: Protocol
    noise: dict[str, float]
    corners: dict[str, np.ndarray]
    edges: tuple[Edge, ...] = ()
    error: dict[str, float] = field(default_factory=dict)
    lines: Mapping[str, HeldLine] = field(default_factory=dict, repr=False)
    shown: bool = False
    zeros: Mapping[str, float] = field(default_factory=dict)
    loads: Mapping[str, float] = field(default_factory=dict)
    unheld: frozenset[str] = frozenset()
    rises: Mapping[str, Rise] = field(default_factory=dict)
    step: float = 0.0
    begun: Mapping[str, float] = field(default_factory=dict)
    room: Mapping[str, float] = field(default_factory=dict)
    untold: Mapping[str, np.ndarray] = field(default_factory=dict, repr=False)
    noisy: frozenset[str] = frozenset()

    def tells(self, times: np.ndarray) -> np.ndarray:
        """Whether it is known at `times` (n,) [s] what the inputs did just before, (n,)."""
        spans = np.concatenate([np.empty((0, 2)), *self.untold.values()])
        begun, ended = (np.searchsorted(np.sort(ends), times) for ends in spans.T)
        return np.asarray(begun == ended)

    def begun_later(self, name: str, by: float) -> Drive:
        """The drive with an input that began to move `by` [s] later."""
        line = self.lines[name]
        lines = dict(self.lines) | {name: line.begun_at(line.begin + by)}
        return replace(self, lines=lines, protocol=joined([(x.time, x.values) for x in lines.values()], list(lines)))

    def moved(self, shifts: np.ndarray, longer: Mapping[str, float] | None = None) -> Protocol:
        """The protocol with every one of `edges` later by its shift (m,) [s], and `longer` [s] by input.

        Exactly: breakpoints move, along the lines beside them, and nothing is sampled. An edge that would pass
        another one, or an end of the record, stops there. An edge whose shape was recorded keeps it.
        """
        by = np.asarray(shifts, dtype=float)
        if by.shape != (len(self.edges),):
            raise ValueError(f"shifts: expected {len(self.edges)} of them, one an edge, but was given {by.size}")
        widened = np.array([max(e.share * (longer or {}).get(e.input, 0.0), -e.rise) for e in self.edges])
        lines = [line.moved(by, widened) for line in self.lines.values()]
        return joined([(line.time, line.values) for line in lines], list(self.lines))

    def without(
        self,
        zeros: Mapping[str, float],
        still: Mapping[str, int],
        levels: Mapping[str, float],
        loads: Mapping[str, float],
    ) -> Drive:
        """The drive without the zeros of some monitors, of which `loads` may be none (SI, by name), and with the first
        `still` points at a level."""

        def rested(name: str, line: HeldLine) -> HeldLine:
            values = line.values - zeros.get(name, 0.0)
            values[: still.get(name, 0)] = levels.get(name, 0.0)
            return replace(line, values=values)

        lines = {name: rested(name, line) for name, line in self.lines.items()}
        edges = tuple(replace(e, low=e.low - z, high=e.high - z) for e in self.edges for z in [zeros.get(e.input, 0.0)])
        protocol = joined([(line.time, line.values) for line in lines.values()], list(lines))
        return replace(self, protocol=protocol, lines=lines, edges=edges, zeros=dict(zeros), loads=dict(loads))


@dataclass(frozen=True)
class _Drawn:
    """The result for one input: its line, all its edges, its noise, and the error of the line."""

    line: HeldLine
    noise: float
    error: float
    corners: np.ndarray
    edges: Sequence[Edge] = ()
    shown: bool = False
    unheld: bool = False
    rise: Rise | None = None
    room: float = 0.0
    untold: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))


def drive(
    experiment: Experiment,
    inputs: Sequence[Input],
    noise: Mapping[str, float] | None = None,
    trigger: np.ndarray | None = None,
    rises: Mapping[str, Rise | None] | None = None,
    between: float = 0.5,
    mains: Mapping[str, Sequence[float]] | None = None,
    remembers: bool = True,
) -> Drive:
    """The protocol behind the recorded monitors.

    `noise` gives levels that bench.toml states; `trigger` (n,) is a logical signal of the switching. `rises` says how
    each held input rises where a set of records tells it (`drives`), `mains` what lines [Hz] of hum each continuous one
    has; else this record alone does. `between` two samples (0 to 1) is where an edge is if nothing tells. To a plant
    that does not remember (without states) it makes no difference what an input does between samples.
    """
    levels = _levels([experiment], inputs, noise, remembers)[0]
    exact = commanded(noise or {})  # commanded: it holds what stands in the file
    drawn: dict[str, _Drawn] = {}
    numbered: dict[str, HeldLine] = {}
    edges: list[Edge] = []
    for signal in inputs:
        name, values = signal.name, experiment.inputs[signal.name]
        leaps = signal.linear and _leaps(experiment, name, levels[name])  # and moves by itself in between
        if signal.band_limited:
            drawn[name] = _band_limited(experiment, signal, levels[name])
        elif signal.linear and not (leaps or _only_steps(experiment, name, levels[name])):
            lines = _mains([experiment], name) if mains is None else mains[name]
            if remembers and float(np.abs(values).max()) > signal.least:  # else nothing but noise is in it
                check_sampling(experiment, name, levels[name], name in (noise or {}))
            drawn[name] = _continuous(experiment, name, levels[name], lines)
        elif not leaps and (sent := sent_at(experiment.time, values)) is not None:
            drawn[name] = replace(_sent(experiment, values, levels[name], sent[0]), room=sent[1])
        elif not leaps and _staircase(values, levels[name]) and (name in exact or not _smooth(values, levels[name])):
            drawn[name] = _stairs(experiment, values, levels[name], rises[name] if rises is not None else None)
        else:
            how = rises[name] if rises is not None else _rise([experiment], name, [levels[name]])
            drawn[name] = _held(experiment, signal, levels[name], how, between, trigger, name in exact)
        large = np.array([abs(e.high - e.low) > MATTERS * float(np.ptp(values)) for e in drawn[name].edges], dtype=bool)
        numbered[name] = drawn[name].line.numbered(np.where(large, len(edges) + np.cumsum(large) - 1, -1))
        edges += [e for e, matters in zip(drawn[name].edges, large, strict=True) if matters]
    whole = [(line.time, line.values) for line in numbered.values()]
    protocol = joined(whole, list(numbered)) if whole else Protocol(experiment.time[[0, -1]], {})
    return Drive(
        protocol,
        {n: d.noise for n, d in drawn.items()},
        {s.name: np.unique(drawn[s.name].corners) for s in inputs if not s.held},
        tuple(edges),
        {n: d.error for n, d in drawn.items()},
        numbered,
        any(d.shown for d in drawn.values()),
        unheld=frozenset(n for n, d in drawn.items() if d.unheld),
        rises={n: d.rise for n, d in drawn.items() if d.rise is not None},
        step=usual_step(experiment.time),
        room={n: d.room for n, d in drawn.items() if d.room > 0},
        untold={n: d.untold for n, d in drawn.items() if d.untold.size},
        noisy=frozenset(s.name for s in inputs if s.band_limited),
    )


@one_blas_thread
def drives(
    experiments: Sequence[Experiment],
    inputs: Sequence[Input],
    noise: Mapping[str, float] | None = None,
    remembers: bool = True,
) -> list[Drive]:
    """The drives of a set whose files were recorded on one bench, of a plant that `remembers` or not (`drive`).

    Its amplifier rises alike in all of them, and its monitors' noise has one colour.
    """
    levels = _levels(experiments, inputs, noise, remembers)
    rises = {s.name: _risen(experiments, s, [n[s.name] for n in levels]) for s in inputs if not s.band_limited}
    mains = {s.name: _mains(experiments, s.name) for s in inputs if s.linear}
    return [
        drive(e, inputs, n, e.trigger, rises, mains=mains, remembers=remembers)
        for e, n in zip(experiments, levels, strict=True)
    ]


def _risen(experiments: Sequence[Experiment], signal: Input, noise: Sequence[float]) -> Rise | None:
    """How an input rises, as those records tell that have edges of it: if it is not held, those that only step."""
    each = zip(experiments, noise, strict=True)
    own = [(e, n) for e, n in each if signal.held or _switches(e, signal.name, n)]
    return _rise([e for e, _ in own], signal.name, [n for _, n in own])


def _rise(experiments: Sequence[Experiment], name: str, noise: Sequence[float]) -> Rise | None:
    """How a held input rises, as its records tell that have edges: steps of a staircase are not on their way.

    Hum would put samples behind an edge on its way, at the same height behind every edge if both keep time.
    """
    each = [(e.time, e.inputs[name], n) for e, n in zip(experiments, noise, strict=True)]
    return rise_of([(time, v - _hum_between(time, v, n), n) for time, v, n in each if not _staircase(v, n)])


def _middle(memories: Sequence[tuple[float, float] | None]) -> tuple[float, float] | None:
    """The median of those known: quiet records agree on it, moving ones may not show it."""
    known = sorted(m for m in memories if m is not None)
    return known[len(known) // 2] if known else None


def _levels(
    experiments: Sequence[Experiment], inputs: Sequence[Input], stated: Mapping[str, float] | None, remembers: bool
) -> list[dict[str, float]]:
    """The noise of every monitor in every record: as stated, or estimated."""
    known = stated or {}
    each = {
        s.name: [known[s.name]] * len(experiments) if s.name in known else _estimated(experiments, s, remembers)
        for s in inputs
    }
    return [{name: levels[i] for name, levels in each.items()} for i in range(len(experiments))]


def _estimated(experiments: Sequence[Experiment], signal: Input, remembers: bool) -> list[float]:
    """The noise of a monitor in every record, with what all of them tell of its colour, and of its resolution.

    Where it is off, it may toggle between two readings, which looks like a command that is new at every sample: whether
    it is one is told by the record in which it is largest. A command (0) is what stands in the file.
    """
    records = [e.inputs[signal.name] for e in experiments]
    step = min((c for values in records if (c := coarseness(values)) > 0), default=0.0)
    kept = _middle([memory(values) for values in records]) if signal.linear else NO_MEMORY
    untold = signal.band_limited or kept is None  # nothing but a bound is known of its noise, if it is not at rest
    if untold and not step and sum(at_rest(values) for values in records) >= ENOUGH_REST:
        return [QUIET * float(np.ptp(values)) for values in records]
    if signal.band_limited:
        return [noise_floor(values) for values in records]
    largest = max(records, key=lambda values: float(np.abs(values).max()))
    there = float(np.abs(largest).max()) > signal.least  # else nothing but noise is in it
    if (signal.held or not remembers) and there and changes_by_itself(largest):
        return [0.0] * len(records)
    levels = [level(values, kept, step) for values in records]
    return _without_signal(levels, records, signal.least) if signal.held else levels


def _without_signal(levels: Sequence[float], records: Sequence[np.ndarray], least: float) -> list[float]:
    """The noise of a held input in every record, where a sweep that is fast beside the sampling may pass for it."""
    moving = [n for n, values in zip(levels, records, strict=True) if float(np.abs(values).max()) > least]
    quiet = min(moving, default=np.inf)
    return [
        noise if noise <= NOISIER * quiet else max(quiet, min(noise, _quietest(values)))
        for noise, values in zip(levels, records, strict=True)
    ]


def _quietest(values: np.ndarray) -> float:
    """The noise of a monitor in the quietest parts of its record, where a signal moves least."""
    parts = np.array_split(values, max(1, values.size // QUIET_BLOCK))
    return float(np.quantile([noise_level(part) for part in parts], STILLEST))


def _band_limited(experiment: Experiment, signal: Input, noise: float) -> _Drawn:
    time, values = experiment.time, experiment.inputs[signal.name]
    step = np.diff(time)
    irregular = np.abs(step / np.median(step) - 1)
    if irregular.max() > CLOCK_JITTER:
        if off_even(time) > JITTER:
            worst = int(np.argmax(irregular))
            raise DataError(
                f"{experiment.name}, line {experiment.lines[worst + 1]}: {step[worst]:.6g} s after the sample before; "
                f"expected samples about every {np.median(step):.6g} s, as the input {signal.name!r} is band_limited "
                "and is computed between them from all of them: leave this file out, or declare the input held=True "
                "(each value holds until the next) or with neither of the two (straight lines)"
            )
        time, values = evened(time, values)
    times, fine, error = band_limited(time, values, signal.direct is not False)
    first, last = experiment.time[[0, -1]]  # even times may begin later, and end earlier
    covered = np.concatenate([[first], times[(times > first) & (times < last)], [last]])
    return _Drawn(_unmoved(covered, np.interp(covered, times, fine)), noise, error, experiment.time)


def _continuous(experiment: Experiment, name: str, noise: float, mains: Sequence[float]) -> _Drawn:
    """The line of a continuous input; hum of the mains in its monitor, at lines `mains` [Hz], is taken away."""
    time, values = experiment.time, experiment.inputs[name]
    hum = hums.at(mains, time, _within_a_turn(time, values))
    for _ in range(HUM_PASSES):  # the line follows what is left of the hum
        if hum.any():
            known = max(level(values - hum), resolution(values) / float(np.sqrt(12.0)))
            noise = min(noise, known)
        drawn, noise = _smoothed(time, values - hum, noise)
        before, hum = hum, hums.at(mains, time, values - np.interp(time, time[drawn.corners], drawn.values))
        if float(np.std(hum - before)) <= HUM_LEFT * noise:
            break
    drawn = halved(time, values - hum, drawn)
    clean, step = values - hum, usual_step(time)
    lines = kinked(time, clean, curved(time, clean, drawn, noise), step, noise)
    lines, met = leaving(time, clean, lines, step, noise)
    line = _unmoved(*lines)
    missed = line_error(experiment, name, line, noise, hum=hum)
    spans = untold(time, clean, lines, step, noise)
    told = np.any((spans[:, :1] <= met) & (met <= spans[:, 1:]), axis=1)  # by the curve that begins there
    return _Drawn(line, noise, missed, line.time, untold=spans[~told])


def _within_a_turn(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (n,) less their average over a turn of the slowest mains, which holds no hum."""
    turn = max(1, round(1 / min(MAINS) / usual_step(time)))
    return np.asarray(values - uniform_filter1d(values, turn))


def _mains(experiments: Sequence[Experiment], name: str) -> list[float]:
    """The lines [Hz] of hum in a continuous monitor: where some records show them, it is in all of them."""
    found = [hums.lines_of(e.time, _within_a_turn(e.time, e.inputs[name])) for e in experiments]
    return max(found, key=len)


def without_hum(experiments: Sequence[Experiment], name: str) -> list[np.ndarray]:
    """The records of a continuous monitor without the hum of the mains."""
    lines = _mains(experiments, name)
    values = [(e.time, e.inputs[name]) for e in experiments]
    return [v - hums.at(lines, t, _within_a_turn(t, v)) for t, v in values]


def _smoothed(time: np.ndarray, values: np.ndarray, noise: float) -> tuple[Polyline, float]:
    """The line of a continuous input and its noise: coloured noise is known better once the line is."""
    line = polyline(time, values, noise)
    if noise < COLOURED * noise_level(values):
        return line, noise
    known = long_run(values - np.interp(time, time[line.corners], line.values))
    if not noise_level(values) < known < noise:
        return line, noise
    return polyline(time, values, known), known


def _unmoved(time: np.ndarray, values: np.ndarray) -> HeldLine:
    """A line without edges."""
    none = np.zeros(time.size)
    return HeldLine(time, values, np.full(time.size, -1), none, none)


def _staircase(values: np.ndarray, noise: float) -> bool:
    """Whether a held signal steps at many samples, by more than noise: then it was as it stands.

    So it was where one without noise steps back at the next sample, as a controller at its limits does: no edge on its
    way does.
    """
    steps = np.diff(values)
    back = np.count_nonzero(steps[1:] * steps[:-1] < 0) if noise == 0 else 0
    return bool(back >= TURNS) or float(np.quantile(np.abs(steps), 1 - STEPPING)) > STAIR * noise


def _smooth(values: np.ndarray, noise: float) -> bool:
    """Whether a signal that moves at many samples is smooth there: cubics through its neighbours come near a sample.

    Stairs with new levels are not. What was sampled from a sine may have been held from sample to sample or not.
    """
    if values.size < 7:
        return False
    missed = values[3:-3] - (9 * (values[2:-4] + values[4:-2]) - values[:-6] - values[6:]) / 16
    left = float(np.mean(missed**2)) - (1 + 164 / 256) * noise**2
    return left < SMOOTHLY**2 * (float(np.mean(np.diff(values) ** 2)) - 2 * noise**2)


def _stairs(experiment: Experiment, values: np.ndarray, noise: float, how: Rise | None) -> _Drawn:
    """A held signal that steps at many samples: as it stands, or straight from sample to sample where other records of
    the set caught its edges on their way, and so were sampled from what moves by itself."""
    time = experiment.time
    if how is not None and how.seen:
        return _Drawn(_unmoved(time, values), noise, 0.0, time, shown=True)
    return _sent(experiment, values, noise, time[np.flatnonzero(np.diff(values)) + 1])


def _sent(experiment: Experiment, values: np.ndarray, noise: float, sent: np.ndarray) -> _Drawn:
    """A held signal that steps at known instants `sent` (k,) [s]."""
    time, begins = experiment.time, np.flatnonzero(np.diff(values, prepend=np.nan))
    corners = np.column_stack([np.append(time[0], sent), np.append(sent, time[-1])]).ravel()
    return _Drawn(_unmoved(corners, np.repeat(values[begins], 2)), noise, 0.0, time)


def _held(
    experiment: Experiment,
    signal: Input,
    noise: float,
    how: Rise | None,
    between: float,
    trigger: np.ndarray | None,
    exact: bool,
) -> _Drawn:
    """The line of a held input and its edges; hum of the mains in its monitor is taken away.

    A value that is `exact` holds from its sample to the next, so that a ramp of many small steps is half a sample late.
    A record that shows edges on their way was sampled from what moves by itself, as one of a continuous input is, and
    is not. Others may be either.
    """
    name, time, values = signal.name, experiment.time, experiment.inputs[signal.name]
    hum = _hum_between(time, values, noise)
    values = values - hum
    found = transitions(time, values, noise)
    written = _written(values, found)
    place = ON_SAMPLES if written else between
    edges = located(name, time, values, noise, found, how, place)
    if trigger is not None:
        edges = triggered(edges, time, trigger)
    shown = bool(np.any(found.after > found.before + 1)) or (how is not None and how.seen)
    itself = shown or signal.linear
    delay = (0.0 if itself else 0.5 if exact else MIDWAY) * usual_step(time)
    line, edges = held_line(time, values, noise, found, edges, delay)
    missed = line_error(experiment, name, line, noise, found, edges, delay, hum)
    unheld = not (itself or exact) and line.ramps(MATTERS)
    return _Drawn(line, noise, missed, line.time, edges, shown, unheld, None if written else how)


def _hum_between(time: np.ndarray, values: np.ndarray, noise: float) -> np.ndarray:
    """The hum (n,) of the mains in the monitor of a held signal."""
    return within(time, _between_edges(time, values, transitions(time, values, noise)))


def _between_edges(time: np.ndarray, values: np.ndarray, found: Transitions) -> np.ndarray:
    """A held signal (n,) without its levels and slow slopes; 0 at its switchings."""
    left = np.zeros(values.size)
    begins = np.append(0, found.after)
    for begin, end in zip(begins, np.append(found.before + 1, values.size), strict=True):
        if end - begin < SLOPES:
            continue
        count = int(np.ceil((end - begin) / SLOPES)) + 1
        corners = np.linspace(0, end - begin - 1, count).astype(int)
        part = slice(begin, end)
        left[part] = values[part] - np.interp(
            np.arange(end - begin), corners, smoothed(time[part], values[part], corners)
        )
    return left


def _switches(experiment: Experiment, name: str, noise: float) -> bool:
    """Whether a continuous input switches in this record, so that instants between samples are to be estimated."""
    return _only_steps(experiment, name, noise) or _leaps(experiment, name, noise)


def _leaps(experiment: Experiment, name: str, noise: float) -> bool:
    """Whether it leaps from one sample to the next, by far more than it moves between any others, as a sine does.

    What noise makes of the largest of those steps is none of its movement.
    """
    time, values = experiment.time, experiment.inputs[name]
    found = transitions(time, values, noise)
    if not len(found) or np.any(found.after > found.before + 1):
        return False
    steps = np.abs(np.diff(values))
    others = np.delete(steps, found.before).max(initial=0.0)
    moves = others if others < RARE * np.median(steps) else others - LEADS_ON * noise
    return bool(steps[found.before].min() > LEAP * moves)


def _only_steps(experiment: Experiment, name: str, noise: float) -> bool:
    """Whether a continuous input only steps in this record, from one level to the next: then a line from the last
    sample before a step to the first behind it would be half a sample early."""
    time, values = experiment.time, experiment.inputs[name]
    found = transitions(time, values, noise)
    if not len(found):
        return False
    begins, ends = [0, *found.after], [*(found.before + 1), values.size]
    levels = [values[a:b] for a, b in zip(begins, ends, strict=True) if a < b]
    off = np.concatenate([level - level.mean() for level in levels])
    return _written(values, found) or bool(np.std(off) <= LEVEL_ALONE * noise)


def _written(values: np.ndarray, found: Transitions) -> bool:
    """Whether the signal is a set point written by a computer: constant between switchings, and no sample within
    one."""
    still = np.count_nonzero(np.diff(values)) <= len(found)
    return bool(len(found) and still and np.all(found.after == found.before + 1))


def joined(lines: list[tuple[np.ndarray, np.ndarray]], names: list[str]) -> Protocol:
    """All inputs on one grid of breakpoints; a time is doubled where any input jumps."""
    single = np.unique(np.concatenate([times for times, _ in lines]))
    doubled = np.unique(np.concatenate([times[1:][np.diff(times) == 0] for times, _ in lines]))
    grid = np.sort(np.concatenate([single, doubled]))
    second = np.append(False, np.diff(grid) == 0)
    inputs = {}
    for name, (times, values) in zip(names, lines, strict=True):
        before = _at(times, values, grid, "left")
        after = _at(times, values, grid, "right")
        inputs[name] = np.where(second, after, before)
        inputs[name][0] = after[0]
    return Protocol(grid, inputs)


def _at(times: np.ndarray, values: np.ndarray, grid: np.ndarray, side: str) -> np.ndarray:
    """Values on the grid, taken from one side where a time is doubled."""
    if side == "left":
        right = np.clip(np.searchsorted(times, grid, side="left"), 1, times.size - 1)
    else:
        right = np.clip(np.searchsorted(times, grid, side="right"), 1, times.size - 1)
    left = right - 1
    span = times[right] - times[left]
    part = np.clip(np.divide(grid - times[left], span, out=np.ones_like(span), where=span > 0), 0, 1)
    return values[left] + part * (values[right] - values[left])
