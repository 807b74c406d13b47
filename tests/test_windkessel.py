"""Ventricle and windkessel against analytic solutions, against svZeroDSolver, against the closed loop whose parameters
they use, and against measured beats."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from coupled import needs, slaves
from shared_data import shared
from tubular_dea.api.heart import patient_of
from tubular_dea.export.package import native_fmu
from tubular_dea.kernel import Kernel
from tubular_dea.model.compose import CouplingError, compose
from tubular_dea.model.dea import tubular_dea
from tubular_dea.model.declare import DeclarationError
from tubular_dea.model.patients import ML, MMHG, PATIENTS, RESISTANCE, PatientError
from tubular_dea.model.scheduler import heartbeat_scheduler
from tubular_dea.model.windkessel import aortic_windkessel, checked_patient, paced_windkessel, patient
from tubular_dea.protocol import Protocol

PERIOD = 0.8
# A ventricle that never ejects: flow enters the windkessel only as (negative) tube flow.
IDLE = {
    "E_max": PATIENTS["healthy"]["E_min"],
    "filling_pressure": 0.0,
    "venous_pressure": 0.0,
    "ventricular_volume_start": 10 * ML,
    "R_closed": 1e16,
}


@functools.cache
def kernel() -> Kernel:
    return Kernel(aortic_windkessel())


def afterload(elements: int, time: np.ndarray, flow: np.ndarray, **values: float) -> np.ndarray:
    """Aortic pressure [Pa] of the windkessel alone for a flow [m3/s] into it, at `time`."""
    parameters = patient("healthy", {**IDLE, "elements": elements, **values})
    return kernel().simulate(Protocol.of(time, tube_flow=-flow), time, parameters, tolerance=1e-9)["aortic_pressure"]


@pytest.mark.parametrize("elements", [2, 3, 4])
def test_constant_flow_is_analytic(elements: int) -> None:
    q, p0 = 90 * ML, 80 * MMHG
    v = PATIENTS["healthy"]
    time = np.linspace(0, 3, 301)
    pressure = afterload(elements, time, np.full(301, q), aortic_pressure_start=p0)
    end = v["R"] * q
    expected = end + (p0 - end) * np.exp(-time / (v["R"] * v["C"]))
    if elements == 3:
        expected += v["Z_c"] * q
    if elements == 4:
        expected += v["Z_c"] * q * np.exp(-time * v["Z_c"] / v["L"])
    assert np.abs(pressure - expected).max() < 1e-3 * MMHG


@pytest.mark.parametrize("elements", [2, 3, 4])
@pytest.mark.parametrize("hertz", [1.25, 5.0])
def test_sinusoidal_flow_sees_the_impedance(elements: int, hertz: float) -> None:
    v = PATIENTS["healthy"]
    omega = 2j * np.pi * hertz
    z = v["R"] / (1 + omega * v["R"] * v["C"])
    z += {2: 0, 3: v["Z_c"], 4: omega * v["L"] * v["Z_c"] / (omega * v["L"] + v["Z_c"])}[elements]
    time = np.arange(0, 20, 2e-3 / hertz)
    mean, swing = 150 * ML, 100 * ML  # the pressure stays above the idle ventricle's, whose valve stays shut
    pressure = afterload(elements, time, mean + swing * np.sin(2 * np.pi * hertz * time))
    last = time > 20 - 4 / hertz
    expected = mean * (v["R"] + (v["Z_c"] if elements == 3 else 0))
    expected = expected + swing * abs(z) * np.sin(2 * np.pi * hertz * time + np.angle(z))
    assert np.abs(pressure - expected)[last].max() < 1e-3 * swing * abs(z)


def svzerod_beat(values: dict[str, float], cycles: int, points: int) -> dict[str, np.ndarray]:
    """The same circuit in svZeroDSolver (mmHg, mL, s): the last of `cycles` beats."""
    import svzerod

    scale = 0.2 + 0.15 * PERIOD
    ideal = {"C": 0.0, "L": 0.0, "R_poiseuille": 0.0}
    fill, stiff = values["filling_pressure"] / MMHG, ML / MMHG
    peak = _hill_peak()  # svZeroDSolver norms the curve to a peak of 1
    configuration = {
        "simulation_parameters": {
            "number_of_cardiac_cycles": cycles,
            "number_of_time_pts_per_cardiac_cycle": points,
            "output_variable_based": True,
            "output_all_cycles": False,
            "cardiac_period": PERIOD,
            "absolute_tolerance": 1e-10,
        },
        "vessels": [
            {
                "vessel_id": 1,
                "vessel_length": 1.0,
                "vessel_name": "atrium",
                "boundary_conditions": {"inlet": "FILL"},
                "zero_d_element_type": "BloodVessel",
                "zero_d_element_values": ideal,
            },
            {
                "vessel_id": 2,
                "vessel_length": 1.0,
                "vessel_name": "aorta",
                "boundary_conditions": {"outlet": "RCR"},
                "zero_d_element_type": "BloodVessel",
                "zero_d_element_values": ideal,
            },
        ],
        "junctions": [],
        "boundary_conditions": [
            {"bc_name": "FILL", "bc_type": "PRESSURE", "bc_values": {"P": [fill, fill], "t": [0.0, PERIOD]}},
            {
                "bc_name": "RCR",
                "bc_type": "RCR",
                "bc_values": {
                    "Rp": values["Z_c"] / RESISTANCE,
                    "C": values["C"] / stiff,
                    "Rd": values["R"] / RESISTANCE,
                    "Pd": values["venous_pressure"] / MMHG,
                },
            },
        ],
        "chambers": [
            {
                "type": "LinearElastanceChamber",
                "name": "lv",
                "values": {
                    "Emax": (values["E_max"] - values["E_min"]) * stiff * peak,
                    "Epass": values["E_min"] * stiff,
                    "Vrest": values["V_0"] / ML,
                },
                "activation_function": {
                    "type": "two_hill",
                    "t_shift": 0.0,
                    "tau_1": 0.7 * scale,
                    "tau_2": 1.17 * scale,
                    "m1": 1.9,
                    "m2": 21.9,
                },
            }
        ],
        "valves": [
            {
                "type": "PiecewiseValve",
                "name": "mitral",
                "params": {
                    "Rmax": 1e4,
                    "Rmin": values["R_mitral"] / RESISTANCE,
                    "upstream_block": "atrium",
                    "downstream_block": "lv",
                },
            },
            {
                "type": "PiecewiseValve",
                "name": "aortic",
                "params": {
                    "Rmax": 1e4,
                    "Rmin": values["R_aortic"] / RESISTANCE,
                    "upstream_block": "lv",
                    "downstream_block": "aorta",
                },
            },
        ],
        "initial_condition": {"Vc:lv": 130.0, "pressure:aortic:aorta": 75.0, "pressure_c:RCR": 75.0},
    }
    table = svzerod.simulate(configuration)
    names = {"pressure": "pressure:aortic:aorta", "volume": "Vc:lv", "ventricle": "pressure:lv:aortic"}
    return {key: table[table["name"] == name]["y"].to_numpy() for key, name in names.items()}


def _hill_peak() -> float:
    t = np.linspace(0, 2.5, 400001)
    rise, fall = (t / 0.7) ** 1.9, (t / 1.17) ** 21.9
    return float((1.55 * rise / (1 + rise) / (1 + fall)).max())


@pytest.mark.parametrize("name", ["healthy", "stiff"])  # its Newton iteration gives up on "failing"
def test_a_beat_is_svzerodsolvers(name: str) -> None:
    needs("svzerod")
    # As sharp a valve as there.
    values = patient(name, {"elements": 3.0, "valve_width": 0.01 * MMHG, "ventricular_volume_start": 130 * ML})
    cycles, points = 15, 2001
    theirs = svzerod_beat(values, cycles, points)
    time = np.linspace((cycles - 1) * PERIOD, cycles * PERIOD, points)
    ours = kernel().simulate(Protocol.of([0, cycles * PERIOD], tube_flow=[0, 0]), time, values, tolerance=1e-8)
    assert np.abs(theirs["pressure"] - ours["aortic_pressure"] / MMHG).max() < 0.15
    assert np.abs(theirs["volume"] - ours["ventricular_volume"] / ML).max() < 0.15
    stroke = np.ptp(ours["ventricular_volume"]) / ML
    assert np.ptp(theirs["volume"]) == pytest.approx(stroke, rel=1e-3)


def simaan(emax: float, beats: int = 40) -> dict[str, float]:
    """Simaan et al. (2009), their five states and values (mmHg, mL, s), written down once more."""
    beat = 60 / 75
    scale = 0.2 + 0.15 * beat

    def elastance(t: float) -> float:
        g = (t % beat / scale / 0.7) ** 1.9
        return (emax - 0.06) * 1.55 * g / (1 + g) / (1 + (t % beat / scale / 1.17) ** 21.9) + 0.06

    def rates(t: float, x: np.ndarray) -> list[float]:
        volume, atrium, arteries, aorta, flow = x
        p = elastance(t) * (volume - 10)
        inlet, outlet = max(atrium - p, 0) / 0.005, max(p - aorta, 0) / 0.001
        back = (arteries - atrium) / 1.0
        return [
            inlet - outlet,
            (back - inlet) / 4.4,
            (flow - back) / 1.33,
            (outlet - flow) / 0.08,
            (aorta - arteries - 0.0398 * flow) / 0.0005,
        ]

    start = [140, 8.2, 67, 82, 0]
    solution = solve_ivp(rates, (0, beats * beat), start, method="LSODA", max_step=4e-3, rtol=1e-7, dense_output=True)
    x = solution.sol(np.linspace((beats - 1) * beat, beats * beat, 1001))
    return {
        "volume": float(x[0].max()),
        "stroke": float(np.ptp(x[0])),
        "mean": float(x[3].mean()),
        "atrium": float(x[1][0]),
    }


def test_steady_values_are_those_of_the_published_closed_loop() -> None:
    """The open loop has the closed loop's end-diastolic atrial pressure; the rest must follow, to a few percent."""
    published = simaan(2.0)
    assert published["atrium"] * MMHG == pytest.approx(PATIENTS["healthy"]["filling_pressure"], rel=0.01)
    time = np.linspace(19 * PERIOD, 20 * PERIOD, 1001)
    ours = kernel().simulate(Protocol.of([0, 20 * PERIOD], tube_flow=[0, 0]), time)
    volume, pressure = ours["ventricular_volume"] / ML, ours["aortic_pressure"] / MMHG
    assert volume.max() == pytest.approx(published["volume"], rel=0.04)
    assert np.ptp(volume) == pytest.approx(published["stroke"], rel=0.05)
    assert pressure.mean() == pytest.approx(published["mean"], rel=0.04)


@pytest.mark.parametrize(("name", "low", "high"), [("healthy", 1.4, 2.0), ("failing", 0.3, 0.5)])
def test_ventricle_and_arteries_match_as_in_man(name: str, low: float, high: float) -> None:
    """Asanoi et al. (1989): elastances nearly 2 to 1 in health, less than 1 to 2 in severe failure (EF below 40 %)."""
    v = patient(name)
    assert low < v["E_max"] / (v["R"] * v["heart_rate"]) < high
    time = np.linspace(19 * PERIOD, 20 * PERIOD, 1001)
    volume = kernel().simulate(Protocol.of([0, 20 * PERIOD], tube_flow=[0, 0]), time, v)["ventricular_volume"]
    assert (np.ptp(volume) / volume.max() < 0.4) == (name == "failing")


def read_beat() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    folder = shared("aorta/stergiopulos1999_data")
    flow, pressure = (np.loadtxt(folder / f"{n}.csv", delimiter=",") for n in ("aflow", "apressure"))
    return flow[:, 0] - flow[0, 0], pressure[:, 1] * MMHG, flow[:, 1] * ML


def read_pig(folder: str, number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    columns = []
    for letter in "PQ":
        lines = shared(f"aorta/{folder}/Ao_baseline1_Ao{letter}{number}.csv").read_text().splitlines()
        rows = [line.split(",") for line in lines if line[:1].isdigit()]
        clock = [sum(float(x) * s for x, s in zip(r[0].split(":"), (3600, 60, 1), strict=True)) for r in rows]
        columns.append((np.array(clock), np.array([float(r[1]) for r in rows])))
    (time, pressure), (when, flow) = columns
    return time - time[0], pressure * MMHG, np.interp(time, when, flow) * 1e-3 / 60


def fitted(time: np.ndarray, pressure: np.ndarray, flow: np.ndarray, elements: int) -> float:
    """Goodness of fit [%] of the windkessel to a record, its parameters and starting pressure free."""

    def model(x: np.ndarray) -> np.ndarray:
        z, r, c, inertance = np.exp(x[:4])
        return afterload(elements, time, flow, Z_c=z, R=r, C=c, L=inertance, aortic_pressure_start=x[4] * 1e4)

    start = [
        np.log(0.04 * RESISTANCE),
        np.log(pressure.mean() / flow.mean()),
        np.log(1.3 * ML / MMHG),
        np.log(0.01 * RESISTANCE),
        pressure[0] / 1e4,
    ]
    bounds = (np.array(start) - 4, np.array(start) + 4)
    best = least_squares(lambda x: (model(x) - pressure) / MMHG, start, diff_step=1e-4, bounds=bounds)
    return float(100 * (1 - np.linalg.norm(pressure - model(best.x)) / np.linalg.norm(pressure - pressure.mean())))


@pytest.mark.parametrize(("elements", "expected"), [(3, 78.4), (4, 82.4)])
def test_fit_of_the_human_beat(elements: int, expected: float) -> None:
    assert fitted(*read_beat(), elements) == pytest.approx(expected, abs=0.5)


@pytest.mark.parametrize(
    ("reader", "least"),
    [
        (lambda: read_pig("exvivo_data", 1), 64),
        (lambda: read_pig("invivo_data", 1), 60),
        (lambda: read_pig("invivo_data", 2), 60),
    ],
    ids=["ex vivo", "in vivo 1", "in vivo 2"],
)
def test_fit_of_the_pigs_records(reader: Callable[[], tuple[np.ndarray, np.ndarray, np.ndarray]], least: float) -> None:
    """The in-vivo records hide an effect that no windkessel has; these are the fits without it."""
    assert fitted(*reader(), 3) > least


def test_r_waves_come_with_the_cycle() -> None:
    time = np.sort(np.concatenate([np.arange(0.0005, 4, 1e-3), PERIOD * np.arange(1, 5)]))
    run = kernel().simulate(Protocol.of([0, 4], tube_flow=[0, 0]), time)
    rises = time[1:][np.diff(run["r_wave"]) > 0]
    assert np.allclose(rises, PERIOD * np.arange(1, 5), atol=1e-9)
    assert np.allclose(run["next_r_wave"], PERIOD * (np.floor(time / PERIOD + 1e-9) + 1), atol=1e-5)


def test_fmus_are_valid(tmp_path: Path) -> None:
    from fmpy.validation import validate_fmu

    for path in slaves().values():
        assert validate_fmu(str(path)) == []
    for model in (aortic_windkessel(), paced_windkessel(), heartbeat_scheduler()):
        assert validate_fmu(str(native_fmu(model, 3, tmp_path / f"{model.name}.fmu"))) == []


def test_patients_must_be_whole_and_known() -> None:
    whole = patient("failing")
    with pytest.raises(PatientError, match="there is no patient 'failling'; did you mean failing"):
        patient("failling")
    with pytest.raises(PatientError, match="lacks C; give C .*m3/Pa"):
        checked_patient({n: v for n, v in whole.items() if n != "C"}, "mine")
    with pytest.raises(PatientError, match="no parameter 'Cc'"):
        checked_patient({**whole, "Cc": 1.0}, "mine")
    with pytest.raises(PatientError, match="no parameter 'RR'; did you mean R"):  # whatever its unit
        patient_of({**whole, "RR": "2 mmHg.s/mL"})
    with pytest.raises(PatientError, match="heart_rate: expected 0.3 to 5.0 Hz but was given 75"):
        checked_patient({**whole, "heart_rate": 75.0}, "mine")


def test_composition_refuses_what_does_not_fit() -> None:
    parts = {"tube": tubular_dea(), "heart": aortic_windkessel()}
    with pytest.raises(CouplingError, match="has no output 'aortic_pressur'; did you mean aortic_pressure"):
        compose("X", parts, [("heart.aortic_pressur", "tube.pressure")])
    with pytest.raises(CouplingError, match="there is no part 'hart'"):
        compose("X", parts, [("hart.aortic_pressure", "tube.pressure")])
    with pytest.raises(CouplingError, match="in 'm3' but tube.pressure expects 'Pa'"):
        compose("X", parts, [("heart.ventricular_volume", "tube.pressure")])
    with pytest.raises(CouplingError, match="keep one"):
        compose(
            "X", parts, [("heart.aortic_pressure", "tube.pressure"), ("heart.ventricular_pressure", "tube.pressure")]
        )
    with pytest.raises(DeclarationError, match="is sampled, or has pure delays"):
        compose("X", {"scheduler": heartbeat_scheduler(), **parts}, [("scheduler.voltage", "tube.voltage")])
    with pytest.raises(DeclarationError, match="algebraic loop"):
        two = {"a": aortic_windkessel({"elements": 3}), "b": aortic_windkessel({"elements": 3})}
        compose("X", two, [("a.aortic_flow", "b.tube_flow"), ("b.aortic_flow", "a.tube_flow")])


def test_composition_keeps_open_inputs() -> None:
    whole = compose(
        "X", {"tube": tubular_dea(), "heart": aortic_windkessel()}, [("heart.aortic_pressure", "tube.pressure")]
    )
    assert [q.name for q in whole.inputs] == ["tube_voltage", "heart_tube_flow"]
    assert "tube_snap_through_margin" not in whole.outputs  # the fold belongs to the tube alone
