"""What each record has of its own, as nuisance parameters: how they change the output, and how large they usually are.

Zeros of sensors and monitors differ between files by an unknown amount, and so do gains of monitors, about 1. The
filters of monitors delay them by a part of a sample, and as channels are sampled in turn, each also has a small unknown
delay or lead. How long an amplifier rises is known as well as samples on its way tell.

The mean of neighbouring samples has less noise than each. A delay of half a sample takes such a mean, and a lag another
one, so both explain noise of a monitor that drives the model. How far the mean of a sample's neighbours replaces it is
therefore a nuisance parameter, too, where effects are sought: what it leaves to a delay is odd in time. Noise that is
slower than a sample does the same over longer means, and is taken for a slower lag or a friction that it cannot move;
so where a monitor shows such noise, means over ever more samples are. Elsewhere it would smooth the signal along with
the noise. There, what a sensor drifts within a file is one instead.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Legendre

from ...kernel import KernelError
from ...protocol import Protocol
from ..fitting.cases import Case, Reading
from ..fitting.compiled import Ids
from ..fitting.marginal import Marginal
from ..fitting.problem import whitened
from ..inputs.drive import MIDWAY
from ..signals import hum as hums
from .instants import TOLD, bounds, reach, samples_behind
from .monitor_uncertainty import shifted
from .remembered import NOISE_OF, at_corners, pushes, spread_at_corner
from .study import Nuisances, Piece, Study

# Set by judgement. Check: `pytest tests/test_ringing_plants.py`
LASTS = 0.1  # [1] of what an edge's instant changes, as sum of squares, that comes after the next edge: then it lasts
MOST_LASTING = 2e6  # [samples] simulated at most for a record's edges that are estimated together
EDGE_STEP = 0.25  # [1] of the way to the farther bound: step of a difference quotient

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions antialias --seed 1000`
USUAL_DELAY = 0.5  # [samples] by which filters against aliasing usually make monitors late
TURN = 0.1  # [samples] by which channels are usually apart that are read in turn

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions monitor_gains --seed 1000`
GAIN = 2e-3  # [1] by which gains of a monitor usually differ between files

# Set by judgement. Check: `pytest tests/test_adjust.py::test_gains_that_differ_between_files_come_out`,
# `python -m blind.score --nulls 12 --conventions monitor_gains --seed 1000`
ZERO_LEFT = 0.1  # [1] of a zero that is usually left where it was seen at rest and taken off

# Set by judgement. Check: `python -m blind.score --nulls 12 --conventions start --seed 1000`
START_SPREAD = 1.0  # [1] of a start's usual size: prior of what is not known of it

# Set by theory: the mean of neighbours has less noise, so that a third of a sample is best replaced by it.
# Check: `pytest tests/test_adjust.py -k noise_of_a_monitor`
SMOOTHER = 0.5  # [1] share by which the mean of its neighbours usually replaces a sample

# Set by theory: the mean of two neighbours leaves a third of the noise, but takes a curve's bend for noise; the cubic
# through seven samples (Savitzky and Golay, Anal. Chem. 36 (1964) 1627) leaves as much and takes none.
# Check: `pytest tests/test_adjust.py -k leaves_a_curve`
SMOOTHERS = (np.array([0.5, 0, 0.5]), np.array([-2, 3, 6, 7, 6, 3, -2]) / 21)  # [1] weights of samples in a row

# Set by measurement: of 1/f noise of 27 Pa at 1 kHz, 64 leaves a lag of 0.5 s, 256 none. Check:
# `pytest tests/test_coloured_monitors.py`
STRIDES = (4, 16, 64, 256)  # [samples] between those that the cubic goes through beside noise slower than a sample,
OF_A_RECORD = 0.25  # [1] if they are in this share of a record

# Set by theory: 1 in 400. Check: `pytest tests/test_adjust.py -k step_stays`
BY_NOISE = 3.0  # [standard deviations] by which noise moves a sample off what smooths it

# Set by theory. Check: `pytest tests/test_edges.py -k clock_of_its_own`
EVENLY = float(np.sqrt(3.0))  # [1] half the width over the standard deviation of what is as likely anywhere in it

# Set by judgement: wide beside any. Check: `python -m blind.score --nulls 12 --conventions hum --seed 1000`
HUM_SIZE = 10.0  # [1] times the noise: prior of the amplitude of a line at mains frequency

# Set by judgement. Check: `python -m blind.score --nulls 12 --conventions drift --seed 1000`
DRIFTS = 5  # [1] polynomials that a drift within a file is made of
USUAL_DRIFT = 0.1  # [1] of the usual zero by which each of them usually drifts: 3 um for the tube's laser

# Names of what a monitor has of its own beside its zero.
GAIN_OF, DELAY_OF, SMOOTH_OF = "gain of ", "delay of ", "smooth "
RISE_OF = "rise of "  # name of how much longer the amplifier behind a monitor rises than its samples tell
BEGUN_OF = "begun "  # name of when an input that moves from the first sample on began to
SENT_OF = "sent "  # name of when an input with a clock of its own was sent
DRIFT_OF = "drift "  # names of a sensor's drifts within a file, by number
EDGE_OF = "edge "  # name of an edge's instant, by its number, where what it changes lasts
HUM_OF, START_OF = "hum ", "start "  # names of waves at mains frequency, by number, and of what a record starts from


def with_columns(study: Study, ids: Ids, values: Mapping[str, float], piece: Piece) -> Piece | None:
    """The piece with the columns of its nuisance parameters at the present model; None where that has no answer.

    They are in SI units, but those of starts, and of neighbours' means, in usual sizes.

    Near a fold it may have none with a nuisance parameter moved: that one is left out there.
    """
    columns: list[np.ndarray] = []
    names: list[str] = []
    rows = piece.case.parts
    for reading, part in zip(piece.case.readings, rows, strict=True):
        if study.zero(reading.output) > 0:
            names.append(reading.output)
            columns.append(_placed(piece, part, np.ones(reading.times.size)))
            for name, drift in _drifts(study, reading):
                names.append(name)
                columns.append(_placed(piece, part, drift))
        for number, wave in enumerate(hums.waves(study.noise[reading.output].hum, reading.times).T):
            names.append(f"{HUM_OF}{number} {reading.output}")
            columns.append(_placed(piece, part, wave))
    cases = [(s.name, *shifted(piece.case, s.name)) for s in study.plant.inputs if study.zero(s.name) > 0]
    monitors = [s.name for s in study.plant.inputs if s.known_zero > 0]
    cases += [(f"{GAIN_OF}{name}", _amplified(piece.case, name), GAIN) for name in monitors]
    cases += [(f"{DELAY_OF}{name}", *_delayed(piece, name)) for name in monitors]
    switching = {e.input for e in piece.driven.edges}
    cases += [(f"{RISE_OF}{name}", *_widened(piece, name)) for name in piece.driven.rises if name in switching]
    cases += [(f"{BEGUN_OF}{name}", *_begun_earlier(piece, name)) for name, sd in piece.driven.begun.items() if sd > 0]
    cases += [(f"{SENT_OF}{name}", _earlier(piece, name, by), by) for name, by in piece.driven.room.items()]
    if study.sought:
        cases += [smooth for s in study.plant.inputs if s.linear for smooth in _smoothers(study, piece, s.name)]
    cases += pushes(study, ids, values, piece) if study.remembering else []
    switched = _lasting_edges(study, ids, values, piece)
    asked = [*(c for _, c, _ in cases), *(m.case for m in switched)]
    here, *others = study.asked(ids, [piece.case, *asked]).possible(values)
    if here is None:
        return None
    changes = [np.zeros(here.size) if answer is None else answer - here for answer in others]
    for (name, _, step), change in zip(cases, changes, strict=False):
        names.append(name)
        columns.append(change / step)
    started = start_columns(study, ids, values, piece)
    names += [f"{START_OF}{name}" for name in study.unknown(ids, piece)]
    columns += list(started.T)
    for group, change in zip(switched, changes[len(cases) :], strict=True):
        for number, step in group.steps.items():
            names.append(f"{EDGE_OF}{number}")
            columns.append(np.where(group.samples[number], change, 0.0) / step)
    table = np.column_stack(columns) if columns else np.empty((piece.record.size, 0))
    return replace(piece, nuisances=Nuisances(tuple(names), table, np.zeros(len(names))))


def start_columns(study: Study, ids: Ids, values: Mapping[str, float], piece: Piece) -> np.ndarray:
    """What each unknown start changes per usual size of it (N, k); nothing where that has no answer.

    Derivatives, not difference quotients: a twist that scales with its start and five parameters changes nothing, of
    which a step of 5 % leaves what looks as if these were determined.
    """
    sizes = study.unknown(ids, piece)
    none = np.zeros((piece.record.size, len(sizes)))
    if not sizes:
        return none
    own = dict.fromkeys(sizes, 0.0) | dict(piece.case.own)
    try:
        _, (columns,) = study.asked(ids, [replace(piece.case, own=own)]).sensitivities(values, list(sizes))
    except KernelError:
        return none
    return columns * np.array([*sizes.values()])


def _drifts(study: Study, reading: Reading) -> list[tuple[str, np.ndarray]]:
    """By name, the forms (n,) in which a sensor may drift within a file: smooth ones, to 1 at its ends.

    None where effects are sought, one of which a drift may be.
    """
    if study.sought:
        return []
    first, last = reading.times[[0, -1]]
    over = 2 * (reading.times - first) / ((last - first) or 1.0) - 1
    return [(f"{DRIFT_OF}{k} {reading.output}", Legendre.basis(k)(over)) for k in range(1, DRIFTS + 1)]


@dataclass(frozen=True)
class _Moved:
    """A `case` in which some edges have moved: by number, how far each [s], and the samples (N,) that it moves."""

    case: Case
    steps: Mapping[int, float]
    samples: Mapping[int, np.ndarray]


def _lasting_edges(study: Study, ids: Ids, values: Mapping[str, float], piece: Piece) -> list[_Moved]:
    """The cases that tell what every edge's instant changes, if that lasts beyond the next edge; none otherwise.

    Edges move in one case whose responses are over before the next of them comes, as the first one's tells.
    """
    edges, (first, last) = piece.driven.edges, np.array([r.times[[0, -1]] for r in piece.case.readings]).T
    order = [  # a part of a file has switchings of the whole file
        number
        for number in np.argsort([e.time for e in edges], kind="stable").tolist()
        if first.min() <= edges[number].latest and edges[number].earliest < last.max()
    ]
    if len(order) < 2:
        return []
    probe = _moved(piece, order[:1])
    here, there = study.asked(ids, [piece.case, probe.case]).possible(values)
    if here is None or there is None or not probe.steps:
        return []
    seen, rows = piece.case.readings[0], piece.case.parts[0]
    told = np.cumsum((there - here)[rows] ** 2)
    by_the_next = told[seen.times <= edges[order[1]].latest]
    if told[-1] - (by_the_next[-1] if by_the_next.size else 0.0) <= LASTS * told[-1]:
        return []
    over = seen.times[min(int(np.searchsorted(told, TOLD * told[-1])), told.size - 1)] - edges[order[0]].earliest
    groups = _apart(piece, order, float(over))
    if len(groups) * piece.record.size > MOST_LASTING:
        return []
    return [_moved(piece, group) for group in groups]


def _apart(piece: Piece, order: Sequence[int], over: float) -> list[list[int]]:
    """The edges, in their order, in as few groups as have at least `over` [s] from each edge to the next."""
    groups: list[list[int]] = []
    for number in order:
        begins = piece.driven.edges[number].earliest
        free = (g for g in groups if piece.driven.edges[g[-1]].earliest + over < begins)
        group = next(free, None)
        if group is None:
            groups.append([number])
        else:
            group.append(number)
    return groups


def _moved(piece: Piece, numbers: Sequence[int]) -> _Moved:
    """The case in which these edges, in the order of time, have moved towards their farther bounds."""
    low, high = bounds(piece)
    ends = np.array([low, high]) - piece.shifts
    steps = EDGE_STEP * np.where(np.abs(ends[0]) > np.abs(ends[1]), *ends)
    chosen = np.isin(np.arange(steps.size), numbers)
    case = replace(piece.case, protocol=piece.driven_by(np.where(chosen, piece.shifts + steps, piece.shifts)))
    samples = {}
    for number, following in zip(numbers, [*numbers[1:], None], strict=True):
        samples[number] = np.zeros(piece.record.size, dtype=bool)
        for reading in range(len(piece.case.readings)):
            samples[number][samples_behind(piece, number, [] if following is None else [following], reading)] = True
    return _Moved(case, {n: float(steps[n]) for n in numbers if steps[n] != 0.0}, samples)


def step_of(piece: Piece) -> float:
    """The time between samples of the monitors [s]."""
    return piece.driven.step


def _amplified(case: Case, name: str) -> Case:
    """The case with one of its inputs scaled by the usual error of a gain."""
    inputs = case.protocol.inputs
    return replace(case, protocol=Protocol(case.protocol.time, inputs | {name: inputs[name] * (1 + GAIN)}))


def _delayed(piece: Piece, name: str) -> tuple[Case, float]:
    """The case with one of its inputs a little earlier, and by how much [s]: an edge that passes a sample is a kink."""
    by = TURN * step_of(piece)
    return _earlier(piece, name, by), by


def _earlier(piece: Piece, name: str, by: float) -> Case:
    """The case with one of its inputs earlier [s]."""
    return replace(piece.case, protocol=piece.case.protocol.with_delay(name, -by))


def _widened(piece: Piece, name: str) -> tuple[Case, float]:
    """The case with edges of one of its inputs longer by the uncertainty of their rise, and that time [s]."""
    by = piece.driven.rises[name].stderr
    wider = replace(piece, longer=dict(piece.longer) | {name: piece.longer.get(name, 0.0) + by})
    return replace(piece.case, protocol=wider.driven_by(piece.shifts)), by


def _begun_earlier(piece: Piece, name: str) -> tuple[Case, float]:
    """The case with one of its inputs begun earlier by the uncertainty of that, and that time [s]."""
    by = piece.driven.begun[name]
    earlier = replace(piece, driven=piece.driven.begun_later(name, -by))
    return replace(piece.case, protocol=earlier.driven_by(piece.shifts)), by


def _smoothers(study: Study, piece: Piece, name: str) -> list[tuple[str, Case, float]]:
    """The nuisance parameters, with their cases, that smooth one of the inputs."""
    samples = float(np.ptp(piece.case.times)) / step_of(piece)
    cubic = SMOOTHERS[-1]
    strides = [s for s in STRIDES if s * (cubic.size - 1) < OF_A_RECORD * samples] if name in study.coloured else []
    smoothers = [*((w, 1) for w in SMOOTHERS), *((cubic, stride) for stride in strides)]
    return [(f"{SMOOTH_OF}{name} {w.size // 2 * by}", _smoothed(study, piece, name, w, by), 1.0) for w, by in smoothers]


def _smoothed(study: Study, piece: Piece, name: str, weights: np.ndarray, stride: int = 1) -> Case:
    """The case with one of its inputs smoothed by `weights` of samples a `stride` apart, the middle one its own, as far
    as noise moves it: a step stays one."""
    protocol, by, reach = piece.case.protocol, stride * step_of(piece), weights.size // 2
    changes = {k: float(w) - (k == 0) for k, w in enumerate(weights, -reach)}
    moved = protocol.delayed({str(k): (name, k * by) for k in changes if k})
    here = moved.inputs[name]
    off = sum(change * (moved.inputs[str(k)] if k else here) for k, change in changes.items())
    most = BY_NOISE * float(np.linalg.norm([*changes.values()])) * study.monitor_noise.get(name, np.inf)
    smooth = here + np.clip(off, -most, most)
    inputs = {n: smooth if n == name else moved.inputs[n] for n in protocol.inputs}
    return replace(piece.case, protocol=Protocol(moved.time, inputs).simplified())


def _placed(piece: Piece, part: slice, values: np.ndarray) -> np.ndarray:
    column = np.zeros(piece.record.size)
    column[part] = values
    return column


def prior(study: Study, piece: Piece, name: str, spread: Mapping[str, float]) -> float:
    """The prior standard deviation of a nuisance parameter (SI); the usual one where no `spread` is known."""
    if name in spread:
        return spread[name] * left_of(study, piece, name)
    kinds: dict[str, Callable[[str], float]] = {
        EDGE_OF: lambda number: reach(piece.driven.edges[int(number)]),
        BEGUN_OF: lambda name: piece.driven.begun[name],
        SENT_OF: lambda name: piece.driven.room[name] / EVENLY,
        HUM_OF: lambda name: HUM_SIZE * study.noise[name.split(" ", 1)[1]].rms,
        NOISE_OF: lambda name: spread_at_corner(study, piece, name),
        DELAY_OF: lambda name: (MIDWAY if name in piece.driven.unheld else TURN) * step_of(piece),
        SMOOTH_OF: lambda name: SMOOTHER,
        START_OF: lambda name: START_SPREAD,
    }
    kind = next((k for k in kinds if name.startswith(k)), None)
    return usual_size(study, piece, name) if kind is None else kinds[kind](name.removeprefix(kind))


def usual_size(study: Study, piece: Piece, name: str) -> float:
    """The usual size of a zero, a gain, a delay or a rise (SI); 0 for the other nuisance parameters."""
    if name.startswith((SMOOTH_OF, BEGUN_OF, SENT_OF, NOISE_OF)):
        return 0.0
    if name.startswith(RISE_OF):
        return study.rises[name.removeprefix(RISE_OF)].stderr
    return (
        USUAL_DELAY * step_of(piece)
        if name.startswith(DELAY_OF)
        else size_of(study, name) * left_of(study, piece, name)
    )


def size_of(study: Study, name: str) -> float:
    """The usual size of a zero, a drift or a gain where nothing was taken off at rest (SI)."""
    if name.startswith(DRIFT_OF):
        return USUAL_DRIFT * study.zero(name.split(" ", 2)[2])
    return GAIN if name.startswith(GAIN_OF) else study.zero(name)


def left_of(study: Study, piece: Piece, name: str) -> float:
    """The share of a zero that is left in a piece: what was taken off may have been a load."""
    if name not in piece.driven.zeros:
        return 1.0
    load = piece.driven.loads.get(name, 0.0)
    return max(ZERO_LEFT, load / study.zero(name)) if load else ZERO_LEFT


def zero_spread(study: Study, name: str) -> float:
    """By how much zeros of a signal differ between files (SI, rms): what was taken off at rest, and what is left."""
    files = list({p.source: p for p in study.pieces}.values())
    taken = [p.driven.zeros[name] for p in files if name in p.driven.zeros]
    left = study.spread[name] * np.array([left_of(study, p, name) for p in files])
    return float(np.hypot(np.std(taken) if taken else 0.0, np.sqrt(np.mean(left**2))))


def with_nuisances(study: Study, piece: Piece, answer: np.ndarray, without: str = "") -> np.ndarray:
    """A model's output (N,) for a piece, corrected by the most likely values of its nuisance parameters, `without` some
    kind of them: without `NOISE_OF` it goes as far astray as any model that is driven by what was recorded.

    Edges are where they likely were, and no delay beside is a straight line there: it would draw spikes.
    """
    if not piece.nuisances.names:  # none are known before a first fit
        return answer
    own = likeliest(study, piece, answer, without_delays(piece, piece.nuisances.sd))
    if without:
        own = np.where([n.startswith(without) for n in piece.nuisances.names], 0.0, own)
    return answer + piece.nuisances.columns @ own


def own_numbers(study: Study, ids: Ids, values: Mapping[str, float]) -> list[tuple[Piece, dict[str, float]]]:
    """The pieces at which the model with effects `ids` has an answer, with their likeliest nuisance parameters by name
    (SI)."""
    answers = study.response(ids, study.pieces).possible(study.shared(values))
    return [
        (piece, dict(zip(piece.nuisances.names, map(float, likeliest(study, piece, answer)), strict=True)))
        for piece, answer in zip(study.pieces, answers, strict=True)
        if answer is not None
    ]


def corner_squares(study: Study, piece: Piece, name: str, answer: np.ndarray) -> np.ndarray:
    """The expected squares (c,) of a monitor's noise at its corners, in units of their prior's variance, for which a
    model has the output `answer` (N,): of the likeliest noise, and of what is not known of it."""
    mine, sd = at_corners(piece, name), piece.nuisances.sd
    own = likeliest(study, piece, answer)[mine] / np.where(sd > 0, sd, 1.0)[mine]
    return own**2 + share_unknown(study, piece)[mine] ** 2


def share_unknown(study: Study, piece: Piece) -> np.ndarray:
    """What a record leaves unknown of its nuisance parameters (k,): standard deviations over those of their priors."""
    sd = piece.nuisances.sd
    columns = whitened(piece.case, piece.nuisances.columns, study.noise, piece.weight)
    columns = Marginal(piece.marginal.windows).apply(columns)[:, sd > 0] * sd[sd > 0]
    left = np.zeros(sd.size)
    squares, turned = np.linalg.eigh(columns.T @ columns)
    left[sd > 0] = np.sqrt(turned**2 @ (1 / (1 + np.maximum(squares, 0.0))))
    return left


def likeliest(study: Study, piece: Piece, answer: np.ndarray, sd: np.ndarray | None = None) -> np.ndarray:
    """The most likely values (k,) of the nuisance parameters of a piece, for which a model has the output `answer`
    (N,); their priors are `sd` (k,), if they are others."""
    residual = whitened(piece.case, answer - piece.record, study.noise, piece.weight)
    columns = whitened(piece.case, piece.nuisances.columns, study.noise, piece.weight)
    local = Marginal(piece.marginal.windows)
    return piece.nuisances.mean(local.apply(columns), local.apply(residual), piece.nuisances.sd if sd is None else sd)


def without_delays(piece: Piece, sd: np.ndarray) -> np.ndarray:
    """The priors (k,) without delays of inputs with edges, by which to tell their instants.

    A delay moves all edges of an input alike, which their instants do as well. What many share would be taken for one,
    and their instants would come near the likeliest ones only little by little.
    """
    switched = {f"{DELAY_OF}{e.input}" for e in piece.driven.edges}
    return np.where([n in switched for n in piece.nuisances.names], 0.0, sd)
