"""The ranges that states pass in the records: an effect that begins at a level shows nothing beyond them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ...identify.fitting.compiled import Ids
from ...identify.study.study import Study
from ...kernel import KernelError
from ...model.effect import Effect

Passed = Mapping[str, tuple[float, float]]  # the least and the largest value of a state, by name


def passed(study: Study, ids: Ids, values: Mapping[str, float], effects: Iterable[Effect]) -> Passed:
    """What the states with a level of some `effects` pass in training, in the model with `ids` at `values` (SI).

    Nothing where the model has no answer.
    """
    states = {state for e in effects for state in e.levels.values()}
    if not states:
        return {}
    try:
        runs = study.response(ids, study.training).trajectories(study.shared(values))
    except KernelError:
        return {}
    return {s: (min(float(r[s].min()) for r in runs), max(float(r[s].max()) for r in runs)) for s in states}
