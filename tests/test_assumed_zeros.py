"""Zeros of which the plant says nothing are no effects, and one that says that there are none is believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.discover.alternatives.assumed_zeros import SHARE, with_assumed
from tubular_dea.identify.study.study import study
from tubular_dea.plants import Balance, Build, Coefficient, Input, Output, Path, Plant

TIME = 0.02 * np.arange(500)
NOISE = 0.02  # m


def vessel(**output: float) -> Plant:
    """A vessel that drains, filled by a flow that is measured."""
    m = Build("Vessel")
    inflow = m.input("inflow", "m3/s", nominal=1.0)
    area = m.parameter("area", "m2", 0.5, minimum=0.01)
    loss = m.parameter("loss", "m2/s", 0.3, minimum=1e-3)
    level = m.state("level", "m", start="free", nominal=4.0)
    outflow = m.define("outflow", "m3/s", loss * level)
    m.derivative(level, (inflow - outflow) / area)
    m.output("reading", "m", level, nominal=4.0)
    places = [Path("inflow"), Coefficient("outflow", of="level"), Balance("level"), Path("reading")]
    return Plant(m.model(), [Input("inflow", zero=0.0)], [Output("reading", **output)], places)


def recorded(plant: Plant, zeros: list[float], effect: str = "", **size: float) -> td.Recordings:
    """Files of random inflows, each of them with a zero of the gauge."""
    random, tables = np.random.default_rng(12), {}
    model = plant.catalogue[effect](plant.model) if effect else plant.model
    for number, zero in enumerate(zeros):
        inflow = np.interp(TIME, np.linspace(1, 10, 12), np.append(0.0, random.uniform(0.0, 1.5, 11)))
        values = {"area": 0.45, "loss": 0.33, "level_start": 0.0} | size
        read = td.Kernel(model).simulate(td.Protocol.of(TIME, inflow=inflow), TIME, values)["reading"]
        read = read + zero + NOISE * random.standard_normal(TIME.size)
        tables[f"file {number}"] = {"time [s]": TIME, "inflow [m3/s]": inflow, "reading [m]": read}
    return td.read_recordings(tables, plant)


ZEROS = [0.06, -0.05, 0.01, -0.06, 0.04]  # m, three times the noise


@pytest.mark.long
def test_zeros_that_nobody_declared_are_no_effect() -> None:
    found = td.discover(recorded(vessel(), ZEROS), hold_out=["file 4"])
    assert found.verdict == "no_effect"
    said = next(line for line in found.content["remarks"] if "zeros of its own" in line)
    assert 'Output("reading", zero=...)' in said
    assert "zero=0" in said
    own = [found.content["records"][f"file {i}"]["zeros"]["reading"] for i in range(len(ZEROS))]
    assert own == pytest.approx(ZEROS, abs=0.02)


def test_zeros_that_are_ruled_out_are_not_assumed() -> None:
    found = td.discover(recorded(vessel(zero=0.0), ZEROS), hold_out=["file 4"])
    assert found.verdict != "no_effect"
    assert not any("zeros of its own" in line for line in found.content["remarks"])


@pytest.mark.long
@pytest.mark.parametrize(("zeros", "assumed"), [(ZEROS, True), ([0.0] * len(ZEROS), False)], ids=["zeros", "none"])
def test_an_effect_is_named_beside_such_zeros_or_without(zeros: list[float], assumed: bool) -> None:
    """Without them `dependence(outflow)` and a remainder were named, and with larger ones two false effects."""
    power = {next(iter(vessel().catalogue["power(outflow)"].off)): 1.6}
    found = td.discover(recorded(vessel(), zeros, "power(outflow)", **power), hold_out=["file 4"])
    assert found.verdict in ("effect_found", "ambiguous")
    assert "power(outflow)" in {i for e in found.effects for i in (e.id, *e.equivalent)}
    assert len(found.effects) == 1
    assert any("zeros of its own" in line for line in found.content["remarks"]) is assumed


def test_assumed_zeros_are_a_share_of_what_a_signal_moves_by() -> None:
    plant = vessel()
    known = study(recorded(plant, [0.0] * 3), [], None)
    allowed = with_assumed(known)
    assert allowed is not None
    assert allowed.assumed == ["reading"]
    span = np.ptp(np.concatenate([p.record for p in known.pieces]))
    assert 0.7 * SHARE * span < allowed.zero("reading") <= SHARE * span
    declared = replace(known, plant=vessel(zero=0.01))
    assert with_assumed(declared) is None
    switched = replace(plant, inputs=[Input("inflow", held=True)])
    held = with_assumed(replace(known, plant=switched))
    assert held is not None
    assert held.zero("inflow") == 0.0  # what was set has no sensor
    assert held.assumed == ["reading"]
