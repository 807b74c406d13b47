"""The page of a closed loop over recordings that begin under load: each is drawn from its own start."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lab_page import Page, commands, opened, python, table

from test_start_under_load import loaded
from tubular_dea.cli import main


@pytest.fixture(scope="module")
def closed(tmp_path_factory: pytest.TempPathFactory) -> Page:
    """The page that `close-loop` writes, in a browser of its own."""
    folder = tmp_path_factory.mktemp("loaded")
    assert main(["close-loop", str(loaded(folder / "data")), "--out", str(folder / "out")]) == 0
    page = opened(folder / "out" / "lab.html", folder)
    yield page
    page.driver.quit()


def test_every_recording_is_followed_and_its_commands_can_be_carried_out(closed: Page, tmp_path: Path) -> None:
    """The kernels were compiled without the parameters of the starts: "there is no rest state" in every file."""
    closed.open()
    closed.show("data")
    closed.wait("lab.D.runs && !lab.D.latest.busy")
    for name, on in (("a", []), ("c", []), ("d", ["electrode_resistance"])):
        closed.run("lab.change('data', (s) => { s.data.on = given[0]; });", on)
        closed.run("lab.change('data', (s) => { s.data.shown = given[0]; });", name)
        closed.wait("lab.D.runs && !lab.D.latest.busy")
        got = closed.run(
            """
            const k = lab.D.experiments.findIndex((e) => e.name === given[0]), e = lab.D.experiments[k];
            const run = lab.D.runs[k], model = run.values.measured_displacement;
            const left = e.outputs.measured_displacement.map((v, i) => v - model[i]);
            return { command: lab.command(), python: lab.python(), time: Array.from(run.time), model: Array.from(model),
                     reason: run.reason, rmse: 1e6 * Math.sqrt(left.reduce((a, v) => a + v * v, 0) / left.length) };
            """,
            name,
        )
        assert not got["reason"] and (on or got["rmse"] < 20), got["reason"]  # the laser's noise is 10 um
        folder = tmp_path / name
        folder.mkdir()
        commands(folder, got["command"])
        made = table(folder / "run" / "response.csv")
        at = np.interp(made["time"], got["time"], got["model"])
        assert np.sqrt(np.mean((made["measured_displacement"] - at) ** 2)) < 2e-7
        (folder / "figure.py").write_text(got["python"])
        assert float(python(folder).split()[-2]) == pytest.approx(got["rmse"], rel=1e-3)
    assert closed.messages() == []
