"""The study: recordings prepared for fits, as pieces in training and held out, with their noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...errors import ArgumentError, UserError
from ...kernel import KernelError
from ...model.declare import nearest
from ...model.effect import Effect
from ...model.starts import loosened
from ...plants.plant import Input, Output, Plant
from ...protocol import Protocol
from ..fitting.cases import Case, Reading
from ..fitting.compiled import Compiled, Ids
from ..fitting.marginal import Marginal
from ..fitting.problem import Free, Problem
from ..fitting.response import FINER, NEGLIGIBLE, ROUGH, TOLERANCE, Response
from ..inputs.drive import Drive, without_hum
from ..inputs.drive import drives as all_drives
from ..inputs.edges import Rise
from ..records.checks import at_limit
from ..records.experiment import RESTED, DataError, Experiment, Recordings
from ..records.growing_noise import with_growing_noise
from ..records.start import MOVED, ZEROS, is_loose, may_be_filtered, zeroed
from ..signals import noise as noises
from ..signals.monitors import COLOURED, noise_level
from ..signals.noise import Noise
from ..signals.noise_bound import limited
from ..signals.quiet import pace_of
from ..signals.sampling import SAME_STEP
from ..signals.slow import LEFT_REST, RESTS_AT, level_at_rest, slow_level
from .read_starts import read_starts

# Set by convention: a quarter.
# Check: `pytest tests/test_discover.py::test_held_out_experiments_stay_inside_what_the_others_reach`
HELD_SHARE = 4  # [1] experiments of which one takes no part in any fit

# Set by judgement: a factor of e^2 for what is positive, twice the size for the rest.
# Check: `pytest tests/test_atlas.py::test_what_is_left_is_orthogonal_to_own_parameters`
PRIOR = 2.0  # [1] width of the weak prior, in the solver's numbers

# Set by measurement: a load that is released at once makes an undamped tube ring, for millions of steps.
# Check: `pytest tests/test_study.py -k between_files`
RELEASED = 2.0  # [s] after the end of a record until its last inputs are those with which the next one begins, at most
RELEASES = 16  # [1] straight lines of which that is made

# Set by judgement: a tenth of the time on ten minutes of heart beats. Check: `pytest tests/test_study.py -k beginning`
LONG = 3000  # [breakpoints] of a record whose beginning is fitted first
RANGE = 0.98  # [1] quantile of a signal that is an end of its range

# Set by judgement. Check: `pytest tests/test_discover.py -k held_out_experiments`
THE_SAME = 1e-9  # [1] distance of experiments that are taken to be at least so far apart
SMOOTH = 25  # [samples] over which an output is averaged before experiments are compared

# Set by judgement. Check: `pytest tests/test_monitors.py -k rest`
LONG_REST = 0.5  # [s] of rest that tell something of a monitor's noise, beside a plant of the usual pace

# Set by judgement. Check: `pytest tests/test_data.py::test_what_a_computer_wrote_may_stand_still`
FAINTEST = 1e-6  # [1] of an output's largest value: noise is not taken to be less


@dataclass(frozen=True)
class Nuisances:
    """Nuisance parameters of a record: `columns` (N, k) that they are multiplied by (SI), priors `sd` (k,)."""

    names: tuple[str, ...]
    columns: np.ndarray
    sd: np.ndarray

    def mean(
        self, white: np.ndarray, residual: np.ndarray, sd: np.ndarray, now: np.ndarray | None = None
    ) -> np.ndarray:
        """Their most likely values (k,) given whitened columns (N, k) and a whitened residual (N,).

        Where the residual is that at values `now` (k,), by how much they change.
        """
        used = sd > 0
        found, size = np.zeros(sd.size), sd[used]
        information = (white.T @ white)[np.ix_(used, used)] * np.outer(size, size) + np.eye(size.size)
        pulled = 0.0 if now is None else now[used] / size
        told = (white.T @ residual)[used] * size + pulled
        # Where a trial model runs away, columns are so long and so alike that the prior is lost beside them.
        found[used] = -np.linalg.lstsq(information, told)[0] * size
        return found


@dataclass(frozen=True)
class Piece:
    """An experiment or part of one: what drives it, what was read at `case.times` (N,), and whether it is held out.

    `source` names the file. `shifts` [s] are those of `driven.edges` that the protocol has by now. `own` and `marginal`
    are the record's own numbers. `loose`: what it starts from is unknown.
    `beside` is what was read of outputs that depend on rates, which take no part in fits. Where the plant did not rest
    between files, `before` is what was done to it before this one, `follows` names the last of those and `clock` [s] is
    where its own clock begins. `arrived` [s] are the least and the largest shifts of edges, each (m,), where outputs
    tell more of them than was recorded.
    """

    name: str
    case: Case
    record: np.ndarray
    held_out: bool
    weight: np.ndarray
    driven: Drive
    marginal: Marginal = field(default_factory=Marginal)
    shifts: np.ndarray = field(default_factory=lambda: np.empty(0))
    nuisances: Nuisances = field(default_factory=lambda: Nuisances((), np.empty((0, 0)), np.empty(0)))
    loose: bool = False
    source: str = ""
    before: Protocol | None = None
    follows: str = ""
    clock: float | None = None
    beside: tuple[tuple[Reading, np.ndarray], ...] = ()
    arrived: tuple[np.ndarray, np.ndarray] | None = None
    delays: Mapping[str, float] = field(default_factory=dict)
    longer: Mapping[str, float] = field(default_factory=dict)

    def driven_by(self, shifts: np.ndarray) -> Protocol:
        """The protocol with edges moved by their shifts [s] and `longer`, less `delays`, behind what was `before`."""
        own = self.driven.moved(shifts, self.longer) if self.driven.edges else self.driven.protocol
        for name, by in self.delays.items():
            own = own.with_delay(name, -by) if by else own
        return own if self.before is None else followed(self.before, own)


@dataclass(frozen=True)
class Study:
    """All pieces, the noise of every output, and the compiled models they are held against.

    `prior` is the width of the weak prior of all fits, in the solver's numbers; None for none. `spread` is by
    how much zeros and gains differ between files (SI, by name), and `delays` those that filters give monitors (in
    samples, by signal) and `longer` how much longer amplifiers rise than was read (s, by input), once estimated. Unless
    effects are `sought`, all that may be a record's own is. `tolerance` is the integrator's. `stated` are the monitors
    whose noise the user knows, `coloured` those that show noise slower than a sample. `remembering`: noise that the
    plant remembers is a record's own (`remembered`). `firm`: zeros and gains differ between files by no more than is
    usual. `zeros` are the usual ones of signals (SI), as the plant declares them or as they are `assumed`.
    """

    plant: Plant
    pieces: list[Piece]
    noise: dict[str, Noise]
    monitor_noise: dict[str, float]
    compiled: Compiled
    geometry: dict[str, float] = field(default_factory=dict)
    prior: float | None = None
    spread: dict[str, float] = field(default_factory=dict)
    delays: dict[str, float] = field(default_factory=dict)
    longer: dict[str, float] = field(default_factory=dict)
    sought: bool = True
    tolerance: float = TOLERANCE
    stated: frozenset[str] = frozenset()
    coloured: frozenset[str] = frozenset()
    remembering: bool = True
    firm: bool = False
    zeros: Mapping[str, float] = field(default_factory=dict)

    @property
    def catalogue(self) -> Mapping[str, Effect]:
        """All effects of the plant, by id."""
        return self.plant.catalogue

    @property
    def training(self) -> list[Piece]:
        """The pieces that take part in fits."""
        return [p for p in self.pieces if not p.held_out]

    @property
    def held_out(self) -> list[Piece]:
        """The pieces that take part in none."""
        return [p for p in self.pieces if p.held_out]

    @property
    def filtered(self) -> bool:
        """Whether the monitors may have a filter."""
        return may_be_filtered([p.driven for p in self.pieces])

    @property
    def rises(self) -> dict[str, Rise]:
        """How the amplifiers rise behind monitors that switch, by input."""
        return {name: rise for p in reversed(self.pieces) for name, rise in p.driven.rises.items()}

    def unknown(self, ids: Ids, piece: Piece) -> dict[str, float]:
        """The parameters of a piece's start that are its own, with their usual sizes (SI), in the model with `ids`;
        none of one that follows another, as it goes on from there."""
        if piece.before is not None:
            return {}
        return self.plant.each_start | (self.compiled.unknown(ids) if piece.loose else {})

    def shared(self, values: Mapping[str, float]) -> dict[str, float]:
        """Values of parameters without those of which each record has its own."""
        own = {name for p in self.pieces for name in (*p.case.own, *self.unknown((), p))}
        return {n: v for n, v in values.items() if n not in own}

    @property
    def beginning(self) -> Study:
        """The study with the beginning of every long record alone, where a search that is far off costs less."""
        pieces = [_beginning(p) for p in self.pieces]
        return self if all(b is p for b, p in zip(pieces, self.pieces, strict=True)) else replace(self, pieces=pieces)

    def zero(self, name: str) -> float:
        """The usual zero error of a signal (SI); 0 for a name that is no signal."""
        return self.zeros.get(name, 0.0)

    @property
    def assumable(self) -> list[str]:
        """The signals that may have a zero error of which the plant says nothing. What was set has none."""
        inputs = [s.name for s in self.plant.inputs if s.zero is None and not s.held]
        outputs = [o for o in self.plant.outputs if o.zero is None and not o.feels_rates]
        return inputs + [o.name for o in outputs if o.name in self.noise]

    @property
    def assumed(self) -> list[str]:
        """The signals of which the plant declares no zero, and which are allowed one all the same."""
        declared = declared_zeros(self.plant)
        return [name for name, size in self.zeros.items() if size > declared[name]]

    def response(self, ids: Ids, pieces: Sequence[Piece], *more: Effect) -> Response:
        """The model with the effects `ids` of the catalogue and `more` on some pieces."""
        return self.asked(ids, [p.case for p in pieces], *more)

    def asked(self, ids: Ids, cases: Sequence[Case], *more: Effect) -> Response:
        """The same for any cases."""
        return Response(self.compiled.kernel(ids, *more), cases, self.geometry, self.tolerance)

    def problem(
        self, ids: Ids, free: Sequence[Free], fixed: Mapping[str, float], pieces: Sequence[Piece] | None = None
    ) -> Problem:
        """The least squares problem of the model with effects `ids` on some pieces (those in training)."""
        pieces = self.training if pieces is None else pieces
        return Problem(
            self.response(ids, pieces),
            [p.record for p in pieces],
            self.noise,
            free,
            self.shared(fixed) | self.geometry,
            [p.weight for p in pieces],
            self.prior if free else None,
            [p.marginal for p in pieces],
        )

    def weighted(self, weights: Sequence[np.ndarray]) -> Study:
        """The study with other weights of the samples, one array a piece."""
        return replace(self, pieces=[replace(p, weight=w) for p, w in zip(self.pieces, weights, strict=True)])


def study(
    recordings: Recordings, held_out: Sequence[str] | None = None, prior: float | None = None, effects: bool = True
) -> Study:
    """A study of some recordings. `held_out` names experiments; by default they are chosen by `choose_held_out`.

    Unless `effects` are sought, what a monitor shows at rest is its zero, even where all files have it in common, and
    sensors may drift.
    """
    recordings = with_growing_noise(recordings)
    plant, experiments = recordings.plant, recordings.experiments
    drives = all_drives(experiments, plant.inputs, recordings.noise, plant.model.remembers)
    drives = zeroed(experiments, drives, plant, effects)
    names = choose_held_out(recordings) if held_out is None else recordings.with_parts(held_out)
    known = [e.name for e in recordings.experiments]
    for name in names:
        if name not in known:
            raise ArgumentError("hold_out", f" {name}: there is no experiment {name!r}{nearest(name, known)}")
    pieces, noise = [], sensor_noise(recordings, drives)
    for experiment, driven in zip(recordings.experiments, drives, strict=True):
        whole = _piece(recordings, experiment, driven, experiment.name in names)
        pieces += [whole] if len(drives) > 1 or held_out is not None else _split(whole)
    pieces = carried(pieces)
    levels = _monitor_noise(recordings, drives)
    compiled = compiled_for(recordings, sum(max(p.record.size, p.case.protocol.time.size) for p in pieces))
    return _integrated(
        Study(
            compiled.plant,
            pieces,
            noise,
            levels,
            compiled,
            dict(recordings.geometry),
            prior,
            sought=effects,
            stated=frozenset(recordings.noise) & {s.name for s in plant.inputs},
            coloured=frozenset(n for n, level in levels.items() if level > COLOURED * fastest(drives, n)),
            zeros=declared_zeros(plant),
        )
    )


def declared_zeros(plant: Plant) -> dict[str, float]:
    """The usual zero error of every signal that the plant declares one of (SI)."""
    signals: list[Input | Output] = [*plant.inputs, *plant.outputs]
    return {s.name: s.known_zero for s in signals}


def log_determinant(pieces: Sequence[Piece]) -> float:
    """The logarithm of the determinant that the own numbers of some records give their likelihood."""
    return sum(p.marginal.log_determinant for p in pieces)


def _integrated(work: Study) -> Study:
    """The study with the rough tolerance, if its error at the declared values is nothing beside the noise."""
    coarse = replace(work, tolerance=ROUGH)
    problem = coarse.problem((), [], work.plant.model.parameter_values(), work.pieces)
    try:
        return coarse if problem.numerical_error(FINER) < NEGLIGIBLE else work
    except KernelError:  # no answer there
        return work


def compiled_for(recordings: Recordings, points: int) -> Compiled:
    """The models of a study, for records with `points` samples together: with free starts if one is unknown."""
    loose = any(is_loose(recordings, e) for e in recordings.experiments)
    plant = recordings.plant.with_model(loosened(recordings.plant.model)) if loose else recordings.plant
    return Compiled(plant, [o.name for o in recordings.fitted_outputs], points, loose)


def _monitor_noise(recordings: Recordings, drives: Sequence[Drive]) -> dict[str, float]:
    """The noise of every monitor as it weighs on averages over many samples (SI).

    1/f noise is small from sample to sample, and a line that follows its record follows it too. What moves slowly looks
    like more of it, so of records with different sampling steps those with the least count, if they tell noise as slow.
    Where a file rests at first, its colour shows. A stated level says nothing of that; where it is more than what
    changes from sample to sample, there is one.
    """
    found = {s.name: fastest(drives, s.name) for s in recordings.plant.inputs}
    rested = [recordings.starts[e.name] == RESTED for e in recordings.experiments]
    groups: dict[float, list[int]] = {}  # the files with each sampling step
    for number, driven in enumerate(drives):
        groups.setdefault(round(driven.step, SAME_STEP), []).append(number)
    pace = _pace(recordings, drives)
    for signal in recordings.plant.inputs:
        stated = recordings.noise.get(signal.name)
        if signal.linear and stated != 0:
            records, fast = without_hum(recordings.experiments, signal.name), found[signal.name]
            if stated and stated < COLOURED * float(np.median([noise_level(r) for r in records])):
                continue
            told = [(step * n[0], n[1]) for step, own in groups.items() if (n := slow_level([records[i] for i in own]))]
            slowest = max((lag for lag, _ in told), default=0.0)
            longest = sorted(level for lag, level in told if 2 * lag > slowest)[: 0 if stated else 1]
            rests = [
                level_at_rest([records[i] for i in own if rested[i]], fast, int(LONG_REST * pace / step))
                for step, own in groups.items()
            ]
            found[signal.name] = max(fast, *rests, *longest)
    return found


def _pace(recordings: Recordings, drives: Sequence[Drive]) -> float:
    """How many times as long as the tube the plant takes for all that it does."""
    return pace_of(recordings.plant.bandwidth, [d.step for d in drives])


def fastest(drives: Sequence[Drive], name: str) -> float:
    """The noise of a monitor that changes from sample to sample."""
    return float(np.median([d.noise[name] for d in drives]))


def _piece(recordings: Recordings, experiment: Experiment, driven: Drive, held_out: bool) -> Piece:
    """A whole experiment, with every output that was recorded in it; it starts as what it follows did."""
    plant, start = recordings.plant, recordings.begun_by(experiment).start
    own: dict[str, float] = {n: plant.model.parameter_values()[n] for n in plant.each_start}
    if plant.model.curve is not None and (start != RESTED or _rests_loaded(driven, plant)):
        own = {plant.model.curve.start_switch: 1.0}
    told = driven.tells(experiment.time)
    seen = {o.name: experiment.seen(o.name) & told for o in plant.outputs}
    read = [(o, *_read(experiment, o.name, seen[o.name])) for o in plant.outputs if seen[o.name].any()]
    record = np.concatenate([values for o, _, values in read if not o.feels_rates])
    case = Case(driven.protocol, tuple(reading for o, reading, _ in read if not o.feels_rates), own)
    return Piece(
        experiment.name,
        replace(case, own=own | read_starts(plant, case, record)),
        record,
        held_out,
        np.ones(record.size),
        driven,
        beside=tuple((reading, values) for o, reading, values in read if o.feels_rates),
        shifts=np.zeros(len(driven.edges)),
        source=experiment.name,
        clock=None if experiment.begins is None else experiment.begins - float(experiment.time[0]),
        loose=is_loose(recordings, experiment),
    )


def _rests_loaded(driven: Drive, plant: Plant) -> bool:
    """Whether what a plant rested under may be a load, as small as the zero of a monitor."""
    first = {s: driven.lines[s.name].values[0] for s in plant.inputs if s.name in driven.lines}
    shown = any(load or driven.lines[name].values[0] for name, load in driven.loads.items())
    return shown and all(abs(value) <= ZEROS * s.known_zero for s, value in first.items())


def _read(experiment: Experiment, output: str, seen: np.ndarray) -> tuple[Reading, np.ndarray]:
    """An output of an experiment: when it was read, of the samples `seen` (n,), and its values."""
    every = Reading(output, experiment.time, experiment.relative_noise.get(output))
    return every.where(seen), experiment.outputs[output][seen]


def carried(pieces: Sequence[Piece]) -> list[Piece]:
    """The pieces, each after all that was done to the plant before it without rest, as that is known by now, and from
    what the first of them started with."""
    found, previous = list(pieces), None
    row = sorted((p.clock, i) for i, p in enumerate(pieces) if p.clock is not None)
    for clock, i in row:
        piece = found[i]
        if previous is not None:
            before = _later(previous.case.protocol, (previous.clock or 0.0) - clock)
            piece = replace(piece, before=before, follows=previous.name)
            own = dict(piece.case.own) | dict(previous.case.own)
            piece = replace(piece, case=replace(piece.case, protocol=piece.driven_by(piece.shifts), own=own))
        found[i] = previous = piece
    return found


def _later(protocol: Protocol, by: float) -> Protocol:
    return Protocol(protocol.time + by, protocol.inputs)


def followed(first: Protocol, then: Protocol) -> Protocol:
    """One protocol after another; soon after the end of the last one all is as the next one begins.

    Nothing tells when it was set; whoever ends a record releases the load then.
    """
    if first.time[-1] >= then.time[0]:
        raise UserError(
            f"order: an experiment ends {first.time[-1] - then.time[0]:.3g} s after the next one begins; "
            "expected start times one after the other"
        )
    end, part = first.time[-1], np.linspace(0, 1, RELEASES + 1)[1:]
    left = (1 - part) ** 2  # the end is gentle, as where a vessel empties
    inputs = {
        name: np.concatenate([first.inputs[name], values[0] + left * (first.inputs[name][-1] - values[0]), values])
        for name, values in then.inputs.items()
    }
    released = end + part * min(RELEASED, 0.5 * (then.time[0] - end))
    return Protocol(np.concatenate([first.time, released, then.time]), inputs)


def sensor_noise(recordings: Recordings, drives: Sequence[Drive]) -> dict[str, Noise]:
    """The noise of every sensor: as bench.toml states it, else from quiet stretches of all records."""
    found = {}
    for output in recordings.fitted_outputs:
        records, read = [], []
        for experiment, driven in zip(recordings.experiments, drives, strict=True):
            seen = experiment.seen(output.name)
            if seen.any():
                seen[seen] = ~at_limit(experiment.outputs[output.name][seen])
                reading, values = _read(experiment, output.name, seen)
                read.append(values)
                records.append((reading.times, reading.evened(values), happenings(driven)))
        try:
            noise = noises.estimate(records, recordings.plant.bandwidth, _pace(recordings, drives))
        except noises.NoStretchError as problem:
            raise DataError(f"{recordings.source}: {output.name}: {problem}") from None
        if not noise.quiet:
            noise = limited(noise, [y for _, y, _ in records])
        stated = next((recordings.noise[n] for n in output.headings if n in recordings.noise), None)
        as_read = [(t, values, events) for (t, _, events), values in zip(records, read, strict=True)]
        floor = FAINTEST * max(float(np.abs(y).max()) for _, y, _ in records)
        if stated and not noise.quiet:  # the colour would be the signal's
            noise = replace(noise, correlation=0.0, white=0.0)
        if not stated:
            noise = noises.rounded(noise, noises.usual_resolution(as_read))
        found[output.name] = replace(
            noise, rms=max(stated or noise.rms, floor), freedom=np.inf if stated else noise.freedom
        )
    if not found:
        raise UserError(f"{recordings.source}: expected at least one output but no file has any")
    return found


def happenings(driven: Drive) -> np.ndarray:
    """When something happens: corners of the inputs, without those by which noise moves them before they set out."""
    time = driven.protocol.time
    moved = [_moved(driven, name) for name in driven.protocol.inputs]
    set_out = min((int(np.argmax(m)) for m in moved if m.any()), default=1)
    return np.unique(np.append(time[:1], time[max(set_out - 1, 0) :]))


def _moved(driven: Drive, name: str) -> np.ndarray:
    """Where an input is farther than noise moves it (n,) from what it begins with: of a line, a few deviations; of a
    monitor as it was read, as many as none of thousands of samples is off by chance."""
    time, values, noise = driven.protocol.time, driven.protocol.inputs[name], driven.noise.get(name, 0.0)
    if name not in driven.noisy:
        return np.asarray(np.abs(values - values[0]) > MOVED * noise)
    rest = np.median(values[time < time[0] + RESTS_AT * driven.step])
    return np.asarray(np.abs(values - rest) > LEFT_REST * noise)


def choose_held_out(recordings: Recordings) -> list[str]:
    """Experiments that resemble another one and stay inside what the others reach, so that nothing is extrapolated.

    One in HELD_SHARE, at least one where there are two. What is compared are the largest inputs, the largest and the
    mean output, and how much an experiment moves; long experiments are kept for training.
    """
    experiments = recordings.experiments
    if len(experiments) < 2:
        return []
    features = np.array([_features(e, recordings.plant) for e in experiments])
    features /= np.maximum(np.abs(features).max(axis=0), 1e-300)
    largest = set(np.argmax(features, axis=0).tolist())
    training = list(range(len(experiments)))
    chosen: list[int] = []
    for _ in range(max(1, len(experiments) // HELD_SHARE)):
        allowed = [i for i in training if i not in largest] or training
        others = {i: [j for j in training if j != i] for i in allowed}
        nearest = {i: min(float(np.linalg.norm(features[i] - features[j])) for j in others[i]) for i in allowed}
        apart = {i: min([1.0, *(float(np.linalg.norm(features[i] - features[j])) for j in chosen)]) for i in allowed}
        best = min(allowed, key=lambda i: (nearest[i] * experiments[i].time.size / max(apart[i], THE_SAME), i))
        chosen.append(best)
        training.remove(best)
    return [experiments[i].name for i in sorted(chosen)]


def _features(experiment: Experiment, plant: Plant) -> list[float]:
    """Largest inputs, largest and mean output, and the way the output goes over its range."""
    first = next(o.name for o in plant.outputs if experiment.seen(o.name).any())
    output = experiment.outputs[first][experiment.seen(first)]
    smooth = np.convolve(output, np.ones(SMOOTH) / SMOOTH, mode="valid")
    way = float(np.abs(np.diff(smooth[::SMOOTH])).sum())
    return [
        *(float(np.abs(v).max()) for v in experiment.inputs.values()),
        float(smooth.max()),
        float(smooth.mean()),
        way,
    ]


def _split(piece: Piece) -> list[Piece]:
    """A single experiment: its last part is held out."""
    times = piece.case.times
    cut = times.min() + (times.max() - times.min()) * (1 - 1 / HELD_SHARE)
    last = replace(_within(piece, cut, np.inf), name=f"{piece.name} (end)", held_out=True)
    return [replace(_within(piece, -np.inf, cut), held_out=False), last]


def _within(piece: Piece, begin: float, end: float) -> Piece:
    """What was read from `begin` on and before `end` [s]."""

    def keep(reading: Reading) -> np.ndarray:
        return (reading.times >= begin) & (reading.times < end)

    readings = tuple(r.where(keep(r)) for r in piece.case.readings)
    kept = np.concatenate([keep(r) for r in piece.case.readings])
    return replace(
        piece,
        case=replace(piece.case, readings=tuple(r for r in readings if r.times.size)),
        record=piece.record[kept],
        weight=piece.weight[kept],
        beside=tuple((r.where(keep(r)), v[keep(r)]) for r, v in piece.beside if keep(r).any()),
    )


def _beginning(piece: Piece) -> Piece:
    """A piece until LONG breakpoints have passed and every signal has been through its range; all of a shorter one.

    Its own numbers, which belong to all of it, are not known there.
    """
    protocol = piece.case.protocol
    mine = protocol.time >= piece.case.times.min()
    points = protocol.time[mine]
    if points.size <= LONG:
        return piece
    signals = [(points, values[mine]) for values in protocol.inputs.values()]
    signals += [(r.times, piece.record[part]) for r, part in zip(piece.case.readings, piece.case.parts, strict=True)]
    ends = [points[LONG]]
    for times, values in signals:
        low, high = np.quantile(values, [1 - RANGE, RANGE])
        ends += [times[np.argmax(values >= high)], times[np.argmax(values <= low)]]
    return replace(_within(piece, -np.inf, max(ends)), marginal=Marginal())
