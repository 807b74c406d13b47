"""A model declared line by line, by keyword, as a plant file does.

Usage::

    m = Build("CascadedTanks", "Two tanks in a row")
    u = m.input("pump", "V", nominal=5)
    k = m.parameter("k", "1/s", 0.05, description="outflow rate")
    h = m.state("h", "V", start="free", nominal=5)
    q = m.define("outflow", "V/s", k * h)
    m.derivative(h, k * u - q)
    m.output("level", "V", h)
    model = m.model()

Every call returns the symbol of what it declares. Expressions are sympy's; `m.rate(u)` is the rate of an input.
Units are compared (see `dimensions`). Errors are `DeclarationError` and name the file and line of the declaration.
"""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from numbers import Real
from pathlib import Path
from typing import Any, TypeAlias

import sympy

from .declare import (
    TIME,
    DeclarationError,
    Definition,
    EquilibriumCurve,
    Model,
    Parameter,
    Quantity,
    State,
    check_name,
    nearest,
    rate,
)
from .dimensions import fault, per_second
from .functions import unusable
from .scales import parameter_size
from .sizes import usual_size
from .units import UnitError, factor, parse

Expression: TypeAlias = sympy.Expr | float
STARTS = ("free", "shared")
OWN = (__file__, contextlib.__file__, "<string>")  # what stands between a plant file and an error


@dataclass
class Build:
    """What is declared so far; `model()` is the model, a value that never changes again."""

    name: str
    description: str = ""
    documentation: str = ""
    _inputs: list[Quantity] = field(default_factory=list)
    _parameters: list[Parameter] = field(default_factory=list)
    _unsized: list[str] = field(default_factory=list)
    _states: dict[str, tuple[Quantity, Expression, Expression | None]] = field(default_factory=dict)
    _derivatives: dict[str, sympy.Expr] = field(default_factory=dict)
    _definitions: list[Definition] = field(default_factory=list)
    _outputs: list[str] = field(default_factory=list)
    _curve: EquilibriumCurve | None = None
    _lines: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        with _located():
            check_name("Build", self.name)

    def input(
        self, name: str, unit: str, description: str = "", *, nominal: float = 1.0, display_unit: str | None = None
    ) -> sympy.Symbol:
        """A signal that drives the model; `nominal` is its usual largest value in `unit`."""
        q = self._quantity(name, unit, description or name, nominal=nominal, display_unit=display_unit)
        self._inputs.append(q)
        return q.symbol

    def parameter(
        self,
        name: str,
        unit: str,
        value: float,
        description: str = "",
        *,
        minimum: float | None = None,
        maximum: float | None = None,
        source: str = "",
        tunable: bool = True,
        display_unit: str | None = None,
        nominal: float | None = None,
    ) -> sympy.Symbol:
        """A parameter of the plant. Fits identify `tunable` ones, between `minimum` and `maximum` (inclusive).

        `nominal` is its usual size: by default that of `value`; where this is 0, the one at which it changes a balance
        or an output by as much as is usual there.
        """
        if not isinstance(value, Real) or not math.isfinite(value):
            raise DeclarationError(f"{_here()}: parameter {name!r}: expected a number but was given {value!r}")
        q = self._quantity(
            name,
            unit,
            description or name,
            value=value,
            minimum=minimum,
            maximum=maximum,
            source=source,
            nominal=(abs(value) or 1.0) if nominal is None else nominal,
            display_unit=display_unit,
        )
        self._unsized += [name] if value == 0 and nominal is None else []
        if not q.allows(value):
            raise DeclarationError(
                f"{_here()}: parameter {name!r}: expected {q.allowed} but was given {value:g}; "
                "correct the value or its minimum and maximum"
            )
        self._parameters.append(Parameter(q, tunable=tunable))
        return q.symbol

    def state(
        self,
        name: str,
        unit: str,
        description: str = "",
        *,
        start: Expression | str = 0.0,
        nominal: float = 1.0,
        minimum: float | None = None,
        equilibrium: Expression | None = None,
        display_unit: str | None = None,
    ) -> sympy.Symbol:
        """A state; `derivative` gives its rate, `nominal` is its usual largest value in `unit`.

        `start` is a number, an expression of parameters and inputs, "free" (an unknown of every recording) or "shared"
        (one unknown for all recordings): both declare the parameter `<name>_start`, which fits find. Before that it is
        half of `nominal` above `minimum`, but of a temperature in kelvin all of it. The equations end at `minimum`.
        Where all states are "free", so are those that effects add, unless bench.toml says of a file that it rested. A
        "free" state whose derivative is 0 is a parameter of which each recording has its own.
        """
        q = self._quantity(name, unit, description or name, minimum=minimum, nominal=nominal, display_unit=display_unit)
        if isinstance(start, str):
            if start not in STARTS:
                raise DeclarationError(
                    f"{_here()}: state {name!r}: start: expected a number, an expression, 'free' or "
                    f"'shared' but was given {start!r}"
                )
            half = max(0.0, minimum or 0.0) + 0.5 * nominal
            unknown = self._quantity(
                f"{name}_start",
                unit,
                f"{description or name} at the start",
                value=nominal if unit == "K" else half,  # no half of a temperature that counts from absolute zero
                nominal=nominal,
                minimum=minimum,
                display_unit=display_unit,
            )
            self._parameters.append(Parameter(unknown, start="each" if start == "free" else "shared"))
            start = unknown.symbol
        self._check_unit(f"the start of {name}", self._known(f"the start of {name}", start), unit)
        self._states[name] = (q, start, equilibrium)
        return q.symbol

    def define(
        self,
        name: str,
        unit: str,
        expression: Expression,
        description: str = "",
        *,
        nominal: float | None = None,
        display_unit: str | None = None,
    ) -> sympy.Symbol:
        """A named intermediate, computed in the order of declaration. Without `nominal`, its size where inputs, states
        and parameters have theirs is taken."""
        value = self._known(name, expression)
        size = usual_size(value, self._sizes(), self._moving()) if nominal is None else nominal
        q = self._quantity(name, unit, description or name, nominal=size, display_unit=display_unit)
        self._check_unit(name, value, unit)
        self._definitions.append(Definition(q, value))
        return q.symbol

    def derivative(self, state: sympy.Symbol, expression: Expression) -> None:
        """The derivative of a state, in its unit per second."""
        name = str(state)
        if name not in self._states:
            raise DeclarationError(
                f"{_here()}: derivative of {name!r}: there is no such state{nearest(name, self._states)}"
            )
        if name in self._derivatives:
            raise DeclarationError(f"{_here()}: the derivative of {name!r} is given twice; add the terms up in one")
        unit = per_second(self._states[name][0].unit)
        rises = self._known(f"the derivative of {name}", expression)
        self._check_unit(f"the derivative of {name}", rises, unit)
        self._derivatives[name] = rises

    def output(
        self,
        name: str,
        unit: str,
        expression: Expression,
        description: str = "",
        *,
        nominal: float | None = None,
        display_unit: str | None = None,
    ) -> sympy.Symbol:
        """What can be recorded of the model: a definition that is put out."""
        symbol = self.define(name, unit, expression, description, nominal=nominal, display_unit=display_unit)
        self._outputs.append(name)
        return symbol

    def equilibrium_curve(self, curve: EquilibriumCurve) -> None:
        """The balance at rest of a model with a fold (see `EquilibriumCurve`); states then have an `equilibrium`.

        Its `start_switch` becomes a Boolean parameter, which is false.
        """
        text = "Start at rest under the first inputs instead of at the start values"
        switch = self._quantity(curve.start_switch, "1", text, value=0.0, nominal=1.0, type="Boolean")
        self._parameters.append(Parameter(switch, tunable=False))
        self._curve = curve

    def model(self) -> Model:
        """The declared model; `DeclarationError` where something is missing."""
        for name in self._states:
            if name not in self._derivatives:
                raise DeclarationError(
                    f"{self._lines[name]}: the state {name!r} has no derivative; add m.derivative({name}, ...)"
                )
        if not self._outputs:
            raise DeclarationError(f"{_here()}: {self.name} puts out nothing; add m.output(name, unit, expression)")
        for name, (q, _, rest) in self._states.items():
            self._check_equilibrium(name, rest, q.unit)
        states = tuple(
            State(q, self._derivatives[name], sympy.sympify(start), None if rest is None else sympy.sympify(rest))
            for name, (q, start, rest) in self._states.items()
        )
        with _located():
            model = Model(
                self.name,
                self.description or self.name,
                self.documentation,
                tuple(self._inputs),
                tuple(self._parameters),
                tuple(self._definitions),
                states,
                tuple(self._outputs),
                self._curve,
            )
        sizes = {name: parameter_size(model, name) for name in self._unsized}
        parameters = [
            replace(p, quantity=replace(p.quantity, nominal=sizes.get(p.quantity.name, p.quantity.nominal)))
            for p in model.parameters
        ]
        return replace(model, parameters=tuple(parameters)) if sizes else model

    def rate(self, signal: sympy.Symbol) -> sympy.Symbol:
        """The rate of an input: known where the recording is straight or band-limited, zero where it is held."""
        names = [q.name for q in self._inputs]
        if str(signal) not in names:
            raise DeclarationError(f"{_here()}: rate of {signal}: there is no such input{nearest(str(signal), names)}")
        return rate(self._inputs[names.index(str(signal))])

    def _quantity(self, name: str, unit: str, description: str, **more: Any) -> Quantity:
        """A quantity with a name that is free and fit for every language, and a unit that can be read."""
        with _located():
            check_name(self.name, name)
        if name == "time" or name in [f"{q.name}_rate" for q in self._inputs]:
            meant = "the time" if name == "time" else "the rate of an input"
            raise DeclarationError(f"{_here()}: {name!r} already means {meant}; take another name")
        if name in self._lines:
            raise DeclarationError(
                f"{_here()}: {name!r} is declared already, in {self._lines[name]}; take another name"
            )
        try:
            parse(unit)
        except UnitError as problem:
            raise DeclarationError(f"{_here()}: {name!r}: {problem}") from None
        try:
            factor(more.get("display_unit") or unit, unit)
        except UnitError as problem:
            raise DeclarationError(f"{_here()}: {name!r}: display_unit: {problem}; leave it out") from None
        nominal = more.get("nominal")
        if not isinstance(nominal, int | float) or not (0 < nominal < math.inf):
            raise DeclarationError(
                f"{_here()}: {name!r}: nominal: expected a usual size above 0 but was given {nominal!r}"
            )
        self._lines[name] = _here()
        return Quantity(name, unit, description, **more)

    def _known(self, name: str, expression: Expression) -> sympy.Expr:
        """The expression, which uses only what is declared before it."""
        try:
            value = sympy.sympify(expression)
        except sympy.SympifyError:
            raise DeclarationError(f"{_here()}: {name}: expected an expression but was given {expression!r}") from None
        wrong = unusable(value)
        if wrong:
            raise DeclarationError(f"{_here()}: {name}: {wrong}")
        known = {TIME, *(q.symbol for q in self._inputs), *(rate(q) for q in self._inputs)}
        known |= {*(p.quantity.symbol for p in self._parameters), *(d.quantity.symbol for d in self._definitions)}
        known |= {q.symbol for q, _, _ in self._states.values()}
        for symbol in sorted(value.free_symbols - known, key=str):
            raise DeclarationError(f"{_here()}: {name} uses {symbol}, {_unknown(str(symbol), sorted(map(str, known)))}")
        self._check_divisors(name, value)
        return value

    def _check_divisors(self, name: str, expression: sympy.Expr) -> None:
        """That nothing is divided by parameters that are declared as 0."""
        nothing = {p.quantity.symbol: 0 for p in self._parameters if p.quantity.value == 0}
        for power in expression.atoms(sympy.Pow):
            if power.exp.is_negative and power.base.subs(nothing) == 0:
                by = ", ".join(sorted(str(symbol) for symbol in power.base.free_symbols if symbol in nothing))
                raise DeclarationError(
                    f"{_here()}: {name} divides by {power.base}, which is 0 with {by} = 0; declare another value"
                )

    def _check_unit(self, name: str, expression: sympy.Expr, unit: str) -> None:
        """That an expression is in the unit that was declared for it."""
        states = [q for q, _, _ in self._states.values()]
        others = [p.quantity for p in self._parameters] + [d.quantity for d in self._definitions]
        known = {TIME: "s", **{q.symbol: q.unit for q in (*self._inputs, *states, *others)}}
        known |= {rate(q): per_second(q.unit) for q in self._inputs}
        wrong = fault(name, expression, unit, known)
        if wrong:
            raise DeclarationError(f"{_here()}: {wrong}")

    def _check_equilibrium(self, name: str, rest: Expression | None, unit: str) -> None:
        """That a value at rest is an expression of what is declared, in its state's unit, once all is declared."""
        if isinstance(rest, str):
            raise DeclarationError(
                f"{self._lines[name]}: state {name!r}: equilibrium: expected an expression but was given {rest!r}"
            )
        if rest is not None:
            self._check_unit(f"the equilibrium of {name}", self._known(f"the equilibrium of {name}", rest), unit)

    def _moving(self) -> dict[sympy.Symbol, float]:
        """The nominal values of inputs and states."""
        return {q.symbol: q.nominal for q in (*self._inputs, *(q for q, _, _ in self._states.values()))}

    def _sizes(self) -> dict[sympy.Symbol, sympy.Expr | float]:
        """Usual values: parameters have theirs, inputs and states their nominal ones; definitions stand for theirs."""
        found: dict[sympy.Symbol, sympy.Expr | float] = {TIME: 0.0}
        found |= {p.quantity.symbol: float(p.quantity.value or 0.0) for p in self._parameters}
        found |= self._moving()
        found |= {rate(q): 0.0 for q in self._inputs}
        return found | {d.quantity.symbol: d.expression for d in self._definitions}


def _unknown(symbol: str, known: Sequence[str]) -> str:
    """What is wrong with a symbol that is not known, and what to do."""
    if symbol == str(TIME):
        return "which is not declared; the time since the start is a state: t = m.state('t', 's'), m.derivative(t, 1)"
    if symbol in known:
        return f"but another symbol of that name than the declared one; use what the declaration of {symbol} returned"
    return f"which is not declared before it{nearest(symbol, [n for n in known if n != str(TIME)])}"


def _here() -> str:
    """File and line of the nearest caller outside this file, its `__init__` and the standard library."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename in OWN:
        frame = frame.f_back
    return f"{Path(frame.f_code.co_filename).name}, line {frame.f_lineno}"


@contextlib.contextmanager
def _located() -> Iterator[None]:
    """Errors of the finished model, with the line that asked for it."""
    try:
        yield
    except DeclarationError as problem:
        raise DeclarationError(f"{_here()}: {problem}") from None
