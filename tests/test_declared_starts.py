"""A base that ends far from the plant takes the records' unknown starts along: the search begins at the declared values
too. A coil behind a diode, whose current the base lets run backwards."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.plants import Balance, Build, Input, Output, Plant

TRUE = {"E": 33.0, "g": 8.3, "r": 2.7, "R": 100.0, "C": 3.3e-5}
COIL, STEP, SAMPLES, FINE, NOISE = 1e-3, 2e-5, 400, 100, 0.05


def buck() -> Plant:
    """A converter's mean voltage, a coil, a capacitor and a load; the diode is missing."""
    m = Build("Buck", "A buck converter")
    control = m.input("control", "V", nominal=2.5)
    source, gain = m.parameter("E", "V", 32.0, minimum=0), m.parameter("g", "1", 8.0, minimum=0)
    r, load = m.parameter("r", "ohm", 1.0, minimum=0), m.parameter("R", "ohm", 50.0, minimum=0.1)
    coil, capacitor = m.parameter("L", "H", COIL, tunable=False), m.parameter("C", "F", 1e-4, minimum=1e-7)
    i, v = m.state("i", "A", start="free", nominal=2.0), m.state("v", "V", start="free", nominal=15.0)
    m.derivative(i, (source - gain * control - r * i - v) / coil)
    m.derivative(v, (i - v / load) / capacitor)
    m.output("voltage", "V", v)
    return Plant(m.model(), [Input("control")], [Output("voltage")], [Balance("i"), Balance("v")])


def recorded(folder: Path, name: str, seed: int) -> None:
    """A record of the converter with an ideal diode, by small explicit steps; it starts at rest at its first input."""
    rng, p = np.random.default_rng(seed), TRUE
    switched, levels = np.sort(rng.integers(0, SAMPLES, 10)), rng.uniform(1.6, 3.4, 11)
    control = levels[np.searchsorted(switched, np.arange(SAMPLES), side="right")]
    i = (p["E"] - p["g"] * control[0]) / (p["r"] + p["R"])
    v, read, h = i * p["R"], [i * p["R"]], STEP / FINE
    for k in range(SAMPLES - 1):
        for part in (np.arange(FINE) + 0.5) / FINE:
            driven = p["E"] - p["g"] * (control[k] + part * (control[k + 1] - control[k]))
            i = max(i + h * (driven - p["r"] * i - v) / COIL, 0.0)
            v += h * (i - v / p["R"]) / p["C"]
        read.append(v)
    columns = [np.arange(SAMPLES) * STEP, control, np.array(read) + NOISE * rng.standard_normal(SAMPLES)]
    np.savetxt(
        folder / f"{name}.csv",
        np.column_stack(columns),
        delimiter=",",
        header="time [s],control [V],voltage [V]",
        comments="",
    )


def test_a_diode_is_found_behind_a_coil_whose_base_ran_away(tmp_path: Path) -> None:
    for seed, name in enumerate("abc"):
        recorded(tmp_path, name, seed + 1)
    plant = buck()
    found = td.discover(td.read_recordings(tmp_path, plant))
    assert [e.id for e in found.effects] == ["one_way(i)"]
    assert not found.effects[0].equivalent
    got = {n: found.parameters[n].value for n in TRUE}
    assert got == pytest.approx(TRUE, rel=0.05)
