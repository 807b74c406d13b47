"""The monitors' noise: it drives the model, and must not be mistaken for an effect.

The part of a monitor's noise that cannot be separated from its signal moves the model's output slowly (a few um on a
bench). So samples at which the output is sensitive to the inputs weigh less: their variance is that of the sensor plus
that of the monitors times the squared static sensitivity, both at low frequencies, where effects are sought.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from ...identify.fitting.compiled import Ids
from ...identify.fitting.fit import NORMAL_95
from ...identify.fitting.misfit import BLOCK
from ...identify.fitting.problem import whitened
from ...identify.signals.monitors import GAUSSIAN_MAD
from ...identify.study.monitor_uncertainty import noise_sensitivities
from ...identify.study.nuisances import SMOOTH_OF, corner_squares, with_nuisances
from ...identify.study.remembered import remembers
from ...identify.study.study import Piece, Study, fastest
from ...protocol import Protocol
from ..options.residuals import block_means, expected_variance, over_blocks, sensor_squares

# Set by theory. Check: `python -m blind.score --nulls 12 --conventions rates own_protocols --seed 1000`
FOURTH = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # [1] weights of a fourth difference

# Set by judgement. Check: `python -m blind.score --nulls 12 --conventions rates own_protocols --seed 1000`
LEVELS = 13  # [1] levels of a monitor's noise that are compared
STEPS = 4.0  # [1] times the monitor's noise above which a fourth difference is a step between samples
BESIDE_STEP = 5  # [samples] about a step whose values it may have changed

# Set by theory. Check: `pytest tests/test_input_noise.py`
SECOND = np.array([1.0, -2.0, 1.0])  # [1] weights of a second difference

# Set by convention: of normal numbers 3 in 1000 are farther off. Check: `pytest tests/test_input_noise.py`
ASIDE = 3.0  # [standard deviations] of what a monitor usually bends from block to block: more is what was done

InputSensitivities = Mapping[str, list[np.ndarray]]  # of every piece (N,), by input


def weighted(study: Study, sensitivities: InputSensitivities) -> Study:
    """The study with every sample weighted by the sensor's share of its standard deviation.

    A sensor whose noise is slow has little that is new in a sample: there the monitors' fast noise counts by itself.
    """
    driven = _fast_rms(study, sensitivities)
    noise = {name: replace(n, driven=driven[name] if n.quiet and n.tau > 0 else 0.0) for name, n in study.noise.items()}
    return replace(study, noise=noise).weighted(weights(study, sensitivities))


def told_by_outputs(
    study: Study, values: Mapping[str, float], sensitivities: InputSensitivities, ids: Ids = ()
) -> Study:
    """The study with monitors' noise as large as the outputs say, between what changes from sample to sample and what
    their own records allow; `ids` are the effects that the model has.

    What moves a monitor slowly is its noise, or the plant follows it and it is a supply that wanders: only noise
    is in the outputs' residual. Averages over blocks of that tell the likelier level. What a model lacks makes them
    larger, too. So where the residual does not follow the monitor from block to block, only the changes between blocks
    count: those of what a model lacks are small.
    """
    levels = _unsure(study)
    if not levels:
        return study
    answers = study.response(ids, study.pieces).possible(values)
    left = _left_over_blocks(study, answers)
    for name in levels:
        known = study.monitor_noise
        if any(remembers(p, name) for p in study.pieces):
            told = max(levels[name], min(1.0, _at_corners(study, name, answers)) * known[name])
            study = replace(study, monitor_noise=known | {name: told})
            continue
        tried = [known | {name: float(at)} for at in np.geomspace(levels[name], known[name], LEVELS)]
        changes = not _follows(study, name, sensitivities, left)
        costs = [_block_misfit(replace(study, monitor_noise=one), sensitivities, left, changes) for one in tried]
        study = replace(study, monitor_noise=tried[int(np.argmin(costs))])
    return study


def at_least(study: Study) -> Study | None:
    """The study with monitors' noise as small as it may be: what changes from sample to sample; None where that is
    what it is."""
    levels = _unsure(study)
    return replace(study, monitor_noise=dict(study.monitor_noise) | levels) if levels else None


def _unsure(study: Study) -> dict[str, float]:
    """The least noise of the monitors whose noise may be more than what changes from sample to sample."""
    levels = {name: fastest([p.driven for p in study.pieces], name) for name in study.monitor_noise}
    return {n: levels[n] for n, level in study.monitor_noise.items() if level > levels[n] > 0 and n not in study.stated}


def bounded_by_outputs(study: Study, values: Mapping[str, float]) -> Study:
    """The study with monitors' noise no larger than what moves the outputs by their whole error: the rest of what
    changes from sample to sample is signal (light behind clouds). Stated noise is known, and a fit may take most of
    the error that remembered noise makes."""
    caused, answers = caused_rms(study, values), study.response((), study.pieces).possible(values)
    squares: dict[str, list[np.ndarray]] = {name: [] for name in study.noise}
    for piece, answer in zip(study.pieces, answers, strict=True):
        if answer is None:  # held out, and beyond a fold of the refitted base
            continue
        for reading, rows in zip(piece.case.readings, piece.case.parts, strict=True):
            squares[reading.output].append((answer - piece.record)[rows] ** 2)
    errors = _roots(squares)
    share = min([1.0, *(errors[name] / caused[name] for name in errors if caused[name] > 0)])
    fixed = {n for n in study.monitor_noise if n in study.stated or any(remembers(p, n) for p in study.pieces)}
    levels = {n: level if n in fixed else share * level for n, level in study.monitor_noise.items()}
    return replace(study, monitor_noise=levels)


def _at_corners(study: Study, name: str, answers: Sequence[np.ndarray | None]) -> float:
    """The remembered noise of a monitor (rms) as the outputs tell it at corners, in units of what it is taken for: a
    step of expectation and maximisation."""
    squares = []
    for piece, answer in zip(study.pieces, answers, strict=True):
        if answer is not None and not piece.held_out:
            squares.append(corner_squares(study, piece, name, answer))
    told = np.concatenate([np.empty(0), *squares])  # none where only what is held out has corners
    return float(np.sqrt(np.mean(told))) if told.size else 1.0


def _left_over_blocks(study: Study, answers: Sequence[np.ndarray | None]) -> list[np.ndarray | None]:
    """What answers of the model leave of each record, with all that the monitors' noise moves, whitened by the sensor's
    noise and averaged over blocks (B,); None of what is held out or has no answer."""
    return [
        None
        if piece.held_out or answer is None
        else block_means(
            whitened(piece.case, with_nuisances(study, piece, answer, SMOOTH_OF) - piece.record, study.noise), [piece]
        )
        for piece, answer in zip(study.pieces, answers, strict=True)
    ]


def _block_misfit(
    study: Study, sensitivities: InputSensitivities, residuals: Sequence[np.ndarray | None], changes: bool
) -> float:
    """Minus twice the log likelihood of the training's residual, averaged over blocks, or of its changes from block to
    block, with the study's noise."""
    found = 0.0
    for piece, left, weight in zip(study.pieces, residuals, weights(study, sensitivities), strict=True):
        if left is None:
            continue
        variance = over_blocks(expected_variance(study, replace(piece, weight=weight), BLOCK) / weight**2)
        squares = np.diff(left) ** 2 if changes else left**2
        if changes:
            variance = variance[1:] + variance[:-1]
        found += float(np.sum(squares / variance + np.log(variance)))
    return found


def _follows(
    study: Study, name: str, sensitivities: InputSensitivities, residuals: Sequence[np.ndarray | None]
) -> bool:
    """Whether the residual follows what moves a monitor slowly, as it does where that is its noise.

    What is done to the plant moves it, too: how it bends from block to block is compared, and rare bends are left out.
    Where usual ones are more than noise can be, nothing is told, and it may.
    """
    lines, moved, bends = [], [], []
    for number, (piece, left) in enumerate(zip(study.pieces, residuals, strict=True)):
        if left is None:
            continue
        line = np.concatenate([piece.case.protocol.at(r.times)[name] for r in piece.case.readings])
        scaled = whitened(piece.case, sensitivities[name][number] * (line - line.mean()), study.noise)
        lines.append(np.diff(over_blocks(line), 2))
        moved.append(np.diff(block_means(scaled, [piece]), 2))
        bends.append(np.diff(left, 2))
    if not lines:
        return True
    bent, x, y = (np.concatenate(each) for each in (lines, moved, bends))
    usual = GAUSSIAN_MAD * float(np.median(np.abs(bent))) if bent.size else 0.0
    kept = np.abs(bent) < ASIDE * usual
    squares = float(x[kept] @ x[kept])
    if usual > study.monitor_noise[name] * np.sqrt(SECOND @ SECOND / BLOCK) or squares == 0:
        return True
    share = float(x[kept] @ y[kept]) / squares
    uncertainty = float(np.linalg.norm((y - share * x)[kept]) / np.sqrt(squares * np.count_nonzero(kept)))
    return share > NORMAL_95 * uncertainty


def weights(study: Study, sensitivities: InputSensitivities) -> list[np.ndarray]:
    """The weight of every sample (N,), one array a piece: the sensor's share of its standard deviation."""
    result = []
    for i, piece in enumerate(study.pieces):
        slow = np.concatenate([np.full(r.times.size, study.noise[r.output].slow) for r in piece.case.readings])
        added = sum(
            (study.monitor_noise[name] ** 2 + _between_samples(study, piece, name) ** 2) * moved[i] ** 2
            for name, moved in sensitivities.items()
        )
        result.append(1 / np.sqrt(1 + added / slow**2))
    return result


def allowed_rms(study: Study) -> dict[str, float]:
    """The rms of what every output [SI] is allowed to be off: its noise, and what the weights of its samples add."""
    squares: dict[str, list[np.ndarray]] = {name: [] for name in study.noise}
    for piece in study.pieces:
        for reading, rows in zip(piece.case.readings, piece.case.parts, strict=True):
            squares[reading.output].append((study.noise[reading.output].slow / piece.weight[rows]) ** 2)
    return _roots(squares)


def _roots(squares: Mapping[str, list[np.ndarray]]) -> dict[str, float]:
    """The root mean squares by output, of parts of squares (each (n,)); none for an output without a part."""
    return {name: float(np.sqrt(np.mean(np.concatenate(parts)))) for name, parts in squares.items() if parts}


def _between_samples(study: Study, piece: Piece, name: str) -> np.ndarray:
    """How far an input may be from its line between two samples (N,), at and beside every sample.

    A sixth of the fourth differences: half of a step that fell between two samples, and nothing of a curve that many
    samples show. Switchings are known better.
    """
    signal = next(s for s in study.plant.inputs if s.name == name)
    if signal.held or signal.band_limited or any(e.input == name for e in piece.driven.edges):
        return np.zeros(piece.record.size)
    found = []
    for reading in piece.case.readings:
        line = piece.case.protocol.at(reading.times)[name]
        jerk = np.abs(np.convolve(np.pad(line, 2, mode="edge"), FOURTH, mode="valid")) / 6
        found.append(maximum_filter1d(np.where(jerk > STEPS * study.monitor_noise[name], jerk, 0.0), BESIDE_STEP))
    return np.concatenate(found)


def caused_rms(study: Study, values: Mapping[str, float], seed: int = 0) -> dict[str, float]:
    """The rms that the monitors' noise causes in every output [SI]: what one draw of it moves the base model.

    A line follows of white noise what its corners do.
    """
    random, cases = np.random.default_rng(seed), []
    for piece in study.pieces:
        protocol = piece.case.protocol
        share = float(np.sqrt(min(1.0, np.unique(protocol.time).size / piece.record.size)))
        noise = {
            n: share * level * random.standard_normal(protocol.time.size) for n, level in study.monitor_noise.items()
        }
        inputs = {n: v + noise.get(n, 0.0) for n, v in protocol.inputs.items()}
        cases += [piece.case, replace(piece.case, protocol=Protocol(protocol.time, inputs))]
    answers = study.asked((), cases).possible(study.shared(values))
    moved: dict[str, list[np.ndarray]] = {name: [] for name in study.noise}
    for piece, still, noisy in zip(study.pieces, answers[::2], answers[1::2], strict=True):
        if still is not None and noisy is not None:
            for reading, rows in zip(piece.case.readings, piece.case.parts, strict=True):
                moved[reading.output].append((noisy - still)[rows])
    return {n: float(np.sqrt(np.mean(np.concatenate(parts) ** 2))) if parts else 0.0 for n, parts in moved.items()}


def unweighted(study: Study, ids: Ids, values: Mapping[str, float]) -> float:
    """The squares that a model leaves of the training records over those that sensors' noise makes, and what monitors'
    noise causes, where samples at which inputs switch weigh as all others do.

    What an input did between two samples is not known, so these weigh less in fits: a supply that falls slowly may hide
    there. Where instants are fitted, noise alone is left there, too.
    """
    caused = caused_rms(study, values)
    read = [
        (r.times.size, caused[r.output] / study.noise[r.output].total) for p in study.training for r in p.case.readings
    ]
    expected = sum(count * (1 + driven**2) for count, driven in read)
    return sensor_squares(study, ids, values, study.noise) / expected


def _fast_rms(study: Study, sensitivities: InputSensitivities) -> dict[str, float]:
    """The rms in every output [SI] of noise that changes from sample to sample, up to the plant's own bandwidth.

    Lines with few corners follow little of it.
    """
    total: dict[str, list[float]] = {name: [0.0, 0.0] for name in study.noise}
    for i, piece in enumerate(study.pieces):
        for reading, rows in zip(piece.case.readings, piece.case.parts, strict=True):
            step = reading.clock.step
            share = min(1.0, 2 * study.plant.bandwidth * step)
            squares = sum(float(np.sum((_followed(piece, n) * g[i][rows]) ** 2)) for n, g in sensitivities.items())
            total[reading.output][0] += share * squares
            total[reading.output][1] += reading.times.size
    return {name: float(np.sqrt(squares / max(count, 1))) for name, (squares, count) in total.items()}


def _followed(piece: Piece, name: str) -> float:
    """The noise of a monitor that its line follows."""
    corners = piece.driven.corners.get(name, np.empty(0)).size
    return piece.driven.noise[name] * float(np.sqrt(min(1.0, corners / piece.record.size)))


def input_sensitivities(study: Study, values: Mapping[str, float], ids: Ids = ()) -> InputSensitivities:
    """How far noise of each monitor moves the outputs of every piece: output over input, each (N,)."""
    response = study.response(ids, study.pieces)
    noisy = [name for name, level in study.monitor_noise.items() if level > 0]
    return {name: noise_sensitivities(response, values, name, study.pieces) for name in noisy}
