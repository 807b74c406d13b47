"""A delay of an input that switches between samples: all edges may be off alike, as far as none leaves its bounds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import tubular_dea as td
from tubular_dea.identify.study.instants import into_bounds
from tubular_dea.plants import Build, Input, Output, Plant
from tubular_dea.plants import Path as Way

DELAY, TAU, GAIN, STEP = 0.043, 0.11, 5.3e4, 0.01
NOISE = 400.0  # Pa
RESISTANCE, NOISE_OF_CURRENT = 5.4, 2e-3  # Ohm, A


def regulator(coil: bool = False) -> Plant:
    """A proportional regulator of pressure: of first order. The current of its `coil` follows the command at once."""
    m = Build("Regulator", "A proportional regulator of pressure", "tau dp/dt = G u - p")
    u = m.input("command", "V", "Command", nominal=7)
    gain = m.parameter("G", "Pa/V", 5e4, "Gain", minimum=0)
    tau = m.parameter("tau", "s", 0.08, "Time constant", minimum=1e-3)
    p = m.state("p", "Pa", "Pressure", start="free", nominal=3e5)
    m.derivative(p, (gain * u - p) / tau)
    m.output("pressure", "Pa", p, "Its sensor")
    outputs, places = [Output("pressure", zero=1e3)], [Way("command")]
    if coil:
        resistance = m.parameter("R", "Ohm", 5, "Resistance", minimum=1e-3)
        m.output("current", "A", (u - p / gain) / resistance, "Current of its coil", nominal=0.5)
        outputs.append(Output("current", zero=1e-3))
        places += [Way("current"), Way("pressure")]
    return Plant(m.model(), inputs=[Input("command", held=True)], outputs=outputs, places=places)


def record(random: np.random.Generator, coil: bool = False, delay: float = DELAY, before: float = -1.0) -> str:
    """A record of 12 s: the command switches at any time (or so long `before` a sample), and is sampled every 10 ms;
    the answer is exact."""
    times = np.arange(0.0, 12.0, STEP)
    switched = 1.5 + np.cumsum(random.uniform(0.8, 2.0, 6))
    switched = STEP * np.ceil(switched / STEP) - before if before >= 0 else switched
    levels = random.permutation([2.5, 3.5, 4.5, 5.5, 6.5, 7.0, 3.0])
    command = levels[np.searchsorted(switched, times, side="right")]
    pressure = np.full(times.size, GAIN * levels[0])
    for before, after, at in zip(levels[:-1], levels[1:], switched + delay, strict=True):
        pressure += GAIN * (after - before) * (1 - np.exp(-np.maximum(times - at, 0.0) / TAU))
    read = pressure + NOISE * np.sqrt(1 - 0.5**2) * lfilter([1.0], [1.0, -0.5], random.standard_normal(times.size))
    rows = [f"{t:.2f},{u},{p:.1f}" for t, u, p in zip(times, command, read, strict=True)]
    heading = "time [s],command [V],pressure [Pa]"
    if coil:
        late = levels[np.searchsorted(switched + delay, times, side="right")]
        current = (late - pressure / GAIN) / RESISTANCE + NOISE_OF_CURRENT * random.standard_normal(times.size)
        rows = [f"{row},{i:.5f}" for row, i in zip(rows, current, strict=True)]
        heading += ",current [A]"
    return "\n".join([heading, *rows])


def short_delays(folder: Path) -> td.RecordingSet:
    """Commands 2 ms late, which were switched 0.5 ms before a sample: there the coil has the old one still."""
    random = np.random.default_rng(5)
    folder.mkdir()
    for name in "abc":
        (folder / f"{name}.csv").write_text(record(random, True, delay=0.002, before=0.0005))
    return td.read_recordings(folder, regulator(coil=True))


@pytest.mark.long
def test_a_delay_shorter_than_a_sampling_interval_is_one(tmp_path: Path) -> None:
    """It was a moving average of the current, or a lag: the tangent at no delay changes no sample behind an edge."""
    found = td.discover(short_delays(tmp_path / "late"))
    first = found.effects[0]
    assert "delay(command)" in (first.id, *first.equivalent)
    assert not any("average" in name or "lag" in name for name in (first.id, *first.equivalent))


def test_limits_of_delays_are_no_nanoseconds(tmp_path: Path) -> None:
    """They were 0.2 us at 10 ms: what is known of an instant is between which two samples it was."""
    folder, random = tmp_path / "null", np.random.default_rng(6)
    folder.mkdir()
    for name in "abc":
        (folder / f"{name}.csv").write_text(record(random, True, delay=0.0))
    found = td.discover(td.read_recordings(folder, regulator(coil=True)))
    assert found.verdict == "no_effect"
    limits = found.discovery.limits
    edges = sum(len(p.driven.edges) for p in found.discovery.study.training)
    least = STEP * (1 - 0.2 ** (1 / edges))
    for name in ("delay(command)", "delay(current)"):
        (limit,) = limits[name].values()
        assert limit is not None and 0.99 * least <= limit < STEP


@pytest.mark.parametrize("seed", [3, 4])
def test_a_delay_is_where_no_edge_leaves_its_bounds(seed: int, tmp_path: Path) -> None:
    """It stayed 1.4 ms off, where fits began, with an interval of 0.1 ms."""
    random = np.random.default_rng(seed)
    for name in ("a", "b", "c"):
        (tmp_path / f"{name}.csv").write_text(record(random))
    (tmp_path / "bench.toml").write_text('[noise]\ncommand = "0 V"\n')
    found = td.discover(td.read_recordings(tmp_path, plant=regulator()))
    assert found.verdict in ("effect_found", "ambiguous")
    assert found.effects[0].id == "delay(command)"
    told = found.effects[0].parameters["command_delay"]
    low, high = told.ci95
    assert low < DELAY < high
    assert high - low < 0.6 * STEP


@pytest.mark.parametrize("seed", [3, 4])
def test_a_delay_is_found_behind_which_an_output_jumps_at_once(seed: int, tmp_path: Path) -> None:
    """Its samples jump one by one as the delay grows, and a fit stayed before the first of them: 36.8 and 34.2 ms, with
    a significant rest, or an echo of everything."""
    random = np.random.default_rng(seed)
    for name in ("a", "b", "c"):
        (tmp_path / f"{name}.csv").write_text(record(random, coil=True))
    (tmp_path / "bench.toml").write_text('[noise]\ncommand = "0 V"\n')
    found = td.discover(td.read_recordings(tmp_path, plant=regulator(coil=True)))
    assert found.verdict == "effect_found"
    assert [e.id for e in found.effects] == ["delay(command)"]
    told = found.effects[0].parameters["command_delay"]
    low, high = told.ci95
    assert low < DELAY < high
    assert abs(told.value - DELAY) < 0.15 * STEP


@pytest.mark.parametrize(
    ("shifts", "by"),
    [([-0.2, 0.1], 0.0), ([0.3, 0.8], -0.3), ([-1.4, -0.9], 0.4), ([-1.5, 0.5], 0.25)],
    ids=["inside", "late", "early", "wider than bounds"],
)
def test_edges_are_moved_no_farther_than_into_their_bounds(shifts: list[float], by: float) -> None:
    found = into_bounds(np.array(shifts), np.ones(2), np.full(2, -1.0), np.full(2, 0.5))
    assert found == pytest.approx(by, abs=1e-3)
