"""The uncertainty of the parameters due to the form of a law: the catalogue's law may not be exactly the plant's.

The true contribution of an effect to the readings may differ from that of its law, c, by some per cent, slowly varying
over the output, the inputs and the experiments, and by a shift in time. This model discrepancy is c times smooth
functions, each with a coefficient of zero mean and standard deviation LAW. The coefficients are fitted along with the
parameters and integrated out (Kennedy and O'Hagan, "Bayesian calibration of computer models", J. R. Statist. Soc. B 63
(2001) 425, with few functions instead of a Gaussian process). The parameters stay those of the law; the change that the
coefficients would cause counts as uncertainty. Effects with only one form (`Effect.exact`) have no discrepancy. The
spread between equivalent effects counts as uncertainty too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress

import numpy as np

from ...identify.fitting.compiled import Ids
from ...identify.fitting.fit import Fit, inverse
from ...identify.fitting.problem import Problem
from ...identify.study.study import Study
from ...kernel import KernelError
from ...model.effect import Effect
from ..options.acceptance import EARNS, bounded_away
from ..scores.parameters import switched_off

# Set by judgement: by some per cent, slowly. A factor of four either way changes standard errors by 8 % at most there.
# Check: `pytest tests/test_law_uncertainty.py::test_another_law_is_within_the_uncertainty`
LAW = 0.1  # [1] standard deviation of each share by which a law may be another

# Set by judgement. Check: `pytest tests/test_law_uncertainty.py`
PART = 0.1  # [1] of the effect that is switched off to see its contribution


def with_law(study: Study, problem: Problem, ids: Ids, best: Fit) -> Fit:
    """The fit with a covariance and standard errors that include the discrepancy of its laws."""
    other = [_columns(study.catalogue[name], problem, best) for name in ids if not study.catalogue[name].exact]
    if not other:
        return best
    k, columns = len(best.names), np.concatenate(other, axis=1)
    columns = np.pad(columns, ((0, best.residual.size - len(columns)), (0, 0)))  # the prior's rows
    everything = np.concatenate([best.jacobian, columns], axis=1)
    information = everything.T @ everything
    information[k:, k:] += np.eye(columns.shape[1]) / LAW**2
    together = inverse(information)
    moved = (together @ (everything.T @ best.residual))[:k]
    alone = inverse(best.jacobian.T @ best.jacobian)
    return best.with_covariance(best.covariance + (together[:k, :k] - alone + np.outer(moved, moved)))


def with_rivals(best: Fit, rivals: Sequence[Fit]) -> Fit:
    """The fit with the spread between it and equivalent rivals added to the uncertainty of common parameters."""
    apart = [
        np.array(
            [r.scaled[r.names.index(n)] - best.scaled[i] if n in r.names else 0.0 for i, n in enumerate(best.names)]
        )
        for r in rivals
    ]
    if not apart:
        return best
    return best.with_covariance(best.covariance + np.mean([np.outer(d, d) for d in apart], axis=0))


def still_there(study: Study, ids: Ids, narrow: Fit, wide: Fit, gains: Mapping[str, float]) -> Fit:
    """The wider fit, but no wider than that effects stay there which are there by the narrower one or their `gains`.

    Another form of a law says that its size means something else, not that there is no such effect. And where a size
    and other parameters make up for each other along a bent valley, an interval from the covariance may reach to where
    the effect is off, though the misfit rises far by then: the gain is the profile of the likelihood there. An effect
    that gains `EARNS` is off at as many standard deviations, squared.
    """
    share = np.ones(len(wide.names))
    for effect_id, effect in ((name, study.catalogue[name]) for name in ids):
        there = bounded_away(effect, narrow) or gains.get(effect_id, 0.0) > EARNS
        if not there or bounded_away(effect, wide):
            continue
        for i, name in enumerate(wide.names):
            if name in effect.off or (name in effect.fit and not any(n in wide.names for n in effect.off)):
                most = abs(wide.values[name] - effect.off.get(name, 0.0)) / float(np.sqrt(EARNS))
                share[i] = min(1.0, most / wide.stderr[name])
    return wide.with_covariance(wide.covariance * np.outer(share, share))


def _columns(effect: Effect, problem: Problem, best: Fit) -> np.ndarray:
    """The change of the whitened readings by a coefficient of 1 of each function, shape (N, functions)."""
    outputs = problem.response.outputs(best.values)
    added, cases = _added(effect, problem, best, outputs), problem.response.cases
    inputs = [list(case.protocol.at(case.times).values()) for case in cases]
    signals = [np.array([y, *u]) for y, u in zip(outputs, inputs, strict=True)]
    low = np.min([s.min(axis=1) for s in signals], axis=0)
    span = np.maximum(np.max([s.max(axis=1) for s in signals], axis=0) - low, 1e-300)
    slopes = [np.gradient(c, case.times) for c, case in zip(added, cases, strict=True)]
    duration = np.linalg.norm(np.concatenate(added)) / max(float(np.linalg.norm(np.concatenate(slopes))), 1e-300)
    functions = []
    for i, (c, signal) in enumerate(zip(added, signals, strict=True)):
        scaled = 2 * (signal - low[:, None]) / span[:, None] - 1
        each = [c * (i == j) for j in range(len(cases))]
        functions.append(np.column_stack([*each, *(c * s for s in scaled), c * scaled[0] ** 2, slopes[i] * duration]))
    return problem.whiten(functions)


def _added(effect: Effect, problem: Problem, best: Fit, outputs: Sequence[np.ndarray]) -> list[np.ndarray]:
    """What the effect adds to the `outputs` of every case: by a part of it less, or more where the model has no answer
    with less, as beyond a fold; by its slope where it has none with either."""
    off = switched_off(effect)
    away = {n: v - off[n] for n, v in best.values.items() if n in effect.off}
    for part in (PART, -PART):
        less = {n: best.values[n] - part * by for n, by in away.items()}
        with suppress(KernelError):
            without = problem.response.outputs(best.values | less)
            return [(a - b) / part for a, b in zip(outputs, without, strict=True)]
    _, slopes = problem.response.sensitivities(best.values, [*away])
    return [slope @ np.array([*away.values()]) for slope in slopes]
