"""What is found from recordings that begin under load is a model as any other."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description

import tubular_dea as td
from tubular_dea.cli import main
from tubular_dea.plants.tube import PLANT


def loaded(folder: Path) -> Path:
    """Four recordings of the declared tube, held at 6 kPa for long before three of them begin."""
    folder.mkdir()
    random, time = np.random.default_rng(5), np.arange(0, 4, 0.004)
    for name, begins, rises, volts in (
        ("a", 0, 9e3, 0),
        ("b", 6e3, 9e3, 0),
        ("c", 6e3, 6e3, 4e3),
        ("d", 6e3, 8e3, 5e3),
    ):
        before = np.arange(-30, 0, 0.02) if begins else np.array([])
        whole = np.concatenate([before, time])
        pressure = np.interp(whole, [-30, -29, 0.5, 1.5, 2.5, 3.5], [0, begins, begins, rises, rises, begins])
        pressure = pressure + 400 * np.sin(8 * whole) * (whole > 0.5)
        voltage = np.where((whole > 1.002) & (whole < 3.002), volts, 0.0)
        run = td.simulate(PLANT, td.Protocol.of(whole, pressure=pressure, voltage=voltage), times=whole)
        kept = whole >= 0
        radius = 0.015 + run["measured_displacement"][kept] + 10e-6 * random.standard_normal(time.size)
        pressure = pressure[kept] + 15 * random.standard_normal(time.size)
        columns = {"time [s]": time, "pressure [Pa]": pressure, "voltage [V]": voltage[kept], "radius [m]": radius}
        table = np.column_stack([*columns.values()])
        np.savetxt(folder / f"{name}.csv", table, "%.7g", ",", header=",".join(columns), comments="")
    return folder


def test_the_model_can_be_loaded_again(tmp_path: Path) -> None:
    """The numbers of the recordings' own starts were written to model.json, and nothing could read it."""
    data, out = loaded(tmp_path / "data"), tmp_path / "out"
    assert main(["close-loop", str(data), "--out", str(out)]) == 0
    assert json.loads((out / "result.json").read_text())["verdict"] == "no_effect"
    model = td.load(out / "model.json")
    assert model.parameter_values().keys() == PLANT.model.parameter_values().keys()
    assert main(["simulate", "--model", str(out / "model.json"), "--pressure", "8 kPa", "--voltage", "0 V"]) == 0
    described = read_model_description(str(next((out / "fmi2").glob("*.fmu"))))
    assert not [v.name for v in described.modelVariables if "off_at_start" in v.name]
    assert "off_at_start" in (out / "lab.html").read_text()  # where each recording is drawn from its own start
    moved = {"start_at_equilibrium": 1.0, "sigma_vis1_off_at_start": -2e4}
    off = td.simulate(model, pressure="8 kPa", voltage="0 V", parameters=moved)  # as the page copies it
    settled = td.simulate(model, pressure="8 kPa", voltage="0 V", parameters={"start_at_equilibrium": 1.0})
    assert off["measured_displacement"].max() > settled["measured_displacement"].max() + 1e-5
    saved = json.loads((out / "model.json").read_text())
    saved["parameters"]["sigma_vis1_off_at_start"] = {"value": -2e4, "unit": "Pa"}
    (tmp_path / "from_the_page.json").write_text(json.dumps(saved))
    assert td.load(tmp_path / "from_the_page.json").parameter_values()["sigma_vis1_off_at_start"] == -2e4
    run = td.simulate(model, pressure="8 kPa", voltage="0 V")
    published = td.simulate(PLANT, pressure="8 kPa", voltage="0 V")
    assert run["measured_displacement"][-1] == pytest.approx(published["measured_displacement"][-1], rel=0.02)
