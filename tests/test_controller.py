"""The tube controller: what it holds beyond the fold, within which limits, how it fails, its FMU in other tools."""

from __future__ import annotations

import dataclasses
import functools
import json
import tempfile
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

import controller as benchmark
import step_margin
import test_assist
import tubular_dea as td
from hosts.compile import compile_host, run_host
from tubular_dea.cli import main
from tubular_dea.control.design import gains, open_loop
from tubular_dea.control.peers import PI, Constant
from tubular_dea.control.rig import Bench, Record, TubeController, experiment, fmu, rest_voltage
from tubular_dea.cosim.heart_assist import archive, fmus, heart_assist
from tubular_dea.cosim.hold import FIELD, RADIUS, how_held
from tubular_dea.cosim.master import Options, Run, simulate
from tubular_dea.kernel import Kernel
from tubular_dea.model.dea import tubular_dea
from tubular_dea.model.reduced import holdable, reduced
from tubular_dea.model.tube_controller import INPUTS, tube_controller
from tubular_dea.model.windkessel import patient

MMHG = 133.322


def rms(record: Record, start: float = 0.5) -> float:
    return float(np.sqrt(np.mean(record.error[record.time >= start] ** 2)))


def test_the_reduced_model_is_the_models_without_its_mass() -> None:
    """Its rate is the slow eigenvalues of the declared model's own Jacobian, with the branches."""
    kernel = Kernel(tubular_dea())
    stretch, pressure = 25 / 15, 140 * MMHG
    volt = rest_voltage(25e-3, pressure)
    values = {**tubular_dea().parameter_values(), "lambda_2": stretch}
    parts = {n: float(e.subs({s: values[str(s)] for s in e.free_symbols})) for n, e in reduced().items()}
    J = kernel.jacobian(np.array([stretch, 0, 0, 0]), np.array([pressure, volt]))
    stiffness = -J[1, 0] / J[1, 1] * parts["damping"]
    push = parts["along"] * np.array([values["k_1"], values["k_2"]])
    decay = np.array([values["k_1"] / values["eta_1"], values["k_2"] / values["eta_2"]])
    top = np.array([stiffness, -parts["share"], -parts["share"]]) / parts["damping"]
    A = np.vstack([top, np.outer(push, top) - np.diag([0, *decay])[1:]])
    slow = np.sort(np.linalg.eigvals(J).real)[1:]
    assert np.allclose(np.sort(np.linalg.eigvals(A).real), slow, rtol=2e-3)
    assert slow[-1] == pytest.approx(0.105, abs=0.002), "unstable in open loop"
    assert np.abs(expm(A)).max() > 1


def test_the_gains_are_those_of_the_design() -> None:
    defaults, designed = tube_controller().parameter_values(), gains()
    for name, value in dataclasses.asdict(designed).items():
        assert defaults[name] == pytest.approx(value, rel=0.01), name
    assert open_loop()[1] > 0, "the design point is unstable"


@pytest.mark.parametrize(
    ("radius", "pressure", "start", "field", "swing"),
    [
        (25.0, 140, 25.5, 85, 0),
        (25.0, 140, 24.5, 95, 0),
        (25.0, 140, 25.0, 105, 15),
        (26.0, 100, 25.5, 140, 0),
        (26.0, 100, 26.0, 140, 15),
    ],
)
def test_holds_beyond_the_fold(radius: float, pressure: float, start: float, field: float, swing: float) -> None:
    r = benchmark.held(radius * 1e-3, pressure, start * 1e-3, field * 1e6, swing)
    assert r.settled(100e-6) < 0.5
    assert rms(r) < 50e-6
    along = np.sqrt(1 + (15 / 24.5) ** 2 * (r.radius / 15e-3 - 1) ** 2)
    field_seen = r.voltage * along * r.radius / 15e-3 / 1e-4
    assert field_seen.max() <= field * 1e6 * 1.002, "within what 15 um of noise make of it"
    current = 9.15e-9 * (along * r.radius / 15e-3)[1:] ** 2 * np.abs(np.diff(r.voltage)) / 1e-3
    assert current.max() <= 10e-3 * 1.01, "of the amplifier"
    assert np.all(r.outputs["mode"][1:] == 1)


def test_without_control_the_tube_leaves_and_a_pi_holds_it_worse() -> None:
    volt = rest_voltage(26e-3, 100 * MMHG)
    bench = Bench(lambda t: (100 + 10 * np.sin(2.5 * np.pi * t)) * MMHG, lambda t: 26e-3, 26e-3, {}, 15e-6, 2, 1, volt)
    ours = TubeController({"field_limit": 140e6})
    found = [experiment(bench, c, 2.5) for c in (Constant(volt), PI(volt, 140e6), ours)]
    ours.close()
    opened, pi, held = (rms(r) for r in found)
    assert opened > 300e-6
    assert held < 0.7 * pi < 0.1 * opened


@pytest.mark.long
def test_random_runs_of_the_stated_region() -> None:
    """A dozen of those of `python tests/benchmarks/controller.py random`."""
    generator = np.random.default_rng(4)
    for _ in range(12):
        gone, error = benchmark.lost(*benchmark.draw(generator, benchmark.Region()), benchmark.Region().field, 1.0)
        assert not gone
        assert error < 50e-6


def test_saturation_does_not_wind_up() -> None:
    """A second of a pressure too low to be made up for by the field limit; then it is over within 0.15 s."""

    def pressure(t: float) -> float:
        return (110 if 0.5 < t < 1.5 else 140) * MMHG

    controller = TubeController({"field_limit": 90e6})
    r = experiment(Bench(pressure, lambda t: 25e-3, 25e-3), controller, 2.5)
    controller.close()
    inside = (r.time > 0.7) & (r.time < 1.5)
    assert np.all(r.outputs["limited"][inside] == 1), "the field limits it"
    assert abs(r.outputs["bias"][inside]).max() < 0.5 * MMHG, "and nothing is integrated meanwhile"
    after = r.time > 1.5
    assert r.error[after].max() < 100e-6, "no overshoot outwards"


def drive(steps: int, inputs: dict[int, dict[str, float]], step: float = 1e-3) -> dict[str, np.ndarray]:
    """The controller alone, under a still tube: outputs over steps; `inputs` from a step on."""
    from tubular_dea.cosim.slaves import Slave

    names = ("voltage", "mode", "target_voltage", "limited", "next_event", "estimated_radius")
    with Slave("controller", fmu(tube_controller())) as slave:
        references = {v.name: v.valueReference for v in slave.description.modelVariables}
        slave.fmu.setupExperiment(startTime=0.0)
        given = {"reference_radius": 19e-3, "pressure": 95 * MMHG, "displacement": 3.8e-3, "enable": 1.0}
        slave.fmu.enterInitializationMode()
        slave.fmu.setReal([references[n] for n in given], list(given.values()))
        slave.fmu.exitInitializationMode()
        rows = []
        for k in range(steps):
            given |= inputs.get(k, {})
            slave.fmu.setReal([references[n] for n in given], list(given.values()))
            slave.fmu.doStep(k * step, step)
            rows.append(slave.fmu.getReal([references[n] for n in names]))
    return dict(zip(names, np.array(rows).T, strict=True))


def test_fall_back_is_bumpless() -> None:
    found = drive(600, {200: {"enable": 0.0}, 400: {"enable": 1.0}})
    volt = found["voltage"]
    assert set(found["mode"][250:400]) == {0} and set(found["mode"][450:]) == {1}
    assert volt[399] == pytest.approx(0, abs=1), "the safe voltage"
    falling = -np.diff(volt[201:399]) / 1e-3
    assert falling.max() < 1.05e5, "by fallback_slew, 100 V a ms"
    assert np.abs(np.diff(volt)).max() < 700, "nothing jumps"


def test_a_sensor_that_jumps_is_a_fault() -> None:
    found = drive(400, {200: {"displacement": 8e-3}, 205: {"displacement": 3.8e-3}})
    assert found["mode"][199] == 1 and set(found["mode"][206:]) == {2}, "latched, though the sensor came back"
    assert found["voltage"][-1] == pytest.approx(0, abs=1)


def test_samples_do_not_depend_on_the_communication_step() -> None:
    """1 ms, and a quarter of it: the controller samples every millisecond."""
    coarse, fine = drive(300, {}), drive(1200, {}, 2.5e-4)
    assert np.allclose(coarse["target_voltage"], fine["target_voltage"][3::4], rtol=1e-3, atol=2.0)


def test_references_beyond_the_tube_are_refused() -> None:
    from tubular_dea.cosim.slaves import Slave, SlaveError

    with Slave("controller", fmu(tube_controller())) as slave, pytest.raises(SlaveError, match="reference_radius"):
        slave.fmu.setupExperiment(startTime=0.0)
        slave.set("reference_radius", 0.05)
    low, high = holdable(25e-3, 85e6)
    assert low / MMHG == pytest.approx(138.2, abs=0.1) and high / MMHG == pytest.approx(170.2, abs=0.1)


# The FMU in other tools ---------------------------------------------------------------------------------------------


def test_fmus_are_valid(tmp_path: Path) -> None:
    from fmpy.validation import validate_fmu

    from tubular_dea.export.package import native_fmu

    assert validate_fmu(str(fmu(tube_controller()))) == []
    assert validate_fmu(str(native_fmu(tube_controller(), 3, tmp_path / "TubeController.fmu"))) == []


def test_runs_in_fmpy_and_in_c(tmp_path: Path) -> None:
    """The same measurements in both: 300 ms of a pressure that rises."""
    from fmpy import simulate_fmu

    time = np.arange(301) * 1e-3
    pressure = (90 + 20 * np.minimum(time / 0.2, 1)) * MMHG
    displacement = 3.8e-3 + 1e-4 * np.sin(20 * time)
    path = fmu(tube_controller())
    outputs = ["voltage", "estimated_radius", "bias"]
    table = np.column_stack([time, pressure, displacement])
    in_c = run_host(compile_host("host", tmp_path), path, table, outputs, names=("pressure", "displacement"))
    held = np.array(
        [tuple(row) for row in np.repeat(table, 2, axis=0)[1:]],
        dtype=[("time", float), ("pressure", float), ("displacement", float)],
    )
    held["pressure"][1::2], held["displacement"][1::2] = table[1:, 1], table[1:, 2]
    held["pressure"][2::2], held["displacement"][2::2] = table[1:, 1], table[1:, 2]
    result = simulate_fmu(
        str(path),
        fmi_type="CoSimulation",
        stop_time=0.3,
        output_interval=1e-3,
        input=np.array([tuple(r) for r in table], dtype=held.dtype),
        output=outputs,
    )
    for i, name in enumerate(outputs, start=1):
        assert np.ptp(in_c[:, i]) > 0
        assert np.allclose(result[name][1:], in_c[1:, i], rtol=1e-9, atol=1e-9 * np.abs(in_c[:, i]).max()), name


@functools.cache
def controlled() -> dict[str, Path]:
    return fmus(Path(tempfile.mkdtemp(prefix="controlled-")), controlled=True)


def in_the_loop(step: Options) -> dict[str, np.ndarray]:
    values = patient("failing")
    stretch = test_assist.stretch(values["aortic_pressure_start"])
    start = {"tube.start_at_equilibrium": 0.0, "tube.lambda_2_start": stretch, "controller.reference_radius": 18e-3}
    system = dataclasses.replace(heart_assist(controlled(), values, start), events=())
    return simulate(system, test_assist.STOP, step).completed().values


@pytest.mark.parametrize("tool", ["ecos", "libcosim"])
def test_the_controlled_loop_in_other_tools(tool: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The archive with a controller in it, in the tools of tests/test_assist.py, against our master."""
    folder = Path(tempfile.mkdtemp(prefix="ssp-"))
    path = archive(controlled(), folder / "Controlled.ssp", patient("failing"), radius=18e-3)
    ours = in_the_loop(Options("jacobi", cubic=False, restart=1.0))
    assert ours["controller.voltage"].max() > 3000

    class Reference:
        time = np.arange(ours["tube.radius"].size) * 1e-3

        def __getitem__(self, name: str) -> np.ndarray:
            return ours[name]

    monkeypatch.setattr(test_assist, "ssp", lambda: path)
    monkeypatch.setattr(test_assist, "explicit", Reference)
    {"ecos": test_assist.test_ssp_in_ecos, "libcosim": test_assist.test_ssp_in_libcosim}[tool]()


@pytest.mark.long
def test_assist_with_the_controller(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["assist", "--beats", "8", "--controller", "18mm", "--out", str(tmp_path / "held")]) == 0
    printed = capsys.readouterr().out
    assert "Assisted: all 5 beats" in printed
    table = np.genfromtxt(tmp_path / "held" / "with_assist.csv", delimiter=",", names=True, deletechars="")
    on = table["scheduler.on_[1]"] > 0.5
    late = on & np.roll(on, 150) & np.roll(on, -2)  # from 150 ms of a pulse on
    free = table["controller.limited_[1]"][late] == 0
    error = np.abs(table["tube.radius_[m]"][late] - 18e-3)
    assert free.sum() > 300 and np.median(error[free]) < 50e-6
    told = json.loads((tmp_path / "held" / "summary.json").read_text())["held"]
    grid = np.arange(0, table["time_[s]"][-1], 1e-3)  # steps of the run are shorter where a pulse begins
    at = {name: np.interp(grid, table["time_[s]"], table[name]) for name in table.dtype.names}
    on = at["scheduler.on_[1]"] > 0.5
    inward = 18e-3 - at["tube.radius_[m]"][on & np.roll(on, 74)]  # it rises in 73 ms
    assert told["largest"] == pytest.approx(-inward.max(), rel=0.05) and told["largest"] < -0.2e-3
    assert told["rms"] == pytest.approx(np.sqrt(np.mean(inward**2)), rel=0.05)
    assert told["below"] == pytest.approx(np.mean(at["controller.limited_[1]"][on] > 0.5), abs=0.01)
    said = "The field limit of 78.4 V/um held the tube below it in 30 % of the pulses' time."
    assert said in printed and said.replace("'", "&#x27;") in (tmp_path / "held" / "report.html").read_text()
    for radius, text in (
        ("26mm", "26 mm is outside the reachable set"),
        ("40mm", "expected 15.1 to 27.5 mm"),
        ("wide", "--controller: expected a number"),
    ):
        assert main(["assist", "--controller", radius, "--out", str(tmp_path / "none")]) == 2
        assert text in capsys.readouterr().err
        assert not (tmp_path / "none").exists()


@pytest.mark.long
def test_a_radius_that_is_held_is_told_so(tmp_path: Path) -> None:
    """The same radius below a field limit that is never met."""
    result = td.assist(beats=6, controller="18 mm", settings={"scheduler.field_limit": "100 V/um"})
    assert result.held.below == result.held.above == 0
    assert abs(result.held.largest) < 60e-6 and result.held.rms < 50e-6
    assert result.lines()[1] == result.held.text and result.held.text.endswith(" No limit kept the tube from it.")
    assert result.assisted["controller.limited"].max() == 0
    assert td.assist(beats=6).held is None


def test_how_a_radius_was_held_is_over_the_time_after_the_rise() -> None:
    """Two pulses of 0.3 s: 0.1 mm below by the field, then 0.2 mm above without voltage; rises of 50 + 50 ms."""
    time = np.arange(0, 1.0, 0.01)
    on = (time % 0.5 > 0.095) & (time % 0.5 < 0.395)
    first, late = on & (time < 0.5), on & (time > 0.5)
    radius = np.where(first, 17.9e-3, np.where(late, 18.2e-3, 15.5e-3))
    radius[[10, 60]] = 15.5e-3  # the rows in which the pulses begin: 2.5 mm away
    values = {"scheduler.on": on * 1.0, "tube.radius": radius, "controller.limited": first * 1.0 + late * 2.0}
    run = Run(time, values, {}, *(np.zeros(0),) * 3, 0, "")
    settings = {RADIUS: 18e-3, FIELD: 78e6, "controller.reference_rate": 0.05, "controller.tracking_gain": 60.0}
    held = how_held(run, settings)
    assert held.rise == pytest.approx(0.1) and held.largest == pytest.approx(0.2e-3)
    assert held.rms == pytest.approx(1e-3 * np.sqrt((0.1**2 + 0.2**2) / 2))
    assert held.below == pytest.approx(0.5) and held.above == pytest.approx(29 / 60)  # not in the row at 15.5 mm
    assert "0.2 mm (above), 0.16 mm rms" in held.text and "with no voltage left to take away" in held.text
    assert how_held(run, settings | {"controller.reference_rate": 1e-3}) is None, "no pulse lasts as long as its rise"


@pytest.mark.parametrize(
    ("damping", "mass", "step", "snapped"),
    [
        (1, 1, 0.999, False),
        (0.03, 1, 0.999, False),
        (0.1, 100, 0.999, False),
        (0.001, 1, 0.96, True),
        (0.03, 100, 0.98, True),
    ],
)
def test_steps_keep_to_the_static_margin_while_the_wall_is_damped(
    damping: float, mass: float, step: float, snapped: bool
) -> None:
    """What the description of snap_through_margin says (`python tests/benchmarks/step_margin.py` has all of it)."""
    critical = step_margin.critical_voltage(100 * MMHG)
    assert critical == pytest.approx(7270, abs=5)
    assert step_margin.snaps(100 * MMHG, step * critical, step_margin.scaled(damping, mass)) == snapped


def test_inputs_are_what_is_measured() -> None:
    assert [q.name for q in INPUTS] == ["reference_radius", "pressure", "displacement", "enable"]
