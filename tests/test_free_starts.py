"""Where every state of a plant starts free in each record, so does what an effect adds: a room's walls are as cold as
the night before left them."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.identify.records.data import read_folder
from tubular_dea.identify.study.study import study
from tubular_dea.plants import Balance, Build, Input, Output, Path, Plant

RELAXING = ("relaxation(T)",)
STIFFNESS, TAU, RATE, PER, NOISE = 0.1, 8.0, 0.05, 2.0, 0.01
STEP, SAMPLES, FINE = 0.1, 300, 10


def room() -> Plant:
    """A room that is heated and cools; its walls are missing."""
    m = Build("Room", "A room without walls")
    heating = m.input("heating", "W", nominal=10.0)
    T = m.state("T", "degC", start="free", nominal=20.0)
    rate, per = m.parameter("rate", "1/s", 0.06), m.parameter("per", "degC/W", 1.5)
    m.derivative(T, rate * (per * heating - T))
    m.output("room", "degC", T)
    return Plant(m.model(), [Input("heating", held=True)], [Output("room")], places=[Balance("T")])


def recordings(folder: pathlib.Path, starts: str = "") -> None:
    """Four records of a room whose walls start up to 5 degC off it, by small explicit steps."""
    for number in range(4):
        random, rows = np.random.default_rng(number), []
        levels = random.uniform(2.0, 10.0, 6)
        T = random.uniform(8.0, 16.0)
        wall = T + random.uniform(-5.0, 5.0)
        for k in range(SAMPLES):
            heating = float(levels[k * levels.size // SAMPLES])
            rows.append(f"{k * STEP:.2f},{heating:.4f},{T + NOISE * random.standard_normal():.4f}")
            for _ in range(FINE):
                change = RATE * (PER * heating - T) - STIFFNESS * (T - wall)
                wall += STEP / FINE * (T - wall) / TAU
                T += STEP / FINE * change
        text = "time [s],heating [W],room [degC]\n" + "\n".join(rows) + "\n"
        (folder / f"night_{number}.csv").write_text(text, encoding="utf-8")
    (folder / "bench.toml").write_text(starts, encoding="utf-8")


def test_a_hidden_store_starts_anywhere_in_each_record(tmp_path: pathlib.Path) -> None:
    recordings(tmp_path)
    found = td.discover(tmp_path, plant=room(), seed=1)
    assert [e["id"] for e in found.content["effects"]] == list(RELAXING)
    values = {p: v["value"] for p, v in found.content["effects"][0]["parameters"].items()}
    assert values["T_relaxation_stiffness"] == pytest.approx(STIFFNESS, rel=0.1)
    assert values["T_relaxation_tau"] == pytest.approx(TAU, rel=0.1)
    assert found.content["error"]["after"]["held_out_rmse"] < 1.2 * NOISE


def test_a_record_that_rested_says_so(tmp_path: pathlib.Path) -> None:
    recordings(tmp_path, '[start]\nnight_1 = "rested"\n')
    made = study(read_folder(tmp_path, plant=room()), ())
    assert [len(made.unknown(RELAXING, p)) for p in made.pieces] == [2, 1, 2, 2]
    assert [len(made.unknown((), p)) for p in made.pieces] == [1, 1, 1, 1]


def test_a_state_that_stays_is_a_parameter_of_each_record() -> None:
    m = Build("Lag", "A lag whose gain differs from specimen to specimen")
    drive, tau = m.input("drive", "V", nominal=10), m.parameter("tau", "s", 1.0, minimum=0.01)
    gain = m.state("gain", "1", start="free", nominal=2.0)
    x = m.state("x", "V", nominal=10)
    m.derivative(gain, 0)
    m.derivative(x, (gain * drive - x) / tau)
    m.output("y", "V", x)
    plant = Plant(m.model(), [Input("drive")], [Output("y")], places=[Path("drive"), Balance("x"), Path("y")])
    time, tables, gains = np.arange(0, 12, 0.05), {}, {"a": 0.7, "b": 1.1, "c": 1.6, "d": 2.1}
    for seed, (name, own) in enumerate(gains.items()):
        random = np.random.default_rng(seed)
        driven = np.interp(time, np.arange(13), random.uniform(0, 10, 13))
        known = {"gain_start": own, "tau": 0.8}
        read = td.Kernel(plant.model).simulate(td.Protocol.of(time, drive=driven), time, known)["y"]
        read = read + 0.02 * random.standard_normal(time.size)
        tables[name] = {"time [s]": time, "drive [V]": driven, "y [V]": read}
    found = td.discover(td.read_recordings(tables, plant))
    assert found.verdict == "no_effect"
    assert {n: r["start"]["gain_start"] for n, r in found.content["records"].items()} == pytest.approx(gains, abs=5e-3)
