"""The recordings as a study: pieces that take part in fits, pieces that do not, and the noise they carry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import UserError
from ..identify.data import Experiment, Recordings
from ..identify.drive import Drive, drive
from ..identify.noise import Noise
from ..identify.problem import Free, Problem
from ..identify.procedure import sensor_noise
from ..identify.response import Case, Response
from ..model.declare import Model
from ..model.effects import Effect
from .compiled import Compiled, Ids

PRIOR = 2.0  # width of the weak prior: a factor of e^2 for what is positive, twice the size for the rest
HELD_SHARE = 4  # one experiment in so many takes no part in any fit
LEAST_SAMPLES = 600  # in training: fewer tell no effect from noise


@dataclass(frozen=True)
class Piece:
    """An experiment or part of one: what drives it, what was read at `case.times`, and whether it is held out."""

    name: str
    case: Case
    record: np.ndarray
    held_out: bool
    weight: np.ndarray
    driven: Drive


@dataclass(frozen=True)
class Study:
    """All pieces, the sensor's noise, and the compiled models they are held against."""

    pieces: list[Piece]
    noise: Noise
    monitor_noise: dict[str, float]
    compiled: Compiled
    measured: str
    geometry: dict[str, float] = field(default_factory=dict)

    @property
    def training(self) -> list[Piece]:
        """The pieces that take part in fits."""
        return [p for p in self.pieces if not p.held_out]

    @property
    def held_out(self) -> list[Piece]:
        """The pieces that take part in none."""
        return [p for p in self.pieces if p.held_out]

    def response(self, ids: Ids, pieces: Sequence[Piece], *more: Effect) -> Response:
        """The model with the effects `ids` of the catalogue and `more` on some pieces."""
        return Response(self.compiled.kernel(ids, *more), [p.case for p in pieces], self.measured, self.geometry)

    def problem(self, ids: Ids, free: Sequence[Free], fixed: Mapping[str, float],
                pieces: Sequence[Piece] | None = None) -> Problem:  # fmt: skip
        """The least squares problem of the model with effects `ids` on some pieces (those in training)."""
        pieces = self.training if pieces is None else pieces
        return Problem(self.response(ids, pieces), [p.record for p in pieces], self.noise, free, fixed,
                       [p.weight for p in pieces], PRIOR if free else None)  # fmt: skip

    def weighted(self, weights: Sequence[np.ndarray]) -> Study:
        """The study with other weights of the samples, one array a piece."""
        return replace(self, pieces=[replace(p, weight=w) for p, w in zip(self.pieces, weights, strict=True)])


def study(recordings: Recordings, model: Model, held_out: Sequence[str] | None = None) -> Study:
    """A study of some recordings. `held_out` names experiments; by default they are chosen by `choose_held_out`.

    Raises `UserError` where too little is left for fits.
    """
    bench = recordings.bench
    drives = [drive(e, bench, recordings.noise) for e in recordings.experiments]
    noise = sensor_noise(recordings, drives)
    names = choose_held_out(recordings) if held_out is None else list(held_out)
    pieces = []
    for experiment, driven in zip(recordings.experiments, drives, strict=True):
        seen = experiment.seen
        whole = Piece(experiment.name, Case(driven.protocol, experiment.time[seen]), experiment.output[seen],
                      experiment.name in names, np.ones(int(seen.sum())), driven)  # fmt: skip
        pieces += [whole] if len(drives) > 1 else _split(whole)
    training = sum(p.record.size for p in pieces if not p.held_out)
    if training < LEAST_SAMPLES:
        raise UserError(
            f"{recordings.source}: {training} samples beside those held out are too few to tell an effect from noise; "
            f"expected at least {LEAST_SAMPLES}: record longer, or more experiments"
        )
    levels = {s.name: float(np.median([d.noise[s.name] for d in drives])) for s in bench.inputs}
    return Study(pieces, noise, levels, Compiled(model), bench.measured, dict(recordings.geometry))


def choose_held_out(recordings: Recordings) -> list[str]:
    """Experiments that resemble another one and stay inside what the others reach, so that nothing is extrapolated.

    One in HELD_SHARE, at least one where there are two. What is compared are the largest inputs, the largest and the
    mean output, and how much an experiment moves; long experiments are kept for training.
    """
    experiments = recordings.experiments
    if len(experiments) < 2:
        return []
    features = np.array([_features(e) for e in experiments])
    features /= np.maximum(features.max(axis=0), 1e-300)
    largest = set(np.argmax(features, axis=0).tolist())
    training = list(range(len(experiments)))
    chosen: list[int] = []
    for _ in range(max(1, len(experiments) // HELD_SHARE)):
        allowed = [i for i in training if i not in largest] or training
        others = {i: [j for j in training if j != i] for i in allowed}
        nearest = {i: min(float(np.linalg.norm(features[i] - features[j])) for j in others[i]) for i in allowed}
        apart = {i: min([1.0, *(float(np.linalg.norm(features[i] - features[j])) for j in chosen)]) for i in allowed}
        best = min(allowed, key=lambda i: (nearest[i] * experiments[i].time.size / max(apart[i], 1e-9), i))
        chosen.append(best)
        training.remove(best)
    return [experiments[i].name for i in sorted(chosen)]


def _features(experiment: Experiment) -> list[float]:
    """Largest inputs, largest and mean output, and the way the output goes over its range."""
    output = experiment.output[experiment.seen]
    smooth = np.convolve(output, np.ones(25) / 25, mode="valid")
    way = float(np.abs(np.diff(smooth[::25])).sum())
    return [
        *(float(np.abs(v).max()) for v in experiment.inputs.values()),
        float(smooth.max()),
        float(smooth.mean()),
        way,
    ]


def _split(piece: Piece) -> list[Piece]:
    """A single experiment: its last part is held out."""
    cut = round(piece.record.size * (1 - 1 / HELD_SHARE))
    parts = []
    for name, part, held in ((piece.name, slice(0, cut), False), (f"{piece.name} (end)", slice(cut, None), True)):
        case = Case(piece.case.protocol, piece.case.times[part])
        parts.append(replace(piece, name=name, case=case, record=piece.record[part], held_out=held,
                             weight=piece.weight[part]))  # fmt: skip
    return parts
