"""Long gaps in a record: what comes after one is an experiment of its own where an input moves meanwhile."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tubular_dea import RecordingSet, identify, read_recordings
from tubular_dea.identify.records import gaps
from tubular_dea.identify.study.study import study
from tubular_dea.model.declare import DeclarationError
from tubular_dea.plants import Build, Input, Output, Plant

TIME = np.arange(400.0)
RANDOM = np.random.default_rng(11)
STAIRS = 100.0 * RANDOM.uniform(size=400)
RARELY = np.where(TIME > 300, 100.0, 0.0)
SMOOTH = 50.0 + 0.1 * TIME


def room(remembers: bool = True, **kind: bool) -> Plant:
    """A heated room, or a heater's surface that follows at once."""
    m = Build("Room")
    heat, gain = m.input("heat", "W", nominal=100.0), m.parameter("gain", "K/W", 0.01)
    if remembers:
        T = m.state("T", "K", start="free", nominal=1.0)
        m.derivative(T, (gain * heat - T) / m.parameter("tau", "s", 30.0))
    m.output("reading", "K", T if remembers else gain * heat, nominal=1.0)
    return Plant(m.model(), [Input("heat", **(kind or {"held": True}))], [Output("reading")])


def record(heat: np.ndarray, *lost: tuple[int, int]) -> dict[str, np.ndarray]:
    """A record of the room without the samples from the first to before the second of each pair."""
    kept = np.ones(TIME.size, dtype=bool)
    for first, last in lost:
        kept[first:last] = False
    response = np.convolve(0.01 * heat, np.exp(-TIME / 30) / 30)[: TIME.size]
    noisy = response + 1e-3 * np.random.default_rng(2).standard_normal(TIME.size)
    return {"time [s]": TIME[kept], "heat [W]": heat[kept], "reading [K]": noisy[kept]}


def parts(found: RecordingSet) -> list[tuple[str, int]]:
    return [(e.name, e.time.size) for e in found.experiments]


def test_what_comes_after_a_long_gap_is_an_experiment_of_its_own() -> None:
    found = read_recordings({"a": record(STAIRS, (150, 165)), "b": record(STAIRS)}, room())
    assert parts(found) == [("a", 150), ("a_part2", 235), ("b", 400)]
    assert found.starts == {"a": "rested", "a_part2": "unknown", "b": "rested"}
    (said,) = (r for r in found.remarks() if "missing" in r)
    assert "15 samples are missing after sample 150, near where heat moves" in said and "start is unknown" in said
    work = study(found, ["a"])
    assert [p.name for p in work.held_out] == ["a", "a_part2"]  # both are kept aside
    assert [*work.unknown((), work.pieces[1])] == ["T_start"]  # as every record has one


@pytest.mark.parametrize(
    "whole",
    [
        lambda: read_recordings({"a": record(STAIRS, (150, 156))}, room()),  # brief
        lambda: read_recordings({"a": record(RARELY, (150, 165))}, room()),  # nothing moves about it
        lambda: read_recordings({"a": record(SMOOTH, (150, 165))}, room(held=False)),  # the line across it is right
        lambda: read_recordings({"a": record(STAIRS, (150, 165))}, room(remembers=False)),
    ],
)
def test_a_gap_at_which_nothing_is_unknown_is_none(whole: Callable[[], RecordingSet]) -> None:
    found = whole()
    assert [e.name for e in found.experiments] == ["a"] and not [r for r in found.remarks() if "missing" in r]


RAMP = np.clip(TIME - 130.0, 0.0, 40.0)  # it ends while nothing is read


@pytest.mark.parametrize(
    ("heat", "empty", "parted"),
    [
        (STAIRS, slice(150, 165), True),
        (RAMP, slice(150, 190), True),
        (SMOOTH, slice(150, 190), False),
        (STAIRS, slice(150, 156), False),
    ],
)
def test_empty_cells_of_an_input_are_lost_samples_where_it_moves(heat: np.ndarray, empty: slice, parted: bool) -> None:
    """A line across them would be heat that nobody recorded, for as long as they are."""
    table = record(heat)
    table["heat [W]"] = table["heat [W]"].copy()
    table["heat [W]"][empty] = np.nan
    found = read_recordings({"a": table}, room(held=False))
    count = empty.stop - empty.start
    assert parts(found) == ([("a", 150), ("a_part2", 250 - count)] if parted else [("a", 400)])


def test_an_input_that_was_read_less_often_has_no_gaps() -> None:
    table = record(STAIRS)
    table["heat [W]"] = np.where(TIME % 20 == 0, table["heat [W]"], np.nan)
    table["heat [W]"][::2] = STAIRS[::2]  # every other sample, then
    assert parts(read_recordings({"a": table}, room())) == [("a", 400)]


def test_samples_that_are_rare_for_a_while_are_no_gaps() -> None:
    """A recorder that writes fewer lines while nothing happens: after a switching, and before the next one."""
    kept = np.unique(np.concatenate([np.arange(0, 120), np.arange(120, 280, 12), np.arange(280, 400)]))
    heat = np.where((TIME > 90) & (TIME < 119) | (TIME > 285), 100.0, 0.0)
    columns = {name: values[kept] for name, values in record(heat).items()}
    assert parts(read_recordings({"a": columns}, room())) == [("a", kept.size)]


def test_parts_that_are_too_short_are_left_out_and_said() -> None:
    found = read_recordings({"a": record(STAIRS, (5, 20), (150, 165))}, room())
    assert parts(found) == [("a", 130), ("a_part2", 235)]
    assert found.starts["a"] == "unknown"
    assert any("5 samples between gaps are too few" in r for r in found.remarks())


def test_a_state_that_starts_at_a_known_value_does_not_after_a_gap() -> None:
    m = Build("Tank")
    flow, h = m.input("flow", "m3/s", nominal=100.0), m.state("h", "m", start=0.0, nominal=1.0)
    m.derivative(h, m.parameter("gain", "1/m2", 3e-4) * flow - h / m.parameter("tau", "s", 30.0))
    m.output("reading", "m", h)
    tank = Plant(m.model(), [Input("flow", held=True)], [Output("reading")])
    columns = dict(zip(("time [s]", "flow [m3/s]", "reading [m]"), record(STAIRS, (150, 165)).values(), strict=True))
    work = study(read_recordings({"a": columns, "b": columns}, tank))
    assert [[*work.unknown((), p)] for p in work.pieces] == [[], ["h_off_at_start"]] * 2


def test_a_meters_value_is_the_mean_over_the_time_before_it() -> None:
    heat = np.repeat(STAIRS[:40], 10)
    metered = np.append(0.0, heat[:-1])  # written at the end of every second
    told = read_recordings({"a": record(metered)}, room(held=True, mean=True))
    (piece,) = {p.source: p for p in study(told).pieces}.values()
    between = TIME[:-1] + 0.5
    np.testing.assert_allclose(piece.driven.protocol.at(between)["heat"], heat[:-1])
    with pytest.raises(DeclarationError, match=r"Input\('heat'\): expected held=True beside mean=True"):
        Input("heat", mean=True)


def test_of_a_static_law_what_is_remembered_under_a_load_is_unknown() -> None:
    """A relaxing branch behind it is loaded or relaxed there, and the first reading is the same."""
    loaded = {"a": record(RARELY), "b": record(RARELY + 40.0)}
    assert read_recordings(loaded, room(remembers=False)).starts == {"a": "rested", "b": "unknown"}
    assert read_recordings(loaded, room()).starts == {"a": "rested", "b": "rested"}  # with a free start of its own


def test_what_is_hardly_read_between_gaps_is_left_out_there() -> None:
    """Neither a part without any reading, nor a second sensor's single one, ends in an error."""
    whole, plant = record(STAIRS, (150, 165)), room()
    late = whole["time [s]"] > 160
    lost = whole | {"reading [K]": np.where(late, np.nan, whole["reading [K]"])}
    found = read_recordings({"a": lost}, plant)
    assert parts(found) == [("a", 150)] and "235 samples between gaps are too few" in " ".join(found.remarks())
    identify(found, starts=1)
    m = Build("Room")
    heat, T = m.input("heat", "W", nominal=100.0), m.state("T", "K", start="free", nominal=1.0)
    m.derivative(T, (m.parameter("gain", "K/W", 0.01) * heat - T) / m.parameter("tau", "s", 30.0))
    m.output("reading", "K", T)
    m.output("second", "K", 0.5 * T)
    two = Plant(m.model(), [Input("heat", held=True)], [Output("reading"), Output("second", required=False)])
    once = np.where(late, np.nan, 0.5 * whole["reading [K]"])
    once[np.flatnonzero(late)[3]] = 0.1
    found = read_recordings({"a": whole | {"second [K]": once}, "b": record(STAIRS)}, two)
    assert "1 readings of second between gaps are too few" in " ".join(found.remarks())
    assert not np.isfinite(found["a_part2"].outputs["second"]).any()
    identify(found, starts=1)


def test_noise_about_a_gap_is_no_movement() -> None:
    """A voltage that was never switched on, of a monitor with 5 V of noise: its files were cut in two."""
    noise = 5.0 * np.random.default_rng(6).standard_normal(4000) - 12.0
    assert gaps._moves(noise, Input("voltage", held=True), 1500, 35)
    assert not gaps._moves(noise, Input("voltage", held=True, most=1e5), 1500, 35)
    assert gaps._moves(noise + 4e3 * (np.arange(4000) > 1520), Input("voltage", held=True, most=1e5), 1500, 35)
