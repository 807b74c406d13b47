"""How much zeros and gains differ between files, and what all files have in common: delays and rises.

The spread of zeros is estimated together with the fit (restricted maximum likelihood by expectation and maximisation,
Laird and Ware, Biometrics 38 (1982) 963) about a mean of its own, so that an offset common to all files is left to the
effects that explain it; but for the outputs of a plant whose records start anywhere, whose zeros no rest shows: these
have what they share, too, up to COMMON_ZERO. With fewer than LEAST_FILES files the spread is the usual one that the
plant declares. Gains of monitors are treated in the same way.

The filters of monitors delay them equally in all files. This delay is estimated with the fit, up to the longest
plausible one, and corrected. So is how long the amplifier behind a monitor rises, as far as no sample shows it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg

from ..fitting.compiled import Ids
from ..fitting.fit import inverse
from ..fitting.marginal import marginal
from ..fitting.problem import Free, whitened
from ..records.start import LATEST, ZEROS, anywhere
from ..signals.colour_estimate import ROUNDED_OFF
from .linearised import Linearised, wide, windows_of
from .nuisances import DELAY_OF, GAIN_OF, RISE_OF, TURN, USUAL_DELAY, prior, size_of, usual_size
from .study import Piece, Study

# Set by judgement. Check: `pytest tests/test_adjust.py`,
# `python -m blind.score --nulls 12 --conventions monitor_zeros laser_zero --seed 1000`
LEAST_FILES = 3  # [1] files from which on a spread between them can be told

# Set by judgement: zeros of -13, -11 and -13 um had no spread, so their mean was an effect; a fourth file has 20 um.
# Check: `pytest tests/test_adjust.py -k alike`
SAME_ZERO = 0.4  # [1] chance that one more file has the zero of those before, though their spread is the usual one

# Set by judgement: no unit test tells a factor of four. Check:
# `python -m blind.score --nulls 12 --conventions monitor_zeros laser_zero --seed 1000`
ITERATIONS = 40  # [1] of expectation and maximisation

# Set by theory: nothing beside 1, and all beside it. Check: `pytest tests/test_adjust.py`
VAGUE = 1e-6  # [1] information that a mean of all files is zero, in units of its usual size, where they may tell it
FIRM = 1e6  # [1] the same where a file shows at rest that it is, or where nothing but a fit is wanted
NO_PRIOR = 1e-9  # [1] information that holds a parameter without a prior
LEAST_VARIANCE = 1e-8  # [1] between files, in units of the usual one, that it comes down to

# Set by judgement. Check: `pytest tests/test_ringing_plants.py -k amplifier`
A_JUMP = 0.1  # [1] of what is not known of a rise that no sample shows: a shorter one is none

# Set by judgement. Check: `pytest tests/test_adjust.py::test_gains_that_differ_between_files_come_out`,
# `python -m blind.score --nulls 12 --conventions monitor_gains --seed 1000`
MOST_GAIN = 6e-3  # [1] by which gains of a monitor differ between files at most
MOST_ZERO = 10.0  # [1] times the usual zero by which those of a sensor differ between files at most

# Set by convention: 95 %. Check: `pytest tests/test_zeros.py -k in_common`
COMMON_ZERO = 2.0  # [1] times its usual zero that an output has in common to all files at most, where no rest shows it


@dataclass(frozen=True)
class Common:
    """What all files of a bench have in common, by input: the delay of its monitor (samples), and how much `longer`
    its amplifier rises than was read (s)."""

    delays: dict[str, float] = field(default_factory=dict)
    longer: dict[str, float] = field(default_factory=dict)


def spreads(
    study: Study, ids: Ids, values: Mapping[str, float], linear: Sequence[Linearised], free: Sequence[Free]
) -> tuple[dict[str, float], Common]:
    """The standard deviation between files of every zero and gain by name (SI), and what files have in common.

    With few files the spreads are the usual ones.
    """
    first = study.pieces[0]
    kinds = [
        n for n in dict.fromkeys(n for p in study.pieces for n in p.nuisances.names) if usual_size(study, first, n) > 0
    ]
    kinds = [n for n in kinds if not n.startswith(RISE_OF) and (study.filtered or not n.startswith(DELAY_OF))]
    sizes = {n: size_of(study, n) for n in kinds if not n.startswith(DELAY_OF)}
    training = [(p, s) for p, s in zip(study.pieces, linear, strict=True) if not p.held_out]
    if not training or not (kinds or study.rises):
        return sizes, Common()
    problem = study.problem(ids, free, {n: v for n, v in values.items() if n not in {f.name for f in free}})
    fixed = [np.empty((p.record.size, 0)) for p, _ in training]
    if free:
        _, columns = problem.response.sensitivities(values, [f.name for f in free])
        slopes = np.array([f.slope(values[f.name]) for f in free])
        fixed = [
            whitened(p.case, c * slopes, study.noise, p.weight) for (p, _), c in zip(training, columns, strict=True)
        ]
    few = len({p.source for p, _ in training}) < LEAST_FILES
    variance, delays = _estimated(study, kinds, training, fixed, few) if kinds else (np.empty(0), {})
    found = {n: float(np.sqrt(v)) * sizes[n] for n, v in zip(kinds, variance, strict=True) if n in sizes}
    spread = {n: min(v, most_spread(study, n)) for n, v in found.items()}
    return spread, Common(delays, {name: _longer(study, name, spread, training, fixed) for name in study.rises})


def most_spread(study: Study, name: str) -> float:
    """By how much a zero, a drift or a gain differs between files at most (SI)."""
    if study.firm:
        return size_of(study, name)
    if name.startswith(GAIN_OF):
        return MOST_GAIN
    monitor = any(s.name == name for s in study.plant.inputs)
    return (ZEROS if monitor else MOST_ZERO) * size_of(study, name)


def _estimated(
    study: Study,
    kinds: Sequence[str],
    training: Sequence[tuple[Piece, Linearised]],
    fixed: Sequence[np.ndarray],
    few: bool,
) -> tuple[np.ndarray, dict[str, float]]:
    """Expectation and maximisation over the normal equations of parameters, means and every file's deviations.

    Returns variances (k,) in units of the usual ones (1 where files are `few`), and mean delays in samples.
    """
    k, p, m = len(kinds), fixed[0].shape[1], len(training)
    size = p + k + m * k
    information, target = np.zeros((size, size)), np.zeros(size)
    for i, ((piece, linear), columns) in enumerate(zip(training, fixed, strict=True)):
        own = np.column_stack(
            [
                linear.columns[:, piece.nuisances.names.index(n)] * usual_size(study, piece, n)
                if n in piece.nuisances.names
                else np.zeros(piece.record.size)
                for n in kinds
            ]
        )
        others = np.array([0.0 if n in kinds else prior(study, piece, n, {}) for n in piece.nuisances.names])
        local = marginal(windows_of(piece, linear, piece.shifts), linear.columns, others)
        together = local.apply(np.column_stack([columns, own, linear.undecided()]))
        gram = together.T @ together
        at = np.r_[0 : p + k, p + k + i * k : p + k + (i + 1) * k]
        wide = np.r_[0 : p + k, p : p + k]  # the mean and the deviation have the same columns
        information[np.ix_(at, at)] += gram[np.ix_(wide, wide)]
        target[at] -= gram[wide, -1]
    delayed = np.array([n.startswith(DELAY_OF) for n in kinds])
    known = np.array([study.delays.get(n.removeprefix(DELAY_OF), 0.0) / USUAL_DELAY for n in kinds]) * delayed
    information[range(p), range(p)] += 1 / study.prior**2 if study.prior else NO_PRIOR
    seen = np.array([not study.sought or any(_shown(piece, n) for piece, _ in training) for n in kinds])
    information[range(p, p + k), range(p, p + k)] += np.where(delayed, 1.0, np.where(seen, FIRM, VAGUE))
    together = alike(delayed)
    information[p : p + k, p : p + k] += together
    target[p : p + k] -= known + together @ known
    variance = np.where(delayed, (TURN / USUAL_DELAY) ** 2, 1.0)
    by_chance = SAME_ZERO ** (m - 1)  # so many files with the usual spread count beside them
    for _ in range(1 if few else ITERATIONS):
        penalised = information.copy()
        penalised[range(p + k, size), range(p + k, size)] += np.tile(1 / np.maximum(variance, LEAST_VARIANCE), m)
        scale = 1 / np.sqrt(np.diag(penalised))
        inverse = scipy.linalg.pinvh(penalised * np.outer(scale, scale), rtol=ROUNDED_OFF) * np.outer(scale, scale)
        solved = inverse @ target
        found, uncertainty = solved[p + k :].reshape(m, k), np.diag(inverse)[p + k :].reshape(m, k)
        if not few:
            told = np.sum(found**2 + uncertainty, axis=0)
            variance = np.where(delayed, variance, (by_chance + told) / (by_chance + m))
    if study.sought and anywhere(study.plant):  # no rest shows what the zeros of its outputs have in common
        outputs = np.array([n in study.noise for n in kinds])
        variance = variance + np.where(outputs, np.clip(solved[p : p + k], -COMMON_ZERO, COMMON_ZERO) ** 2, 0.0)
    means = np.clip((known + solved[p : p + k]) * USUAL_DELAY, 0.0, LATEST)
    return variance, {
        n.removeprefix(DELAY_OF): float(v) for n, v, is_delay in zip(kinds, means, delayed, strict=True) if is_delay
    }


def _longer(
    study: Study,
    name: str,
    spread: Mapping[str, float],
    training: Sequence[tuple[Piece, Linearised]],
    fixed: Sequence[np.ndarray],
) -> float:
    """How much longer the amplifier behind an input rises than was read [s]: the likeliest, within what samples allow.

    Edges that may be anywhere between two samples stay where they are by now: what a rise changes beyond them is told
    from there. Those that samples tell may take its place, and are where these tell. Where nothing was seen of it, a
    short rise is none.
    """
    rise, known, size = study.rises[name], study.longer.get(name, 0.0), fixed[0].shape[1] + 1
    information, target = np.zeros((size, size)), np.zeros(size)
    for (piece, linear), columns in zip(training, fixed, strict=True):
        names = piece.nuisances.names
        if f"{RISE_OF}{name}" not in names:
            continue
        own = names.index(f"{RISE_OF}{name}")
        others = np.array([prior(study, piece, n, spread) for n in names])
        others[own] = 0.0
        local = marginal(windows_of(piece, linear, piece.shifts), linear.columns, others)
        along = linear.columns[:, own] * rise.stderr
        left = linear.residual if np.any(wide(piece)) else linear.undecided()
        white = local.apply(np.column_stack([columns, along, left]))
        information += white[:, :-1].T @ white[:, :-1]
        target -= white[:, :-1].T @ white[:, -1]
    information[range(size - 1), range(size - 1)] += 1 / study.prior**2 if study.prior else NO_PRIOR
    information[-1, -1] += 1.0
    target[-1] -= known / rise.stderr
    by = known + float(inverse(information)[-1] @ target) * rise.stderr
    return 0.0 if not rise.seen and by < A_JUMP * rise.stderr else float(np.clip(by, *rise.longer))


def _shown(piece: Piece, name: str) -> bool:
    """Whether a piece shows at rest that a monitor is not off: then others have no zero in common that it lacks."""
    return name in piece.driven.zeros and float(piece.driven.protocol.inputs[name][0]) == 0.0


def alike(delayed: np.ndarray) -> np.ndarray:
    """The information (k, k) that delays of monitors, where `delayed` (k,), are alike: filters of one kind."""
    count = int(delayed.sum())
    if count < 2:
        return np.zeros((delayed.size, delayed.size))
    centred = np.diag(delayed.astype(float)) - np.outer(delayed, delayed) / count
    return (USUAL_DELAY / TURN) ** 2 * centred
