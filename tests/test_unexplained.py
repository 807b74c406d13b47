"""Where nothing explains a residual, the base model is handed out with intervals as `identify` gives them."""

from __future__ import annotations

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.identify.signals.colour import Colour
from tubular_dea.plants import Build, Input, Output, Path, Plant

TIME, SAMPLES = 0.1 * np.arange(500), 500


def tank() -> Plant:
    """A tank that empties through a pipe; somebody else opens and closes a tap, which nobody recorded."""
    m = Build("Tank")
    flow, h = m.input("flow", "m3/s", nominal=1.0), m.state("h", "m", nominal=1.0)
    gain, tau = m.parameter("gain", "1/m2", 0.5, minimum=0.01), m.parameter("tau", "s", 2.0, minimum=0.1)
    m.derivative(h, gain * flow - h / tau)
    m.output("level", "m", h)
    return Plant(m.model(), [Input("flow", held=True)], [Output("level")], [Path("flow"), Path("level")])


def record(seed: int) -> dict[str, np.ndarray]:
    random = np.random.default_rng(seed)
    flow = random.uniform(0, 2, 50)[np.arange(SAMPLES) // 10] * (TIME >= 5)
    tap = 0.3 * Colour(0.97).sample(SAMPLES, random) * (TIME >= 5)
    h = np.zeros(SAMPLES)
    for k in range(1, SAMPLES):  # exact between samples, as both are held there
        level = 2.0 * (0.5 * flow[k - 1] + 0.5 * tap[k - 1])
        h[k] = level + (h[k - 1] - level) * np.exp(-0.1 / 2.0)
    return {"time [s]": TIME, "flow [m3/s]": flow, "level [m]": h + 2e-3 * random.standard_normal(SAMPLES)}


@pytest.mark.long
def test_what_nothing_explains_leaves_intervals_as_wide_as_identify_gives_them() -> None:
    """They were a seventh as wide in a building with visitors and sun: those of white noise."""
    fitted = {name: record(seed) for seed, name in enumerate(("a", "b", "c"))}
    found = td.discover(td.read_recordings(fitted | {"kept": record(9)}, tank()), hold_out=["kept"])
    assert found.verdict == "unexplained"
    told = td.identify(td.read_recordings(fitted, tank())).parameters
    for name, parameter in found.parameters.items():
        assert parameter.value == pytest.approx(told[name].value, abs=told[name].stderr)
        assert parameter.stderr == pytest.approx(told[name].stderr, rel=0.5)
