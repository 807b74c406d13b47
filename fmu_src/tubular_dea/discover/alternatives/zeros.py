"""Checks of zeros: are those that the files seem to have such as sensors have, and is an offset more than a zero?

Zeros are taken off each file before errors are told, so a plant that differs between files, or an effect that shifts an
output, can pass for one. Where a zero would have to be far larger than the plant declares, the model does not explain
that file.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...identify.study.nuisances import own_numbers
from ...identify.study.study import Study
from ...laws import Path
from ..options.options import Option

# Set by judgement. Check: `pytest tests/test_zeros.py`,
# `python -m blind.score --nulls 12 --conventions laser_zero monitor_zeros --seed 1000`
IMPOSSIBLE = 20.0  # [1] times the usual zero of an output beyond which a file's is none

# Set by measurement: where pressures move at once, zeros that differ pass for gains, and -34 Pa in common is left of
# them (usual: 130); offsets of the bench begin at 0.6. Check: `python -m blind.score --nulls 1 --seed 1400002`
USUAL = 0.5  # [1] times the usual zero of a signal up to which an offset that all files have is a zero


@dataclass(frozen=True)
class Shift:
    """What a file's `output` would have to be off by, `value` [SI], in the piece of this name."""

    output: str
    piece: str
    value: float


def impossible(study: Study, chosen: Option) -> Shift | None:
    """The zero of an output, in any piece, that is farthest beyond what zeros are; None where all are possible."""
    found: dict[float, Shift] = {}
    for piece, own in own_numbers(study, chosen.ids, chosen.fitted.values):
        for name, value in own.items():
            if name in study.noise and study.zero(name) > 0:
                found[abs(value) / study.zero(name)] = Shift(name, piece.name, value)
    most = max(found, default=0.0)
    return found[most] if most > IMPOSSIBLE else None


def as_usual(study: Study, option: Option, effect: str) -> bool:
    """Whether an effect of an option is an offset of a signal no larger than its zero usually is."""
    signal = next((p.name for p in study.plant.places if isinstance(p, Path) and p.id("offset") == effect), "")
    sizes = [abs(option.fitted.values[n]) for n in study.catalogue[effect].off if n in option.fitted.names]
    return 0 < max(sizes, default=0.0) <= USUAL * study.zero(signal)
