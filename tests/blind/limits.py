"""Whether effects are seen at their detection limits: how many of some tubes' are named at one and two times these.

`python -m blind.limits --seed 500 --sets 2 --conventions edges amplifier` (from tests/). Of each set the recordings
with nothing hidden are searched for the limits; then the same tube with one effect of that size is recorded again.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import tubular_dea as td
from blind.laboratory import Laboratory, laboratory, write

TIMES = (1.0, 2.0)
OWN_MASS = 4.618e-3  # kg: the bench counts an added mass in these
PER_UNIT: Mapping[str, tuple[float, float]] = {  # bench's number = what it is at nothing + factor times the limit (SI)
    "electrode_resistance": (0.0, 1.0),
    "sensor_delay": (0.0, 1.0),
    "sensor_lag": (0.0, 1.0),
    "pressure_delay": (0.0, 1.0),
    "voltage_delay": (0.0, 1.0),
    "added_mass": (0.0, 1 / OWN_MASS),
    "pressure_offset": (0.0, 1.0),
    "radius_gain": (1.0, 1.0),
    "passive_layer_stiffness": (0.0, 1.0),
    "stretch_dependent_viscosity": (0.0, 1.0),
}


def answer(lab: Laboratory) -> td.DiscoveryResult:
    """What the package says of a set's recordings."""
    with tempfile.TemporaryDirectory() as folder:
        write(lab, Path(folder) / "set")
        return td.discover(Path(folder) / "set")


def named(found: td.DiscoveryResult, effect: str) -> bool:
    """Whether an effect is in the answer."""
    return any(effect in (entry["id"], *entry["equivalent"]) for entry in found.content["effects"])


def main() -> None:
    """Print one line an effect and set."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=500)
    parser.add_argument("--sets", type=int, default=2)
    parser.add_argument("--conventions", nargs="+", default=["edges", "amplifier"])
    parser.add_argument("--effects", nargs="+", default=list(PER_UNIT), choices=list(PER_UNIT))
    options = parser.parse_args()
    for seed in range(options.seed, options.seed + options.sets):
        nothing = laboratory(seed, only=options.conventions)
        limits = answer(nothing).content["invisible"]
        for effect in options.effects:
            (limit,) = limits[effect].values()
            said = []
            for times in TIMES if limit is not None else ():
                off, factor = PER_UNIT[effect]
                tube = replace(nothing.tube, hidden={effect: (off + factor * times * limit,)})
                found = answer(replace(nothing, tube=tube))
                names = [e["id"] for e in found.content["effects"]]
                said.append(f"{times:g} times: {'named' if named(found, effect) else names or found.verdict}")
            print(f"seed {seed} {effect} limit {limit}: {', '.join(said)}", flush=True)


if __name__ == "__main__":
    main()
