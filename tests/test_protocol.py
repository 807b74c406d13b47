"""Inputs: short specifications and CSV files, and what is said of bad ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tubular_dea.model.units import UnitError, factor, parse
from tubular_dea.protocol import Protocol, ProtocolError, from_specifications, read_csv
from tubular_dea.sweep.inputs import template

UNITS = {"pressure": "Pa", "voltage": "V"}


def test_units_convert() -> None:
    assert factor("mmHg", "Pa") == pytest.approx(133.322)
    assert factor("L/min", "m3/s") == pytest.approx(1e-3 / 60)
    assert factor("mL/mmHg", "m3/Pa") == pytest.approx(1e-6 / 133.322)
    assert parse("Pa.s").exponents == parse("kg/m/s").exponents


@pytest.mark.parametrize(
    ("written", "plain"),
    [
        ("kPa/(mL/min)", "kPa.min/mL"),  # it was kPa/(mL.min), and a right declaration was refused
        ("1/(K/J)", "J/K"),
        ("J/(kg.K)", "J/kg/K"),
        ("(W/m)/K", "W/m/K"),
        ("[ (W / m).K ]", "W.K/m"),
        ("V/(m/(s/A))", "V.s/m/A"),
        ("m.(s/(K/A))/V", "m.s.A/K/V"),
        ("(V)/(m)", "V/m"),
    ],
)
def test_units_with_brackets(written: str, plain: str) -> None:
    assert parse(written) == parse(plain)


@pytest.mark.parametrize("unit", ["barn", "mm Gh", "", "V//m", "m-", "(m/s)2", "kPa (abs)", "(kPa", "2(m)"])
def test_unknown_units_are_named(unit: str) -> None:
    with pytest.raises(UnitError, match="cannot read the unit"):
        parse(unit)


def test_units_of_another_dimension_are_refused() -> None:
    with pytest.raises(UnitError, match="expected a unit like 'Pa' but was given 'kV'"):
        factor("kV", "Pa")


def test_specifications_become_breakpoints() -> None:
    protocol = from_specifications(
        {"pressure": "ramp 0 95mmHg from 0.5 to 1", "voltage": "step 0 6 kV at 1000ms until 2 s"}, UNITS, 4.0
    )
    at = protocol.at(np.array([0.0, 0.75, 1.0, 1.999, 2.0, 4.0]))
    np.testing.assert_allclose(at["pressure"], 133.322 * 95 * np.array([0, 0.5, 1, 1, 1, 1]))
    np.testing.assert_allclose(at["voltage"], [0, 0, 6e3, 6e3, 0, 0])


@pytest.mark.parametrize("begin", ["0", "0.2", "100 ms"])
@pytest.mark.parametrize("stop", [0.25, 3.0, 3.3, 4.05])
def test_pulses_are_those_of_a_sweep(begin: str, stop: float) -> None:
    text = f"pulses 0 5 kV every 1 from {begin} for 0.3"
    ours = from_specifications({"voltage": text, "pressure": "ramp 0 95 mmHg from 0 to 0.25"}, UNITS, stop)
    swept = template("voltage", text, "V", Path()).breakpoints({}, np.array([stop]))
    theirs = Protocol(np.insert(swept.time[0], 0, 0.0), {"voltage": np.insert(swept.value[0], 0, 0.0)})
    times = np.linspace(0, stop, 1237)[:-1]
    assert np.array_equal(ours.at(times)["voltage"], theirs.at(times)["voltage"])
    np.testing.assert_allclose(ours.at(times)["pressure"], 95 * 133.322 * np.minimum(times / 0.25, 1))
    assert ours.time[-1] == stop and ours.time[0] == 0


@pytest.mark.parametrize(
    "text",
    [
        "",
        "x",
        "nan",
        "inf Pa",
        "95 barn",
        "step 0 1",
        "step 0 1 Pa at 5",
        "ramp 0 nan Pa from 0 to 1",
        "1 2 3",
        "step 0 1 Pa at 1kV",
        "step 0 1 Pa at x",
        "pulses 0 1 Pa",
        "pulses 0 1 every 1 from 0",
    ],
)
def test_bad_specifications_name_the_input(text: str) -> None:
    with pytest.raises(ProtocolError, match="^pressure: "):
        from_specifications({"pressure": text}, UNITS, 4.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("step 0 1 Pa at -3", "expected times from 0 s on but was given -3 s"),  # and not the end, which was not given
        ("ramp 0 1 Pa from -1 to 2", "expected times from 0 s on but was given -1 s"),
        ("step 0 1 Pa at 2 until 1", "expected times that rise but was given 2 and 1 s"),
        (
            "pulses 0 1 Pa every 1 from 5 for 0.1",
            "5 s is not before the end of the run (4 s); choose it earlier, or a later end",
        ),
        ("pulses 0 1 Pa every 1 from 0 for 1", "expected pulses of less than the 1 s between them but was given 1 s"),
        (
            "pulses 0 1 Pa every 1 ms from 0 for 0",
            "expected pulses of less than the 0.001 s between them but was given 0 s",
        ),
        ("pulses 0 1 Pa every 1 us from 0 for 1 ns", "expected at most 10000 pulses but was given 4e+06"),
        ("step 0 1 Pa at 9", "9 s is not before the end of the run (4 s); choose it earlier, or a later end"),
    ],
)
def test_times_are_told_as_they_were_given(text: str, said: str) -> None:
    with pytest.raises(ProtocolError) as refusal:
        from_specifications({"pressure": text}, UNITS, 4.0)
    assert str(refusal.value) == f"pressure: {said}"


def test_an_example_is_in_the_inputs_own_unit() -> None:
    for unit, example in {"m3/s": '"1 m3/s"', "1": '"1"', "V": '"5 kV"', "Pa": '"95 mmHg"'}.items():
        with pytest.raises(ProtocolError, match=f"cannot read 'x'; expected {example}, "):
            from_specifications({"drive": "x"}, {"drive": unit}, 4.0)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["time [s],pressure [Pa]", "0,1", "1,1"], "line 1: expected a column 'voltage"),
        (["time [s],pressure,voltage [V]", "0,1,2", "1,1,2"], "line 1: column 'pressure' names no unit"),
        (["time [s],pressure [kV],voltage [V]", "0,1,2", "1,1,2"], "line 1: column 'pressure': expected a unit like"),
        (["time [s],pressure [Pa],voltage [V]", "0,1,2", "1,x,2"], "line 3, column 'pressure': .* found 'x'"),
        (["time [s],pressure [Pa],voltage [V]", "0,1,2", "1,nan,2"], "line 3, column 'pressure': .* found 'nan'"),
        (["time [s],pressure [Pa],voltage [V]", "1,1,2", "0,1,2"], "line 3: time goes back from 1 to 0"),
        (["time [s],pressure [Pa],voltage [V]", "1,1,2"], "below it but found 1"),
        (["time [s],pressure [Pa],voltage [V]", "0,1,2", "1"], "line 3, column 'pressure': .* found ''"),
    ],
)
def test_bad_files_name_line_and_column(tmp_path: Path, lines: list[str], message: str) -> None:
    path = tmp_path / "inputs.csv"
    path.write_text("\n".join(lines))
    with pytest.raises(ProtocolError, match=message):
        read_csv(path, UNITS)


def test_a_file_of_another_encoding_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "inputs.csv"
    path.write_bytes("time [s],Druck [µPa]".encode("utf-16"))
    with pytest.raises(ProtocolError, match="cannot be read as a text file"):
        read_csv(path, UNITS)


def test_customary_units_are_read(tmp_path: Path) -> None:
    path = tmp_path / "inputs.csv"
    path.write_text("﻿time [ms], pressure [mmHg], voltage [kV], radius [mm]\r\n0,95,0,18\r\n1000,95,5,18\r\n")
    protocol = read_csv(path, UNITS)
    np.testing.assert_allclose(protocol.time, [0, 1])
    np.testing.assert_allclose(protocol.inputs["pressure"], 95 * 133.322)
    np.testing.assert_allclose(protocol.inputs["voltage"], [0, 5000])


def test_protocols_are_checked() -> None:
    with pytest.raises(ProtocolError, match="expected 2 values but was given 3"):
        Protocol.of([0, 1], pressure=[1, 2, 3])
    with pytest.raises(ProtocolError, match="do not descend"):
        Protocol.of([1, 0], pressure=[1, 2])
    with pytest.raises(ProtocolError, match="pressure: expected finite values but was given nan"):
        Protocol.of([0, 1], pressure=[1, float("nan")])


def test_a_breakpoint_more_changes_nothing() -> None:
    step = Protocol.of([0, 1, 1, 3], load=[0, 2, 5, 7])
    more = step.with_time(0.25)
    assert more.time.tolist() == [0, 0.25, 1, 1, 3]
    assert more.inputs["load"].tolist() == [0, 0.5, 2, 5, 7]
    assert step.with_time(1.0) is step


def test_a_held_input_keeps_each_row_until_the_next() -> None:
    recorded = Protocol.of([0, 1, 2, 3], u=[0, 4, 4, 1], p=[0, 10, 20, 30]).holding(["u"])
    times = [0, 0.99, 1, 1.5, 2.5, 2.999, 3]
    assert recorded.at(times)["u"].tolist() == [0, 0, 4, 4, 4, 4, 1]
    assert recorded.at(times)["p"] == pytest.approx([0, 9.9, 10, 15, 25, 29.99, 30])
    assert recorded.jumps.tolist() == [1, 3]  # where nothing jumps, nothing stops the solver


def test_a_mean_is_that_since_the_row_before() -> None:
    recorded = Protocol.of([0, 1, 2], rain=[7, 4, 1]).holding([], ["rain"])
    assert recorded.at([0.01, 0.99, 1, 1.99, 2])["rain"].tolist() == [4, 4, 1, 1, 1]


def test_an_edge_that_is_written_as_a_pair_of_rows_stays_what_it_is() -> None:
    """A saw tooth, and a level that two close rows end: the row before a jump is told, not held over."""
    given = Protocol.of([0, 1, 1, 2, 2.5, 2.500001, 3, 3], u=[0, 5, 1, 1, 1, 2, 3, 3])
    held = given.holding(["u"])
    times = [0, 0.5, 0.999, 1, 1.5, 2.25, 2.6]
    assert held.at(times)["u"] == pytest.approx([0, 2.5, 4.995, 1, 1, 1, 2.2], abs=1e-3)
    only_pairs = Protocol.of([0, 1, 1, 3], u=[0, 0, 5, 5])
    again = only_pairs.holding(["u"])
    assert again.time.tolist() == only_pairs.time.tolist()
    assert again.inputs["u"].tolist() == [0, 0, 5, 5]
