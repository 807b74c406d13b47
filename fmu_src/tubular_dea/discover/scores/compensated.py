"""What an effect changes once the model's parameters have made up for it as far as they can.

What they leave of it is linear in what it changes only as long as they hardly move. A damper that grows with the
stretch is mostly a larger damper: seen from the damper of the fit, 320 are left of one; from the smaller damper that
goes with it, 23. So where parameters have far to move, they are moved, and what is left is taken from there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...identify.fitting.fit import Fit
from ...identify.study.common_nuisances import CommonNuisances
from ...identify.study.study import Study
from ...identify.threads import side_by_side
from ...kernel import Kernel, KernelError
from .bank import Candidate
from .parameters import all_off

Strength = Mapping[str, float]  # by parameter, from off (SI)

# Set by measurement: what is curved is one to three times the square of the step times the column's length, and an
# effect has to score 7 squared. Of a pressure gain of 10 %, 340 long, parameters move by 0.17: 33 squared seem to be
# left, and 0.5 squared are.
# Check: `pytest tests/test_compensated.py`
MOST_CURVED = 0.5  # [standard deviations] of a column that may be curved in a step, where the linear model is taken
FARTHEST_STEP = 1.0  # [1] that is taken at once, at most: a factor of e
MOST_MOVES = 4  # [1] that are taken at most
NOT_TOLD = 1e-8  # [1] of the largest singular value: parameters do not move in directions below


def step_towards(jacobian: np.ndarray, changed: np.ndarray, count: int, size: float) -> np.ndarray | None:
    """How far the first `count` numbers of a fit move to make up for `changed` (N,), by its `jacobian` (N, k); None
    where it is so little that what is left of a column as long as `size` is linear in it."""
    step = np.clip(-np.linalg.lstsq(jacobian, changed, rcond=NOT_TOLD)[0][:count], -FARTHEST_STEP, FARTHEST_STEP)
    return step if np.max(np.abs(step), initial=0.0) ** 2 * size > MOST_CURVED else None


class Compensation:
    """What parameters make up for, around the fit of a model without effects.

    The fit is what it is: sought are the parameters that a tube with the effect has if it fits the recordings best.
    """

    def __init__(self, study: Study, fitted: Fit, common: CommonNuisances) -> None:
        self.fitted, self.common, self.catalogue = fitted, common, study.catalogue
        self.problem = study.problem((), fitted.free, fitted.values)
        self.kernels = study.compiled.scorers((), None)
        self.basis, self.triangle = np.linalg.qr(common.beside(fitted.jacobian))

    def of(self, chords: Mapping[str, Candidate], strengths: Mapping[str, Strength]) -> dict[str, Candidate]:
        """The chords (one column each, of the whole effect), taken anew where parameters have far to move."""
        far = {name: step for name, chord in chords.items() if (step := self._step(chord.columns)) is not None}
        distinct = {id(self.kernels[name]): self.kernels[name] for name in far}
        alone = side_by_side(lambda kernel: self.outputs(kernel, self.fitted.values), distinct.values())
        before = dict(zip(distinct, alone, strict=True))
        moved = side_by_side(lambda n: self.moved(chords[n], strengths[n], before[id(self.kernels[n])])[1], far)
        return dict(chords) | {n: replace(chords[n], columns=c) for n, c in zip(far, moved, strict=True)}

    def moved(
        self, chord: Candidate, strength: Strength, before: Sequence[np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """The parameters (k,) with the effect, and its column (N, 1); `before` are the outputs without it. As far as
        the model has an answer."""
        scaled, column = self.fitted.scaled, chord.columns
        effect = {n: chord.effect.off[n] + value for n, value in strength.items()}
        for _ in range(MOST_MOVES):
            step = self._step(column)
            if step is None:
                break
            further = self.problem.inside(scaled + step)
            values = self.problem.values(further) | chord.shape | effect
            try:
                after = self.outputs(self.kernels[chord.effect.id], values)
            except KernelError:
                break
            white = self.problem.whiten([a - b for a, b in zip(after, before, strict=True)])
            pulled = (self.problem.pulled(further) - self.problem.pulled(self.fitted.scaled))[:, 0]
            scaled, column = further, np.concatenate([white, pulled])[:, None]
        return scaled, column

    def outputs(self, kernel: Kernel, values: Mapping[str, float]) -> list[np.ndarray]:
        """What a model with many effects reads, all off but for `values` (SI)."""
        off = all_off(kernel.model.effects, self.catalogue)
        return self.problem.response.by(kernel).outputs_alone(off | dict(values))

    def _step(self, column: np.ndarray) -> np.ndarray | None:
        """The next one (k,); None where the linear model is exact enough."""
        across = self.basis.T @ self.common.apply(column)[:, 0]
        return step_towards(self.triangle, across, self.fitted.scaled.size, float(np.linalg.norm(column)))
