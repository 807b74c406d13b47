"""Rows of a sweep: a pure function of the plan and the row numbers, the same wherever it is called."""

from __future__ import annotations

import numpy as np

from ..kernel.batch import MESSAGES, Batch, Results, message
from ..kernel.checks import fractional, unfit
from .expression import Values
from .models import ExternalFmu
from .plan import Plan
from .quantities import Quantities

BAD_INPUT, OUT_OF_BOUNDS, UNDEFINED, NOT_WHOLE = -2, -3, -4, -5
TEXTS = {
    BAD_INPUT: "the times of {what} do not ascend",
    OUT_OF_BOUNDS: "{what} is outside its bounds",
    UNDEFINED: "{what} is not a finite number",
    NOT_WHOLE: "{what} is not one of the whole numbers that it takes",
    4: "the FMU could not be simulated",
}
Rows = dict[str, np.ndarray]


class PreparedPlan:
    """A plan made ready: its model compiled for what is wanted."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.probes = [probe for w in plan.outputs for probe in w.probes]
        self.quantities = Quantities.of(plan.model)
        if isinstance(plan.model, ExternalFmu):
            from .external import ExternalRows

            self.engine: Batch | ExternalRows = ExternalRows(plan.model, self.probes)
        else:
            self.engine = Batch(plan.model, self.probes)

    @property
    def threads(self) -> bool:
        """Whether several threads may compute rows at the same time."""
        return isinstance(self.engine, Batch)

    def rows(self, start: int, stop: int) -> Rows:
        """The columns of rows `start` to `stop`, as `plan.columns` lists them."""
        plan, n = self.plan, stop - start
        varied = plan.design.columns(start, stop)
        defaults = {name: float(q.value or 0.0) for name, q in self.quantities.parameters.items()}
        values: Values = {**defaults, **dict(plan.fixed), **varied}
        parameters = dict(plan.fixed) | {k: v for k, v in varied.items() if k in self.quantities.parameters}
        problems = _Problems(n)
        for name, value in parameters.items():
            q, given = self.quantities.parameters[name], np.asarray(value)
            bad = unfit(q, given)
            problems.add(NOT_WHOLE, name, fractional(q, given))
            problems.add(OUT_OF_BOUNDS, name, bad)
            if np.any(bad):  # the engine takes none of them, and what it finds in these rows is not used
                parameters[name] = np.where(bad, defaults[name], given)
        compute = self._trajectories if plan.study == "trajectory" else self._rest
        results = compute(n, parameters, values, problems)
        return self._table(start, n, varied, results, problems)

    def _trajectories(
        self, n: int, parameters: dict[str, np.ndarray | float], values: Values, problems: _Problems
    ) -> Results:
        plan = self.plan
        stop = plan.stop(values)
        problems.add(UNDEFINED, "stop", ~(np.isfinite(stop) & (stop > 0)))
        stop = np.where(np.isfinite(stop), stop, 0.0)
        inputs = {name: template.breakpoints(values, stop) for name, template in plan.inputs}
        for name, b in inputs.items():
            problems.add(UNDEFINED, name, ~np.all(np.isfinite(b.time) & np.isfinite(b.value), axis=1, keepdims=True))
            problems.add(BAD_INPUT, name, ~np.all(np.diff(b.time, axis=1) >= 0, axis=1, keepdims=True))
        probes = [p for w in plan.outputs for p in w.placed(values, stop)]
        stop = np.where(problems.status[:, None] == 0, stop, 0.0)
        if isinstance(self.engine, Batch):
            return self.engine.trajectories(n, parameters, inputs, stop, plan.tolerance, probes)
        self.engine.probes = tuple(probes)
        return self.engine.trajectories(n, parameters, inputs, stop, plan.tolerance)

    def _rest(self, n: int, parameters: dict[str, np.ndarray | float], values: Values, problems: _Problems) -> Results:
        inputs = {name: template.values[0](values)[:, 0] for name, template in self.plan.inputs}
        for name, value in inputs.items():
            problems.add(UNDEFINED, name, ~np.isfinite(value))
        assert isinstance(self.engine, Batch)
        return self.engine.rest(n, parameters, inputs)

    def _table(self, start: int, n: int, varied: Rows, results: Results, problems: _Problems) -> Rows:
        bad = problems.status != 0
        status = np.where(bad, problems.status, results.status).astype(np.int32)
        table: Rows = {"row": np.arange(start, start + n)} | varied
        place = 0
        for w in self.plan.outputs:
            table[w.column] = np.where(bad, np.nan, w.value(results, place))
            place += len(w.probes)
        texts = np.full(n, "", dtype=object)
        for i in np.flatnonzero(status):
            texts[i] = (
                problems.texts.get(int(i))
                or TEXTS.get(int(status[i]))
                or message(int(status[i]), float(results.reached[i]))
            )
        return table | {"status": status, "message": texts}


class _Problems:
    """Rows that cannot be computed, and why: the first reason counts."""

    def __init__(self, rows: int) -> None:
        self.status = np.zeros(rows, np.int32)
        self.texts: dict[int, str] = {}

    def add(self, status: int, what: str, bad: np.ndarray) -> None:
        if not np.any(bad):
            return
        flat = np.broadcast_to(np.reshape(bad, (-1,)), self.status.shape)
        for i in np.flatnonzero(flat & (self.status == 0)):
            self.status[i] = status
            self.texts[int(i)] = TEXTS[status].format(what=what)


def failures(table: Rows) -> dict[str, int]:
    """How often each status other than 0 is there, by a text for it."""

    def text(status: int) -> str:
        return MESSAGES.get(status) or TEXTS.get(status, f"status {status}").format(what="a number")

    found, counts = np.unique(table["status"], return_counts=True)
    return {text(int(s)): int(c) for s, c in zip(found, counts, strict=True) if s}
