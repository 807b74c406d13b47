"""A windkessel fitted to one record, and how much its residual says."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from ...identify.fit import goodness, inverse, rmse
from .candidates import CANDIDATES, modelled, unknowns
from .records import PRESSURE, Record

Ids = tuple[str, ...]


@dataclass(frozen=True)
class Fitted:
    """A windkessel with `effects` on one record: parameters and standard errors by name, the residual (n,) [mmHg]."""

    record: Record
    effects: Ids
    values: dict[str, float]
    stderr: dict[str, float]
    residual: np.ndarray

    def squares(self, held_out: bool = False) -> float:
        """Sum of squares over the training part, or the held-out one."""
        return float(np.sum(self.residual[self.record.training != held_out] ** 2))

    def goodness(self, held_out: bool = False) -> float:
        """The paper's goodness of fit [%] over the training part, or the held-out one."""
        part = self.record.training != held_out
        p = self.record.pressure[part]
        return goodness([p], [p - self.residual[part]])

    def rmse(self, held_out: bool = False) -> float:
        """Root mean square error [Pa] over the training part, or the held-out one."""
        part = self.record.training != held_out
        return PRESSURE * rmse([self.residual[part]], [np.zeros(int(part.sum()))])

    def independent(self) -> float:
        """How many independent samples the training residual is worth: by the integral of its correlation to zero."""
        r = self.residual[self.record.training]
        power = np.abs(np.fft.rfft(r - r.mean(), 2 * r.size)) ** 2
        correlation = np.fft.irfft(power)[: r.size]
        correlation /= correlation[0]
        until = int(np.argmax(correlation <= 0)) or r.size
        return float(r.size / (1 + 2 * np.sum(correlation[1:until])))

    def si(self) -> dict[str, float]:
        """All parameters of the declared model (`model.afterload`) in SI units."""
        values = {u.name: self.values[u.name] * u.si for u in unknowns(self.record, self.effects)}
        for name in self.effects:
            values |= CANDIDATES[name].on(self.record)
        return values


def fit_record(record: Record, effects: Ids, start: Mapping[str, float] | None = None) -> Fitted:
    """Bounded least squares on the training part, from the usual values or from `start` where it names them."""
    free = unknowns(record, effects)
    low, high, size = (np.array([getattr(u, a) for u in free]) for a in ("low", "high", "size"))
    first = np.array([(start or {}).get(u.name, u.start) for u in free])

    def residual(x: np.ndarray) -> np.ndarray:
        values = {u.name: float(v) for u, v in zip(free, x, strict=True)}
        return record.pressure - modelled(record, effects, values)

    found = least_squares(lambda x: residual(x)[record.training], np.clip(first, low + 1e-6 * size, high - 1e-6 * size),
                          bounds=(low, high), x_scale=size)  # fmt: skip
    values = {u.name: float(x) for u, x in zip(free, found.x, strict=True)}
    fitted = Fitted(record, effects, values, {}, residual(found.x))
    variance = 2 * found.cost / max(fitted.independent() - len(free), 1.0)
    errors = np.sqrt(variance * np.diag(inverse(found.jac.T @ found.jac)))
    return dataclasses.replace(fitted, stderr={u.name: float(e) for u, e in zip(free, errors, strict=True)})


def on_whole_records(fits: Sequence[Fitted]) -> list[Fitted]:
    """The same models fitted to whole records: what is reported beside the held-out figures, and exported."""
    whole = [dataclasses.replace(f.record, training=np.full(f.residual.size, True)) for f in fits]
    return [fit_record(r, f.effects, f.values) for r, f in zip(whole, fits, strict=True)]
