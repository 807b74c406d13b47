"""A monitor's noise where the plant goes on from where it was moved: a random walk, which is no effect."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tubular_dea as td
from tubular_dea import plants
from tubular_dea.discover.alternatives.input_noise import bounded_by_outputs
from tubular_dea.identify.records.experiment import Recordings
from tubular_dea.identify.study.adjust import adjusted
from tubular_dea.identify.study.remembered import (
    LEFT_OF,
    MOST_CORNERS,
    NOISE_OF,
    corners,
    left_between,
    pushes,
    spread_at_corner,
)
from tubular_dea.identify.study.study import Study, study
from tubular_dea.plants import Balance, Build, Input, Output, Plant

MASS, VISCOUS, LOAD = 95.1, 203.5, -3.2  # kg, N.s/m, N
STEP, SAMPLES = 0.01, 2000  # s; of a file
FORCE_NOISE, POSITION_NOISE = 0.3, 2e-6  # N, m
TRUE = {"mass": MASS, "viscous": VISCOUS, "load": LOAD}


def carriage(held_by: float = 0.0) -> Plant:
    m = Build("Carriage")
    force = m.input("force", "N", nominal=50.0)
    mass = m.parameter("mass", "kg", 80.0, minimum=1.0)
    viscous = m.parameter("viscous", "N.s/m", 300.0, minimum=1.0)
    load = m.parameter("load", "N", 0.0)
    spring = m.parameter("spring", "N/m", held_by, tunable=False)
    x, v = m.state("x", "m", nominal=0.1), m.state("v", "m/s", nominal=0.2)
    m.derivative(x, v)
    m.derivative(v, (force - viscous * v - load - spring * x) / mass)
    m.output("position", "m", x)
    places = [Balance("v", displacement="x"), plants.Path("force"), plants.Path("position")]
    return Plant(m.model(), [Input("force")], [Output("position")], places=places)


def moved(number: int, drag: float = 0.0) -> dict[str, np.ndarray]:
    """A file of a carriage that forces of many frequencies move; the force is read with noise."""
    random, time = np.random.default_rng(number), STEP * np.arange(SAMPLES)
    frequencies, phases = random.uniform(0.05, 0.4, (12, 1)), random.uniform(0, 2 * np.pi, (12, 1))

    def force(t: np.ndarray | float) -> np.ndarray:
        return 15 * np.tanh(t) * np.sin(2 * np.pi * frequencies * t + phases).sum(axis=0)

    def rates(t: float, y: np.ndarray) -> list[float]:
        return [y[1], (float(force(t)[0]) - VISCOUS * y[1] - LOAD - drag * y[1] * abs(y[1])) / MASS]

    true = solve_ivp(rates, (0, time[-1]), [0, 0], t_eval=time, rtol=1e-9, atol=1e-10, max_step=0.05).y[0]
    return {
        "time [s]": time,
        "force [N]": force(time) + FORCE_NOISE * random.standard_normal(SAMPLES),
        "position [m]": true + POSITION_NOISE * random.standard_normal(SAMPLES),
    }


def recorded(plant: Plant, drag: float = 0.0) -> Recordings:
    return td.read_recordings({f"run {n}": moved(n, drag) for n in range(4)}, plant=plant)


@cache
def at_truth() -> Study:
    """The study of nulls, with nuisance parameters at the true parameters."""
    work = study(recorded(carriage()))
    return adjusted(work, (), TRUE)


@pytest.mark.long
def test_a_random_walk_is_no_effect() -> None:
    """Counted as if the noise were a constant, 100 um were no wonder, and drifts and loops were seen in nulls."""
    found = td.discover(recorded(carriage()))
    assert found.verdict == "no_effect"
    assert found.errors["after"]["rmse"] > 1e-4  # as it is predicted from the recorded force
    assert found.discovery.base.lack_of_fit.ratio < 1.1  # beside the course of the noise
    assert any("remembers the noise of the recorded force" in remark for remark in found.content["remarks"])
    for name, true in TRUE.items():
        assert found.parameters[name].value == pytest.approx(true, rel=2e-3)


@pytest.mark.long
def test_a_drag_beside_a_random_walk_is_found() -> None:
    found = td.discover(recorded(carriage(), 30.0))
    (drag,) = found.effects
    low, high = drag.parameters["v_quadratic_drag"].ci95
    assert (found.verdict, drag.id) == ("effect_found", "quadratic_drag(v)")
    assert low < 30.0 / MASS < high < 2 * low


@pytest.mark.long
def test_intervals_include_the_random_walk(tmp_path: Path) -> None:
    for number in range(4):
        table = moved(number)
        values, heading = np.column_stack([*table.values()]), ",".join(table)
        np.savetxt(tmp_path / f"run {number}.csv", values, delimiter=",", header=heading, comments="")
    (tmp_path / "bench.toml").write_text('[noise]\nforce = "0.3 N"\n', encoding="utf-8")
    fitted = td.identify(td.read_recordings(tmp_path, plant=carriage()))
    for name, true in TRUE.items():
        low, high = fitted.parameters[name].ci95
        assert abs(true - (low + high) / 2) < 0.8 * (high - low)  # 3.1 standard deviations
        assert high - low < 8e-3 * abs(true)


@pytest.mark.parametrize(("spring", "remembered"), [(0.0, True), (2000.0, False)])
def test_what_returns_to_rest_remembers_nothing(spring: float, remembered: bool) -> None:
    work = study(recorded(carriage(spring)))
    values = work.plant.model.parameter_values() | TRUE
    assert bool(pushes(work, (), values, work.pieces[0])) is remembered


def test_stated_noise_stays_as_it_is() -> None:
    """Noise that was estimated is no larger than what moves the output by its error; what the user states is known."""
    work = replace(study(recorded(carriage(2000.0))), monitor_noise={"force": 1e4})
    values = work.plant.model.parameter_values() | TRUE
    assert bounded_by_outputs(work, values).monitor_noise["force"] < 1e4
    stated = replace(work, stated=frozenset({"force"}))
    assert bounded_by_outputs(stated, values).monitor_noise == {"force": 1e4}


def test_every_corner_has_its_own_number() -> None:
    piece = at_truth().pieces[0]
    own = [n for n in piece.nuisances.names if n.startswith(NOISE_OF) and n != f"{LEFT_OF}force"]
    assert own == [f"{NOISE_OF}{k} force" for k in range(MOST_CORNERS)]
    places = corners(piece)
    line = np.stack([np.interp(piece.case.times, places, row) for row in np.eye(places.size)], axis=1)
    known = np.sqrt(np.diag(np.linalg.inv(line.T @ line)))[5:-5]
    told = spread_at_corner(at_truth(), piece, "9 force")
    assert told == pytest.approx(at_truth().monitor_noise["force"] * known.mean(), rel=0.1)


@pytest.mark.long
def test_what_noise_moves_between_corners() -> None:
    """Beside the corners' line, as noise of the force that was drawn moves the model."""
    random, piece, left = np.random.default_rng(1), at_truth().pieces[0], []
    columns = piece.nuisances.columns[:, [n.split(" ")[1].isdigit() for n in piece.nuisances.names]]
    line = piece.case.protocol.time  # the recorded force is joined through fewer points than samples
    share = np.sqrt(line.size / SAMPLES)
    for _ in range(9):
        noise = np.interp(piece.case.times, line, share * random.standard_normal(line.size))
        walk = np.cumsum(_velocity(noise)) * STEP
        left.append(walk - columns @ np.linalg.lstsq(columns, walk, rcond=None)[0])
    told = left_between(piece, "force")
    assert told is not None
    assert np.unique(told) == pytest.approx(np.std(left), rel=0.3)


def _velocity(force: np.ndarray) -> np.ndarray:
    """The carriage's speed under a force at every sample."""
    found, v = np.empty(force.size), 0.0
    for k, each in enumerate(force):
        v += STEP / MASS * (each - VISCOUS * v)
        found[k] = v
    return found
