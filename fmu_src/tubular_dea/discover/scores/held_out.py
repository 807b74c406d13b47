"""The choice of held-out experiments: they should confirm effects, and leave enough data to find them.

Every effect's columns, at the declared parameters and the middle of its shapes, show how its change is distributed over
the experiments. The held-out experiments should contain about a share HELD of it, for as many candidates as possible,
and the training data most of it. Without them, the uncertainty of the base's own parameters should increase only
little.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...identify.fitting.compiled import Ids
from ...identify.study.study import HELD_SHARE, Study
from ...kernel import KernelError
from ...model.effect import Effect
from . import bank
from .parameters import base_parameters

# Set by judgement. Check: `pytest tests/test_acceptance.py tests/test_rounds.py`,
# `python -m blind.score --singles 2 --seed 1000`
HELD = 0.2  # [1] share of what a candidate changes: enough to confirm it, and more is missed where it is to be found
HELD_MOST = 0.3  # [1] share of all samples that may be held out together
HELD_LONG = 0.2  # [1] share of all samples that may be held out in one experiment: long ones are kept for fits
FEWEST_HELD_FROM = 3  # [1] experiments from which on one is held out by its information
DEAR = 0.5  # [log standard error] that a parameter may lose for a candidate that is confirmed

# Set by judgement: else a ramp of 4 kV is held out, which costs nothing because it tells nothing.
# Check: `pytest tests/test_rounds.py -k held`, `python -m blind.score --singles 2 --seed 1000`
AS_GOOD = 0.05  # [1] of worth: of experiments that are as good, the one that confirms most candidates is held out,
AS_DEAR = 0.15  # [1] of worth: if it costs little more of the parameters' information than the best


@dataclass(frozen=True)
class _Information:
    """The share of each candidate's change that lies in each piece (m, pieces); Fisher information (pieces, k, k)."""

    shares: np.ndarray
    information: np.ndarray

    def confirmed(self, chosen: list[int]) -> float:
        """The share of the candidates that the pieces `chosen` confirm."""
        return float(np.mean(np.minimum(self.shares[:, chosen].sum(axis=1), HELD))) / HELD

    def worth(self, chosen: list[int]) -> float:
        """The value of holding out the pieces `chosen`: candidates confirmed, less candidates and information lost."""
        lost = float(np.mean(np.maximum(self.shares[:, chosen].sum(axis=1) - HELD, 0))) / (1 - HELD)
        return self.confirmed(chosen) - lost - self.dear(chosen)

    def dear(self, chosen: list[int]) -> float:
        """What the parameters lose by holding out the pieces `chosen`, in units of worth."""
        rest = [i for i in range(len(self.information)) if i not in chosen]
        return float(np.mean(self._errors(rest) - self._errors(range(len(self.information))))) / DEAR

    def _errors(self, pieces: list[int] | range) -> np.ndarray:
        """Logarithms of the parameters' standard errors from some pieces (with a prior of 1)."""
        total = self.information[list(pieces)].sum(axis=0) + np.eye(self.information.shape[1])
        return 0.5 * np.log(np.diag(np.linalg.inv(total)))


def with_held_out(study: Study, shown: Ids = (), needed: Collection[str] = ()) -> Study:
    """The study with held-out pieces chosen by their information, so that they confirm the effects `shown` (all of the
    catalogue without any); unchanged where the model cannot be solved yet, and where no piece is long or short enough.

    The pieces `needed` take part in fits.
    """
    if len(study.pieces) < FEWEST_HELD_FROM:
        return study
    try:
        information = _information(study, [study.catalogue[i] for i in shown] or None)
    except KernelError:
        return study
    chosen: list[int] = []
    sizes = [p.record.size for p in study.pieces]
    for _ in range(max(1, len(study.pieces) // HELD_SHARE)):
        room = HELD_MOST * sum(sizes) - sum(sizes[i] for i in chosen)
        most = min(room, HELD_LONG * sum(sizes))
        rest = [i for i, p in enumerate(study.pieces) if sizes[i] <= most and i not in chosen and p.name not in needed]
        if not rest:
            break
        worth = {i: information.worth([*chosen, i]) for i in rest}
        best = max(rest, key=lambda i: (worth[i], -i))
        dear = information.dear([*chosen, best]) + AS_DEAR
        good = [i for i in rest if worth[i] > worth[best] - AS_GOOD and information.dear([*chosen, i]) <= dear]
        chosen.append(max(good, key=lambda i: (information.confirmed([*chosen, i]), -i)))
    if not chosen:
        return study
    return replace(study, pieces=[replace(p, held_out=i in chosen) for i, p in enumerate(study.pieces)])


def _information(study: Study, effects: Sequence[Effect] | None) -> _Information:
    everyone = replace(study, pieces=[replace(p, held_out=False) for p in study.pieces])
    values = study.plant.model.parameter_values()
    problem = everyone.problem((), base_parameters(study.plant), {})
    residual, jacobian = problem.linearised(problem.scaled(values))
    ends = np.cumsum([p.record.size for p in study.pieces])
    parts = np.split(jacobian[: ends[-1]], ends[:-1])
    listed = bank.candidates_at(everyone, values, residual.size, effects=effects, points=bank.middle_point)
    squares = np.array([[np.sum(part**2) for part in np.split(c.columns[: ends[-1]], ends[:-1])] for c in listed])
    shares = squares / np.maximum(squares.sum(axis=1, keepdims=True), 1e-300)
    return _Information(shares, np.array([part.T @ part for part in parts]))
