"""Recordings that are unusual but right: set points, coarse monitors, either polarity, short, at rest, other tubes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from blind.conventions import draw
from blind.laboratory import laboratory, write
from tubular_dea import discover
from tubular_dea.cli import main
from tubular_dea.discover import engine
from tubular_dea.discover.alternatives import input_noise
from tubular_dea.discover.answer import outcome
from tubular_dea.discover.options import base, residuals
from tubular_dea.identify.fitting.fit import AGREE, fit, goodness
from tubular_dea.identify.inputs.drive import drive, joined
from tubular_dea.identify.records import checks
from tubular_dea.identify.records.checks import mislabelled
from tubular_dea.identify.records.data import read_experiment
from tubular_dea.identify.records.experiment import Experiment, Recordings
from tubular_dea.identify.study import procedure
from tubular_dea.identify.study.adjust import adjusted
from tubular_dea.identify.study.study import PRIOR, Study, sensor_noise, study
from tubular_dea.kernel import Kernel
from tubular_dea.plants.tube import PLANT

EXAMPLE = Path(__file__).resolve().parents[1] / "cosim_examples" / "data" / "bench"
MODEL = PLANT.model
OUTPUT = PLANT.outputs[0].name
TIME = np.arange(0, 8, 0.004)
SOFT = {"C_1": 0.6, "C_2": 0.6, "C_3": 0.6, "eps_r": 1.6, "k_1": 0.6, "k_2": 0.6}  # of Table III


def recorded(
    seed: int, pressure: np.ndarray, voltage: np.ndarray, values: Mapping[str, float] | None = None, noise: float = 25.0
) -> Experiment:
    """What sensors of 15 um, `noise` Pa and 4 V say of the paper's tube (or another) driven like this at TIME."""
    random = np.random.default_rng(seed)
    switched = np.repeat(TIME, 2)[1:], np.repeat(voltage, 2)[:-1]  # held from sample to sample
    protocol = joined([(TIME, pressure), switched], ["pressure", "voltage"])
    radius = Kernel(MODEL).simulate(protocol, TIME, values)["radial_displacement"]
    monitors = {
        "pressure": pressure + noise * random.standard_normal(TIME.size),
        "voltage": voltage + 4 * random.standard_normal(TIME.size),
    }
    laser = radius + 15e-6 * random.standard_normal(TIME.size)
    return Experiment(str(seed), TIME, monitors, {OUTPUT: laser}, np.arange(TIME.size))


def several(values: Mapping[str, float] | None = None, softer: float = 1.0, seed: int = 0, **more: float) -> Recordings:
    """Five experiments: 5.5 to 8.3 kPa (times `softer`), with voltage pulses of 3 to 4.8 kV, the last with a ramp."""
    pulses = (TIME % 2 > 1) & (TIME > 1.5)
    voltages = [np.where(pulses, 3000.0 + 600 * i, 0.0) for i in range(4)] + [500 * np.clip(TIME - 2, 0, None)]
    pressures = [softer * (5500 + 700 * i) * np.minimum(TIME, 1) for i in range(5)]
    driven = enumerate(zip(pressures, voltages, strict=True), seed)
    listed = [recorded(i, p, v, values, **more) for i, (p, v) in driven]
    return Recordings(PLANT, listed, {}, {}, "unusual")


def changed(recordings: Recordings, change: Mapping[str, object]) -> Recordings:
    """The recordings with a function applied to each input that is named."""
    listed = [
        replace(e, inputs={n: change.get(n, lambda v: v)(v) for n, v in e.inputs.items()})
        for e in recordings.experiments
    ]
    return replace(recordings, experiments=listed)


@pytest.fixture(scope="module")
def plain() -> Recordings:
    return several()


def noise_of(recordings: Recordings) -> float:
    return sensor_noise(recordings, [drive(e, PLANT.inputs) for e in recordings.experiments])[OUTPUT].rms


def test_set_points_and_coarse_monitors_are_no_noise_of_the_sensor(plain: Recordings) -> None:
    for other in (several(noise=0.0), changed(plain, {"pressure": lambda v: np.round(v / 133.322) * 133.322})):
        assert noise_of(other) == pytest.approx(15e-6, rel=0.05)


@pytest.mark.parametrize(("name", "step"), [("pressure", 133.322), ("pressure", 66.7), ("voltage", 10.0)])
def test_a_coarse_monitor_is_neither_frozen_nor_saturated(tmp_path: Path, name: str, step: float) -> None:
    for source in sorted(EXAMPLE.glob("*.csv")):
        header, *lines = source.read_text().splitlines()
        column = [h.split(" ")[0] for h in header.split(",")].index(name)
        table = np.array([[float(cell) for cell in line.split(",")] for line in lines])
        table[:, column] = np.round(table[:, column] / step) * step
        np.savetxt(tmp_path / source.name, table, delimiter=",", header=header, comments="")
        assert read_experiment(tmp_path / source.name, PLANT).time.size == len(lines)


def test_short_pulses_on_a_coarse_monitor_are_no_noise() -> None:
    """Between pulses the monitor reads zero for long, which a noisy one would not."""
    pulses = np.zeros(1400)
    for begin in range(0, 1360, 68):
        pulses[begin : begin + 5] = [1640.6, 6234.4, 6187.5, 656.3, -234.4]
        pulses[begin + 12 : begin + 30 : 6] = 46.9
    lines = np.arange(pulses.size) + 2
    voltage = {"voltage": pulses, "pressure": np.random.default_rng(1).normal(5e3, 30, pulses.size)}
    assert not [fault for fault in checks.inputs(voltage, PLANT, lines) if "voltage" in fault]
    stuck = np.where(np.arange(pulses.size) < 1300, np.random.default_rng(2).normal(5e3, 30, pulses.size), 5e3)
    assert "frozen" in next(checks.inputs(voltage | {"pressure": stuck}, PLANT, lines))


def test_what_is_held_or_commanded_may_rest_and_what_is_missing_is_no_rest() -> None:
    random, lines = np.random.default_rng(3), np.arange(400) + 2
    moving = random.normal(5e3, 300, 400)
    resting = np.where((lines > 100) & (lines < 160), 0.0, moving)
    held = replace(PLANT, inputs=tuple(replace(s, held=True) for s in PLANT.inputs))
    still = {"pressure": resting, "voltage": moving}
    assert [fault for fault in checks.inputs(still, PLANT, lines) if "frozen" in fault]
    assert not list(checks.inputs(still, held, lines))
    assert not list(checks.inputs(still, PLANT, lines, commanded=["pressure"]))
    monitored = {"pressure": moving, "voltage": np.where(resting == 0, 5e3, 5e3 + (moving - 5e3) / 75)}  # 4 V of noise
    assert [fault for fault in checks.inputs(monitored, PLANT, lines) if "'voltage'" in fault and "frozen" in fault]
    started = np.where((lines < 60) | (lines > 370), 0.0, moving)  # an excitation that begins and ends at rest
    assert not list(checks.inputs({"pressure": started, "voltage": moving}, PLANT, lines))
    missing = np.where(resting == 0, np.nan, moving)
    assert not list(checks.inputs({"pressure": missing, "voltage": moving}, PLANT, lines))


def test_a_command_that_is_smooth_where_it_moves_may_stand_still() -> None:
    """Levels with ramps between them, and a sum of sines that rests in the middle: no noise is in them."""
    random, at = np.random.default_rng(4), np.arange(1500)
    ramp = np.hanning(20) / np.hanning(20).sum()
    levels = np.convolve(np.repeat(random.uniform(1e3, 8e3, 15), 100), ramp, mode="same")
    sines = sum(np.sin(2 * np.pi * at * k / 375 + k * k) for k in range(1, 30))  # 13 samples in the fastest turn
    rest = np.clip(np.abs(at - 750) / 100 - 1, 0, 1)
    for command in (levels, 5e3 + 100 * sines * rest * rest * (3 - 2 * rest)):
        assert not list(checks.inputs({"pressure": command, "voltage": np.zeros(1500)}, PLANT, at + 2))
        noisy = command + random.normal(0, 30, 1500) * (np.abs(at - 750) > 100)
        assert "frozen" in next(checks.inputs({"pressure": noisy, "voltage": np.zeros(1500)}, PLANT, at + 2))


def test_a_voltage_that_toggles_about_zero_is_not_mislabelled() -> None:
    voltage = next(signal for signal in PLANT.inputs if signal.name == "voltage")
    toggling = 2.44 * (np.random.default_rng(0).random(2000) < 0.05)  # 12 bits of 10 kV
    assert mislabelled(toggling, voltage, PLANT.quantity("voltage")) == ""
    rarely = np.where(np.isin(np.arange(TIME.size), [70, 200, 290]), -11.7, 0.0)
    assert mislabelled(rarely, voltage, PLANT.quantity("voltage")) == ""
    assert "kV labelled V" in mislabelled(np.where(TIME > 2, 5.0, 0.0), voltage, PLANT.quantity("voltage"))


def test_either_polarity_is_the_same_tube(plain: Recordings) -> None:
    def prepared(recordings: Recordings) -> tuple[Study, list[np.ndarray]]:
        work = adjusted(study(recordings, prior=PRIOR), (), MODEL.parameter_values())
        return work, input_noise.weights(work, input_noise.input_sensitivities(work, MODEL.parameter_values()))

    (_, positive), (work, negative) = prepared(plain), prepared(changed(plain, {"voltage": lambda v: -v}))
    for a, b in zip(positive, negative, strict=True):
        np.testing.assert_allclose(a, b, rtol=0.02)
    assert work.problem((), [], MODEL.parameter_values()).residuals(np.empty(0)).std() == pytest.approx(1, abs=0.1)


@pytest.mark.long
@pytest.mark.parametrize(("seed", "steep"), [(9002, "chebyshev"), (9001, "linear_phase")])
def test_monitors_behind_steep_filters_hide_nothing(seed: int, steep: str, tmp_path: Path) -> None:
    """What rings about every edge is not the voltage, and how long the amplifier takes is hidden by it."""
    conventions = replace(draw(seed, ["antialias", "amplifier", "edges"]), steep=steep)
    write(laboratory(seed, conventions=conventions), tmp_path / "data")
    assert discover(tmp_path / "data").verdict == "no_effect"


def test_geometry_of_the_bench_counts_in_identify(plain: Recordings) -> None:
    found = []
    for h_ao in (100e-6, 200e-6):
        work = study(replace(plain, geometry={"h_ao": h_ao}), held_out=())
        start = MODEL.parameter_values() | {"eps_r": 2.8 * (h_ao / 100e-6) ** 2}
        found.append(procedure.joint(work, start, 1, names=["eps_r"])[1].values)
    assert found[0]["eps_r"] == pytest.approx(2.8, rel=0.01)
    assert found[1]["eps_r"] == pytest.approx(4 * found[0]["eps_r"], rel=1e-4)  # the force goes with eps_r / h_ao^2
    assert found[1]["h_ao"] == 200e-6


def test_samples_weigh_alike_where_all_are_counted() -> None:
    """Of a model that leaves three times the sensor's noise at edges that weigh nothing, nine tenths are hidden."""
    listed = [recorded(i, load * np.minimum(TIME, 1), 0 * TIME, noise=0.0) for i, load in enumerate((9e3, 1.1e4))]
    work = study(Recordings(PLANT, listed, {}, {}, "steps"), held_out=())
    values = PLANT.model.parameter_values()
    assert input_noise.unweighted(work, (), values) == pytest.approx(1.0, abs=0.15)
    nothing = replace(work, pieces=[replace(p, weight=0 * p.weight) for p in work.pieces])
    assert input_noise.unweighted(nothing, (), values) == pytest.approx(input_noise.unweighted(work, (), values))
    off = replace(work, pieces=[replace(p, record=p.record + 4.5e-5 * (p.case.times > 2)) for p in nothing.pieces])
    assert input_noise.unweighted(off, (), values) > 3


def test_what_recordings_without_pressure_do_not_determine_is_named() -> None:
    pulses = np.where((TIME > 1) & (TIME < 5), 1.0, 0.0)
    listed = [recorded(i, 0 * TIME, v * pulses, noise=0.0) for i, v in enumerate((5e3, 6e3, 6.8e3))]
    work = study(Recordings(PLANT, listed, {}, {}, "voltage alone"), held_out=())
    best = procedure.joint(work, MODEL.parameter_values(), 1)[1]
    assert np.all(np.isfinite(best.covariance))
    assert {"C_2", "C_3", "eta_2"} <= set(best.undetermined()) <= set(best.names) - {"C_1", "eps_r", "eta_o"}


def test_a_tube_far_from_table_3_gets_the_best_base() -> None:
    declared = MODEL.parameter_values()
    truth = {n: declared[n] * part for n, part in SOFT.items()}
    work = study(several(truth, softer=0.6, seed=20), prior=PRIOR)
    for seed in (0, 3):  # without the declared branches among the starts, both end in a poorer place
        found = base.recalibrate(work, seed=seed)
        assert found.cost < fit(work.problem((), found.free, {}), declared | truth).cost + AGREE


def test_the_level_of_noise_is_as_uncertain_as_the_record_is_short(plain: Recordings) -> None:
    short = replace(plain, experiments=plain.experiments[:1])
    noise = [sensor_noise(r, [drive(e, PLANT.inputs) for e in r.experiments])[OUTPUT] for r in (plain, short)]
    assert noise[0].uncertainty < noise[1].uncertainty == pytest.approx(np.sqrt(2 / TIME.size), rel=0.2)


def test_few_blocks_and_records_at_rest_have_statistics() -> None:
    assert abs(residuals.whiteness(np.random.default_rng(0).standard_normal(12))) < 3
    assert residuals.whiteness(np.sin(np.arange(12))) > 5
    assert np.isnan(goodness([np.full(9, 0.015)], [np.full(9, 0.0151)]))


def test_a_held_out_end_at_rest_has_no_goodness() -> None:
    voltage = np.where(TIME < 5, 6e3 * (TIME % 2 > 1) * (TIME > 1), 0.0)
    one = recorded(0, 9000 * np.minimum(TIME, 1), voltage)
    at_rest = np.where(TIME < 5.9, one.outputs[OUTPUT], np.median(one.outputs[OUTPUT][-100:]))
    found = engine.discover(Recordings(PLANT, [replace(one, outputs={OUTPUT: at_rest})], {}, {"radius": 15e-6}, "one"))
    result = outcome.result(found)
    assert result["error"]["after"]["held_out_fit_percent"] is None
    assert result["error"]["after"]["fit_percent"] > 0


@pytest.mark.parametrize("command", ["identify", "close-loop"])
def test_a_negative_seed_is_refused(command: str, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert main([command, str(EXAMPLE), "--seed", "-1", "--out", str(tmp_path / "out")]) == 2
    assert "--seed: expected at least 0 but was given -1" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_an_output_that_moves_by_some_times_its_noise_is_not_constant() -> None:
    """A tube at 2 kV moves by 0.1 mm, beside a laser's noise of 16 um."""
    noise = 16e-6 * np.random.default_rng(1).standard_normal(1000)
    moved = 1e-4 * (np.arange(1000) // 250 % 2)
    lines = np.arange(1000) + 2
    assert not list(checks.constant(moved + noise, "radius", lines, "the output moves"))
    assert list(checks.constant(noise, "radius", lines, "the output moves"))
