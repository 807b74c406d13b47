"""The assisted heart for the page: its wiring as C tables (`wiring.h`, for coupled.c), its parts as C sources."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import fmpy
import numpy as np

from ..cosim.heart_assist import heart_assist
from ..cosim.master import SCHEMES, Options
from ..cosim.system import Port, Ports, System, Wiring, wire
from ..emit.variables import Variable, guid, variables
from ..export.compile import native_source
from ..export.package import MASTER_SOURCES, sources
from ..model.declare import Model
from ..model.patients import PATIENTS
from ..protocol import Protocol

OPTIONS = Options(order=1)  # as the command `assist` runs
VARIABLE = Options(step=10 * OPTIONS.step, order=1, variable=True, tolerance=1e-4)  # and with --variable
EXPORTS = ("coupled_run", "coupled_said")


@dataclass(frozen=True)
class Coupling:
    """C `sources` by prefix and `shared` ones."""

    sources: dict[str, dict[str, str]]
    shared: dict[str, str]


def coupling(parts: Mapping[str, Model]) -> Coupling:
    """The C of the paced assisted heart with these parts."""
    shared = {name: native_source(name) for name in MASTER_SOURCES}
    shared |= {name: _fmi_header(name) for name in ("fmi2FunctionTypes.h", "fmi2TypesPlatform.h")}
    shared["coupled.c"] = (resources.files("tubular_dea") / "lab" / "coupled.c").read_text(encoding="utf-8")
    shared["wiring.h"] = _printed(parts).text()
    return Coupling({f"{part}_": sources(model, 2) for part, model in parts.items()}, shared)


def signals_of(parts: Mapping[str, Model]) -> tuple[list[str], list[str]]:
    """The parts in the order in which they are stepped, and the names of all signals."""
    printed = _printed(parts)
    return list(printed.wiring.order), printed.signals


def _printed(parts: Mapping[str, Model]) -> _Printed:
    ports = {part: _ports(variables(model)) for part, model in parts.items()}
    constant = Protocol.of([0.0, 1.0], pace=[1.0, 1.0])
    system = heart_assist({part: Path(part) for part in parts}, PATIENTS["healthy"], None, constant)
    wiring = wire(system, ports)
    known = [f"{name}.{signal}" for name, protocol in system.sources.items() for signal in protocol.inputs]
    signals = [*known, *(f"{part}.{name}" for part in wiring.order for name in ports[part].outputs)]
    return _Printed(parts, ports, wiring, system, signals, known)


def _ports(table: Sequence[Variable]) -> Ports:
    """What the FMU of a model offers, in the order of its description."""

    def of(causality: str) -> dict[str, Port]:
        return {
            v.name: Port(i, v.quantity.unit, abs(v.quantity.nominal) or 1.0)
            for i, v in enumerate(table, start=1)
            if v.causality == causality and v.quantity.type == "Real"
        }

    return Ports(of("input"), of("output"), tuple(v.name for v in table if v.causality == "parameter"))


def _fmi_header(name: str) -> str:
    return (Path(fmpy.__file__).parent / "c-code" / name).read_text(encoding="utf-8")


@dataclass(frozen=True)
class _Printed:
    """`wiring.h`: parts, wires and settings as constants. Signals are numbered as cosim/master.py numbers them."""

    parts: Mapping[str, Model]
    ports: Mapping[str, Ports]
    wiring: Wiring
    system: System
    signals: list[str]
    known: list[str]

    def text(self) -> str:
        order, w = self.wiring.order, self.wiring
        arrays = [self._arrays(part) for part in order]
        rows = [self._part(part) for part in order]
        followed = {s: t for t, s in w.source.items() if not w.sampled[t] and s not in self.known}
        unknown = sorted(
            {
                self._place(s)
                for t, s in w.source.items()
                if s in followed and not w.sampled[t] and order.index(_part(s)) >= order.index(_part(t))
            }
        )
        watched, events = [self._place(s) for s in followed], [self._place(s) for s in self.system.events]
        o = OPTIONS
        settings = [
            SCHEMES.index(o.scheme),
            o.order,
            int(o.cubic),
            o.restart,
            int(o.variable),
            0.0,
            0.0,
            o.step,
            o.refine,
            o.tolerance,
            o.smallest or o.step / 1000,
            o.iterations,
            *w.loop,
        ]
        lists = {"unknown": unknown, "events": events, "watched": watched}
        tail = [f"{len(values)}, {name}" for name, values in lists.items()]
        scale = [1.0] * len(self.known) + [
            self.ports[_part(s)].outputs[_name(s)].nominal for s in self.signals[len(self.known) :]
        ]
        return "\n".join(
            [
                f"#define N_PARTS {len(order)}",
                f"#define N_WIRES {len(w.source)}",
                f"#define N_SIGNALS {len(self.signals)}",
                f"#define N_TABLES {len(self.known)}",
                f"#define SLAVE_TOLERANCE {o.slave_tolerance!r}",
                *(line for part in order for line in self._declared(part)),
                *arrays,
                f"static const Part parts[N_PARTS] = {{{', '.join(rows)}}};",
                f"static const Wire wires[N_WIRES] = {{{', '.join(self._wire(t, s) for t, s in w.source.items())}}};",
                *(_array("int", name, values) for name, values in lists.items()),
                _array("double", "scale", scale),
                f"#define SETTINGS {{{', '.join([*map(repr, settings), *tail])}}}",
                "",
            ]
        )

    def _place(self, signal: str) -> int:
        return self.signals.index(signal)

    def _inputs(self, part: str) -> list[str]:
        return [name for name in self.ports[part].inputs if f"{part}.{name}" in self.wiring.source]

    def _shared(self, part: str) -> list[str]:
        return [name for name in self.ports[part].outputs if f"{part}.{name}" in self.wiring.source.values()]

    def _declared(self, part: str) -> list[str]:
        return [f"fmi2{name}TYPE {part}_fmi2{name};" for name in (*_PART, *_SLAVE)]

    def _arrays(self, part: str) -> str:
        ports, w = self.ports[part], self.wiring
        inputs, shared = self._inputs(part), self._shared(part)
        return "\n".join(
            [
                _array("unsigned", f"{part}_inputs", [ports.inputs[n].reference for n in inputs]),
                _array("int", f"{part}_signals", [self._place(w.source[f"{part}.{n}"]) for n in inputs]),
                _array("int", f"{part}_held", [int(w.sampled[f"{part}.{n}"]) for n in inputs]),
                _array("unsigned", f"{part}_outputs", [p.reference for p in ports.outputs.values()]),
                _array("unsigned", f"{part}_shared", [ports.outputs[n].reference for n in shared]),
                _array("int", f"{part}_shared_signals", [self._place(f"{part}.{n}") for n in shared]),
            ]
        )

    def _part(self, part: str) -> str:
        inputs, shared, outputs = self._inputs(part), self._shared(part), self.ports[part].outputs
        first = self._place(f"{part}.{next(iter(outputs))}") if outputs else 0
        functions = [f"(void *){part}_fmi2{name}" for name in _SLAVE]
        slave = [
            "0",
            *functions,
            str(len(inputs)),
            f"{part}_inputs",
            f"{part}_signals",
            f"{part}_held",
            str(len(outputs)),
            f"{part}_outputs",
            str(first),
            str(len(shared)),
            f"{part}_shared",
            f"{part}_shared_signals",
        ]
        own = [f'"{part}"', f'"{guid(self.parts[part])}"', *(f"{part}_fmi2{name}" for name in _PART)]
        return f"{{{', '.join([*own, '{' + ', '.join(slave) + '}'])}}}"

    def _wire(self, target: str, source: str) -> str:
        order, table = self.wiring.order, source in self.known
        into = self.ports[_part(target)].inputs[_name(target)].reference
        origin = self.known.index(source) if table else order.index(_part(source))
        reference = 0 if table else self.ports[_part(source)].outputs[_name(source)].reference
        return f"{{{order.index(_part(target))}, {into}, {int(table)}, {origin}, {reference}}}"


# The functions of an FMU that the start needs, and those of the master's Slave, in the order of the C structures.
_PART = (
    "Instantiate",
    "SetupExperiment",
    "EnterInitializationMode",
    "ExitInitializationMode",
    "SetInteger",
    "SetBoolean",
    "FreeInstance",
)
_SLAVE = (
    "SetReal",
    "SetRealInputDerivatives",
    "GetReal",
    "GetRealOutputDerivatives",
    "DoStep",
    "GetFMUstate",
    "SetFMUstate",
    "FreeFMUstate",
)


def _part(name: str) -> str:
    return name.partition(".")[0]


def _name(name: str) -> str:
    return name.partition(".")[2]


def _array(kind: str, name: str, values: Sequence[float]) -> str:
    """A constant array; C has none of size zero."""
    return f"static const {kind} {name}[] = {{{', '.join(map(repr, np.array(values).tolist())) or '0'}}};"
