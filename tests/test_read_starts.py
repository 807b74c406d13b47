"""Fits begin where a sensor reads an unknown start, and are begun there again if they end far from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.identify.study.read_starts import begins_elsewhere, read_starts
from tubular_dea.identify.study.study import PRIOR, Study, study
from tubular_dea.plants import Build, Input, Output, Path, Plant

BEGAN, NOISE = 3.0, 0.01


def cup() -> Plant:
    """A cup that cools: its temperature is read, and that of its wall, of which only a half is seen, is not."""
    m = Build("Cup", "A cup that cools")
    room = m.input("room", "degC", nominal=20.0)
    rate = m.parameter("rate", "1/s", 0.2, minimum=1e-3)
    temperature = m.state("temperature", "degC", start="free", nominal=5.0)
    wall = m.state("wall", "degC", start="free", nominal=5.0)
    m.derivative(temperature, rate * (wall - temperature))
    m.derivative(wall, rate * (room - wall))
    m.output("inside", "degC", temperature)
    m.output("outside", "degC", wall / 2)
    return Plant(m.model(), [Input("room")], [Output("inside", zero=0.1), Output("outside")], [Path("inside")])


def work(outlier: float = 0.0) -> Study:
    random, time = np.random.default_rng(1), np.arange(400) * 0.1
    tables = {}
    for name in ("one", "two"):
        inside = BEGAN + np.sin(time) + NOISE * random.standard_normal(time.size)
        inside[0] += outlier
        outside = 1.0 + np.cos(time) + NOISE * random.standard_normal(time.size)
        columns = {"time [s]": time, "room [degC]": 20.0 + np.sin(time), "inside [degC]": inside}
        tables[name] = columns | {"outside [degC]": outside}
    return study(td.read_recordings(tables, plant=cup()), [], PRIOR)


@pytest.mark.parametrize("outlier", [0.0, 5.0])
def test_a_start_is_read_where_a_sensor_reads_its_state(outlier: float) -> None:
    found = work(outlier)
    for piece in found.pieces:
        assert read_starts(found.plant, piece.case, piece.record) == {
            "temperature_start": pytest.approx(BEGAN, abs=0.25)
        }
        assert piece.case.own["temperature_start"] == pytest.approx(BEGAN, abs=0.25)
        assert piece.case.own["wall_start"] == found.plant.model.parameter_values()["wall_start"]


def test_a_reading_that_begins_later_tells_no_start() -> None:
    found = work()
    case = found.pieces[0].case
    later = replace(case, readings=tuple(r.where(r.times > 1.0) for r in case.readings))
    assert read_starts(found.plant, later, found.pieces[0].record) == {}


@pytest.mark.parametrize(("by", "elsewhere"), [(0.3, False), (0.9, True), (-0.9, True)])
def test_beyond_a_zero_and_noise_a_start_is_elsewhere(by: float, elsewhere: bool) -> None:
    found = work()
    pieces = [
        replace(p, case=replace(p.case, own={**p.case.own, "temperature_start": p.case.own["temperature_start"] + by}))
        for p in found.pieces
    ]
    assert begins_elsewhere(found, pieces) is elsewhere
