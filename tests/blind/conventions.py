"""The conventions of a laboratory: each is drawn by itself, so that one may be switched off and the rest stays."""

from __future__ import annotations

import hashlib
from collections.abc import Collection
from dataclasses import dataclass, field, fields, replace

import numpy as np

from blind.protocols import Edge
from blind.tubes import TABLE_I

MAX_SAMPLES = 250_000  # of a set: what a set may hold at most (issue 11 times that many)


@dataclass(frozen=True)
class Format:
    """How a file is written: units (name in the header, SI per unit), signs and lines around the numbers."""

    delimiter: str = ","
    decimal: str = "."
    suffix: str = ".csv"
    encoding: str = "utf-8"
    brackets: str = "[]"
    capital: bool = False
    shuffled: bool = False
    comments: tuple[str, ...] = ()
    remarks: bool = False  # a column of words
    units: tuple[tuple[str, str, float], ...] = (
        ("time", "s", 1.0),
        ("pressure", "Pa", 1.0),
        ("voltage", "V", 1.0),
        ("radius", "m", 1.0),
        ("current", "uA", 1e-6),
        ("trigger", "V", 1.0),
    )


@dataclass(frozen=True)
class Conventions:
    """What was drawn; the plain values are those of the bench sets."""

    edges: bool = False  # voltage switches between samples
    amplifier: Edge = field(default_factory=Edge)
    monitor_zeros: bool = False
    monitor_gains: bool = False
    laser_zero: bool = False
    hum: float = 0.0  # Hz
    drift: bool = False  # of the sensor, small
    colour: float = 0.0  # AR(1) coefficient of the laser's noise at the (first) rate
    bits: int = 0
    rates: tuple[float, ...] = (250.0,)
    antialias: bool = False  # of the monitors
    steep: str = ""  # what makes their filters steeper than second order: butterworth, chebyshev, linear_phase
    format: Format = field(default_factory=Format)
    start: str = "rested"  # or equilibrium, cut, mixed
    beats: int = 0  # in the heart's file
    order: bool = False  # one after the other, without rest
    trigger: bool = False
    current: bool = False
    gaps: bool = False  # samples are missing
    not_a_number: bool = False
    displacement: bool = False
    geometry: tuple[tuple[str, float], ...] = tuple(TABLE_I.items())
    files: int = 8
    own_protocols: bool = False
    rounded: bool = False  # pressure has no corners
    noise: float = 1.0  # times the bench sets' of all sensors
    noise_told: bool = False
    start_told: bool = False

    def names(self) -> list[str]:
        """The conventions that differ from the bench sets'."""
        plain = Conventions()
        return [f.name for f in fields(self) if getattr(self, f.name) != getattr(plain, f.name)]

    def wall(self) -> tuple[float, float]:
        """How much more pressure and voltage this geometry's wall takes than Table I's."""
        here = dict(self.geometry)
        thick = here["h_o"] / here["r_o"] / (TABLE_I["h_o"] / TABLE_I["r_o"])
        return thick, here["h_ao"] / TABLE_I["h_ao"]


NAMES = tuple(f.name for f in fields(Conventions))


def stream(seed: int, *words: object) -> np.random.Generator:
    """Random numbers of their own for every seed and words."""
    digest = hashlib.sha256(repr(words).encode()).digest()
    return np.random.default_rng([seed, int.from_bytes(digest[:8], "big")])


def draw(seed: int, only: Collection[str] | None = None) -> Conventions:
    """The conventions of a seed; `only` these where they are given, the others plain."""
    unknown = set(only or ()) - set(NAMES)
    if unknown:
        raise ValueError(f"expected conventions among {', '.join(NAMES)} but found {', '.join(sorted(unknown))}")
    drawn = {}
    for name, (share, value) in CHANCES.items():
        random = stream(seed, "convention", name)
        wanted = random.random() < share if only is None else name in only
        if wanted:
            drawn[name] = value(random)
    return _possible(Conventions(**drawn))


def _possible(c: Conventions) -> Conventions:
    """Without what no laboratory would do: very long files at very high rates, an order of rested experiments."""
    changed = {f.name: getattr(c, f.name) for f in fields(c)}
    if not c.antialias:
        changed["steep"] = ""
    if c.beats:
        changed["rates"] = tuple(min(r, 500.0 if c.beats < 100 else 250.0) for r in c.rates)
    if c.order:
        changed["start"] = "rested"
        changed["files"] = max(c.files, 2)
    if c.current:  # an amplifier that gives its tube some mA and not an ampere
        changed["amplifier"] = replace(c.amplifier, rise=max(c.amplifier.rise, 2e-3))
    if len(c.rates) > 1 and c.files == 1:
        changed["rates"] = c.rates[:1]
    return Conventions(**changed)


def _amplifier(random: np.random.Generator) -> Edge:
    rise = float(np.exp(random.uniform(np.log(0.3e-3), np.log(5e-3))))
    return Edge(rise, str(random.choice(["linear", "smooth", "exponential"])))


def _rates(random: np.random.Generator) -> tuple[float, ...]:
    choice = [50.0, 100.0, 200.0, 400.0, 500.0, 1000.0, 2000.0, 5000.0]
    first = float(random.choice(choice))
    return (first, float(random.choice(choice))) if random.random() < 0.3 else (first,)


def _format(random: np.random.Generator) -> Format:
    delimiter = str(random.choice([",", ";", "\t"]))
    decimal = "," if delimiter != "," and random.random() < 0.5 else "."
    micro = "\u00b5m" if random.random() < 0.5 else "um"
    units = (
        _unit(random, "time", ("s", 1.0), ("ms", 1e-3)),
        _unit(
            random,
            "pressure",
            ("mmHg", 133.322),
            ("kPa", 1e3),
            ("mbar", 100.0),
            ("hPa", 100.0),
            ("cmH2O", 98.0665),
            ("Pa", 1.0),
            ("bar", 1e5),
            ("psi", 6894.757293),
        ),
        _unit(random, "voltage", ("kV", 1e3), ("V", 1.0)),
        _unit(random, "radius", ("mm", 1e-3), (micro, 1e-6), ("m", 1.0), ("cm", 1e-2)),
        _unit(random, "current", ("uA", 1e-6), ("mA", 1e-3)),
        ("trigger", "V", 1.0),
    )
    comments = ("# rig 3", "# operator: none") if random.random() < 0.5 else ()
    return Format(
        delimiter,
        decimal,
        str(random.choice([".csv", ".txt", ".dat"] + [".tsv"] * (delimiter == "\t"))),
        str(random.choice(["utf-8", "utf-8-sig", "latin-1", "utf-16"])),
        str(random.choice(["[]", "()"])),
        bool(random.random() < 0.5),
        bool(random.random() < 0.5),
        comments,
        bool(random.random() < 0.3),
        units,
    )


def _unit(random: np.random.Generator, name: str, *units: tuple[str, float]) -> tuple[str, str, float]:
    return (name, *units[random.integers(len(units))])


def _geometry(random: np.random.Generator) -> tuple[tuple[str, float], ...]:
    r_o = random.uniform(10e-3, 20e-3)
    return (
        ("r_o", round(r_o, 5)),
        ("l_o", round(r_o * random.uniform(1.4, 2.0), 5)),
        ("h_o", round(r_o * random.uniform(0.05, 0.08), 6)),
        ("h_ao", round(random.uniform(60e-6, 140e-6), 7)),
        ("rho", 1e3),
        ("n_layers", float(random.integers(4, 13))),
    )


def _yes(_: np.random.Generator) -> bool:
    return True


CHANCES = {  # of each convention, and what is drawn for it
    "edges": (0.6, _yes),
    "amplifier": (0.3, _amplifier),
    "monitor_zeros": (0.35, _yes),
    "monitor_gains": (0.2, _yes),
    "laser_zero": (0.35, _yes),
    "hum": (0.25, lambda random: float(random.choice([50.0, 60.0]))),
    "drift": (0.15, _yes),
    "colour": (0.5, lambda random: float(random.choice([random.uniform(0.2, 0.9), random.uniform(0.9, 0.97)]))),
    "bits": (0.35, lambda random: int(random.choice([8, 10, 12, 14, 16], p=[0.1, 0.2, 0.3, 0.2, 0.2]))),
    "rates": (0.5, _rates),
    "antialias": (0.15, _yes),
    "steep": (0.5, lambda random: str(random.choice(["butterworth", "chebyshev", "linear_phase"]))),
    "format": (0.35, _format),
    "start": (0.3, lambda random: str(random.choice(["equilibrium", "cut", "mixed"]))),
    "beats": (0.15, lambda random: int(random.choice([60, 240]))),
    "order": (0.12, _yes),
    "trigger": (0.12, _yes),
    "current": (0.15, _yes),
    "gaps": (0.1, _yes),
    "not_a_number": (0.05, _yes),
    "displacement": (0.15, _yes),
    "geometry": (0.2, _geometry),
    "files": (0.3, lambda random: int(random.integers(1, 11))),
    "own_protocols": (0.6, _yes),
    "rounded": (0.4, _yes),
    "noise": (0.3, lambda random: float(np.exp(random.uniform(np.log(0.3), np.log(2.0))))),
    "noise_told": (0.1, _yes),
    "start_told": (0.1, _yes),
}
