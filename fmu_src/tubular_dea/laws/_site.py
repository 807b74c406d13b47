"""A place found in a model: what a law reads there (unit, sizes, names) and how it changes the model there."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import sympy

from ..model.change import arriving, at_rest, at_start, effective, reading, with_input_delay, with_output_delay
from ..model.declare import DeclarationError, Definition, Model, Quantity, State, nearest, rate
from ..model.effect import Effect
from ..model.scales import at_first, rate_size, seconds
from ..model.units import UnitError, combined, factor
from .places import Balance, Coefficient, Path, Place

ACTUATORS = (
    *("saturation", "dead_zone", "power", "quadratic", "cubic", "hysteresis"),
    *("rate_limit", "slow_release", "echo", "creep"),
)
"""Laws that, at an input, belong to what drives the plant and not to the monitor that recorded it."""
QUICK = 0.1  # of the plant's own times: how long the lag of an instrument usually is
ORDINARY = 0.3  # of the farther bound: the size of a parameter that usually is nothing


@dataclass(frozen=True)
class Knob:
    """A parameter of a law: its usual value, and what it is for the search (see `Effect`)."""

    quantity: Quantity
    typical: float
    off: float | None
    on: float | None
    shapes: tuple[float, ...]
    trade: float
    refine: bool
    strengths: tuple[float, ...]
    hard: bool

    @property
    def symbol(self) -> sympy.Symbol:
        """Its symbol."""
        return self.quantity.symbol


@dataclass(frozen=True)
class Site:
    """A place in a model, as the law `law` finds it. `quantity` is what the place names."""

    model: Model
    place: Place
    quantity: Quantity
    law: str = ""
    held: frozenset[str] = frozenset()  # the inputs that are held between samples

    def __str__(self) -> str:
        return f"{self.model.name}: {type(self.place).__name__}({self.place.name!r})"

    @property
    def unit(self) -> str:
        """Unit of the quantity."""
        return self.quantity.unit

    @property
    def nominal(self) -> float:
        """Usual size of the quantity."""
        return self.place.size or abs(self.quantity.nominal) or 1.0

    @property
    def seconds(self) -> float:
        """Usual size of times here."""
        return self.place.seconds or seconds(self.model)

    @property
    def quickness(self) -> float:
        """How long an instrument's own lag usually is, over `seconds`.

        Sensors and amplifiers are chosen to be faster than the plant: where nobody said how fast, `QUICK`.
        """
        return QUICK if isinstance(self.place, Path) and not self.place.seconds else 1.0

    @property
    def drives(self) -> bool:
        """Whether this is the path of an input."""
        return self.place.name in [q.name for q in self.model.inputs]

    @property
    def words(self) -> str:
        """The quantity in a sentence."""
        return self.place.words or self.place.name.replace("_", " ")

    def name(self, part: str = "") -> str:
        """What a law calls something here: `place_law_part`, or as the place's `names` say."""
        given = self.place.names.get(f"{self.law}.{part}" if part else self.law, "")
        prefix = self.place.names.get(self.law, f"{self.place.name}_{self.law}")
        return given or (f"{prefix}_{part}" if part else prefix)

    def per(self, *powers: tuple[str, int]) -> str:
        """A unit made of others."""
        return combined(*powers)

    def knob(
        self,
        part: str,
        unit: str,
        description: str,
        typical: float,
        low: float,
        high: float,
        *,
        off: float | None = None,
        on: float | None = None,
        shapes: Sequence[float] = (),
        trade: float = 0.0,
        refine: bool = False,
        strengths: Sequence[float] = (),
        hard: bool = False,
    ) -> Knob:
        """A parameter of the law."""
        start = off if off is not None else typical
        usual = abs(typical) or ORDINARY * max(abs(low), abs(high))
        q = Quantity(self.name(part), unit, description, start, "", low, high, nominal=usual)
        return Knob(q, typical, off, on, tuple(shapes), trade, refine, tuple(strengths), hard)

    def time_constant(
        self, description: str, typical: float, low: float, high: float, times: Sequence[float], trade: float = 0.0
    ) -> Knob:
        """The time constant of the law; its sizes are parts of the usual time."""
        shapes = [part * self.seconds for part in times]
        usual, least, most = (part * self.seconds for part in (typical, low, high))
        return self.knob("tau", "s", description, usual, least, most, shapes=shapes, trade=trade)

    def effect(
        self,
        summary: str,
        source: str,
        apply: Callable[[Model], Model],
        *knobs: Knob,
        exact: bool = False,
        levels: Mapping[str, str] | None = None,
        limits: Sequence[str] = (),
        lasting: bool = False,
        delicate: bool = False,
    ) -> Effect:
        """The law as an effect; `limits` are laws at the same place."""
        named = [(k.quantity.name, k) for k in knobs]
        return Effect(
            self.place.id(self.law),
            self.place.channel or self.place.name,
            summary,
            apply,
            tuple(replace(k.quantity, source=source) for k in knobs),
            off={n: k.off for n, k in named if k.off is not None},
            typical={n: k.typical for n, k in named},
            on={n: k.on for n, k in named if k.on is not None},
            shapes={n: k.shapes for n, k in named if k.shapes},
            refine=tuple(n for n, k in named if k.refine),
            trades={n: k.trade for n, k in named if k.trade},
            strengths={n: k.strengths for n, k in named if k.strengths},
            hard=tuple(n for n, k in named if k.hard),
            exact=exact,
            levels=levels or {},
            limits=tuple(self.place.id(law) for law in limits),
            lasting=lasting,
            delicate=delicate,
            recording=isinstance(self.place, Path) and (not self.drives or self.law not in ACTUATORS),
        )

    def constant(
        self, model: Model, part: str, unit: str, value: float, description: str, before: str | None = None
    ) -> tuple[Model, sympy.Symbol]:
        """A number with a unit and a name, declared before `before`."""
        q = Quantity(self.name(part), unit, description, nominal=abs(value) or 1.0)
        first = before or (model.definitions[0].quantity.name if model.definitions else None)
        return model.extend(definitions=[Definition(q, sympy.Float(value))], before=first), q.symbol

    def state(
        self,
        model: Model,
        part: str,
        unit: str,
        description: str,
        derivative: Callable[[sympy.Symbol], sympy.Expr],
        start: sympy.Expr,
        nominal: float = 1.0,
    ) -> tuple[Model, sympy.Symbol]:
        """A state of the law's own that starts at `start` and settles to what that is at rest."""
        q = Quantity(self.name(part), unit, description, nominal=nominal)
        made = State(q, derivative(q.symbol), at_start(model, start), at_rest(model, start))
        return model.extend(states=[made]), q.symbol


@dataclass(frozen=True)
class SignalSite(Site):
    """A signal on its path, or a coefficient: a law takes its expression and replaces it by another."""

    is_input: bool = False
    is_parameter: bool = False

    @property
    def signal(self) -> str:
        """The name under which the quantity acts."""
        if isinstance(self.place, Coefficient):
            return (self.place.signal or f"{self.place.name}_effective") if self.is_parameter else self.place.name
        return self.place.signal or f"{self.place.name}_{'felt' if self.is_input else 'reading'}"

    @property
    def may_be_delayed(self) -> bool:
        """Whether the record of this input may be delayed."""
        return self.is_input and isinstance(self.place, Path) and self.place.delayed

    @property
    def is_constant(self) -> bool:
        """Whether nothing moves it: a parameter, or a definition that depends on parameters alone."""
        if self.is_parameter:
            return True
        if self.is_input:
            return False
        fixed = {
            *(d.quantity.symbol for d in self.model.definitions),
            *(p.quantity.symbol for p in self.model.parameters),
        }
        return self._reached <= fixed

    @property
    def is_steered(self) -> bool:
        """Whether an input moves it at once, or through states that it does not move itself: the spool of a valve."""
        inputs = {q.symbol for q in self.model.inputs}
        if self._reached & inputs:
            return True
        moves = {s.quantity.symbol: sympy.sympify(s.derivative).free_symbols for s in self.model.states}
        known, seen = self._reached, set[sympy.Symbol]()
        while more := (known & moves.keys()) - seen:
            seen |= more
            driven = self._made_of(set().union(*(moves[m] for m in more)))
            if self.quantity.symbol in driven:
                return False
            known = known | driven
        return bool(known & inputs)

    @property
    def is_static(self) -> bool:
        """Whether no state moves it: it follows the inputs alone."""
        return not self._reached & {s.quantity.symbol for s in self.model.states}

    @property
    def has_rate(self) -> bool:
        """Whether inputs alone move it that are not held, and whose rates the model does not use already."""
        moved = [q for q in self.model.inputs if q.symbol in self._reached]
        used = [d.expression for d in self.model.definitions] + [s.derivative for s in self.model.states]
        rates = {rate(q) for q in moved} & set().union(*(sympy.sympify(e).free_symbols for e in used))
        return self.is_static and not rates and not self.held & {q.name for q in moved}

    @property
    def _reached(self) -> set[sympy.Symbol]:
        """Everything that it is made of, definitions in between too."""
        return self._made_of({self.quantity.symbol})

    def _made_of(self, symbols: set[sympy.Symbol]) -> set[sympy.Symbol]:
        """Some symbols, and everything that they are made of."""
        reached = set(symbols)
        for d in reversed(self.model.definitions):
            if d.quantity.symbol in reached:
                reached |= sympy.sympify(d.expression).free_symbols
        return reached

    @property
    def is_load(self) -> bool:
        """Whether the equilibrium curve balances this input: changes of it at rest must be inverted there."""
        return self.is_input and self.model.curve is not None and self.model.curve.load == self.place.name

    @property
    def other(self) -> Quantity | None:
        """The quantity that the place says it may depend on."""
        of = getattr(self.place, "of", "")
        return self.model.quantity(of) if of else None

    def start_of(self, model: Model, of: Quantity) -> tuple[Model, sympy.Expr]:
        """The model, and where a quantity starts as declared.

        A temperature in kelvin does not begin at 0: a law that counted from there would change what the plant's own
        parameters are at rest.
        """
        first = at_first(self.model, of.name)
        if first == 0.0:
            return model, sympy.Integer(0)
        return self.constant(model, "start", of.unit, first, f"{of.name} at the start", before=self.name("from"))

    def ready(self, model: Model) -> Model:
        """The model with the signal under its name."""
        if self.is_input:
            return arriving(model, self.place.name, self.signal)
        if self.is_parameter:
            return effective(model, self.place.name, self.signal)
        return model if isinstance(self.place, Coefficient) else reading(model, self.place.name, self.signal)

    def taken(self, model: Model) -> tuple[Model, sympy.Symbol]:
        """The model, and the signal as it arrives at this law."""
        model = self.ready(model)
        q = model.quantity(self.signal)
        come = replace(q, name=self.name("from"), description=f"{q.description}; before {self.law.replace('_', ' ')}")
        speed = f"{self.signal}_rate" if self._moves(model) else self.signal
        first = next(d.quantity.name for d in model.definitions if d.quantity.name in (self.signal, speed))
        made = Definition(come, model.expression(self.signal))
        if speed != self.signal:
            moving = replace(model.quantity(speed), name=self.name("from_rate"))
            model = model.extend(definitions=[Definition(moving, model.expression(speed))], before=speed)
        return model.extend(definitions=[made], before=first), come.symbol

    def followed(self, model: Model, tau: Knob, how: str) -> tuple[Model, sympy.Symbol, sympy.Symbol]:
        """The model, the signal as it comes to this law, and a state that follows it with the time constant `tau`."""
        model, signal = self.taken(model)
        words = f"{self.words.capitalize()}, {how}"
        model, slow = self.state(
            model, "slow", self.unit, words, lambda z: (signal - z) / tau.symbol, signal, self.nominal
        )
        return model, signal, slow

    def chased(
        self,
        model: Model,
        state: tuple[str, str],
        quick: tuple[str, float, str],
        rate: Callable[[sympy.Symbol, sympy.Symbol, sympy.Symbol], sympy.Expr],
    ) -> tuple[Model, sympy.Symbol, sympy.Symbol]:
        """The model, the signal as it comes to this law, and a state that goes after it by `rate(signal, z, quick)`.

        `state` is its name and description; `quick` a time too short to matter: name, part of the usual one, words.
        """
        model, signal = self.taken(model)
        name, share, words = quick
        model, soon = self.constant(model, name, "s", share * self.seconds, words, before=self.name("from"))
        model, z = self.state(
            model, state[0], self.unit, state[1], lambda z: rate(signal, z, soon), signal, self.nominal
        )
        return model, signal, z

    def put(self, model: Model, value: sympy.Expr, inverse: Callable[[sympy.Expr], sympy.Expr] | None = None) -> Model:
        """The model with `value` in the place of the signal that was taken; `inverse` turns it round at rest."""
        model = model.replace(self.signal, value)
        if self._moves(model):
            model = model.replace(f"{self.signal}_rate", self._speed(model, value))
        if self.is_load and inverse and model.curve:
            held = sympy.Symbol(f"{self.signal}_held", real=True)
            balance = model.curve.balance
            model = model.replace(balance, model.expression(balance).subs(held, inverse(held)))
        return model

    def swinging(
        self, model: Model, signal: sympy.Expr, omega: sympy.Expr, damping: sympy.Expr
    ) -> tuple[Model, sympy.Symbol]:
        """Two states: what follows `signal` as a damped oscillator, and its rate."""
        swung = Quantity(self.name("swing"), self.unit, f"{self.words.capitalize()}, swinging", nominal=self.nominal)
        speed = Quantity(
            self.name("swing_rate"),
            combined((self.unit, 1), ("s", -1)),
            "Its rate",
            nominal=self.nominal / self.seconds,
        )
        pull = omega**2 * (signal - swung.symbol) - 2 * damping * omega * speed.symbol
        still = sympy.Integer(0)
        states = [
            State(swung, speed.symbol, at_start(model, signal), at_rest(model, signal)),
            State(speed, pull, still, still),
        ]
        return model.extend(states=states), swung.symbol

    @property
    def is_late(self) -> bool:
        """Whether the model delays this signal already."""
        delayed = {d.quantity.symbol for d in self.model.delays}
        if self.is_input:
            return any(d.of == self.place.name for d in self.model.delays)
        return bool(delayed & sympy.sympify(self.model.expression(self.place.name)).free_symbols)

    def delayed(self, model: Model, by: Knob) -> Model:
        """The model with the signal delayed by `by` seconds."""
        model = self.ready(model)
        q = model.quantity(self.place.name if self.is_input else self.signal)
        delayed = Quantity(
            self.name("late"), q.unit, f"{q.description}, delayed", nominal=q.nominal, display_unit=q.display_unit
        )
        if self.is_input:
            return with_input_delay(model, delayed, self.place.name, by.quantity.name)
        return with_output_delay(model, delayed, self.place.name, self.signal, by.quantity.name)

    def _moves(self, model: Model) -> bool:
        """Whether the model uses the rate of this input."""
        return self.is_input and f"{self.signal}_rate" in model.quantities()

    def _speed(self, model: Model, value: sympy.Expr) -> sympy.Expr:
        """The rate of `value`: of the signal as it came, and of the states in it."""
        rates = {s.quantity.symbol: s.derivative for s in model.states}
        rates[sympy.Symbol(self.name("from"), real=True)] = sympy.Symbol(self.name("from_rate"), real=True)
        return sympy.Add(*(sympy.diff(value, s) * r for s, r in rates.items() if s in value.free_symbols))


@dataclass(frozen=True)
class BalanceSite(Site):
    """A balance: terms are added to a derivative, or to the definition that stands for it."""

    displaced: Quantity | None = None
    receives: Quantity | None = None

    @property
    def moves(self) -> bool:
        """Whether the balance is that of a speed; else it is that of a store."""
        angular = {"rad", "deg", "rpm"} & {*re.split(r"[./]", self.unit)}
        return self.displaced is not None or alike(self.unit, "m/s") or bool(angular)

    @property
    def travelled(self) -> tuple[str, float]:
        """Unit and usual size of the displacement; without one, of what a speed covers in the usual time."""
        if self.displaced is not None:
            return self.displaced.unit, self.displaced.nominal
        return combined((self.unit, 1), ("s", 1)), self.nominal * self.seconds

    @property
    def rate_unit(self) -> str:
        """Unit of a term of the balance."""
        return combined((self.unit, 1), ("s", -1))

    @property
    def rate_size(self) -> float:
        """Usual size of a term of the balance."""
        return rate_size(self.model, self.place.name)

    @property
    def coordinate(self) -> Quantity:
        """The displacement; in a store, the level itself."""
        return self.displaced or self.quantity

    def rest(self, model: Model) -> tuple[Model, sympy.Symbol]:
        """The model, and what the balance gives so far, under a name of its own."""
        derivative, whole = _derivative(model, self.place.name)
        q = Quantity(self.name("rest"), self.rate_unit, f"Rate of {self.words} without it", nominal=self.rate_size)
        given = model.expression(whole) if whole else derivative
        return model.extend(definitions=[Definition(q, given)], before=whole), q.symbol

    def added(self, model: Model, term: sympy.Expr, state: str = "", part: str = "term") -> Model:
        """The model with a term in the balance of `state` (default: the place's own)."""
        state = state or self.place.name
        derivative, whole = _derivative(model, state)
        unit = combined((model.quantity(state).unit, 1), ("s", -1))
        q = Quantity(
            self.name(part),
            unit,
            f"{self.law.replace('_', ' ').capitalize()} in the balance of {state}",
            nominal=self.rate_size,
        )
        model = model.extend(definitions=[Definition(q, term)], before=whole)
        if whole:
            return model.replace(whole, model.expression(whole) + q.symbol)
        return model.drive(state, derivative + q.symbol)


def _derivative(model: Model, state: str) -> tuple[sympy.Expr, str | None]:
    """The derivative of a state, and the name of the definition that stands for it."""
    derivative = next(s.derivative for s in model.states if s.quantity.name == state)
    return derivative, str(derivative) if derivative in [d.quantity.symbol for d in model.definitions] else None


AnySite = SignalSite | BalanceSite


def site(model: Model, place: Place) -> AnySite:
    """The place in the model; `DeclarationError` that names it, what was expected and what came."""
    inputs = [q.name for q in model.inputs]
    defined = [d.quantity.name for d in model.definitions]
    states = [s.quantity.name for s in model.states]
    parameters = [p.quantity.name for p in model.parameters]
    shown = f"{model.name}: {type(place).__name__}"
    kinds = {
        n: k
        for k, names in (
            ("an input", inputs),
            ("a definition", defined),
            ("a state", states),
            ("a parameter", parameters),
        )
        for n in names
    }

    def known(role: str, name: str, expected: str, allowed: Iterable[str]) -> Quantity:
        there = list(allowed)
        if name in there:
            return model.quantity(name)
        came = f"{name!r}, {kinds[name]}" if name in kinds else repr(name)
        hint = "" if name in kinds else nearest(name, there)
        head = f"({name!r})" if role == "name" else f"({place.name!r}, {role}={name!r})"
        raise DeclarationError(f"{shown}{head}: expected {expected} but was given {came}{hint}")

    if isinstance(place, Path | Coefficient):
        if isinstance(place, Path):
            outputs = [n for n in model.outputs if n in defined]
            q = known("name", place.name, "an input, or an output that is a definition", [*inputs, *outputs])
        else:
            q = known("name", place.name, "a definition or a parameter", [*defined, *parameters])
        if place.of:
            earlier = defined[: defined.index(place.name)] if place.name in defined else []
            expected = f"an input, a state or a definition before {place.name}"
            known("of", place.of, expected, [*inputs, *states, *earlier])
        name = place.name
        return SignalSite(model, place, q, is_input=name in inputs, is_parameter=name in parameters)
    if isinstance(place, Balance):
        q = known("name", place.name, "a state", states)
        x = known("displacement", place.displacement, "a state", states) if place.displacement else None
        if x is not None and not _same(combined((x.unit, 1), ("s", -1)), q.unit):
            raise DeclarationError(
                f"{shown}({place.name!r}, displacement={x.name!r}): expected a displacement whose "
                f"rate is in {q.unit!r}, as {place.name} is; {x.name} is in {x.unit!r}"
            )
        below = known("below", place.below, "a state", states) if place.below else None
        return BalanceSite(model, place, q, displaced=x, receives=below)
    raise DeclarationError(f"{model.name}: expected a Path, a Balance or a Coefficient but was given {place!r}")


def _same(unit: str, other: str) -> bool:
    return alike(unit, other) and abs(factor(unit, other) - 1) < 1e-9


def alike(unit: str, other: str) -> bool:
    """Whether both are units of one kind of quantity."""
    try:
        factor(unit, other)
    except UnitError:
        return False
    return True
