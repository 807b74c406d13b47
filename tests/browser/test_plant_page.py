"""Pages of other plants: whatever a plant file declares is played, compared with records, and has its effects."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from lab_page import Page, commands, table

from tubular_dea.api.recordings import read_recordings
from tubular_dea.cli import main
from tubular_dea.kernel import Kernel
from tubular_dea.lab.opened import closed_loop
from tubular_dea.lab.page import write
from tubular_dea.plants.load import load_plant
from tubular_dea.protocol import Protocol

LOOP = Path(__file__).parents[2] / "cosim_examples" / "plants" / "mock_loop.py"
TANKS = Path(__file__).parents[2] / "cosim_examples" / "plants" / "cascaded_tanks.py"


@pytest.mark.long
def test_a_plant_file_gets_its_page(browser: Page, tmp_path: Path) -> None:
    path, plant = tmp_path / "tanks.html", load_plant(str(TANKS))
    assert main(["lab", "--plant", str(TANKS), "--out", str(path)]) == 0
    drive = Protocol.of([0.0, 10.0, 10.0, 60.0], pump=[2.0, 2.0, 6.0, 6.0])
    recorded = Kernel(plant.model).simulate(drive, np.arange(0.0, 60.0, 0.25), {"k1": 0.03})
    pump = np.where(recorded.time < 10, 2.0, 6.0)
    lines = [
        "time [s],pump [V],level_2 [V]",
        *(f"{t:.3f},{u:.12g},{y:.12g}" for t, u, y in zip(recorded.time, pump, recorded["level_2"], strict=True)),
    ]
    assert browser.requests() == []  # of the page that was open until now
    own = browser.path
    try:
        browser.path = path
        browser.open()
        assert "Ctrl+Alt+1, 2: views" in browser.run("return document.querySelector('footer').textContent;")
        titled = "lab.facts.tube.effects.push('slow_leak'); const t = lab.pageTitle(); lab.facts.tube.effects.pop();"
        assert browser.run(f"{titled} return t;") == f"{plant.model.name} lab · with slow leak"
        values = browser.run(
            "lab.compute(); const r = lab.T.result; return [Array.from(r.run.time),"
            " Array.from(r.run.values.level_2), r.drive.time, r.drive.inputs.pump];"
        )
        played = Kernel(plant.model).simulate(Protocol.of(values[2], pump=values[3]), np.array(values[0]))
        assert np.array_equal(played["level_2"], values[1])
        simulated = browser.run("return lab.command();")
        browser.show("data")
        assert browser.run("return lab.facts.effects.map((e) => e.id);") == list(plant.catalogue)
        text = "\n".join(lines)
        browser.run(
            "await lab.takeFiles([new File([given[0]], 'tanks.csv')]);"
            "lab.change('data', (s) => { s.data.set.k1 = 0.03; });",
            text,
        )
        browser.wait("lab.D.runs && !lab.D.latest.busy && !lab.D.same")
        left = browser.run(
            "return Math.max(...lab.D.runs[0].values.level_2.map("
            "(v, i) => Math.abs(v - lab.D.experiments[0].outputs.level_2[i])));"
        )
        assert left < 1e-5
        compared = browser.run("return lab.command();")
        assert browser.messages() == [] and browser.requests() == []
    finally:
        browser.close()
        browser.path = own
    commands(tmp_path, simulated)
    again = table(tmp_path / "run" / "response.csv")
    np.testing.assert_allclose(np.interp(again["time"], values[0], values[1]), again["level_2"], rtol=1e-6)
    commands(tmp_path, compared)
    again = table(tmp_path / "run" / "response.csv")
    np.testing.assert_allclose(
        np.interp(recorded.time, again["time"], again["level_2"]), recorded["level_2"], rtol=1e-5
    )
    made = json.loads((tmp_path / "model.json").read_text())
    assert (made["plant"], made["parameters"]["k1"]["value"]) == (str(TANKS), 0.03)


def test_a_recording_starts_where_the_fit_found_it(browser: Page, tmp_path: Path) -> None:
    plant, time = load_plant(str(LOOP)), np.arange(0.0, 8.0, 0.01)
    flow = 1e-4 * (1 + np.sin(2 * np.pi * time))
    begun = {"p_C_start": 9000.0}
    true = Kernel(plant.model).simulate(Protocol.of(time, flow=flow), time, begun)["pressure"]
    noise = 0.1 * np.random.default_rng(1).standard_normal(time.size)
    read = {"time [s]": time, "flow [m3/s]": flow + 1e-9 * noise, "pressure [Pa]": true + noise}
    content = closed_loop(
        read_recordings({"beats": read}, plant), plant.model, {}, {"model": "", "data": ""}, {"beats": begun}
    )
    own = browser.path
    try:
        browser.path = write(tmp_path / "loop.html", content)
        browser.open()
        browser.show("data")
        left = (
            "const [run] = lab.D.runs, recorded = lab.D.experiments[0].outputs.pressure;"
            "const reached = Array.from(run.values.pressure.slice(0, run.rows));"
            "return Math.max(...reached.map((v, i) => Math.abs(v - recorded[i])));"
        )
        assert browser.run(left) < 1.0
        assert "--set p_C_start=9000" in browser.run("return lab.command();")
        browser.run("lab.change('data', (s) => { s.data.set.p_C_start = 0; });")  # by hand
        browser.wait("lab.D.runs && !lab.D.latest.busy && !lab.D.same")
        assert browser.run(left) > 8000.0
        assert browser.messages() == []
    finally:
        browser.close()
        browser.path = own
