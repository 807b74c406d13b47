"""The master: accuracy and order against the monolithic solution, energy, divergence, steps, events, errors."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path

import numpy as np
import pytest

from coupled import CASES, PERIOD, case, driven_tube, pulses, reference, slaves, stretch, tube_work
from shared_data import shared
from tubular_dea.cosim.heart_assist import heart_assist
from tubular_dea.cosim.master import MasterError, Options, Run, simulate
from tubular_dea.cosim.slaves import SlaveError
from tubular_dea.cosim.system import Connection, System
from tubular_dea.model.compose import CouplingError
from tubular_dea.model.windkessel import patient
from tubular_dea.protocol import Protocol

BEATS = 3
PLAIN = {"cubic": False, "restart": 1.0, "refine": 0.0, "slave_tolerance": 1e-8, "tolerance": 1e-7}


@functools.cache
def coupled(name: str, voltage: float = 6000.0, **how: object) -> Run:
    """Tube and heart under prescribed pulses."""
    values = case(name)
    start = {"tube.lambda_2_start": stretch(values["aortic_pressure_start"]), "tube.start_at_equilibrium": 0.0}
    system = driven_tube(slaves(), values, pulses(BEATS, voltage), start)
    return simulate(system, BEATS * PERIOD, Options(**how))


def error(run: Run, name: str, voltage: float = 6000.0) -> float:
    """Largest difference of the aortic pressure from the monolithic solution, over the beat's amplitude."""
    expected = reference(case(name), pulses(BEATS, voltage), run.time)["heart_aortic_pressure"]
    return float(np.abs(run["heart.aortic_pressure"] - expected).max() / np.ptp(expected))


def gap(run: Run) -> float:
    """Energy lost between the two sides of the interface, over the larger of both."""
    given, received = tube_work(run)
    return abs(given - received) / max(abs(given), abs(received))


@pytest.mark.parametrize("name", CASES)
def test_implicit_at_one_millisecond(name: str) -> None:
    run = coupled(name, slave_tolerance=1e-8, tolerance=1e-7).completed()
    assert error(run, name) < 1e-4
    assert gap(run) < 1e-4


@pytest.mark.parametrize("name", CASES)
def test_implicit_with_default_options(name: str) -> None:
    run = coupled(name).completed()
    assert error(run, name) < 1e-4


def test_the_stiff_case_is_near_the_fold() -> None:
    run = coupled("stiff").completed()
    assert run["tube.snap_through_margin"].min() < 15 * 133.322


def observed_order(values: list[float]) -> float:
    return float(np.log2(values[0] / values[-1]) / (len(values) - 1))


@pytest.mark.parametrize(
    ("scheme", "order", "expected"),
    [("jacobi", 0, 1), ("jacobi", 1, 2), ("gauss-seidel", 0, 1), ("gauss-seidel", 1, 2), ("implicit", 0, 2)],
)
def test_convergence_order(scheme: str, order: int, expected: int) -> None:
    steps = (2e-3, 1e-3, 5e-4)
    errors = [
        error(coupled("healthy", scheme=scheme, order=order, step=h, **PLAIN).completed(), "healthy") for h in steps
    ]
    assert observed_order(errors) == pytest.approx(expected, abs=0.35)


def test_energy_gap_falls_with_the_square_of_the_step() -> None:
    gaps = [gap(coupled("healthy", step=h, **PLAIN)) for h in (2e-3, 1e-3, 5e-4)]
    assert observed_order(gaps) == pytest.approx(2, abs=0.2)


def test_energy_over_the_last_beat() -> None:
    for name in CASES:
        run = coupled(name, slave_tolerance=1e-8, tolerance=1e-7)
        rows = np.searchsorted(run.time, [(BEATS - 1) * PERIOD - 1e-9, BEATS * PERIOD])
        given, received = tube_work(run, slice(int(rows[0]), int(rows[1]) + 1))
        assert abs(given - received) < 1e-4 * max(abs(given), abs(received)), name


@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel"])
def test_divergence_is_refused_with_its_reason(scheme: str, order: int) -> None:
    run = coupled("stiff", scheme=scheme, order=order, **PLAIN)
    assert "diverges" in run.reason and "use the implicit scheme" in run.reason
    assert run.time[-1] < 0.2, "found out at once"
    with pytest.raises(MasterError, match=r"ended at 0\.\d+ s: the (jacobi|gauss-seidel) scheme diverges"):
        run.completed()


@pytest.mark.parametrize("step", [2e-3, 1e-2])
@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel"])
def test_stable_explicit_runs_are_not_refused(scheme: str, step: float) -> None:
    for name in ("healthy", "failing"):
        simulate(heart_assist(slaves(), patient(name)), 5.0, Options(scheme, step)).completed()


def test_variable_steps_keep_their_tolerance() -> None:
    how = {"step": 0.02, "variable": True, "slave_tolerance": 1e-8}
    runs = {t: coupled("stiff", tolerance=t, **how) for t in (1e-3, 1e-4, 1e-5)}
    errors = [error(run.completed(), "stiff") for run in runs.values()]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1e-4
    steps = np.diff(runs[1e-4].time)
    assert steps.max() > 20 * steps.min(), "the steps follow what happens"
    assert runs[1e-4].rejected > 0
    assert runs[1e-4].time.size < 1500


def test_explicit_schemes_vary_their_step_too() -> None:
    run = coupled("healthy", scheme="gauss-seidel", order=1, step=0.02, variable=True, tolerance=1e-4).completed()
    assert error(run, "healthy") < 5e-3
    assert run.time.size < 2500


def test_events_are_hit_exactly() -> None:
    drive = pulses(BEATS, 6000.0)
    for how in ({"step": 3e-3}, {"step": 0.02, "variable": True, "tolerance": 1e-4}):
        run = coupled("healthy", **how)
        inside = drive.time[(drive.time > 0) & (drive.time < run.time[-1])]
        assert max(np.abs(run.time - t).min() for t in inside) < 1e-12
        waves = PERIOD * np.arange(1, BEATS)
        assert max(np.abs(run.time - t).min() for t in waves) < 1e-9


def test_long_runs_do_not_add_up_time() -> None:
    run = coupled("healthy", scheme="jacobi", step=1e-3, restart=1.0)
    k = np.rint(run.time * 1e3)
    on_grid = np.abs(run.time - k * 1e-3) < 1e-12
    assert on_grid.sum() >= BEATS * 800 + 1


def test_the_same_twice() -> None:
    system = heart_assist(slaves(), patient("failing"))
    first, second = (simulate(system, 3.2, Options()) for _ in range(2))
    assert all(np.array_equal(first[n], second[n]) for n in first.values)


def test_iterations_are_few() -> None:
    assert coupled("healthy").iterations[1:].mean() < 2.5
    assert coupled("stiff").iterations[1:].mean() < 3


# Errors ---------------------------------------------------------------------------------------------------------


def test_wrong_connections_are_refused_before_the_run() -> None:
    system = heart_assist(slaves(), patient("healthy"))

    def with_wires(*wires: Connection) -> System:
        return dataclasses.replace(system, connections=[*system.connections, *wires])

    bad = {
        "there is no part 'hert'; did you mean heart": with_wires(Connection("hert.r_wave", "tube.pressure")),
        "heart has no output 'rwave'; did you mean r_wave": with_wires(Connection("heart.rwave", "tube.pressure")),
        "tube has no input 'pressur'; did you mean pressure": with_wires(
            Connection("heart.aortic_pressure", "tube.pressur")
        ),
        "keep one": with_wires(Connection("heart.ventricular_pressure", "tube.pressure")),
        "nothing is connected to heart.tube_flow": dataclasses.replace(
            system, connections=[c for c in system.connections if c.target != "heart.tube_flow"]
        ),
        "heart.aortic_flow is in 'm3/s' but tube.pressure expects 'Pa'": dataclasses.replace(
            system, connections=[Connection("heart.aortic_flow", "tube.pressure"), *system.connections[1:]]
        ),
        "heart has no parameter 'CC'": dataclasses.replace(system, parameters={"heart.CC": 1.0}),
        "event heart.nothing": dataclasses.replace(system, events=["heart.nothing"]),
        "expected 'part.variable' but was given 'pressure'": with_wires(Connection("pressure", "tube.pressure")),
    }
    for text, wrong in bad.items():
        with pytest.raises(CouplingError, match=text):
            simulate(wrong, 1.0)


def test_wrong_options_are_refused() -> None:
    system = heart_assist(slaves(), patient("healthy"))
    for how, text in (
        ({"scheme": "explicit"}, "expected jacobi, gauss-seidel, implicit but was given 'explicit'"),
        ({"step": 0.0}, "step: expected a positive number"),
        ({"step": float("nan")}, "step: expected a positive number"),
        ({"tolerance": -1.0}, "tolerance: expected a positive number"),
    ):
        with pytest.raises(MasterError, match=text):
            simulate(system, 1.0, Options(**how))
    with pytest.raises(MasterError, match="stop: expected a time after the start"):
        simulate(system, 0.0)


def test_slaves_that_do_not_start_say_why(tmp_path: Path) -> None:
    with pytest.raises(SlaveError, match=r"C: expected at least 1e-11 .*but was given -1"):
        simulate(heart_assist(slaves(), patient("healthy"), {"heart.C": -1.0}), 1.0)
    with pytest.raises(SlaveError, match="tube, initialization: no rest state to start at"):
        simulate(heart_assist(slaves(), patient("healthy"), {"heart.aortic_pressure_start": 3e4}), 1.0)
    broken = tmp_path / "broken.fmu"
    broken.write_bytes(b"not a zip")
    with pytest.raises(SlaveError, match=r"tube: .*broken\.fmu cannot be read as an FMU"):
        simulate(heart_assist({**slaves(), "tube": broken}, patient("healthy")), 1.0)


def test_a_slave_that_fails_ends_the_run_with_what_there_is(tmp_path: Path) -> None:
    """A pressure that no tube can take, from 0.5 s on: the solver of the tube gives up."""
    wires = [Connection("drive.pressure", "tube.pressure"), Connection("drive.voltage", "tube.voltage")]
    drive = Protocol.of([0, 0.5, 0.5, 1.0], pressure=[1e4, 1e4, 1e300, 1e300], voltage=[0, 0, 0, 0])
    run = simulate(System({"tube": slaves()["tube"]}, wires, {"drive": drive}), 1.0, Options("jacobi"))
    assert run.reason.startswith("the run ended at 0.5 s: tube refused: ")
    assert "lambda_2 would come to 0" in run.reason
    assert run.time[-1] == pytest.approx(0.5)
    table = run.write(tmp_path / "run.csv").read_text().splitlines()
    assert len(table) == run.time.size + 1
    assert table[0].startswith("time [s],drive.pressure [1],drive.voltage [1],tube.radial_displacement [m]")


def test_measured_pressure_drives_the_tube() -> None:
    """The pig's aorta as a source: linear between its samples, which are all hit."""
    lines = shared("aorta/invivo_data/Ao_baseline1_AoP1.csv").read_text().splitlines()
    pressure = np.array([float(line.split(",")[1]) for line in lines if line[:1].isdigit()]) * 133.322
    time = np.arange(pressure.size) / 200
    wires = [Connection("drive.pressure", "tube.pressure"), Connection("drive.voltage", "tube.voltage")]
    drive = Protocol.of(time, pressure=pressure, voltage=np.full(time.size, 5000.0))
    run = simulate(
        System({"tube": slaves()["tube"]}, wires, {"drive": drive}, {"tube.start_at_equilibrium": 1.0}),
        float(time[-1]),
        Options("jacobi", 1e-2, restart=1.0),
    ).completed()
    assert max(np.abs(run.time - t).min() for t in time) < 1e-9
    assert np.ptp(run["tube.radial_displacement"][400:]) > 1e-4
