"""Checks of a declared model: unique names, expressions in known symbols only, a complete equilibrium curve."""

from __future__ import annotations

import sympy

from .declare import TIME, DeclarationError, Delay, Model, before, check_name, nearest, rate


def check(model: Model) -> None:
    """`DeclarationError` for the first fault."""
    _check_names(model)
    _check_order(model)
    _check_starts(model)
    _check_curve(model)


def _check_names(model: Model) -> None:
    """Names are fit for a file and for every language, every quantity is declared once and every output is there."""
    check_name("the model", model.name)
    fold = [model.curve.fold.name] if model.curve else []
    seen: set[str] = set()
    for name in [
        *(q.name for q in model.inputs),
        *(p.quantity.name for p in model.parameters),
        *(s.quantity.name for s in model.states),
        *fold,
        *(d.quantity.name for d in model.delays),
        *(d.quantity.name for d in model.discretes),
        *(d.quantity.name for d in model.definitions),
    ]:
        check_name(model.name, name)
        if name in seen:
            raise DeclarationError(f"{model.name} declares {name!r} twice; give the second another name")
        seen.add(name)
    for name in model.outputs:
        if name not in seen:
            raise DeclarationError(f"{model.name} has no quantity {name!r} to put out{nearest(name, seen)}")
    for name in [name for terminal in model.terminals for _, name in terminal.members]:
        if name not in seen:
            raise DeclarationError(f"{model.name} has no quantity {name!r} for a terminal{nearest(name, seen)}")


def _check_order(model: Model) -> None:
    """Every expression uses only what is declared before it."""
    fold = [model.curve.fold.symbol] if model.curve else []
    known = {
        TIME,
        *(q.symbol for q in model.inputs),
        *(rate(q) for q in model.inputs),
        *(rate(d.quantity) for d in model.delays if d.of in [q.name for q in model.inputs]),
        *(p.quantity.symbol for p in model.parameters),
        *(s.quantity.symbol for s in model.states),
        *fold,
        *(d.quantity.symbol for d in model.delays),
        *(d.quantity.symbol for d in model.discretes),
    }
    for definition in model.definitions:
        _check_known(model, definition.quantity.name, definition.expression, known)
        known.add(definition.quantity.symbol)
    for state in model.states:
        _check_known(model, f"der({state.quantity.name})", state.derivative, known)
        if state.quantity.maximum is not None:
            raise DeclarationError(
                f"{model.name}: {state.quantity.name} is a state; expected no maximum: it would not be enforced"
            )
    for delay in model.delays:
        _check_delay(model, delay)
    _check_samples(model)


def _check_starts(model: Model) -> None:
    """Each state starts from inputs (which do not move yet), parameters and the starts of other states."""
    known = {*(q.symbol for q in model.inputs), *(rate(q) for q in model.inputs)}
    known |= {*(p.quantity.symbol for p in model.parameters), *(d.quantity.symbol for d in model.discretes)}
    known |= {d.quantity.symbol for d in model.delays} | {rate(d.quantity) for d in model.delays}
    defined = {d.quantity.symbol: sympy.sympify(d.expression) for d in model.definitions}
    left = {s.quantity.symbol: _leaves(s.start, defined) - known for s in model.states}
    for symbol, used in left.items():
        unknown = sorted(str(s) for s in used - left.keys())
        if unknown:
            raise DeclarationError(
                f"{model.name}: the start of {symbol} uses {', '.join(unknown)}; expected inputs, parameters and states"
            )
    while left:
        ready = {symbol for symbol, used in left.items() if not used & left.keys()}
        if not ready:
            raise DeclarationError(
                f"{model.name}: the starts of {', '.join(sorted(map(str, left)))} use one another; "
                "give one of them a start of its own"
            )
        left = {symbol: used for symbol, used in left.items() if symbol not in ready}


def _leaves(expression: sympy.Expr, defined: dict[sympy.Symbol, sympy.Expr]) -> set[sympy.Symbol]:
    """What an expression depends on in the end, through definitions."""
    found: set[sympy.Symbol] = set()
    seen: set[sympy.Symbol] = set()
    todo = set(sympy.sympify(expression).free_symbols)
    while todo:
        symbol = todo.pop()
        seen.add(symbol)
        if symbol in defined:
            todo |= defined[symbol].free_symbols - seen
        else:
            found.add(symbol)
    return found


def _check_curve(model: Model) -> None:
    """An equilibrium curve names existing quantities, and every state declares its equilibrium."""
    curve = model.curve
    if curve is None:
        return
    switches = [p.quantity.name for p in model.parameters if p.quantity.type == "Boolean"]
    for role, name, kind, there in (
        ("balance", curve.balance, "a definition", [d.quantity.name for d in model.definitions]),
        ("load", curve.load, "an input", [q.name for q in model.inputs]),
        ("unknown", curve.unknown, "a state", [s.quantity.name for s in model.states]),
        ("start_switch", curve.start_switch, "a Boolean parameter", switches),
    ):
        if name not in there:
            raise DeclarationError(
                f"{model.name}: the equilibrium curve's {role}: expected {kind} but was given {name!r}"
                f"{nearest(name, there)}"
            )
    if not curve.lower <= curve.fold_lower < curve.upper:
        raise DeclarationError(
            f"{model.name}: the equilibrium curve: expected lower <= fold_lower < upper but was given "
            f"{curve.lower:g}, {curve.fold_lower:g}, {curve.upper:g}"
        )
    known = {*(q.symbol for q in model.inputs), *(p.quantity.symbol for p in model.parameters), model[curve.unknown]}
    for state in model.states:
        if state.equilibrium is None:
            raise DeclarationError(
                f"{model.name} has an equilibrium curve, but {state.quantity.name} has no equilibrium; "
                "give the value it settles to"
            )
        unknown = sorted(str(s) for s in sympy.sympify(state.equilibrium).free_symbols - known)
        if unknown:
            raise DeclarationError(
                f"{model.name}: the equilibrium of {state.quantity.name} uses {', '.join(unknown)}; "
                f"expected inputs, parameters and {curve.unknown}"
            )


def _check_samples(model: Model) -> None:
    """Each discrete is sampled from what is known by then."""
    fixed = {*(q.symbol for q in model.inputs), *(p.quantity.symbol for p in model.parameters)}
    known = {TIME, *fixed, *(s.quantity.symbol for s in model.states), *(before(d.quantity) for d in model.discretes)}
    for discrete in model.discretes:
        _check_known(model, f"the start of {discrete.quantity.name}", discrete.start, fixed)
        _check_known(model, f"the update of {discrete.quantity.name}", discrete.update, known)
        known.add(discrete.quantity.symbol)


def _check_delay(model: Model, delay: Delay) -> None:
    """The delayed quantity is there, its delay is a bounded parameter, and a delayed definition drives no state."""
    inputs = [q.name for q in model.inputs]
    places = {d.quantity.name: i for i, d in enumerate(model.definitions)}
    if delay.of not in inputs and delay.of not in places:
        raise DeclarationError(
            f"{model.name}: {delay.quantity.name} delays {delay.of!r}; expected an input or a definition"
            f"{nearest(delay.of, [*inputs, *places])}"
        )
    by = model.quantity(delay.by)
    signed = delay.of in inputs and by.minimum is not None and by.minimum <= 0
    if not (signed or by.minimum == 0) or by.maximum is None:
        raise DeclarationError(
            f"{model.name}: expected bounds of the delay {by.name} from 0 (an input's from below) to some time in s"
        )
    if delay.of in inputs:
        return
    reached: set[sympy.Symbol] = set().union(*(s.derivative.free_symbols for s in model.states))
    for definition in reversed(model.definitions):
        if definition.quantity.symbol in reached:
            reached |= definition.expression.free_symbols
    if delay.quantity.symbol in reached:
        raise DeclarationError(
            f"{model.name}: {delay.quantity.name} drives a state; expected so of delayed inputs only, and "
            f"{delay.of} is not an input"
        )


def _check_known(model: Model, name: str, expression: sympy.Expr, known: set[sympy.Symbol]) -> None:
    unknown = sorted(str(s) for s in sympy.sympify(expression).free_symbols - known)
    if unknown:
        raise DeclarationError(
            f"{model.name}: {name} uses {', '.join(unknown)} before it is declared; "
            "declare it, or place this definition after it"
        )
