"""Was it there to be found? What a hidden thing leaves after everything else has followed it, by the bench's own tube.

The nine parameters and the numbers of what else is hidden follow by least squares; so do a zero and a gain of every
monitor in every file and the laser's zero, as far as a laboratory's usually are, and what was done to the tube before a
file that begins in the middle. What is small after that cannot be found by anybody, however good.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import PPoly
from scipy.optimize import least_squares

from blind.effects import EVERYTHING
from blind.laboratory import File, Laboratory
from blind.recordings import GAIN, LASER, ZEROS, step
from blind.tubes import BurstError, Drive, Tube, rising

CLEAR = 100.0  # squared, in units of the noise: ten of its standard deviations
FORM = 0.02  # of the stronger of two: no law of a catalogue is exactly the tube's
SAMPLES = 20_000  # of a set that are compared, at most
TOL = 1e-7  # of tube.c
NUDGE, FOLLOWS = 5e-4, 24  # relative move of the differences, and rounds of the least squares
FARTHEST = (0.02, 50.0)  # times what was drawn: what else a tube may be
BEFORE = (0.02, 0.2, 2.0)  # s before a file that begins in the middle: what the tube remembers of
LOAD = 3e3  # Pa, in each of these spans, that nobody knows of


def there(lab: Laboratory) -> bool:
    """Whether everything that is hidden can be found."""
    sizes = [signature(lab, name) for name in lab.tube.hidden]
    return min(sizes) > max(CLEAR, FORM * max(sizes) if len(sizes) > 1 else 0.0)


def imitated(lab: Laboratory, names: list[str]) -> bool:
    """Whether effects of the catalogue do what is hidden, to within what could be found."""
    known = [n for n in names if n in EVERYTHING]
    middle = {n: tuple(float(np.mean(ends)) for ends in EVERYTHING[n].ranges) for n in known}
    bare = replace(lab.tube, hidden=middle)
    return _left(lab, bare) < max(CLEAR, FORM * signature(lab, *lab.tube.hidden))


def signature(lab: Laboratory, *names: str) -> float:
    """How far these move the readings where nothing else can follow, squared, in units of the noise."""
    bare = lab.tube
    for name in names:
        bare = bare.without(name)
    return _left(lab, bare)


def _left(lab: Laboratory, start: Tube) -> float:
    """What is left between the readings and those of the best tube like `start`."""
    target = [radius for radius, _ in lab.truth]
    nuisance = _nuisances(lab)

    def left(shares: np.ndarray) -> np.ndarray:
        try:
            readings = lab.readings(_scaled(start, shares), TOL)
        except BurstError:
            return np.full(total, 1e3)
        parts = []
        for number, ((radius, _), true) in enumerate(zip(readings, target, strict=True)):
            white = np.append(_white(lab, number, radius - true), np.zeros(nuisance[number].shape[1]))
            parts.append(white - nuisance[number] @ (nuisance[number].T @ white))
        return np.concatenate(parts)

    total = sum(len(n) for n in nuisance)
    shares = np.ones(len(_numbers(start)))
    return 2 * float(
        least_squares(left, shares, x_scale="jac", diff_step=NUDGE, bounds=FARTHEST, max_nfev=FOLLOWS).cost
    )


def _nuisances(lab: Laboratory) -> list[np.ndarray]:
    """Of every file, an orthonormal basis of what its zeros and gains do to it; the rows below are their priors."""
    base = [radius for radius, _ in lab.readings(tol=TOL)]
    moves = []
    for quantity in ("pressure", "voltage"):
        for zero, gain, size in ((1.0, 0.0, ZEROS[quantity]), (0.0, 1.0, GAIN)):
            drives = tuple(_moved(d, quantity, zero * size, gain * size) for d in lab.drives)
            moved = replace(lab, drives=drives).readings(tol=TOL)
            moves.append([radius - b for (radius, _), b in zip(moved, base, strict=True)])
    for reach in BEFORE:
        drives = tuple(_loaded(d, next(f for f in lab.files if f.drive == n), reach) for n, d in enumerate(lab.drives))
        moved = replace(lab, drives=drives).readings(tol=TOL)
        moves.append([radius - b for (radius, _), b in zip(moved, base, strict=True)])
    found = []
    for number, radius in enumerate(base):
        columns = [move[number] for move in moves] + [np.full(radius.size, ZEROS["radius"])]
        white = np.column_stack([_white(lab, number, column) for column in columns])
        found.append(np.linalg.qr(np.vstack([white, np.eye(len(columns))]))[0])
    return found


def _moved(drive: Drive, quantity: str, zero: float, gain: float) -> Drive:
    """The drive where a monitor has a zero and a gain of its own."""
    signal: PPoly = getattr(drive, quantity)
    c = signal.c * (1 + gain)
    c[-1] += zero
    return replace(drive, **{quantity: PPoly(c, signal.x)})


def _loaded(drive: Drive, first: File, reach: float) -> Drive:
    """The drive with more pressure before its first file, if that begins in the middle."""
    span = (max(drive.start, first.begin - reach), first.begin)
    if first.start != "unknown" or span[0] >= span[1]:
        return drive
    grid = np.unique(np.concatenate([drive.pressure.x, span]))
    c = rising(drive.pressure, grid).T[::-1].copy()
    c[-1, (grid[:-1] >= span[0]) & (grid[:-1] < span[1])] += LOAD
    return replace(drive, pressure=PPoly(c, grid), hard=np.unique(np.concatenate([drive.hard, span])))


def _white(lab: Laboratory, number: int, difference: np.ndarray) -> np.ndarray:
    """A file's difference in units of its noise, each value independent of the others."""
    c, file = lab.conventions, lab.files[number]
    keep = c.colour ** (c.rates[0] / file.rate) if c.colour else 0.0
    rms = np.hypot(c.noise * LASER, step("radius", c) / np.sqrt(12))
    white = (difference[1:] - keep * difference[:-1]) / np.sqrt(1 - keep**2) / rms
    thin = max(1, sum(f.times.size for f in lab.files) // SAMPLES)
    return white[::thin] * np.sqrt(thin)


def _numbers(tube: Tube) -> list[float]:
    return [*tube.identified.values(), *(v for values in tube.hidden.values() for v in values)]


def _scaled(tube: Tube, shares: np.ndarray) -> Tube:
    """The tube with each of its numbers multiplied by its share."""
    numbers = iter(np.array(_numbers(tube)) * shares)
    identified = {name: next(numbers) for name in tube.identified}
    return replace(
        tube, identified=identified, hidden={n: tuple(next(numbers) for _ in v) for n, v in tube.hidden.items()}
    )
