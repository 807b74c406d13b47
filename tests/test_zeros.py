"""A zero that no sensor has is not what explains a file."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.discover.alternatives import zeros
from tubular_dea.plants import Balance, Build, Input, Output, Path, Plant

TIME = 0.01 * np.arange(600)


def plant() -> Plant:
    """A spring that is pulled, and a gauge with a zero."""
    m = Build("Spring")
    pull = m.input("pull", "N", nominal=10.0)
    softness = m.parameter("softness", "m/N", 0.01, minimum=1e-5)
    m.output("stretch", "m", softness * pull, nominal=0.1)
    return Plant(
        m.model(), [Input("pull", held=True)], [Output("stretch", zero=1e-3)], places=[Path("pull"), Path("stretch")]
    )


def recorded(shifted: float) -> td.Recordings:
    """Four files of steps with zeros of the usual size, in the last one `shifted` [m] more."""
    random = np.random.default_rng(1)
    tables = {}
    for number, size in enumerate((4.0, 8.0, 12.0, 9.0)):
        pull = np.where((TIME > 1) & (TIME < 4), size, 0.5 * size * (TIME >= 4))
        zero = 1e-3 * random.standard_normal() + shifted * (number == 3)
        read = 0.011 * pull + zero + 1e-4 * random.standard_normal(TIME.size)
        tables[f"file {number}"] = {"time [s]": TIME, "pull [N]": pull, "stretch [m]": read}
    return td.read_recordings(tables, plant=plant())


def test_usual_zeros_are_no_effect_and_are_told_for_each_record() -> None:
    found = td.discover(recorded(0.0))
    assert found.verdict == "no_effect"
    drawn = np.random.default_rng(1)  # as `recorded` draws them: a zero, then the noise of its record
    for number in range(4):
        zero = 1e-3 * drawn.standard_normal()
        drawn.standard_normal(TIME.size)
        told = found.content["records"][f"file {number}"]
        assert told == {"start": {}, "zeros": {"stretch": pytest.approx(zero, abs=5e-5)}, "gains": {}}


def test_starts_and_zeros_of_records_give_the_error_again() -> None:
    """The model with what a record has of its own, by the kernel alone."""
    m = Build("Lag", "A vessel that fills")
    inflow = m.input("inflow", "m3/s", nominal=1e-4)
    tau = m.parameter("tau", "s", 1.0, minimum=0.01)
    resistance = m.parameter("resistance", "s/m2", 1e3, tunable=False)
    level = m.state("level", "m", start="free", nominal=0.1)
    m.derivative(level, (resistance * inflow - level) / tau)
    m.output("reading", "m", level, nominal=0.1)
    vessel = Plant(m.model(), [Input("inflow", zero=2e-6)], [Output("reading", zero=1e-3)], [Path("reading")])
    drawn, tables = np.random.default_rng(4), {}
    for name in "abc":
        inflow = np.interp(TIME, [0, 1, 2, 3, 4, 6], drawn.uniform(2e-5, 2e-4, 6))
        values = {"tau": 1.3, "level_start": drawn.uniform(0.05, 0.15)}
        read = td.Kernel(vessel.model).simulate(td.Protocol.of(TIME, inflow=inflow), TIME, values)["reading"]
        read = read + 1e-3 * drawn.standard_normal() + 1e-4 * drawn.standard_normal(TIME.size)
        recorded = inflow + 4e-6 * drawn.standard_normal()
        tables[name] = {"time [s]": TIME, "inflow [m3/s]": recorded, "reading [m]": read}
    found = td.discover(td.read_recordings(tables, vessel))
    kernel = td.Kernel(found.model)
    for name, table in tables.items():
        own = found.content["records"][name]
        drive = td.Protocol.of(TIME, inflow=table["inflow [m3/s]"] - own["zeros"]["inflow"])
        again = kernel.simulate(drive, TIME, own["start"])["reading"] + own["zeros"]["reading"]
        error = float(np.sqrt(np.mean((again - table["reading [m]"]) ** 2)))
        told = found.content["error"]["after"]["per_experiment"][name]["rmse"]
        assert told <= error < 1.25 * told  # gains of a thousandth and delays of 0.2 ms are not in it


def test_a_zero_that_all_files_have_in_common_is_no_effect_where_no_rest_shows_it() -> None:
    """A thermistor of a Peltier cooler that is 1.5 times its usual zero off: an offset of the block's balance."""
    m = Build("Block", "A block that is heated in air")
    power, air = m.input("power", "W", nominal=20.0), m.input("air", "K", nominal=300.0)
    loss = m.parameter("loss", "W/K", 0.5, minimum=0.01)
    heat = m.parameter("heat", "J/K", 20.0, tunable=False)
    warmth = m.state("warmth", "K", start="free", nominal=300.0)
    m.derivative(warmth, (power - loss * (warmth - air)) / heat)
    m.output("reading", "K", warmth)
    inputs, places = [Input("power", held=True), Input("air", zero=0)], [Balance("warmth"), Path("reading")]
    block = Plant(m.model(), inputs, [Output("reading", zero=0.1)], places)
    time, drawn, tables = np.arange(600.0), np.random.default_rng(2), {}
    for name in "abcd":
        levels, air_now = (
            drawn.uniform(0, 20, 6),
            296 + drawn.uniform(-2, 2) + 0.5 * np.sin(time / drawn.uniform(60, 90)),
        )
        heated = np.repeat(levels, 100)
        own = {"loss": 0.55, "warmth_start": 300 + drawn.uniform(0, 10)}
        protocol = td.Protocol.of(time, power=heated, air=air_now)
        read = td.Kernel(block.model).simulate(protocol, time, own)["reading"]
        read = read + 0.15 + 0.005 * drawn.standard_normal() + 0.02 * drawn.standard_normal(time.size)
        tables[name] = {"time [s]": time, "power [W]": heated, "air [K]": air_now, "reading [K]": read}
    found = td.discover(td.read_recordings(tables, block))
    assert found.verdict == "no_effect"
    assert all(own["zeros"]["reading"] == pytest.approx(0.15, abs=0.02) for own in found.content["records"].values())


@pytest.mark.parametrize("hold_out", [["file 1"], ["file 3"]], ids=["in training", "held out"])
def test_a_file_with_an_impossible_zero_is_not_explained(hold_out: list[str]) -> None:
    found = td.discover(recorded(0.04), hold_out=hold_out)
    assert found.verdict == "unexplained"
    said = next(line for line in found.lines() if "too much" in line)
    assert "file 3" in said
    assert "stretch" in said
    assert found.content["residual"]["remainder"]["rms"] == pytest.approx(0.04, rel=0.1)


@pytest.mark.parametrize(
    ("effect", "size", "usual"),
    [
        ("offset(pull)", 0.09, True),
        ("offset(pull)", -0.09, True),
        ("offset(pull)", 0.11, False),
        ("gain(pull)", 0.09, False),
        ("offset(stretch)", 0.09, False),
    ],
)
def test_an_offset_as_zeros_are_is_no_effect(effect: str, size: float, usual: bool) -> None:
    declared = SimpleNamespace(
        plant=plant(),
        catalogue={effect: SimpleNamespace(hard=(), off={"size": 0.0})},
        zero=lambda name: {"pull": 0.2, "stretch": 1e-3}.get(name, 0.0),
    )
    fitted = SimpleNamespace(fitted=SimpleNamespace(values={"size": size}, names=["size"]))
    assert zeros.as_usual(declared, fitted, effect) is usual
