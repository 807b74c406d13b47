"""The page's numbers against the kernel's and the commands' own, and its take-aways carried out."""

from __future__ import annotations

import json
import random
from pathlib import Path

import numpy as np
import pytest
from lab_page import Page, commands, python, table

from tubular_dea.kernel import Kernel
from tubular_dea.protocol import from_specifications

UNITS = {"pressure": "Pa", "voltage": "V"}
COMPARED = ("lambda_2", "sigma_vis1", "radial_displacement", "electric_field", "snap_through_pressure", "tube_volume")


def settings(n: int) -> list[dict]:
    """Random inputs and parameters, in the customary units in which they are typed."""
    draw = random.Random(14)
    found = []
    for _ in range(n):
        high, volts = round(draw.uniform(40, 105), 1), round(draw.uniform(0.5, 6.4), 2)
        begin, end = round(draw.uniform(0, 1.5), 2), round(draw.uniform(2, 3.9), 2)
        ramp = {"kind": "ramp", "low": 0, "high": high, "from": 0, "to": round(draw.uniform(0.3, 3), 2)}
        step = {"kind": "step", "low": 0, "high": volts, "at": begin, "until": end}
        changed = {
            "C_1": round(draw.uniform(300, 380), 2),
            "eps_r": round(draw.uniform(2.2, 3.2), 3),
            "k_1": round(draw.uniform(10, 30), 3),
            "eta_o": round(draw.uniform(500, 900), 2),
        }
        rest = {"inputs": {"pressure": ramp, "voltage": step}, "stop": 4, "set": changed}
        if draw.random() < 0.3:
            rest["set"] |= {"start_at_equilibrium": 1}
            rest["inputs"]["pressure"] = {"kind": "step", "low": 80, "high": high, "at": 0.5, "until": 2.5}
        found.append(rest)
    return found


def in_words(spec: dict, unit: str) -> str:
    if spec["kind"] == "ramp":
        return f"ramp {spec['low']} {spec['high']} {unit} from {spec['from']} to {spec['to']}"
    return f"step {spec['low']} {spec['high']} {unit} at {spec['at']} until {spec['until']}"


def test_fifty_random_settings_equal_the_kernel_to_the_last_bit(page: Page, kernel: Kernel) -> None:
    factors = {"C_1": 1e3, "k_1": 1e6, "eta_o": 1e3}
    for setting in settings(50):
        got = page.run(
            """
            lab.adopt(lab.merged(lab.defaults(), { tube: given[0] }, ""));
            lab.compute();
            const { run } = lab.T.result;
            if (run.reason) throw new Error(run.reason);
            const every = (values) => Array.from(values).filter((_, i) => i % 8 === 0);
            const of = (n) => n === "time" ? run.time : run.values[n];
            return Object.fromEntries(["time", ...given[1]].map((n) => [n, every(of(n))]));
        """,
            setting,
            COMPARED,
        )
        words = {
            name: in_words(spec, {"pressure": "mmHg", "voltage": "kV"}[name])
            for name, spec in setting["inputs"].items()
        }
        protocol = from_specifications(words, UNITS, 4.0)
        values = {name: value * factors.get(name, 1.0) for name, value in setting["set"].items()}
        # What was not sampled makes no difference; the page samples eight times as finely.
        wanted = kernel.simulate(protocol, np.array(got["time"]), values, with_fold=True)
        for name in COMPARED:
            assert np.array_equal(wanted[name], got[name]), (setting, name)


BY_HAND = {"time": [0, 0.5, 1.2, 1.25, 3.0], "pressure": [0, 80, 80, 95, 95], "voltage": [0, 0, 4.5, 5, 5]}


@pytest.mark.long
@pytest.mark.parametrize(
    "inputs",
    [
        {},
        {"pressure": {"kind": "beat", "low": 70, "high": 110, "rate": 66}, "voltage": {"kind": "beat", "high": 4.5}},
        {"pressure": {"kind": "hand", "level": 95}, "voltage": {"kind": "hand", "level": 5}},
    ],
    ids=["step and ramp", "beats", "by hand"],
)
def test_the_copied_tube_command_computes_the_figure_again(page: Page, tmp_path: Path, inputs: dict) -> None:
    hand = any(spec.get("kind") == "hand" for spec in inputs.values())
    tube = {"inputs": inputs, "set": {"eps_r": 2.5, "r_o": 14.5}} | ({"record": BY_HAND} if hand else {})
    got = page.run(
        """
        lab.T.playing = false;
        lab.adopt(lab.merged(lab.defaults(), { tube: given[0] }, ""));
        lab.compute();
        const { run } = lab.T.result;
        return { command: lab.command(), python: lab.python(), time: Array.from(run.time),
                 values: Array.from(run.values.radial_displacement),
                 margin: Array.from(run.values.snap_through_margin) };
    """,
        tube,
    )
    page.close()
    commands(tmp_path, got["command"])
    made = table(tmp_path / "run" / "response.csv")
    n = min(len(got["time"]), made["time"].size)
    assert n > 500
    np.testing.assert_allclose(made["time"][:n], got["time"][:n], atol=1e-9)
    np.testing.assert_allclose(made["radial_displacement"][:n], got["values"][:n], rtol=2e-9, atol=1e-12)
    np.testing.assert_allclose(made["snap_through_margin"][:n], got["margin"][:n], rtol=1e-9, atol=1e-6)
    (tmp_path / "figure.py").write_text(got["python"])
    assert python(tmp_path).split()[0] == f"{1e3 * max(got['values']):.4f}"


@pytest.mark.long
@pytest.mark.parametrize(
    "heart",
    [
        {"beats": 8},
        {
            "beats": 10,
            "rhythm": "premature",
            "patient": "stiff",
            "set": {"scheduler.voltage_on": 5, "scheduler.on_fraction": -0.05, "heart.C": 0.7},
        },
    ],
    ids=["regular", "premature"],
)
def test_the_copied_heart_command_finds_the_same_indices(page: Page, tmp_path: Path, heart: dict) -> None:
    page.show("heart")
    page.run(
        "lab.H.result = null; lab.H.asked = ''; lab.adopt(lab.merged(lab.defaults(), given[0], ''));",
        {"view": "heart", "heart": heart},
    )
    page.wait("lab.H.result")
    got = page.run("""
        return { command: lab.command(), python: lab.python(), course: lab.H.result.course,
                 told: document.getElementById("heart-told").textContent };
    """)
    page.close()
    commands(tmp_path, got["command"])
    summary = json.loads((tmp_path / "assisted" / "summary.json").read_text())
    assert got["told"] == summary["verdict"]["text"]
    (tmp_path / "figure.py").write_text(got["python"])
    assert python(tmp_path).startswith(got["told"])
    assert {n: got["course"]["counted"][n] for n in summary["scheduler"]} == summary["scheduler"]
    for name, wanted in summary["figures"].items():
        for page_name, cli_name in (("without", "without"), ("with", "with")):
            ours, theirs = got["course"][page_name].get(name), wanted[cli_name]
            assert ours["mean"] == pytest.approx(theirs["mean"], rel=2e-5, abs=1e-9), name
            assert ours["worst"] == pytest.approx(theirs["worst"], rel=2e-5, abs=1e-9), name


@pytest.mark.long
def test_the_copied_data_command_and_python_leave_the_same_residual(page: Page, tmp_path: Path) -> None:
    page.run(
        "lab.adopt(lab.merged(lab.defaults(), given[0], ''));",
        {
            "view": "data",
            "data": {"shown": "08_heartbeat_5kV", "on": ["electrode_resistance"], "set": {"tau_e": 20, "C_1": 320}},
        },
    )
    page.wait("lab.D.runs && lab.D.before && !lab.D.same && !lab.D.latest.busy")
    got = page.run("""
        const k = lab.D.experiments.findIndex((e) => e.name === "08_heartbeat_5kV");
        const e = lab.D.experiments[k], run = lab.D.runs[k], model = run.values.measured_displacement;
        const left = e.outputs.measured_displacement.map((v, i) => v - model[i]);
        return { command: lab.command(), python: lab.python(), time: Array.from(run.time), model: Array.from(model),
                 rmse: 1e6 * Math.sqrt(left.reduce((a, v) => a + v * v, 0) / left.length) };
    """)
    page.close()
    commands(tmp_path, got["command"])
    made = table(tmp_path / "run" / "response.csv")
    at = np.interp(made["time"], got["time"], got["model"])
    assert np.sqrt(np.mean((made["measured_displacement"] - at) ** 2)) < 2e-8  # the CSV's times lie a little beside
    (tmp_path / "figure.py").write_text(got["python"])
    assert float(python(tmp_path).split()[-2]) == pytest.approx(got["rmse"], rel=1e-4)
