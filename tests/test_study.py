"""A study: how finely its models are integrated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tubular_dea as td
from shared_data import shared
from tubular_dea.identify.fitting.cases import Case, Reading
from tubular_dea.identify.fitting.marginal import Marginal
from tubular_dea.identify.fitting.problem import Free
from tubular_dea.identify.fitting.response import FINER, LEAST_STEPS, ROUGH, STEPS_A_SAMPLE, TOLERANCE, Response
from tubular_dea.identify.records.data import read_folder
from tubular_dea.identify.study.adjust import adjusted
from tubular_dea.identify.study.study import LONG, Nuisances, followed, study
from tubular_dea.kernel import Kernel
from tubular_dea.plants import Balance, Build, Input, Output, Plant
from tubular_dea.plants.tube import PLANT
from tubular_dea.protocol import Protocol

EXAMPLE = Path(__file__).resolve().parents[1] / "cosim_examples" / "data" / "bench"


def test_the_tolerance_follows_the_noise() -> None:
    """What the coarse one changes is nothing beside 15 um; beside a noise of 0.1 um the usual one is taken."""
    recordings = read_folder(Path(shared("lab/lab-1")), PLANT)
    coarse = study(recordings)
    assert coarse.tolerance == ROUGH
    values = PLANT.model.parameter_values()
    rough, exact = (coarse.response((), coarse.pieces).outputs(values, finer) for finer in (1.0, 1e3))
    furthest = max(float(np.abs(a - b).max()) for a, b in zip(rough, exact, strict=True))
    assert furthest < 0.01 * coarse.noise["measured_displacement"].rms
    known = replace(recordings, noise=dict(recordings.noise) | {"radius": 1e-7})
    assert study(known).tolerance == TOLERANCE


def test_the_beginning_of_a_long_record_has_been_through_its_range() -> None:
    """A voltage that comes late is in it; a short record stays whole, and the numbers of all of it are forgotten."""
    rate, seconds = 250.0, 120.0
    time = np.arange(0, seconds, 1 / rate)
    beat = 8e3 + 4e3 * np.sin(2 * np.pi * 1.2 * time)
    late = np.where(time > 0.6 * seconds, 5e3, 0.0)
    inputs = {"pressure": beat, "voltage": late}
    whole = study(read_folder(EXAMPLE, PLANT))
    piece = max(whole.training, key=lambda p: p.record.size)
    protocol = Protocol(time, inputs)
    reading = Reading(piece.case.readings[0].output, time)
    record = 1e-3 * np.sin(2 * np.pi * 1.2 * time) + 1e-7 * late
    long = replace(
        piece,
        case=Case(protocol, (reading,)),
        record=record,
        weight=np.ones(time.size),
        marginal=Marginal((), np.ones((time.size, 1)), np.eye(1), np.ones(1)),
    )
    short = next(p for p in whole.pieces if p.case.protocol.time.size < LONG)
    begun = replace(whole, pieces=[long, short]).beginning.pieces
    assert begun[1] is short
    end = begun[0].case.times[-1]
    assert 0.6 * seconds < end < 0.7 * seconds
    assert begun[0].marginal.columns is None
    assert begun[0].record.size == begun[0].weight.size == begun[0].case.times.size == round(end * rate) + 1
    assert replace(whole, pieces=[short]).beginning.pieces == [short]


def test_between_files_in_a_row_the_next_one_s_load_holds() -> None:
    """Whoever ends a record under load releases the load then, not little by little until the next one begins."""
    loaded = Protocol.of([0.0, 10.0], pressure=[1.2e4, 1.2e4], voltage=[0.0, 0.0])
    rests = Protocol.of([40.0, 50.0], pressure=[0.0, 0.0], voltage=[0.0, 0.0])
    both = followed(loaded, rests)
    assert np.allclose(both.at(np.array([5.0, 10.0, 11.0, 12.0, 30.0, 45.0]))["pressure"], [1.2e4, 1.2e4, 3e3, 0, 0, 0])
    assert Kernel(PLANT.model).simulate(both, np.array([50.0])).steps < 20_000  # released at once, it rings: 186 000
    short = followed(loaded, Protocol(rests.time - 29.9, rests.inputs))
    assert np.allclose(short.at(np.array([10.05, 10.1]))["pressure"], 0.0)


def test_a_tube_that_rings_out_in_pauses_is_followed() -> None:
    """Unloaded at once before a pause of five minutes, a tube without damping rings for most of a minute."""
    pulse = Protocol.of([0.0, 1.0, 1.0, 2.0], pressure=[1.2e4, 1.2e4, 0.0, 0.0], voltage=[0.0] * 4)
    chain = pulse
    for number in range(1, 12):
        chain = followed(chain, Protocol(pulse.time + 300.0 * number, pulse.inputs))
    reading = Reading("measured_displacement", np.arange(3300.0, 3302.0, 0.01))
    response = Response(Kernel(PLANT.model), [Case(chain, (reading,))], {}, TOLERANCE)
    assert np.isfinite(response.outputs({}, FINER)[0]).all()
    steps = Kernel(PLANT.model).simulate(chain, reading.times, tolerance=TOLERANCE / FINER, max_steps=3_000_000).steps
    assert steps > LEAST_STEPS + STEPS_A_SAMPLE * (reading.times.size + chain.time.size)


def test_files_without_a_rest_between_them_have_one_start(tmp_path: Path) -> None:
    """Each of five weeks of a building had a start of its own at the beginning of the first: no run follows all."""
    m = Build("Store")
    heating = m.input("heating", "W", nominal=10.0)
    T = m.state("T", "degC", start="free", nominal=20.0)
    rate, per = m.parameter("rate", "1/s", 0.05), m.parameter("per", "degC/W", 2.0)
    m.derivative(T, rate * (per * heating - T))
    m.output("room", "degC", T)
    plant = Plant(m.model(), [Input("heating")], [Output("room")], places=[Balance("T")])
    time, random, at = np.arange(0.0, 30.0, 0.1), np.random.default_rng(1), 12.0
    for number in range(3):
        rows = []
        for t in time:
            power = 5 + 4 * np.sin(0.3 * t + number)
            rows.append(f"{t:g},{power:.6f},{at + 0.01 * random.standard_normal():.6f}")
            at += 0.1 * 0.05 * (2 * power - at)
        (tmp_path / f"w{number}.csv").write_text(
            "time [s],heating [W],room [degC]\n" + "\n".join(rows), encoding="utf-8"
        )
    (tmp_path / "bench.toml").write_text('[order]\nw0 = "0 s"\nw1 = "30 s"\nw2 = "60 s"\n', encoding="utf-8")
    made = study(read_folder(tmp_path, plant=plant), ())
    assert [bool(made.unknown((), p)) for p in made.pieces] == [True, False, False]
    assert [p.follows for p in made.pieces] == ["", "w0", "w1"]
    values = plant.model.parameter_values()
    settled = adjusted(made, (), values, [Free("rate", 0.05)])
    starts = [p.case.own["T_start"] for p in settled.pieces]
    assert len(set(starts)) == 1 and abs(starts[0] - 12.0) < 0.5
    assert len(settled.response((), settled.pieces).shared) == 1
    told = td.discover(tmp_path, plant=plant, hold_out=["w2"]).content["records"]
    assert told["w0"]["start"]["T_start"] == pytest.approx(12.0, abs=0.05)
    own = {"zeros": {}, "gains": {}}
    assert [told[n] for n in ("w1", "w2")] == [{"follows": "w0", **own}, {"follows": "w1", **own}]


def test_columns_of_a_model_that_runs_away_hide_no_prior() -> None:
    """Two starts from which a level doubles every few steps change a record by 1e27, and alike to the last digit."""
    away = np.full((50, 2), 1e27)
    found = Nuisances(("first", "second"), away, np.ones(2)).mean(away, np.full(50, -2e27), np.ones(2))
    assert found == pytest.approx([1.0, 1.0])
