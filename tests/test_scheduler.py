"""The scheduler's rules: on R times made for each rule, and on recorded ECGs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupled import needs, slaves
from shared_data import shared
from tubular_dea.cosim.heartbeats import Ecg, HeartbeatError, detect, r_waves, read_ecg
from tubular_dea.cosim.master import Options, Run, simulate
from tubular_dea.cosim.slaves import Slave
from tubular_dea.cosim.system import Connection, System
from tubular_dea.kernel import Kernel, KernelError
from tubular_dea.model.declare import DeclarationError, Discrete, Quantity
from tubular_dea.model.scheduler import heartbeat_scheduler
from tubular_dea.protocol import Protocol

INPUTS = ("aortic_pressure", "electric_field", "snap_through_margin")
SAFE = {"aortic_pressure": 0.0, "electric_field": 0.0, "snap_through_margin": 1e5}
STEADY = 0.8 * np.arange(1, 11)


def scheduled(
    times: np.ndarray, stop: float, step: float = 0.01, tables: dict[str, Protocol] | None = None, **settings: float
) -> Run:
    """The scheduler alone, on R waves at `times` [s]; `tables` drive other inputs by name, the rest is safe."""
    tables = tables or {}
    wires = [Connection("ecg.r_wave", "scheduler.r_wave", sampled=True)]
    wires += [Connection(f"{n}.{n}", f"scheduler.{n}", sampled=True) for n in tables]
    parameters = {f"scheduler.{n}": v for n, v in {**SAFE, **settings}.items() if n not in tables}
    system = System(
        {"scheduler": slaves()["scheduler"]},
        wires,
        {"ecg": r_waves(times, stop), **tables},
        parameters,
        ["scheduler.next_event"],
    )
    return simulate(system, stop, Options("jacobi", step)).completed()


def pulses(run: Run) -> np.ndarray:
    """Rows (on [s], off [s]) of the pulses told to the amplifier."""
    told = np.concatenate([[0], run["scheduler.target_voltage"] > 0, [0]])
    # Outputs show a step late what was decided at its start.
    at = run.time[np.concatenate([[0], np.arange(run.time.size - 1)])]
    edges = np.diff(told.astype(int))
    return np.column_stack([at[np.flatnonzero(edges == 1)], at[np.minimum(np.flatnonzero(edges == -1), at.size - 1)]])


def last(run: Run, name: str) -> float:
    return float(run[f"scheduler.{name}"][-1])


def test_pulses_follow_the_predicted_beat_exactly() -> None:
    run = scheduled(STEADY, 8.5)
    # Three intervals are known with the fourth R wave.
    expected = np.array([(r + 0.05 * 0.8, r + 0.38 * 0.8) for r in STEADY[3:]])
    assert np.allclose(pulses(run), expected, atol=1e-7)
    assert last(run, "beats") == 10
    assert last(run, "pulses") == 7


def test_predicted_beat_is_the_median_of_five() -> None:
    rr = np.array([0.8, 0.9, 0.7, 1.0, 0.85, 0.75, 0.95])
    run = scheduled(1 + np.concatenate([[0], np.cumsum(rr)]), 8.0)
    assert last(run, "predicted_rr") == pytest.approx(np.median(rr[-5:]), abs=1e-9)


def test_refractory_time() -> None:
    double = np.sort(np.concatenate([STEADY, STEADY + 0.2]))  # T waves taken for R waves
    run = scheduled(double, 8.5)
    assert last(run, "beats") == 10
    assert last(run, "ignored_edges") == 10
    assert last(run, "predicted_rr") == pytest.approx(0.8)


@pytest.mark.parametrize(("action", "length"), [(0, None), (1, 0.5 * 0.33 * 0.8)])
def test_premature_beat_is_skipped_or_shortened(action: int, length: float | None) -> None:
    times = np.array([0.8, 1.6, 2.4, 3.2, 4.0, 4.5, 5.6, 6.4])  # one at 0.625 of a beat, with its pause
    run = scheduled(times, 7.2, premature_action=action)
    assert last(run, "premature_beats") == 1
    assert last(run, "skipped_pulses") == 1 - action
    of_it = [p for p in pulses(run) if 4.5 <= p[0] < 5.6]
    assert len(of_it) == action
    if length is not None:
        assert of_it[0][1] - of_it[0][0] == pytest.approx(length, abs=1e-6)
    assert any(5.6 <= p[0] < 6.4 for p in pulses(run)), "the beat after the pause is assisted"


def test_lost_rhythm_switches_off_until_beats_return() -> None:
    times = np.concatenate([STEADY, [12.0, 12.8, 13.6]])  # 8.0 was the last, 9.2 is the limit
    run = scheduled(times, 14.4)
    assert last(run, "dropouts") == 1
    lost = run.time[:-1][run["scheduler.lost"][1:] > 0.5]
    assert lost[0] == pytest.approx(8.0 + 1.5 * 0.8, abs=1e-7)
    during = [p for p in pulses(run) if 8.8 < p[0] < 12.8]
    assert during == [], "no pulse in the gap, nor on the first beat after it"
    assert sum(p[0] > 12.8 for p in pulses(run)) == 2


def test_longest_pulse() -> None:
    run = scheduled(STEADY, 8.5, max_on_time=0.1)
    assert np.allclose(np.diff(pulses(run), axis=1), 0.1, atol=1e-6)


def test_pulse_ends_with_the_next_r_wave() -> None:
    run = scheduled(np.array([0.8, 1.6, 2.4, 3.2, 4.0, 4.28]), 5.0, off_fraction=0.6, premature_action=0)
    assert pulses(run)[-1][1] == pytest.approx(4.28, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "levels", "cause"),
    [("electric_field", (0.0, 85e6, 75e6, 60e6), 1), ("snap_through_margin", (1e5, 500.0, 1500.0, 1e5), 2)],
)
def test_veto_has_a_hysteresis(name: str, levels: tuple[float, float, float, float], cause: int) -> None:
    times = 0.8 * np.arange(1, 16)
    changes, stop = (4.1, 4.2, 8.1), 12.5  # into the limit, back within the hysteresis, out of it
    grid = [0.0, *np.repeat(changes, 2), stop]
    run = scheduled(times, stop, tables={name: Protocol.of(grid, **{name: np.repeat(levels, 2)})})
    assert last(run, "vetoes") == 1
    assert last(run, "veto_cause") == cause
    on = pulses(run)
    assert not [p for p in on if 4.1 < p[0] < 8.2], "no pulse while vetoed"
    cut = [p for p in on if p[0] < 4.1 < p[1] + 1e-6]
    assert cut and cut[0][1] == pytest.approx(4.1, abs=0.011), "the running pulse was cut"
    assert [p for p in on if p[0] > 8.2], "pulses return"


def test_notch_ends_the_pulse() -> None:
    beat = np.array([(0.0, 80), (0.05, 78), (0.15, 120), (0.22, 108), (0.24, 112), (0.8, 80)])
    time = np.concatenate([beat[:, 0] + r - 0.0001 for r in 0.8 * np.arange(11)])
    pressure = Protocol.of(
        np.maximum.accumulate(np.maximum(time, 0)), aortic_pressure=np.tile(beat[:, 1] * 133.322, 11)
    )
    run = scheduled(STEADY, 8.5, step=0.002, tables={"aortic_pressure": pressure})
    after_r = pulses(run)[:, 1] - STEADY[3:]
    assert np.all((after_r > 0.22) & (after_r < 0.226)), "off within a sample or two of the notch, not at 0.304"


def test_amplifier_limits() -> None:
    run = scheduled(STEADY, 4.0, step=1e-3, current_limit=2e-3, slew_rate=1e6)
    speed = np.abs(np.diff(run["scheduler.voltage"]) / np.diff(run.time))
    assert speed.max() == pytest.approx(2e-3 / 20e-9, rel=1e-3)  # the current limit is the lower one
    assert np.abs(run["scheduler.amplifier_current"]).max() <= 2e-3 * (1 + 1e-6)
    run = scheduled(STEADY, 4.0, step=1e-3, current_limit=1.0, slew_rate=5e5)
    assert np.abs(np.diff(run["scheduler.voltage"]) / np.diff(run.time)).max() == pytest.approx(5e5, rel=1e-3)
    assert run["scheduler.voltage"].max() == pytest.approx(5000, rel=1e-6)


def test_every_state_is_shown() -> None:
    run = scheduled(np.array([0.8, 1.6, 2.4, 3.2, 4.0, 4.5, 5.6, 6.4]), 9.0)
    assert set(run["scheduler.state"]) == {0, 1, 2, 3, 4, 5}


def test_saved_state_is_exact() -> None:
    """Discretes are part of the FMU's state: a run that is rolled back at every beat is the same run."""

    def drive(slave: Slave, begin: int, end: int, bytes_: list[float]) -> None:
        inputs = slave.ports().inputs
        for k in range(begin, end):
            t = k * 0.01
            slave.fmu.setReal([inputs["r_wave"].reference], [float(t % 0.8 < 0.015)])
            slave.fmu.doStep(t, 0.01)
            outputs = [p.reference for p in slave.ports().outputs.values()]
            bytes_.extend(slave.fmu.getReal(outputs))

    with Slave("one", slaves()["scheduler"]) as slave:
        slave.fmu.setupExperiment(startTime=0.0)
        slave.fmu.enterInitializationMode()
        slave.fmu.exitInitializationMode()
        drive(slave, 0, 400, [])
        state = slave.fmu.getFMUstate()
        serialized = slave.fmu.serializeFMUstate(state)
        first: list[float] = []
        second: list[float] = []
        drive(slave, 400, 700, first)
        slave.fmu.setFMUstate(slave.fmu.deSerializeFMUstate(serialized))
        drive(slave, 400, 700, second)
        slave.fmu.freeFMUstate(state)
    assert first == second
    assert len(set(first)) > 100


def test_model_exchange_is_refused() -> None:
    import fmpy
    from fmpy.fmi2 import FMU2Model

    path = slaves()["scheduler"]
    description = fmpy.read_model_description(str(path))
    assert description.modelExchange is None
    folder = fmpy.extract(str(path))
    fmu = FMU2Model(
        guid=description.guid, unzipDirectory=folder, modelIdentifier="HeartbeatScheduler", instanceName="x"
    )
    with pytest.raises(Exception, match="instantiate"):
        fmu.instantiate()


def test_discretes_need_a_host_that_samples() -> None:
    with pytest.raises(KernelError, match="sampled at communication points"):
        Kernel(heartbeat_scheduler())
    model = heartbeat_scheduler()
    late = Discrete(Quantity("x", "1", ""), model["voltage_on"], model["r_high"] + model["pulses"])
    with pytest.raises(DeclarationError, match="the update of x uses pulses, r_high"):
        replace(model, discretes=(late, *model.discretes))


# Recorded ECGs --------------------------------------------------------------------------------------------------


def annotated(record: Path) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] of all annotated beats, and of those annotated as premature."""
    import wfdb

    notes = wfdb.rdann(str(record), "atr")
    times, symbols = np.array(notes.sample) / 360, np.array(notes.symbol)
    return times[np.isin(symbols, ["N", "A", "V"])], times[np.isin(symbols, ["A", "V"])]


def by_rule(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Premature and lost beats of R `times`, from the rules' text and numpy's median: flags for each R wave."""
    premature, lost = np.zeros(times.size, bool), np.zeros(times.size, bool)
    history: list[float] = []
    for i in range(1, times.size):
        rr = times[i] - times[i - 1]
        known = history[-5:] if len(history) >= 5 else [history[0]] * (5 - len(history)) + history if history else []
        if len(history) >= 3:
            premature[i] = rr < 0.8 * np.median(known)
            lost[i] = rr >= 1.5 * np.median(known)
        if rr <= 2.5:
            history.append(rr)
    return premature, lost


def test_record_100_for_thirty_minutes() -> None:
    needs("wfdb")
    record = shared("ecg/100.hea").with_suffix("")
    beats, marked = annotated(record)
    run = scheduled(beats, 1806.0)
    premature, lost = by_rule(beats)
    on = pulses(run)
    belongs = np.searchsorted(beats, on[:, 0], side="right") - 1
    assert last(run, "beats") == beats.size
    assert last(run, "premature_beats") == premature.sum()
    assert np.isin(beats[premature], marked).sum() >= 29, "what is skipped as premature is annotated so"
    assert not premature[belongs].any(), "no pulse on a premature beat"
    assert not lost[belongs].any(), "no pulse on the first beat after a missing one"
    assert np.unique(belongs).size == belongs.size, "one pulse a beat at most"
    expected = np.arange(beats.size) >= 3
    assert set(belongs) == set(np.flatnonzero(expected & ~premature & ~lost))


def test_record_100_with_missing_beats_and_vetoes() -> None:
    """A beat in fifty is taken away, and the field goes beyond its limit for a while every minute."""
    needs("wfdb")
    beats, _ = annotated(shared("ecg/100.hea").with_suffix(""))
    kept = np.delete(beats, np.arange(25, beats.size, 50))
    high = np.array([(m * 60 + s) for m in range(30) for s in (20.0, 20.0, 24.0, 24.0)])
    field = Protocol.of([0, *high, 1806], electric_field=[0, *np.tile([0, 9e7, 9e7, 0], 30), 0])
    run = scheduled(kept, 1806.0, tables={"electric_field": field})
    on = pulses(run)
    assert last(run, "vetoes") == 30
    assert last(run, "dropouts") >= 40
    within = (on[:, 0] % 60 > 20.0) & (on[:, 0] % 60 < 24.0)
    assert not within.any(), "no pulse on a vetoed beat"
    gaps = [(a, b) for a, b in zip(kept, kept[1:], strict=False) if b - a > 1.5 * 0.85]
    late = [p for p in on for a, b in gaps if a + 1.5 * 0.85 < p[0] < b]
    assert late == [], "no pulse on a missing beat"


def test_detector_finds_the_annotated_beats() -> None:
    needs("wfdb")
    needs("sleepecg")
    beats, _ = annotated(shared("ecg/100.hea").with_suffix(""))
    found = detect(read_ecg(shared("ecg/100.hea")))
    nearest = np.abs(
        found[:, None] - beats[np.clip(np.searchsorted(beats, found)[:, None] + [-1, 0], 0, beats.size - 1)]
    )
    assert (nearest.min(axis=1) < 0.05).mean() > 0.999
    assert abs(found.size - beats.size) <= 2


def test_noise_and_dropouts_give_no_pulse_without_a_beat() -> None:
    needs("wfdb")
    needs("sleepecg")
    ecg = read_ecg(shared("ecg/100.hea"))
    signal = ecg.signal[: int(300 * ecg.rate)].copy()
    random = np.random.default_rng(7)
    signal += 0.1 * random.standard_normal(signal.size)
    gaps = [(40, 46), (100, 101.2), (200, 215)]
    for begin, end in gaps:
        signal[int(begin * ecg.rate) : int(end * ecg.rate)] = np.nan
    found = detect(Ecg(signal, ecg.rate))
    assert not any(begin < t < end for t in found for begin, end in gaps)
    run = scheduled(found, 300.0)
    on = pulses(run)
    assert on.shape[0] > 300
    for begin, end in gaps:
        # The pulse of the last beat before the gap may still begin; nothing after the rhythm is lost.
        assert not [p for p in on if begin + 1.5 < p[0] < end]


def test_arterial_pressure_shows_its_notches() -> None:
    needs("wfdb")
    needs("sleepecg")
    record = shared("ecg/03700181.hea")
    beats, pressure = detect(read_ecg(record)), read_ecg(record, "ABP")
    stop = 120.0
    filled = np.nan_to_num(pressure.signal[: int(stop * pressure.rate) + 1]) * 133.322
    grid = np.arange(filled.size) / pressure.rate
    table = Protocol.of([*grid, stop + 1], aortic_pressure=[*filled, filled[-1]])
    run = scheduled(
        beats[beats < stop], stop, step=0.004, tables={"aortic_pressure": table}, off_fraction=0.6, max_on_time=0.5
    )
    assert last(run, "beats") > 100
    assert last(run, "notches") > 0.5 * last(run, "beats")
    assert last(run, "pulses") > 0.7 * last(run, "beats")


def test_bad_ecgs_are_refused(tmp_path: Path) -> None:
    with pytest.raises(HeartbeatError, match="at least one time"):
        r_waves([], 10.0)
    with pytest.raises(HeartbeatError, match="ascending"):
        r_waves([1.0, 0.5], 10.0)
    with pytest.raises(HeartbeatError, match="does not move"):
        needs("sleepecg")
        detect(Ecg(np.zeros(5000), 250.0))
    with pytest.raises(HeartbeatError, match="beats found in"):
        detect(Ecg(np.linspace(0, 1, 25000), 250.0))
    with pytest.raises(HeartbeatError, match="50 samples a second; expected more than 60, to find beats: is the unit"):
        detect(Ecg(np.linspace(0, 1, 25000), 50.0))
    table = tmp_path / "ecg.csv"
    table.write_text("t,v\n0,1\n")
    with pytest.raises(HeartbeatError, match="expected the columns 'time"):
        read_ecg(table)
    table.write_text("time [s],pressure [Pa],voltage [V]\n0,1,2\n0.1,1,2\n")
    with pytest.raises(HeartbeatError, match=r"'ecg \[mV\]' but found time .*; name the column of the ECG as the lead"):
        read_ecg(table)
    assert read_ecg(table, "voltage").rate == pytest.approx(10.0)
    table.write_text("time [parsec],II [mV]\n0,1\n0.1,1\n")
    with pytest.raises(HeartbeatError, match="line 1, column 'time': "):
        read_ecg(table)


@pytest.mark.parametrize("heading", ["time [ms],II [mV]", "time [ms],other [A],chest [mV]", "Time (ms),ECG"])
def test_the_column_of_an_ecg(tmp_path: Path, heading: str) -> None:
    table, wide = tmp_path / "ecg.csv", heading.count(",") > 1
    table.write_text(heading + "\n" + "".join(f"{4 * k},{'9,' * wide}{k % 7}\n" for k in range(50)))
    read = read_ecg(table)
    assert read.rate == pytest.approx(250.0)
    assert read.signal[:8].tolist() == [0, 1, 2, 3, 4, 5, 6, 0]
