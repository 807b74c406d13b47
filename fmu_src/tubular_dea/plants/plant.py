"""The definition of a plant: a model, its recorded signals, and the places where effects may act.

::

     inputs                    model                      outputs
    ---[ path ]--->  balances, coefficients, ...  ---[ path ]---> recorded
          ^                ^            ^                ^
          |                |            |                |
        places: where a law (offset, lag, friction, power, ...) or an effect of the plant's own may act

A plant file holds one value `PLANT = Plant(model, inputs, outputs, places)`; `identify`, `close-loop`, `build`,
`simulate` and `sweep` take it by `--plant FILE.py`. The engine behind them knows plants, places, laws and recordings,
and no quantity of any plant by name. `cosim_examples/plants` has three to copy from.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from numbers import Real
from types import MappingProxyType

import numpy as np
import sympy

from ..laws import Coefficient, Path, Place, check, effects_at, laws
from ..model.declare import DeclarationError, Model, Quantity, nearest, rate
from ..model.effect import Effect
from ..protocol import Protocol

Values = Mapping[str, float]
Drives = Sequence[Protocol]

# Set by judgement: 200 Pa and 200 V for the tube. Check: `pytest tests/test_reading.py -k nothing_moves`
AT_REST = 0.002  # [1] of an input's largest plausible value: what moves by less is at rest


@dataclass(frozen=True)
class Input:
    """A recorded signal that drives the model; `name` is the model's input.

    Between samples it is `held` (a set point, or a switch), linear (the default), or `band_limited` (an analogue signal
    behind a filter). What a meter or a weather station writes is the `mean` over the time since the sample before: a
    held input then has each value up to its time, not from there on. A recording whose largest value (SI) is not
    between `least` and `most` was labelled with a wrong unit.
    `zero` is the usual size of a monitor's own zero error (SI; 0: there is none); those found may differ between files
    by up to three times as much, and errors are told without them. Without it (None), a search assumes zeros where they
    explain what effects would have to, and says so. `channel` is the name in reports of effects on its path into the
    plant. `direct` says whether an output follows it at once; None: as the plant's model has it.
    """

    name: str
    held: bool = False
    band_limited: bool = False
    least: float = 0.0
    most: float = math.inf
    zero: float | None = None
    channel: str = ""
    direct: bool | None = None
    mean: bool = False

    def __post_init__(self) -> None:
        _check_numbers(self, "least", "most", "zero")
        if self.mean and not self.held:
            raise DeclarationError(
                f"Input({self.name!r}): expected held=True beside mean=True, as a mean says nothing of the course; or "
                "leave out mean"
            )
        if self.held and self.band_limited:
            raise DeclarationError(
                f"Input({self.name!r}): expected held or band_limited but was given both; held is for set points and "
                "switches, band_limited for an analogue signal behind a filter"
            )

    @property
    def known_zero(self) -> float:
        """The usual size of its zero error where that is declared, else 0."""
        return self.zero or 0.0

    @property
    def little(self) -> float:
        """What it moves by at rest, at most; 0 where no largest value is declared."""
        return AT_REST * self.most if math.isfinite(self.most) else 0.0

    @property
    def linear(self) -> bool:
        """Whether it is linear between samples."""
        return not self.held and not self.band_limited


@dataclass(frozen=True)
class Output:
    """A recorded signal that the model is compared with; `name` is the model's output for the sensor's reading.

    `columns` are the headings under which it may stand in a file, each with the name of a parameter that is subtracted
    from it, or "" (default: its own name). `multiples` are headings of what is a heading's own multiple: {"diameter":
    ("radius", 2)}. `rest` is what the output reads in a plant at rest, where that is known.
    `zero` is the usual size of the sensor's own zero error, another one in each file (SI; 0: there is none); those
    found may differ between files by up to ten times as much, and errors are told without them. A file that would need
    twenty times as much is said, and is not explained. Without it (None), a search assumes zeros where they explain
    what effects would have to, and says so.
    `required` is False for a second output that files may have. `feels_rates` is True for one that an input's rate
    drives (a current): where inputs move fast nobody knows it to better than a part of a sample, so that it takes no
    part in fits, and tells effects apart that explain the other outputs alike.
    """

    name: str
    columns: Mapping[str, str] = field(default_factory=dict)
    least: float = 0.0
    most: float = math.inf
    zero: float | None = None
    channel: str = "sensor"
    rest: float | None = None
    required: bool = True
    feels_rates: bool = False
    multiples: Mapping[str, tuple[str, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check_numbers(self, "least", "most", "zero", "rest")

    @property
    def known_zero(self) -> float:
        """The usual size of its zero error where that is declared, else 0."""
        return self.zero or 0.0

    @property
    def headings(self) -> tuple[str, ...]:
        """All names under which it may stand in a file, the usual one first."""
        return tuple(self.columns) or (self.name,)

    @property
    def change(self) -> str:
        """The heading of its change, from whose numbers nothing is subtracted; the usual one where there is none."""
        return next((h for h, parameter in self.columns.items() if not parameter), self.headings[0])

    @property
    def size_at_rest(self) -> str:
        """The parameter that is subtracted under one of its headings; "" where there is none."""
        return next((parameter for parameter in self.columns.values() if parameter), "")


def _check_numbers(signal: Input | Output, *names: str) -> None:
    """`DeclarationError` for a size that is no number, as "5 um" is not, or one below 0 that cannot be."""
    for name in names:
        value = getattr(signal, name)
        number = isinstance(value, Real) and not isinstance(value, bool) and not math.isnan(value)
        if value is not None and not (number and (value >= 0 or name in ("rest", "most"))):
            wanted = "a number" if name in ("rest", "most") else "a number that is not negative"
            raise DeclarationError(
                f"{type(signal).__name__}({signal.name!r}): {name}: expected {wanted} (in SI units) but was given "
                f"{value!r}"
            )


@dataclass(frozen=True)
class Exchange:
    """Parameters that may be exchanged without changing the outputs: `pairs` of names, both ways.

    `ordered` tells whether values are in the order in which they are reported.
    """

    pairs: Mapping[str, str]
    ordered: Callable[[Values], bool]


@dataclass(frozen=True)
class Stage:
    """A step of a staged fit: `names` from the experiments that `select` picks from the protocols (numbers of them).

    `prepare` may move the values before the step.
    """

    names: tuple[str, ...]
    words: str
    select: Callable[[Drives], list[int]]
    prepare: Callable[[Values], Values] = dict


class _Effects(dict[str, Effect]):
    """Effects by id; a name that is none says what is like it."""

    def __missing__(self, name: str) -> Effect:
        raise KeyError(f"no effect {name!r}{nearest(name, self)}")


@dataclass(frozen=True)
class Plant:
    """A model with its signals, places and effects. `DeclarationError` if these name what the model does not have.

    `own` are the plant's own effects by id. `geometry` names parameters that `bench.toml` may set. `starts` are named
    starting values for fits beside the declared ones; `safer` moves values to where the model is more
    likely to be solvable, tried in turn; `restart` names parameters that a search does not bring back by itself.
    `standard` makes the protocols that are usual on a bench, by name, `experiments` feasible ones, with their
    descriptions, within the largest inputs recorded. `latent` holds, by channel, effects that stand for anything that
    acts there; without it they are made from the places. `own_channels` are those of the model's own parameters. A
    recording has at least `least_samples`, lasts at least `shortest` [s] and has at most `coarsest` [s] between
    samples. Inputs faster than `bandwidth` [Hz] hardly reach the outputs. `file` is where it was declared, as
    `--plant` has it.
    """

    model: Model
    inputs: Sequence[Input]
    outputs: Sequence[Output]
    places: Sequence[Place] = ()
    own: Mapping[str, Effect] = field(default_factory=dict)
    geometry: Sequence[str] = ()
    exchanges: Sequence[Exchange] = ()
    stages: Sequence[Stage] = ()
    starts: Mapping[str, Values] = field(default_factory=dict)
    safer: Sequence[Callable[[Values], Values]] = ()
    restart: Sequence[str] = ()
    standard: Callable[[], dict[str, Protocol]] | None = None
    experiments: Callable[[Mapping[str, float]], dict[str, Protocol]] | None = None
    latent: Mapping[str, Effect] = field(default_factory=dict)
    own_channels: Mapping[str, str] = field(default_factory=dict)
    least_samples: int = 50
    shortest: float = 0.0
    coarsest: float = math.inf
    bandwidth: float = math.inf
    file: str = ""

    def __post_init__(self) -> None:
        self._check_kinds()
        driven = [q.name for q in self.model.inputs]
        for signal in self.inputs:
            if signal.name not in driven:
                raise DeclarationError(
                    f"{self.name}: Input({signal.name!r}): {self.model.name} has no such input"
                    f"{nearest(signal.name, driven)}"
                )
        missing = [name for name in driven if name not in [s.name for s in self.inputs]]
        if missing:
            raise DeclarationError(
                f"{self.name}: expected an Input for every input of {self.model.name} but there is "
                f"none for {missing[0]!r}"
            )
        if not self.outputs:
            raise DeclarationError(f"{self.name}: expected at least one Output but was given none")
        for output in self.outputs:
            if output.name not in self.model.outputs:
                raise DeclarationError(
                    f"{self.name}: Output({output.name!r}): {self.model.name} puts out no such "
                    f"quantity{nearest(output.name, self.model.outputs)}"
                )
            if _constant(self.model, output.name):
                raise DeclarationError(
                    f"{self.name}: Output({output.name!r}) depends on no state and no input of {self.model.name}: it "
                    "would never change; look at its equation"
                )
        for what, names in self._named().items():
            for name in names:
                if name not in self.model.parameter_values():
                    raise DeclarationError(
                        f"{self.name}: {what}: {self.model.name} has no parameter {name!r}"
                        f"{nearest(name, self.model.parameter_values())}"
                    )
        self._check_used()
        self._check_multiples()
        self._check_once()
        self._check_places()
        at_once = _at_once(self.model, [o.name for o in self.outputs])
        inputs = [s if s.direct is not None else replace(s, direct=s.name in at_once) for s in self.inputs]
        object.__setattr__(self, "inputs", tuple(inputs))

    def _check_kinds(self) -> None:
        """`DeclarationError` for a model, a list or a signal that is none."""
        if not isinstance(self.model, Model):
            raise DeclarationError(
                f"Plant: model: expected a model, as m.model(), but was given a {type(self.model).__name__}"
            )
        for what, given in (("inputs", self.inputs), ("outputs", self.outputs), ("places", self.places)):
            if not isinstance(given, Sequence) or isinstance(given, str):
                raise DeclarationError(
                    f"{self.name}: {what}: expected a list, as {what}=[...], but was given {given!r}"
                )
            kinds, words = {
                "inputs": (Input, "Input"),
                "outputs": (Output, "Output"),
                "places": (Place, "Path, Balance or Coefficient"),
            }[what]
            other = next((one for one in given if not isinstance(one, kinds)), None)
            if isinstance(other, str):
                raise DeclarationError(
                    f"{self.name}: {what}: expected {words}, as {words.split(',')[0]}({other!r}), but was given the "
                    f"name {other!r} alone"
                )
            if other is not None:
                raise DeclarationError(
                    f"{self.name}: {what}: expected {words} of tubular_dea.plants but was given {other!r}"
                )

    def _check_used(self) -> None:
        """`DeclarationError` for a tunable parameter on which nothing depends."""
        model, named = self.model, {name for names in self._named().values() for name in names}
        used = _used(model) | named
        idle = next((p.quantity.name for p in model.parameters if p.tunable and p.quantity.name not in used), None)
        if idle:
            raise DeclarationError(
                f"{self.name}: the parameter {idle!r} is in no equation of {model.name}, so no recording can tell its "
                "value; put it where it belongs, or take it out"
            )

    def _check_multiples(self) -> None:
        """`DeclarationError` for a multiple of what is no heading, or that is none."""
        for output in self.outputs:
            for name, (heading, times) in output.multiples.items():
                if heading not in output.headings or not times:
                    raise DeclarationError(
                        f"{self.name}: Output({output.name!r}): multiples: expected {name!r} to be some times one of "
                        f"{', '.join(output.headings)} but was given {times:g} times {heading!r}"
                    )

    def _check_once(self) -> None:
        """`DeclarationError` for a signal that is given twice."""
        signals: dict[str, Sequence[Input | Output]] = {"inputs": self.inputs, "outputs": self.outputs}
        for what, given in signals.items():
            names = [signal.name for signal in given]
            for number, signal in enumerate(given):
                if signal.name in names[:number]:
                    raise DeclarationError(
                        f"{self.name}: {type(signal).__name__}({signal.name!r}) is given twice in {what}; give it once"
                    )

    def _check_places(self) -> None:
        """`DeclarationError` for a place that the model does not have, or that is given twice."""
        for number, place in enumerate(self.places):
            check(self.model, place)
            if place in self.places[:number]:
                raise DeclarationError(
                    f"{self.name}: {type(place).__name__}({place.name!r}) is given twice in places; give it once"
                )

    def _named(self) -> dict[str, list[str]]:
        """Every parameter that a plant names, by where."""
        return {
            "geometry": list(self.geometry),
            **{f"Output({o.name!r})": [n for n in o.columns.values() if n] for o in self.outputs},
            "exchanges": [n for e in self.exchanges for pair in e.pairs.items() for n in pair],
            **{f"Stage({s.words!r})": list(s.names) for s in self.stages},
            **{f"starts {name!r}": list(values) for name, values in self.starts.items()},
            "restart": list(self.restart),
        }

    @property
    def restarts(self) -> dict[str, float]:
        """The declared values of the parameters that a search does not bring back by itself."""
        return {n: v for n, v in self.model.parameter_values().items() if n in self.restart}

    @property
    def free_starts(self) -> dict[str, str]:
        """The parameters that are unknown start values: "each" recording has its own, or they are "shared" by all."""
        return {p.quantity.name: p.start for p in self.model.parameters if p.start}

    @property
    def each_start(self) -> dict[str, float]:
        """The unknown start values of which each recording has its own, with their usual sizes (SI)."""
        return {n: self.quantity(n).nominal for n, kind in self.free_starts.items() if kind == "each"}

    @property
    def name(self) -> str:
        """The model's name."""
        return self.model.name

    @cached_property
    def catalogue(self) -> Mapping[str, Effect]:
        """All candidate effects by id: the plant's own, then every law at its places, but those its model has."""
        found, held = dict(self.own), [s.name for s in self.inputs if s.held]
        for number, place in enumerate(self.places):
            there = effects_at(self.model, place, held)
            if any(type(p) is type(place) and p.name == place.name for p in self.places[:number]):
                there = self._of_another(place, held)
            found |= {effect.id: effect for effect in there if effect.id not in found}
        kept = {name: effect for name, effect in found.items() if name not in self.model.effects}
        return MappingProxyType(_Effects(kept))

    def _of_another(self, place: Place, held: Sequence[str]) -> list[Effect]:
        """The effects at a place that is declared once more because it may depend on a further quantity: only what that
        changes, as shaft_dependence_twist for Coefficient("shaft", of="twist") after one of another quantity."""
        if not isinstance(place, Path | Coefficient) or not place.of:
            return effects_at(self.model, place, held)
        alone = {effect.id for effect in effects_at(self.model, replace(place, of="", laws=None, names={}), held)}
        own = [law for law in laws() if place.asks(law) and f"{law}({place.name})" not in alone]
        named = {law: f"{place.name}_{law}_{place.of}" for law in own} | dict(place.names)
        return [e for e in effects_at(self.model, replace(place, names=named), held) if e.id not in alone]

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels in which effects may act, by the plant's own names."""
        return tuple(dict.fromkeys(effect.channel for effect in self.catalogue.values()))

    def quantity(self, name: str) -> Quantity:
        """A quantity of the model."""
        return self.model.quantity(name)

    def ordered(self, values: Values) -> dict[str, float]:
        """The same values with exchangeable parameters in the order in which they are reported."""
        found = dict(values)
        for exchange in self.exchanges:
            if set(exchange.pairs) <= set(found) and not exchange.ordered(found):
                found = {name: found[exchange.pairs.get(name, name)] for name in found}
        return found

    def exchanged(self, values: Values) -> dict[str, str]:
        """By name, where each parameter's value comes from when `values` are put in order."""
        names = {name: name for name in values}
        for exchange in self.exchanges:
            if set(exchange.pairs) <= set(values) and not exchange.ordered(values):
                names = {name: names[exchange.pairs.get(name, name)] for name in names}
        return names

    def with_model(self, model: Model) -> Plant:
        """The plant with another model (other values, or an effect already in it)."""
        return replace(self, model=model)

    def headers(self) -> str:
        """A line of headings as it is expected in a file."""
        cells = ["time [s]", *(f"{s.name} [{self.quantity(s.name).unit}]" for s in self.inputs)]
        cells += [f"{o.headings[0]} [{self.quantity(o.name).unit}]" for o in self.outputs if o.required]
        return ",".join(cells)

    def nominal_inputs(self, drives: Drives) -> dict[str, float]:
        """The largest value of every input over some protocols, with its sign."""
        joined = {s.name: np.concatenate([d.inputs[s.name] for d in drives]) for s in self.inputs}
        return {name: float(v[int(np.argmax(np.abs(v)))]) for name, v in joined.items()}


def _reached(model: Model, outputs: Sequence[str]) -> set[sympy.Symbol]:
    """All symbols that some outputs depend on at once."""
    reached = {model.quantity(name).symbol for name in outputs}
    for definition in reversed(model.definitions):
        if definition.quantity.symbol in reached:
            reached |= sympy.sympify(definition.expression).free_symbols
    return reached


def _used(model: Model) -> set[str]:
    """The names of all quantities that some equation, start or delay of a model uses."""
    equations = [d.expression for d in model.definitions]
    equations += [e for s in model.states for e in (s.derivative, s.start, s.equilibrium) if e is not None]
    equations += [e for d in model.discretes for e in (d.start, d.update)]
    symbols = set().union(*(sympy.sympify(e).free_symbols for e in equations))
    switch = {model.curve.start_switch} if model.curve else set()
    return {str(symbol) for symbol in symbols} | {d.by for d in model.delays} | switch


def _constant(model: Model, output: str) -> bool:
    """Whether an output depends on parameters alone."""
    fixed = {p.quantity.symbol for p in model.parameters} | {d.quantity.symbol for d in model.definitions}
    return _reached(model, [output]) <= fixed


def _at_once(model: Model, outputs: Sequence[str]) -> set[str]:
    """The inputs with direct feedthrough to some output."""
    reached = _reached(model, outputs)
    return {q.name for q in model.inputs if reached & {q.symbol, rate(q)}}
