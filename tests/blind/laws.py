"""Whether a verdict keeps every law: a plant with one law in it, at its usual size, is simulated and handed in.

Three records each, with levels and sums of sines, own parameters 10 % off at most, white noise of 0.2 % of the range. A
law is `named`, `in the set` of what cannot be told from the one that is named, or `not seen` where the plant's own
parameters make up for it (nothing is left but noise); else the answer is `wrong`.

    python -m blind.laws                        # all laws at all places of three plants, an hour of processor time
    python -m blind.laws tanks "power(flow_1)"  # one law
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np

import tubular_dea as td
from test_laws import PLACES, at, shown
from tubular_dea.model.declare import Model
from tubular_dea.model.effect import Effect
from tubular_dea.plants import Input, Output, Plant

SAMPLES, FINE = 1200, 8  # of a record, and points of what drives it between two
NOISE = 2e-3  # of the largest range of a record
LENGTHS = {"oscillator": 12.0, "tanks": 60.0, "sensor": 10.0}
RANGES = {
    "oscillator": {"force": (-3.0, 3.0)},
    "tanks": {"pump": (0.5, 9.0)},
    "sensor": {"load": (-150.0, 150.0), "supply": (9.0, 11.0)},
}


def driven(number: int, low: float, high: float, random: np.random.Generator) -> np.ndarray:
    """What drives a record: levels with smooth ramps in the first, sums of sines in the others, after a rest."""
    points = (SAMPLES - 1) * FINE + 1
    part = np.linspace(0, 1, points)
    if number == 0:
        begins = np.sort(random.uniform(0.08, 1.0, 9))
        levels = np.append(0.0, random.uniform(low, high, 9))[np.searchsorted(begins, part, side="right")]
        ramp = np.hanning(points // 64)
        padded = np.pad(levels, ramp.size, mode="edge")
        return np.convolve(padded, ramp / ramp.sum(), mode="same")[ramp.size : -ramp.size]
    k = np.arange(1, 10 if number == 1 else 30)
    sines = np.cos(2 * np.pi * np.outer(part, k) + random.uniform(0, 2 * np.pi, k.size)).sum(axis=1)
    signal = 0.5 * (low + high) + sines / np.abs(sines).max() * 0.5 * (high - low) / number
    return signal * (0.5 - 0.5 * np.cos(np.pi * np.clip(part / 0.04 - 1, 0, 1)))


def recorded(name: str, law: Effect | None) -> dict[str, dict[str, np.ndarray]]:
    """Three records of a plant with a law in it."""
    base: Model = PLACES[name][0]()
    off = np.random.default_rng(5)
    true = {p.quantity.name: p.quantity.value * (1 + 0.1 * off.uniform(-1, 1)) for p in base.parameters}
    kernel = td.Kernel(law(base) if law else base)
    values = true | (shown(law) if law else {})
    fine = np.linspace(0, LENGTHS[name], (SAMPLES - 1) * FINE + 1)
    output, time, tables = base.outputs[0], fine[::FINE], {}
    for number in range(3):
        random = np.random.default_rng(100 + number)
        drive = {q: driven(number, *ends, random) for q, ends in RANGES[name].items()}
        read = kernel.simulate(td.Protocol.of(fine, **drive), fine, values, tolerance=1e-9)[output][::FINE]
        columns = {f"{q} [{base.quantity(q).unit}]": v[::FINE] for q, v in drive.items()}
        tables[f"record {number}"] = {"time [s]": time, **columns, f"{output} [{base.quantity(output).unit}]": read}
    heading = f"{output} [{base.quantity(output).unit}]"
    noise = NOISE * max(float(np.ptp(t[heading])) for t in tables.values())
    for number, table in enumerate(tables.values()):
        table[heading] = table[heading] + noise * np.random.default_rng(10 + number).standard_normal(SAMPLES)
    return tables


def answer(name: str, law: Effect | None) -> tuple[str, td.DiscoveryResult]:
    """How the verdict on a plant with a law in it is to be called, and the result."""
    base, places = PLACES[name][0](), PLACES[name][1]
    plant = Plant(base, [Input(q) for q in RANGES[name]], [Output(base.outputs[0])], places=list(places))
    found = td.discover(td.read_recordings(recorded(name, law), plant=plant))
    ids = [e.id for e in found.effects]
    if law is None or not ids:
        return ("wrong" if ids or found.verdict != "no_effect" else "not seen"), found
    if ids == [law.id]:
        return "named", found
    return ("in the set" if any(law.id in e.equivalent for e in found.effects) else "wrong"), found


def main(arguments: Sequence[str]) -> None:
    """Print a line for every law."""
    plants, ids = arguments[:1] or PLACES, arguments[1:]
    if unknown := {*plants} - {*PLACES}:
        raise SystemExit(f"there is no plant {', '.join(unknown)}: expected one of {', '.join(PLACES)}")
    for name in plants:
        laws: dict[str, Effect | None] = {e.id: e for i in range(len(PLACES[name][1])) for e in at(name, i)}
        if unknown := {*ids} - {*laws}:
            raise SystemExit(f"{name} has no law {', '.join(unknown)}: expected some of {', '.join(laws)}")
        for law in [laws[i] for i in ids] or [None, *laws.values()]:
            said, found = answer(name, law)
            named = ", ".join(f"{e.id} ({', '.join(e.equivalent)})" if e.equivalent else e.id for e in found.effects)
            print(f"{said:10} {law.id if law else 'nothing':28} {found.verdict:16} {named}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
