"""The tubular actuator on a bench: pressure and voltage in, the radius at the middle out, the current beside it.

::

    regulator --- pressure ---> [ tube ] --- radius ---> laser
    amplifier --- voltage ----> [      ] --- current --> monitor

Equations: `model/dea.py`. Places: the pressure's and the voltage's way to the wall, the wall's balance, its stiffness,
damping and permittivity, the laser. Effects that are more than a law at one of them stand in `effects/`, one file each.

Stages of the paper's fit (Section III): C_1 and eps_r come from the ramp with the lowest voltage, C_2 and C_3 from the
ramp with the highest, the viscous parameters from a step. Table II starts both Maxwell branches with the same values.
There the cost has a saddle (the branches are exchangeable), so they are moved apart by their relaxation times.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..laws import Coefficient, Path
from ..model.dea import GEOMETRY, tubular_dea
from .effects import own
from .plant import Drives, Exchange, Input, Output, Plant, Stage, Values
from .tube_experiments import feasible, standard
from .tube_latent import latent

ELASTIC_LOW, ELASTIC_HIGH = ("C_1", "eps_r"), ("C_2", "C_3")
VISCOUS = ("eta_o", "k_1", "eta_1", "k_2", "eta_2")
TABLE_II = {
    "C_1": 195e3,
    "C_2": -1.5e3,
    "C_3": 2.5e3,
    "eps_r": 2.8,
    "eta_o": 500e3,
    "k_1": 10e6,
    "eta_1": 500e3,
    "k_2": 10e6,
    "eta_2": 500e3,
}
JUMP = 0.2  # of the largest voltage: an experiment with such a jump is a step, one without is a ramp
DRIVEN = 0.1  # of the largest voltage: an experiment with less says nothing of it


def _kinds(drives: Drives) -> tuple[list[int], list[int], list[int]]:
    """The experiment with the lowest ramp, that with the highest, and one with steps (all, where there is none)."""
    everything = list(range(len(drives)))
    heights = [float(np.abs(d.inputs["voltage"]).max()) for d in drives]
    top = max(heights)
    driven = [i for i in everything if heights[i] > DRIVEN * top]
    jumps = {i: np.abs(np.diff(drives[i].inputs["voltage"])[np.diff(drives[i].time) < SUDDEN]) for i in driven}
    ramps = [i for i in driven if jumps[i].max(initial=0) < JUMP * top]
    by_height = sorted(ramps, key=lambda i: heights[i])
    few = sorted((i for i in driven if i not in ramps), key=lambda i: (len(drives[i].time), heights[i]))
    return by_height[:1] or everything, by_height[-1:] or everything, few[:1] or everything


SUDDEN = 0.01  # s: a change of the voltage that is this short is a jump


def _both_ramps(drives: Drives) -> list[int]:
    low, high, _ = _kinds(drives)
    return sorted({*low, *high})


def _apart(values: Values) -> Values:
    """Branches with equal relaxation times get different ones: a fast and a slow one."""
    moved = dict(values)
    if abs(values["eta_1"] / values["k_1"] - values["eta_2"] / values["k_2"]) < 1e-3 * values["eta_1"] / values["k_1"]:
        moved["eta_1"], moved["eta_2"] = values["eta_1"] * 5, values["eta_2"] * 25
    return moved


def _stiffer(values: Values, factor: float) -> dict[str, float]:
    """A tube that carries higher pressures before it bursts."""
    return {n: v * (factor if n.startswith("C_") else 1.0) for n, v in values.items()}


def _faster_first(values: Mapping[str, float]) -> bool:
    """The faster of the two Maxwell branches is called the first, as in Table III."""
    return values["k_1"] / values["eta_1"] >= values["k_2"] / values["eta_2"]


PRESSURE = {
    "offset": "pressure_offset",
    "gain": "pressure_gain",
    "delay": "pressure_delay",
    "delay.late": "delayed_pressure",
    "lead": "pressure_lead",
    "lead.tau": "tau_pressure_rate",
    "lead.slow": "pressure_a_moment_ago",
    "resonance": "pneumatic_line",
    "resonance.omega": "line_omega",
    "resonance.damping": "line_damping",
    "resonance.share": "line_share",
}
DIAMETER = ("diameter", "durchmesser", "diamètre", "diametre", "diametro", "diámetro")  # as laboratories head it
RADIUS = {
    "offset": "radius_offset",
    "delay": "sensor_delay",
    "delay.late": "delayed_reading",
    "lag": "sensor_lag",
    "lag.tau": "tau_sensor",
    "lag.share": "sensor_share",
    "lag.slow": "lagging_reading",
    "average": "sensor_average",
    "average.window": "averaging_window",
    "average.swing": "averaged_reading",
    "drift": "sensor_drift",
}
VOLTAGE = {
    "delay": "voltage_delay",
    "delay.late": "delayed_voltage",
    "slow_release": "slow_discharge",
    "slow_release.tau": "tau_discharge",
    "slow_release.held": "discharging_voltage",
}
PLACES = (
    Path(
        "pressure",
        words="the recorded pressure",
        channel="pressure",
        signal="wall_pressure",
        seconds=0.02,
        size=2e4,
        delayed=True,
        names=PRESSURE,
        laws=("offset", "gain", "delay", "lead", "resonance"),
    ),
    Path(
        "voltage",
        words="the recorded voltage",
        channel="electrical",
        signal="electrode_voltage",
        seconds=0.02,
        size=5e3,
        delayed=True,
        names=VOLTAGE,
        laws=("delay", "slow_release"),
    ),
    Path(
        "measured_displacement",
        words="the recorded radius",
        channel="sensor",
        signal="sensor_signal",
        seconds=0.02,
        size=5e-3,
        names=RADIUS,
        laws=("offset", "delay", "lag", "average", "drift"),
    ),
    Coefficient(
        "dW_dI_1",
        words="the elastomer's stiffness",
        channel="mechanical",
        seconds=1.0,
        names={"drift": "stiffness_drift"},
        laws=("drift",),
    ),
    Coefficient(
        "eps_r",
        words="the permittivity",
        channel="electrical",
        signal="eps_effective",
        seconds=1.0,
        names={"drift": "permittivity_drift"},
        laws=("drift",),
    ),
)
PLANT = Plant(
    tubular_dea(),
    inputs=(
        Input("pressure", least=400.0, most=1e5, zero=130.0, channel="pressure"),
        Input("voltage", held=True, least=25.0, most=1e5, zero=10.0, channel="electrical"),
    ),
    outputs=(
        Output(
            "measured_displacement",
            {"radius": "r_o", "displacement": "", "radial_displacement": ""},
            multiples={name: ("radius", 2.0) for name in DIAMETER},
            most=0.2,
            zero=30e-6,
            rest=0.0,
        ),
        Output("current", most=0.1, zero=2e-7, channel="electrical", required=False, feels_rates=True),
    ),
    own=own(),
    places=PLACES,
    geometry=tuple(q.name for q in GEOMETRY if q.type != "Boolean" and q.name != "lambda_2_start"),
    exchanges=(Exchange({"k_1": "k_2", "k_2": "k_1", "eta_1": "eta_2", "eta_2": "eta_1"}, _faster_first),),
    stages=(
        Stage(ELASTIC_LOW, "C_1 and eps_r from the lowest ramp", lambda drives: _kinds(drives)[0]),
        Stage(ELASTIC_HIGH, "C_2 and C_3 from the highest ramp", lambda drives: _kinds(drives)[1]),
        Stage(ELASTIC_LOW + ELASTIC_HIGH, "the elastic ones from both ramps", _both_ramps),
        Stage(VISCOUS, "the viscous ones from a step", lambda drives: _kinds(drives)[2], _apart),
    ),
    starts={"table-2": TABLE_II},
    safer=(lambda v: _stiffer(v, 1.2), lambda v: _stiffer(v, 1.5), lambda v: _stiffer(v, 1.8)),
    restart=VISCOUS,
    standard=standard,
    experiments=feasible,
    latent={channel: latent(channel) for channel in ("electrical", "mechanical", "pressure", "sensor")},
    own_channels=dict.fromkeys((*ELASTIC_LOW, *ELASTIC_HIGH, *VISCOUS), "mechanical") | {"eps_r": "electrical"},
    least_samples=50,
    shortest=0.3,
    coarsest=0.5,
    bandwidth=25.0,
)
