"""The ranges that quantities pass in the records: an effect that begins at a level shows nothing beyond them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from ...identify.fitting.compiled import Ids
from ...identify.study.study import Study
from ...kernel import KernelError, Trajectory
from ...model.declare import Model, rate
from ...model.effect import Effect
from ...model.sizes import evaluator

Passed = Mapping[str, tuple[float, float]]  # the least and the largest value of a quantity, by name


def passed(study: Study, ids: Ids, values: Mapping[str, float], effects: Iterable[Effect]) -> Passed:
    """What the quantities with a level of some `effects` pass in training, in the model with `ids` at `values` (SI).

    Nothing where the model has no answer.
    """
    names = {name for e in effects for name in e.levels.values()}
    if not names:
        return {}
    known = study.shared(values) | study.geometry
    try:
        runs = study.response(ids, study.training).trajectories(known)
    except KernelError:
        return {}
    courses = {name: [course(study.plant.model, run, name, known) for run in runs] for name in names}
    return {
        name: (min(float(c.min()) for c in each), max(float(c.max()) for c in each)) for name, each in courses.items()
    }


def course(model: Model, run: Trajectory, name: str, values: Mapping[str, float]) -> np.ndarray:
    """A quantity of a model over a run of it, (n,) [SI]; definitions are computed from what the run has."""
    if name in run.values:
        return run[name]
    expression = model.expression(name)
    for definition in reversed(model.definitions):
        expression = expression.xreplace({definition.quantity.symbol: definition.expression})
    symbols, value = evaluator(expression)
    moving = {str(rate(q)): np.gradient(run[q.name], run.time) for q in model.inputs if rate(q) in symbols}
    numbers = model.parameter_values() | dict(values) | {"time": run.time} | run.values | moving
    found = np.vectorize(value, otypes=[float])(*(numbers[str(s)] for s in symbols)) if symbols else value()
    return np.broadcast_to(found, run.time.shape)
