"""The noise of a monitor where the plant remembers it: a carriage goes on from where a force has moved it.

Elsewhere slow noise moves an output by a static gain, which the weights of samples count. What an integrator makes of
noise is a random walk: it has no static gain, and is alike from sample to sample. There the course of the noise over a
record, as a line with corners, is a nuisance parameter for each of these, with its own change of the output. What such
a line leaves of white noise is drawn once, and is what the weights count. A model that would need far more noise at a
corner than there is misses something: beside it, noise is counted by a static gain there too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ...protocol import Protocol
from ..fitting.cases import Case
from ..fitting.compiled import Ids
from .study import Piece, Study

# Set by judgement: what is left between corners is less than a sensor's noise. Check: `pytest tests/test_remembered.py`
MOST_CORNERS = 129  # [1] of the line that a monitor's noise is over a record
BETWEEN_CORNERS = 8  # [samples] from one to the next at least

# Set by judgement. Check: `pytest tests/test_remembered.py -k rest`
REMEMBERED = 0.5  # [1] of what noise at one corner changes, as sum of squares, that comes after a while
AFTER = 0.1  # [1] of a record until then
SEEN = 4.0  # [squared standard deviations] that noise at all corners changes, or nobody sees it
LEAST_CORNERS = 16  # [1] of a record that tells what is remembered
ASKED = 0.25  # [1] of the corners: the one at which that is asked

# Set by theory: a least squares line with a corner at every n samples of white noise varies by sqrt(3) / n there.
# Check: `pytest tests/test_remembered.py -k every_corner`
AT_CORNER = 3.0**0.25  # [1] standard deviation at a corner over that of a mean of n samples

# Set by judgement: small against any curvature. Check: `pytest tests/test_remembered.py`
PUSH = 4e-3  # [1] of an input's largest value: the noise whose effect is taken, where it is no less

NOISE_OF, LEFT_OF = "noise ", "noise beside "  # names of a monitor's noise at corners, by number, and of the rest of it


def pushes(study: Study, ids: Ids, values: Mapping[str, float], piece: Piece) -> list[tuple[str, Case, float]]:
    """By name, the cases in which a monitor's line is moved at one corner, and by how much [SI], for every corner of
    every monitor whose noise the plant remembers; and that with the rest of such noise."""
    found = []
    for name, level in study.monitor_noise.items():
        if level > 0 and _remembers(study, ids, values, piece, name):
            found += [(f"{NOISE_OF}{k} {name}", *_pushed(piece, name, level, k)) for k in range(corners(piece).size)]
            found.append((f"{LEFT_OF}{name}", *_with_the_rest(piece, name, level)))
    return found


def spread_at_corner(study: Study, piece: Piece, name: str) -> float:
    """The standard deviation [SI] of a monitor's noise at a corner, `name` being its number and that of the monitor;
    0 for the rest of it, which is not estimated."""
    number, monitor = name.split(" ", 1)
    samples = np.diff(corners(piece))[0] / piece.driven.step
    return AT_CORNER * study.monitor_noise[monitor] / float(np.sqrt(samples)) if number.isdigit() else 0.0


def left_between(piece: Piece, name: str) -> np.ndarray | None:
    """What noise of an input changes beside what its corners can change, per noise of a sample (N,) [SI], rms over each
    output; None where corners are no nuisance parameters of the piece."""
    if not remembers(piece, name):
        return None
    columns, line = piece.nuisances.columns, piece.nuisances.columns[:, at_corners(piece, name)]
    changed = columns[:, piece.nuisances.names.index(f"{LEFT_OF}{name}")]
    changed = changed - line @ np.linalg.lstsq(line, changed, rcond=None)[0]
    return np.concatenate([np.full(rows.stop - rows.start, _rms(changed[rows])) for rows in piece.case.parts])


def remembers(piece: Piece, name: str = "") -> bool:
    """Whether noise of a monitor, or of any, is estimated at corners."""
    names = [own.removeprefix(LEFT_OF) for own in piece.nuisances.names if own.startswith(LEFT_OF)]
    return any(np.any(piece.nuisances.sd[at_corners(piece, n)] > 0) for n in names if name in ("", n))


def at_corners(piece: Piece, name: str) -> np.ndarray:
    """Which nuisance parameters (k,) of a piece are the noise of a monitor at corners."""
    line = {f"{NOISE_OF}{k} {name}" for k in range(MOST_CORNERS)}
    return np.array([own in line for own in piece.nuisances.names], dtype=bool)


def corners(piece: Piece) -> np.ndarray:
    """The corners' times (c,) [s], from the first sample to the last."""
    instants = piece.case.instants
    first, last = float(instants[0]), float(instants[-1])
    return np.linspace(first, last, min(MOST_CORNERS, int((last - first) / piece.driven.step / BETWEEN_CORNERS) + 1))


def _remembers(study: Study, ids: Ids, values: Mapping[str, float], piece: Piece, name: str) -> bool:
    """Whether most of what the noise of an input changes at one corner, a quarter into the record, comes much later,
    and what it changes at all of them could be seen."""
    places = corners(piece)
    if places.size < LEAST_CORNERS:
        return False
    asked = int(ASKED * places.size)
    pushed, step = _pushed(piece, name, study.monitor_noise[name], asked)
    here, there = study.asked(ids, [piece.case, pushed]).possible(values)
    if here is None or there is None:
        return False
    later = places[asked + 1] + AFTER * (places[-1] - places[0])
    squares = np.array([0.0, 0.0])
    for reading, rows in zip(piece.case.readings, piece.case.parts, strict=True):
        changed = (there - here)[rows] ** 2 / study.noise[reading.output].slow ** 2
        squares += [changed.sum(), changed[reading.times > later].sum()]
    walked = squares[0] * (spread_at_corner(study, piece, f"{asked} {name}") / step) ** 2 * places.size
    return bool(walked > SEEN and squares[1] > REMEMBERED * squares[0])


def _pushed(piece: Piece, name: str, level: float, number: int) -> tuple[Case, float]:
    """The case with the line of an input, which has noise of a `level` [SI], moved at one corner, and by how much."""
    protocol, places = piece.case.protocol, corners(piece)
    for time in places[max(number - 1, 0) : number + 2]:
        protocol = protocol.with_time(float(time))
    part = np.interp(protocol.time, places, np.arange(places.size) == number)
    return _moved(piece, protocol, name, level, part)


def _with_the_rest(piece: Piece, name: str, level: float) -> tuple[Case, float]:
    """The case with noise of an input beside its line, one draw, and the noise of a sample [SI].

    Its recorded line follows of white noise what its own corners do.
    """
    protocol, places = piece.case.protocol, corners(piece)
    share = np.sqrt(min(1.0, np.unique(protocol.time).size / piece.record.size))
    noise = share * np.random.default_rng(0).standard_normal(protocol.time.size)
    line = np.stack([np.interp(protocol.time, places, row) for row in np.eye(places.size)], axis=1)
    return _moved(piece, protocol, name, level, noise - line @ np.linalg.lstsq(line, noise, rcond=None)[0])


def _moved(piece: Piece, protocol: Protocol, name: str, level: float, part: np.ndarray) -> tuple[Case, float]:
    """The case with a small multiple of `part` (n,) added to an input of the protocol, and that multiple [SI]: where it
    is at rest, as much as the noise, since a smaller one would change nothing but digits."""
    step = max(PUSH * float(np.abs(protocol.inputs[name]).max()), level)
    inputs = protocol.inputs | {name: protocol.inputs[name] + step * part}
    return replace(piece.case, protocol=Protocol(protocol.time, inputs)), step


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
