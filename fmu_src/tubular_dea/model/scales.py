"""Usual sizes in a model: of its times, from its own time constants, of what a balance adds up, and of parameters that
are declared as 0."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
import sympy

from .declare import TIME, Model, rate
from .sizes import evaluator

STEP = 1e-4  # of a nominal value, for time constants
SAME = 1e-3  # of a value: a law that is smooth may change as much where it is off
NEAR = 0.1  # of a nominal value, from a start
HALF = 0.5  # of a nominal value: a state whose start is not known
DECADES = range(-30, 31)  # of a parameter's unit, among which its size is sought


@lru_cache(maxsize=64)
def seconds(model: Model) -> float:
    """The geometric mean of the model's time constants [s]; 1 where it has none.

    At its start or, if it has none there (a tank that is empty, or its valve shut), at work: states at half of what is
    usual, inputs at that.
    """
    start = _start(model)
    work = {s.quantity.symbol: HALF * s.quantity.nominal for s in model.states}
    work |= {q.symbol: q.nominal for q in model.inputs}
    for at in (start, start | work) if model.states else ():
        jacobian = _jacobian(model, at)
        if np.all(np.isfinite(jacobian)):
            speeds = np.abs(np.linalg.eigvals(jacobian))
            speeds = speeds[speeds > 1e-12]
            if speeds.size:
                return _rounded(float(np.exp(-np.mean(np.log(speeds)))))
    return 1.0


def _jacobian(model: Model, at: dict[sympy.Symbol, float]) -> np.ndarray:
    """The derivatives (n, n) of the states' rates with respect to the states [SI]."""
    rates = _evaluator(model)
    columns = []
    for state in model.states:
        symbol, step = state.quantity.symbol, STEP * state.quantity.nominal
        up, down = (rates(at | {symbol: at[symbol] + sign * step}) for sign in (1, -1))
        columns.append((up - down) / (2 * step))
    return np.column_stack(columns)


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


def parameter_size(model: Model, name: str) -> float:
    """The size at which a parameter, declared as 0, changes a balance or an output by as much as is usual there; 1
    where it changes none."""
    symbol, work = model.quantity(name).symbol, _start(model) | {q.symbol: q.nominal for q in model.inputs}
    work |= {s.quantity.symbol: s.quantity.nominal for s in model.states}
    rates, outputs = [s.quantity.name for s in model.states], [model.quantity(o) for o in model.outputs]
    usual = np.array([*(rate_size(model, state) for state in rates), *(q.nominal for q in outputs)])

    def moved(value: float) -> np.ndarray:
        at = work | {symbol: value}
        defined = _defined(model, at)
        return np.array([*_evaluator(model)(at), *(defined[q.symbol] for q in outputs)])

    still = moved(0.0)
    for size in (10.0**k for k in DECADES):
        share = float(np.nanmax(np.abs(moved(size) - still) / usual, initial=0.0))
        if share >= 1:
            return _rounded(size / share)
    return 1.0


def _rounded(value: float) -> float:
    """A size, not a result: two digits."""
    return float(f"{value:.2g}")


def _start(model: Model, unknown: float = HALF) -> dict[sympy.Symbol, float]:
    """Everything that is given, with the states at their start (at `unknown` times their nominal value where that is
    not known), and inputs at 0, but for temperatures in kelvin: these are at their nominal values."""
    at: dict[sympy.Symbol, float] = {TIME: 0.0}
    at |= {p.quantity.symbol: float(p.quantity.value or 0.0) for p in model.parameters}
    for q in (*model.inputs, *(d.quantity for d in model.delays)):
        at |= {q.symbol: float(q.value or (q.nominal if q.unit == "K" else 0.0)), rate(q): 0.0}
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


def moved_by(before: Model, after: Model) -> str:
    """The first state or output of a model that moves otherwise with an effect in it that is off, near its start or
    where states and inputs are usual, to either side; "" for none."""
    return next(filter(None, (_moved_at(before, after, share) for share in (NEAR, HALF, -HALF, 1.0))), "")


def _moved_at(before: Model, after: Model, share: float) -> str:
    """That where every state is off its start by a `share` of its nominal value, to one side."""
    start, side = _start(before), math.copysign(1.0, share)
    work = {s.quantity.symbol: start[s.quantity.symbol] + share * s.quantity.nominal for s in before.states}
    work |= {q.symbol: q.nominal * (1.0 if q.unit == "K" else side) for q in before.inputs}
    told = []
    for model in (before, after):
        at = _start(model) | work
        values = _defined(model, at)
        at |= {d.quantity.symbol: values[model.quantity(d.of).symbol] for d in model.delays}  # nothing is late
        values = _defined(model, at)
        rates = dict(zip([s.quantity.name for s in model.states], _evaluator(model)(at), strict=True))
        told.append({s.quantity.name: rates[s.quantity.name] for s in before.states})
        told[-1] |= {name: values[model.quantity(name).symbol] for name in before.outputs}
    first, second = told
    return next((n for n, was in first.items() if abs(second[n] - was) > SAME * max(abs(was), abs(second[n]))), "")


def undefined(model: Model) -> str:
    """The first equation of a model that has no value at its start whatever the inputs, as 0 / 0 has none; "" where
    all have."""
    start, missing = _start(model), []
    for inputs in (0.0, HALF, 1.0):  # shares of what is usual: a law may have no value at one of them
        at = start | {q.symbol: inputs * q.nominal for q in model.inputs}
        values = {str(symbol): value for symbol, value in _defined(model, at).items()}
        rates = {f"d({s.quantity.name})/dt": r for s, r in zip(model.states, _evaluator(model)(at), strict=True)}
        missing.append([name for name, value in (values | rates).items() if not math.isfinite(value)])
    return next((name for name in missing[0] if all(name in others for others in missing)), "")


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
