"""Plants of which an output follows the rate of a measured input: a dashpot whose stroke is recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.kernel import Kernel
from tubular_dea.plants import Build, Coefficient, Input, Output, Plant
from tubular_dea.plants import Path as Way
from tubular_dea.protocol import Protocol

STEP, DAMPING = 0.005, 950.0


def dashpot(of: str = "") -> Plant:
    m = Build("Dashpot", "A dashpot")
    stroke = m.input("stroke", "m", nominal=0.02)
    c = m.parameter("c", "N.s/m", 900.0, minimum=0)
    speed = m.define("speed", "m/s", m.rate(stroke), nominal=0.2)
    drag = m.define("drag", "N", c * speed, nominal=200)
    m.output("force", "N", drag, nominal=200)
    place = Coefficient("drag", of=of) if of else Coefficient("drag")
    return Plant(m.model(), [Input("stroke")], [Output("force")], places=[place, Way("force")])


def recorded(folder: Path, stroke_noise: float) -> Path:
    random, time = np.random.default_rng(5), np.arange(0.0, 6.0, STEP)
    for number in range(3):
        phase = (9 + 3 * number) * np.maximum(time - 0.5, 0)
        stroke = 0.01 * (1 - np.cos(phase)) + stroke_noise * random.standard_normal(time.size)
        force = DAMPING * 0.01 * (9 + 3 * number) * np.sin(phase) + random.standard_normal(time.size)
        rows = "\n".join(f"{t:.3f},{s:.9f},{f:.6f}" for t, s, f in zip(time, stroke, force, strict=True))
        (folder / f"{number}.csv").write_text(f"time [s],stroke [m],force [N]\n{rows}\n", encoding="utf-8")
    return folder


def test_a_rate_at_a_sample_is_that_of_both_sides() -> None:
    """The rate of either line alone is that of half a sample before or after it."""
    time = np.arange(0.0, 2.0, STEP)
    smooth = Protocol.of(time, stroke=0.01 * np.sin(9 * time))
    run = Kernel(dashpot().model).simulate(smooth, time[1:-1], {"c": DAMPING}, sensitivities=["c"])
    exact = 0.09 * np.cos(9 * time[1:-1])
    assert np.abs(run["force"] - DAMPING * exact)[:-1].max() < 0.05  # half a sample would be 1.9 N, as at the end
    assert np.abs(run.sensitivities["force"][:, 0] - exact)[:-1].max() < 1e-4
    assert np.array_equal(Kernel(dashpot().model).simulate(smooth, time[1:-1], {"c": DAMPING})["force"], run["force"])


def test_at_a_jump_a_rate_is_that_behind_it() -> None:
    jump = Protocol.of([0.0, 1.0, 1.0, 2.0], stroke=[0.0, 1.0, 5.0, 7.0])
    run = Kernel(dashpot().model).simulate(jump, np.array([0.5, 1.0, 1.5]), {"c": 1.0})
    assert run["force"].tolist() == pytest.approx([1.0, 2.0, 2.0])


@pytest.mark.parametrize("noise", [0.0, 2e-6])
def test_a_dashpot_alone_lacks_nothing(tmp_path: Path, noise: float) -> None:
    """Its force was half a sample early: a hysteresis was named, or a creep."""
    found = td.discover(recorded(tmp_path, noise), dashpot("speed"))
    assert found.verdict == "no_effect", found.headline
    c = found.parameters["c"]
    assert abs(c.value - DAMPING) < 4 * c.stderr < 2.0
