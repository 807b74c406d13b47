"""Where every state of a plant starts free in each record, so does what an effect adds: a room's walls are as cold as
the night before left them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.identify.records.data import read_folder
from tubular_dea.identify.study.study import study
from tubular_dea.plants import Balance, Build, Input, Output, Plant

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


def recordings(folder: Path, starts: str = "") -> None:
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


def test_a_hidden_store_starts_anywhere_in_each_record(tmp_path: Path) -> None:
    recordings(tmp_path)
    found = td.discover(tmp_path, plant=room(), seed=1)
    assert [e["id"] for e in found.content["effects"]] == list(RELAXING)
    values = {p: v["value"] for p, v in found.content["effects"][0]["parameters"].items()}
    assert values["T_relaxation_stiffness"] == pytest.approx(STIFFNESS, rel=0.1)
    assert values["T_relaxation_tau"] == pytest.approx(TAU, rel=0.1)
    assert found.content["error"]["after"]["held_out_rmse"] < 1.2 * NOISE


def test_a_record_that_rested_says_so(tmp_path: Path) -> None:
    recordings(tmp_path, '[start]\nnight_1 = "rested"\n')
    made = study(read_folder(tmp_path, plant=room()), ())
    assert [len(made.unknown(RELAXING, p)) for p in made.pieces] == [2, 1, 2, 2]
    assert [len(made.unknown((), p)) for p in made.pieces] == [1, 1, 1, 1]
