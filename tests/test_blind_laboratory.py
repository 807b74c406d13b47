"""The blind laboratory is right: its tube against an independent integration, its files against what was drawn."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import independent
from blind import conventions, detect, peers, protocols, tubes
from blind.laboratory import laboratory, write
from blind.recordings import LASER, PRESSURE
from blind.score import by_convention, shares
from blind.trials import Trial, contradictions
from tubular_dea.protocol import Protocol


def test_a_tube_with_nothing_hidden_does_what_an_independent_integration_says() -> None:
    plan = protocols.PlannedExperiment(
        "short", 1.2, [(0, 0), (0.3, 70), (0.8, 95), (0.82, 60), (1.2, 60)], [(0, 0), (0.4013, 5), (0.7507, 0)]
    )
    times = np.arange(0, 1.2, 1e-3)
    found, _ = tubes.run(tubes.Tube(), protocols.drive(plan, protocols.Edge(), rounded=False), times)
    knots = np.array(
        [
            (t, np.interp(t, *zip(*plan.pressure, strict=True)) * tubes.MMHG, v)
            for t, v in (
                (0, 0),
                (0.3, 0),
                (0.4013, 0),
                (0.4013, 5e3),
                (0.7507, 5e3),
                (0.7507, 0),
                (0.8, 0),
                (0.82, 0),
                (1.2, 0),
            )
        ]
    ).T
    named = dict(zip(("time", "pressure", "voltage"), knots, strict=True))
    expected = independent.trajectory(named, times)["radius"]
    np.testing.assert_allclose(found / 0.015, expected / 0.015, atol=1e-6, rtol=0)


def test_the_current_is_the_rate_of_the_charge() -> None:
    plan = protocols.PlannedExperiment(
        "smooth", 1.5, [(0, 0), (0.5, 80), (1.5, 80)], [(0, 0), (0.6, 0), (1.2, 4), (1.5, 4)], False
    )
    times = np.arange(0.7, 1.1, 1e-3)
    radius, current = tubes.run(
        tubes.Tube(), protocols.drive(plan, protocols.Edge(), rounded=False), times, monitor_lag=1e-5
    )
    voltage = 4e3 * (times - 0.6) / 0.6
    charge = np.array([independent.capacitance(r / 0.015) for r in radius]) * voltage
    np.testing.assert_allclose(current[1:-1], np.gradient(charge, times)[1:-1], rtol=2e-3)


@pytest.mark.parametrize("shape", ["linear", "smooth", "exponential"])
def test_an_amplifier_takes_its_time(shape: str) -> None:
    plan = protocols.PlannedExperiment("edge", 1.0, [(0, 0), (1, 1)], [(0, 0), (0.5, 4), (0.7, 0)])
    voltage = protocols.drive(plan, protocols.Edge(4e-3, shape), rounded=False).voltage
    np.testing.assert_allclose(voltage([0.4999, 0.504, 0.6, 0.7041, 0.9]), [0, 4e3, 4e3, 0, 0], atol=10)
    assert np.all(np.diff(voltage(np.linspace(0.5, 0.5039, 50))) > 0)


def test_the_same_seed_writes_the_same_files(tmp_path: Path) -> None:
    for name in ("one", "two"):
        write(laboratory(18, "two"), tmp_path / name)
    first, second = ({f.name: f.read_bytes() for f in (tmp_path / n).iterdir()} for n in ("one", "two"))
    assert first == second
    assert (tmp_path / "one.truth.json").exists()


@pytest.mark.parametrize("name", [n for n in conventions.NAMES if n not in ("order", "beats")])
def test_a_convention_alone_is_that_one(name: str, tmp_path: Path) -> None:
    needed = ["antialias"] if name == "steep" else []
    lab = laboratory(4, "none", ["files", *needed, name])
    assert name in lab.conventions.names()
    assert set(lab.conventions.names()) <= {name, "files", "amplifier", *needed}
    write(lab, tmp_path / "data")
    assert len([f for f in (tmp_path / "data").iterdir() if f.suffix != ".toml"]) == len(lab.files)


def test_experiments_in_a_row_carry_their_memory_over() -> None:
    row, apart = laboratory(5, "mullins_softening", ["order"]), laboratory(5, "mullins_softening", [])
    np.testing.assert_allclose(row.truth[0][0], apart.truth[0][0], atol=1e-7)
    assert np.max(np.abs(row.truth[4][0] - apart.truth[4][0])) > 1e-5
    assert row.starts[0] == 0
    assert np.all(np.diff(row.starts) > [f.stop - f.begin for f in row.files[:-1]])


def test_a_file_holds_the_truth_and_its_noise(tmp_path: Path) -> None:
    lab = laboratory(6, "none", ["colour", "laser_zero"])
    told = write(lab, tmp_path / "data")["files"][1]
    t, pressure, _, radius = np.loadtxt(tmp_path / "data" / f"{told['name']}.csv", delimiter=",", skiprows=1).T
    file = lab.files[1]
    np.testing.assert_allclose(t, file.times - file.begin, atol=1e-6)
    left = radius - lab.truth[1][0] - told["drawn"]["radius"]["zero"]
    assert left.std() == pytest.approx(LASER, rel=0.25)
    assert np.corrcoef(left[1:], left[:-1])[0, 1] == pytest.approx(lab.conventions.colour, abs=0.1)
    assert (pressure - lab.drives[1].pressure(file.times)).std() == pytest.approx(PRESSURE, rel=0.05)


def test_what_nothing_can_imitate_is_there_to_be_found_and_a_gain_of_all_pressure_is_not() -> None:
    assert detect.there(laboratory(19, "pressure_delay", ["files"]))
    assert not detect.there(laboratory(19, "pressure_gain", ["files"]))


def test_trials_are_judged() -> None:
    null = Trial(1, "none", [], ["hum"], 1000, "no_effect")
    found = Trial(2, "sensor_lag", ["sensor_lag"], [], 1000, "ambiguous", ["sensor_delay"], [["sensor_lag"]])
    false = replace(null, verdict="effect_found", found=["sensor_lag"], equivalent=[["sensor_delay"]])
    odd = Trial(3, "external", ["leak"], [], 1000, "partly_explained", ["pneumatic_line"], [[]], "pressure")
    assert [t.right for t in (null, found, false, odd)] == [True, True, False, True]
    counted = dict(shares([null, found, false, odd, replace(null, verdict="refused")]))
    assert counted["nulls: an effect falsely named"] == [False, True]
    assert counted["nulls: refused or failed"] == [False, False, True]
    assert counted["single effect in the set"] == [True]
    assert counted["single effect first by id"] == [False]
    assert counted["in no library: flagged"] == [True]
    assert "1 of 2" in next(line for line in by_convention([null, false]) if line.startswith("hum"))


def test_a_contradiction_is_seen() -> None:
    effect = {
        "id": "x",
        "channel": "sensor",
        "equivalent": [],
        "evidence": 9.0,
        "explained": 0.5,
        "parameters": {"a": {"value": 2.0, "ci95": [1.0, 3.0]}},
    }
    errors = {"recalibrated": {"held_out_rmse": 2.0}, "after": {"held_out_rmse": 1.0}}
    whole = {
        "verdict": "effect_found",
        "effects": [effect],
        "error": errors,
        "noise_floor": 1.0,
        "residual": {},
        "invisible": {},
        "next_experiment": "none",
    }
    assert contradictions(whole) == []
    assert contradictions(whole | {"verdict": "no_effect"}) == ["no_effect with 1 effects"]
    assert contradictions(whole | {"verdict": "ambiguous"}) == ["ambiguous between nothing"]
    worse = {"recalibrated": {"held_out_rmse": 1.0}, "after": {"held_out_rmse": 1.0}}
    assert contradictions(whole | {"error": worse}) == ["named without held-out gain"]


def test_peers_answer_and_are_counted() -> None:
    random = np.random.default_rng(0)
    t = np.arange(4000) * 4e-3
    data, left = [], []
    for _ in range(2):
        voltage = 4e3 * (np.sin(2 * np.pi * 0.7 * t + 6 * random.random()) > 0)
        pressure = 1e4 + 1e3 * np.sin(1.3 * t)
        data.append(peers.Record(Protocol(t, {"pressure": pressure, "voltage": voltage}), t, 2e-3 + 0 * t, {}))
        left.append(lfilter([0.05], [1, -0.95], voltage / 4e3) + 1e-3 * random.standard_normal(t.size))
    planted = peers.sindy(data, peers.Fit((), {}, np.concatenate(left)))
    assert "voltage" in planted.names
    assert "electrical" in planted.channels
    noise = peers.Fit((), {}, random.standard_normal(2 * t.size))
    assert peers.sindy(data, noise).names == []
    null = Trial(1, "none", [], [], 1000, "no_effect", seconds=2.0)
    said = peers.table([(null, peers.Answer(["leak"], [], 5.0), peers.sindy(data, noise))])
    assert [line.split("named")[-1].count("1 of 1") for line in said.splitlines()] == [0, 0, 1, 0]
