"""A co-simulation as data: slaves, a table of connections, parameter values, known signals, event announcements.

Usage::

    system = System(
        slaves={"tube": Path("TubularDEA.fmu"), "heart": Path("AorticWindkessel.fmu")},
        connections=[Connection("heart.aortic_pressure", "tube.pressure"),
                     Connection("tube.tube_flow", "heart.tube_flow"),
                     Connection("drive.voltage", "tube.voltage")],
        sources={"drive": Protocol.of([0, 10], voltage=[5000, 5000])},
        parameters={"tube.start_at_equilibrium": 1},
        events=["heart.next_r_wave"],
    )
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..model.compose import CouplingError, check_units, end
from ..model.declare import nearest
from ..protocol import Protocol


@dataclass(frozen=True)
class Connection:
    """`source` "part.output" drives `target` "part.input". A `sampled` input keeps, over each step, the value that
    the source has at the start of the step (a controller's); others are interpolated over the step."""

    source: str
    target: str
    sampled: bool = False


@dataclass(frozen=True)
class System:
    """`slaves` are FMI 2 co-simulation FMUs by name; `sources` known signals by name (SI units); `parameters` start
    values by "part.variable" (SI units); `events` outputs that hold the time [s] of the next event."""

    slaves: Mapping[str, Path]
    connections: Sequence[Connection]
    sources: Mapping[str, Protocol] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    events: Sequence[str] = ()


@dataclass(frozen=True)
class Port:
    """A variable of a slave as the couplings see it; one that is not `continuous` has no slope."""

    reference: int
    unit: str | None
    nominal: float
    continuous: bool = True


@dataclass(frozen=True)
class Ports:
    """What a slave offers: its inputs and outputs by name, all Real, and the names of its parameters."""

    inputs: dict[str, Port]
    outputs: dict[str, Port]
    parameters: tuple[str, ...]


@dataclass(frozen=True)
class Wiring:
    """The checked connections: for each "part.input" its source and whether it is sampled; the stepping order of the
    slaves; which of them form the loop that an implicit scheme iterates."""

    source: dict[str, str]
    sampled: dict[str, bool]
    order: tuple[str, ...]
    loop: tuple[int, int]


def wire(system: System, ports: Mapping[str, Ports]) -> Wiring:
    """The connections of `system`, checked against what its slaves offer; `CouplingError` says what is wrong."""
    source: dict[str, str] = {}
    sampled: dict[str, bool] = {}
    for connection in system.connections:
        _check(system, ports, connection)
        if connection.target in source:
            raise CouplingError(
                f"{connection.target} is connected to {source[connection.target]} and to {connection.source}; keep one"
            )
        source[connection.target], sampled[connection.target] = connection.source, connection.sampled
    _check_parameters(system, ports)
    _check_open(system, ports, source)
    for name in system.events:
        part, variable = end(ports, name)
        if variable not in ports[part].outputs:
            raise CouplingError(
                f"event {name}: {part} has no output {variable!r}{nearest(variable, ports[part].outputs)}"
            )
    followed = _followed(ports, source, sampled)
    order = _order(list(ports), followed)
    return Wiring(source, sampled, order, _loop(order, followed))


def _check(system: System, ports: Mapping[str, Ports], connection: Connection) -> None:
    part, output = end({**ports, **system.sources}, connection.source)
    target, into = end(ports, connection.target)
    if into not in ports[target].inputs:
        raise CouplingError(f"{connection.target}: {target} has no input {into!r}{nearest(into, ports[target].inputs)}")
    if part in system.sources:
        signals = system.sources[part].inputs
        if output not in signals:
            raise CouplingError(f"{connection.source}: {part} has no signal {output!r}{nearest(output, signals)}")
        return
    if output not in ports[part].outputs:
        raise CouplingError(
            f"{connection.source}: {part} has no output {output!r}{nearest(output, ports[part].outputs)}"
        )
    units = ports[part].outputs[output].unit, ports[target].inputs[into].unit
    if units[0] and units[1]:
        check_units((connection.source, units[0]), (connection.target, units[1]))


def _check_parameters(system: System, ports: Mapping[str, Ports]) -> None:
    for name, value in system.parameters.items():
        part, variable = end(ports, name)
        known = [*ports[part].parameters, *ports[part].inputs]
        if variable not in known:
            raise CouplingError(f"{name}: {part} has no parameter {variable!r}{nearest(variable, known)}")
        if not np.isfinite(value):
            raise CouplingError(f"{name}: expected a finite number but was given {value}")


def _check_open(system: System, ports: Mapping[str, Ports], source: Mapping[str, str]) -> None:
    missing = [
        f"{part}.{name}"
        for part, p in ports.items()
        for name in p.inputs
        if f"{part}.{name}" not in source and f"{part}.{name}" not in system.parameters
    ]
    if missing:
        raise CouplingError(
            f"nothing is connected to {', '.join(missing)}; connect it, or give it a constant among the parameters"
        )


def _followed(
    ports: Mapping[str, Ports], source: Mapping[str, str], sampled: Mapping[str, bool]
) -> dict[str, set[str]]:
    """For each slave, the slaves whose outputs it follows within a step."""
    followed: dict[str, set[str]] = {part: set() for part in ports}
    for target, origin in source.items():
        part = origin.partition(".")[0]
        if part in ports and not sampled[target]:
            followed[target.partition(".")[0]].add(part)
    return followed


def _reaches(start: str, goal: str, followed: Mapping[str, set[str]]) -> bool:
    seen: set[str] = set()
    left = [start]
    while left:
        for part in followed[left.pop()] - seen:
            if part == goal:
                return True
            seen.add(part)
            left.append(part)
    return False


def _order(parts: list[str], followed: Mapping[str, set[str]]) -> tuple[str, ...]:
    """As given, but each after those it follows, unless they go round."""
    order: list[str] = []
    left = list(parts)
    while left:

        def waits(part: str) -> bool:
            return any(other in left and not _reaches(other, part, followed) for other in followed[part])

        ready = next(part for part in left if not waits(part))
        left.remove(ready)
        order.append(ready)
    return tuple(order)


def _loop(order: tuple[str, ...], followed: Mapping[str, set[str]]) -> tuple[int, int]:
    """The stretch of the order that holds every slave which follows itself through others."""
    places = [i for i, part in enumerate(order) if _reaches(part, part, followed)]
    return (places[0], places[-1] + 1) if places else (0, 0)
