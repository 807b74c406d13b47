"""What all files have in common beside the model: how late filters make monitors, how long amplifiers rise.

Both are estimated together with the parameters (`spreads`), and are held in a fit: what they would take from an effect
if they were fitted with it is not seen there. Here they are columns beside the fit's own, each with its prior, for
what a detection limit and an interval have to count. The rest of each record's own numbers stays integrated out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..fitting.fit import Fit, inverse
from ..fitting.marginal import Marginal, beside_windows
from ..fitting.problem import whitened
from .nuisances import DELAY_OF, RISE_OF, usual_size
from .spreads import alike
from .study import Study

# Set by judgement: beyond any that the records tell. Check: `pytest tests/test_common_nuisances.py`
FOLLOWED = 1e3  # [standard deviations] of the noise that a switching instant takes of what it can, once it is estimated


@dataclass(frozen=True)
class CommonNuisances:
    """Common nuisance parameters of the training pieces: their whitened `columns` (N, c) in units of their priors.

    `held` are the marginals with which a fit whitens each piece of `rows` samples, `free` those without what is common.
    """

    held: tuple[Marginal, ...]
    free: tuple[Marginal, ...]
    rows: tuple[int, ...]
    columns: np.ndarray

    def apply(self, white: np.ndarray) -> np.ndarray:
        """Columns of a fit (N + rows of the prior, k) as they are beside the common ones, (N + rows + c, k)."""
        parts = np.split(white, np.cumsum(self.rows))
        moved = [f.apply(h.undone(part)) for h, f, part in zip(self.held, self.free, parts[:-1], strict=True)]
        return np.concatenate([*moved, parts[-1], np.zeros((self.columns.shape[1], white.shape[1]))])

    def beside(self, jacobian: np.ndarray) -> np.ndarray:
        """The jacobian (N + rows, k) of a fit with the common columns behind it, (N + rows + c, k + c)."""
        count = self.columns.shape[1]
        below = np.pad(self.columns, ((0, len(jacobian) - len(self.columns)), (0, 0)))
        return np.hstack([self.apply(jacobian), np.concatenate([below, np.eye(count)])])

    def widened(self, best: Fit, counted: Fit) -> Fit:
        """The fit with a covariance and standard errors that include what is common, and what was `counted` before.

        The parameters stay as they are; how far they would move beside what is common counts as uncertainty too.
        """
        if not self.columns.shape[1]:
            return counted
        k, beside = len(best.names), self.beside(best.jacobian)
        together = inverse(beside.T @ beside)[:k]
        moved = together @ (beside.T @ self.apply(best.residual[:, None])[:, 0])
        wider = together[:, :k] - inverse(best.jacobian.T @ best.jacobian) + np.outer(moved, moved)
        return counted.with_covariance(counted.covariance + wider)


def common_nuisances(study: Study, followed: bool = False, zeros: bool = False) -> CommonNuisances:
    """What the training pieces have in common, as it was estimated last.

    `followed`: switching instants take all that they can, as when they are estimated before an effect is sought.
    `zeros`: every signal has a zero in common too, of the usual size, which an offset of it would be.
    """
    plant = study.plant
    measured = {*(s.name for s in plant.inputs), *(o.name for o in plant.outputs)} if zeros else set()
    all_names = dict.fromkeys(n for p in study.training for n in p.nuisances.names)
    names = [n for n in all_names if n in measured or _common(study, n)]
    same = {n for n in names if n.startswith(RISE_OF)}
    free, parts = [], []
    for piece in study.training:
        known, windows = piece.nuisances.names, piece.marginal.windows
        white = whitened(piece.case, piece.nuisances.columns, study.noise, piece.weight)
        if followed:
            windows = tuple(replace(w, size=FOLLOWED) for w in windows)
        own = beside_windows(windows, white, np.where([n in same for n in known], 0.0, piece.nuisances.sd))
        mine = [known.index(n) if n in known else -1 for n in names]
        here = np.array([usual_size(study, piece, n) if i >= 0 else 0.0 for n, i in zip(names, mine, strict=True)])
        free.append(own)
        with_none = np.pad(white, ((0, 0), (0, 1)))  # the last column is that of what a record does not have
        parts.append(own.apply(with_none[:, mine] * here))
    delayed = np.array([n.startswith(DELAY_OF) for n in names], dtype=bool)
    prior = np.linalg.cholesky(inverse(np.eye(len(names)) + alike(delayed)))
    rows = tuple(p.record.size for p in study.training)
    return CommonNuisances(tuple(p.marginal for p in study.training), tuple(free), rows, np.concatenate(parts) @ prior)


def _common(study: Study, name: str) -> bool:
    """Whether a nuisance parameter has a part that is estimated for all files together: the rise of an amplifier, and
    the delay of a filter. One that was found to be none may be hidden by what is late behind the sensor."""
    return name.startswith(RISE_OF) or (study.filtered and name.startswith(DELAY_OF))
