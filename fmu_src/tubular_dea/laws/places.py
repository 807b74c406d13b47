"""Places of a plant where laws may act, and the candidates that result there."""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from types import MappingProxyType, ModuleType

from ..model.declare import DeclarationError, Model, check_name, nearest
from ..model.effect import Effect


@dataclass(frozen=True)
class Place:
    """A place of the quantity `name`, which reports call by its `words` (default: the name).

    `channel` is its name in reports (default: the name).

    `names` gives laws at this place the plant's own ids, {"offset": "pressure_offset"}; the parameters of a law are
    named after that id, or as in {"lag.tau": "tau_sensor"}. `laws`, if given, are the only ones that may act here.
    `signal` is the name of the quantity once a law changes it (default: made from the name).
    `seconds` is the usual size of times there, a lag's or a delay's (default: the geometric mean of the model's own
    time constants; an instrument's lag is then taken to be usually a tenth of it), `size` that of the quantity
    (default: its `nominal` value). Nominal values should be the usual ones of a record: an offset of more than a
    twentieth of the nominal value, for example, is no candidate.
    """

    name: str
    words: str = field(default="", kw_only=True)
    channel: str = field(default="", kw_only=True)
    names: Mapping[str, str] = field(default_factory=dict, kw_only=True)
    laws: tuple[str, ...] | None = field(default=None, kw_only=True)
    signal: str = field(default="", kw_only=True)
    seconds: float | None = field(default=None, kw_only=True)
    size: float | None = field(default=None, kw_only=True)

    def id(self, law: str) -> str:
        """The id of a law's effect here."""
        return self.names.get(law, f"{law}({self.name})")

    def asks(self, law: str) -> bool:
        """Whether a law of that name may act here."""
        return self.laws is None or law in self.laws


@dataclass(frozen=True)
class Path(Place):
    """The way of an input into the plant, or of an output (a definition that is put out) to its record.

    `of` may name a quantity that disturbs the signal on its way (cross-talk). `delayed` is True if the record of an
    input may be delayed (a probe's filter, another clock), so that it acts before it is recorded.
    """

    of: str = ""
    delayed: bool = False


@dataclass(frozen=True)
class Balance(Place):
    """The balance behind the derivative of the state `name`, to which a term may be added.

    In mechanics `name` is a velocity, in m/s, rad/s or units like these: friction and drag act there, and springs and
    stops too if `displacement` names the state whose rate it is. Another state is a store (a level, a pressure, a
    charge); `below` is the state that receives what spills over.
    """

    displacement: str = ""
    below: str = ""


@dataclass(frozen=True)
class Coefficient(Place):
    """A factor on the definition (or the parameter) `name`, which may depend on the quantity `of`."""

    of: str = ""


@cache
def laws() -> Mapping[str, ModuleType]:
    """Every law by its name: the modules beside this one that have a `law`."""
    package = __name__.rpartition(".")[0]
    path = importlib.import_module(package).__path__
    names = sorted(m.name for m in pkgutil.iter_modules(path) if not m.name.startswith("_"))
    modules = {name: importlib.import_module(f"{package}.{name}") for name in names if name != "places"}
    return MappingProxyType(modules)


def kinds(law: ModuleType) -> str:
    """The kinds of places at which a law may act, in words."""
    return ", ".join(kind.__name__ for kind in (Path, Balance, Coefficient) if kind in law.KINDS)


def effects_at(model: Model, place: Place, held: Collection[str] = ()) -> list[Effect]:
    """Every law that may act at a place, as an effect of this model; `DeclarationError` for what is no place.

    `held` are the inputs that are held between samples.
    """
    from ._site import site  # which reads the places

    found = []
    check(model, place)
    at = replace(site(model, place), held=frozenset(held))
    for name in place.laws if place.laws is not None else laws():
        module = laws()[name]
        effect = module.law(replace(at, law=name)) if isinstance(place, module.KINDS) else None
        if effect is not None:
            found.append(replace(effect, documentation=(module.__doc__ or "").strip()))
        elif place.laws is not None and place.names.get(name, f"{name}({place.name})") not in model.effects:
            raise DeclarationError(f"{at}: the law {name} cannot act there: it needs {module.NEEDS}")
    return found


def check(model: Model, place: Place) -> None:
    """`DeclarationError` where the place names what the model does not have, or what is of another kind."""
    from ._site import SignalSite, site

    _check_settings(place)
    at = site(model, place)
    if isinstance(place, Path) and place.delayed and not (isinstance(at, SignalSite) and at.is_input):
        raise DeclarationError(
            f"Path({place.name!r}): delayed: expected an input, whose record may be so; an output has the law delay"
        )
    if isinstance(at, SignalSite) and at.is_input and at.signal not in at.ready(model).quantities():
        raise DeclarationError(
            f"Path({place.name!r}): no equation uses this input, so nothing can act on its way; leave the place out"
        )
    for name in (*place.names.values(), *filter(None, [place.signal])):
        check_name(f"{type(place).__name__}({place.name!r})", name)
    for name in (*(place.laws or ()), *(key.split(".")[0] for key in place.names)):
        if name not in laws():
            raise DeclarationError(
                f"{type(place).__name__}({place.name!r}): there is no law {name!r}{nearest(name, laws())}"
            )
    for name in place.laws or ():
        if not isinstance(place, laws()[name].KINDS):
            raise DeclarationError(f"{at}: the law {name} cannot act there: it needs {laws()[name].NEEDS}")


def _check_settings(place: Place) -> None:
    """`DeclarationError` for usual sizes that are no positive numbers, and for laws that are no list."""
    where = f"{type(place).__name__}({place.name!r})"
    for what, value in (("seconds", place.seconds), ("size", place.size)):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if value is not None and not (number and 0 < float(value) < math.inf):
            raise DeclarationError(f"{where}: {what}: expected a positive number but was given {value!r}")
    if isinstance(place.laws, str):
        raise DeclarationError(f"{where}: laws: expected a list of names, as [{place.laws!r}], but was given a text")
