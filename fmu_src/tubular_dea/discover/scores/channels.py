"""Fault isolation: the channel that explains a residual best, by a latent input in each.

A latent input is any smooth function of the signals of its channel. A plant may define its own (`Plant.latent`);
otherwise it is the span of the channel's candidates. It is a set of linear terms with a score statistic like that of
any candidate (`bank`). Channels are compared by Akaike's criterion, as none of the functions is exactly the true one.

An external disturbance is no function of recorded signals. Its channel shows in where the residual is large: where the
plant's response to a wave in that channel is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...identify.fitting.compiled import Ids
from ...identify.fitting.fit import Fit
from ...identify.fitting.misfit import BLOCK, block_sums, parts
from ...identify.fitting.problem import whitened
from ...identify.inputs.drive import joined
from ...identify.study.study import Piece, Study
from ...protocol import Protocol
from . import bank
from .bank import Candidate

# Set by judgement. Check: `python -m blind.score --external 12 --seed 1000`
RECORDED_SHARE = 0.5  # [1] share of what is not noise that recorded signals explain, else a disturbance is looked for
WAVE_SHARE = 0.005  # [1] of an input's size: a small wave
WAVE_POINTS = 16  # [1] points a period with which it is drawn
SPANNED = 1e-3  # [1] of the largest singular value: directions below are the others again
DEAF = 1e-9  # [standard deviations] by which a wave moves no sample more where it does not reach the sensor
FREQUENCY_STEP = 0.25  # [1] of the distance of two frequencies that a record resolves,
FREQUENCY_REACH = 4.0  # [1] of these steps to both sides of the rough frequency, in which the strongest is sought
FREQUENCY_PLACES = 81  # [1] frequencies there that are compared


@dataclass(frozen=True)
class Isolation:
    """The channel with the most evidence (Akaike: half the score statistic less the number of terms), and all evidence.

    `statistics` are the score statistics of the channels. `disturbance` is True where functions of recorded signals
    explain little and the channel was found from where the residual is large.
    """

    channel: str
    evidence: dict[str, float]
    statistics: dict[str, float]
    disturbance: bool


def isolate(study: Study, ids: Ids, fitted: Fit, excess: float, known: Sequence[Candidate] = ()) -> Isolation | None:
    """The channel in which the residual of `fitted` arises; `excess` is its misfit beyond noise.

    `known` are the catalogue's candidates at `fitted`, if they were computed before.
    """
    latent = list(study.plant.latent.values())
    listed = list(known) if known and not latent else bank.candidates(study, fitted, ids, latent or None)
    if not listed:
        return None
    basis, _ = np.linalg.qr(fitted.jacobian)
    left = fitted.residual - basis @ (basis.T @ fitted.residual)
    statistics, terms = {}, {}
    for channel in dict.fromkeys(c.effect.channel for c in listed):
        statistics[channel], terms[channel] = _score_statistic(
            [c for c in listed if c.effect.channel == channel], basis, left
        )
    evidence = {channel: 0.5 * statistics[channel] - terms[channel] for channel in statistics}
    best = max(evidence, key=lambda c: evidence[c])
    if statistics[best] >= RECORDED_SHARE * excess:
        return Isolation(best, evidence, statistics, False)
    outside = disturbance(study, ids, fitted)
    return Isolation(max(outside, key=lambda c: outside[c]), outside, statistics, True)


def _score_statistic(listed: Sequence[Candidate], basis: np.ndarray, left: np.ndarray) -> tuple[float, int]:
    """The joint score statistic of some candidates, and its degrees of freedom."""
    columns = np.column_stack([c.columns for c in listed])
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    columns -= basis @ (basis.T @ columns)
    directions, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    kept = directions[:, sizes > SPANNED * sizes.max(initial=0.0)]
    return float(np.sum((kept.T @ left) ** 2)), kept.shape[1]


def disturbance(study: Study, ids: Ids, fitted: Fit) -> dict[str, float]:
    """Log likelihood ratio, by channel, of an unrecorded disturbance that enters there.

    The disturbance is a wave at the residual's strongest frequency, with its own amplitude and phase in every piece.
    One that enters at an input reaches the sensor through the plant's response at that frequency.
    """
    pieces = study.training
    residuals = parts(fitted.residual, [p.record for p in pieces])
    frequency = _strongest(residuals, pieces)
    result: dict[str, float] = {}
    ways = [(study.plant.outputs[0].channel, ""), *((s.channel or s.name, s.name) for s in study.plant.inputs)]
    for channel, name in ways:
        statistic = 0.0
        for piece, residual in zip(pieces, residuals, strict=True):
            columns = np.column_stack(_swings(study, ids, fitted, piece, name, frequency))
            white = piece.marginal.apply(whitened(piece.case, columns, study.noise, piece.weight))
            basis, _ = np.linalg.qr(white / np.maximum(np.linalg.norm(white, axis=0), 1e-300))
            statistic += float(np.sum((basis.T @ residual) ** 2)) if np.abs(white).max() > DEAF else 0.0
        result[channel] = 0.5 * statistic
    return result


def _strongest(residuals: Sequence[np.ndarray], pieces: Sequence[Piece]) -> float:
    """The frequency [Hz] with the most power in the residuals of some pieces together."""
    means = block_sums(residuals)
    step = BLOCK * pieces[0].case.readings[0].clock.step
    power = np.abs(np.fft.rfft(means - means.mean())) ** 2
    rough = float(np.fft.rfftfreq(means.size, step)[1 + int(np.argmax(power[1:]))])
    resolved = FREQUENCY_STEP / (step * means.size)
    places = np.linspace(-FREQUENCY_REACH, FREQUENCY_REACH, FREQUENCY_PLACES)
    grid = np.maximum(rough + resolved * places, 0.5 * resolved)
    found = np.zeros(grid.size)
    for piece, part in zip(pieces, residuals, strict=True):
        found += np.abs(np.exp(-2j * np.pi * np.outer(grid, piece.case.times)) @ part) ** 2 / part.size
    return float(grid[int(np.argmax(found))])


def _swings(study: Study, ids: Ids, fitted: Fit, piece: Piece, name: str, frequency: float) -> list[np.ndarray]:
    """The change of the reading (N,) by a small wave of the input `name` ("": of the sensor), in two phases; none where
    the model has no answer, as close to a fold."""
    phases = (0.0, 0.5 * np.pi)
    if not name:
        return [np.sin(2 * np.pi * frequency * piece.case.times + phase) for phase in phases]
    cases = [
        piece.case,
        *(replace(piece.case, protocol=_waved(study, piece, name, frequency, phase)) for phase in phases),
    ]
    still, *waved = study.asked(ids, cases).possible(fitted.values)
    return [np.zeros(piece.record.size) if w is None or still is None else w - still for w in waved]


def _waved(study: Study, piece: Piece, name: str, frequency: float, phase: float) -> Protocol:
    """The protocol with a small wave added to an input; one that is held is modulated in proportion."""
    protocol = piece.case.protocol
    fine = np.arange(protocol.time[0], protocol.time[-1], 1 / (WAVE_POINTS * frequency))
    names = list(protocol.inputs)
    fitting = joined([(protocol.time, protocol.inputs[n]) for n in names] + [(fine, fine)], [*names, "fine"])
    inputs = {n: fitting.inputs[n] for n in names}
    held = next(s.held for s in study.plant.inputs if s.name == name)
    size = inputs[name] if held else float(np.abs(inputs[name]).max())
    inputs[name] = inputs[name] + WAVE_SHARE * size * np.sin(2 * np.pi * frequency * fitting.time + phase)
    return Protocol(fitting.time, inputs)
