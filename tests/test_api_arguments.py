"""What the API is handed: each thing it cannot use is refused in one line that names the argument."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import tubular_dea as td

BENCH = Path(__file__).parents[1] / "cosim_examples" / "data" / "bench"
HELD = {"pressure": "95 mmHg", "voltage": "5 kV"}
REFUSED: dict[str, tuple[Callable[[Path], object], str]] = {
    "one effect": (
        lambda out: td.add_effects("tube", "electrode_resistance"),
        "effects: expected a list, as ['electrode_resistance'], but was given 'electrode_resistance' alone",
    ),
    "a model for a plant": (
        lambda out: td.add_effects(td.tube(), ["creep"]),
        "plant: expected a Plant, 'tube', 'aorta' or a FILE.py[:NAME] but was given a Model",
    ),
    "load": (lambda out: td.load(5), "path: expected a path but was given 5"),
    "save": (lambda out: td.save(5, out / "model.json"), "model: expected a Model but was given 5"),
    "save where": (lambda out: td.save(td.tube(), 5), "path: expected a path but was given 5"),
    "no recordings": (lambda out: td.read_recordings(None), "data: expected a path but was given None"),
    "discover": (lambda out: td.discover(5), "data: expected a path but was given 5"),
    "identify": (lambda out: td.identify([1, 2]), "data: expected a path but was given a list"),
    "sweep": (lambda out: td.sweep(5), "plan: expected a path but was given 5"),
    "workers": (lambda out: td.sweep({}, workers="two"), "workers: expected a whole number but was given 'two'"),
    "build": (lambda out: td.build_fmu(5, out / "x.fmu"), "model: expected a Model, a Plant or a file but was given 5"),
    "build where": (lambda out: td.build_fmu(td.tube(), 5), "path: expected a path but was given 5"),
    "platforms": (
        lambda out: td.build_fmu(td.tube(), out / "x.fmu", platforms=3),
        "platforms: expected a name or a list of names but was given 3",
    ),
    "tube effects": (lambda out: td.tube([3]), "effects: expected a list of names but was given [3]"),
    "one hold_out": (
        lambda out: td.discover(BENCH, hold_out="03_step_6kV"),
        "hold_out: expected a list, as ['03_step_6kV'], but was given '03_step_6kV' alone",
    ),
    "one free": (
        lambda out: td.identify(BENCH, free="C_1"),
        "free: expected a list, as ['C_1'], but was given 'C_1' alone",
    ),
    "free": (lambda out: td.identify(BENCH, free=5), "free: expected a list of names but was given 5"),
    "one column": (
        lambda out: td.read_recordings(BENCH, columns="radius=laser"),
        "columns: expected a list, as ['radius=laser'], but was given 'radius=laser' alone",
    ),
    "inputs": (
        lambda out: td.simulate(td.tube(), 3),
        "inputs: expected a Protocol, a file or inputs by name but was given 3",
    ),
    "no protocol": (
        lambda out: td.simulate(td.tube(), td.Protocol([], {})),
        "protocol: expected at least two finite times [s]",
    ),
    "no times": (lambda out: td.simulate(**HELD, times=[]), "times: expected at least one time [s] but was given none"),
    "times": (lambda out: td.simulate(**HELD, times="ab"), "times: expected numbers but was given 'ab'"),
    "tolerance": (lambda out: td.simulate(**HELD, tolerance="x"), "tolerance: expected a number but was given 'x'"),
    "no tolerance": (
        lambda out: td.simulate(**HELD, tolerance=None),
        "tolerance: expected a number but was given None",
    ),
    "signal": (lambda out: td.simulate(pressure=[1], voltage=0), "pressure: expected a number but was given a list"),
    "parameters": (
        lambda out: td.simulate(**HELD, parameters=[3]),
        "parameters: expected values by name, as in a dict, but was given a list",
    ),
    "protocol words": (
        lambda out: td.Protocol.of([0, 1], pressure="a"),
        "pressure: expected numbers but was given 'a'",
    ),
    "protocol times": (lambda out: td.Protocol.of(["now", 1]), "time: expected numbers but was given ['now', 1]"),
    "protocol rows": (
        lambda out: td.Protocol.of([0, 1], pressure=[[1], [1, 2]]),
        "pressure: expected numbers but was given [[1], [1, 2]]",
    ),
    "protocol inputs": (
        lambda out: td.Protocol([0.0, 1.0], [1.0, 2.0]),
        "inputs: expected values by name, as in a dict, but was given [1.0, 2.0]",
    ),
    "settings of a case": (
        lambda out: td.compare({"a": "voltage=4kV"}),
        "cases a: expected values by name, as in a dict, but was given 'voltage=4kV'",
    ),
    "no cases": (lambda out: td.compare([{}]), "cases: expected values by name, as in a dict, but was given a list"),
    "a table": (
        lambda out: td.read_recordings({"one": "one.csv"}),
        "data one: expected arrays by heading, as in a dict, but was given 'one.csv'",
    ),
    "a column of words": (
        lambda out: td.read_recordings({"one": {"time [s]": "abc"}}),
        "data one: time [s]: expected numbers but was given 'abc'",
    ),
    "a folder for tables": (lambda out: td.discover({"data": 1}), "data data: expected arrays by heading"),
    "a number for a name": (
        lambda out: td.assist(settings={3: 1}),
        "settings: expected a name, as 'name', but was given 3",
    ),
    "a number of a table": (
        lambda out: td.read_recordings({3: {}}),
        "data: expected a name, as 'name', but was given 3",
    ),
    "commands": (
        lambda out: td.handbook_page(commands="lab"),
        "commands: expected values by name, as in a dict, but was given 'lab'",
    ),
    "plant": (lambda out: td.load_plant(None), "plant: expected a Plant, 'tube', 'aorta' or a FILE.py"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(tmp_path: Path, case: str) -> None:
    call, said = REFUSED[case]
    with pytest.raises(td.UserError) as refusal:
        call(tmp_path)
    assert str(refusal.value).startswith(said)
    assert not any(tmp_path.iterdir())


def test_a_protocol_with_whole_times_drives_a_model() -> None:
    course = td.Protocol(np.array([0, 1, 1, 2]), {"pressure": [0, 0, 9000, 9000], "voltage": [0, 0, 0, 4000]})
    run = td.simulate(td.tube(), course)
    assert run["pressure"][100] == 9000
    assert "voltage 0 to 4 kV" in run.lines()[0]
