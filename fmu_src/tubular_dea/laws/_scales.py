"""Usual sizes in a model: of its times, from its own time constants, and of what a balance adds up."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
import sympy

from ..model.declare import TIME, Model, rate
from ..model.sizes import evaluator

STEP = 1e-4  # of a nominal value, for time constants


@lru_cache(maxsize=64)
def seconds(model: Model) -> float:
    """The geometric mean of the model's time constants at its start [s]; 1 where it has none."""
    at = _start(model)
    rates = _evaluator(model)
    n = len(model.states)
    jacobian = np.zeros((n, n))
    for j, state in enumerate(model.states):
        step = STEP * state.quantity.nominal
        up, down = (rates(at | {state.quantity.symbol: at[state.quantity.symbol] + sign * step}) for sign in (1, -1))
        jacobian[:, j] = (up - down) / (2 * step)
    if not n or not np.all(np.isfinite(jacobian)):
        return 1.0
    speeds = np.abs(np.linalg.eigvals(jacobian))
    speeds = speeds[speeds > 1e-12]
    return _rounded(float(np.exp(-np.mean(np.log(speeds))))) if speeds.size else 1.0


@lru_cache(maxsize=256)
def rate_size(model: Model, state: str) -> float:
    """The largest term of the balance behind a state's derivative, each input and state moved by its nominal value."""
    at = _start(model)
    rates = _evaluator(model)
    row = [s.quantity.name for s in model.states].index(state)
    still = rates(at)[row]
    moved = [
        rates(at | {q.symbol: at[q.symbol] + q.nominal})[row] - still
        for q in (*model.inputs, *(s.quantity for s in model.states))
    ]
    sizes = [abs(float(m)) for m in moved if math.isfinite(m) and m]
    return _rounded(max(sizes, default=model.quantity(state).nominal / seconds(model)))


def _rounded(value: float) -> float:
    """A size, not a result: two digits."""
    return float(f"{value:.2g}")


def _start(model: Model, unknown: float = 0.5) -> dict[sympy.Symbol, float]:
    """Everything that is given, with the states at their start (at `unknown` times their nominal value where that is
    not known)."""
    at: dict[sympy.Symbol, float] = {TIME: 0.0}
    at |= {p.quantity.symbol: float(p.quantity.value or 0.0) for p in model.parameters}
    for q in (*model.inputs, *(d.quantity for d in model.delays)):
        at |= {q.symbol: float(q.value or 0.0), rate(q): 0.0}
    at |= {d.quantity.symbol: 0.0 for d in model.discretes}
    at |= {model.curve.fold.symbol: model.curve.fold.nominal} if model.curve else {}
    for state in model.states:
        start = sympy.sympify(state.start).subs(at)
        at[state.quantity.symbol] = float(start) if start.is_number else unknown * state.quantity.nominal
    return at


@lru_cache(maxsize=256)
def at_first(model: Model, name: str) -> float:
    """The value of an input, a state or a definition at the model's start, as declared; 0 where it is not known."""
    found = _defined(model, _start(model, math.nan))[model.quantity(name).symbol]
    return found if math.isfinite(found) else 0.0


def _defined(model: Model, given: dict[sympy.Symbol, float]) -> dict[sympy.Symbol, float]:
    """What is given, with the definitions that follow from it."""
    values = dict(given)
    for symbol, arguments, function in _steps(model):
        values[symbol] = function(*(values[a] for a in arguments))
    return values


@lru_cache(maxsize=8)
def _steps(model: Model) -> list[tuple[sympy.Symbol, list[sympy.Symbol], Callable[..., float]]]:
    """The definitions in their order: each symbol, with what it is a function of."""
    return [(d.quantity.symbol, *evaluator(d.expression)) for d in model.definitions]


@lru_cache(maxsize=8)
def _evaluator(model: Model) -> Callable[[dict[sympy.Symbol, float]], np.ndarray]:
    """The derivatives of the states as a function of everything that is given; nan where they have no value."""
    ends = [evaluator(s.derivative) for s in model.states]

    def evaluate(given: dict[sympy.Symbol, float]) -> np.ndarray:
        values = _defined(model, given)
        return np.array([function(*(values[a] for a in arguments)) for arguments, function in ends])

    return evaluate
