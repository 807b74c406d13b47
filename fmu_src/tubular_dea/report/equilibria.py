"""Equilibrium curves p(lambda_2) with folds and stability, as the paper's Fig. 9, and the boundary of snap-through."""

from __future__ import annotations

import numpy as np

from ..emit.jacobian import at_rest, real
from ..kernel import Kernel
from ..model.declare import Model
from ..model.units import factor
from ..sweep.axes import Axis, Levels, Range
from ..sweep.plan import Plan
from ..sweep.shown import Shown
from .pictures import Boundary, Curves, Line

MOST = 6  # curves in one picture
USUAL_LEVELS = (0.0, 0.8, 1.0, 1.2, 1.4)  # of an input's usual size: 4 to 7 kV, as in the paper's Fig. 9


def equilibrium_curves(plan: Plan) -> Curves:
    """The load over the unknown at rest, for some values of the other input; stable branches solid, folds marked."""
    model = plan.model
    assert isinstance(model, Model) and model.curve is not None
    kernel, curve = Kernel(model, differentiated=False), model.curve
    other, levels = _levels(plan, model)
    load, unit = model.quantity(curve.load), model.quantity(curve.load).display_unit or model.quantity(curve.load).unit
    scale = factor(load.unit, unit)
    x = np.linspace(curve.fold_lower, curve.upper, 400)
    lines: list[Line] = []
    for number, level in enumerate(levels):
        y, slope, _ = kernel.curve(x, {other: level} if other else {}, dict(plan.fixed))
        lines += _branches(_named(model, other, level), x, scale * y, slope > 0, number)
    lines = [*lines, *_legend(lines)]
    caption = (
        f"The {curve.load} that holds the model at rest, over {curve.unknown}. Solid: stable at constant {curve.load}, "
        "dashed: unstable, dots: folds, where it snaps through."
    )
    return Curves("equilibrium_curves", caption, tuple(lines), (f"{curve.unknown} [1]", f"{curve.load} [{unit}]"))


def _levels(plan: Plan, model: Model) -> tuple[str, list[float]]:
    """The input beside the load, and values of it that the plan goes through."""
    assert model.curve is not None
    others = [q.name for q in model.inputs if q.name != model.curve.load]
    if not others:
        return "", [0.0]
    axis = next(
        (a for a in plan.design.axes if a.name in _feeding(plan, others[0]) and isinstance(a, Range | Levels)), None
    )
    if axis is None:
        return others[0], [level * model.quantity(others[0]).nominal for level in USUAL_LEVELS]
    values = axis.quantile(np.linspace(0, 1, MOST)[:, None])[axis.name]
    return others[0], sorted({float(v) for v in values})


def _feeding(plan: Plan, name: str) -> set[str]:
    """The axes that an input's values use."""
    template = dict(plan.inputs).get(name)
    return {n for value in template.values for n in value.names} if template else set()


def _named(model: Model, other: str, level: float) -> str:
    if not other:
        return "equilibrium"
    unit = model.quantity(other).display_unit or model.quantity(other).unit
    return f"{level * factor(model.quantity(other).unit, unit):g} {unit}"


def _branches(name: str, x: np.ndarray, y: np.ndarray, stable: np.ndarray, colour: int) -> list[Line]:
    """Pieces of one stability, each up to the next, and the points between them."""
    turns = np.flatnonzero(np.diff(stable.astype(int))) + 1
    lines = []
    for start, stop in zip([0, *turns], [*turns, x.size], strict=True):
        piece = slice(start, min(stop + 1, x.size))
        lines.append(Line(name if start == 0 else "", x[piece], y[piece], colour, dashed=not stable[start]))
    if turns.size:
        lines.append(Line("", x[turns], y[turns], colour, marks=True))
    return lines


def _legend(lines: list[Line]) -> list[Line]:
    """What dashes and dots mean, as lines without points; nothing where there are none."""
    nowhere, said = np.array([np.nan]), []
    if any(line.dashed for line in lines):
        said.append(Line("unstable", nowhere, nowhere, None, dashed=True))
    if any(line.marks for line in lines):
        said.append(Line("fold", nowhere, nowhere, None, marks=True))
    return said


def snap_boundary(plan: Plan, first: Axis, second: Axis, labels: dict[str, Shown]) -> Boundary | None:
    """The fold over two axes of which one is the load and one the other input, both held; else None."""
    model = plan.model
    if not isinstance(model, Model) or model.curve is None:
        return None
    curve, kernel = model.curve, Kernel(model, differentiated=False)
    others = [q.name for q in model.inputs if q.name != curve.load]
    axes = {first.name: first, second.name: second}
    feeding = {name: _feeding(plan, name) & set(axes) for name in (curve.load, *others)}
    if len(others) != 1 or len(feeding[curve.load]) != 1 or len(feeding[others[0]]) != 1:
        return None
    (load_axis,), (other_axis,) = feeding[curve.load], feeding[others[0]]
    if load_axis == other_axis or not _depends(model, others[0]):
        return None
    values = np.linspace(0, 1, 121)[:, None]
    level = axes[other_axis].quantile(values)[other_axis]
    fold = np.array([kernel.curve(np.array([1.0]), {others[0]: float(v)}, dict(plan.fixed))[2][1] for v in level])
    ends = axes[load_axis].quantile(np.array([[0.0], [1.0]]))[load_axis]
    inside = (fold >= ends.min()) & (fold <= ends.max())
    if not inside.any():
        return None
    drawn = {load_axis: fold[inside], other_axis: level[inside]}
    beyond = {
        load_axis: np.r_[np.clip(fold, ends.min(), ends.max()), np.full(2, ends.max())],
        other_axis: np.r_[level, level[[-1, 0]]],
    }
    x, y, *area = (part[axis.name] * labels[axis.name].scale for part in (drawn, beyond) for axis in (first, second))
    return Boundary("snap-through", x, y, tuple(area) if plan.study == "rest" else ())


def _depends(model: Model, name: str) -> bool:
    assert model.curve is not None
    used = [e for _, e in at_rest(model, [real(model.curve.balance)])]
    return any(real(name) in e.free_symbols for e in used)
