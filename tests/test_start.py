"""Whether a signal begins off zero, and the zeros of monitors at rest: from first samples, on made-up ones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from tubular_dea.identify.inputs.drive import Drive, drives
from tubular_dea.identify.records.bench_file import read_bench
from tubular_dea.identify.records.experiment import RESTED, UNKNOWN, Experiment, Recordings
from tubular_dea.identify.records.start import _begins_off, detected, with_unknown_starts, zeroed
from tubular_dea.plants import Build, Input, Output, Plant
from tubular_dea.plants.tube import PLANT
from tubular_dea.recordings import ReadError

TIME = 0.004 * np.arange(100)
LATER = np.where(np.arange(100) < 12, 0.0, 100.0)  # what comes after the first samples


@pytest.mark.parametrize(("level", "off"), [(2.9, False), (3.1, True), (-3.1, True)])
def test_a_load_is_more_than_zeros_usually_are(level: float, off: bool) -> None:
    assert _begins_off(TIME, level + LATER, zero=1.0) is off


@pytest.mark.parametrize(("level", "off"), [(1.95, False), (2.1, True)])
def test_a_load_is_no_small_part_of_a_signal_whose_zero_is_unknown(level: float, off: bool) -> None:
    assert _begins_off(TIME, level + LATER, zero=0.0) is off


@pytest.mark.parametrize(("errors", "off"), [(4.9, False), (5.1, True)])
def test_a_load_stands_out_of_the_noise(errors: float, off: bool) -> None:
    noise = np.where(np.arange(12) % 2, -1.0, 1.0)
    (_, begin), covariance = np.polyfit(TIME[:12], noise, 1, cov=True)
    level = errors * np.sqrt(covariance[1, 1]) - begin
    assert _begins_off(TIME[:12], noise + level, zero=1e-6) is off


def test_a_few_samples_tell_nothing() -> None:
    assert not _begins_off(TIME[:11], np.full(11, 50.0), zero=1.0)


def heater(start: float | str) -> Plant:
    """A block that a heater warms, without an equilibrium of its own; its thermometer reads half of the warming."""
    m = Build("Block")
    power = m.input("power", "W", nominal=5)
    warming = m.state("warming", "K", start=start, nominal=20)
    m.derivative(warming, (power * m.parameter("R", "K/W", 4.0, minimum=0) - warming) / m.parameter("tau", "s", 8.0))
    m.output("reading", "K", warming / 2)
    return Plant(m.model(), [Input("power")], [Output("reading")])


@pytest.mark.parametrize(
    ("start", "power", "reading", "kind"),
    [
        (0.0, 2.0, 4.0, UNKNOWN),  # it stood under load
        (0.0, 2.0, 0.0, RESTED),  # it was switched on before the first sample
        (0.0, 0.0, 4.0, RESTED),  # a zero of the sensor, for all that is known
        (8.0, 2.0, 4.0, RESTED),  # as declared
        ("free", 2.0, 4.0, RESTED),  # which fits find in any case
    ],
)
def test_a_plant_without_an_equilibrium_may_have_stood_under_load(
    start: float | str, power: float, reading: float, kind: str
) -> None:
    """A voice coil at 2 V was computed from rest: a null was "unexplained", 25 times the noise."""
    plant, noise = heater(start), 0.01 * np.random.default_rng(1).standard_normal(100)
    inputs, outputs = {"power": power + LATER / 50 + noise}, {"reading": reading + LATER / 10 + noise}
    assert detected(Experiment("one", TIME, inputs, outputs, np.arange(100)), plant) == kind


def coil() -> Plant:
    """A motor whose angle starts anywhere; its current, which starts at 0, is read beside it."""
    m = Build("Motor", "A motor with a torsion spring")
    voltage, r = m.input("voltage", "V", nominal=3), m.parameter("R", "ohm", 2.5, minimum=0.01)
    i, angle = m.state("i", "A", nominal=1), m.state("angle", "rad", start="free", nominal=0.3)
    m.derivative(i, (voltage - r * i) / m.parameter("L", "H", 1e-3, minimum=1e-6))
    gain = m.parameter("gain", "rad/A", 1.0, minimum=0.01)
    m.derivative(angle, (gain * i - angle) / m.parameter("tau", "s", 0.01, minimum=1e-4))
    m.output("turned", "rad", angle)
    m.output("current", "A", i)
    m.output("short", "A", voltage / r - i)
    return Plant(m.model(), [Input("voltage")], [Output("turned"), Output("current"), Output("short")])


@pytest.mark.parametrize(
    ("current", "short", "kind"),
    [
        (0.4, 0.0, UNKNOWN),  # it stood under load
        (0.0, 0.48, RESTED),  # it was switched on before the first sample
        (0.0, 0.6, RESTED),  # for all that is known: a fit may change what is declared of it
    ],
)
def test_any_output_may_show_that_a_plant_stood_under_load(current: float, short: float, kind: str) -> None:
    """A galvanometer's angle started anywhere, and its current at 0, not at 0.43 A: a null was "unexplained"."""
    noise = 1e-3 * np.random.default_rng(1).standard_normal((4, 100))
    read = dict(zip(("turned", "current", "short"), (0.4, current, short), strict=True))
    outputs = {name: level + LATER / 100 + e for (name, level), e in zip(read.items(), noise, strict=False)}
    inputs = {"voltage": 1.2 + LATER / 100 + noise[3]}
    assert detected(Experiment("one", TIME, inputs, outputs, np.arange(100)), coil()) == kind


@pytest.mark.parametrize(("volts", "said", "moved"), [(1.2, False, True), (0.0, False, False), (1.2, True, False)])
def test_a_file_under_load_may_begin_with_what_nobody_read(volts: float, said: bool, moved: bool) -> None:
    """A cylinder was at any place, and declared to stand still; it moved, and a null was "unexplained"."""
    noise = 1e-3 * np.random.default_rng(1).standard_normal((2, 100))
    inputs, outputs = {"voltage": volts + LATER / 100 + noise[0]}, {"turned": 0.4 + LATER / 100 + noise[1]}
    files = [Experiment(n, TIME, inputs, outputs, np.arange(100), start_said=said) for n in ("one", "two")]
    found = with_unknown_starts(Recordings(coil(), files))
    assert (found is not None) is moved
    assert found is None or set(found.starts.values()) == {UNKNOWN}


def test_a_plant_without_an_equilibrium_starts_at_none(tmp_path: Path) -> None:
    file = tmp_path / "bench.toml"
    file.write_text('[start]\none = "equilibrium"\n')
    with pytest.raises(ReadError, match='Block declares no equilibrium .* expected "unknown", or "rested"'):
        read_bench(file, heater(0.0), ["one"])
    assert read_bench(file, PLANT, ["one"]).start == {"one": "equilibrium"}


def at_rest(zeros: list[float], voltage: float = 0.0) -> tuple[list[Experiment], list[Drive]]:
    """Files that begin at rest; the pressure rises after half a second and its monitor has a zero in each of them."""
    time = 0.004 * np.arange(500)
    experiments = []
    for number, zero in enumerate(zeros):
        noise = 20.0 * np.random.default_rng(number).standard_normal(time.size)
        inputs = {"pressure": zero + noise + np.interp(time, [0.5, 1.0], [0, 8e3]), "voltage": voltage + 0 * time}
        experiments.append(Experiment(f"file {number}", time, inputs, {}, np.arange(time.size)))
    return experiments, drives(experiments, PLANT.inputs)


def first_pressures(experiments: list[Experiment], driven: list[Drive]) -> np.ndarray:
    return np.array([d.protocol.inputs["pressure"][0] for d in zeroed(experiments, driven, PLANT)])


def test_what_rests_shows_the_zeros_of_its_monitors() -> None:
    experiments, driven = at_rest([120.0, -90.0, 15.0, -60.0, 40.0])
    np.testing.assert_allclose(first_pressures(experiments, driven), 0.0, atol=1e-9)
    later = [z.protocol.inputs["pressure"][-1] for z in zeroed(experiments, driven, PLANT)]
    np.testing.assert_allclose(later, 8e3, atol=15.0)


def test_a_zero_that_all_files_have_in_common_may_be_an_effect_and_stays() -> None:
    experiments, driven = at_rest([210.0, 190.0, 205.0, 195.0], voltage=7.0)
    np.testing.assert_allclose(first_pressures(experiments, driven), 200.0, atol=5.0)
    assert zeroed(experiments, driven, PLANT)[0].protocol.inputs["voltage"][0] == 0.0  # no effect is an offset of it


def test_what_three_files_happen_to_have_in_common_is_no_effect() -> None:
    """Zeros of -18, -32 and -21 Pa are six standard errors from 0 and yet chance: left in, C_1 came out 17 off."""
    experiments, driven = at_rest([-18.4, -32.0, -21.0])
    np.testing.assert_allclose(first_pressures(experiments, driven), 0.0, atol=1e-9)


def test_where_no_effects_are_sought_what_is_in_common_is_a_zero_too() -> None:
    experiments, driven = at_rest([210.0, 190.0, 205.0, 195.0])
    for one in zeroed(experiments, driven, PLANT, effects=False):
        assert one.protocol.inputs["pressure"][0] == pytest.approx(0.0, abs=1e-9)
        assert one.protocol.inputs["pressure"][-1] == pytest.approx(8e3, abs=15.0)


def test_files_in_a_row_show_their_zeros_where_their_inputs_rest() -> None:
    experiments, driven = at_rest([120.0, -90.0])
    in_a_row = [replace(e, begins=3.0 * i) for i, e in enumerate(experiments)]
    np.testing.assert_allclose(first_pressures(in_a_row, driven), 0.0, atol=1e-9)


@pytest.mark.parametrize("start", ["unknown", "equilibrium"])
def test_what_does_not_rest_shows_no_zeros(start: str) -> None:
    experiments, driven = at_rest([120.0, -90.0, 15.0])
    moved = [replace(e, start=start) for e in experiments]
    np.testing.assert_array_equal(first_pressures(moved, driven), [d.protocol.inputs["pressure"][0] for d in driven])


def test_a_load_is_no_zero_and_few_files_show_only_usual_ones() -> None:
    experiments, driven = at_rest([120.0, -90.0, 15.0, 2e3])
    assert first_pressures(experiments, driven)[3] == pytest.approx(2e3, abs=15.0)
    experiments, driven = at_rest([180.0, 170.0])
    np.testing.assert_allclose(first_pressures(experiments, driven), 175.0, atol=3.0)
    experiments, driven = at_rest([120.0])
    assert first_pressures(experiments, driven) == 0.0


def test_a_single_sample_of_noise_is_no_movement() -> None:
    """One that stands out of the line would have a plant ring that has no damping at rest."""
    experiments, _ = at_rest([120.0, -90.0, 15.0])
    for e in experiments:
        e.inputs["pressure"][40] += 90.0
    driven = zeroed(experiments, drives(experiments, PLANT.inputs), PLANT)
    assert all(np.ptp(d.protocol.at(np.linspace(0, 0.45, 100))["pressure"]) < 1e-9 for d in driven)


def test_what_noise_leaves_of_a_line_at_rest_does_not_drive_the_plant() -> None:
    experiments, driven = at_rest([120.0, -90.0, 15.0])
    for one in zeroed(experiments, driven, PLANT):
        line = one.protocol.at(np.linspace(0, 0.4, 101))["pressure"]
        np.testing.assert_array_equal(line, 0.0)


def test_a_zero_that_a_file_clearly_begins_with_is_taken_off_without_any_rest() -> None:
    """A tube without damping at rest would ring from a step of it; what may as well be noise is no step."""
    time, zeros = 0.004 * np.arange(500), [-80.0, 70.0, -65.0, 12.0]
    experiments = []
    for number, zero in enumerate(zeros):
        noise = 20.0 * np.random.default_rng(number).standard_normal(time.size)
        inputs = {"pressure": zero + noise + np.interp(time, [0.0, 1.0], [0, 8e3]), "voltage": 0 * time}
        experiments.append(Experiment(f"file {number}", time, inputs, {}, np.arange(time.size)))
    driven = drives(experiments, PLANT.inputs)
    *clear, unclear = zeroed(experiments, driven, PLANT)
    for one, zero in zip(clear, zeros, strict=False):
        assert one.zeros["pressure"] == pytest.approx(zero, abs=8.0)
        assert one.protocol.inputs["pressure"][0] == 0.0
    assert "pressure" not in unclear.zeros  # the pressure may have begun to rise half a sample earlier
    assert unclear.protocol.inputs["pressure"][0] == 0.0


@pytest.mark.parametrize("late", [0.0, 0.001, 0.0035])
@pytest.mark.parametrize("lasting", [0.05, 0.2])
def test_an_input_that_moves_at_once_began_up_to_a_sample_earlier(late: float, lasting: float) -> None:
    """What a sampling clock misses at the start is a step of pressure otherwise, under which a tube at rest rings."""
    time = 0.004 * np.arange(500)
    begun, known = [], []
    for number in range(20):
        noise = 25.0 * np.random.default_rng(number).standard_normal(time.size)
        inputs = {"pressure": noise + np.interp(time + late, [0.0, lasting, 0.4], [0, 1e4, 0]), "voltage": 0 * time}
        experiments = [Experiment("file", time, inputs, {}, np.arange(time.size))]
        (one,) = zeroed(experiments, drives(experiments, PLANT.inputs), PLANT)
        assert one.protocol.inputs["pressure"][0] == 0.0
        begun.append(one.protocol.time[0])
        known.append(one.begun["pressure"])
    off = np.array(begun) + late
    assert np.all(np.array(begun) <= 0.0)
    assert np.all(np.array(begun) >= -0.004)
    assert np.all(np.array(known) < 0.002)
    assert np.max(np.abs(off) / known) < 3.0
    if lasting == 0.05:  # 800 Pa a sample are more than what zeros of monitors are
        assert np.mean(begun) == pytest.approx(-late, abs=0.0005)


@pytest.mark.parametrize("lasting", [0.1, 0.2, 0.4])
def test_a_filter_lets_an_input_seem_to_begin_later(lasting: float) -> None:
    """Begun with the first sample, a line would be off by 50 to 80 Pa until its next corner: two or three times the
    noise."""
    time, missed = 0.004 * np.arange(500), []
    true = np.interp(time - 0.005, [0.0, lasting, 2 * lasting], [0, 1e4, 0])
    for number in range(20):
        noise = 25.0 * np.random.default_rng(number).standard_normal(time.size)
        experiments = [Experiment("file", time, {"pressure": true + noise, "voltage": 0 * time}, {}, np.arange(500))]
        (one,) = zeroed(experiments, drives(experiments, PLANT.inputs), PLANT)
        line = one.lines["pressure"]
        missed.append(np.interp(time, line.time, line.values)[:14] - true[:14])
        assert one.protocol.time[0] == 0.0
        later, earlier = one.begun_later("pressure", 1e-4).lines["pressure"], one.begun_later("pressure", -0.01)
        assert later.begin == pytest.approx(line.begin + 1e-4)
        assert earlier.protocol.time[0] == earlier.lines["pressure"].begin == pytest.approx(line.begin - 0.01)
    assert np.sqrt(np.mean(np.square(missed))) < 30.0


def test_an_input_that_rests_begins_with_its_first_sample() -> None:
    experiments, driven = at_rest([0.0])
    (one,) = zeroed(experiments, driven, PLANT)
    assert one.protocol.time[0] == 0.0
    assert not one.begun


def test_noise_with_a_memory_at_rest_is_no_movement() -> None:
    """It wanders off and comes back. A tube at rest has no damping: it rang at 40 um under what a line followed."""
    time = 0.001 * np.arange(4000)
    experiments = []
    for number in range(4):
        random = np.random.default_rng(number)
        slow = lfilter([7.2 * np.sqrt(1 - 0.905**2)], [1, -0.905], random.standard_normal(time.size))
        slow[240:300] += 35 * np.sin(np.pi * np.arange(60) / 60)
        noise = 9.6 * random.standard_normal(time.size) + slow
        inputs = {"pressure": noise + np.interp(time, [0.5, 1.2], [0, 8e3]), "voltage": 0 * time}
        experiments.append(Experiment(f"file {number}", time, inputs, {}, np.arange(time.size)))
    for one in zeroed(experiments, drives(experiments, PLANT.inputs), PLANT):
        assert np.ptp(one.protocol.at(np.linspace(0, 0.45, 400))["pressure"]) < 1e-9
