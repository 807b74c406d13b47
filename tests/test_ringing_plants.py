"""Plants whose answer to a switching lasts beyond the next one, and plants that nothing drives.

The records are made by matrix exponentials and by SciPy, not by the project's own integrator.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import tubular_dea as td
from tubular_dea.identify.study import adjust
from tubular_dea.identify.study.study import Study, study
from tubular_dea.kernel import Kernel
from tubular_dea.plants import Balance, Build, Coefficient, Input, Output, Path, Plant
from tubular_dea.protocol import Protocol

STEP = 0.004  # s, of the sampling: a quarter of the ringing's period
AREA, MASS = 1.2e-3, 60.0
TRUE = {"k_q": 1.2e-4, "b": 900.0, "stiffness": 6e12}


def cylinder() -> Plant:
    """A servo valve drives a cylinder that moves a mass: it rings at 60 Hz, and stays where it was moved to."""
    m = Build("Cylinder")
    command = m.input("command", "V", nominal=2.0)
    area = m.parameter("area", "m2", AREA, tunable=False)
    mass = m.parameter("mass", "kg", MASS, tunable=False)
    k_q = m.parameter("k_q", "m3/s/V", 1e-4, minimum=1e-6)
    b = m.parameter("b", "N.s/m", 700.0, minimum=0)
    stiffness = m.parameter("stiffness", "Pa/m3", 5e12, minimum=1e10)
    x = m.state("x", "m", start="free", nominal=0.25)
    v = m.state("v", "m/s", nominal=0.2)
    p = m.state("p", "Pa", nominal=5e6)
    flow = m.define("flow", "m3/s", k_q * command, nominal=2e-4)
    m.derivative(x, v)
    m.derivative(v, (area * p - b * v) / mass)
    m.derivative(p, stiffness * (flow - area * v))
    m.output("piston", "m", x, nominal=0.25)
    m.output("load_pressure", "Pa", p, nominal=5e6)
    return Plant(
        m.model(),
        [Input("command", held=True)],
        [Output("piston", zero=1e-3), Output("load_pressure", zero=5e4)],
        places=[Path("command"), Coefficient("flow", of="p"), Balance("v", displacement="x"), Path("piston")],
    )


def switched(number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[tuple[float, float]]]:
    """Samples of one file: time, command, piston and pressure (n, 2), and the instants and levels of its command."""
    random = np.random.default_rng(number)
    instants = 0.31 + np.cumsum(random.uniform(0.15, 0.3, 8))
    levels = [*random.uniform(0.4, 1.5, 7) * (-1.0) ** np.arange(7), 0.0]
    time = np.arange(0.0, instants[-1] + 0.4, STEP)
    ended = [-TRUE["stiffness"] * AREA, 0.0, TRUE["k_q"] * TRUE["stiffness"]]
    rates = np.zeros((4, 4))  # of speed, pressure and the command, and of the way
    rates[0, :2] = -TRUE["b"] / MASS, AREA / MASS
    rates[1, :3] = ended
    rates[3, 0] = 1.0
    events = sorted([*((t, None) for t in time), *zip(instants, levels, strict=True)], key=lambda e: e[0])
    state, now, command, read = np.array([0.0, 0.0, 0.0, 0.21]), 0.0, [], []
    for at, level in events:
        state, now = expm(rates * (at - now)) @ state, at
        if level is None:
            command.append(state[2])
            read.append(state[[3, 1]])
        else:
            state[2] = level
    noise = random.standard_normal((time.size, 2)) * [4e-5, 1.5e4]
    return time, np.array(command), np.array(read) + noise, list(zip(instants, levels, strict=True))


def recordings() -> td.Recordings:
    tables = {}
    for number in range(3):
        time, command, read, _ = switched(number)
        columns = {"piston [m]": read[:, 0], "load_pressure [Pa]": read[:, 1]}
        tables[f"file {number}"] = {"time [s]": time, "command [V]": command} | columns
    return td.read_recordings(tables, plant=cylinder())


def test_what_a_switching_changes_lasts_and_its_instant_is_told_by_all_that_follows() -> None:
    work = study(recordings(), held_out=())
    truth = work.plant.model.parameter_values() | TRUE
    for _ in range(4):
        work = adjust.adjusted(work, (), truth)
    for number, piece in enumerate(work.pieces):
        instants = [t for t, _ in switched(number)[3]]
        found = [e.time + shift for e, shift in zip(piece.driven.edges, piece.shifts, strict=True)]
        assert found == pytest.approx(instants, abs=0.1 * STEP)


def test_a_ringing_plant_is_identified_from_switchings_between_samples() -> None:
    found = td.identify(recordings())
    assert found.verdict == "adequate"
    for name, true in TRUE.items():
        assert found.parameters[name].value == pytest.approx(true, rel=0.01)


def test_nothing_is_missing_from_a_ringing_plant() -> None:
    found = td.discover(recordings())
    assert found.verdict == "no_effect"
    _, piston, pressure = found.lines()[:3]  # every output is told
    asked = replace(found, content={**found.content, "remarks": ["Asked before the search: a in bar?", "All is well."]})
    assert any("may be wrong" in line and "a in bar?" in line for line in asked.lines())
    assert not any("may be wrong" in line for line in found.lines())
    assert piston.startswith("error ") and piston.endswith(" um")
    assert pressure.startswith("load_pressure: error ") and pressure.endswith(" kPa")


def pendulum() -> Plant:
    """A pendulum, let go: nothing drives it."""
    from sympy import sin

    m = Build("Pendulum")
    gravity = m.parameter("gravity", "m/s2", 9.81, tunable=False)
    length = m.parameter("length", "m", 0.3, minimum=0.05)
    b = m.parameter("b", "1/s", 0.1, minimum=0)
    theta = m.state("theta", "rad", start="free", nominal=1.5)
    omega = m.state("omega", "rad/s", start="free", nominal=10.0)
    m.derivative(theta, omega)
    m.derivative(omega, -gravity / length * sin(theta) - b * omega)
    m.output("angle", "rad", theta, nominal=1.5)
    return Plant(m.model(), [], [Output("angle")], places=[Balance("omega", displacement="theta"), Path("angle")])


def swinging() -> td.Recordings:
    """Three records of a pendulum of 0.31 m with quadratic drag, 0.12, beside the linear one, 0.05/s."""
    tables, time = {}, np.arange(0.0, 12.0, 0.02)
    for degrees in (20, 60, 100):
        random = np.random.default_rng(degrees)
        true = solve_ivp(
            lambda t, y: [y[1], -9.81 / 0.31 * np.sin(y[0]) - 0.05 * y[1] - 0.12 * y[1] * abs(y[1])],
            (0.0, 12.0),
            [np.deg2rad(degrees), 0.0],
            t_eval=time,
            rtol=1e-9,
            atol=1e-9,
        ).y[0]
        tables[f"from {degrees}"] = {"time [s]": time, "angle [rad]": true + 2.6e-3 * random.standard_normal(time.size)}
    return td.read_recordings(tables, plant=pendulum())


@pytest.mark.long
def test_a_plant_that_nothing_drives_is_discovered_too(tmp_path) -> None:
    found = td.discover(swinging())
    assert [e.id for e in found.effects] == ["quadratic_drag(omega)"]
    assert found.effects[0].parameters["omega_quadratic_drag"].value == pytest.approx(0.12, rel=0.05)
    assert "quadratic_drag" in next(p for p in found.report(tmp_path) if p.name == "report.html").read_text("utf-8")


def test_a_plant_that_nothing_drives_is_simulated_from_its_start() -> None:
    run = td.simulate(
        pendulum().model.with_values({"length": 0.31, "b": 0.0, "theta_start": 0.05, "omega_start": 0.0}), stop=2.0
    )
    period = 2 * np.pi * np.sqrt(0.31 / 9.81)
    assert run["angle"] == pytest.approx(0.05 * np.cos(2 * np.pi * run.time / period), abs=1e-4)


def spring() -> Plant:
    """A force moves a mass on a spring, which rings for some periods of three samples."""
    m = Build("Spring")
    force = m.input("force", "N", nominal=1.0)
    turns = m.parameter("turns", "Hz", 80.0, minimum=1.0)
    ringing = m.parameter("ringing", "s", 0.02, minimum=1e-4)
    softness = m.parameter("softness", "m/N", 0.01, tunable=False)
    x = m.state("x", "m", nominal=1e-2)
    v = m.state("v", "m/s", nominal=1.0)
    m.derivative(x, v)
    m.derivative(v, (2 * np.pi * turns) ** 2 * (softness * force - x) - v / ringing)
    m.output("position", "m", x, nominal=1e-2)
    return Plant(m.model(), [Input("force", held=True)], [Output("position")], places=[Path("force")])


def rung(rise: float) -> Study:
    """Files of a spring whose amplifier begins to rise on samples and ends before the next: no sample shows it."""
    plant, time = spring(), STEP * np.arange(900)
    kernel, tables = Kernel(plant.model), {}
    for number in range(3):
        random = np.random.default_rng(number)
        begins = time[50 + 60 * np.arange(14)]
        corners = np.column_stack([begins, begins + rise]).ravel()
        levels = np.append(0.0, random.uniform(0.5, 1.0, 14) * (np.arange(14) % 2 == 0))
        force = np.column_stack([levels[:-1], levels[1:]]).ravel()
        protocol = Protocol.of([0, *corners, time[-1]], force=[0, *force, 0])
        position = kernel.simulate(protocol, time)["position"] + 2e-5 * random.standard_normal(time.size)
        read = np.append(0.0, protocol.at(time[1:] - 1e-9)["force"]) + 1e-4 * random.standard_normal(time.size)
        tables[f"file {number}"] = {"time [s]": time, "force [N]": read, "position [m]": position}
    return study(td.read_recordings(tables, plant=plant), held_out=())


@pytest.mark.parametrize("rise", [0.0, 2e-3, 3.4e-3])
def test_the_rise_of_an_amplifier_that_no_sample_shows_is_told_by_the_ringing(rise: float) -> None:
    work = rung(rise)
    truth = work.plant.model.parameter_values()
    for _ in range(6):
        work = adjust.adjusted(work, (), truth)
    assert work.longer["force"] ** 2 == pytest.approx(rise**2, abs=4e-7)  # the ringing feels the square of a rise
    residual = work.problem((), [], truth).residuals(np.empty(0))
    assert residual @ residual < 1.05 * residual.size


def test_a_file_without_edges_of_an_amplifier_tells_nothing_of_its_rise() -> None:
    """One that steps at every sample, for instance."""
    work = rung(2e-3)
    first, *others = work.pieces
    work = replace(work, pieces=[replace(first, driven=replace(first.driven, rises={})), *others])
    found = adjust.adjusted(work, (), work.plant.model.parameter_values())
    assert found.longer["force"] > 1e-3
    assert not any(n.startswith("rise") for n in found.pieces[0].nuisances.names)
