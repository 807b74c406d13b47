"""Several models wired into one: the monolithic system that a co-simulation of the same models approximates.

Usage::

    from tubular_dea.model.compose import compose
    whole = compose("AssistedHeart", {"tube": tubular_dea(), "heart": aortic_windkessel()},
                    [("heart.aortic_pressure", "tube.pressure"), ("tube.tube_flow", "heart.tube_flow")])

Every quantity of part `tube` is called `tube_...`; inputs that nothing is connected to stay inputs of the whole. The
equilibrium curve of a part belongs to that part alone: what needs it (the fold and its margin) is left out.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import sympy

from .declare import DeclarationError, Definition, Model, Parameter, Quantity, State, nearest, rate
from .whole import rename


class CouplingError(DeclarationError):
    """A connection that names what is not there, leaves an input open, or joins different units."""


Connection = tuple[str, str]


def compose(name: str, parts: Mapping[str, Model], connections: Sequence[Connection]) -> Model:
    """One model from `parts`, wired by `connections`: pairs "part.output", "part.input".

    Raises `CouplingError` for unknown or doubly connected variables and for units that differ,
    `DeclarationError` for an algebraic loop.
    """
    for part, model in parts.items():
        if model.discretes or model.delays:
            raise DeclarationError(
                f"{part}: {model.name} is sampled, or has pure delays; expected continuous models: couple it as an FMU"
            )
    wires = _wires(parts, connections)
    renamed = {part: _Renamed(part, model) for part, model in parts.items()}
    definitions = [d for r in renamed.values() for d in r.definitions()]
    definitions += [_wire(renamed, source, target) for target, source in wires.items()]
    states = [s for r in renamed.values() for s in r.states()]
    rates = _wire_rates(renamed, wires)
    definitions = [dataclasses.replace(d, expression=rename(d.expression, rates)) for d in definitions]
    inputs = [r.quantity(q) for part, r in renamed.items() for q in r.model.inputs if f"{part}.{q.name}" not in wires]
    outputs = [r.name(o) for r in renamed.values() for o in r.model.outputs]
    ordered = _ordered(name, definitions)
    known = {d.quantity.name for d in ordered} | {s.quantity.name for s in states}
    return Model(
        name=name,
        description=" and ".join(m.name for m in parts.values()) + ", wired into one system of equations",
        documentation="\n\n".join(m.documentation for m in parts.values()),
        inputs=tuple(inputs),
        parameters=tuple(p for r in renamed.values() for p in r.parameters()),
        definitions=tuple(ordered),
        states=tuple(states),
        outputs=tuple(o for o in outputs if o in known),
    )


def check_units(source: Quantity | tuple[str, str], target: Quantity | tuple[str, str]) -> None:
    """`CouplingError` unless both ends (quantities, or (name, unit)) have the same unit."""
    (a, unit_a), (b, unit_b) = ((q.name, q.unit) if isinstance(q, Quantity) else q for q in (source, target))
    if unit_a != unit_b:
        raise CouplingError(
            f"{a} is in {unit_a!r} but {b} expects {unit_b!r}; connect quantities of the same unit, or convert one"
        )


def end(parts: Mapping[str, object], text: str) -> tuple[str, str]:
    """Part and variable of "part.variable"; `CouplingError` where there is no such part."""
    part, dot, variable = text.partition(".")
    if not dot or not variable:
        raise CouplingError(f"connection: expected 'part.variable' but was given {text!r}")
    if part not in parts:
        raise CouplingError(f"connection {text!r}: there is no part {part!r}{nearest(part, parts)}")
    return part, variable


def _wires(parts: Mapping[str, Model], connections: Sequence[Connection]) -> dict[str, str]:
    """Source by target, both as "part.variable", checked."""
    wires: dict[str, str] = {}
    for source, target in connections:
        (from_part, output), (to_part, into) = end(parts, source), end(parts, target)
        inputs = {q.name: q for q in parts[to_part].inputs}
        if output not in parts[from_part].outputs:
            raise CouplingError(
                f"{source}: {parts[from_part].name} has no output {output!r}{nearest(output, parts[from_part].outputs)}"
            )
        if into not in inputs:
            raise CouplingError(f"{target}: {parts[to_part].name} has no input {into!r}{nearest(into, inputs)}")
        if target in wires:
            raise CouplingError(f"{target} is connected to {wires[target]} and to {source}; keep one")
        unit = (source, parts[from_part].quantity(output).unit)
        check_units(unit, (target, inputs[into].unit))
        wires[target] = source
    return wires


@dataclasses.dataclass(frozen=True)
class _Renamed:
    """A part with its name in front of every quantity."""

    part: str
    model: Model

    def name(self, name: str) -> str:
        return f"{self.part}_{name}"

    def quantity(self, q: Quantity) -> Quantity:
        return dataclasses.replace(q, name=self.name(q.name))

    def symbols(self) -> dict[sympy.Symbol, sympy.Symbol]:
        pairs = {q.symbol: self.quantity(q).symbol for q in self.model.quantities().values()}
        return pairs | {rate(q): rate(self.quantity(q)) for q in self.model.inputs}

    def expression(self, e: sympy.Expr) -> sympy.Expr:
        return rename(e, self.symbols())

    def parameters(self) -> list[Parameter]:
        switch = self.model.curve.start_switch if self.model.curve else None
        return [
            dataclasses.replace(p, quantity=self.quantity(p.quantity))
            for p in self.model.parameters
            if p.quantity.name != switch
        ]

    def states(self) -> list[State]:
        return [
            State(
                self.quantity(s.quantity),
                self.expression(s.derivative),
                self.expression(s.start),
                self.expression(s.start),
            )
            for s in self.model.states
        ]

    def definitions(self) -> list[Definition]:
        """All definitions but those that need the fold."""
        without = {self.model.curve.fold.symbol} if self.model.curve else set()
        kept = []
        for d in self.model.definitions:
            if sympy.sympify(d.expression).free_symbols & without:
                without.add(d.quantity.symbol)
            else:
                kept.append(Definition(self.quantity(d.quantity), self.expression(d.expression)))
        return kept


def _wire(renamed: Mapping[str, _Renamed], source: str, target: str) -> Definition:
    """The connected input as a definition: it is what the source is."""
    (a, output), (b, into) = source.split("."), target.split(".")
    quantity = renamed[b].quantity(renamed[b].model.quantity(into))
    return Definition(
        dataclasses.replace(quantity, value=None, source=f"connected to {source}"),
        sympy.Symbol(renamed[a].name(output), real=True),
    )


def _wire_rates(renamed: Mapping[str, _Renamed], wires: Mapping[str, str]) -> dict[sympy.Symbol, sympy.Expr]:
    """The rates of connected inputs that are used: known where the source is a state."""
    rates: dict[sympy.Symbol, sympy.Expr] = {}
    for target, source in wires.items():
        (a, output), (b, into) = source.split("."), target.split(".")
        used = {s for d in renamed[b].definitions() for s in d.expression.free_symbols}
        symbol = rate(renamed[b].quantity(renamed[b].model.quantity(into)))
        if symbol not in used:
            continue
        derivatives = {s.quantity.name: s.derivative for s in renamed[a].states()}
        if renamed[a].name(output) not in derivatives:
            raise CouplingError(f"{target} needs the rate of {source}, which is not a state; connect a state")
        rates[symbol] = derivatives[renamed[a].name(output)]
    return rates


def _ordered(name: str, definitions: Sequence[Definition]) -> list[Definition]:
    """The definitions so that each comes after those it uses; `DeclarationError` where they go round."""
    left = {d.quantity.symbol: d for d in definitions}
    ordered: list[Definition] = []
    while left:
        ready = [s for s, d in left.items() if not sympy.sympify(d.expression).free_symbols & left.keys()]
        if not ready:
            loop = ", ".join(sorted(str(s) for s in left))
            raise DeclarationError(
                f"{name}: the connections make an algebraic loop through {loop}; one of them must follow a state"
            )
        ordered += [left.pop(s) for s in ready]
    return ordered
